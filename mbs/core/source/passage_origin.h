/* Choice of the origin of the chart, and restart of the integration in the chart.
 *
 * The origin is the state at which a step begins. If this state is not regular, it is the last
 * regular state of the motion; at a singular start it is a state of the branch at a small distance
 * before the start.
 */
#ifndef MBS_PASSAGE_ORIGIN_H
#define MBS_PASSAGE_ORIGIN_H

#include "passage_data.h"

/* Fraction of its velocities by which a singular start may differ from the branch. The mean of
 * neighbouring values has an error of 1e-9. A larger difference has energy across the branch.
 * Starts that miss a branch by 3e-6 are refused, and by 3e-7 are accepted. */
#define START_VELOCITY 1e-6

/* Make the chart at x, or at the last regular state if x is not regular, and compute the
 * coordinates of x in it. Returns a status of the stepper. */
int origin_prepare(passage *g, double t, const double *x);

/* Recompute the chart from memory, unless it is valid. Returns 1 on failure. */
int origin_restore(passage *g);

#endif
