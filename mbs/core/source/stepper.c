#include "stepper.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "finite.h"

/* Offsets in `memory`. */
enum { TIME, STEP, ERROR, SLOPE_VALID, LAST_STEP, LAST_END, SLOPE };

static const double SAFETY = 0.9, SHRINK = 0.2, GROW = 10.0, BETA = 0.04;
static const double NEAR_ZERO = 1e-10; /* fraction of the limit below which time counts as zero */

/* Relative distance to a jump at which functions of time are evaluated: a few roundings of time. */
static const double ASIDE = 1e3 * DBL_EPSILON;
static const double GAP = 0.25; /* maximum of that distance, as a fraction of the time to a jump */

static const double UNMOVED = 0.01; /* projection, in tolerances, below which the slope is kept */

void stepper_init(stepper *s, int n, const stepper_method *method, stepper_rhs rhs, void *user,
                  double *memory, double *work) {
    memset(s, 0, sizeof *s);
    s->n = n;
    s->method = method;
    s->rhs = rhs;
    s->user = user;
    s->rtol = s->atol = 1e-8;
    s->h_max = HUGE_VAL;
    s->max_steps = 100000;
    s->memory = memory;
    s->work = work;
}

void stepper_start(stepper *s, double t) {
    memset(s->memory, 0, sizeof(double) * (size_t)STEPPER_MEMORY(s->n));
    s->memory[TIME] = s->memory[LAST_END] = t;
    s->memory[ERROR] = 1e-4;
    s->memory[STEP] = s->fixed;
    s->steps = s->rejected = s->since_output = 0;
}

void stepper_restart(stepper *s) {
    s->memory[SLOPE_VALID] = 0.0;
    s->memory[ERROR] = 1e-4;
}

void stepper_fix(stepper *s, double h) { s->h_max = s->fixed = h; }

void stepper_restart_afresh(stepper *s) {
    stepper_restart(s);
    s->memory[STEP] = s->fixed > 0.0 ? s->fixed : s->afresh;
}

/* Set the interval [from, to] between the previous and the next jump of functions of time. */
static void find_side(stepper *s) {
    long before = s->next - 1, after = s->next;
    double first, last, aside, end = s->n_stops ? fabs(s->stops[s->n_stops - 1]) : 0.0;
    while (before >= 0 && s->hard[before] == 0.0) before--;
    while (after < s->n_stops && s->hard[after] == 0.0) after++;
    first = before >= 0 ? s->stops[before] : -HUGE_VAL;
    last = after < s->n_stops ? s->stops[after] : HUGE_VAL;
    aside = fmin(ASIDE * fmax(end, fabs(s->memory[TIME])), GAP * (last - first));
    s->from = first + aside;
    s->to = last - aside;
}

void stepper_stop_at(stepper *s, const double *stops, const double *hard, long count) {
    s->stops = stops;
    s->hard = hard;
    s->n_stops = count;
    for (s->next = 0; s->next < count && stops[s->next] <= s->memory[TIME]; s->next++) continue;
    find_side(s);
}

int stepper_pass_stop(stepper *s) {
    int jumps = 0;
    if (s->next >= s->n_stops || s->memory[TIME] < s->stops[s->next]) return 0;
    for (; s->next < s->n_stops && s->stops[s->next] <= s->memory[TIME]; s->next++)
        jumps |= s->hard[s->next] > 0.0;
    if (jumps) {
        find_side(s);
        stepper_restart_afresh(s);
    }
    return jumps;
}

double stepper_law_time(const stepper *s, double t) {
    return s->n_stops ? fmin(fmax(t, s->from), s->to) : t;
}

double stepper_time(const stepper *s) { return s->memory[TIME]; }
double stepper_wanted_step(const stepper *s) { return s->memory[STEP]; }
double stepper_last_step(const stepper *s) { return s->memory[LAST_STEP]; }

double *stepper_slope(const stepper *s) { return s->memory + SLOPE; }
double *stepper_trial(const stepper *s) { return s->work; }
double *stepper_candidate(const stepper *s) { return s->work + s->n; }

int stepper_evaluate(const stepper *s, double t, const double *x, double *xdot) {
    if (s->rhs(s->user, t, x, xdot)) return STEPPER_RHS_FAILED;
    return all_finite(xdot, s->n) ? STEPPER_OK : STEPPER_NOT_FINITE;
}

void stepper_close(stepper *s, const double *slope) {
    if (slope) memcpy(stepper_slope(s), slope, sizeof(double) * (size_t)s->n);
    s->memory[SLOPE_VALID] = slope ? 1.0 : 0.0;
}

/* Weighted root mean square of v (n,): each element is divided by its error tolerance. */
static double norm(const stepper *s, const double *v, const double *x, const double *y) {
    double sum = 0.0;
    int i;
    for (i = 0; i < s->n; i++) {
        double size = s->nominal ? s->nominal[i] : 1.0;
        double part = s->rtol * (s->relative ? s->relative[i] : 1.0);
        double r = v[i] / (s->atol * size + s->noise + part * fmax(fabs(x[i]), fabs(y[i])));
        sum += r * r;
    }
    return s->n ? sqrt(sum / s->n) : 0.0;
}

/* First step size from an explicit Euler step and its curvature (Hairer et al. 1993, II.4). */
static double first_step(stepper *s, const double *x, double span) {
    const double *k1 = stepper_slope(s);
    double *y = stepper_trial(s), *k2 = stepper_candidate(s), d0, d1, d2, h0, h1;
    int i;
    s->noise = 0.0; /* rounding is estimated by attempts only */
    d0 = norm(s, x, x, x);
    d1 = norm(s, k1, x, x);
    h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h0 = fmin(h0, span);
    for (i = 0; i < s->n; i++) y[i] = x[i] + h0 * k1[i];
    if (stepper_evaluate(s, s->memory[TIME] + h0, y, k2)) return h0 * 1e-3;
    for (i = 0; i < s->n; i++) y[i] = k2[i] - k1[i];
    d2 = norm(s, y, x, x) / h0;
    h1 = fmax(d1, d2) <= 1e-15 ? fmax(1e-6, h0 * 1e-3) : pow(0.01 / fmax(d1, d2), 0.2);
    return fmin(fmin(100 * h0, h1), span);
}

/* Project the candidate onto the constraints and set `corrected`. */
static int project_candidate(stepper *s, const double *x, double t_new) {
    double *y = stepper_candidate(s), *move = stepper_trial(s);
    int i;
    memcpy(move, y, sizeof(double) * (size_t)s->n);
    if (s->project(s->user, t_new, y)) return STEPPER_PROJECTION_FAILED;
    if (!all_finite(y, s->n)) return STEPPER_NOT_FINITE;
    for (i = 0; i < s->n; i++) move[i] -= y[i];
    s->corrected = norm(s, move, x, y) > UNMOVED;
    return STEPPER_OK;
}

/* Project the candidate and copy it to x. `close` of the method stores the slope there. */
static int accept(stepper *s, double *x, double t_new, double h) {
    double *y = stepper_candidate(s);
    int status = STEPPER_OK;
    s->method->keep(s, x, h);
    s->corrected = 0;
    if (s->project && !s->kept_closed) status = project_candidate(s, x, t_new);
    if (status) return status;
    status = s->method->close(s, t_new);
    if (status) return status;
    memcpy(x, y, sizeof(double) * (size_t)s->n);
    s->memory[TIME] = s->memory[LAST_END] = t_new;
    s->memory[LAST_STEP] = h;
    return STEPPER_OK;
}

/* Compute the slope at x and the first step size, unless they are available. */
static int open_step(stepper *s, const double *x, double limit) {
    double *m = s->memory;
    if (m[SLOPE_VALID] == 0.0) {
        int status = s->method->slope ? s->method->slope(s, x)
                                      : stepper_evaluate(s, m[TIME], x, stepper_slope(s));
        if (!status && s->method->open) status = s->method->open(s, x);
        if (status) return status;
        m[SLOPE_VALID] = 1.0;
    }
    if (m[STEP] <= 0.0) m[STEP] = first_step(s, x, limit - m[TIME]);
    m[STEP] = fmin(m[STEP], s->h_max);
    return STEPPER_OK;
}

/* Factor of the step size after a failed attempt: 0.83 at singular configurations, 0.5 outside the
 * local coordinates, 0.25 for other failures. */
static double shortened(int status) {
    if (status >= STEPPER_SINGULAR && status <= STEPPER_NEAR_MISS) return 0.83;
    return status == STEPPER_CHART_LEFT ? 0.5 : 0.25;
}

/* Attempt one step towards limit. Returns STEPPER_MORE if it is accepted, STEPPER_OK if it is
 * rejected and a shorter step is possible. */
static int try_step(stepper *s, double *x, double limit) {
    double *m = s->memory, t = m[TIME], h = m[STEP], error = 0.0, factor;
    int status, cut = t + 1.01 * h >= limit;
    if (cut) h = limit - t;
    s->cut = cut;
    s->steps++;
    status = s->method->attempt(s, x, h);
    if (!status) {
        error = norm(s, stepper_trial(s), x, stepper_candidate(s));
        if (!isfinite(error)) status = STEPPER_NOT_FINITE;
    }
    if (!status && error <= 1.0) {
        status = accept(s, x, cut ? limit : t + h, h);
        if (!status) {
            factor = SAFETY * pow(m[ERROR], BETA) / pow(fmax(error, 1e-10), 0.2 - 0.75 * BETA);
            h *= fmin(GROW, fmax(SHRINK, factor));
            m[STEP] = cut ? fmax(h, m[STEP]) : h;
            if (!cut) m[ERROR] = fmax(error, 1e-4);
            return STEPPER_MORE;
        }
    }
    s->rejected++;
    if (status == STEPPER_UNDETERMINED) return status;
    m[STEP] = h * (status ? shortened(status) : fmax(SHRINK, SAFETY / pow(error, 0.2)));
    if (m[STEP] > 4 * DBL_EPSILON * fmax(fabs(t), NEAR_ZERO * fabs(limit))) return STEPPER_OK;
    return status ? status : STEPPER_STEP_TOO_SMALL;
}

int stepper_step(stepper *s, double *x, double limit) {
    int status;
    stepper_pass_stop(s);
    if (s->next < s->n_stops) limit = fmin(limit, s->stops[s->next]);
    status = open_step(s, x, limit);
    while (!status) {
        if (s->since_output++ >= s->max_steps) return STEPPER_TOO_MANY_STEPS;
        status = try_step(s, x, limit);
    }
    return status == STEPPER_MORE ? STEPPER_OK : status;
}

int stepper_state(const stepper *s, const double *x, double t, double *row) {
    double h = s->memory[LAST_STEP];
    if (t >= s->memory[TIME]) {
        memcpy(row, x, sizeof(double) * (size_t)s->n);
        return STEPPER_OK;
    }
    s->method->interpolate(s, (t - (s->memory[LAST_END] - h)) / h, row);
    if (s->project && s->project(s->user, t, row)) return STEPPER_PROJECTION_FAILED;
    return all_finite(row, s->n) ? STEPPER_OK : STEPPER_NOT_FINITE;
}

int stepper_rewind(stepper *s, double *x, double t) {
    double *y = stepper_trial(s);
    int status = stepper_state(s, x, t, y);
    if (status) return status;
    memcpy(x, y, sizeof(double) * (size_t)s->n);
    s->memory[TIME] = t;
    stepper_close(s, NULL);
    return STEPPER_OK;
}

int stepper_table(stepper *s, double *x, const double *times, long count, double *table, long *done,
                  long budget) {
    long last = s->steps + budget;
    int status = STEPPER_OK;
    while (*done < count && !status) {
        if (times[*done] <= s->memory[TIME]) {
            status = stepper_state(s, x, times[*done], table + *done * s->n);
            if (!status) ++*done;
            s->since_output = 0;
        } else if (s->steps >= last) {
            return STEPPER_MORE;
        } else {
            status = stepper_step(s, x, times[count - 1]);
        }
    }
    return status;
}
