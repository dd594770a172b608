/* Reduced equations of a target pose near a singular configuration, in the null directions.
 *
 * Re-entrant: no globals and no allocation.
 * Source: Golubitsky and Schaeffer 1985, chapter VII.
 */
#ifndef MBS_ARM_REDUCE_H
#define MBS_ARM_REDUCE_H

#include "arm.h"

typedef struct {
    int corank;           /* number c of remaining unknowns h; n - c equations are solved */
    const double *centre; /* (n,) singular configuration, x = q / unit */
    const double *solved; /* (n - c, 6) directions of the solved equations */
    const double *left;   /* (6 - n + c, 6) directions of the remaining equations */
    const double *null;   /* (c, n) directions of the remaining unknowns */
} arm_reduction;

/* Computes x (n,) for h (c,) and the residual g (6 - n + c,) of the remaining equations, by
 * Newton's method. Returns 0 if it does not converge. */
int arm_reduced(const arm *a, const double *target, const arm_reduction *r, const double *h,
                double *x, double *g);

#endif
