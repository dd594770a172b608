/* All configurations that reach a pose, by descents from random starts.
 *
 * Re-entrant: no globals and no allocation. The starts depend on the seed only.
 */
#ifndef MBS_ARM_SEARCH_H
#define MBS_ARM_SEARCH_H

#include "arm.h"

typedef struct {
    double *q;        /* (room, n) distinct configurations */
    double *residual; /* (room,) their relative residuals */
    long long *hits;  /* (room,) number of results that are equal to each configuration */
    long long count;
} arm_configurations;

/* Random start, reproducible by seed and number: angles in (-pi, pi], displacements within the
 * reach of the arm and of the target pose. */
void arm_start(const arm *a, const double *target, unsigned long long seed, long long number,
               double *q);

/* Whether two solutions are the same: closer than 1e-9, or closer than 1e-2 if their mean is a
 * solution too, to 1e-14 or as exact as they are, as for copies of a multiple root. Angles are
 * compared modulo 2 pi, lengths in arm lengths. */
int arm_same(const arm *a, const double *target, const double *q, const double *other);

/* Adds a solution to the list; of equal solutions the best is kept. q is no row of found. */
void arm_add(const arm *a, const double *target, const double *q, arm_configurations *found);

/* Solutions from `starts` starts. The list must have room for `starts` configurations. */
void arm_search(const arm *a, const double *target, long long starts, unsigned long long seed,
                arm_configurations *found);

#endif
