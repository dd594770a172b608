/* The classical Runge-Kutta method of order 4 with a fixed step, for real time.
 *
 * Every step costs four right-hand sides. There is no error control: a step is shortened only
 * where the right-hand side has no answer, and cut where it would pass the end.
 *
 * Source: Kutta 1901; Hairer, Norsett and Wanner 1993, II.1.
 */
#ifndef MBS_RK4_H
#define MBS_RK4_H

#include "stepper.h"

#define RK4_WORK(n) (8 * (n))

/* Call stepper_fix after it: that sets the length of all steps. */
void rk4_init(stepper *s, int n, stepper_rhs rhs, void *user, double *memory, double *work);

#endif
