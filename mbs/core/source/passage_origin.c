#include "passage_origin.h"

#include <math.h>
#include <string.h>

#include "passage_chart.h"
#include "passage_crossing.h"
#include "passage_frame.h"
#include "passage_newton.h"

/* Distance [rad or m], against the velocity, of the origin from a start that is singular. The
 * origin must be regular there. With 0.2 the error of a start on a branch at a tolerance of 1e-8
 * rises from 0.02 to 0.3 tolerances; with 0.002 no motion of the tests changes. */
#define START_DISTANCE 0.02

/* Make a regular origin at START_DISTANCE before the singular state x, along its velocity. Returns
 * 1 if no branch has this velocity. */
static int origin_before_start(passage *g, double t, const double *x) {
    int nq = g->size.nq, nv = g->size.nv, n = g->stepper->n, i, pass;
    double *q = g->scratch.state, *v = g->scratch.w, *y = g->scratch.y, speed = 0.0,
           move = HUGE_VAL, behind, part;
    for (i = 0; i < nv; i++) speed = fmax(speed, fabs(x[nq + i]));
    if (!(speed > 0.0) || frame_evaluate(g, &g->point, t, x)) return 1;
    behind = t - (g->size.moving ? START_DISTANCE / speed : 0.0);
    memcpy(q, x, sizeof(double) * (size_t)n);
    for (i = 0; i < nv; i++) v[i] = -x[nq + i] * START_DISTANCE / speed;
    for (i = 0; i < nq; i++) q[i] += frame_position_rate(g, &g->point.rows, i, v);
    for (pass = 0; pass < NEWTON_STEPS && !(move < NEWTON_CONVERGED); pass++) {
        if (frame_evaluate(g, &g->origin, behind, q) || frame_factorize(g, &g->origin)) return 1;
        memset(y, 0, sizeof(double) * (size_t)nv);
        frame_solve_rows(g, &g->origin, g->origin.rows.position, y);
        frame_velocity(g, &g->origin, y);
        move = 0.0;
        for (i = 0; i < nv; i++) move = fmax(move, fabs(y[i]));
        for (i = 0; i < nq; i++) q[i] -= frame_position_rate(g, &g->origin.rows, i, y);
    }
    if (!(move < NEWTON_CONVERGED)) return 1;
    if (frame_evaluate(g, &g->origin, behind, q) || frame_factorize(g, &g->origin)) return 1;
    part = crossing_regularity(g, behind, q) / g->memory->regularity_max;
    if (!(part > SIGMA_REGULAR)) return 1;
    g->memory->sigma_max = g->origin.sigma / fmin(part, 1.0);
    g->memory->has_origin = 1.0;
    g->memory->origin_time = behind;
    memcpy(g->origin_state, q, sizeof(double) * (size_t)n);
    return 0;
}

/* Whether the velocities of a start x differ from the state `on` of the branch beyond
 * START_VELOCITY. */
static int misses_branch(const passage *g, const double *x, const double *on) {
    int first = g->size.nq, i;
    double speed = 0.0, miss = 0.0;
    for (i = first; i < first + g->size.nv; i++) {
        speed = fmax(speed, fabs(x[i]));
        miss = fmax(miss, fabs(x[i] - on[i]));
    }
    return !(miss <= START_VELOCITY * speed);
}

int origin_prepare(passage *g, double t, const double *x) {
    passage_memory *m = g->memory;
    double part;
    int n = g->stepper->n, first = !(m->has_origin > 0.0);
    if (g->prepared.valid && t == g->prepared.time &&
        !memcmp(x, g->prepared.x, sizeof(double) * (size_t)n))
        return STEPPER_OK;
    g->prepared.valid = 0;
    if (frame_evaluate(g, &g->origin, t, x) || frame_factorize(g, &g->origin))
        return STEPPER_SINGULAR;
    part = crossing_regularity(g, t, x) / m->regularity_max;
    if (m->sigma_max == 0.0 && part > SIGMA_REGULAR)
        m->sigma_max = g->origin.sigma / fmin(part, 1.0);
    if (m->sigma_max > 0.0 && g->origin.sigma >= SIGMA_REGULAR * m->sigma_max) {
        m->sigma_max = fmax(m->sigma_max, g->origin.sigma);
        m->has_origin = 1.0;
        m->origin_time = t;
        memcpy(g->origin_state, x, sizeof(double) * (size_t)n);
        first = 0;
    } else if (first) {
        if (origin_before_start(g, t, x)) return STEPPER_UNDETERMINED;
    } else if (frame_evaluate(g, &g->origin, m->origin_time, g->origin_state) ||
               frame_factorize(g, &g->origin)) {
        return STEPPER_SINGULAR;
    }
    if (chart_make(g)) return STEPPER_SINGULAR;
    if (g->size.moving) frame_particular_velocity(g, &g->origin, g->chart.drift);
    if (chart_coordinates(g, t, x, g->prepared.y)) return STEPPER_SINGULAR;
    if (first) {
        g->step.sigma = HUGE_VAL;
        if (crossing_state(g, t, g->prepared.y, g->scratch.state, g->stages.slope_x[0],
                           g->stages.slope_y[0]) ||
            misses_branch(g, x, g->scratch.state)) {
            m->has_origin = m->sigma_max = 0.0; /* a second call then fails in the same way */
            return STEPPER_UNDETERMINED;
        }
    }
    memcpy(g->prepared.x, x, sizeof(double) * (size_t)n);
    g->prepared.time = t;
    g->prepared.valid = 1;
    return STEPPER_OK;
}

int origin_restore(passage *g) {
    const passage_memory *m = g->memory;
    if (g->chart.valid) return 0;
    if (frame_evaluate(g, &g->origin, m->origin_time, g->origin_state) ||
        frame_factorize(g, &g->origin))
        return 1;
    if (chart_make(g)) return 1;
    g->chart.valid = 1;
    return 0;
}
