/* Through singular configurations of closed loops, by steps in local tangent coordinates.
 *
 * Where the rows of the loops become dependent, branches of motion meet. With s the distance from
 * there along a branch, an error w across it obeys (s w)'' = 0: it grows as 1/s, whatever the step,
 * so a state of all coordinates does not come through, though the motion along the branch is as
 * smooth as anywhere. Near such a configuration a step is therefore made in coordinates xi along the
 * branch and their rates u, of which positions, velocities and accelerations of the tree follow by
 * Newton steps onto all rows; the error across is removed at every stage. At the singular
 * configuration itself, where they do not follow, they are means of values on both sides.
 *
 * The chart is orthogonal in the metric of the inertia matrix: the direction that the rows lose does
 * not reach u'. It is made anew at each step, where the step begins. Elsewhere the method of the
 * stepper runs unchanged.
 *
 * Source: Hairer, Lubich and Wanner 2006, IV.5.3, for local tangent coordinates; Golub and Van Loan
 * 2013, algorithm 5.4.1, for the orthogonal factors of the rows, cut at the rank that assembling
 * found.
 */
#ifndef MBS_PASSAGE_H
#define MBS_PASSAGE_H

#include "stepper.h"

/* Part of the largest regularity below which steps are made in the chart. A full step magnifies its
 * errors by 1 / regularity and rounding by its square; at a fifth that is little, and a tenth of the
 * range of a crank lies below it. */
#define PASSAGE_ON 0.2

typedef struct {
    int nq, nv, nz; /* positions, velocities and other states of x */
    int positions;  /* rows of positions: the first ones belong to those of velocities, the last
                       ones keep quaternions at unit length */
    int anchors;    /* those of velocities that lock the coordinate which the last anchors rows of
                       positions before the norms give, wherever it is */
    int speeds;     /* rows of velocities */
    int moving;     /* 1 where rows depend on time */
} passage_size;

/* position (positions,) and its slopes by q (positions, nq); J (speeds, nv), b and c with J v = b
 * and J a = c; N (nq, nv) and bend (nq,) with q' = N v and q'' = N a + bend; the rank of J. Where nq
 * is nv the model leaves out J, which are the slopes, N, the unit matrix, and bend, which is zero. */
/* Where matrices have elements: for each column, and behind the last one, the place of its first element;
 * then the rows of all elements, column by column and rising. NULL: everywhere. The model writes the
 * elements alone, in this order. */
typedef struct {
    const int *slope, *J, *N, *M;
} passage_patterns;

typedef struct {
    double *position, *slope, *J, *b, *c, *N, *bend, *rank;
} passage_rows;

typedef struct {
    int (*rows)(void *user, double t, const double *x, const passage_rows *rows);
    /* Inertia matrix M (nv, nv), forces f (nv,) so that M a = f + J' y, and rates of the other
     * states. */
    int (*forces)(void *user, double t, const double *x, double *M, double *f, double *rate);
    /* How independent the rows of the full step are: near zero, and linear in the distance, where
     * they become dependent. */
    int (*regularity)(void *user, double t, const double *x, double *value);
    double typical; /* regularity at a common configuration */
} passage_model;

/* What one step hands to the next: scalars, then the last regular state. */
#define PASSAGE_MEMORY(n) (8 + (n))

typedef struct passage passage;

/* NULL: no memory is left. patterns may be NULL: all matrices are dense. After the init of the method, which it wraps. */
passage *passage_new(stepper *s, const passage_size *size, const passage_patterns *patterns,
                     const passage_model *model, double *memory);
void passage_free(passage *g);

/* Before stepper_start. */
void passage_start(passage *g);

/* The memory was replaced: what stands beside it belongs to it no more. */
void passage_forget(passage *g);

/* Positions and velocities projected onto the rows in the chart of the last step; 1 where there is
 * no such chart, and the projection of the full step is to be used. */
int passage_project(passage *g, double t, double *x);

/* A start where rows may be dependent, before any step. */

/* 1 where they nearly are at a state. */
int passage_singular(passage *g, double t, const double *x);

/* Positions projected onto all rows, those of x that are loose alone; 1: they do not come there. */
int passage_place(passage *g, double t, double *x, const int *loose, int count);

/* The velocities in x become the smallest on all rows that keep the given ones of them; 1 where no
 * motion has these. */
int passage_velocities(passage *g, double t, double *x, const int *kept, int count);

/* The slope of a state, in a singular configuration that of the branch which has its velocities; on
 * (n,), where it is not NULL: the state on the branch, x where rows are independent. A status of the
 * stepper: undetermined where no branch has these velocities. */
int passage_slope(passage *g, double t, const double *x, double *xdot, double *on);

/* The velocity that the rows constrain least at a state, each in its unit (nv,); -1: no answer. */
int passage_loosest(passage *g, double t, const double *x, const double *unit);

/* Where the steps are made by somebody else, a chart lasts from one call of passage_chart to the
 * next; all return a status of the stepper. */

/* The chart begins here. */
int passage_chart(passage *g, double t, const double *x);

/* y = (xi, u, z), the coordinates of x in the chart. */
int passage_coordinates(passage *g, double t, const double *x, double *y);

/* The state x on the rows at the coordinates y, on the branch of a state guide near it; the slopes of
 * x and y; *alignment: how far the tangents are from those at the origin, 1 there and 0 across. */
int passage_state(passage *g, double t, const double *y, const double *guide, double *x,
                  double *slope_x, double *slope_y, double *alignment);

/* Right after passage_state gave y and its slope at t + h: 1 where the path to it from a state x on
 * the motion at t, with its slope, goes across branches that only come near each other. */
int passage_jumps(passage *g, double t, const double *x, const double *first, double h,
                  const double *y, const double *last);

/* The inverse of how fast velocities, in their units (nv,), are at most where the independent ones,
 * as many as the motion is free, have size one: zero where those determine nothing. 1: no answer. */
int passage_grip(passage *g, double t, const double *x, const int *independent, const double *unit,
                 double *grip);

/* How independent the rows are, part of the largest value so far. */
double passage_regularity(passage *g, double t, const double *x);

#endif
