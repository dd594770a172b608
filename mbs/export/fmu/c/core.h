/* An instance of a model, and the functions of both FMI versions on it.
 *
 * The core is independent of the FMI version; fmi2.c and fmi3.c are thin interfaces to it. The
 * parts of an instance, each with its own header, from the lowest to the highest. A part refers to
 * the parts before it, and includes their headers only.
 *
 *   run.h        state of the state machine, time
 *   log.h        messages
 *   inputs.h     inputs within a communication step
 *   machine.h    variables, accepted configuration, equations (closure.h, watch.h, guard.h)
 *   solver.h     integrator and its coordinates (tree_state.h, charts.h, calculated.h)
 *   event_data.h events (internal_step.h, event_mode.h, chart_choice.h)
 *   core.h       the instance
 *
 * `core_memory` is a flat block with all data that a run changes, so a saved state is a copy of it.
 * The caller allocates the instance `core`. Memory for saved states comes from a `core_supply`.
 *
 * All functions return a status and log the reason of an error.
 */
#ifndef MBS_CORE_H
#define MBS_CORE_H

#include <stddef.h>

#include "event_data.h"
#include "inputs.h"
#include "log.h"
#include "machine.h"
#include "references.h"
#include "run.h"
#include "solver.h"

/* Callback after every internal step. A result of 1 requests that the communication step ends at
 * *until, or at once if that time has passed. */
typedef int (*core_watch)(void *host, double time, int may_return, double *until);

/* Allocator of saved states: memory aligned for doubles, NULL if no memory is left. */
typedef struct {
    void *(*take)(void *owner, size_t size);
    void (*drop)(void *owner, void *memory);
    void *owner;
} core_supply;

/* What the importer provides and supports. */
typedef struct {
    core_supply supply;
    int timed;        /* 1 if TIME_REFERENCE is a value reference */
    int event_mode;   /* 1 if it handles the events of co-simulation in event mode */
    int early_return; /* 1 if it accepts that a communication step ends early */
    core_watch watch; /* callback after internal steps, or NULL */
} core_host;

/* All data that a run changes. */
typedef struct {
    core_run run;
    core_variables variables;
    core_inputs inputs;
    core_configuration configuration;
    core_solver_memory solver;
#if NK > 0
    core_event_memory events;
#endif
} core_memory;

typedef struct {
    core_memory m;
    core_log log;
    machine machine;
    core_solver solver;
    core_events events;
    core_host host;
} core;

/* Result of a communication step. */
typedef struct {
    int event, early; /* whether an event is pending; whether the step ended before its end */
} core_stop;

typedef struct core_state core_state;

/* Initialise an instance. Returns 1 if no memory is left. The caller keeps `name` alive. The
 * options in `c->host` and `c->log.discards` may be set afterwards. */
int core_init(core *c, const char *name, int cosimulation, core_logger log, void *host,
              core_supply supply);
void core_end(core *c);

/* Set the relative tolerance, and the times of the experiment [s]. stop: HUGE_VAL for none. */
core_status core_setup(core *c, double tolerance, double start, double stop);
core_status core_enter_initialization(core *c);
core_status core_exit_initialization(core *c);
core_status core_terminate(core *c);
core_status core_reset(core *c);

/* Get or set variables by value reference. Modes are integers, all other variables are real. */
core_status core_get(core *c, const core_reference *ref, size_t n, double *values);
core_status core_get_modes(core *c, const core_reference *ref, size_t n, core_integer *values);
core_status core_set(core *c, const core_reference *ref, size_t n, const double *values);

/* Derivatives of unknowns by knowns: Jacobian times seed, and transposed Jacobian times seed. */
core_status core_directional(core *c, const core_reference *unknown, size_t n_unknown,
                             const core_reference *known, size_t n_known, const double *seed,
                             double *answer);
#ifdef MODEL_ADJOINT
core_status core_adjoint(core *c, const core_reference *unknown, size_t n_unknown,
                         const core_reference *known, size_t n_known, const double *seed,
                         double *answer);
#endif

/* Event mode. *changed: 1 if the values of the continuous states have changed. */
core_status core_enter_event_mode(core *c);
core_status core_update_discrete_states(core *c, int *changed);

/* Model exchange. */
core_status core_enter_continuous_mode(core *c);
core_status core_completed_step(core *c, int *event); /* *event: 1 if event mode must follow */
core_status core_set_time(core *c, double time);
core_status core_set_states(core *c, const double *x, size_t n);
core_status core_get_states(core *c, double *x, size_t n);
core_status core_get_derivatives(core *c, double *xdot, size_t n);
core_status core_get_nominals(core *c, double *nominal, size_t n);
core_status core_get_indicators(core *c, double *indicators, size_t n);

/* Co-simulation. Derivatives of inputs refer to the start of the next step. Derivatives of outputs
 * are time derivatives along the motion. */
core_status core_do_step(core *c, double time, double h, core_stop *stop);
core_status core_enter_step_mode(core *c);
core_status core_set_input_slopes(core *c, const core_reference *ref, size_t n,
                                  const core_integer *order, const double *values);
core_status core_get_output_slopes(core *c, const core_reference *ref, size_t n,
                                   const core_integer *order, double *values);

/* Saved states. *state: an earlier state to overwrite, or NULL for a new one. */
core_status core_save(core *c, core_state **state);
core_status core_restore(core *c, const core_state *state);
void core_free_state(core *c, core_state *state);
size_t core_state_size(void);
core_status core_serialize(core *c, const core_state *state, char *bytes, size_t size);
core_status core_deserialize(core *c, const char *bytes, size_t size, core_state **state);

/* Error if an accepted time is past the stop time of the importer. Trial times of an external
 * integrator may be later: CVODE, for example, steps past the end and interpolates back. */
core_status core_check_stop(core *c, double time);

#endif
