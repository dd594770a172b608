/* Shortest solutions of linear equations, and Gauss-Newton iterations.
 *
 * Every sum has one order, that of NumPy. The digits of a result are therefore the same on every
 * processor.
 *
 * Source: Golub and Van Loan 2013, section 5.4, for QR with column pivoting.
 */
#ifndef MBS_LEAST_SQUARES_H
#define MBS_LEAST_SQUARES_H

#include "model.h"

/* Compute the shortest x (n,) that minimises |A x - b|, for A (m, n) by rows and b (m,). A column
 * counts as dependent if its part orthogonal to the columns before it is shorter than `gap` times
 * the longest column. Returns 1 if no memory is left. */
int shortest_solution(int m, int n, const double *A, const double *b, double gap, double *x);

/* Equations r(q, p) = 0 with some elements of q unknown. */
typedef struct {
    int size, rows, unknowns, elements;
    double *q, *r, *e; /* (size,), (rows,), (elements,) */
    const double *p;
    const int *free;         /* (unknowns,) indices of the unknowns in q */
    const int *row, *column; /* (elements,) of the Jacobian; column of an unknown, or -1 */
    const double *tolerance; /* (rows,) */
    double gap;              /* see shortest_solution */
    int iterations;
    model_function equations; /* (q, p) -> r, e */
    model_function values;    /* (q, p) -> r, optional; else `equations` */
    model_function step;      /* (e, b) -> the shortest x (unknowns,) for large sparse Jacobians */
} least_squares;

/* Result of gauss_newton. Failed: a function has no value, or no memory is left. */
enum { LEAST_SQUARES_OPEN, LEAST_SQUARES_CONVERGED, LEAST_SQUARES_FAILED };

/* Solve by a damped Gauss-Newton iteration from q, which becomes the last iterate. *residual:
 * Euclidean norm of r there. Each step is halved until the residual decreases. */
int gauss_newton(least_squares *s, double *residual);

#endif
