/* Model exchange, with an external integrator, and event mode, also of co-simulation. */
#include <math.h>
#include <string.h>

#include "calculated.h"
#include "chart_choice.h"
#include "configuration.h"
#include "core.h"
#include "event_mode.h"
#include "guard.h"

#define NOT_STEPPING (INITIALIZATION | EVENT | CONTINUOUS | TERMINATED)

#if !MODEL_TREE_OUTSIDE
/* Accept the calculated configuration, if the motion to it passes no singular configuration. */
static core_status accept_present(machine *m) {
    const double *v = m->values;
    core_status status = configuration_accept(m, v + STATES, v + DEPENDENTS);
    return status ? status : guard_pass(m);
}
#endif

core_status core_enter_event_mode(core *c) {
    int external = !c->m.run.cosimulation, from = external ? CONTINUOUS : STEP;
    if (!external && !c->host.event_mode)
        return log_error(&c->log,
                         "the instance was made without event mode; its events are handled inside");
    if (!log_allowed(&c->log, from, "entering event mode") || core_check_stop(c, c->m.run.time))
        return CORE_ERROR;
    if (external) {
        core_status status = calculate(&c->solver);
#if MODEL_TREE_OUTSIDE
        if (!status) status = chart_choice_enter_event_mode(&c->solver);
#else
        if (!status) status = accept_present(&c->machine);
#endif
        if (status) return status;
    }
    c->m.run.mode = EVENT;
    return CORE_OK;
}

core_status core_update_discrete_states(core *c, int *changed) {
    *changed = 0;
    if (!log_allowed(&c->log, EVENT, "updating discrete states")) return CORE_ERROR;
#if MODEL_TREE_OUTSIDE
    if (!c->m.run.cosimulation) return chart_choice_update(&c->events, changed);
#endif
    return event_mode_iterate(&c->events, changed);
}

core_status core_enter_continuous_mode(core *c) {
    if (!log_allowed(&c->log, c->m.run.cosimulation ? 0 : EVENT, "entering continuous-time mode"))
        return CORE_ERROR;
    if (machine_check_rules(&c->machine)) return CORE_ERROR;
    c->m.run.mode = CONTINUOUS;
#if MODEL_TREE_OUTSIDE
    if (c->solver.charts->tangent) return CORE_OK;
#endif
    return guard_restart(&c->machine);
}

core_status core_completed_step(core *c, int *event) {
    core_status status;
    *event = 0;
    if (!log_allowed(&c->log, CONTINUOUS, "completing a step") || core_check_stop(c, c->m.run.time))
        return CORE_ERROR;
    if (!NZ && !NK) return CORE_OK;
    status = event_mode_arm_indicators(&c->events);
#if MODEL_TREE_OUTSIDE
    if (!status) status = chart_choice_completed_step(&c->solver, event);
#else
    if (!status) status = accept_present(&c->machine);
#endif
    return status;
}

core_status core_set_time(core *c, double time) {
    core_run *run = &c->m.run;
    if (!log_allowed(&c->log, run->cosimulation ? 0 : EVENT | CONTINUOUS, "setting the time"))
        return CORE_ERROR;
    if (!isfinite(time)) return log_error(&c->log, "time %g is not finite", time);
    if (run->mode == EVENT && core_check_stop(c, time)) return CORE_ERROR;
    if (time != run->time) c->m.variables.stale = 1;
    run->time = time;
    return CORE_OK;
}

/* Return 1 if an array has `count` elements, else 0 after an error message. what: its content. */
static int counted(core_log *l, const void *array, size_t n, int count, const char *what) {
    if (n == (size_t)count && (array || !n)) return 1;
    log_error(l, "%d %s were asked for; it has %d", (int)n, what, count);
    return 0;
}

core_status core_set_states(core *c, const double *x, size_t n) {
    double *states = c->m.variables.values + CONTINUOUS_STATES;
    size_t i;
    if (!log_allowed(&c->log, CONTINUOUS, "setting the states") ||
        !counted(&c->log, x, n, NX, "states"))
        return CORE_ERROR;
    for (i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return log_error(&c->log, "%s = %g is not finite", MODEL_NAMES[CONTINUOUS_STATES + i],
                             x[i]);
    if (memcmp(states, x, n * sizeof *x)) c->m.variables.stale = 1;
    memcpy(states, x, n * sizeof *x);
    return CORE_OK;
}

core_status core_get_states(core *c, double *x, size_t n) {
    int first = c->m.run.mode == INITIALIZATION ? (int)STATES : (int)CONTINUOUS_STATES;
    if (!log_allowed(&c->log, NOT_STEPPING, "getting the states") ||
        !counted(&c->log, x, n, NX, "states"))
        return CORE_ERROR;
    memcpy(x, c->m.variables.values + first, n * sizeof *x);
    return CORE_OK;
}

core_status core_get_derivatives(core *c, double *xdot, size_t n) {
    core_status status;
    if (!log_allowed(&c->log, NOT_STEPPING, "getting derivatives") ||
        !counted(&c->log, xdot, n, NX, "states"))
        return CORE_ERROR;
    status = calculate(&c->solver);
    memcpy(xdot, c->m.variables.values + CONTINUOUS_DERIVATIVES, n * sizeof *xdot);
    return status;
}

core_status core_get_nominals(core *c, double *nominal, size_t n) {
    if (!counted(&c->log, nominal, n, NX, "states")) return CORE_ERROR;
    memcpy(nominal, MODEL_NOMINAL + STATES, n * sizeof *nominal);
    return CORE_OK;
}

core_status core_get_indicators(core *c, double *indicators, size_t n) {
    const double *v = c->m.variables.values;
    core_status status;
    if (!log_allowed(&c->log, NOT_STEPPING, "getting event indicators") ||
        !counted(&c->log, indicators, n, NK + NC, "event indicators"))
        return CORE_ERROR;
    status = event_mode_show_indicators(&c->events);
#if MODEL_TREE_OUTSIDE
    if (!status) status = chart_choice_show_indicator(&c->solver);
    indicators[NK] = v[CHART_INDICATOR];
#endif
    memcpy(indicators, v + INDICATORS, NK * sizeof *indicators);
    return status;
}
