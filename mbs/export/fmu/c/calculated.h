/* Calculated values of an instance: derivatives, outputs, dependents, and states that follow from
 * other states. */
#ifndef MBS_CALCULATED_H
#define MBS_CALCULATED_H

#include "solver.h"

/* Calculate all values if the time, a state, an input or a parameter has changed. Error if the
 * equations have no solution or a value is not finite. */
core_status calculate(core_solver *s);

#endif
