/* Newton steps onto the constraints of a system. */
#ifndef MBS_PROJECTION_H
#define MBS_PROJECTION_H

/* Make one Newton step from x (n,) at time t. after (n,): state after the step. *residual: largest
 * residual at x. Returns 0, or nonzero on failure. */
typedef int (*projection_step)(void *user, double t, const double *x, double *after,
                               double *residual);

/* Project x (n,) until the residual is below 1e-12 of the largest state. after (n,) is scratch.
 * Returns 0, or 1 if the steps do not converge. */
int projection_converge(int n, projection_step step, void *user, double t, double *x,
                        double *after);

#endif
