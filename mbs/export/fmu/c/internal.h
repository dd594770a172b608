/* Declarations that the files of the core share. */
#ifndef MBS_INTERNAL_H
#define MBS_INTERNAL_H

#include "core.h"

#define RUNNING (EVENT | CONTINUOUS | STEP)
#define READABLE (INITIALIZATION | RUNNING | INTERMEDIATE | TERMINATED)

/* Return 1 if the instance is in one of these modes, otherwise 0 after an error message. */
int core_allowed(core *c, int modes, const char *action);
const char *core_mode_name(int mode);

/* Largest difference of times that count as equal, relative to the larger of the time and 1 s.
 * Hosts sum step sizes, and each sum adds a rounding error of about 1e-16. */
#define SAME_TIME 1e-9

/* Error if an accepted time is past the stop time of the host. Trial times of an external
 * integrator may be later: CVODE, for example, steps past the end and interpolates back. */
core_status core_before_stop(core *c, double time);

/* core_check_rules: error if states or parameters violate a rule of the model. core_no_answer: log
 * a message and return the status of a failed evaluation. */
core_status core_check_rules(core *c);
core_status core_no_answer(core *c, const char *format, ...);

/* Error that derivatives do not exist near a singular configuration. sine: distance from it. */
core_status core_not_differentiable(core *c, double sine);

/* Return names and values of the states as text. */
const char *core_where(core *c);

/* Recompute derivatives, outputs and dependents if time, states, inputs or parameters changed. */
core_status core_refresh(core *c);

/* Set the arguments t, x, z, u, p, with which all generated functions begin. */
void core_point(core *c, const double *t, const double *x, const double *z);

/* Compute derivatives xdot and outputs y (or NULL). Nonzero if the equations have no solution. */
int core_call_rhs(core *c, double t, const double *x, const double *z, double *xdot, double *y);

/* Inputs at time t, and their time derivatives. */
const double *core_inputs(core *c, double t);
void core_input_rates(core *c, double t, double *du);

/* Begin and end a communication step: extrapolated inputs are stored at its end. */
void core_begin_inputs(core *c);
void core_end_inputs(core *c);

/* Solver of co-simulation: initialise once per instance; set its options before each use. */
int core_init_solver(core *c); /* 1 if no memory is left */
void core_prepare_solver(core *c);

#if MODEL_TREE_OUTSIDE
/* Evaluate events on the state of the tree (tree = 1) or on the joint states (tree = 0). */
void core_take_states(core *c, int tree);
#endif

#ifdef MODEL_TREE
/* State of the tree: all joints and component states. The functions compute its first value, test
 * for and set up a start in a singular configuration (z: dependents close to it), copy it to the
 * states and dependents of the model, and evaluate its derivatives Xdot and outputs y. */
core_status core_start_tree(core *c);
int core_starts_singular(core *c, const double *z);
core_status core_start_singular(core *c, double *z);
void core_show_tree(core *c);
void core_show_slope(const double *slope, double *y); /* copy its accelerations to the outputs */
int core_call_tree(core *c, const double *X, double *Xdot, double *y);
#endif

/* Events: initialise once per instance; set the first modes; evaluate the first indicators. */
void core_init_events(core *c);
core_status core_first_modes(core *c);
core_status core_start_events(core *c);

/* Restart the solver after a change of data on which derivatives and indicators depend. */
void core_restart(core *c);

/* One internal step, at most to `limit` [s]. It ends at its first event, which is then pending. */
core_status core_step(core *c, double limit);
int core_pending(const core *c);

/* Make the jumps that the present state requires. *changed: 1 if they change the states. */
core_status core_settle(core *c, int *changed);

/* Event indicators for an external integrator. After its steps, an indicator that has left zero is
 * armed: from then on it can fire. */
core_status core_show_indicators(core *c);
core_status core_arm_indicators(core *c);

/* Make x, z the configuration from which loops are closed. Error if the closure is singular. */
core_status core_accept_configuration(core *c, const double *x, const double *z);

/* Accept the present states, after their dependent coordinates are computed. */
core_status core_accept_states(core *c);

#endif
