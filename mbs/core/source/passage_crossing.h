/* Values at the singular configuration itself: weighted means of values on both sides.
 *
 * The distance from the singular configuration is measured by sigma, the smallest pivot of the
 * rows, as a fraction of its largest value.
 */
#ifndef MBS_PASSAGE_CROSSING_H
#define MBS_PASSAGE_CROSSING_H

#include "passage_data.h"

/* Fraction of the largest sigma below which values are means of neighbours. The rounding error of
 * u' grows with the inverse square of this fraction, 3e-16 / (3e-5)^2 = 3e-7; at smaller sigma no
 * accuracy remains. A larger fraction smooths the motion near the singular configuration, such as
 * that of a delta robot whose legs become singular one after another. */
#define SIGMA_FLOOR 3e-5

/* Number of floors above which a state is regular. It separates states whose own values are used
 * from states next to means; ten times more stops at near misses by 1e-8 m. */
#define FLOORS_REGULAR 2.0
#define SIGMA_REGULAR (FLOORS_REGULAR * SIGMA_FLOOR)

/* Compute x and the slopes at the chart coordinates y, by means of neighbours if y is singular.
 * Returns a status of the stepper. */
int crossing_state(passage *g, double t, const double *y, double *x, double *xdot, double *ydot);

/* Return the regularity at x, 0 on failure. Updates the largest value. */
double crossing_regularity(passage *g, double t, const double *x);

#endif
