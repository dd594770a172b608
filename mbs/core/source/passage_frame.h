/* Constraint rows, inertia and tangents of the motion at a state.
 *
 * With M = L L' the rows are factorized as L^-1 J' = Q R, so that lengths are measured in the
 * metric of M. The tangents T = L^-T Q_2 span the velocities with J v = 0.
 */
#ifndef MBS_PASSAGE_FRAME_H
#define MBS_PASSAGE_FRAME_H

#include "passage_data.h"

/* Evaluate the rows at x. Returns 1 on failure. */
int frame_rows(passage *g, double t, const double *x, const passage_rows *rows);

/* Evaluate rows, inertia and forces at x, and set the rank. Returns 1 on failure. */
int frame_evaluate(passage *g, passage_frame *p, double t, const double *x);

/* Compute L, the factors of the rows, the tangents T and sigma after frame_evaluate. Returns 1 on
 * failure. */
int frame_factorize(passage *g, passage_frame *p);

/* Compute v = L^-T Q y in place: orthonormal coordinates become a velocity. */
void frame_velocity(const passage *g, const passage_frame *p, double *y);

/* Compute the first `rank` elements of y such that J v = c for v = L^-T Q y. */
void frame_solve_rows(const passage *g, const passage_frame *p, const double *c, double *y);

/* Compute the velocity v with J v = b that is shortest in the metric of M. */
void frame_particular_velocity(const passage *g, const passage_frame *p, double *v);

/* Element i of N v, the rate of position i. */
static inline double frame_position_rate(const passage *g, const passage_rows *rows, int i,
                                         const double *v) {
    double rate = 0.0;
    int j;
    if (g->size.nq == g->size.nv) return v[i];
    for (j = g->patterns.N.begin[i]; j < g->patterns.N.begin[i + 1]; j++)
        rate += rows->N[g->patterns.N.from[j]] * v[g->patterns.N.column[j]];
    return rate;
}

#endif
