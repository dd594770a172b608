/* Co-simulation, with an integrator inside the FMU. */
#include "internal.h"

#include <math.h>

/* Call the intermediate update of the host, which may request an earlier end of the step. */
static void let_look(core *c, double *end) {
    double until = *end;
    int asked;
    if (!c->watch) return;
    c->m.mode = INTERMEDIATE;
    asked = c->watch(c->host, c->m.time, c->early_return, &until);
    c->m.mode = STEP;
    if (asked && c->early_return) *end = fmax(c->m.time, fmin(*end, until));
}

/* Internal steps up to the end, or to the first event if the host handles events. */
static core_status run(core *c, double end, core_stop *stop) {
    int hand_over = c->event_mode && c->early_return, changed;
    double until = end;
    core_status status = CORE_OK;
    while (!status && !stop->event && (c->m.time < until || core_pending(c))) {
        status = core_pending(c) ? core_settle(c, &changed) : core_step(c, until);
        stop->event = !status && hand_over && core_pending(c);
        if (!status) let_look(c, &until);
    }
    stop->early = !status && c->m.time < end;
    return status;
}

core_status core_do_step(core *c, double time, double h, core_stop *stop) {
    double end = time + h;
    core_status status;
    stop->event = stop->early = 0;
    if (!core_allowed(c, STEP, "a step")) return CORE_ERROR;
    if (!isfinite(end) || !(h > 0.0))
        return core_refuse(c, "%s: step %g at time %g must be positive", c->name, h, time);
    if (fabs(time - c->m.time) > SAME_TIME * fmax(1.0, fabs(time)))
        return core_refuse(c, "%s: the step starts at time %.12g; the model is at %.12g", c->name,
                           time, c->m.time);
    if (core_before_stop(c, end) || core_check_rules(c)) return CORE_ERROR;
    core_prepare_solver(c);
    c->solver.since_output = 0;
    core_begin_inputs(c);
    c->m.stale = 1;
    status = run(c, end, stop);
    if (!status && !stop->early) c->m.time = end;
    core_end_inputs(c);
    return status;
}

core_status core_enter_step_mode(core *c) {
    core_status status;
    int changed;
    if (!core_allowed(c, c->m.cosimulation ? EVENT : 0, "entering step mode")) return CORE_ERROR;
    status = core_settle(c, &changed);
    if (!status) c->m.mode = STEP;
    return status;
}
