/* The classical Runge-Kutta method of order 4 with a fixed step, for real time.
 *
 * Every step evaluates four right-hand sides. There is no error control: a step is shortened only
 * if the right-hand side fails or if the step would exceed a time limit.
 *
 * Source: Kutta 1901; Hairer, Norsett and Wanner 1993, II.1.
 */
#ifndef MBS_RK4_H
#define MBS_RK4_H

#include "stepper.h"

#define RK4_WORK(n) (8 * (n))

/* Initialise a stepper with this method. Call stepper_fix afterwards to set the step size. */
void rk4_init(stepper *s, int n, stepper_rhs rhs, void *user, double *memory, double *work);

#endif
