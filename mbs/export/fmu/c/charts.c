#include "charts.h"

#ifdef MODEL_TREE

#include <float.h>
#include <math.h>
#include <string.h>

#include "closure.h"
#include "internal.h"

/* Part of the largest regularity of the rows below which tangent coordinates are used, as for the
 * solver inside; and of the largest velocity of all joints, that of the independent ones. Errors are
 * magnified by the inverse. */
#define REGULAR 0.2
#define HOLD 0.1
#define LEAVE 1.5  /* of that room, from which on the independent joints serve again */
#define TURNED 0.5 /* of the tangents at the origin, at which a chart is made anew */
/* Part of the velocities, and angle or length, by which states may be off the loops. Error control
 * of the host keeps them far below; on another branch velocities differ by about their own size. */
#define OFF 0.01
#define LEAP 0.1
#define REST 1e-3 /* velocities [rad/s or m/s] that are compared with no less than this */
#define DIFFERENCE 1e-5 /* step of a difference: cube root of the rounding of a state, 1e-15 */

/* The states on the loops, and their slopes, by those of the independent joints, the dependent
 * coordinates and the outputs. */
static int spread(core *c, const double *x, const double *z, const double *xdot, const double *y,
                  double *on, double *slope) {
    double still[NT], none[NT];
    int i;
    for (i = 0; i < NX; i++) on[MODEL_TREE_STATES[i]] = x[i];
    for (i = 0; i < NZ; i++) on[MODEL_TREE_DEPENDENTS[i]] = z[i];
    for (i = NZ; i < NF; i++) on[MODEL_TREE_FOLLOWED[i]] = y[PASSIVE_V + i - NZ];
    memset(still, 0, sizeof still);
    c->arg[0] = on;
    c->arg[1] = still;
    c->res[0] = slope;
    c->res[1] = none;
    if (mbs_tree_rate(c->arg, c->res, c->iw, c->w, 0)) return 1;
    for (i = 0; i < NX; i++) slope[MODEL_TREE_STATES[i]] = xdot[i];
    for (i = NZ; i < NF; i++) slope[MODEL_TREE_FOLLOWED[i]] = y[PASSIVE_A + i - NZ];
    return 0;
}

void charts_show_rates(core *c) {
    double slope[NT], *v = c->m.values;
    int i;
    if (spread(c, v + STATES, v + DEPENDENTS, v + DERIVATIVES, v + OUTPUTS, c->m.on, slope)) return;
    for (i = 0; i < NF; i++) v[RATES + i] = slope[MODEL_TREE_FOLLOWED[i]];
}

/* All states from those of the independent joints and the ones that follow. */
static void gather(core *c) {
    int i;
    for (i = 0; i < NX; i++) c->m.tree[MODEL_TREE_STATES[i]] = c->m.values[STATES + i];
}

/* On the loops with the independent joints as they are. */
static int by_joints(core *c, double *on, double *slope, double *y) {
    const double *x = c->m.values + STATES;
    double z[NZ + 1], xdot[NX + 1];
    int i;
    for (i = 0; i < NZ; i++) z[i] = c->m.tree[MODEL_TREE_DEPENDENTS[i]];
    if (closure_near(c, x, z) || core_call_rhs(c, c->m.time, x, z, xdot, y)) return 1;
    return spread(c, x, z, xdot, y, on, slope);
}

/* On the loops with the coordinates of the chart as they are. */
static int by_chart(core *c, double *on, double *slope, double *y, double *turned) {
    static const passage_size size = MODEL_PASSAGE;
    double none[NT];
    int i;
    if (passage_state(c->passage, c->m.time, c->m.tree, on, slope, turned)) return 1;
    if (core_call_tree(c, on, none, y)) return 1;
    for (i = 0; i < FOLLOWED - OUTPUTS; i++) y[i] = slope[size.nq + MODEL_TREE_HELD[i]];
    for (i = NZ; i < NF; i++) y[PASSIVE_A + i - NZ] = slope[MODEL_TREE_FOLLOWED[i]];
    return 0;
}

static int put_on(core *c, double *on, double *slope, double *y) {
    int status = c->m.charts.tangent ? by_chart(c, on, slope, y, &c->m.charts.turned)
                                     : by_joints(c, on, slope, y);
    return status || !stepper_all_finite(slope, NT);
}

core_status charts_refresh(core *c) {
    double *v = c->m.values, slope[NT], y[NY + 1];
    char where[CORE_WHERE];
    int i;
    gather(c);
    if (put_on(c, c->m.on, slope, y))
        return core_no_answer(c, "%s: at time %.9g the states (%s) are too far from closed loops, or "
                              "in a singular configuration that the motion does not pass; ask for "
                              "a smaller tolerance or start elsewhere", c->name, c->m.time,
                              core_where(c, where));
    memcpy(v + OUTPUTS, y, NY * sizeof *v);
    for (i = 0; i < NX; i++) v[DERIVATIVES + i] = slope[MODEL_TREE_STATES[i]];
    for (i = 0; i < NZ; i++) v[DEPENDENTS + i] = c->m.on[MODEL_TREE_DEPENDENTS[i]];
    for (i = 0; i < NF; i++) {
        v[RATES + i] = slope[MODEL_TREE_FOLLOWED[i]];
        v[FOLLOWED + i] = c->m.tree[MODEL_TREE_FOLLOWED[i]];
    }
    return CORE_OK;
}

/* How far a state is from where the independent joints do not serve: 1 at the limit. */
static double room(core *c, const double *on) {
    double grip = 0.0;
    if (passage_grip(c->passage, c->m.time, on, MODEL_TREE_HELD, MODEL_TREE_UNITS, &grip))
        return 0.0;
    return fmin(passage_regularity(c->passage, c->m.time, on) / REGULAR, grip / HOLD);
}

/* The coordinates of the next steps, which begin where the states are. */
static core_status choose(core *c, double least) {
    core_charts *m = &c->m.charts;
    char where[CORE_WHERE];
    c->m.stale = 1;
    m->time = c->m.time;
    m->tangent = !(room(c, c->m.tree) > least);
    if (!m->tangent || !passage_chart(c->passage, c->m.time, c->m.tree)) return CORE_OK;
    return core_no_answer(c, "%s: at time %.9g the motion is in a singular configuration (%s), and "
                          "its velocities choose no branch; start elsewhere", c->name, c->m.time,
                          core_where(c, where));
}

core_status charts_start(core *c) {
    core_status status = core_start_tree(c);
    return status ? status : choose(c, 1.0);
}

void charts_set(core *c) { c->m.charts.loose = (c->m.mode & EVENT) != 0; }

static core_status left(core *c) {
    char where[CORE_WHERE];
    return core_refuse(c, "%s: between time %.9g and %.9g the states (at the end %s) leave the motion "
                       "that the loops allow; ask for a smaller tolerance or make shorter steps",
                       c->name, c->m.charts.time, c->m.time, core_where(c, where));
}

/* How far the states are off the loops. */
static double off(const core *c) {
    const double *a = c->m.tree, *b = c->m.on;
    double place = 0.0, miss = 0.0, speed = REST;
    int i;
    for (i = 0; i < NF; i++) {
        int k = MODEL_TREE_FOLLOWED[i];
        if (i < NZ) {
            place = fmax(place, fabs(a[k] - b[k]) / MODEL_NOMINAL[DEPENDENTS + i]);
        } else {
            speed = fmax(speed, fmax(fabs(a[k]), fabs(b[k])));
            miss = fmax(miss, fabs(a[k] - b[k]));
        }
    }
    return fmax(place, miss / speed);
}

/* Not positive where other coordinates are to be taken. */
static double indicator(core *c) {
    double chart = c->m.charts.tangent ? c->m.charts.turned - TURNED : room(c, c->m.on) - 1.0;
    return fmin(chart, 1.0 - off(c) / OFF);
}

core_status charts_show_indicator(core *c) {
    core_status status = core_refresh(c);
    double shown = status ? 0.0 : indicator(c);
    c->m.values[CHART] = shown == 0.0 ? -DBL_MIN : shown;
    return status;
}

core_status charts_completed(core *c, int *event) {
    core_charts *m = &c->m.charts;
    core_status status = core_refresh(c);
    if (status) return status;
    if (!(off(c) < LEAP)) return left(c);
    m->time = c->m.time;
    *event = !(indicator(c) > 0.0) || (m->tangent && room(c, c->m.on) > LEAVE);
    return CORE_OK;
}

core_status charts_update(core *c, int *changed) {
    core_charts *m = &c->m.charts;
    double before[NT];
    core_status status;
    int i;
    gather(c);
    memcpy(before, c->m.tree, sizeof before);
    if (m->loose) {
        double z[NZ + 1];
        for (i = 0; i < NZ; i++) z[i] = c->m.tree[MODEL_TREE_DEPENDENTS[i]];
        if (closure_near(c, c->m.values + STATES, z))
            return core_no_answer(c, "%s: the loops cannot be closed at time %.9g with the values "
                                  "that were set", c->name, c->m.time);
        memcpy(c->m.values + DEPENDENTS, z, NZ * sizeof *z);
        status = core_start_tree(c);
        m->loose = 0;
        if (!status) status = choose(c, 1.0);
    } else {
        if (m->settled) return CORE_OK;
        status = core_refresh(c);
        memcpy(c->m.tree, c->m.on, sizeof c->m.tree);
        if (!status) status = choose(c, LEAVE);
    }
    m->settled = 1;
    if (status) return status;
    for (i = 0; i < NX; i++) c->m.values[STATES + i] = c->m.tree[MODEL_TREE_STATES[i]];
    *changed = memcmp(before, c->m.tree, sizeof before) != 0;
    return CORE_OK;
}

/* Rates and outputs a part of the way along a direction. */
static int beside(core *c, const charts_tangent *along, double part, double *rate, double *y) {
    double *v = c->m.values, *X = c->m.tree, on[NT], slope[NT], turned;
    int i, status;
    c->m.time += part * along->dt;
    for (i = 0; i < NX; i++) X[MODEL_TREE_STATES[i]] += part * along->dx[i];
    for (i = 0; i < NF; i++) X[MODEL_TREE_FOLLOWED[i]] += part * along->dx[NX + i];
    for (i = 0; i < NU; i++) v[INPUTS + i] += part * along->du[i];
    for (i = 0; i < NP; i++) v[PARAMETERS + i] += part * along->dp[i];
    status = by_chart(c, on, slope, y, &turned);
    for (i = 0; i < NX; i++) rate[i] = slope[MODEL_TREE_STATES[i]];
    for (i = 0; i < NF; i++) rate[NX + i] = slope[MODEL_TREE_FOLLOWED[i]];
    for (i = 0; i < NF; i++) y[FOLLOWED - OUTPUTS + i] = X[MODEL_TREE_FOLLOWED[i]];
    return status;
}

core_status charts_difference(core *c, charts_tangent *along) {
    core_memory kept = c->m;
    double rate[2][NX + NF + 1], y[2][NY + 1], size = fabs(along->dt), step;
    int i, side, status = 0;
    for (i = 0; i < NX + NF; i++) size = fmax(size, fabs(along->dx[i]));
    for (i = 0; i < NU; i++) size = fmax(size, fabs(along->du[i]));
    for (i = 0; i < NP; i++) size = fmax(size, fabs(along->dp[i]));
    step = DIFFERENCE / fmax(size, 1e-300);
    for (side = 0; side < 2 && !status; side++) {
        gather(c);
        status = beside(c, along, side ? step : -step, rate[side], y[side]);
        c->m = kept;
    }
    if (status) return core_no_answer(c, "%s: no derivative at time %.9g", c->name, c->m.time);
    for (i = 0; i < NX + NF; i++) along->dxdot[i] = (rate[1][i] - rate[0][i]) / (2 * step);
    for (i = 0; i < NY; i++) along->dy[i] = (y[1][i] - y[0][i]) / (2 * step);
    return CORE_OK;
}

#endif
