/* First states at which the rows may be dependent. */
#ifndef MBS_PASSAGE_START_H
#define MBS_PASSAGE_START_H

#include "passage.h"

/* Whether the rows are dependent, or nearly so, at x. */
int passage_singular(passage *g, double t, const double *x);

/* Project the positions in x onto all rows by changes of the positions with indices loose (count,).
 * Returns 1 if the Newton steps do not converge. */
int passage_place(passage *g, double t, double *x, const int *loose, int count);

/* Replace the velocities in x by the shortest vector that satisfies all rows and keeps the
 * velocities with indices kept (count,). Returns 1 if no motion has these velocities. */
int passage_velocities(passage *g, double t, double *x, const int *kept, int count);

/* Compute the slope xdot (n,) at x. In a singular configuration it is the slope of the branch that
 * has the velocities of x. on (n,) or NULL: the state on the branch; x if the rows are independent.
 * Returns a status of the stepper, STEPPER_UNDETERMINED if no branch has these velocities. */
int passage_slope(passage *g, double t, const double *x, double *xdot, double *on);

/* Return the index of the velocity that the rows constrain least at x, or -1 on failure.
 * unit (nv,): factor that scales each velocity. */
int passage_loosest(passage *g, double t, const double *x, const double *unit);

#endif
