/* Dormand and Prince's explicit Runge-Kutta pair of order 5(4), with dense output of order 4.
 *
 * Source: Dormand and Prince 1980; Hairer, Norsett and Wanner 1993, II.4 to II.6.
 */
#ifndef MBS_DOPRI5_H
#define MBS_DOPRI5_H

#include "stepper.h"

#define DOPRI5_WORK(n) (13 * (n))

/* Without a projection the last call of the right-hand side that stepper_step makes is at the new
 * state. */
void dopri5_init(stepper *s, int n, stepper_rhs rhs, void *user, double *memory, double *work);

#endif
