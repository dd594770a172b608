/* Dependent coordinates of closed loops, by Newton steps from a known configuration.
 *
 * FMUs and bare C libraries share this file and watch.h. The code uses no heap and no stdio and
 * keeps no data between calls. Numbers have the type `real` of real.h.
 */
#ifndef MBS_CLOSURE_H
#define MBS_CLOSURE_H

#include "model.h"
#include "real.h"

/* Status. OPEN: no solution. SINGULAR: the closure Jacobian is singular. NEARLY: the start is a
 * singular configuration, which Newton steps do not reach; z is an extrapolation close to it. */
enum { CLOSURE_OK, CLOSURE_OPEN, CLOSURE_SINGULAR, CLOSURE_NEARLY };

#ifndef NCUT
#define NCUT 0 /* number of positions of cut joints that may be guessed */
#endif

/* Closed loops of a run. z: dependent coordinates; x: states. */
typedef struct {
    real *x, *z;       /* the last accepted configuration */
    const real *guess; /* guess of z at the start; values other than MODEL_START select a branch */
    const real *cut;   /* guess of the positions of cut joints, of the same kind */
    const real *p;     /* parameters */
    const real **arg;  /* scratch of the generated functions */
    real **res;
    long long *iw;
    real *w;
} loops;

/* Compute z (NZ,) at the states x (NX,), on the branch of the last accepted configuration. */
SHARED int closure_solve(const loops *l, const real *x, real *z);

/* Compute z at the start of a run, at the states x. If l->guess or l->cut differs from the start values
 * of the model, z is the solution nearest to it, otherwise the solution on the branch of the start. */
SHARED int closure_start(const loops *l, const real *x, real *z);

/* Whether x, z is singular: a small change of x causes an almost unbounded change of z. */
SHARED int closure_singular(const loops *l, const real *x, const real *z);

#endif
