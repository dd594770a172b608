/* What the parts of the core share among themselves. */
#ifndef MBS_INTERNAL_H
#define MBS_INTERNAL_H

#include "core.h"

#define RUNNING (EVENT | CONTINUOUS | STEP)

/* 1 in one of these modes; otherwise a message, and 0. */
int core_allowed(core *c, int modes, const char *action);
const char *core_mode_name(int mode);

/* A message, and the status of an evaluation that has no answer. */
core_status core_no_answer(core *c, const char *format, ...);

/* Make derivatives, outputs and dependents belong to time, states, inputs and parameters. */
core_status core_refresh(core *c);

/* From here on loops are closed starting at this posture; refused where they lose rank. */
core_status core_accept_posture(core *c, const double *x, const double *z);

#endif
