/* Co-simulation: the integrator is inside. */
#include "internal.h"

#include <math.h>

static core_status step_failed(core *c, int status) {
    static const char *const reason[] = {
        "", "", "too many steps", "the step size became too small",
        "the loops cannot be closed or the equations have no solution (unclosable or singular "
        "posture)", "the projection failed", "a derivative is not finite (singular posture?)"};
    return core_no_answer(c, "%s: integration stopped at time %.9g with step %.3g: %s", c->name,
                     c->m.time, stepper_wanted_step(&c->solver), reason[status]);
}

core_status core_do_step(core *c, double time, double h) {
    double *x = c->m.values + STATES, end = time + h;
    int status = STEPPER_OK;
    if (!core_allowed(c, STEP, "a step")) return CORE_ERROR;
    if (!isfinite(end) || !(h > 0.0))
        return core_refuse(c, "%s: step %g at time %g must be positive", c->name, h, time);
    if (fabs(time - c->m.time) > 1e-9 * fmax(1.0, fabs(time)))
        return core_refuse(c, "%s: the step starts at time %.12g; the model is at %.12g", c->name,
                           time, c->m.time);
    c->solver.rtol = c->solver.atol = c->m.tolerance;
    c->solver.since_output = 0;
    c->m.stale = 1;
    while (!status && stepper_time(&c->solver) < end) {
        status = stepper_step(&c->solver, x, end);
        c->m.time = stepper_time(&c->solver);
        if (!status && core_accept_posture(c, x, c->z)) return CORE_ERROR;
    }
    if (status) return step_failed(c, status);
    c->m.time = end;
    return CORE_OK;
}
