#include "machine.h"

#include <math.h>
#include <string.h>

#include "finite.h"

void machine_init(machine *m, core_run *run, core_log *log, core_variables *variables,
                  core_inputs *inputs, core_configuration *accepted) {
    loops *l = &m->loops;
    m->run = run;
    m->log = log;
    m->variables = variables;
    m->values = variables->values;
    m->inputs = inputs;
    m->accepted = accepted;
    l->x = accepted->x;
    l->z = accepted->z;
    l->guess = variables->guess;
    l->cut = variables->cut;
    l->p = variables->values + PARAMETERS;
    l->arg = m->arg;
    l->res = m->res;
    l->iw = m->iw;
    l->w = m->w;
}

void machine_reset(machine *m) {
    core_variables *v = m->variables;
    v->stale = 1;
    memcpy(v->values, MODEL_START, N_VALUES * sizeof *v->values);
    memcpy(v->guess, MODEL_START + DEPENDENTS, NZ * sizeof *v->guess);
    memcpy(v->cut, MODEL_START + CUTS, NCUT * sizeof *v->cut);
#ifdef MODEL_TREE
    memcpy(v->speeds, MODEL_START + OUTPUTS + PASSIVE_V, N_PASSIVE * sizeof *v->speeds);
#endif
}

void machine_point(machine *m, const double *t, const double *x, const double *z) {
    m->arg[0] = t;
    m->arg[1] = x;
    m->arg[2] = z;
    m->arg[3] = inputs_at(m->inputs, m->values + INPUTS, *t, m->u);
    m->arg[4] = m->values + PARAMETERS;
}

void machine_loop_point(machine *m, const double *x, const double *z) {
    m->arg[0] = x;
    m->arg[1] = z;
    m->arg[2] = m->values + PARAMETERS;
}

int machine_rhs(machine *m, double t, const double *x, const double *z, double *xdot, double *y) {
    machine_point(m, &t, x, z);
    m->res[0] = xdot;
    m->res[1] = y;
    return machine_call(m, mbs_rhs);
}

void machine_input_rates(const machine *m, double t, double *du) {
    inputs_rates(m->inputs, m->values + INPUTS, t, du);
}

#if NK > 0

core_status machine_first_modes(machine *m) {
    double beyond[NK], modes[NM + 1];
    int k;
    machine_point(m, &m->run->time, m->values + STATES, m->z);
    m->res[0] = modes;
    m->res[1] = beyond;
    if (machine_call(m, mbs_first) || !all_finite(modes, NM) || !all_finite(beyond, NK))
        return log_failed(m->log, "the first modes have no value at time %.9g", m->run->time);
    memcpy(m->values + MODES, modes, NM * sizeof *modes);
    for (k = 0; k < NK; k++)
        if (beyond[k] > 0.0)
            return log_failed(m->log, "the start values lie beyond %s by %.3g; start inside",
                              MODEL_INDICATORS[k], beyond[k]);
    return CORE_OK;
}

#else

core_status machine_first_modes(machine *m) {
    (void)m;
    return CORE_OK;
}

#endif

core_status machine_check_rules(machine *m) {
#ifdef MODEL_RULES
    double excess[MODEL_RULES];
    int i = m->run->mode == INITIALIZATION ? 0 : MODEL_RULES_AT_START;
    m->arg[0] = m->values + STATES;
    m->arg[1] = m->values + PARAMETERS;
    m->res[0] = excess;
    if (machine_call(m, mbs_excess)) excess[i] = NAN;
    for (; i < MODEL_RULES; i++)
        if (!(excess[i] <= 0.0)) return log_error(m->log, "%s", MODEL_SENTENCES[i]);
#endif
    (void)m;
    return CORE_OK;
}

core_status machine_unsolved(machine *m) {
    return log_failed(m->log, "the equations have no solution at time %.9g", m->run->time);
}

core_status machine_not_differentiable(machine *m, double sine) {
    return log_error(
        m->log,
        "at time %.9g the configuration is so near a singular one (%s; sine %.2g) "
        "that second derivatives of the loops have no accuracy at these velocities; ask "
        "for derivatives at another configuration, at smaller velocities, or choose "
        "other independent joints (assemble(active=...))",
        m->run->time, log_where(m->log), sine);
}
