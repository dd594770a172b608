#include "dopri5.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum { TIME, STEP, ERROR, SLOPE_VALID, LAST_STEP, SLOPE }; /* places in memory */

static const double C[7] = {0.0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1.0, 1.0};
static const double A[7][6] = {
    {0},
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
static const double E[7] = {71.0 / 57600,      0.0,          -71.0 / 16695, 71.0 / 1920,
                            -17253.0 / 339200, 22.0 / 525.0, -1.0 / 40};
static const double D[7] = {-12715105075.0 / 11282082432,  0.0,
                            87487479700.0 / 32700410799,   -10690763975.0 / 1880347072,
                            701980252875.0 / 199316789632, -1453857185.0 / 822651844,
                            69997945.0 / 29380423};

static const double SAFETY = 0.9, SHRINK = 0.2, GROW = 10.0, BETA = 0.04;

/* work: k2 .. k7 (6n), a state (n), the new state (n), dense output (5n) */
static double *stage(const dopri5 *s, int i) {
    return i == 0 ? s->memory + SLOPE : s->work + (size_t)(i - 1) * s->n;
}
static double *trial(const dopri5 *s) { return s->work + 6 * (size_t)s->n; }
static double *candidate(const dopri5 *s) { return s->work + 7 * (size_t)s->n; }
static double *dense(const dopri5 *s, int i) { return s->work + (size_t)(8 + i) * s->n; }

static int all_finite(const double *v, int n) {
    int i;
    for (i = 0; i < n; i++)
        if (!isfinite(v[i])) return 0;
    return 1;
}

void dopri5_init(dopri5 *s, int n, dopri5_rhs rhs, void *user, double *memory, double *work) {
    memset(s, 0, sizeof *s);
    s->n = n;
    s->rhs = rhs;
    s->user = user;
    s->rtol = s->atol = 1e-8;
    s->h_max = HUGE_VAL;
    s->max_steps = 100000;
    s->memory = memory;
    s->work = work;
}

void dopri5_start(dopri5 *s, double t) {
    memset(s->memory, 0, sizeof(double) * (size_t)DOPRI5_MEMORY(s->n));
    s->memory[TIME] = t;
    s->memory[ERROR] = 1e-4;
    s->steps = s->rejected = s->since_output = 0;
}

void dopri5_restart(dopri5 *s) {
    s->memory[SLOPE_VALID] = 0.0;
    s->memory[ERROR] = 1e-4;
}

double dopri5_time(const dopri5 *s) { return s->memory[TIME]; }
double dopri5_wanted_step(const dopri5 *s) { return s->memory[STEP]; }

static int slope(const dopri5 *s, double t, const double *x, double *xdot) {
    if (s->rhs(s->user, t, x, xdot)) return DOPRI5_RHS_FAILED;
    return all_finite(xdot, s->n) ? DOPRI5_OK : DOPRI5_NOT_FINITE;
}

static double norm(const dopri5 *s, const double *v, const double *x, const double *y) {
    double sum = 0.0;
    int i;
    for (i = 0; i < s->n; i++) {
        double size = s->nominal ? s->nominal[i] : 1.0;
        double r = v[i] / (s->atol * size + s->rtol * fmax(fabs(x[i]), fabs(y[i])));
        sum += r * r;
    }
    return s->n ? sqrt(sum / s->n) : 0.0;
}

/* A step that an explicit Euler step and its curvature suggest (Hairer et al. 1993, II.4). */
static double first_step(dopri5 *s, const double *x, double span) {
    const double *k1 = stage(s, 0);
    double *y = trial(s), *k2 = stage(s, 1), d0, d1, d2, h0, h1;
    int i;
    d0 = norm(s, x, x, x);
    d1 = norm(s, k1, x, x);
    h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h0 = fmin(h0, span);
    for (i = 0; i < s->n; i++) y[i] = x[i] + h0 * k1[i];
    if (slope(s, s->memory[TIME] + h0, y, k2)) return h0 * 1e-3;
    for (i = 0; i < s->n; i++) y[i] = k2[i] - k1[i];
    d2 = norm(s, y, x, x) / h0;
    h1 = fmax(d1, d2) <= 1e-15 ? fmax(1e-6, h0 * 1e-3) : pow(0.01 / fmax(d1, d2), 0.2);
    return fmin(fmin(100 * h0, h1), span);
}

/* The six new stages and the candidate state, which is where the last of them is taken. */
static int stages(dopri5 *s, const double *x, double h) {
    double t = s->memory[TIME];
    int i, j, k, status;
    for (k = 1; k < 7; k++) {
        double *y = k == 6 ? candidate(s) : trial(s);
        for (i = 0; i < s->n; i++) {
            double sum = 0.0;
            for (j = 0; j < k; j++) sum += A[k][j] * stage(s, j)[i];
            y[i] = x[i] + h * sum;
        }
        if (!all_finite(y, s->n)) return DOPRI5_NOT_FINITE;
        status = slope(s, t + C[k] * h, y, stage(s, k));
        if (status) return status;
    }
    return DOPRI5_OK;
}

static double error_of(dopri5 *s, const double *x, double h) {
    double *e = trial(s);
    int i, j;
    for (i = 0; i < s->n; i++) {
        double sum = 0.0;
        for (j = 0; j < 7; j++) sum += E[j] * stage(s, j)[i];
        e[i] = h * sum;
    }
    return norm(s, e, x, candidate(s));
}

static void keep_dense(dopri5 *s, const double *x, double h) {
    const double *y = candidate(s), *k1 = stage(s, 0), *k7 = stage(s, 6);
    int i, j;
    for (i = 0; i < s->n; i++) {
        double rise = y[i] - x[i], bend = h * k1[i] - rise, sum = 0.0;
        for (j = 0; j < 7; j++) sum += D[j] * stage(s, j)[i];
        dense(s, 0)[i] = x[i];
        dense(s, 1)[i] = rise;
        dense(s, 2)[i] = bend;
        dense(s, 3)[i] = rise - h * k7[i] - bend;
        dense(s, 4)[i] = h * sum;
    }
}

/* Project the candidate and make it the state; the slope there opens the next step. */
static int accept(dopri5 *s, double *x, double t_new, double h) {
    double *y = candidate(s), *next = stage(s, 6);
    size_t size = sizeof(double) * (size_t)s->n;
    keep_dense(s, x, h);
    if (s->project) {
        int status;
        if (s->project(s->user, t_new, y)) return DOPRI5_PROJECTION_FAILED;
        if (!all_finite(y, s->n)) return DOPRI5_NOT_FINITE;
        status = slope(s, t_new, y, next);
        if (status) return status;
    }
    memcpy(x, y, size);
    memcpy(stage(s, 0), next, size);
    s->memory[TIME] = t_new;
    s->memory[LAST_STEP] = h;
    return DOPRI5_OK;
}

static int open_step(dopri5 *s, const double *x, double limit) {
    double *m = s->memory;
    if (m[SLOPE_VALID] == 0.0) {
        int status = slope(s, m[TIME], x, stage(s, 0));
        if (status) return status;
        m[SLOPE_VALID] = 1.0;
    }
    if (m[STEP] <= 0.0) m[STEP] = first_step(s, x, limit - m[TIME]);
    m[STEP] = fmin(m[STEP], s->h_max);
    return DOPRI5_OK;
}

/* One try of one step towards limit. DOPRI5_MORE: accepted. DOPRI5_OK: rejected, try again. */
static int try_step(dopri5 *s, double *x, double limit) {
    double *m = s->memory, t = m[TIME], h = m[STEP], error = 0.0, factor;
    int status, cut = t + 1.01 * h >= limit;
    if (cut) h = limit - t;
    s->steps++;
    status = stages(s, x, h);
    if (!status) {
        error = error_of(s, x, h);
        if (!isfinite(error)) status = DOPRI5_NOT_FINITE;
    }
    if (!status && error <= 1.0) {
        status = accept(s, x, cut ? limit : t + h, h);
        if (!status) {
            factor = SAFETY * pow(m[ERROR], BETA) / pow(fmax(error, 1e-10), 0.2 - 0.75 * BETA);
            h *= fmin(GROW, fmax(SHRINK, factor));
            m[STEP] = cut ? fmax(h, m[STEP]) : h;
            if (!cut) m[ERROR] = fmax(error, 1e-4);
            return DOPRI5_MORE;
        }
    }
    s->rejected++;
    m[STEP] = h * (status ? 0.25 : fmax(SHRINK, SAFETY / pow(error, 0.2)));
    if (m[STEP] > 4 * DBL_EPSILON * fmax(fabs(t), fabs(limit))) return DOPRI5_OK;
    return status ? status : DOPRI5_STEP_TOO_SMALL;
}

/* Steps until one is accepted. */
static int step(dopri5 *s, double *x, double limit, long *budget) {
    int status = open_step(s, x, limit);
    while (!status) {
        if (s->since_output++ >= s->max_steps) return DOPRI5_TOO_MANY_STEPS;
        --*budget;
        status = try_step(s, x, limit);
    }
    return status == DOPRI5_MORE ? DOPRI5_OK : status;
}

int dopri5_step(dopri5 *s, double *x, double limit) {
    long budget = 0;
    return step(s, x, limit, &budget);
}

int dopri5_advance(dopri5 *s, double *x, double t_end) {
    long budget = 0;
    s->since_output = 0;
    while (s->memory[TIME] < t_end) {
        int status = step(s, x, t_end, &budget);
        if (status) return status;
    }
    return DOPRI5_OK;
}

static void interpolate(const dopri5 *s, double t, double *row) {
    double h = s->memory[LAST_STEP], a = (t - (s->memory[TIME] - h)) / h, b = 1.0 - a;
    int i;
    for (i = 0; i < s->n; i++)
        row[i] = dense(s, 0)[i] + a * (dense(s, 1)[i] + b * (dense(s, 2)[i] + a * (dense(s, 3)[i] +
                                                                 b * dense(s, 4)[i])));
}

static int output(dopri5 *s, const double *x, double t, double *row) {
    s->since_output = 0;
    if (t >= s->memory[TIME]) {
        memcpy(row, x, sizeof(double) * (size_t)s->n);
        return DOPRI5_OK;
    }
    interpolate(s, t, row);
    if (s->project && s->project(s->user, t, row)) return DOPRI5_PROJECTION_FAILED;
    return all_finite(row, s->n) ? DOPRI5_OK : DOPRI5_NOT_FINITE;
}

int dopri5_table(dopri5 *s, double *x, const double *times, long count, double *table, long *done,
                 long budget) {
    int status = DOPRI5_OK;
    while (*done < count && !status) {
        if (times[*done] <= s->memory[TIME]) {
            status = output(s, x, times[*done], table + (size_t)*done * s->n);
            if (!status) ++*done;
        } else if (budget <= 0) {
            return DOPRI5_MORE;
        } else {
            status = step(s, x, times[count - 1], &budget);
        }
    }
    return status;
}
