#include "dopri5.h"

#include "finite.h"

const double DOPRI5_C[7] = {0.0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1.0, 1.0};
const double DOPRI5_A[7][6] = {
    {0},
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
const double DOPRI5_E[7] = {71.0 / 57600,      0.0,          -71.0 / 16695, 71.0 / 1920,
                            -17253.0 / 339200, 22.0 / 525.0, -1.0 / 40};
const double DOPRI5_D[7] = {-12715105075.0 / 11282082432,  0.0,
                            87487479700.0 / 32700410799,   -10690763975.0 / 1880347072,
                            701980252875.0 / 199316789632, -1453857185.0 / 822651844,
                            69997945.0 / 29380423};

/* Layout of `work` after the first 2n elements: stages k2 .. k7 (6n), dense output (5n). */
static double *stage(const stepper *s, int i) {
    return i == 0 ? stepper_slope(s) : s->work + (size_t)(1 + i) * s->n;
}
static double *dense(const stepper *s, int i) { return s->work + (size_t)(8 + i) * s->n; }

static double combine(const stepper *s, const double *weight, int count, int row) {
    double sum = 0.0;
    int j;
    for (j = 0; j < count; j++) sum += weight[j] * stage(s, j)[row];
    return sum;
}

/* Compute stages 2 to 7, the candidate state (the point of stage 7) and the error estimate. */
static int attempt(stepper *s, const double *x, double h) {
    double t = stepper_time(s), *e = stepper_trial(s);
    int i, k, status;
    for (k = 1; k < 7; k++) {
        double *y = k == 6 ? stepper_candidate(s) : stepper_trial(s);
        for (i = 0; i < s->n; i++) y[i] = x[i] + h * combine(s, DOPRI5_A[k], k, i);
        if (!all_finite(y, s->n)) return STEPPER_NOT_FINITE;
        status = stepper_evaluate(s, t + DOPRI5_C[k] * h, y, stage(s, k));
        if (status) return status;
    }
    for (i = 0; i < s->n; i++) e[i] = h * combine(s, DOPRI5_E, 7, i);
    return STEPPER_OK;
}

static void keep(stepper *s, const double *x, double h) {
    const double *y = stepper_candidate(s), *k1 = stage(s, 0), *k7 = stage(s, 6);
    int i;
    for (i = 0; i < s->n; i++) {
        double rise = y[i] - x[i], bend = h * k1[i] - rise;
        dense(s, 0)[i] = x[i];
        dense(s, 1)[i] = rise;
        dense(s, 2)[i] = bend;
        dense(s, 3)[i] = rise - h * k7[i] - bend;
        dense(s, 4)[i] = h * combine(s, DOPRI5_D, 7, i);
    }
}

static int close(stepper *s, double t) {
    double *next = stage(s, 6);
    if (s->corrected) {
        int status = stepper_evaluate(s, t, stepper_candidate(s), next);
        if (status) return status;
    }
    stepper_close(s, next);
    return STEPPER_OK;
}

void dopri5_interpolate(const double *dense, int n, double a, double *row) {
    const double *d = dense;
    double b = 1.0 - a;
    int i;
    for (i = 0; i < n; i++)
        row[i] = d[i] + a * (d[n + i] + b * (d[2 * n + i] + a * (d[3 * n + i] + b * d[4 * n + i])));
}

void dopri5_hermite(int n, const double *x, const double *y, double h, const double *first,
                    const double *last, double *dense) {
    int i;
    for (i = 0; i < n; i++) {
        double rise = y[i] - x[i], bend = h * first[i] - rise;
        dense[i] = x[i];
        dense[n + i] = rise;
        dense[2 * n + i] = bend;
        dense[3 * n + i] = rise - h * last[i] - bend;
        dense[4 * n + i] = 0.0;
    }
}

static void interpolate(const stepper *s, double a, double *row) {
    dopri5_interpolate(dense(s, 0), s->n, a, row);
}

void dopri5_init(stepper *s, int n, stepper_rhs rhs, void *user, double *memory, double *work) {
    static const stepper_method method = {NULL, attempt, keep, close, interpolate, NULL};
    stepper_init(s, n, &method, rhs, user, memory, work);
}
