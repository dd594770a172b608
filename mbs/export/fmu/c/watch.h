/* Detection of singular configurations between two accepted configurations.
 *
 * In a singular configuration the independent joints do not determine the dependent joints, and
 * branches of motion meet. A step across it may end on another branch, on which all closure rows
 * hold but energy is not conserved. Two signs reveal such a step. The determinant of a diagonal
 * block of the closure Jacobian changes its sign. Or the change of a dependent velocity differs
 * from the trapezoidal integral of its acceleration, so that the motion has a kink.
 */
#ifndef MBS_WATCH_H
#define MBS_WATCH_H

#include "closure.h"

#ifndef WATCHED /* the header of a bare library defines this structure itself */
typedef struct {
    int on;
    real time;
    real sign[NB + 1];
    real v[N_PASSIVE + 1], a[N_PASSIVE + 1]; /* velocities and accelerations of dependent joints */
} watched;
#endif

#define WATCH_WORK (NZ * NZ)

#if NB > 0

/* Compute the sign (+1 or -1) of the determinant of each diagonal block (NB,). Returns 1 if a block
 * is singular. J: scratch memory of WATCH_WORK numbers. */
SHARED int watch_signs(const loops *l, const real *x, const real *z, real *sign, real *J);

/* Whether the motion between two configurations is not smooth. unit: typical sizes of v. */
SHARED int watch_differ(const watched *before, const watched *now, const real *unit);

#endif

#endif
