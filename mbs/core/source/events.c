#include "events.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "finite.h"

enum { LOOKS = 2, TANGENTS = 30, SECANTS = 20, MAX_JUMPS = 20, MAX_IDLE = 100 };

static const double DEPARTURE = 1e-8; /* fraction of a step for a rising indicator to leave zero */
/* Fraction of a step up to which an event does not repeat it: the error of the dense output from
 * stages after the event grows with the square of this fraction. */
static const double AT_START = 1e-3;

static const double NEAR = 0.5;    /* maximum of pace times time between two samples: half an
                                    * obstacle, or a rotation of half a radian */
static const double FASTER = 1.25; /* assumed ratio of the speed between samples to that at them */
static const double FALL = 0.85;   /* fraction of the time to zero until the next sample; the limit
                                    * is 2 / (1 + FASTER) */
static const double FULL = 0.98;   /* fraction of the time of NEAR: the pace may grow a little */
static const double OFF = 0.1;     /* maximum deviation from the curve of the step, as a fraction of
                                    * the indicator (at least 100 times the tolerance) */
static const double SHORTER = 0.75; /* maximum fraction of a step that is repeated after a missed
                                     * change of the equations */

/* Offsets in `memory`, followed by six arrays (count,). */
enum { LAST, IDLE, PENDING, UNSEEN, ARRAYS };
static double *kept(const events *e, int i) {
    return e->memory + ARRAYS + (size_t)i * (size_t)e->count;
}
static double *armed(const events *e) { return kept(e, 0); }
static double *due(const events *e) { return kept(e, 1); }
static double *fired(const events *e) { return kept(e, 2); }
static double *left(const events *e) { return kept(e, 3); }
static double *overshot(const events *e) { return kept(e, 4); }
static double *left_rate(const events *e) { return kept(e, 5); }

/* Layout of `work`: a state (n,), then 15 arrays (count,). */
static double *part(const events *e, int i) {
    return e->work + e->solver->n + (size_t)i * (size_t)e->count;
}
static double *right(const events *e) { return part(e, 0); }
static double *middle(const events *e) { return part(e, 1); }
static double *right_rate(const events *e) { return part(e, 2); }
static double *middle_rate(const events *e) { return part(e, 3); }
static double *at_start(const events *e) { return part(e, 4); } /* `armed` there */
/* approaches at the left and right sample, 3 columns each */
static double *left_near(const events *e) { return part(e, 5); }
static double *right_near(const events *e) { return part(e, 8); }
/* indicators and their rates at both ends of the step */
static double *first_value(const events *e) { return part(e, 11); }
static double *first_rate(const events *e) { return part(e, 12); }
static double *last_value(const events *e) { return part(e, 13); }
static double *last_rate(const events *e) { return part(e, 14); }
static void copy(const events *e, double *to, const double *from) {
    memcpy(to, from, sizeof(double) * (size_t)e->count);
}

void events_init(events *e, stepper *solver, int count, const events_model *model, double *memory,
                 double *work) {
    e->solver = solver;
    e->count = count;
    e->model = model;
    e->memory = memory;
    e->work = work;
    e->near_at = NAN;
}

int events_pending(const events *e) { return e->memory[PENDING] > 0.0; }
const double *events_fired(const events *e) { return fired(e); }
const double *events_due(const events *e) { return due(e); }
const double *events_armed(const events *e) { return armed(e); }
const double *events_seen(const events *e) { return left(e); }

/* Evaluate the indicators at time t of the last step, and their rates unless rates is NULL. */
static int look(const events *e, const double *x, double t, double *values, double *rates) {
    void *user = e->solver->user;
    int status = stepper_state(e->solver, x, t, e->work);
    if (status) return status;
    if (e->model->indicators(user, t, e->work, values)) return EVENTS_INDICATORS_FAILED;
    if (rates && e->model->rates(user, t, e->work, rates)) return EVENTS_INDICATORS_FAILED;
    return all_finite(values, e->count) ? STEPPER_OK : EVENTS_INDICATORS_FAILED;
}

/* Smallest value of the indicators that can fire. */
static double least(const events *e, const double *values) {
    double value = HUGE_VAL;
    int k;
    for (k = 0; k < e->count; k++)
        if (armed(e)[k] > 0.0) value = fmin(value, values[k]);
    return value;
}

/* Let positive indicators fire at their next zero. */
static void arm(const events *e, const double *values) {
    int k;
    for (k = 0; k < e->count; k++)
        if (values[k] > 0.0) armed(e)[k] = 1.0;
}

/* Evaluate the indicators and rates at the present time and clear the pending jump. */
static int look_here(events *e, const double *x) {
    e->near_at = NAN;
    e->memory[PENDING] = e->memory[UNSEEN] = 0.0;
    return look(e, x, stepper_time(e->solver), left(e), left_rate(e));
}

/* Whether indicator k still has the negative value to which an external integrator overshot. */
static int is_overshot(const events *e, int k) {
    double below = overshot(e)[k];
    return below > 0.0 && fabs(left(e)[k] + below) <= 1e-9 * below;
}

/* Set the indicators that trigger a jump at the present state. An indicator that is zero within the
 * tolerance and does not clearly fall is decided by the first sample of the next step. */
static int judge(events *e, const double *x) {
    double t = stepper_time(e->solver), step = stepper_last_step(e->solver);
    double slack = fmax(1e3 * DBL_EPSILON * fabs(t), DEPARTURE * step), zero = e->solver->atol;
    int k, status = look_here(e, x);
    if (status) return status;
    for (k = 0; k < e->count; k++) {
        double value = left(e)[k], rise = left_rate(e)[k];
        int waits = value >= -fmax(zero, rise * slack) && !(rise * step < -zero);
        waits = waits || (rise >= 0.0 && is_overshot(e, k));
        armed(e)[k] = value > (rise > 0.0 ? zero : 0.0);
        due(e)[k] = value <= 0.0 && !waits;
        if (due(e)[k] > 0.0) e->memory[PENDING] = 1.0;
    }
    return STEPPER_OK;
}

int events_start(events *e, const double *x) {
    memset(e->memory, 0, sizeof(double) * (size_t)EVENTS_MEMORY(e->count));
    e->memory[LAST] = -HUGE_VAL;
    return judge(e, x);
}

void events_restart(events *e) { e->memory[UNSEEN] = 1.0; }

int events_look(events *e, const double *x) {
    return e->memory[UNSEEN] > 0.0 ? judge(e, x) : STEPPER_OK;
}

int events_found(events *e, const double *x, const double *offset) {
    int k, status = look_here(e, x);
    if (status) return status;
    for (k = 0; k < e->count; k++) {
        due(e)[k] = left(e)[k] + offset[k] <= 0.0;
        overshot(e)[k] = fmax(0.0, -left(e)[k]);
        if (due(e)[k] > 0.0) e->memory[PENDING] = 1.0;
    }
    return STEPPER_OK;
}

void events_overshoot(events *e, const double *value) {
    int k;
    for (k = 0; k < e->count; k++) overshot(e)[k] = fmax(0.0, -value[k]);
}

/* Whether an indicator that cannot fire yet is not positive at the right sample. */
static int returned(const events *e) {
    int k;
    for (k = 0; k < e->count; k++)
        if (!(armed(e)[k] > 0.0) && right(e)[k] <= 0.0) return 1;
    return 0;
}

/* Move the first sample *end to an earlier time until indicators that started at zero are positive.
 * If none is found down to the rounding of time, the indicators can fire from `start` on. */
static int first_look(const events *e, const double *x, double start, double *end) {
    double step = stepper_last_step(e->solver);
    int k, status = look(e, x, *end, right(e), right_rate(e));
    while (!status && returned(e)) {
        double half = start + 0.5 * (*end - start);
        if (*end - start <= 4 * DBL_EPSILON * fmax(fabs(*end), 1e-3 * step)) {
            for (k = 0; k < e->count; k++)
                if (!(armed(e)[k] > 0.0)) armed(e)[k] = 1.0, left(e)[k] = DBL_MIN;
            return STEPPER_OK;
        }
        *end = half;
        status = look(e, x, half, right(e), right_rate(e));
    }
    return status;
}

/* Next time in (a, b): secant through the values low and high, or bisection after SECANTS tries. */
static double next_guess(double a, double b, double low, double high, double margin, int count) {
    if (count >= SECANTS || b - a <= 4 * margin) return a + 0.5 * (b - a);
    return fmin(fmax(a + (b - a) * low / (low - high), a + margin), b - margin);
}

/* Locate in *b a zero crossing after a, by the Illinois method: secants with a safeguard, and half
 * the value at an end that is kept twice. */
static int locate(const events *e, const double *x, double a, double *b) {
    double low = least(e, left(e)), high = least(e, right(e)), value;
    double step = stepper_last_step(e->solver);
    int count = 0, side = 0, status;
    for (;; count++) {
        double margin = 2 * DBL_EPSILON * fmax(fmax(fabs(a), fabs(*b)), 1e-3 * step);
        double t = next_guess(a, *b, low, high, margin, count);
        if (!(t > a && t < *b) || *b - a <= 1e-3 * DBL_EPSILON * step) return STEPPER_OK;
        status = look(e, x, t, middle(e), NULL);
        if (status) return status;
        value = least(e, middle(e));
        if (value > 0.0) {
            if (side > 0) high *= 0.5;
            a = t, low = value, side = 1;
        } else {
            if (side < 0) low *= 0.5;
            *b = t, high = value, side = -1;
            copy(e, right(e), middle(e));
        }
    }
}

/* Search indicator k, which falls at a and rises at *b, for a value that is not positive, and set
 * *b to its time. Tangents bound a convex function from below. They are refined at their
 * intersection until the bound is positive. */
static int find_dip(const events *e, const double *x, int k, double a, double *b) {
    double low = left(e)[k], fall = left_rate(e)[k];
    double end = *b, high = right(e)[k], rise = right_rate(e)[k];
    int i, status;
    for (i = 0; i < TANGENTS && fall < 0.0 && rise > 0.0; i++) {
        double width = end - a, meet = (low - high + rise * width) / (rise - fall), t;
        int inside = meet > 0.0 && meet < width;
        if (inside && low + fall * meet > 0.0) return STEPPER_OK;
        t = a + (inside ? meet : 0.5 * width);
        status = look(e, x, t, middle(e), middle_rate(e));
        if (status) return status;
        if (middle(e)[k] <= 0.0) {
            copy(e, right(e), middle(e));
            copy(e, right_rate(e), middle_rate(e));
            *b = t;
            return STEPPER_OK;
        }
        if (middle_rate(e)[k] < 0.0)
            a = t, low = middle(e)[k], fall = middle_rate(e)[k];
        else
            end = t, high = middle(e)[k], rise = middle_rate(e)[k];
    }
    return STEPPER_OK;
}

/* Apply find_dip to all indicators that can fire and are positive at both samples. */
static int find_dips(const events *e, const double *x, double a, double *b) {
    int k, status = STEPPER_OK;
    for (k = 0; k < e->count && !status; k++)
        if (armed(e)[k] > 0.0 && left(e)[k] > 0.0 && right(e)[k] > 0.0)
            status = find_dip(e, x, k, a, b);
    return status;
}

/* Whether a step that contains an event is repeated up to the event. Steps of fixed size and steps
 * in local coordinates (kept_closed) are not repeated. */
static int may_repeat(const stepper *s, double start, double event) {
    double end = stepper_time(s);
    return event < end && event - start > AT_START * (end - start) && s->fixed == 0.0 &&
           !s->kept_closed;
}

/* Evaluate the approaches at the state of the last sample. */
static int look_near(const events *e, double t, double *near) {
    if (e->model->approaches(e->solver->user, t, e->work, near)) return EVENTS_INDICATORS_FAILED;
    return all_finite(near, 3 * e->count) ? STEPPER_OK : EVENTS_INDICATORS_FAILED;
}

/* Reciprocal time scale of indicator k, the larger value of both samples. */
static double pace(const events *e, int k) {
    return fmax(left_near(e)[e->count + k], right_near(e)[e->count + k]);
}

/* Copy the approaches of the right sample to the left sample, at time t. */
static void move_near(events *e, double t) {
    memcpy(left_near(e), right_near(e), 3 * sizeof(double) * (size_t)e->count);
    e->near_at = t;
}

/* Evaluate the approaches at both ends of the step from start. *fast: whether an indicator is fast
 * enough to need more samples. If so, evaluate the indicators and rates at both ends, too. */
static int look_at_ends(events *e, const double *x, double start, int *fast) {
    double end = stepper_time(e->solver);
    int k, status = STEPPER_OK;
    if (e->near_at != start) {
        status = stepper_state(e->solver, x, start, e->work);
        if (!status) status = look_near(e, start, left_near(e));
    }
    if (!status) status = stepper_state(e->solver, x, end, e->work);
    if (!status) status = look_near(e, end, right_near(e));
    for (k = 0; k < e->count; k++) *fast |= pace(e, k) * (end - start) > NEAR;
    if (status || !*fast) return status;
    status = look(e, x, start, first_value(e), first_rate(e));
    return status ? status : look(e, x, end, last_value(e), last_rate(e));
}

/* Whether no indicator can have fallen to zero and risen again between samples at a and b. */
static int are_near(const events *e, double a, double b) {
    double width = b - a, least_width = 1e-3 * stepper_last_step(e->solver);
    int k;
    if (width <= 4 * DBL_EPSILON * fmax(fabs(b), least_width)) return 1;
    for (k = 0; k < e->count; k++) {
        double speed = FASTER * fmax(left_near(e)[k], right_near(e)[k]);
        if (pace(e, k) * width <= NEAR) continue;
        if (left(e)[k] > 0.0 && right(e)[k] > 0.0 && left(e)[k] + right(e)[k] > speed * width)
            continue;
        return 0;
    }
    return 1;
}

/* Time from the left sample to the next that probably satisfies are_near. */
static double time_to_next(const events *e) {
    double least_time = HUGE_VAL;
    int k;
    for (k = 0; k < e->count; k++) {
        double rate = left_near(e)[e->count + k], speed = left_near(e)[k], time = 0.0;
        if (rate == 0.0) continue;
        if (left(e)[k] > 0.0 && speed > 0.0) time = FALL * left(e)[k] / speed;
        least_time = fmin(least_time, fmax(time, FULL * NEAR / rate));
    }
    return least_time;
}

/* Move the right sample at *b towards a until are_near holds. */
static int come_near(const events *e, const double *x, double a, double *b) {
    int status = look_near(e, *b, right_near(e));
    while (!status && !are_near(e, a, *b)) {
        *b = a + 0.5 * (*b - a);
        status = look(e, x, *b, right(e), right_rate(e));
        if (!status) status = look_near(e, *b, right_near(e));
    }
    return status;
}

/* Whether the indicators on which the equations depend agree at t with the cubic Hermite curve
 * through both ends of the step, within OFF. */
static int follows(const events *e, double start, double t) {
    const stepper *s = e->solver;
    double h = stepper_time(s) - start, u = (t - start) / h, w = 1.0 - u;
    int k;
    if (s->fixed > 0.0 || s->kept_closed || t >= stepper_time(s)) return 1;
    for (k = 0; k < e->count; k++) {
        double low = first_value(e)[k], high = last_value(e)[k], curve, size;
        if (right_near(e)[2 * e->count + k] == 0.0 || pace(e, k) * h <= NEAR) continue;
        curve = w * w * ((1.0 + 2.0 * u) * low + u * h * first_rate(e)[k]) +
                u * u * ((1.0 + 2.0 * w) * high - w * h * last_rate(e)[k]);
        size = fmax(fmax(fabs(low), fabs(high)), 100.0 * s->atol);
        if (fabs(right(e)[k] - curve) > OFF * size) return 0;
    }
    return 1;
}

/* Find the first event in the step from start; right() contains the indicators there.
 * event: time of the event, HUGE_VAL if there is none. again: end time of a repeated step, if this
 * step missed a change of the equations, else HUGE_VAL. */
static int first_event(events *e, const double *x, double start, double *event, double *again) {
    double from = start, end = stepper_time(e->solver);
    int number = 1, near = 0, status = STEPPER_OK;
    if (e->model->approaches) status = look_at_ends(e, x, start, &near);
    *event = *again = HUGE_VAL;
    while (!status && from < end) {
        double next = number < LOOKS ? start + number * (end - start) / LOOKS : end;
        double to = near ? fmin(next, from + time_to_next(e)) : next;
        if (to <= from) to = next; /* the increment is below the rounding of time */
        status =
            from > start ? look(e, x, to, right(e), right_rate(e)) : first_look(e, x, start, &to);
        if (near && !status) {
            status = come_near(e, x, from, &to);
            if (!status && !follows(e, start, to)) {
                *again = fmin(to, start + SHORTER * (end - start));
                return STEPPER_OK;
            }
        }
        if (!status) status = find_dips(e, x, from, &to);
        if (status) return status;
        if (least(e, right(e)) <= 0.0) {
            *event = to;
            return locate(e, x, from, event);
        }
        arm(e, right(e));
        copy(e, left(e), right(e));
        copy(e, left_rate(e), right_rate(e));
        if (near) move_near(e, to);
        if (to == next) number++;
        from = to;
    }
    if (e->model->approaches && !near && !status) move_near(e, end);
    return status;
}

/* Return to the time of the event and make its jump pending. */
static int stop_at_event(events *e, double *x, double event) {
    int k;
    for (k = 0; k < e->count; k++) due(e)[k] = armed(e)[k] > 0.0 && right(e)[k] <= 0.0;
    e->memory[PENDING] = 1.0;
    return stepper_rewind(e->solver, x, event);
}

int events_step(events *e, double *x, double limit) {
    stepper *s = e->solver;
    double start = stepper_time(s), event = HUGE_VAL, again = HUGE_VAL;
    int status, repeats = 0;
    if (stepper_pass_stop(s)) events_restart(e);
    status = events_look(e, x);
    if (status || events_pending(e)) return status;
    copy(e, at_start(e), armed(e));
    status = stepper_step(s, x, limit);
    if (!status) status = first_event(e, x, start, &event, &again);
    while (!status) {
        double end = again;
        if (again == HUGE_VAL) {
            /* Stages after the event use other equations: repeat the step up to the event. */
            if (event == HUGE_VAL || repeats++ || !may_repeat(s, start, event)) break;
            end = event;
        }
        status = stepper_rewind(s, x, start);
        if (!status) status = look(e, x, start, left(e), left_rate(e));
        copy(e, armed(e), at_start(e));
        if (!status) status = stepper_step(s, x, end);
        if (!status) status = first_event(e, x, start, &event, &again);
    }
    return status || event == HUGE_VAL ? status : stop_at_event(e, x, event);
}

/* Project the state onto the constraints of the final modes. Modes between jumps are not projected,
 * because their constraints may not be solvable. */
static int projected(events *e, double *x) {
    stepper *s = e->solver;
    if (!s->project) return STEPPER_OK;
    if (s->project(s->user, stepper_time(s), x) || !all_finite(x, s->n))
        return STEPPER_PROJECTION_FAILED;
    return judge(e, x);
}

int events_settle(events *e, double *x, double limit) {
    stepper *s = e->solver;
    double *m = e->memory, t = stepper_time(s);
    int i, k, status;
    memset(fired(e), 0, sizeof(double) * (size_t)e->count);
    stepper_restart_afresh(s);
    for (i = 0; events_pending(e); i++) {
        for (k = 0; k < e->count; k++) fired(e)[k] = fmax(fired(e)[k], due(e)[k]);
        if (i == MAX_JUMPS) return EVENTS_DO_NOT_SETTLE;
        if (e->model->jump(s->user, t, x, due(e)) || !all_finite(x, s->n))
            return EVENTS_JUMP_FAILED;
        status = judge(e, x);
        if (!status && !events_pending(e)) status = projected(e, x);
        if (status) return status;
    }
    m[IDLE] = t - m[LAST] <= 1e3 * DBL_EPSILON * fmax(fabs(t), fabs(limit)) ? m[IDLE] + 1.0 : 0.0;
    m[LAST] = t;
    return m[IDLE] > MAX_IDLE ? EVENTS_STAND_STILL : EVENTS_FIRED;
}

int events_table(events *e, double *x, const double *times, long count, double *table, long *done,
                 long budget) {
    stepper *s = e->solver;
    long last = s->steps + budget;
    int status = STEPPER_OK;
    while (*done < count && !status) {
        double t = times[*done], now = stepper_time(s);
        if (t < now || (t == now && !events_pending(e))) {
            status = stepper_state(s, x, t, table + (size_t)*done * s->n);
            if (!status) ++*done;
            s->since_output = 0;
        } else if (events_pending(e)) {
            status = events_settle(e, x, times[count - 1]);
        } else if (s->steps >= last) {
            return STEPPER_MORE;
        } else {
            status = events_step(e, x, times[count - 1]);
        }
    }
    return status;
}
