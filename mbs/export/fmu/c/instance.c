/* An instance: initialisation, and the state machine up to the first event iteration. */
#include <math.h>
#include <string.h>

#include "calculated.h"
#include "chart_choice.h"
#include "configuration.h"
#include "core.h"
#include "event_mode.h"
#include "guard.h"
#include "tree_state.h"

/* Set all data to those before the initialization. */
static void to_start(core *c) {
    int cosimulation = c->m.run.cosimulation;
    memset(&c->m, 0, sizeof c->m);
    c->m.run.cosimulation = cosimulation;
    c->m.run.mode = INSTANTIATED;
    c->m.run.stop = HUGE_VAL;
    c->m.solver.tolerance = MODEL_TOLERANCE;
    machine_reset(&c->machine);
}

int core_init(core *c, const char *name, int cosimulation, core_logger log, void *host,
              core_supply supply) {
    core_memory *m = &c->m;
    memset(c, 0, sizeof *c);
    c->log.name = name;
    c->log.write = log;
    c->log.host = host;
    c->log.run = &m->run;
    c->log.states = m->variables.values + STATES;
    c->host.supply = supply;
    m->run.cosimulation = cosimulation;
    machine_init(&c->machine, &m->run, &c->log, &m->variables, &m->inputs, &m->configuration);
    to_start(c);
    if (solver_init(&c->solver, &c->machine, &m->solver)) return 1;
#if NK > 0
    event_mode_init(&c->events, &c->solver, &m->events);
#else
    event_mode_init(&c->events, &c->solver);
#endif
    return 0;
}

void core_end(core *c) { solver_end(&c->solver); }

core_status core_check_stop(core *c, double time) {
    double stop = c->m.run.stop;
    if (time <= stop + SAME_TIME * fmax(1.0, fabs(stop))) return CORE_OK;
    return log_error(&c->log,
                     "time %.12g lies past the stop time %.12g of the experiment; end there "
                     "or set up a later one",
                     time, stop);
}

core_status core_setup(core *c, double tolerance, double start, double stop) {
    core_log *l = &c->log;
    if (!log_allowed(l, INSTANTIATED, "setting up the experiment")) return CORE_ERROR;
    if (!isfinite(start)) return log_error(l, "start time %g is not finite", start);
    if (!(stop >= start))
        return log_error(l, "stop time %.12g lies before the start at %.12g; give a later one",
                         stop, start);
    if (!(tolerance > 0.0) || !isfinite(tolerance))
        return log_error(l, "tolerance %g must be positive", tolerance);
    c->m.run.time = start;
    c->m.run.stop = stop;
    c->m.solver.tolerance = tolerance;
    c->m.variables.stale = 1;
    return CORE_OK;
}

core_status core_enter_initialization(core *c) {
    if (!log_allowed(&c->log, INSTANTIATED, "entering initialization mode")) return CORE_ERROR;
    c->m.run.mode = INITIALIZATION;
    return CORE_OK;
}

/* Start the integration and the events at the initial values. */
static core_status start_solver(core *c) {
    core_solver *s = &c->solver;
    core_status status = CORE_OK;
    stepper_start(&s->stepper, c->m.run.time);
#ifdef MODEL_TREE
    if (c->m.run.cosimulation && solver_has_tree(s) && !s->tree->singular) status = tree_start(s);
#endif
#if MODEL_TREE_OUTSIDE
    if (!status && !c->m.run.cosimulation) status = chart_choice_start(s);
#endif
    if (!status) status = event_mode_start(&c->events);
    if (!status && !solver_has_tree(s)) status = guard_restart(&c->machine);
    return status;
}

core_status core_exit_initialization(core *c) {
    const double *v = c->m.variables.values;
    core_status status;
    int changed;
    if (!log_allowed(&c->log, INITIALIZATION, "leaving initialization mode")) return CORE_ERROR;
    if (machine_check_rules(&c->machine)) return CORE_ERROR;
    status = calculate(&c->solver);
    if (!status && !solver_starts_singular(&c->solver))
        status = configuration_accept(&c->machine, v + STATES, v + DEPENDENTS);
    if (status) return status;
    c->m.configuration.known = 1;
    status = start_solver(c);
    if (status) return status;
    if (!c->m.run.cosimulation || c->host.event_mode) {
        c->m.run.mode = EVENT;
        return CORE_OK;
    }
    status = event_mode_iterate(&c->events, &changed);
    if (!status) c->m.run.mode = STEP;
    return status;
}

core_status core_terminate(core *c) {
    if (!log_allowed(&c->log, RUNNING, "termination")) return CORE_ERROR;
    c->m.run.mode = TERMINATED;
    return CORE_OK;
}

core_status core_reset(core *c) {
    if (!log_allowed(&c->log, ~INTERMEDIATE, "a reset")) return CORE_ERROR;
    to_start(c);
    return CORE_OK;
}
