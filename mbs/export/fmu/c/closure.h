/* Dependent coordinates of closed loops, by Newton steps from a known configuration.
 *
 * FMUs and bare C libraries share this file and watch.h: no heap, no stdio, nothing kept between
 * calls, and numbers are `real`, see real.h.
 */
#ifndef MBS_CLOSURE_H
#define MBS_CLOSURE_H

#include "model.h"
#include "real.h"

/* NEARLY: of a start in a singular configuration, which Newton steps do not reach; z is beside it. */
enum { CLOSURE_OK, CLOSURE_OPEN, CLOSURE_SINGULAR, CLOSURE_NEARLY };

/* What a run knows of its loops. */
typedef struct {
    real *x, *z;       /* the last accepted configuration */
    const real *guess; /* of z at the start; where it is not MODEL_START, it chooses the branch */
    const real *p;     /* parameters */
    const real **arg;  /* scratch of the generated functions */
    real **res;
    long long *iw;
    real *w;
} loops;

/* z of the configuration x, on the branch of the last accepted configuration. */
SHARED int closure_solve(const loops *l, const real *x, real *z);

/* The first configuration of a run: from the guesses, through the start values of the states. */
SHARED int closure_start(const loops *l, const real *x, real *z);

/* 1 where a small change of the states moves the dependent coordinates almost without bound. */
SHARED int closure_singular(const loops *l, const real *x, const real *z);

#endif
