#include "arm.h"

#include <math.h>
#include <string.h>

enum { STALLS = 3, ROWS = 6 + ARM_JOINTS };
static const double FINE = 1e-26;   /* costs below it are those of solutions but for rounding */
static const double FINEST = 1e-31; /* nothing is left to gain */
static const double WEAK = 1e-8;    /* pivots of squares below it are taken for rounding */
static const double LEAST = 1e-31;  /* damping, so that no matrix is singular */

/* (J' J + shift) dx = J' gap by Cholesky. 0: too close to singular. */
static int normal_step(const arm *a, const configuration *p, double shift, double *dx) {
    double L[ARM_JOINTS][ARM_JOINTS], most = 0.0;
    int i, j, k, n = a->n;
    for (j = 0; j < n; j++) {
        for (i = j; i < n; i++) {
            double sum = i == j ? shift : 0.0;
            for (k = 0; k < 6; k++) sum += p->J[i][k] * p->J[j][k];
            for (k = 0; k < j; k++) sum -= L[i][k] * L[j][k];
            if (i > j) {
                L[i][j] = sum * L[j][j];
            } else {
                if (sum > most) most = sum;
                if (!(sum > WEAK * most)) return 0;
                L[j][j] = 1.0 / sqrt(sum);
            }
        }
        dx[j] = 0.0;
        for (k = 0; k < 6; k++) dx[j] += p->J[j][k] * p->gap[k];
        for (k = 0; k < j; k++) dx[j] -= L[j][k] * dx[k];
        dx[j] *= L[j][j];
    }
    for (j = n - 1; j >= 0; j--) {
        for (k = j + 1; k < n; k++) dx[j] -= L[k][j] * dx[k];
        dx[j] *= L[j][j];
    }
    return 1;
}

/* Reflects columns j .. n so that column j ends at its element j. */
static void reflect(double A[ARM_JOINTS + 1][ROWS], int j, int n, int rows) {
    double size = 0.0, scale;
    int i, k;
    for (i = j; i < rows; i++) size += A[j][i] * A[j][i];
    if (size == 0.0) return;
    size = A[j][j] > 0.0 ? -sqrt(size) : sqrt(size);
    A[j][j] -= size;
    scale = 1.0 / (size * A[j][j]);
    for (k = j + 1; k <= n; k++) {
        double sum = 0.0;
        for (i = j; i < rows; i++) sum += A[j][i] * A[k][i];
        for (i = j; i < rows; i++) A[k][i] += scale * sum * A[j][i];
    }
    A[j][j] = size;
}

/* The same step by reflections of [J gap; sqrt(shift) 0], which do not square the Jacobian. */
static void orthogonal_step(const arm *a, const configuration *p, double shift, double *dx) {
    double A[ARM_JOINTS + 1][ROWS] = {{0.0}};
    int j, k, n = a->n, rows = 6 + a->n;
    for (j = 0; j < n; j++) {
        memcpy(A[j], p->J[j], sizeof p->J[j]);
        A[j][6 + j] = sqrt(shift);
    }
    memcpy(A[n], p->gap, sizeof p->gap);
    for (j = 0; j < n; j++) reflect(A, j, n, rows);
    for (j = n - 1; j >= 0; j--) {
        dx[j] = A[n][j];
        for (k = j + 1; k < n; k++) dx[j] -= A[k][j] * dx[k];
        dx[j] /= A[j][j];
    }
}

/* The configuration after one step. */
static void attempt(const arm *a, const double *target, const configuration *from, double damping,
                    configuration *to) {
    double dx[ARM_JOINTS], shift = damping * from->cost + LEAST;
    int k;
    if (!normal_step(a, from, shift, dx)) orthogonal_step(a, from, shift, dx);
    for (k = 0; k < a->n; k++) to->q[k] = from->q[k] + arm_unit(a, k) * dx[k];
    arm_examine(a, target, to);
}

/* The damping is proportional to the cost, which makes the last steps those of Newton
 * (Yamashita and Fukushima 2001), even where the Jacobian loses rank. */
void arm_descend(const arm *a, const double *target, configuration *p) {
    double damping = 0.1;
    int stalls = 0, step;
    configuration next;
    arm_examine(a, target, p);
    for (step = 0; step < ARM_STEPS && p->cost > FINEST && stalls < STALLS; step++) {
        double gain;
        attempt(a, target, p, damping, &next);
        if (!(next.cost < p->cost)) {
            damping = damping < 1e-3 ? 1e-2 : 4.0 * damping;
            stalls += p->cost < FINE || damping * p->cost > 1e12;
            continue;
        }
        gain = 1.0 - next.cost / p->cost;
        damping *= gain > 0.5 ? 0.2 : gain > 0.1 ? 0.5 : 2.0;
        stalls = gain < 5e-2 ? stalls + 1 : 0;
        *p = next;
    }
}

double arm_polish(const arm *a, const double *target, double *q) {
    double before, after, T[16];
    configuration p;
    memcpy(p.q, q, (size_t)a->n * sizeof(double));
    arm_pose(a, q, T);
    before = arm_residual(target, T);
    arm_descend(a, target, &p);
    arm_wrap(a, p.q);
    arm_pose(a, p.q, T);
    after = arm_residual(target, T);
    if (!(after < before)) return before;
    memcpy(q, p.q, (size_t)a->n * sizeof(double));
    return after;
}
