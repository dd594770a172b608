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
 * Source: Hairer, Lubich and Wanner 2006, IV.5.3, for local tangent coordinates; Golub and Van Loan
 * 2013, algorithm 5.4.1, for the orthogonal factors of the rows, truncated at the rank that the
 * assembly of the model found.
 */
#ifndef MBS_PASSAGE_H
#define MBS_PASSAGE_H

#include "stepper.h"

/* Fraction of the largest regularity below which steps are made in the chart. A full step magnifies
 * errors by 1 / regularity and rounding by its square. At a fifth the magnification is small; a
 * tenth of the range of a crank lies below it. */
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

/* Number of doubles that are kept between steps: scalars, then the last regular state (n,). */
#define PASSAGE_MEMORY(n) (8 + (n))

typedef struct passage passage;

/* Wrap the method of an initialised stepper. Returns NULL if no memory is left. patterns is NULL if
 * all matrices are dense. memory has PASSAGE_MEMORY(n) elements. */
passage *passage_new(stepper *s, const passage_size *size, const passage_patterns *patterns,
                     const passage_model *model, double *memory);
void passage_free(passage *g);

/* Clear the memory before stepper_start. */
void passage_start(passage *g);

/* Discard all data outside `memory` after its contents were replaced. */
void passage_forget(passage *g);

/* Project positions and velocities in x onto the rows in the chart of the last step. Returns 1 if
 * the last step had no chart; the projection of the full step is then required. */
int passage_project(passage *g, double t, double *x);

/* Functions for a first state at which the rows may be dependent. */

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

/* Functions for an external integrator. A chart is valid from one call of passage_chart to the
 * next. All functions return a status of the stepper. */

/* Make a chart at the state x. */
int passage_chart(passage *g, double t, const double *x);

/* Compute the coordinates y = (xi, u, z) of x in the chart. */
int passage_coordinates(passage *g, double t, const double *x, double *y);

/* Compute the state x on the rows at the coordinates y, and the slopes of x and y. guide (n,):
 * state near x that selects the branch. *alignment: alignment of the tangents with the tangents at
 * the origin of the chart, 1 if parallel and 0 if orthogonal. */
int passage_state(passage *g, double t, const double *y, const double *guide, double *x,
                  double *slope_x, double *slope_y, double *alignment);

/* Whether a step from x at t, with slope first, to y at t + h, with slope last, jumps between
 * branches that come near each other and do not meet. Call it right after passage_state computed
 * y (n,) and last (n,). */
int passage_jumps(passage *g, double t, const double *x, const double *first, double h,
                  const double *y, const double *last);

/* Compute how well the independent velocities determine the motion. independent: indices of as many
 * velocities as there are degrees of freedom. unit (nv,): factor that scales each velocity.
 * *grip: 1 / largest element (at least 1) of the matrix from the independent velocities to all
 * velocities; 0 if they do not determine the motion. Returns 1 on failure. */
int passage_grip(passage *g, double t, const double *x, const int *independent, const double *unit,
                 double *grip);

/* Return the regularity at x, as a fraction of the largest value so far. */
double passage_regularity(passage *g, double t, const double *x);

#endif
