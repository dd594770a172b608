/* Co-simulation, with an integrator inside the FMU. */
#include <math.h>

#include "core.h"
#include "event_mode.h"
#include "internal_step.h"

/* Call the intermediate update of the importer, which may request an earlier end of the step. */
static void update_importer(core *c, double *end) {
    core_run *run = &c->m.run;
    double until = *end;
    int asked;
    if (!c->host.watch) return;
    run->mode = INTERMEDIATE;
    asked = c->host.watch(c->log.host, run->time, c->host.early_return, &until);
    run->mode = STEP;
    if (asked && c->host.early_return) *end = fmax(run->time, fmin(*end, until));
}

/* Internal steps up to the end [s], or to the first event if the importer handles events. */
static core_status run_to(core *c, double end, core_stop *stop) {
    int hand_over = c->host.event_mode && c->host.early_return, changed;
    double until = end;
    core_status status = CORE_OK;
    while (!status && !stop->event && (c->m.run.time < until || event_is_pending(&c->events))) {
        status = event_is_pending(&c->events) ? event_mode_iterate(&c->events, &changed)
                                              : internal_step(&c->events, until);
        stop->event = !status && hand_over && event_is_pending(&c->events);
        if (!status) update_importer(c, &until);
    }
    stop->early = !status && c->m.run.time < end;
    return status;
}

core_status core_do_step(core *c, double time, double h, core_stop *stop) {
    double end = time + h, now = c->m.run.time;
    core_inputs *inputs = &c->m.inputs;
    core_status status;
    stop->event = stop->early = 0;
    if (!log_allowed(&c->log, STEP, "a step")) return CORE_ERROR;
    if (!isfinite(end) || !(h > 0.0))
        return log_error(&c->log, "step %g at time %g must be positive", h, time);
    if (fabs(time - now) > SAME_TIME * fmax(1.0, fabs(time)))
        return log_error(&c->log, "the step starts at time %.12g; the model is at %.12g", time,
                         now);
    if (core_check_stop(c, end) || machine_check_rules(&c->machine)) return CORE_ERROR;
    solver_prepare(&c->solver);
    c->solver.stepper.since_output = 0;
    if (inputs->motion == INPUTS_MOVED) { /* the importer gave no derivatives for this step */
        inputs_hold(inputs);
        internal_step_restart(&c->events);
    }
    c->m.variables.stale = 1;
    status = run_to(c, end, stop);
    if (!status && !stop->early) c->m.run.time = end;
    inputs_end_step(inputs, c->m.variables.values + INPUTS, c->m.run.time);
    return status;
}

core_status core_enter_step_mode(core *c) {
    core_status status;
    int changed;
    if (!log_allowed(&c->log, c->m.run.cosimulation ? EVENT : 0, "entering step mode"))
        return CORE_ERROR;
    status = event_mode_iterate(&c->events, &changed);
    if (!status) c->m.run.mode = STEP;
    return status;
}

/* Check the reference, order and value of a derivative of an input. */
static core_status settable_slope(core_log *l, core_reference ref, int order, double value) {
    if (ref < INPUTS || ref >= OUTPUTS)
        return log_error(l, "value reference %u is no input; only inputs are interpolated",
                         (unsigned)ref);
    if (order < 1 || order > INPUT_ORDERS)
        return log_error(l, "derivative %d of %s is not followed; use orders 1 to %d", order,
                         MODEL_NAMES[ref], INPUT_ORDERS);
    if (!isfinite(value))
        return log_error(l, "derivative %d of %s = %g is not finite", order, MODEL_NAMES[ref],
                         value);
    return CORE_OK;
}

core_status core_set_input_slopes(core *c, const core_reference *ref, size_t n,
                                  const core_integer *order, const double *values) {
    core_inputs *inputs = &c->m.inputs;
    size_t i;
    if (!log_allowed(&c->log, c->m.run.cosimulation ? INITIALIZATION | STEP : 0,
                     "setting derivatives of inputs"))
        return CORE_ERROR;
    if (n && (!ref || !order || !values)) return log_error(&c->log, "the array is NULL");
    for (i = 0; i < n; i++)
        if (settable_slope(&c->log, ref[i], (int)order[i], values[i])) return CORE_ERROR;
    if (!n) return CORE_OK;
    if (inputs->motion == INPUTS_MOVED) inputs_hold(inputs);
    for (i = 0; i < n; i++)
        inputs_set_slope(inputs, (int)(ref[i] - INPUTS), (int)order[i], values[i], c->m.run.time);
    internal_step_restart(&c->events);
    return CORE_OK;
}
