#include "charts.h"

#if MODEL_TREE_OUTSIDE

#include <float.h>
#include <math.h>
#include <string.h>

#include "finite.h"
#include "passage_external.h"
#include "tree_state.h"

/* Displacement of the state in central differences, in typical sizes. The truncation error of sixth
 * order is its sixth power, 1e-18 of a derivative. The rounding error is that of the accelerations,
 * at most 1e-12, divided by the displacement. */
#define DIFFERENCE 1e-3
#define STEPS 12 /* step lengths that are tried to displace the state by about DIFFERENCE */
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
} chart_values;

/* Evaluate the model at the states x of the independent joints. Nonzero on failure. */
static int by_joints(core_solver *s, const double *x, chart_values *f) {
    machine *m = s->machine;
    double z[NZ + 1];
    int i;
    if (closure_solve(&m->loops, x, z) || machine_rhs(m, m->run->time, x, z, f->rate, f->y))
        return 1;
    for (i = 0; i < NX; i++) f->X[MODEL_TREE_STATES[i]] = x[i];
    for (i = 0; i < NZ; i++) f->X[MODEL_TREE_DEPENDENTS[i]] = z[i];
    for (i = 0; i < N_PASSIVE; i++) f->X[MODEL_TREE_PASSIVE[i]] = f->y[PASSIVE_V + i];
    m->arg[0] = f->X;
    m->res[0] = f->slope;
    if (machine_call(m, mbs_tree_rate)) return 1;
    for (i = 0; i < NX; i++) f->slope[MODEL_TREE_STATES[i]] = f->rate[i];
    for (i = 0; i < N_PASSIVE; i++) f->slope[MODEL_TREE_PASSIVE[i]] = f->y[PASSIVE_A + i];
    return 0;
}

/* Extrapolate the state of the tree from the last accepted state to the present time. */
static void extrapolate(const core_solver *s, double *guide) {
    const core_charts *last = s->charts;
    double dt = s->machine->run->time - last->time;
    int i;
    for (i = 0; i < NT; i++) guide[i] = last->X[i] + dt * last->slope[i];
    for (i = 0; i < TREE_SIZE.nq && tree_is_plain(); i++)
        guide[i] += 0.5 * dt * dt * last->slope[TREE_SIZE.nq + i];
}

/* Compute the state of the tree from chart coordinates y, on the branch of the near state guide.
 * Nonzero on failure. */
static int near_guide(core_solver *s, const double *y, const double *guide, chart_values *f) {
    memset(f->rate, 0, sizeof f->rate);
    return passage_state(s->passage, s->machine->run->time, y, guide, f->X, f->slope, f->rate,
                         &s->charts->alignment);
}

/* Compute the outputs at the state f->X. Nonzero on failure. */
static int chart_outputs(core_solver *s, chart_values *f) {
    double none[NT];
    if (tree_call(s, f->X, none, f->y)) return 1;
    tree_show_slope(f->slope, f->y); /* valid in the singular configuration too */
    return 0;
}

/* Evaluate the model at chart coordinates y, on the branch of the last accepted states. Nonzero on
 * failure, or if the motion jumps to another branch. */
static int by_chart(core_solver *s, const double *y, chart_values *f) {
    const core_charts *last = s->charts;
    double guide[NT];
    extrapolate(s, guide);
    if (near_guide(s, y, guide, f)) return 1;
    if (passage_jumps(s->passage, last->time, last->X, last->slope,
                      s->machine->run->time - last->time, f->X, f->slope))
        return 1;
    return chart_outputs(s, f);
}

/* Evaluate the model at the states. Nonzero on failure. */
static int at_states(core_solver *s, chart_values *f) {
    const double *x = s->machine->values + CHART_STATES;
    return (s->charts->tangent ? by_chart(s, x, f) : by_joints(s, x, f)) ||
           !all_finite(f->slope, NT);
}

core_status charts_calculate(core_solver *s) {
    machine *m = s->machine;
    double *v = m->values;
    chart_values f;
    int i;
    if (at_states(s, &f))
        return log_failed(
            m->log,
            "at time %.9g the loops have no solution near the last one (%s), or "
            "are in a singular configuration that the motion does not pass; ask for a "
            "smaller tolerance or start elsewhere",
            m->run->time, log_where(m->log));
    memcpy(s->tree->X, f.X, sizeof f.X);
    memcpy(s->tree->slope, f.slope, sizeof f.slope);
    memcpy(v + OUTPUTS, f.y, NY * sizeof *v);
    memcpy(v + CHART_RATES, f.rate, NX * sizeof *v);
    for (i = 0; i < NX; i++) v[STATES + i] = f.X[MODEL_TREE_STATES[i]];
    for (i = 0; i < NX; i++) v[DERIVATIVES + i] = f.slope[MODEL_TREE_STATES[i]];
    for (i = 0; i < NZ; i++) v[DEPENDENTS + i] = f.X[MODEL_TREE_DEPENDENTS[i]];
    return CORE_OK;
}

void charts_accept(core_solver *s) {
    machine *m = s->machine;
    core_charts *last = s->charts;
    last->time = m->run->time;
    memcpy(last->X, s->tree->X, sizeof last->X);
    memcpy(last->slope, s->tree->slope, sizeof last->slope);
    memcpy(m->accepted->x, m->values + STATES, NX * sizeof(double));
    memcpy(m->accepted->z, m->values + DEPENDENTS, NZ * sizeof(double));
}

void charts_show_joints(core_solver *s) {
    double *v = s->machine->values;
    int i;
    for (i = 0; i < NX; i++) v[CHART_STATES + i] = v[STATES + i];
}

/* Evaluate the model at a point displaced by `part` times the direction `along`. ahead (NT,):
 * estimated derivative of the tree state along it, which selects the branch. Nonzero on failure. */
static int displaced(core_solver *s, const charts_tangent *along, const double *ahead, double part,
                     chart_values *f) {
    machine *m = s->machine;
    double *v = m->values, y[NX + 1], guide[NT];
    core_run run = *m->run;
    core_variables variables = *m->variables;
    core_solver_memory memory = *s->memory;
    int i, status;
    m->run->time += part * along->dt;
    for (i = 0; i < NX; i++) y[i] = v[CHART_STATES + i] + part * along->dx[i];
    for (i = 0; i < NU; i++) v[INPUTS + i] += part * along->du[i];
    for (i = 0; i < NP; i++) v[PARAMETERS + i] += part * along->dp[i];
    for (i = 0; i < NT; i++) guide[i] = s->tree->X[i] + part * ahead[i];
    status = near_guide(s, y, guide, f) || chart_outputs(s, f);
    *m->run = run;
    *m->variables = variables;
    *s->memory = memory;
    return status;
}

/* Largest velocity, or square root of an acceleration, of the tree in typical sizes [1/s]. */
static double typical_rate(const core_tree *tree) {
    double rate = 0.0;
    int i;
    for (i = 0; i < TREE_SIZE.nv; i++) {
        rate = fmax(rate, fabs(tree->X[TREE_SIZE.nq + i]) * MODEL_TREE_UNITS[i]);
        rate = fmax(rate, sqrt(fabs(tree->slope[TREE_SIZE.nq + i]) * MODEL_TREE_UNITS[i]));
    }
    return rate > 0.0 ? rate : 1.0;
}

/* Distance of two states and their derivatives, in typical sizes. */
static double distance(const chart_values *a, const chart_values *b, double rate) {
    double far = 0.0;
    int i, plain = tree_is_plain();
    for (i = 0; i < TREE_SIZE.nq; i++)
        far = fmax(far, fabs(a->X[i] - b->X[i]) * (plain ? MODEL_TREE_UNITS[i] : 1.0));
    for (i = 0; i < TREE_SIZE.nv; i++) {
        int k = TREE_SIZE.nq + i;
        far = fmax(far, fabs(a->X[k] - b->X[k]) * MODEL_TREE_UNITS[i] / rate);
        far = fmax(far, fabs(a->slope[k] - b->slope[k]) * MODEL_TREE_UNITS[i] / (rate * rate));
    }
    return far;
}

/* Find *step, the multiple of a direction that displaces the state by about DIFFERENCE, and ahead,
 * the derivative of the tree state along the direction. Returns 1 on failure. */
static int step_of(core_solver *s, const charts_tangent *along, double rate, double *ahead,
                   double *step) {
    const double *v = s->machine->values;
    double size = rate * fabs(along->dt), far, longest = HUGE_VAL;
    chart_values f[2];
    int i, pass;
    for (i = 0; i < NX; i++) size = fmax(size, fabs(along->dx[i]));
    for (i = 0; i < NU; i++) size = fmax(size, fabs(along->du[i]) / fmax(1.0, fabs(v[INPUTS + i])));
    for (i = 0; i < NP; i++)
        size = fmax(size, fabs(along->dp[i]) / fmax(DBL_MIN, fabs(v[PARAMETERS + i])));
    *step = FIRST_STEP / fmax(size, DBL_MIN / DBL_EPSILON);
    memset(ahead, 0, NT * sizeof *ahead);
    for (pass = 0; pass < STEPS; pass++) {
        if (displaced(s, along, ahead, -*step, f) || displaced(s, along, ahead, *step, f + 1)) {
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
    return displaced(s, along, ahead, *step, f);
}

/* Derivative by central differences of sixth order. d: f(k step) - f(-k step) for k = 1, 2, 3.
 * *error: difference from the derivative of fourth order. */
static double derivative(const double *d, double step, double *error) {
    double six = (45.0 * d[0] - 9.0 * d[1] + d[2]) / (60.0 * step);
    *error = fabs(six - (8.0 * d[0] - d[1]) / (12.0 * step));
    return six;
}

#define DERIVATIVE_OF(field)                                         \
    (d[0] = f[1].field - f[0].field, d[1] = f[3].field - f[2].field, \
     d[2] = f[5].field - f[4].field, derivative(d, step, &error))

core_status charts_difference(core_solver *s, charts_tangent *along) {
    double rate = typical_rate(s->tree), step, d[3], error, most = 0.0, worst = 0.0;
    chart_values f[6];
    double ahead[NT];
    int i, k, status;
    status = step_of(s, along, rate, ahead, &step);
    for (k = 0; k < 6 && !status; k++)
        status = displaced(s, along, ahead, (k % 2 ? step : -step) * (k / 2 + 1), f + k);
    if (status)
        return log_failed(s->machine->log, "no derivative at time %.9g", s->machine->run->time);
    for (i = 0; i < TREE_SIZE.nv; i++) {
        double scale = MODEL_TREE_UNITS[i];
        most = fmax(most, fabs(DERIVATIVE_OF(slope[TREE_SIZE.nq + i])) * scale);
        worst = fmax(worst, error * scale);
    }
    if (!(worst <= INACCURATE * most + IDLE * rate * rate * DIFFERENCE / step))
        return machine_not_differentiable(s->machine, 0.0);
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
