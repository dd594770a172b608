/* Projection of positions onto the constraint rows at fixed chart coordinates, by Newton steps.
 *
 * Source: Hairer, Lubich and Wanner 2006, IV.5.3.
 */
#ifndef MBS_PASSAGE_NEWTON_H
#define MBS_PASSAGE_NEWTON_H

#include "passage_data.h"

/* Maximum number of Newton steps onto the rows. Three or four are usual in a step of the
 * integration. One step refuses starts on a branch; a hundred change nothing. */
#define NEWTON_STEPS 10

/* Largest element of a Newton step [rad or m] after which the next step is below rounding, because
 * convergence is quadratic: its square is 1e-18. At a near miss by 1e-8 m and a tolerance of 1e-9
 * the energy error is 0.6 tolerances; it is 2.9 tolerances with 1e-8, and 1.4 tolerances with
 * 1e-10. */
#define NEWTON_CONVERGED 1e-9

/* Project the positions in x onto all rows at fixed xi by Newton steps. *distance: sum of their
 * largest elements. Returns 1 if they do not converge. */
int newton_project(passage *g, double t, const double *xi, double *x, double *distance);

#endif
