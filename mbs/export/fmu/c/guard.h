/* What watch.h watches, as the core sees it. */
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
