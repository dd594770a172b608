/* The accepted configuration of an instance, from which its loops are closed. */
#ifndef MBS_CONFIGURATION_H
#define MBS_CONFIGURATION_H

#include "machine.h"

/* Make x (NX,), z (NZ,) the accepted configuration. Error if the closure is singular. */
core_status configuration_accept(machine *m, const double *x, const double *z);

/* Compute the dependent coordinates of the present states, and accept both. */
core_status configuration_accept_states(machine *m);

/* Log why the closure has no solution. status: of closure.h. */
core_status configuration_failed(machine *m, int status);

#endif
