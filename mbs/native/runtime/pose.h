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

typedef struct {
    const arm *arm;
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

#endif
