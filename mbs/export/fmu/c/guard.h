/* No leap without notice: what is watched between two accepted configurations.
 *
 * Where the independent joints lose their hold on the dependent ones, branches of motion meet, and a
 * step may end on another one: every row of the closure holds there, energy does not. Two things
 * tell it. The determinant of a diagonal block of the slopes of the closure changes its sign: the
 * step has passed a singular configuration. Or velocities of dependent joints change by other than
 * what their accelerations at both ends make of the step: the motion has a kink.
 */
#ifndef MBS_GUARD_H
#define MBS_GUARD_H

#include "core.h"

/* What the next configuration is compared with is this one: after a start, a jump, or where
 * something that the accelerations depend on has changed. */
core_status guard_restart(core *c);

/* Compare the present configuration with the one before, and watch from here. */
core_status guard_pass(core *c);

/* The next comparison is to begin with the configuration before it, as it is then. */
void guard_forget(core *c);

#endif
