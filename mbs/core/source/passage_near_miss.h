/* Detection of steps across a singular configuration at which branches of motion come near each
 * other and do not meet, so that the true motion reverses.
 *
 * Such a step is smooth on both sides, so its error estimate does not show it. The bordered matrix
 * of the constraint rows J and the rows C N of the coordinates is singular where the rows are
 * dependent, and the sign of its determinant changes across. Bisection locates the singular
 * configuration. There the residual of the rows along the left null vector, which no change of the
 * positions removes, measures how far the branches miss each other.
 */
#ifndef MBS_PASSAGE_NEAR_MISS_H
#define MBS_PASSAGE_NEAR_MISS_H

#include "passage_data.h"

/* Whether a step of length h from x at time t to y crosses branches that do not meet. first and
 * last: slopes at x and y. It requires the frame of y in g->point. */
int near_miss_jumped(passage *g, double t, const double *x, double h, const double *y,
                     const double *first, const double *last);

#endif
