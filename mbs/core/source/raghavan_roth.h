/* All configurations of a six-joint arm that reach a pose, by elimination.
 *
 * The loop is Z_1 C_1 .. Z_6 C_6 = 1, with the displacements Z of the joints and constant
 * transforms C, one of which contains the target pose. It may start at any joint and run in either
 * direction. Python code selects the best loop of an arm once. Re-entrant: no globals and no
 * allocation.
 *
 * Source: Raghavan and Roth 1993; Manocha and Canny 1994.
 */
#ifndef MBS_RAGHAVAN_ROTH_H
#define MBS_RAGHAVAN_ROTH_H

#include "arm_search.h"

enum {
    ROTH_SIZE = 12,            /* largest number of monomials x4^i x5^j */
    ROTH_ROOTS = 24,           /* largest number of angles of joint 3 */
    ROTH_SHARED = 6,           /* largest number of solutions that share an angle of joint 3 */
    ROTH_CONFIGURATIONS = 144, /* largest number of candidates */
    ROTH_ROWS = 28             /* largest number of equations before they are mixed */
};

typedef struct roth_loop {
    int order[6];             /* index of the arm's joint for each joint of the loop */
    int sign;                 /* 1; -1 if the loop runs against the arm */
    int prismatic[6];         /* whether each joint of the loop is prismatic */
    double offsets[6];        /* angles at which the loop's joints are zero [rad] */
    double transforms[6][16]; /* (4, 4), row by row, in arm lengths */
    int index;                /* index of the transform that ends where the pose begins */
    double after[16];         /* transform after the pose in that transform */
    double length;            /* unit of lengths [m] */
    int count;                /* number of used elements of w, see pair.h */
    int elements[15];         /* indices of these elements; the first is the number 1 */
    int powers[5];            /* numbers of monomials of joints 1 to 5 */
    int raised;               /* 0: the equations are multiplied by x4; 1: by x5 */
    int rank;                 /* rank of the matrix of the monomials of joints 1 and 2 */
    int size;                 /* size of the square matrix */
    const double *mix;        /* (size, rows) combinations of the equations; NULL: rows = size */
    const struct roth_loop *next; /* alternative loop of the arm, for poses at which the matrix
                                     of this loop is nearly singular at every angle; or NULL */
} roth_loop;

/* Matrix that is singular at a solution: parts with the weights of the angle u of joint 3, 1, cos
 * u, sin u or cos(u/2), sin(u/2). */
typedef struct {
    int size, parts;
    double M[3][ROTH_SIZE * ROTH_SIZE]; /* row by row */
} roth_matrix;

/* Transforms of the loop for a target pose. */
void roth_transforms(const roth_loop *r, const double *T, double transforms[6][16]);

void roth_weights(int parts, double u, double *weights);

void roth_eliminate(const roth_loop *r, const double transforms[6][16], roth_matrix *m);

/* Finds an offset of the angle of joint 3 at which the matrix is well conditioned. Returns the
 * regularity at this offset, near 0 for a matrix that is nearly singular everywhere. */
double roth_regularity(const roth_matrix *m, double *offset);

/* Angles u, ascending, at which the matrix is singular, or nearly singular for a real angle. A
 * double root appears twice. Returns the number of angles. */
int roth_roots(const roth_matrix *m, double offset, double *u);

/* Half angles x4, x5 (ROTH_SHARED,) of the `count` solutions at the angle u. Returns the number of
 * solutions found. */
int roth_middle(const roth_loop *r, const roth_matrix *m, double u, int count, double *x4,
                double *x5);

/* Positions of all joints of the loop for positions of joints 3, 4, 5. Returns their count. */
int roth_rest(const roth_loop *r, const double transforms[6][16], const double *middle,
              double configurations[3][6]);

/* Configurations q (ROTH_CONFIGURATIONS, 6) that may reach the pose. Returns their number. */
int roth_candidates(const roth_loop *r, const double *T, double *q);

/* Distinct polished configurations that reach the pose. There must be room for
 * ROTH_CONFIGURATIONS. */
void roth_solve(const arm *a, const roth_loop *r, const double *T, arm_configurations *found);

#endif
