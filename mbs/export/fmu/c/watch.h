/* What is watched between two accepted configurations: no leap without notice.
 *
 * Where the independent joints lose their hold on the dependent ones, branches of motion meet, and a
 * step may end on another one: every row of the closure holds there, energy does not. Two things
 * show it. The determinant of a diagonal block of the slopes of the closure changes its sign: the
 * step has passed a singular configuration. Or velocities of dependent joints change by other than
 * what their accelerations at both ends make of the step: the motion has a kink.
 */
#ifndef MBS_WATCH_H
#define MBS_WATCH_H

#include "closure.h"

#ifndef WATCHED /* the header of a bare library has it */
typedef struct {
    int on;
    real time;
    real sign[NB + 1];
    real v[N_PASSIVE + 1], a[N_PASSIVE + 1]; /* of the dependent joints */
} watched;
#endif

#define WATCH_WORK (NZ * NZ)

#if NB > 0

/* The signs of the determinants of the diagonal blocks at a configuration; 1 where one is singular.
 * J: WATCH_WORK numbers. */
SHARED int watch_signs(const loops *l, const real *x, const real *z, real *sign, real *J);

/* 1 where what lies between two configurations is no smooth motion; unit: of v. */
SHARED int watch_differ(const watched *before, const watched *now, const real *unit);

#endif

#endif
