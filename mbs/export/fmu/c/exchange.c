/* Model exchange, with an external integrator, and event mode, also of co-simulation. */
#include "internal.h"

#include "charts.h"
#include "guard.h"

#include <math.h>
#include <string.h>

core_status core_enter_event_mode(core *c) {
    int from = c->m.cosimulation ? STEP : CONTINUOUS;
    if (c->m.cosimulation && !c->event_mode)
        return core_refuse(c, "%s: the instance was made without event mode; its events are "
                           "handled inside", c->name);
    if (!core_allowed(c, from, "entering event mode") || core_before_stop(c, c->m.time))
        return CORE_ERROR;
    if (!c->m.cosimulation) {
        core_status status = core_refresh(c);
#if MODEL_TREE_OUTSIDE
        if (!status) status = charts_pause(c);
#else
        if (!status) status = core_accept_configuration(c, c->m.values + STATES, c->m.values + DEPENDENTS);
        if (!status) status = guard_pass(c);
#endif
        if (status) return status;
    }
    c->m.mode = EVENT;
    return CORE_OK;
}

core_status core_update_discrete_states(core *c, int *changed) {
    *changed = 0;
    if (!core_allowed(c, EVENT, "updating discrete states")) return CORE_ERROR;
#if MODEL_TREE_OUTSIDE
    if (!c->m.cosimulation) return charts_update(c, changed);
#endif
    return core_settle(c, changed);
}

core_status core_enter_continuous_mode(core *c) {
    if (!core_allowed(c, c->m.cosimulation ? 0 : EVENT, "entering continuous-time mode"))
        return CORE_ERROR;
    if (core_check_rules(c)) return CORE_ERROR;
    c->m.mode = CONTINUOUS;
#if MODEL_TREE_OUTSIDE
    if (c->m.charts.tangent) return CORE_OK;
#endif
    return guard_restart(c);
}

core_status core_completed_step(core *c, int *event) {
    core_status status;
    *event = 0;
    if (!core_allowed(c, CONTINUOUS, "completing a step") || core_before_stop(c, c->m.time))
        return CORE_ERROR;
    if (!NZ && !NK) return CORE_OK;
#if MODEL_TREE_OUTSIDE
    status = core_arm_indicators(c);
    if (!status) status = charts_completed(c, event);
#else
    status = core_arm_indicators(c);
    if (!status) status = core_accept_configuration(c, c->m.values + STATES, c->m.values + DEPENDENTS);
    if (!status) status = guard_pass(c);
#endif
    return status;
}

core_status core_set_time(core *c, double time) {
    if (!core_allowed(c, c->m.cosimulation ? 0 : EVENT | CONTINUOUS, "setting the time"))
        return CORE_ERROR;
    if (!isfinite(time)) return core_refuse(c, "%s: time %g is not finite", c->name, time);
    if (c->m.mode == EVENT && core_before_stop(c, time)) return CORE_ERROR;
    if (time != c->m.time) c->m.stale = 1;
    c->m.time = time;
    return CORE_OK;
}

#define NOT_STEPPING (INITIALIZATION | EVENT | CONTINUOUS | TERMINATED)

static int counted(core *c, const void *array, size_t n, int count, const char *what) {
    if (n == (size_t)count && (array || !n)) return 1;
    core_refuse(c, "%s: %d %s were asked for; it has %d", c->name, (int)n, what, count);
    return 0;
}

core_status core_set_states(core *c, const double *x, size_t n) {
    size_t i;
    if (!core_allowed(c, CONTINUOUS, "setting the states") || !counted(c, x, n, NX, "states"))
        return CORE_ERROR;
    for (i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return core_refuse(c, "%s: %s = %g is not finite", c->name, MODEL_NAMES[OUTSIDE + i],
                               x[i]);
    if (memcmp(c->m.values + OUTSIDE, x, n * sizeof *x)) c->m.stale = 1;
    memcpy(c->m.values + OUTSIDE, x, n * sizeof *x);
    return CORE_OK;
}

core_status core_get_states(core *c, double *x, size_t n) {
    if (!core_allowed(c, NOT_STEPPING, "getting the states") ||
        !counted(c, x, n, NX, "states"))
        return CORE_ERROR;
    memcpy(x, c->m.values + (c->m.mode == INITIALIZATION ? (int)STATES : (int)OUTSIDE),
           n * sizeof *x);
    return CORE_OK;
}

core_status core_get_derivatives(core *c, double *xdot, size_t n) {
    core_status status;
    if (!core_allowed(c, NOT_STEPPING, "getting derivatives") ||
        !counted(c, xdot, n, NX, "states"))
        return CORE_ERROR;
    status = core_refresh(c);
    memcpy(xdot, c->m.values + OUTSIDE_RATES, n * sizeof *xdot);
    return status;
}

core_status core_get_nominals(core *c, double *nominal, size_t n) {
    if (!counted(c, nominal, n, NX, "states")) return CORE_ERROR;
    memcpy(nominal, MODEL_NOMINAL + STATES, n * sizeof *nominal);
    return CORE_OK;
}

core_status core_get_indicators(core *c, double *indicators, size_t n) {
    core_status status;
    if (!core_allowed(c, NOT_STEPPING, "getting event indicators") ||
        !counted(c, indicators, n, NK + NC, "event indicators"))
        return CORE_ERROR;
#if MODEL_TREE_OUTSIDE
    status = core_show_indicators(c);
    if (!status) status = charts_show_indicator(c);
    indicators[NK] = c->m.values[CHART];
#else
    status = core_show_indicators(c);
#endif
    memcpy(indicators, c->m.values + INDICATORS, NK * sizeof *indicators);
    return status;
}
