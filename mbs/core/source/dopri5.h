/* Dormand and Prince's explicit Runge-Kutta pair of order 5(4), with dense output of order 4.
 *
 * Source: Dormand and Prince 1980; Hairer, Norsett and Wanner 1993, II.4 to II.6.
 */
#ifndef MBS_DOPRI5_H
#define MBS_DOPRI5_H

#include "stepper.h"

#define DOPRI5_WORK(n) (13 * (n))

/* The tableau: nodes, stages, weights of the error, and of the last term of the dense output. */
extern const double DOPRI5_C[7], DOPRI5_A[7][6], DOPRI5_E[7], DOPRI5_D[7];

/* The state at a part a of a step; dense (5, n), row by row. */
void dopri5_interpolate(const double *dense, int n, double a, double *row);

/* Without a projection the last call of the right-hand side that stepper_step makes is at the new
 * state. */
void dopri5_init(stepper *s, int n, stepper_rhs rhs, void *user, double *memory, double *work);

#endif
