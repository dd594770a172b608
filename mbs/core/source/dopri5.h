/* Dormand and Prince's explicit Runge-Kutta pair of order 5(4), with dense output of order 4.
 *
 * Source: Dormand and Prince 1980; Hairer, Norsett and Wanner 1993, II.4 to II.6.
 */
#ifndef MBS_DOPRI5_H
#define MBS_DOPRI5_H

#include "stepper.h"

#define DOPRI5_WORK(n) (13 * (n))

/* Butcher tableau: nodes, stage weights, error weights, weights of the last dense-output term. */
extern const double DOPRI5_C[7], DOPRI5_A[7][6], DOPRI5_E[7], DOPRI5_D[7];

/* Evaluate the dense output (5, n), stored by rows, at the fraction a of the step. */
void dopri5_interpolate(const double *dense, int n, double a, double *row);

/* Write the cubic Hermite polynomial from x to y (n,), with the slopes first and last, in the form
 * of the dense output. h: length of the step [s]. Source: Hairer, Norsett and Wanner 1993, II.6. */
void dopri5_hermite(int n, const double *x, const double *y, double h, const double *first,
                    const double *last, double *dense);

/* Initialise a stepper with this method. work has DOPRI5_WORK(n) elements. Without projection, the
 * last evaluation of the right-hand side in stepper_step is at the new state. */
void dopri5_init(stepper *s, int n, stepper_rhs rhs, void *user, double *memory, double *work);

#endif
