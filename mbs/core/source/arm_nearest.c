#include "arm_nearest.h"

#include <math.h>
#include <string.h>

#include "arm_search.h"

enum { KEPT = 8, REFINEMENTS = 60 };
static const double NUDGE = 1e-5;   /* joint step of finite differences of the slope */
static const double FLAT = 1e-15;   /* slope that is rounding */
static const double FINEST = 1e-31; /* cost below which nothing can be gained */
static const double ALIKE = 1e-14;  /* relative rounding of costs */
static const double EQUAL = 1e-6;   /* relative difference of costs of the same minimum */

typedef double matrix[ARM_JOINTS][ARM_JOINTS];

/* Half the gradient of the cost. It is exact, although J has the angular velocity and not the rate
 * of the rotation vector, because that vector is the axis of its own rotation. */
static void slope(const arm *a, const configuration *p, double *g) {
    int j, k;
    for (j = 0; j < a->n; j++) {
        g[j] = 0.0;
        for (k = 0; k < 6; k++) g[j] -= p->J[j][k] * p->gap[k];
    }
}

static double norm(const double *v, int n) {
    double sum = 0.0;
    int i;
    for (i = 0; i < n; i++) sum += v[i] * v[i];
    return sqrt(sum);
}

/* Hessian H by finite differences of the slope. */
static void curvature(const arm *a, const double *target, const configuration *p, matrix H) {
    double ahead[ARM_JOINTS], behind[ARM_JOINTS];
    configuration near;
    int i, k;
    configuration_copy(a, &near, p);
    for (k = 0; k < a->n; k++) {
        near.q[k] = p->q[k] + NUDGE * arm_unit(a, k);
        arm_examine(a, target, &near);
        slope(a, &near, ahead);
        near.q[k] = p->q[k] - NUDGE * arm_unit(a, k);
        arm_examine(a, target, &near);
        slope(a, &near, behind);
        near.q[k] = p->q[k];
        for (i = 0; i < a->n; i++) H[i][k] = (ahead[i] - behind[i]) / (2.0 * NUDGE);
    }
}

/* Solves (H + shift) dx = -g by Cholesky. Returns 1 if the matrix is not positive definite. */
static int newton_step(const matrix H, int n, double shift, const double *g, double *dx) {
    matrix L;
    int i, j, k;
    for (j = 0; j < n; j++) {
        dx[j] = -g[j];
        for (i = j; i < n; i++) {
            double sum = 0.5 * (H[i][j] + H[j][i]) + (i == j ? shift : 0.0);
            for (k = 0; k < j; k++) sum -= L[i][k] * L[j][k];
            if (i == j && !(sum > 0.0)) return 1;
            L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
        }
        for (k = 0; k < j; k++) dx[j] -= L[j][k] * dx[k];
        dx[j] /= L[j][j];
    }
    for (j = n - 1; j >= 0; j--) {
        for (k = j + 1; k < n; k++) dx[j] -= L[k][j] * dx[k];
        dx[j] /= L[j][j];
    }
    return 0;
}

/* Whether a step is an improvement. Near a minimum the slope decides: costs are rounding. */
static int lower(double cost, double slope, double old_cost, double old_slope) {
    return cost < old_cost * (1.0 - ALIKE) ||
           (cost < old_cost * (1.0 + ALIKE) && slope < 0.5 * old_slope);
}

/* Newton's method to the local minimum near p. */
static void refine(const arm *a, const double *target, configuration *p) {
    double g[ARM_JOINTS], next_g[ARM_JOINTS], dx[ARM_JOINTS], shift = 1e-9;
    int k, step, known = 0;
    configuration next;
    matrix H;
    slope(a, p, g);
    for (step = 0; step < REFINEMENTS && p->cost > FINEST && norm(g, a->n) > FLAT; step++) {
        if (!known) curvature(a, target, p, H);
        known = 1;
        if (shift > 1e6) return;
        if (!newton_step((const double (*)[ARM_JOINTS])H, a->n, shift, g, dx)) {
            for (k = 0; k < a->n; k++) next.q[k] = p->q[k] + arm_unit(a, k) * dx[k];
            arm_examine(a, target, &next);
            slope(a, &next, next_g);
            if (lower(next.cost, norm(next_g, a->n), p->cost, norm(g, a->n))) {
                configuration_copy(a, p, &next);
                memcpy(g, next_g, (size_t)a->n * sizeof *g);
                shift = fmax(0.1 * shift, 1e-12);
                known = 0;
                continue;
            }
        }
        shift = fmax(10.0 * shift, 1e-6);
    }
}

/* Inserts p into the list of the best different minima, sorted by cost. Returns their number. */
static int keep(const arm *a, const configuration *p, configuration *best, int count) {
    int i, rank = 0;
    while (rank < count && best[rank].cost <= p->cost) rank++;
    if (rank > 0 && p->cost - best[rank - 1].cost < EQUAL * p->cost) return count;
    if (rank == KEPT) return count;
    if (count < KEPT) count++;
    for (i = count - 1; i > rank; i--) configuration_copy(a, &best[i], &best[i - 1]);
    configuration_copy(a, &best[rank], p);
    return count;
}

double arm_nearest(const arm *a, const double *target, long long starts, unsigned long long seed,
                   double *q) {
    configuration best[KEPT], p;
    int count = 0, i, nearest = 0;
    long long start;
    for (start = 0; start < starts; start++) {
        arm_start(a, target, seed, start, p.q);
        arm_descend(a, target, &p);
        count = keep(a, &p, best, count);
    }
    for (i = 0; i < count; i++) {
        refine(a, target, &best[i]);
        if (best[i].cost < best[nearest].cost) nearest = i;
    }
    memcpy(q, best[nearest].q, (size_t)a->n * sizeof(double));
    arm_wrap(a, q);
    return best[nearest].cost;
}
