#include "charts.h"

#if MODEL_TREE_OUTSIDE

#include <float.h>
#include <math.h>
#include <string.h>

#include "closure.h"
#include "guard.h"
#include "internal.h"

/* Part of the largest velocity of all joints, that of the independent ones, below which tangent
 * coordinates are used: errors are magnified by the inverse. */
#define HOLD 0.1
#define LEAVE 1.5  /* of that room, from which on the joints serve again: not at once, back and forth */
#define NEAR 1e-6  /* of that room: importers find the limit to less, from either side */
#define TURNED 0.5 /* of the tangents at the origin, 60 degrees: well before a chart ends (passage.c) */
#define DIFFERENCE 1e-5 /* step of a difference: cube root of the rounding of a state, 1e-15 */

/* A state of the tree, its slope, and that of the states. */
typedef struct {
    double X[NT], slope[NT], rate[NX + 1], y[NY + 1];
} found;

/* Where the states are those of the independent joints. */
static int by_joints(core *c, const double *x, found *f) {
    double z[NZ + 1];
    int i;
    if (closure_solve(&c->loops, x, z) || core_call_rhs(c, c->m.time, x, z, f->rate, f->y)) return 1;
    for (i = 0; i < NX; i++) f->X[MODEL_TREE_STATES[i]] = x[i];
    for (i = 0; i < NZ; i++) f->X[MODEL_TREE_DEPENDENTS[i]] = z[i];
    for (i = 0; i < N_PASSIVE; i++) f->X[MODEL_TREE_PASSIVE[i]] = f->y[PASSIVE_V + i];
    c->arg[0] = f->X;
    c->res[0] = f->slope;
    if (mbs_tree_rate(c->arg, c->res, c->iw, c->w, 0)) return 1;
    for (i = 0; i < NX; i++) f->slope[MODEL_TREE_STATES[i]] = f->rate[i];
    for (i = 0; i < N_PASSIVE; i++) f->slope[MODEL_TREE_PASSIVE[i]] = f->y[PASSIVE_A + i];
    return 0;
}

/* The motion from the last states that were on it. */
static void foretell(const core *c, double *guide) {
    static const passage_size size = MODEL_PASSAGE;
    const core_charts *m = &c->m.charts;
    double dt = c->m.time - m->time;
    int i;
    for (i = 0; i < NT; i++) guide[i] = m->X[i] + dt * m->slope[i];
    for (i = 0; i < size.nq && size.nq == size.nv; i++)
        guide[i] += 0.5 * dt * dt * m->slope[size.nq + i];
}

/* Where the states are coordinates of a chart. */
static int by_chart(core *c, const double *y, found *f) {
    const core_charts *m = &c->m.charts;
    double guide[NT], none[NT];
    foretell(c, guide);
    memset(f->rate, 0, sizeof f->rate);
    if (passage_state(c->passage, c->m.time, y, guide, f->X, f->slope, f->rate,
                      &c->m.charts.alignment))
        return 1;
    if (passage_jumps(c->passage, m->time, m->X, m->slope, c->m.time - m->time, f->X, f->slope))
        return 1;
    if (core_call_tree(c, f->X, none, f->y)) return 1;
    core_show_slope(f->slope, f->y); /* near the singular configuration itself from beside it */
    return 0;
}

static int found_state(core *c, found *f) {
    const double *x = c->m.values + SLOTS;
    return (c->m.charts.tangent ? by_chart(c, x, f) : by_joints(c, x, f)) ||
           !stepper_all_finite(f->slope, NT);
}

static core_status lost(core *c) {
    return core_no_answer(c, "%s: at time %.9g the loops have no solution near the last one (%s), or "
                          "are in a singular configuration that the motion does not pass; ask for a "
                          "smaller tolerance or start elsewhere", c->name, c->m.time,
                          core_where(c));
}

core_status charts_refresh(core *c) {
    double *v = c->m.values;
    found f;
    int i;
    if (found_state(c, &f)) return lost(c);
    memcpy(c->m.tree, f.X, sizeof f.X);
    memcpy(c->m.slope, f.slope, sizeof f.slope);
    memcpy(v + OUTPUTS, f.y, NY * sizeof *v);
    memcpy(v + RATES, f.rate, NX * sizeof *v);
    for (i = 0; i < NX; i++) v[STATES + i] = f.X[MODEL_TREE_STATES[i]];
    for (i = 0; i < NX; i++) v[DERIVATIVES + i] = f.slope[MODEL_TREE_STATES[i]];
    for (i = 0; i < NZ; i++) v[DEPENDENTS + i] = f.X[MODEL_TREE_DEPENDENTS[i]];
    return CORE_OK;
}

void charts_back(core *c, double time) {
    static const passage_size size = MODEL_PASSAGE;
    double *X = c->m.tree, *slope = c->m.slope;
    int i;
    for (i = 0; i < NT; i++) X[i] -= time * slope[i];
    for (i = 0; i < size.nq && size.nq == size.nv; i++) {
        X[i] += 0.5 * time * time * slope[size.nq + i];
        slope[i] -= time * slope[size.nq + i];
    }
}

/* The motion is followed from here. */
static void follow_from_here(core *c) {
    core_charts *m = &c->m.charts;
    m->time = c->m.time;
    memcpy(m->X, c->m.tree, sizeof m->X);
    memcpy(m->slope, c->m.slope, sizeof m->slope);
    memcpy(c->m.configuration_x, c->m.values + STATES, NX * sizeof(double));
    memcpy(c->m.configuration_z, c->m.values + DEPENDENTS, NZ * sizeof(double));
}

/* How far the state is from where the independent joints do not serve: 1 at the limit. */
static double room(core *c) {
    double grip = 0.0;
    if (passage_grip(c->passage, c->m.time, c->m.tree, MODEL_TREE_HELD, MODEL_TREE_UNITS, &grip))
        return 0.0;
    return fmin(passage_regularity(c->passage, c->m.time, c->m.tree) / PASSAGE_ON, grip / HOLD);
}

/* The coordinates of the next steps, which begin in the state of the tree. */
static core_status choose(core *c, double least) {
    core_charts *m = &c->m.charts;
    double *slots = c->m.values + SLOTS;
    int i;
    c->m.stale = 1;
    m->settled = 1;
    m->tangent = !(room(c) > least);
    if (!m->tangent) {
        for (i = 0; i < NX; i++) slots[i] = c->m.tree[MODEL_TREE_STATES[i]];
        return CORE_OK;
    }
    memset(slots, 0, NX * sizeof *slots);
    m->alignment = 1.0;
    if (!passage_chart(c->passage, c->m.time, c->m.tree) &&
        !passage_coordinates(c->passage, c->m.time, c->m.tree, slots))
        return CORE_OK;
    return core_no_answer(c, "%s: at time %.9g the motion is in a singular configuration (%s), and "
                          "its velocities choose no branch; start elsewhere", c->name, c->m.time,
                          core_where(c));
}

/* The state of the tree by the joints, and the coordinates of the next steps. */
static core_status begin(core *c) {
    core_status status;
    c->m.charts.tangent = c->m.charts.loose = 0;
    status = charts_refresh(c);
    if (status) return status;
    follow_from_here(c);
    return choose(c, 1.0);
}

/* The joints are the states outside. */
static void joints_are_states(core *c) {
    int i;
    for (i = 0; i < NX; i++) c->m.values[SLOTS + i] = c->m.values[STATES + i];
}

core_status charts_start(core *c) {
    joints_are_states(c);
    if (c->m.singular) {
        c->m.singular = 0;
        follow_from_here(c);
        return choose(c, 1.0);
    }
    passage_start(c->passage);
    return begin(c);
}

core_status charts_set(core *c) {
    core_status status = c->m.charts.tangent ? core_refresh(c) : CORE_OK;
    c->m.charts.tangent = 0;
    c->m.charts.loose = 1;
    joints_are_states(c);
    return status;
}

core_status charts_pause(core *c) {
    c->m.charts.settled = 0;
    return c->m.charts.tangent ? CORE_OK : guard_pass(c);
}

/* Not positive where other coordinates are to be taken. */
static double indicator(core *c) {
    return c->m.charts.tangent ? c->m.charts.alignment - TURNED : room(c) - 1.0;
}

/* The states are on the motion, and no branch was left on the path to them. */
static core_status accept_states(core *c) {
    core_status status = c->m.charts.tangent ? CORE_OK : guard_pass(c);
    if (!status) follow_from_here(c);
    return status;
}

core_status charts_show_indicator(core *c) {
    core_status status = core_refresh(c);
    double shown;
    if (status) return status;
    shown = indicator(c);
    if (shown > 0.0) status = accept_states(c);
    if (status) return status;
    c->m.values[CHART] = shown == 0.0 ? -DBL_MIN : shown;
    return CORE_OK;
}

core_status charts_completed(core *c, int *event) {
    core_charts *m = &c->m.charts;
    core_status status = core_refresh(c);
    if (!status) status = accept_states(c);
    if (status) return status;
    *event = !(indicator(c) > 0.0) || (m->tangent && room(c) > LEAVE);
    return CORE_OK;
}

/* The jumps of events move the state of the tree, from which the next steps begin. */
static core_status settle_tree(core *c, int *jumped) {
#if NK > 0 && !MODEL_CHARTS_ALONE
    core_charts *m = &c->m.charts;
    core_status status = core_refresh(c);
    *jumped = 0;
    if (!status) status = core_settle(c, jumped);
    if (status || !c->m.stale) return status;
    if (m->tangent) {
        m->time = c->m.time;
        memcpy(m->X, c->m.tree, sizeof m->X);
        memset(m->slope, 0, sizeof m->slope);
        status = choose(c, 1.0);
    } else {
        joints_are_states(c);
    }
    if (!status) status = core_refresh(c);
    if (!status) follow_from_here(c);
    return status;
#else
    (void)c;
    *jumped = 0;
    return CORE_OK;
#endif
}

core_status charts_update(core *c, int *changed) {
    core_charts *m = &c->m.charts;
    double before[NX + 1];
    core_status status;
    int jumped;
    *changed = m->loose;
    if (m->loose) {
        status = begin(c);
        if (status) return status;
    }
    status = settle_tree(c, &jumped);
    *changed = *changed || jumped;
    if (status || m->settled) return status;
    memcpy(before, c->m.values + SLOTS, sizeof before);
    status = core_refresh(c);
    if (status) return status;
    follow_from_here(c);
    status = choose(c, m->tangent ? LEAVE : 1.0 + NEAR);
    *changed = memcmp(before, c->m.values + SLOTS, NX * sizeof *before) != 0;
    return status;
}

/* Rates, outputs and joints a part of the distance along a direction. */
static int beside(core *c, const charts_tangent *along, double part, found *f) {
    double *v = c->m.values, y[NX + 1];
    int i;
    c->m.time += part * along->dt;
    for (i = 0; i < NX; i++) y[i] = v[SLOTS + i] + part * along->dx[i];
    for (i = 0; i < NU; i++) v[INPUTS + i] += part * along->du[i];
    for (i = 0; i < NP; i++) v[PARAMETERS + i] += part * along->dp[i];
    return by_chart(c, y, f);
}

core_status charts_difference(core *c, charts_tangent *along) {
    core_memory kept = c->m;
    double size = fabs(along->dt), step;
    found f[2];
    int i, side, status = 0;
    for (i = 0; i < NX; i++) size = fmax(size, fabs(along->dx[i]));
    for (i = 0; i < NU; i++) size = fmax(size, fabs(along->du[i]));
    for (i = 0; i < NP; i++) size = fmax(size, fabs(along->dp[i]));
    step = DIFFERENCE / fmax(size, DBL_MIN / DBL_EPSILON);
    for (side = 0; side < 2 && !status; side++) {
        status = beside(c, along, side ? step : -step, f + side);
        c->m = kept;
    }
    if (status) return core_no_answer(c, "%s: no derivative at time %.9g", c->name, c->m.time);
    for (i = 0; i < NX; i++) along->dxdot[i] = (f[1].rate[i] - f[0].rate[i]) / (2 * step);
    for (i = 0; i < NY; i++) along->dy[i] = (f[1].y[i] - f[0].y[i]) / (2 * step);
    for (i = 0; i < NX; i++) {
        int k = MODEL_TREE_STATES[i];
        along->djoints[i] = (f[1].X[k] - f[0].X[k]) / (2 * step);
        along->dslopes[i] = (f[1].slope[k] - f[0].slope[k]) / (2 * step);
    }
    for (i = 0; i < NZ; i++) {
        int k = MODEL_TREE_DEPENDENTS[i];
        along->dz[i] = (f[1].X[k] - f[0].X[k]) / (2 * step);
    }
    return CORE_OK;
}

#endif
