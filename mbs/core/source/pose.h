/* All configurations of an arm that reach a pose, and whether they are certainly complete.
 *
 * Re-entrant: no globals and no allocation. Uncertain poses, near singular configurations, are left
 * to slower methods. `inverse_geometry/draft_many.py` has the same rules and constants for batches.
 */
#ifndef MBS_POSE_H
#define MBS_POSE_H

#include "raghavan_roth.h"

/* Result of the solution for a pose. */
enum { POSE_CERTAIN, POSE_DOUBTFUL, POSE_NOT_RIGID, POSE_FAILED };

enum { POSE_COLUMNS = 16 }; /* largest number of isolated configurations of a six-joint arm */

typedef struct {
    const arm *robot;
    const roth_loop *loop; /* loop of the general method; NULL: the closed form is used */
    /* T -> q (n, branches), residual, real, regular, mark (branches,), in CasADi's convention */
    int (*evaluate)(const double **, double **, long long *, double *, int);
    int (*checkout)(void);
    void (*release)(int);
    long long branches;
    long long arguments, results, integers, reals; /* work sizes of the closed form */
    double suspect, nearly;                        /* bounds, see pose_settle */
    long long nq;
    const long long *indices; /* (n,) of the arm's joints in the coordinates; NULL: in order */
    const double *others;     /* (nq,) positions of all coordinates; arm joints unused */
} pose_solver;

/* Rounds T (4, 4), row by row, to the nearest rigid transform; 0 if not rigid to 1e-6. */
int pose_round(double *T);

/* Whether the smallest singular value of the Jacobian, with arm lengths, is below a bound. */
int pose_is_singular(const arm *a, const double *q, double bound);

/* Keeps the branches of a closed form that are solutions, each once, in q (branches, n), residual
 * and number (branch index). Returns their count. Sets *doubtful if others may be missing, as at
 * singular values of the Jacobian below `nearly`. The Jacobian is not examined for branches whose
 * `real` and `regular` are at least `suspect`. */
long long pose_settle(const arm *a, const double *T, long long branches, double *q,
                      double *residual, const double *real, const double *regular, double suspect,
                      double nearly, double *number, int *doubtful);

/* Solves for a pose (4, 4), column by column: q (room, nq), residual (room,), branch number (room,)
 * and their count. Returns the result code. There must be room for all branches, or
 * ROTH_CONFIGURATIONS. w has as many doubles, or the work of the closed form and three doubles per
 * branch. */
int pose_solve(const pose_solver *s, const double *columns, double *q, double *residual,
               double *number, double *w, long long *count);

/* The general method as a CasADi Function: T (4, 4) -> q (nq, POSE_COLUMNS), valid (POSE_COLUMNS,),
 * count, certain. Residuals are below 1e-12 times max(1 m, length). Columns from count on are NaN.
 * certain is 0 if a configuration may be missing or T is not rigid. w has
 * ROTH_CONFIGURATIONS (nq + 3) doubles. */
int pose_all(const pose_solver *s, const double **arg, double **res, double *w);

/* Jacobian of pose_all: T and outputs -> dq/dT (POSE_COLUMNS nq, 16); zero for NaN columns. */
int pose_all_jacobian(const pose_solver *s, const double **arg, double **res);

#endif
