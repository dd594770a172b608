#include "guard.h"

#include <string.h>

#if NB > 0

/* Error that the motion comes to a singular configuration. */
static core_status passed(machine *m) {
    return log_error(
        m->log,
        "between time %.9g and %.9g the motion comes to a singular configuration, where "
        "the states do not determine the dependent coordinates (at its end %s); choose "
        "other independent joints (assemble(active=...)), start elsewhere, or end the "
        "run before",
        m->accepted->watched.time, m->run->time, log_where(m->log));
}

/* Compute determinant signs, and velocities and accelerations of dependent joints, at this time. */
static core_status look(machine *m, watched *now) {
    const double *x = m->values + STATES;
    double z[NZ], xdot[NX + 1], y[NY + 1], J[WATCH_WORK];
    now->on = 1;
    now->time = m->run->time;
    if (closure_solve(&m->loops, x, z) || watch_signs(&m->loops, x, z, now->sign, J) ||
        machine_rhs(m, m->run->time, x, z, xdot, y))
        return passed(m);
    memcpy(now->v, y + PASSIVE_V, N_PASSIVE * sizeof *y);
    memcpy(now->a, y + PASSIVE_A, N_PASSIVE * sizeof *y);
    return CORE_OK;
}

core_status guard_restart(machine *m) {
    core_status status = look(m, &m->accepted->watched);
    if (status) m->accepted->watched.on = 0;
    return status;
}

core_status guard_pass(machine *m) {
    watched *reference = &m->accepted->watched, now;
    core_status status;
    if (reference->on && reference->time >= m->run->time) return CORE_OK;
    memset(&now, 0, sizeof now);
    status = look(m, &now);
    if (status) return status;
    if (reference->on && watch_differ(reference, &now, MODEL_NOMINAL + OUTPUTS + PASSIVE_V))
        return passed(m);
    *reference = now;
    return CORE_OK;
}

void guard_forget(machine *m) { m->accepted->watched.on = 0; }

#else

core_status guard_restart(machine *m) {
    (void)m;
    return CORE_OK;
}

core_status guard_pass(machine *m) {
    (void)m;
    return CORE_OK;
}

void guard_forget(machine *m) { (void)m; }

#endif
