/* All configurations of an arm of six joints that reach a pose, by elimination.
 *
 * The loop Z_1 C_1 .. Z_6 C_6 = 1 of the joints' motions Z and constant transforms C, one of which
 * contains the target pose, may begin at any joint and run in either direction; what is
 * best for an arm is chosen once, elsewhere. Re-entrant: no globals and no allocation.
 *
 * Source: Raghavan and Roth 1993; Manocha and Canny 1994.
 */
#ifndef MBS_RAGHAVAN_ROTH_H
#define MBS_RAGHAVAN_ROTH_H

#include "arm_search.h"

enum {
    ROTH_SIZE = 12,      /* monomials x4^i x5^j at most */
    ROTH_ROOTS = 24,     /* angles of joint 3 */
    ROTH_SHARED = 6,     /* solutions at one of them */
    ROTH_CONFIGURATIONS = 144, /* candidates */
    ROTH_ROWS = 28       /* equations before they are mixed */
};

typedef struct roth_loop {
    int order[6];            /* the arm's joint that each joint of the loop is */
    int sign;                /* 1; -1 where the loop runs against the arm */
    int prismatic[6];           /* of the loop's joints */
    double offsets[6];       /* from which their angles are counted [rad] */
    double transforms[6][16];      /* (4, 4), row by row, in arm lengths */
    int index;               /* of the transform that ends where the pose begins */
    double after[16];        /* what comes after the pose in its transform */
    double length;           /* of the arm [m] */
    int count;               /* elements of a pair that are used, */
    int elements[15];        /* which ones; the first is the number 1 */
    int powers[5];           /* numbers of monomials of joints 1 to 5 */
    int raised;              /* 0: the equations are multiplied by x4; 1: by x5 */
    int rank;                /* of what joints 1 and 2 are in */
    int size;                /* of the matrix */
    const double *mix;       /* (size, rows) makes as many equations; NULL: there are as many */
    const struct roth_loop *next; /* the same arm from another joint, for poses at which the matrix of
                                     this loop is nearly singular at every angle; or NULL */
} roth_loop;

/* The matrix that is singular at a solution: its parts with the weights of the angle u of joint 3,
 * 1, cos u, sin u or cos(u/2), sin(u/2). */
typedef struct {
    int size, parts;
    double M[3][ROTH_SIZE * ROTH_SIZE]; /* row by row */
} roth_matrix;

/* The transforms of the loop for a target pose. */
void roth_transforms(const roth_loop *r, const double *T, double transforms[6][16]);

void roth_weights(int parts, double u, double *weights);

void roth_eliminate(const roth_loop *r, const double transforms[6][16], roth_matrix *m);

/* Finds an offset of the angles at which the matrix is well conditioned. Returns the regularity there:
 * a nearly singular matrix has none. */
double roth_regularity(const roth_matrix *m, double *offset);

/* Angles u, ascending, where the matrix is singular, or nearly so for a real angle; a double one is
 * there twice. Returns their number. */
int roth_roots(const roth_matrix *m, double offset, double *u);

/* Half angles x4, x5, (ROTH_SHARED,), of the `count` solutions at the angle u; gives for how many
 * of them. */
int roth_middle(const roth_loop *r, const roth_matrix *m, double u, int count, double *x4,
                double *x5);

/* Positions of all joints of the loop from those of joints 3, 4 and 5: one, two or three rows. */
int roth_rest(const roth_loop *r, const double transforms[6][16], const double *middle,
              double configurations[3][6]);

/* Configurations (ROTH_CONFIGURATIONS, 6) of the arm that may reach the pose; gives how many they are. */
int roth_candidates(const roth_loop *r, const double *T, double *q);

/* The distinct ones that do reach it, polished. There must be room for ROTH_CONFIGURATIONS. */
void roth_solve(const arm *a, const roth_loop *r, const double *T, arm_configurations *found);

#endif
