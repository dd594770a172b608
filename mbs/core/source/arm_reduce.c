#include "arm_reduce.h"

#include <math.h>

#include "dense.h"

enum { STEPS = 12 };
static const double CONVERGED = 1e-11; /* step and equations: rounding, magnified by the inverse */
static const double FINISHED = 1e-14;  /* step [rad or arm lengths] that gains nothing */
static const double FARTHEST = 0.5;    /* largest step of a joint [rad or arm lengths] */

static double dot(const double *x, const double *y, int n) {
    double sum = 0.0;
    int k;
    for (k = 0; k < n; k++) sum += x[k] * y[k];
    return sum;
}

/* Newton step from x for the solved equations and given coordinates h along the null directions. */
static int step_from(const arm *a, const configuration *p, const arm_reduction *r, const double *h,
                     double *x, double *longest) {
    double A[ARM_JOINTS * ARM_JOINTS], b[ARM_JOINTS], away[ARM_JOINTS], most = 0.0;
    int j, k, n = a->n, rank = n - r->corank;
    dense_qr f;
    for (k = 0; k < n; k++) away[k] = x[k] - r->centre[k];
    for (j = 0; j < n; j++) {
        const double *null = r->null + (j - rank) * n, *solved = r->solved + 6 * j;
        b[j] = j < rank ? dot(solved, p->gap, 6) : h[j - rank] - dot(null, away, n);
        for (k = 0; k < n; k++) A[k * n + j] = j < rank ? dot(solved, p->J[k], 6) : null[k];
        if (!(fabs(b[j]) <= most)) most = fabs(b[j]);
    }
    f.rows = f.columns = f.steps = n;
    f.A = A;
    dense_factorize(&f);
    dense_solve(&f, b, 1, 0.0);
    *longest = 0.0;
    for (k = 0; k < n; k++) {
        double dx = fabs(b[k]) < HUGE_VAL ? fmax(-FARTHEST, fmin(b[k], FARTHEST)) : 0.0;
        x[k] += dx;
        *longest = fmax(*longest, fabs(dx));
    }
    return most < CONVERGED && *longest < CONVERGED;
}

int arm_reduced(const arm *a, const double *target, const arm_reduction *r, const double *h,
                double *x, double *g) {
    configuration p;
    double longest = 1.0;
    int i, k, step, found = 0, n = a->n, rank = n - r->corank;
    for (k = 0; k < n; k++) {
        x[k] = r->centre[k];
        for (i = 0; i < r->corank; i++) x[k] += r->null[i * n + k] * h[i];
    }
    for (step = 0; step <= STEPS; step++) {
        for (k = 0; k < n; k++) p.q[k] = arm_unit(a, k) * x[k];
        arm_examine(a, target, &p);
        if (step == STEPS || longest < FINISHED) break;
        found = step_from(a, &p, r, h, x, &longest);
    }
    for (i = 0; i < 6 - rank; i++) g[i] = -dot(r->left + 6 * i, p.gap, 6);
    return found;
}
