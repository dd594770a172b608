/* Linear algebra of small real matrices.
 *
 * Code of its own, because where only a C compiler is there is no LAPACK to link with.
 * Re-entrant: no globals and no allocation. Matrices are stored column by column.
 */
#ifndef MBS_DENSE_H
#define MBS_DENSE_H

#define DENSE_MOST 32 /* rows or columns */

/* A P = Q R by reflections, the longest remaining column first.
 * Source: Businger and Golub 1965; Golub and Van Loan 2013, algorithm 5.4.1. */
typedef struct {
    int rows, columns, steps;  /* steps: reflections; fewer than columns where the rank is known */
    double *A;                 /* (rows, columns), replaced by R and, below it, the reflections */
    double weight[DENSE_MOST]; /* of the reflections */
    int order[DENSE_MOST];     /* column k of R belongs to column order[k] */
} dense_qr;

void dense_factorize(dense_qr *f);

/* A reflection that leaves only the first element of v (count,): v becomes that element and, below
 * it, the tail of the vector (1, tail) that it is made of. Returns its weight. */
double dense_reflection(double *v, int count);

/* column (count,) -= weight v (v' column), where v is (1, tail); tail[0] is not read. */
void dense_reflect(const double *tail, double weight, int count, double *column);

/* B (rows, count) = Q' B. */
void dense_turn(const dense_qr *f, double *B, int count);

/* X (columns, count), in place of the first rows of B (rows, count), such that A X is as near
 * to B as it can be; pivots below `least` times the first one are taken to be of that size. */
void dense_solve(const dense_qr *f, double *B, int count, double least);

/* |last pivot / first pivot|, an estimate of the reciprocal condition. */
double dense_regularity(const dense_qr *f);

/* The last `count` columns of Q, V (rows, count): an orthonormal basis of what is orthogonal to the
 * columns of A when their rank is rows - count. */
void dense_complement(const dense_qr *f, double *V, int count);

#endif
