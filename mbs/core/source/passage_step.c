#include "passage_step.h"

#include <math.h>
#include <string.h>

#include "dopri5.h"
#include "passage_chart.h"
#include "passage_crossing.h"
#include "passage_near_miss.h"
#include "passage_origin.h"
#include "passage_start.h"

/* Number of steps over which the regularity is extrapolated, a little more than the next step. With
 * ten times more the error of a linkage at a tolerance of 1e-10 rises from 0.06 to 3.7 tolerances;
 * with a tenth no motion of the tests changes. */
#define STEPS_AHEAD 1.2

/* Fraction of the velocities, or of the distance that they move in a step, by which a state may
 * differ from the explicit result of the stages. The error control permits a hundredth of it. On
 * another branch the velocities differ by about their own size, a hundred times as much. */
#define BRANCH_DIFFERENCE 0.01

/* Rounding error of u' [rad/s2 or m/s2] for accelerations and sigma of size one, about the
 * rounding of a double. It is added to the tolerance. Ten times more accepts an error of 8.3
 * tolerances at a near miss by 1e-8 m. */
#define ROUNDING 3e-16

/* Multiple of atol (half a tolerance) that limits the rounding error of a stage near a singular
 * configuration. A larger error rejects a step that starts further away. The next shorter step has
 * the singular configuration between two stages. */
#define NOISE_REJECTED 15.0

/* Number of consecutive rejected steps before more rounding is accepted. Each is shorter by a
 * factor of 0.83, so that the last one has 0.83^8 = 0.2 of the first length. */
#define NOISE_REJECTIONS 8

/* Multiple of atol (40 tolerances) that limits the rounding error of a stage after these
 * rejections. It applies only if no step has the singular configuration between two stages.
 * Other values were not compared. */
#define NOISE_ACCEPTED 1000.0

int step_leaves_branch(const passage *g, const double *x, const double *along, double h, double a) {
    int nq = g->size.nq, nv = g->size.nv, i;
    double v = h * a, move = 0.0, change = 0.0, zero = g->stepper->atol; /* at rest */
    for (i = 0; i < nv; i++) {
        v = fmax(v, fmax(fabs(x[nq + i]), fabs(along[nq + i])));
        change = fmax(change, fabs(x[nq + i] - along[nq + i]));
    }
    for (i = 0; i < nq; i++) move = fmax(move, fabs(x[i] - along[i]));
    return change > BRANCH_DIFFERENCE * v + zero || move > BRANCH_DIFFERENCE * h * v + zero;
}

/* Compute the error estimate of a step in the chart, in the coordinates (n,) of the tree. */
static void chart_error(const passage *g, double h, double *error) {
    int nq = g->size.nq, nv = g->size.nv, nz = g->size.nz, d = g->chart.dimension, i, j, k;
    const double *T = g->origin.T, *N = g->origin.rows.N;
    double *e = g->scratch.w;
    for (i = 0; i < 2 * d + nz; i++) {
        double sum = 0.0;
        for (j = 0; j < 7; j++) sum += DOPRI5_E[j] * g->stages.slope_y[j][i];
        e[i] = h * sum;
    }
    memset(error, 0, sizeof(double) * (size_t)(nq + nv));
    for (i = 0; i < nv; i++) {
        double move = 0.0;
        for (k = 0; k < d; k++) {
            move += T[k * nv + i] * e[k];
            error[nq + i] += T[k * nv + i] * e[d + k];
        }
        if (nq == nv)
            error[i] += move;
        else
            for (j = g->patterns.N.start[i]; j < g->patterns.N.start[i + 1]; j++)
                error[g->patterns.N.row[j]] += N[j] * move;
    }
    memcpy(error + nq + nv, e + 2 * d, sizeof(double) * (size_t)nz);
}

/* Rounding error of a velocity change. sigma: fraction of the largest sigma. */
static double rounding_error(double change, double sigma) {
    return ROUNDING * change / (sigma * sigma);
}

/* Evaluate the stages of a step of length h from the prepared state at time t. y: result (n,). *a:
 * largest acceleration. Returns a status of the stepper. */
static int evaluate_stages(passage *g, double t, double h, double *y, double *a) {
    int nq = g->size.nq, nv = g->size.nv, ny = 2 * g->chart.dimension + g->size.nz, i, j, k;
    g->step.sigma = HUGE_VAL;
    for (k = 0; k < 7; k++) {
        double *to = k == 6 ? y : g->scratch.state;
        int status;
        for (i = 0; i < ny; i++) {
            double sum = 0.0;
            for (j = 0; j < k; j++) sum += DOPRI5_A[k][j] * g->stages.slope_y[j][i];
            g->stages.y[i] = g->prepared.y[i] + h * sum;
        }
        status = crossing_state(g, t + DOPRI5_C[k] * h, g->stages.y, to, g->stages.slope_x[k],
                                g->stages.slope_y[k]);
        if (status) return status;
        for (i = 0; i < nv; i++) *a = fmax(*a, fabs(g->stages.slope_x[k][nq + i]));
    }
    return STEPPER_OK;
}

/* Whether the step must be rejected because the rounding error of a stage, near a singular
 * configuration, exceeds the tolerance. change: largest change of velocity in the step. */
static int too_much_rounding(const passage *g, double change) {
    const stepper *s = g->stepper;
    double limit = g->step.rejections < NOISE_REJECTIONS ? NOISE_REJECTED : NOISE_ACCEPTED;
    return rounding_error(change, g->origin.sigma / g->memory->sigma_max) <
               NOISE_REJECTED * s->atol &&
           s->noise > limit * s->atol;
}

/* Attempt one step of dopri5 in the chart. Returns a status of the stepper. */
static int attempt_in_chart(passage *g, const double *x, double h) {
    stepper *s = g->stepper;
    double t = stepper_time(s), a = 0.0, *candidate = stepper_candidate(s);
    double *explicit_result = g->scratch.state;
    int begun, i, j, status = origin_prepare(g, t, x);
    if (!status) status = evaluate_stages(g, t, h, candidate, &a);
    if (status) return status;
    /* A step may end in the singular configuration at a limit, or if it began there: a slow motion
     * needs many steps to leave it. */
    begun = g->memory->origin_time != t || memcmp(g->origin_state, x, sizeof *x * (size_t)s->n);
    if (!s->cut && !begun &&
        (g->step.singular || g->point.sigma < SIGMA_REGULAR * g->memory->sigma_max))
        return STEPPER_ENDS_SINGULAR;
    if (near_miss_jumped(g, t, x, h, candidate, g->stages.slope_x[0], g->stages.slope_x[6]))
        return STEPPER_CHART_LEFT;
    for (i = 0; i < s->n; i++) { /* from the slopes of the stages, without the rows */
        double sum = 0.0;
        for (j = 0; j < 6; j++) sum += DOPRI5_A[6][j] * g->stages.slope_x[j][i];
        explicit_result[i] = x[i] + h * sum;
    }
    if (step_leaves_branch(g, candidate, explicit_result, h, a)) return STEPPER_CHART_LEFT;
    chart_error(g, h, stepper_trial(s));
    s->noise = rounding_error(h * a, g->step.sigma);
    if (!begun && !s->cut && !g->step.missed && too_much_rounding(g, h * a)) {
        g->step.rejections++;
        return STEPPER_ENDS_SINGULAR;
    }
    s->kept_closed = 1;
    return STEPPER_OK;
}

/* Smallest regularity expected in the next step h, by linear extrapolation. */
static double expected_regularity(passage *g, double t, const double *x, double h) {
    passage_memory *m = g->memory;
    if (!(m->regularity_known > 0.0) || t != m->regularity_time) {
        m->regularity = crossing_regularity(g, t, x);
        m->regularity_time = t;
        m->regularity_known = 1.0;
    }
    return fmin(m->regularity, m->regularity + STEPS_AHEAD * h * m->regularity_rate);
}

/* Attempt a step of the wrapped method, or a step in the chart if the regularity is too small. */
static int attempt_step(stepper *s, const double *x, double h) {
    passage *g = s->passage;
    double t = stepper_time(s), ahead = expected_regularity(g, t, x, h),
           on = PASSAGE_ON * g->memory->regularity_max;
    int status;
    g->step.charted = s->kept_closed = 0;
    s->noise = 0.0;
    if (ahead >= on) {
        status = g->step.opened || !g->regular->open ? STEPPER_OK : g->regular->open(s, x);
        if (status) return status;
        g->step.opened = 1;
        status = g->regular->attempt(s, x, h);
        if (status || crossing_regularity(g, t + h, stepper_candidate(s)) >= on) {
            g->step.missed = 0;
            return status;
        }
    }
    g->step.charted = 1;
    status = attempt_in_chart(g, x, h);
    if (g->step.missed && (status == STEPPER_SINGULAR || status == STEPPER_ENDS_SINGULAR))
        return STEPPER_NEAR_MISS;
    return status;
}

/* Store the dense output of an accepted step, and the regularity at its end. */
static void keep_dense_output(stepper *s, const double *x, double h) {
    passage *g = s->passage;
    passage_memory *m = g->memory;
    double t = stepper_time(s) + h, *y = stepper_candidate(s), value;
    int n = s->n, i, j;
    value = crossing_regularity(g, t, y);
    m->regularity_rate = (value - m->regularity) / h;
    m->regularity = value;
    m->regularity_time = t;
    g->step.kept = g->step.charted;
    g->step.rejections = 0;
    if (!g->step.charted) {
        g->regular->keep(s, x, h);
        return;
    }
    dopri5_hermite(n, x, y, h, g->stages.slope_x[0], g->stages.slope_x[6], g->dense.accepted);
    for (i = 0; i < n; i++) {
        double sum = 0.0;
        for (j = 0; j < 7; j++) sum += DOPRI5_D[j] * g->stages.slope_x[j][i];
        g->dense.accepted[4 * n + i] = h * sum;
    }
}

/* End a step: store the slope of the last stage in the chart. */
static int close_step(stepper *s, double t) {
    passage *g = s->passage;
    g->step.opened = 0;
    if (!g->step.charted) return g->regular->close(s, t);
    stepper_close(s, g->stages.slope_x[6]);
    return STEPPER_OK;
}

/* Evaluate the dense output of the last step at the fraction a. */
static void interpolate_step(const stepper *s, double a, double *row) {
    const passage *g = s->passage;
    if (g->step.kept)
        dopri5_interpolate(g->dense.accepted, s->n, a, row);
    else
        g->regular->interpolate(s, a, row);
}

/* Postpone `open` of the wrapped method, which may compute a Jacobian, until a full step is made:
 * near singular configurations the Jacobian may have no value. */
static int postpone_open(stepper *s, const double *x) {
    passage *g = s->passage;
    (void)x;
    g->step.opened = 0;
    return STEPPER_OK;
}

/* Set the slope at the start of a step, from the chart if the rows are nearly dependent. */
static int slope_at_start(stepper *s, const double *x) {
    return passage_slope(s->passage, stepper_time(s), x, stepper_slope(s), NULL);
}

const stepper_method PASSAGE_METHOD = {postpone_open, attempt_step,     keep_dense_output,
                                       close_step,    interpolate_step, slope_at_start};
