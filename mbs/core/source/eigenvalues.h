/* Eigenvalues of a small real matrix.
 *
 * Code of its own, because where only a C compiler is there is no LAPACK to link with.
 * Re-entrant: no globals and no allocation. Matrices are stored row by row.
 */
#ifndef MBS_EIGENVALUES_H
#define MBS_EIGENVALUES_H

#define EIGENVALUES_MOST 32 /* rows */

/* The n eigenvalues of A (n, n), which is overwritten; conjugate ones follow each other. 1: the
 * iteration did not end, or some element is not a finite number.
 *
 * Balancing by powers of two, Householder's reduction to the form of Hessenberg, then Francis's
 * steps with two implicit shifts.
 * Source: Golub and Van Loan 2013, algorithms 7.4.2 and 7.5.1; Wilkinson and Reinsch 1971, II.11
 * and II.14, for the balancing, the exceptional shifts and where a step may begin.
 */
int eigenvalues(int n, double *A, double *real, double *imaginary);

#endif
