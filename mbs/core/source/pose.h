/* All configurations of an arm that reach one pose, and whether they are certain.
 *
 * Re-entrant: no globals and no allocation. What is in doubt, next to singular configurations, is
 * left to slower methods; `inverse_geometry/many.py` has the same rules and numbers for batches.
 */
#ifndef MBS_POSE_H
#define MBS_POSE_H

#include "raghavan_roth.h"

/* What came of a pose. */
enum { POSE_CERTAIN, POSE_DOUBTFUL, POSE_NOT_RIGID, POSE_FAILED };

enum { POSE_COLUMNS = 16 }; /* isolated configurations of six joints that reach a pose, at most */

typedef struct {
    const arm *robot;
    const roth_loop *loop; /* of the general method; NULL: the closed form solves */
    /* T -> q (n, branches), residual, real, regular, mark (branches,), in CasADi's convention */
    int (*evaluate)(const double **, double **, long long *, double *, int);
    int (*checkout)(void);
    void (*release)(int);
    long long branches;
    long long arguments, results, integers, reals; /* that the closed form works with */
    double suspect, nearly; /* see pose_settle */
    long long nq;
    const long long *indices; /* (n,) of the arm's joints among the coordinates; NULL: all, in order */
    const double *others;     /* (nq,) positions of all coordinates; those of the arm do not count */
} pose_solver;

/* Rounds T (4, 4), row by row, to the nearest rigid transform; 0 where it is none but for 1e-6. */
int pose_round(double *T);

/* Whether the smallest singular value of the Jacobian is below a bound, lengths in arm lengths. */
int pose_is_singular(const arm *a, const double *q, double bound);

/* Keeps in q (branches, n) and in residual those branches of a closed form that are solutions, each
 * once, with their numbers; gives how many they are. *doubtful is set where others may be missing.
 * Below a singular value `nearly` they may; of branches whose `real` and `regular` are at least
 * `suspect` the Jacobian is not asked. */
long long pose_settle(const arm *a, const double *T, long long branches, double *q,
                      double *residual, const double *real, const double *regular,
                      double suspect, double nearly, double *number, int *doubtful);

/* What came of a pose (4, 4), column by column: q (room, nq), residual (room,), number (room,) of the
 * branches, and how many they are. There must be room for all branches, or for
 * ROTH_CONFIGURATIONS; w has as many doubles, or what the closed form works with and three a branch. */
int pose_solve(const pose_solver *s, const double *columns, double *q, double *residual,
               double *number, double *w, long long *count);

/* The general method as a Function of CasADi: T (4, 4) -> q (nq, POSE_COLUMNS), valid
 * (POSE_COLUMNS,), count, certain. Residuals are below 1e-12 of max(1 m, the length); columns from
 * the count on are NaN; certain is 0 where a configuration may be missing or T is no pose. w has
 * ROTH_CONFIGURATIONS (nq + 3) doubles. */
int pose_all(const pose_solver *s, const double **arg, double **res, double *w);

/* Its Jacobian: T and the outputs -> d q / d T (POSE_COLUMNS nq, 16), zero for columns without one. */
int pose_all_jacobian(const pose_solver *s, const double **arg, double **res);

#endif
