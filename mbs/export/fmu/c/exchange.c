/* Model exchange: the integrator is outside. */
#include "internal.h"

#include <math.h>
#include <string.h>

core_status core_enter_event_mode(core *c) {
    if (!core_allowed(c, CONTINUOUS, "entering event mode")) return CORE_ERROR;
    c->m.mode = EVENT;
    return CORE_OK;
}

core_status core_update_discrete_states(core *c) {
    return core_allowed(c, EVENT, "updating discrete states") ? CORE_OK : CORE_ERROR;
}

core_status core_enter_continuous_mode(core *c) {
    if (!core_allowed(c, EVENT, "entering continuous-time mode")) return CORE_ERROR;
    c->m.mode = CONTINUOUS;
    return CORE_OK;
}

core_status core_completed_step(core *c) {
    core_status status;
    if (!core_allowed(c, CONTINUOUS, "completing a step")) return CORE_ERROR;
    if (!NZ) return CORE_OK;
    status = core_refresh(c);
    return status ? status
                  : core_accept_posture(c, c->m.values + STATES, c->m.values + DEPENDENTS);
}

core_status core_set_time(core *c, double time) {
    if (!core_allowed(c, EVENT | CONTINUOUS, "setting the time")) return CORE_ERROR;
    if (!isfinite(time)) return core_refuse(c, "%s: time %g is not finite", c->name, time);
    if (time != c->m.time) c->m.stale = 1;
    c->m.time = time;
    return CORE_OK;
}

static int counted(core *c, const void *array, size_t n) {
    if (n == NX && (array || !n)) return 1;
    core_refuse(c, "%s: %d states were asked for; it has %d", c->name, (int)n, NX);
    return 0;
}

core_status core_set_states(core *c, const double *x, size_t n) {
    size_t i;
    if (!core_allowed(c, CONTINUOUS, "setting the states") || !counted(c, x, n)) return CORE_ERROR;
    for (i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return core_refuse(c, "%s: %s = %g is not finite", c->name, MODEL_NAMES[i], x[i]);
    if (memcmp(c->m.values + STATES, x, n * sizeof *x)) c->m.stale = 1;
    memcpy(c->m.values + STATES, x, n * sizeof *x);
    return CORE_OK;
}

core_status core_get_states(core *c, double *x, size_t n) {
    if (!core_allowed(c, INITIALIZATION | EVENT | CONTINUOUS | TERMINATED, "getting the states") ||
        !counted(c, x, n))
        return CORE_ERROR;
    memcpy(x, c->m.values + STATES, n * sizeof *x);
    return CORE_OK;
}

core_status core_get_derivatives(core *c, double *xdot, size_t n) {
    core_status status;
    if (!core_allowed(c, INITIALIZATION | EVENT | CONTINUOUS | TERMINATED, "getting derivatives") ||
        !counted(c, xdot, n))
        return CORE_ERROR;
    status = core_refresh(c);
    memcpy(xdot, c->m.values + DERIVATIVES, n * sizeof *xdot);
    return status;
}

core_status core_get_nominals(core *c, double *nominal, size_t n) {
    if (!counted(c, nominal, n)) return CORE_ERROR;
    memcpy(nominal, MODEL_NOMINAL + STATES, n * sizeof *nominal);
    return CORE_OK;
}
