/* Inputs within a communication step: Taylor polynomials in time about its start.
 *
 * `given` (NU,) are the values that the importer has set. They hold at the time of the derivatives.
 */
#ifndef MBS_INPUTS_H
#define MBS_INPUTS_H

#include "references.h"

#define INPUT_ORDERS 3 /* highest derivative of an input that extrapolates it in a step */

/* Inputs: constant; extrapolated by their derivatives; extrapolated up to the present time. */
typedef enum { INPUTS_HELD, INPUTS_MOVE, INPUTS_MOVED } core_input_motion;

typedef struct {
    int motion;                           /* a core_input_motion */
    double time;                          /* time of the derivatives and of the given values [s] */
    double slopes[INPUT_ORDERS * NU + 1]; /* first, second, third derivatives of all inputs */
} core_inputs;

/* Return the inputs (NU,) at time t [s], in `given` or in the scratch array u (NU,). */
const double *inputs_at(const core_inputs *in, const double *given, double t, double *u);

/* Compute the time derivatives du (NU,) of the inputs at time t [s]. */
void inputs_rates(const core_inputs *in, const double *given, double t, double *du);

/* Make all inputs constant. */
void inputs_hold(core_inputs *in);

/* Set a derivative of an input at time t [s]. order: 1 to INPUT_ORDERS. */
void inputs_set_slope(core_inputs *in, int input, int order, double value, double t);

/* End a communication step at time t [s]: store the extrapolated inputs in `given`. */
void inputs_end_step(core_inputs *in, double *given, double t);

#endif
