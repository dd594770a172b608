/* Smallest solutions and Gauss-Newton iterations: the twin of `solvers/least_squares.py`.
 *
 * Every sum has the order that it has there, which is NumPy's: results are the same to the bit, so
 * that it makes no difference which of the twins ran. A change here is a change there.
 */
#ifndef MBS_LEAST_SQUARES_H
#define MBS_LEAST_SQUARES_H

/* The shortest x (n,) of those that bring A x nearest to b (m,), A (m, n) row by row; columns that
 * those before leave shorter than `gap` of the longest are dependent. 1 where memory is lacking. */
int mbs_smallest_solution(int m, int n, const double *A, const double *b, double gap, double *x);

/* Equations r(q) = 0, of which some elements of q are unknown. The functions read q, and write r and
 * the elements of the Jacobian; what they return is 0 where they have values. */
typedef struct {
    int size, rows, unknowns, elements;
    double *q, *r, *e;        /* (size,), (rows,), (elements,) */
    const int *free;          /* numbers of the unknowns in q */
    const int *row, *column;  /* of the elements, the column among the unknowns, -1 elsewhere */
    const double *tolerance;  /* (rows,) */
    double gap;
    int iterations;
    int (*equations)(void), (*values)(void); /* r and e, r alone */
} least_squares;

/* Failed: a function has no value, or memory is lacking. */
enum { LEAST_SQUARES_OPEN, LEAST_SQUARES_CONVERGED, LEAST_SQUARES_FAILED };

/* Damped Gauss-Newton from q, which becomes the last iterate; *residual: Euclidean norm there. */
int mbs_gauss_newton(least_squares *s, double *residual);

#endif
