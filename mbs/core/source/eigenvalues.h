/* Eigenvalues of a small real matrix.
 *
 * Implemented without LAPACK, so that a C compiler is the only requirement.
 * Re-entrant: no globals and no allocation. Matrices are stored row by row.
 */
#ifndef MBS_EIGENVALUES_H
#define MBS_EIGENVALUES_H

#define EIGENVALUES_MOST 32 /* rows */

/* Compute the n eigenvalues of A (n, n), which is overwritten. Conjugate eigenvalues are adjacent.
 * Returns 1 if the iteration does not converge or an element of A is not finite.
 *
 * Method: balancing by powers of two, Householder reduction to Hessenberg form, then Francis steps
 * with two implicit shifts.
 * Source: Golub and Van Loan 2013, algorithms 7.4.2 and 7.5.1; Wilkinson and Reinsch 1971, II.11
 * and II.14, for the balancing, the exceptional shifts and the start row of a step.
 */
int eigenvalues(int n, double *A, double *real, double *imaginary);

#endif
