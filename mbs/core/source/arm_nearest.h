/* The reachable pose that is nearest to a target pose.
 *
 * Re-entrant: no globals and no allocation. The starts depend on the seed alone.
 */
#ifndef MBS_ARM_NEAREST_H
#define MBS_ARM_NEAREST_H

#include "arm.h"

/* The configuration whose pose is nearest, the gap's cost being the square of the distance; gives that
 * cost. At least one start. */
double arm_nearest(const arm *a, const double *target, long long starts, unsigned long long seed,
                   double *q);

#endif
