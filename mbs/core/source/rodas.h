/* RODAS5P: a linearly implicit (Rosenbrock) method of order 5(4) for stiff equations.
 *
 * Stiffly accurate and L-stable, so that fast decays cost no steps. Each step takes one Jacobian,
 * one factorization and eight right-hand sides; dense output is of order 4.
 *
 * Source: Steinebach 2023; Hairer and Wanner 1996, IV.7, for the form in which it is computed.
 */
#ifndef MBS_RODAS_H
#define MBS_RODAS_H

#include "stepper.h"

#define RODAS_WORK(n) (18 * (n) + 2 * (n) * (n))

void rodas_init(stepper *s, int n, stepper_rhs rhs, stepper_jacobian jacobian, void *user,
                double *memory, double *work);

#endif
