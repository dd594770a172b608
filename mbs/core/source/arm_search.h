/* All configurations that reach a pose, from random starts.
 *
 * Re-entrant: no globals and no allocation. The starts depend on the seed alone.
 */
#ifndef MBS_ARM_SEARCH_H
#define MBS_ARM_SEARCH_H

#include "arm.h"

typedef struct {
    double *q;        /* (room, n) distinct configurations */
    double *residual; /* (room,) their relative residuals */
    long long *hits;  /* (room,) how many configurations were found to be this one */
    long long count;
} arm_configurations;

/* A configuration to start from, the same for the same numbers: angles in (-pi, pi], lengths as far
 * as the arm and the target pose reach. */
void arm_start(const arm *a, const double *target, unsigned long long seed, long long number,
               double *q);

/* Whether two solutions are one: closer than 1e-9, or closer than 1e-2 with a solution midway,
 * to 1e-14 or as good as they are, as between copies of a multiple root. Angles that differ by
 * angles modulo 2 pi are equal; lengths are measured in arm lengths. */
int arm_same(const arm *a, const double *target, const double *q, const double *other);

/* Puts a solution among the others, the better of two that are one. q is none of theirs. */
void arm_add(const arm *a, const double *target, const double *q, arm_configurations *found);

/* Solutions found from `starts` starts; there must be room for as many. */
void arm_search(const arm *a, const double *target, long long starts, unsigned long long seed,
                arm_configurations *found);

#endif
