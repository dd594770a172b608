/* Dependent coordinates of closed loops, by Newton steps from a known posture. */
#ifndef MBS_CLOSURE_H
#define MBS_CLOSURE_H

#include "core.h"

enum { CLOSURE_OK, CLOSURE_OPEN, CLOSURE_SINGULAR };

/* z of the posture x, on the branch of the last accepted posture. */
int closure_solve(core *c, const double *x, double *z);

/* The first posture of a run: from the guesses, by way of the start values of the states. */
int closure_start(core *c, const double *x, double *z);

/* 1 where a small change of the states moves the dependent coordinates almost without bound. */
int closure_singular(core *c, const double *x, const double *z);

#endif
