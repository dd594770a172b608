/* The equations of a target pose near a singular configuration, in the directions left free.
 *
 * Re-entrant: no globals and no allocation.
 * Source: Golubitsky and Schaeffer 1985, chapter VII.
 */
#ifndef MBS_ARM_REDUCE_H
#define MBS_ARM_REDUCE_H

#include "arm.h"

typedef struct {
    int corank;           /* c, unknowns h that remain; n - c equations are solved for the others */
    const double *centre; /* (n,) the configuration, x = q / unit */
    const double *solved; /* (n - c, 6) directions of the equations that are solved */
    const double *left;   /* (6 - n + c, 6) of those that remain */
    const double *null;   /* (c, n) directions of the unknowns that remain */
} arm_reduction;

/* x (n,) with h (c,) and what it leaves of the equations, g (6 - n + c,), by Newton's method; 0: it
 * does not converge. */
int arm_reduced(const arm *a, const double *target, const arm_reduction *r, const double *h, double *x,
                double *g);

#endif
