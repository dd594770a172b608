/* Checks of watch.h for an instance: detection of singular configurations between two steps. */
#ifndef MBS_GUARD_H
#define MBS_GUARD_H

#include "machine.h"

/* Store the present configuration as the reference of the next comparison. Required after a start,
 * a jump, or a change of an input or parameter of the accelerations. */
core_status guard_restart(machine *m);

/* Compare the present configuration with the reference, then make it the reference. Error if the
 * motion between the two passes a singular configuration. */
core_status guard_pass(machine *m);

/* Discard the reference, because a jump or a new input has made it invalid. */
void guard_forget(machine *m);

#endif
