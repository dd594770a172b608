/* Cholesky factorization of symmetric matrices in skyline storage, and solutions with the factor.
 *
 * Column k of L has elements before row end[k], because each joint of a tree is coupled by inertia
 * to its ancestors and descendants only. Re-entrant: no globals and no allocation. Matrices (n, n)
 * are stored column by column.
 *
 * Source: Golub and Van Loan 2013, section 4.2.
 */
#ifndef MBS_SKYLINE_H
#define MBS_SKYLINE_H

#include "sparse_pattern.h"

/* Factorize M (n, n) = L L' in place. end: row after the last element of each column, on input of
 * M, on return of L. Returns 1 if M is singular within MASSLESS_PIVOT. */
int skyline_cholesky(double *M, int *end, int n);

/* Solve L y = b in place. */
void skyline_solve(const double *L, const int *end, int n, double *b);

/* Solve L y = b in place for a sparse b. set: rows of its elements; rows that fill in are added. */
void skyline_solve_sparse(const double *L, const int *end, int n, row_set *set, double *b);

/* Solve L' y = b in place. */
void skyline_solve_transposed(const double *L, const int *end, int n, double *b);

#endif
