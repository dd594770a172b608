/* Linear algebra of small real matrices.
 *
 * Implemented without LAPACK, so that a C compiler is the only requirement.
 * Re-entrant: no globals and no allocation. Matrices are stored column by column.
 */
#ifndef MBS_DENSE_H
#define MBS_DENSE_H

#define DENSE_MOST 32 /* rows or columns */

/* Factors A P = Q R by Householder reflections, with the longest remaining column as pivot.
 * Source: Businger and Golub 1965; Golub and Van Loan 2013, algorithm 5.4.1. */
typedef struct {
    int rows, columns, steps;  /* steps: reflections; fewer than columns where the rank is known */
    double *A;                 /* (rows, columns), replaced by R and, below it, the reflections */
    double weight[DENSE_MOST]; /* weights of the reflections */
    int order[DENSE_MOST];     /* column k of R belongs to column order[k] */
} dense_qr;

/* Factorize A in place; sets A, weight and order. */
void dense_factorize(dense_qr *f);

/* Make the Householder reflection that maps v (count,) to a multiple of the first unit vector. v[0]
 * becomes the factor and v[1..] the tail of the reflection vector (1, tail). Returns its weight. */
double dense_reflection(double *v, int count);

/* column (count,) -= weight v (v' column), where v is (1, tail); tail[0] is not read. */
void dense_reflect(const double *tail, double weight, int count, double *column);

/* Compute B = Q' B (rows, count) in place. */
void dense_turn(const dense_qr *f, double *B, int count);

/* Write the least-squares solution X (columns, count) of A X = B to the first rows of each column
 * of B (rows, count). Pivots below `least` times the first pivot are raised to that size. */
void dense_solve(const dense_qr *f, double *B, int count, double least);

/* Return |last pivot / first pivot|, an estimate of the reciprocal condition number. */
double dense_regularity(const dense_qr *f);

/* Write the last `count` columns of Q to V (rows, count). They are an orthonormal basis of the
 * orthogonal complement of the columns of A, if the rank of A is rows - count. */
void dense_complement(const dense_qr *f, double *V, int count);

/* Factorize A (n, n) = L U with row exchanges, in place, and apply the row operations to b
 * (n, count). Returns the sign of the determinant, 0 if A is singular. */
int dense_eliminate(double *A, int n, double *b, int count);

/* Compute b = A^-1 b (n, count) in place. A (n, n) is overwritten. Returns 1 if it is singular. */
int dense_solve_square(double *A, int n, double *b, int count);

#endif
