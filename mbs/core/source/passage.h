/* Steps through singular configurations of closed loops, in local tangent coordinates.
 *
 * "Rows" are the closure constraints of the loops. At a configuration where the rows become
 * dependent, branches of motion meet. Let s be the distance from it along a branch. An error w
 * across the branch obeys (s w)'' = 0 and grows as 1/s for any step size. An integration of all
 * coordinates therefore fails there, although the motion along the branch is smooth. Near such a
 * configuration the steps use coordinates xi along the branch and their rates u. Positions,
 * velocities and accelerations of the tree follow from Newton steps onto all rows, which remove the
 * error across the branch at every stage. At the singular configuration itself they are weighted
 * means of values on both sides.
 *
 * The chart (the local coordinates) is orthogonal in the metric of the inertia matrix, so that the
 * direction in which the rows lose rank has no effect on u'. A new chart is made at the start of
 * each step. Away from singular configurations the method of the stepper runs unchanged.
 *
 * Further headers: passage_start.h for starts in singular configurations, passage_external.h for
 * external integrators. The parts of the method are passage_frame.h (rows, inertia and tangents at
 * a state), passage_newton.h (projection), passage_chart.h (local coordinates), passage_crossing.h
 * (values at the singular configuration), passage_origin.h (choice of the chart, restart),
 * passage_near_miss.h (branches that do not meet) and passage_step.h (the step).
 *
 * Source: Hairer, Lubich and Wanner 2006, IV.5.3, for local tangent coordinates; Hairer and Wanner
 * 1996, VII.2, for local state space forms of equations of index 3; Golub and Van Loan 2013,
 * algorithm 5.4.1, for the orthogonal factors of the rows, truncated at the rank that the assembly
 * of the model found.
 */
#ifndef MBS_PASSAGE_H
#define MBS_PASSAGE_H

#include "stepper.h"

/* Fraction of the largest regularity below which steps are made in the chart. A full step magnifies
 * errors by 1 / regularity and rounding by its square. At a fifth the magnification is small, and a
 * tenth of the range of a crank lies below it. With ten times more the error of an
 * antiparallelogram at a tolerance of 1e-10 rises from 0.05 to 6.5 tolerances. */
#define PASSAGE_ON 0.2

/* Dimensions of the state and of the constraint rows. */
typedef struct {
    int nq, nv, nz; /* numbers of positions, velocities and other states in x */
    int positions;  /* number of position rows: the rows that belong to the velocity rows, in
                       the same order, then the unit norms of quaternions */
    int anchors;    /* number of velocity rows that lock a coordinate. They are the last velocity
                       rows. Their position rows keep the value at the origin of the chart. */
    int speeds;     /* number of velocity rows */
    int moving;     /* 1 if the rows depend on time, else 0 */
} passage_size;

/* Sparsity patterns in compressed columns: the index of the first element of each column, the
 * number of elements, then the row indices of all elements by columns, in ascending order. NULL
 * for a dense matrix. The model writes only these elements, in this order. */
typedef struct {
    const int *slope, *J, *N, *M;
} passage_patterns;

/* Constraint rows at a state. position (positions,): residuals. slope (positions, nq): derivatives
 * of position by q. J (speeds, nv), b and c: J v = b and J a = c. N (nq, nv) and bend (nq,):
 * q' = N v and q'' = N a + bend. rank: rank of J. If nq equals nv, the model omits J (equal to the
 * first rows of slope), N (unit matrix) and bend (zero). */
typedef struct {
    double *position, *slope, *J, *b, *c, *N, *bend, *rank;
} passage_rows;

/* Functions of the model. They return 0, or nonzero on failure. */
typedef struct {
    int (*rows)(void *user, double t, const double *x, const passage_rows *rows);
    /* Inertia matrix M (nv, nv), forces f (nv,) with M a = f + J' y, where y are the constraint
     * forces, and rates (nz,) of the other states. */
    int (*forces)(void *user, double t, const double *x, double *M, double *f, double *rate);
    /* Measure of the independence of the rows: near a singular configuration it is small and linear
     * in the distance from it. */
    int (*regularity)(void *user, double t, const double *x, double *value);
    double typical; /* regularity at a common configuration */
} passage_model;

/* Data that are kept between steps, in addition to the origin of the chart. All members are
 * doubles, flags included, so that a saved state can check them as one array. */
typedef struct {
    double sigma_max;        /* largest sigma so far, the distance from the loss of rank; 0: none */
    double regularity_max;   /* largest regularity so far */
    double regularity;       /* regularity at the end of the last step */
    double regularity_rate;  /* its mean rate in the last step [1/s] */
    double regularity_known; /* 1 if regularity belongs to regularity_time, else 0 */
    double regularity_time;  /* [s] */
    double has_origin;       /* 1 if the origin of the chart is set, else 0 */
    double origin_time;      /* time of the origin of the chart [s] */
} passage_memory;

typedef struct passage passage;

/* Wrap the method of an initialised stepper. Returns NULL if no memory is left. patterns is NULL if
 * all matrices are dense. The caller keeps memory and origin (n,), the last regular state, at which
 * the chart has its origin; a copy of both saves the data between steps. */
passage *passage_new(stepper *s, const passage_size *size, const passage_patterns *patterns,
                     const passage_model *model, passage_memory *memory, double *origin);
void passage_free(passage *g);

/* Clear the memory before stepper_start. */
void passage_start(passage *g);

/* Discard all data outside memory and origin after their contents were replaced. */
void passage_forget(passage *g);

/* Whether all members are finite. */
int passage_memory_finite(const passage_memory *memory);

/* Project positions and velocities in x onto the rows in the chart of the last step. Returns 1 if
 * the last step had no chart; the projection of the full step is then required. */
int passage_project(passage *g, double t, double *x);

#endif
