#include "guard.h"

#include <string.h>

#include "internal.h"

#if NB > 0

static core_status passed(core *c) {
    return core_refuse(
        c, "%s: between time %.9g and %.9g the motion comes to a singular configuration, where the "
           "states do not determine the dependent coordinates (at its end %s); choose other "
           "independent joints (assemble(active=...)), start elsewhere, or end the run before",
        c->name, c->m.watched.time, c->m.time, core_where(c));
}

/* Compute determinant signs, and velocities and accelerations of dependent joints, at this time. */
static core_status look(core *c, watched *now) {
    const double *x = c->m.values + STATES;
    double z[NZ], xdot[NX + 1], y[NY + 1], J[WATCH_WORK];
    now->on = 1;
    now->time = c->m.time;
    if (closure_solve(&c->loops, x, z) || watch_signs(&c->loops, x, z, now->sign, J) ||
        core_call_rhs(c, c->m.time, x, z, xdot, y))
        return passed(c);
    memcpy(now->v, y + PASSIVE_V, N_PASSIVE * sizeof *y);
    memcpy(now->a, y + PASSIVE_A, N_PASSIVE * sizeof *y);
    return CORE_OK;
}

core_status guard_restart(core *c) {
    core_status status = look(c, &c->m.watched);
    if (status) c->m.watched.on = 0;
    return status;
}

core_status guard_pass(core *c) {
    watched now;
    core_status status;
    if (c->m.watched.on && c->m.watched.time >= c->m.time) return CORE_OK;
    memset(&now, 0, sizeof now);
    status = look(c, &now);
    if (status) return status;
    if (c->m.watched.on &&
        watch_differ(&c->m.watched, &now, MODEL_NOMINAL + OUTPUTS + PASSIVE_V))
        return passed(c);
    c->m.watched = now;
    return CORE_OK;
}

void guard_forget(core *c) { c->m.watched.on = 0; }

#else

core_status guard_restart(core *c) {
    (void)c;
    return CORE_OK;
}

core_status guard_pass(core *c) {
    (void)c;
    return CORE_OK;
}

void guard_forget(core *c) { (void)c; }

#endif
