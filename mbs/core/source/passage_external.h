/* Charts for an external integrator.
 *
 * A chart is valid from one call of passage_chart to the next. The functions that return no other
 * value return a status of the stepper.
 */
#ifndef MBS_PASSAGE_EXTERNAL_H
#define MBS_PASSAGE_EXTERNAL_H

#include "passage.h"

/* Make a chart at the state x. */
int passage_chart(passage *g, double t, const double *x);

/* Compute the coordinates y = (xi, u, z) of x in the chart. */
int passage_coordinates(passage *g, double t, const double *x, double *y);

/* Compute the state x on the rows at the coordinates y, and the slopes of x and y. guide (n,):
 * state near x that selects the branch. *alignment: alignment of the tangents with the tangents at
 * the origin of the chart, 1 if parallel and 0 if orthogonal. */
int passage_state(passage *g, double t, const double *y, const double *guide, double *x,
                  double *slope_x, double *slope_y, double *alignment);

/* Whether a step from x at t, with slope first, to y at t + h, with slope last, jumps between
 * branches that come near each other and do not meet. Call it right after passage_state computed
 * y (n,) and last (n,). */
int passage_jumps(passage *g, double t, const double *x, const double *first, double h,
                  const double *y, const double *last);

/* Compute how well the independent velocities determine the motion. independent: indices of as many
 * velocities as there are degrees of freedom. unit (nv,): factor that scales each velocity.
 * *grip: 1 / largest element (at least 1) of the matrix from the independent velocities to all
 * velocities; 0 if they do not determine the motion. Returns 1 on failure. */
int passage_grip(passage *g, double t, const double *x, const int *independent, const double *unit,
                 double *grip);

/* Return the regularity at x, as a fraction of the largest value so far. */
double passage_regularity(passage *g, double t, const double *x);

#endif
