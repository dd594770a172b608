/* Reachable pose nearest to a target pose.
 *
 * Re-entrant: no globals and no allocation. The starts depend on the seed only.
 */
#ifndef MBS_ARM_NEAREST_H
#define MBS_ARM_NEAREST_H

#include "arm.h"

/* Configuration q whose pose has the smallest cost, the squared norm of the gap to the target.
 * Returns this cost. At least one start is required. */
double arm_nearest(const arm *a, const double *target, long long starts, unsigned long long seed,
                   double *q);

#endif
