/* What the parts of the core share among themselves. */
#ifndef MBS_INTERNAL_H
#define MBS_INTERNAL_H

#include "core.h"

#define RUNNING (EVENT | CONTINUOUS | STEP)
#define READABLE (INITIALIZATION | RUNNING | INTERMEDIATE | TERMINATED)

/* 1 in one of these modes; otherwise a message, and 0. */
int core_allowed(core *c, int modes, const char *action);
const char *core_mode_name(int mode);

/* Times closer than this part of them, or of 1 s, are one: hosts add up steps, whose rounding grows
 * with their number, some 1e-16 each. */
#define SAME_TIME 1e-9

/* Refuses to arrive at a time past the stop time that the host has given. Times that an integrator
 * outside only tries may lie there: CVODE, for one, steps over the end and interpolates back. */
core_status core_before_stop(core *c, double time);

/* A message, and the status of an evaluation that has no answer. */
core_status core_check_rules(core *c);
core_status core_no_answer(core *c, const char *format, ...);

/* Refuses derivatives near a singular configuration; sine: the distance from it. */
core_status core_not_differentiable(core *c, double sine);

/* The states in words. */
const char *core_where(core *c);

/* Make derivatives, outputs and dependents belong to time, states, inputs and parameters. */
core_status core_refresh(core *c);

/* The arguments t, x, z, u, p that the generated functions begin with. */
void core_point(core *c, const double *t, const double *x, const double *z);

/* Derivatives and outputs; y may be NULL. 0, or anything else where they have no answer. */
int core_call_rhs(core *c, double t, const double *x, const double *z, double *xdot, double *y);

/* Inputs at a time, and how fast they change there. */
const double *core_inputs(core *c, double t);
void core_input_rates(core *c, double t, double *du);

/* A communication step begins, and ends: its inputs have followed their derivatives. */
void core_begin_inputs(core *c);
void core_end_inputs(core *c);

/* The solver of co-simulation: once for an instance, and before it is used. */
int core_init_solver(core *c); /* 1: no memory is left */
void core_prepare_solver(core *c);

#if MODEL_TREE_OUTSIDE
/* Whether events are those of the tree or of the states of the joints. */
void core_take_states(core *c, int tree);
#endif

#ifdef MODEL_TREE
/* The tree: its first state, also where the loops are in a singular configuration, z beside it; the states and dependents of the model from it; derivatives and
 * outputs there. */
core_status core_start_tree(core *c);
int core_starts_singular(core *c, const double *z);
core_status core_start_singular(core *c, double *z);
void core_show_tree(core *c);
void core_show_slope(const double *slope, double *y); /* its accelerations among the outputs */
int core_call_tree(core *c, const double *X, double *Xdot, double *y);
#endif

/* Events: once for an instance; the modes at the start; the first look. */
void core_init_events(core *c);
core_status core_first_modes(core *c);
core_status core_start_events(core *c);

/* What indicators and slopes depend on has changed. */
void core_restart(core *c);

/* One internal step towards limit, cut at its first event, which is then pending. */
core_status core_step(core *c, double limit);
int core_pending(const core *c);

/* The jumps that the present state asks for; changed: 1 where they move the states. */
core_status core_settle(core *c, int *changed);

/* What an integrator outside sees; after its steps, what has left zero can fire. */
core_status core_show_indicators(core *c);
core_status core_arm_indicators(core *c);

/* From here on loops are closed starting at this configuration; refused where they lose rank. */
core_status core_accept_configuration(core *c, const double *x, const double *z);

/* The same, of the present states, whose dependent coordinates are not at hand. */
core_status core_accept_states(core *c);

#endif
