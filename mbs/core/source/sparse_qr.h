/* Sparse QR factorization by Householder reflections.
 *
 * Each reflection acts only on the rows in which its column has elements, because each constraint
 * row of a loop depends on few joints. Re-entrant: no globals and no allocation. Matrices are
 * stored column by column.
 *
 * Source: Businger and Golub 1965 for the choice of pivots; Golub and Van Loan 2013, algorithm
 * 5.4.1.
 */
#ifndef MBS_SPARSE_QR_H
#define MBS_SPARSE_QR_H

#include "sparse_pattern.h"

/* Number of columns above which they are factorized in their order, without column pivoting. With
 * pivoting, the reflections of a chain of loops merge and fill in: with 40 loops a reflection then
 * acts on 14 joints on average. The smallest pivot in order is about twice the smallest pivot with
 * pivoting, which is a worse estimate of the smallest singular value. For fewer columns the order
 * saves nothing, and near misses of single linkages need the better estimate. */
#define MANY_ROWS 32

/* Factors A (n, m) P = Q R. */
typedef struct {
    double *A;            /* A, replaced by R */
    double *weight;       /* weights of the reflections */
    double *tails;        /* vector of reflection k, from index k n on */
    int *reflected;       /* rows of reflection k, from index k n on, pivot_row[k] first */
    int *reflected_count; /* number of rows of reflection k */
    int *pivot_column;    /* column k of R is stored in column pivot_column[k] of A */
    int *pivot_row;       /* row k of R is stored in row pivot_row[k] of A; rows without reflection
                           are last */
    double *length2;     /* squared lengths of the remaining columns, by position in pivot_column */
    row_set *nonzero;    /* rows in which each remaining column may have elements */
    int *last_column;    /* last position in pivot_column at which a row may have an element */
    row_set *filled;     /* rows in which each column of A may have had elements */
    int *upper;          /* rows of the elements above the diagonal of R, by columns of A */
    int *upper_count;    /* number of these elements in each column */
    int height, columns; /* size of A when it was last filled. Elements outside `filled` are zero,
                            unless height is 0. */
} sparse_qr;

/* Set A (n, m) to zero, before it is filled by sparse_qr_put. */
void sparse_qr_begin(sparse_qr *f, int n, int m);

/* Set element (i, j) of A (n, m). */
static inline void sparse_qr_put(sparse_qr *f, int n, int i, int j, double value) {
    f->A[j * n + i] = value;
    f->filled[j * ROW_WORDS(n) + (unsigned)i / ROW_BITS] |= row_bit(i);
}

/* Find the nonzero elements of A (n, m) if it was not filled by sparse_qr_put. */
void sparse_qr_scan(sparse_qr *f, int n, int m);

/* Factorize A (n, m) up to `rank`, or until the remaining columns are shorter than `least` times
 * the first pivot. Returns the rank. The pivot is the longest remaining column; more than MANY_ROWS
 * columns that are all required are factorized in order. */
int sparse_qr_factorize(sparse_qr *f, int n, int m, int rank, double least);

/* Return the absolute value of pivot k, the diagonal element k of R. */
double sparse_qr_pivot(const sparse_qr *f, int n, int k);

/* Solve R' y = b for y = Q' x, so that A' x = b for the first `rank` columns in order of pivots. */
void sparse_qr_solve_transposed(const sparse_qr *f, int n, int rank, const double *b, double *y);

/* Apply reflection k to b (n,) in place. The product of the reflections 0, 1, .. is Q'. */
void sparse_qr_reflect(const sparse_qr *f, int n, int k, double *b);

/* Compute y = Q y in place, with the first `rank` reflections. */
void sparse_qr_multiply(const sparse_qr *f, int n, int rank, double *y);

/* Compute a basis Z (d, n) of the null space of A', where A has n - d columns, from Q. S (d, d) is
 * its product D Z' with the rows D (d, n) that border A' to a square matrix. */
void sparse_qr_border(const sparse_qr *f, int n, int d, const double *D, double *Z, double *S);

#endif
