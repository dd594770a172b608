#include "charts.h"

#if MODEL_TREE_OUTSIDE

#include <float.h>
#include <math.h>
#include <string.h>

#include "closure.h"
#include "guard.h"
#include "internal.h"

/* Smallest grip (independent velocities / largest joint velocity) at which the joints are the
 * states. Errors of the states are magnified by its inverse. Below it, tangent coordinates are
 * used. */
#define HOLD 0.1
#define LEAVE 1.5  /* room above which the joints are the states again: hysteresis above 1 */
#define NEAR 1e-6  /* tolerance of the room at 1: importers locate it better, on either side */
#define TURNED 0.5 /* smallest alignment, 60 degrees: well before a chart ends (passage.c) */
/* Displacement of the state in central differences, in typical sizes. The truncation error of sixth
 * order is its sixth power, 1e-18 of a derivative. The rounding error is that of the accelerations,
 * at most 1e-12, divided by the displacement. */
#define DIFFERENCE 1e-3
#define STEPS 12      /* step lengths that are tried to displace the state by about DIFFERENCE */
#define FIRST_STEP 1e-6
#define SHORTER 0.1
#define LONGER 100.0
/* Largest error of the derivatives of accelerations, relative to the largest derivative. IDLE:
 * relative to squared rates, for derivatives that are zero. */
#define INACCURATE 3e-6
#define IDLE 1e-10

/* State X of the tree and its derivative slope; derivative of the states (rate); outputs y. */
typedef struct {
    double X[NT], slope[NT], rate[NX + 1], y[NY + 1];
} found;

/* Evaluate the model at the states x of the independent joints. Nonzero on failure. */
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

/* Extrapolate the state of the tree from the last accepted state to the present time. */
static void foretell(const core *c, double *guide) {
    static const passage_size size = MODEL_PASSAGE;
    const core_charts *m = &c->m.charts;
    double dt = c->m.time - m->time;
    int i;
    for (i = 0; i < NT; i++) guide[i] = m->X[i] + dt * m->slope[i];
    for (i = 0; i < size.nq && size.nq == size.nv; i++)
        guide[i] += 0.5 * dt * dt * m->slope[size.nq + i];
}

/* Compute the state of the tree from chart coordinates y, on the branch of the near state guide. */
static int near_guide(core *c, const double *y, const double *guide, found *f) {
    memset(f->rate, 0, sizeof f->rate);
    return passage_state(c->passage, c->m.time, y, guide, f->X, f->slope, f->rate,
                         &c->m.charts.alignment);
}

/* Compute the outputs at the state f->X. */
static int chart_outputs(core *c, found *f) {
    double none[NT];
    if (core_call_tree(c, f->X, none, f->y)) return 1;
    core_show_slope(f->slope, f->y); /* valid in the singular configuration too */
    return 0;
}

/* Evaluate the model at chart coordinates y, on the branch of the last accepted states. Nonzero on
 * failure, or if the motion jumps to another branch. */
static int by_chart(core *c, const double *y, found *f) {
    const core_charts *m = &c->m.charts;
    double guide[NT];
    foretell(c, guide);
    if (near_guide(c, y, guide, f)) return 1;
    if (passage_jumps(c->passage, m->time, m->X, m->slope, c->m.time - m->time, f->X, f->slope))
        return 1;
    return chart_outputs(c, f);
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

/* Make the present state the last accepted state, from which the motion is followed. */
static void follow_from_here(core *c) {
    core_charts *m = &c->m.charts;
    m->time = c->m.time;
    memcpy(m->X, c->m.tree, sizeof m->X);
    memcpy(m->slope, c->m.slope, sizeof m->slope);
    memcpy(c->m.configuration_x, c->m.values + STATES, NX * sizeof(double));
    memcpy(c->m.configuration_z, c->m.values + DEPENDENTS, NZ * sizeof(double));
}

/* Margin of the independent joints as states: above 1 they can be used, 0 in a singular
 * configuration. */
static double room(core *c) {
    double grip = 0.0;
    if (passage_grip(c->passage, c->m.time, c->m.tree, MODEL_TREE_HELD, MODEL_TREE_UNITS, &grip))
        return 0.0;
    return fmin(passage_regularity(c->passage, c->m.time, c->m.tree) / PASSAGE_ON, grip / HOLD);
}

/* Choose the coordinates of the next steps, which begin at the state of the tree: the joints if the
 * room exceeds `least`, else tangent coordinates. */
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

/* Compute the state of the tree from the joints, and choose the coordinates of the next steps. */
static core_status begin(core *c) {
    core_status status;
    c->m.charts.tangent = c->m.charts.loose = 0;
    status = charts_refresh(c);
    if (status) return status;
    follow_from_here(c);
    return choose(c, 1.0);
}

/* Copy the joint states to the states of the external integrator. */
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

/* Event indicator: not positive if the coordinates must change. */
static double indicator(core *c) {
    return c->m.charts.tangent ? c->m.charts.alignment - TURNED : room(c) - 1.0;
}

/* Accept the present states, if the motion to them has not left its branch. */
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

/* Make the jumps that are due. The next steps begin at the state of the tree after them. */
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

/* Evaluate the model at a point displaced by `part` times the direction `along`. ahead (NT,):
 * estimated derivative of the tree state along it, which selects the branch. */
static int beside(core *c, const charts_tangent *along, const double *ahead, double part, found *f) {
    double *v = c->m.values, y[NX + 1], guide[NT];
    core_memory kept = c->m;
    int i, status;
    c->m.time += part * along->dt;
    for (i = 0; i < NX; i++) y[i] = v[SLOTS + i] + part * along->dx[i];
    for (i = 0; i < NU; i++) v[INPUTS + i] += part * along->du[i];
    for (i = 0; i < NP; i++) v[PARAMETERS + i] += part * along->dp[i];
    for (i = 0; i < NT; i++) guide[i] = c->m.tree[i] + part * ahead[i];
    status = near_guide(c, y, guide, f) || chart_outputs(c, f);
    c->m = kept;
    return status;
}

/* Largest velocity, or square root of an acceleration, of the tree in typical sizes [1/s]. */
static double typical_rate(const core *c) {
    static const passage_size size = MODEL_PASSAGE;
    double rate = 0.0;
    int i;
    for (i = 0; i < size.nv; i++) {
        rate = fmax(rate, fabs(c->m.tree[size.nq + i]) * MODEL_TREE_UNITS[i]);
        rate = fmax(rate, sqrt(fabs(c->m.slope[size.nq + i]) * MODEL_TREE_UNITS[i]));
    }
    return rate > 0.0 ? rate : 1.0;
}

/* Distance of two states and their derivatives, in typical sizes. */
static double distance(const found *a, const found *b, double rate) {
    static const passage_size size = MODEL_PASSAGE;
    double far = 0.0;
    int i, plain = size.nq == size.nv;
    for (i = 0; i < size.nq; i++)
        far = fmax(far, fabs(a->X[i] - b->X[i]) * (plain ? MODEL_TREE_UNITS[i] : 1.0));
    for (i = 0; i < size.nv; i++) {
        int k = size.nq + i;
        far = fmax(far, fabs(a->X[k] - b->X[k]) * MODEL_TREE_UNITS[i] / rate);
        far = fmax(far, fabs(a->slope[k] - b->slope[k]) * MODEL_TREE_UNITS[i] / (rate * rate));
    }
    return far;
}

/* Find *step, the multiple of a direction that displaces the state by about DIFFERENCE, and ahead,
 * the derivative of the tree state along the direction. Returns 1 on failure. */
static int step_of(core *c, const charts_tangent *along, double rate, double *ahead, double *step) {
    double size = rate * fabs(along->dt), far, longest = HUGE_VAL;
    found f[2];
    int i, pass;
    for (i = 0; i < NX; i++) size = fmax(size, fabs(along->dx[i]));
    for (i = 0; i < NU; i++)
        size = fmax(size, fabs(along->du[i]) / fmax(1.0, fabs(c->m.values[INPUTS + i])));
    for (i = 0; i < NP; i++)
        size = fmax(size, fabs(along->dp[i]) / fmax(DBL_MIN, fabs(c->m.values[PARAMETERS + i])));
    *step = FIRST_STEP / fmax(size, DBL_MIN / DBL_EPSILON);
    memset(ahead, 0, NT * sizeof *ahead);
    for (pass = 0; pass < STEPS; pass++) {
        if (beside(c, along, ahead, -*step, f) || beside(c, along, ahead, *step, f + 1)) {
            longest = *step;
            *step *= SHORTER;
            continue;
        }
        for (i = 0; i < NT; i++) ahead[i] = (f[1].X[i] - f[0].X[i]) / (2.0 * *step);
        far = 0.5 * distance(f, f + 1, rate);
        if (far > 0.5 * DIFFERENCE && far < 2.0 * DIFFERENCE) return 0;
        *step *= fmin(LONGER, DIFFERENCE / fmax(far, DIFFERENCE / LONGER));
        if (!(*step < longest)) *step = 0.5 * longest;
    }
    return beside(c, along, ahead, *step, f);
}

/* Derivative by central differences of sixth order. d: f(k step) - f(-k step) for k = 1, 2, 3.
 * *error: difference from the derivative of fourth order. */
static double derivative(const double *d, double step, double *error) {
    double six = (45.0 * d[0] - 9.0 * d[1] + d[2]) / (60.0 * step);
    *error = fabs(six - (8.0 * d[0] - d[1]) / (12.0 * step));
    return six;
}

#define DERIVATIVE_OF(field)                                                                          \
    (d[0] = f[1].field - f[0].field, d[1] = f[3].field - f[2].field, d[2] = f[5].field - f[4].field,  \
     derivative(d, step, &error))

core_status charts_difference(core *c, charts_tangent *along) {
    static const passage_size size = MODEL_PASSAGE;
    double rate = typical_rate(c), step, d[3], error, most = 0.0, worst = 0.0;
    found f[6];
    double ahead[NT];
    int i, k, status;
    status = step_of(c, along, rate, ahead, &step);
    for (k = 0; k < 6 && !status; k++)
        status = beside(c, along, ahead, (k % 2 ? step : -step) * (k / 2 + 1), f + k);
    if (status) return core_no_answer(c, "%s: no derivative at time %.9g", c->name, c->m.time);
    for (i = 0; i < size.nv; i++) {
        double scale = MODEL_TREE_UNITS[i];
        most = fmax(most, fabs(DERIVATIVE_OF(slope[size.nq + i])) * scale);
        worst = fmax(worst, error * scale);
    }
    if (!(worst <= INACCURATE * most + IDLE * rate * rate * DIFFERENCE / step))
        return core_not_differentiable(c, 0.0);
    for (i = 0; i < NX; i++) along->dxdot[i] = DERIVATIVE_OF(rate[i]);
    for (i = 0; i < NY; i++) along->dy[i] = DERIVATIVE_OF(y[i]);
    for (i = 0; i < NX; i++) {
        k = MODEL_TREE_STATES[i];
        along->djoints[i] = DERIVATIVE_OF(X[k]);
        along->dslopes[i] = DERIVATIVE_OF(slope[k]);
    }
    for (i = 0; i < NZ; i++) {
        k = MODEL_TREE_DEPENDENTS[i];
        along->dz[i] = DERIVATIVE_OF(X[k]);
    }
    return CORE_OK;
}

#endif
