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

/* The arguments t, x, z, u, p that the generated functions begin with. */
void core_point(core *c, const double *t, const double *x, const double *z);

/* Derivatives and outputs; y may be NULL. 0, or anything else where they have no answer. */
int core_call_rhs(core *c, double t, const double *x, const double *z, double *xdot, double *y);

/* The solver of co-simulation: once for an instance, and at the start of each run. */
void core_init_solver(core *c);
void core_start_solver(core *c);

/* From here on loops are closed starting at this posture; refused where they lose rank. */
core_status core_accept_posture(core *c, const double *x, const double *z);

#endif
