#include "rk4.h"

#include <string.h>

#include "finite.h"

/* Layout of `work` after the first 2n elements: a slope, states and scaled slopes at both ends of
 * the step for dense output, and the point of a stage. */
static double *part(const stepper *s, int i) { return s->work + i * s->n; }
static double *slope(const stepper *s) { return part(s, 2); }
static double *from(const stepper *s) { return part(s, 3); }
static double *first(const stepper *s) { return part(s, 4); }
static double *to(const stepper *s) { return part(s, 5); }
static double *last(const stepper *s) { return part(s, 6); }
static double *point(const stepper *s) { return part(s, 7); }

static int attempt(stepper *s, const double *x, double h) {
    static const double PLACE[] = {0.0, 0.5, 0.5, 1.0}, WEIGHT[] = {1.0, 2.0, 2.0, 1.0};
    double t = stepper_time(s), *y = stepper_candidate(s);
    int i, k, n = s->n;
    memcpy(slope(s), stepper_slope(s), sizeof(double) * (size_t)n);
    memcpy(y, x, sizeof(double) * (size_t)n);
    for (k = 0; k < 4; k++) {
        for (i = 0; i < n; i++) point(s)[i] = x[i] + PLACE[k] * h * slope(s)[i];
        if (k) {
            int status = stepper_evaluate(s, t + PLACE[k] * h, point(s), slope(s));
            if (status) return status;
        }
        for (i = 0; i < n; i++) y[i] += h / 6.0 * WEIGHT[k] * slope(s)[i];
    }
    memset(stepper_trial(s), 0, sizeof(double) * (size_t)n); /* the method has no error estimate */
    return all_finite(y, n) ? STEPPER_OK : STEPPER_NOT_FINITE;
}

static void keep(stepper *s, const double *x, double h) {
    int i;
    memcpy(from(s), x, sizeof(double) * (size_t)s->n);
    for (i = 0; i < s->n; i++) first(s)[i] = h * stepper_slope(s)[i];
}

static int close(stepper *s, double t) {
    double h = t - stepper_time(s);
    int i, status = stepper_evaluate(s, t, stepper_candidate(s), slope(s));
    if (status) return status;
    memcpy(to(s), stepper_candidate(s), sizeof(double) * (size_t)s->n);
    for (i = 0; i < s->n; i++) last(s)[i] = h * slope(s)[i];
    stepper_close(s, slope(s));
    return STEPPER_OK;
}

/* Evaluate the cubic Hermite interpolant of the step at the fraction a. */
static void interpolate(const stepper *s, double a, double *row) {
    double b = 1.0 - a;
    int i;
    for (i = 0; i < s->n; i++) {
        double chord = to(s)[i] - from(s)[i];
        double bend = b * (first(s)[i] - chord) + a * (chord - last(s)[i]);
        row[i] = b * from(s)[i] + a * to(s)[i] + a * b * bend;
    }
}

void rk4_init(stepper *s, int n, stepper_rhs rhs, void *user, double *memory, double *work) {
    static const stepper_method method = {NULL, attempt, keep, close, interpolate, NULL};
    stepper_init(s, n, &method, rhs, user, memory, work);
}
