/* One step of the integration: the wrapped method, or Dormand and Prince's method in the chart. */
#ifndef MBS_PASSAGE_STEP_H
#define MBS_PASSAGE_STEP_H

#include "passage_data.h"

/* Method that replaces the method of the stepper. */
extern const stepper_method PASSAGE_METHOD;

/* Whether the states x and `along` at the same time are on different branches, by their velocities
 * or by their positions after a step h. a: largest acceleration in the step. */
int step_leaves_branch(const passage *g, const double *x, const double *along, double h, double a);

#endif
