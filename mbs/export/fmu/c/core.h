/* A model that runs: instance, modes, closed loops, integration, derivatives, saved states.
 *
 * The core is independent of the FMI version; fmi2.c and fmi3.c are thin interfaces to it. A value
 * reference is an index of `values`, in the order of the enumeration below. `core_memory` is a flat
 * block with all data that a run changes, so a saved state is a copy of it. The caller allocates
 * the instance `core`. Memory for saved states comes from a `core_supply`.
 */
#ifndef MBS_CORE_H
#define MBS_CORE_H

#include <stddef.h>
#include <stdint.h>

#include "closure.h"
#include "model.h"
#include "solver.h"
#include "watch.h"

#if NK > 0
#include "events.h"
#endif

enum {
    STATES = 0,
    DERIVATIVES = STATES + NX,
    INPUTS = DERIVATIVES + NX,
    OUTPUTS = INPUTS + NU,
    PARAMETERS = OUTPUTS + NY,
    MODES = PARAMETERS + NP,
    DEPENDENTS = MODES + NM,
    INDICATORS = DEPENDENTS + NZ,
    SLOTS = INDICATORS + NK, /* states of closed loops for an external integrator (charts.h) */
    RATES = SLOTS + NS,      /* derivatives of these states */
    CHART = RATES + NS,      /* indicator of a change of their coordinates */
    CUTS = CHART + NC,       /* positions of cut joints */
    N_VALUES = CUTS + NCUT,
    TIME_REFERENCE = N_VALUES /* the independent variable time, a variable in FMI 3.0 only */
};

/* First indices of the states and their derivatives for an external integrator. */
#if MODEL_TREE_OUTSIDE
enum { OUTSIDE = SLOTS, OUTSIDE_RATES = RATES };
#else
enum { OUTSIDE = STATES, OUTSIDE_RATES = DERIVATIVES };
#endif

/* Number of integrated coordinates: those of all joints of the tree if the model has closed loops
 * with tree equations, else the states. */
#ifdef MODEL_TREE
#define NT MODEL_TREE
/* Whether the instance moves the coordinates of the tree. */
#define ON_TREE(c) ((c)->m.cosimulation ? MODEL_TREE_INSIDE : MODEL_TREE_OUTSIDE)
#else
#define NT NX
#define ON_TREE(c) 0
#endif
#define MOST(a, b) ((a) > (b) ? (a) : (b))

#define CORE_TEXT 1024
#define CORE_WHERE 512

#define INPUT_ORDERS 3 /* highest derivative of an input that extrapolates it in a step */

/* Types of value references and integers: FMI 3.0 if adjoint derivatives exist, else FMI 2.0. */
#ifdef MODEL_ADJOINT
typedef uint32_t core_reference;
typedef int32_t core_integer;
#else
typedef unsigned core_reference;
typedef int core_integer;
#endif

typedef enum { CORE_OK, CORE_DISCARD, CORE_ERROR } core_status;

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    TERMINATED = 32,
    INTERMEDIATE = 64 /* intermediate update within a communication step: values can be read */
} core_mode;

/* Inputs: constant; extrapolated by their derivatives; extrapolated up to the present time. */
typedef enum { INPUTS_HELD, INPUTS_MOVE, INPUTS_MOVED } core_input_motion;

typedef void (*core_logger)(void *host, const char *name, core_status status, const char *message);
/* Callback after every internal step. A result of 1 requests that the communication step ends at
 * *until, or at once if that time has passed. */
typedef int (*core_watch)(void *host, double time, int may_return, double *until);

/* Allocator of saved states: memory aligned for doubles, NULL if no memory is left. */
typedef struct {
    void *(*take)(void *owner, size_t size);
    void (*drop)(void *owner, void *memory);
    void *owner;
} core_supply;

typedef struct {
    int event, early; /* whether an event is pending; whether the step ended before its end */
} core_stop;

#if MODEL_TREE_OUTSIDE
/* Coordinates that the states stand for, see charts.h. */
typedef struct {
    int tangent;   /* 1 if the states are local tangent coordinates */
    int loose;     /* 1 if joint values were set, so that the joints become the states again */
    int settled;   /* 1 if the coordinates of the next steps are chosen */
    double alignment; /* alignment of the tangents with the chart: 1 at its origin, 0 orthogonal */
    double time, X[NT], slope[NT]; /* last accepted time, tree state and its derivative */
} core_charts;
#endif

typedef struct {
    int mode, cosimulation;
    int stale;   /* 1 if the calculated values are out of date */
    int closed;  /* 1 if a configuration that closes the loops is known */
    int inputs;  /* core_input_motion */
    double time, tolerance, stop; /* stop: end of the experiment [s], HUGE_VAL if it has none */
    double values[N_VALUES + 1];
    double guess[NZ + 1];
    double cut[NCUT + 1]; /* guess of the positions of cut joints */
    /* last accepted configuration: warm start of the Newton steps */
    double configuration_x[NX + 1], configuration_z[NZ + 1];
    double input_time;                  /* time of `slopes` and the values of inputs [s] */
    double slopes[INPUT_ORDERS * NU + 1]; /* first, second, third derivatives of all inputs */
    watched watched;
#if NK > 0
    double offset[NK]; /* hysteresis: added to an indicator that has not left zero yet */
    double events[EVENTS_MEMORY(NK)];
#endif
#ifdef MODEL_TREE
    int loose; /* 1 if the tree state must be projected onto its rows before the next step */
    double tree[NT];
    passage_memory passage;
    double origin[NT]; /* origin of the chart of the passage */
    double slope[NT]; /* derivative of `tree`, at the start or for an external integrator */
    double speeds[N_PASSIVE + 1]; /* start velocities of dependent joints: values other than
                                     MODEL_START select the branch of a singular start */
    int singular; /* 1 while the run is at a start in a singular configuration */
#endif
#if MODEL_TREE_OUTSIDE
    core_charts charts;
#endif
    double solver[STEPPER_MEMORY(MOST(NX, NT))];
} core_memory;

typedef struct {
    core_memory m;
    const char *name;
    core_logger log;
    void *host;
    core_supply supply;
    char text[CORE_TEXT], where[CORE_WHERE]; /* last message, and its list of state values */
    int discards; /* 1 to log discarded calls too; errors are always logged */
    int timed;    /* 1 if TIME_REFERENCE is a value reference */
    int event_mode, early_return; /* whether the host handles events, and accepts early returns */
    core_watch watch;             /* callback after internal steps, or NULL */
    stepper solver;
#if NK > 0
    events events;
    double event_work[EVENTS_WORK(MOST(NX, NT), NK) + 1];
#endif
#ifdef MODEL_TREE
    passage *passage;
    double work[MOST(SOLVER_WORK(MOST(NX, NT)), DOPRI5_WORK(NT)) + 1];
#else
    double work[SOLVER_WORK(NX) + 1];
#endif
    double z[NZ + 1], u[NU + 1];
    const double *arg[SZ_ARG + 1];
    double *res[SZ_RES + 1];
    long long iw[SZ_IW + 1];
    double w[SZ_W + 1];
    loops loops; /* points into this instance */
} core;

typedef struct core_state core_state;

/* Initialise an instance. Returns 1 if no memory is left. The caller keeps `name` alive. */
int core_init(core *c, const char *name, int cosimulation, core_logger log, void *host,
              core_supply supply);
void core_end(core *c);
core_status core_set_logging(core *c, int on, const char *const *categories, size_t n);
const char *core_category(core_status status);
core_status core_refuse(core *c, const char *format, ...);

core_status core_setup(core *c, double tolerance, double start, double stop);
core_status core_enter_initialization(core *c);
core_status core_exit_initialization(core *c);
core_status core_terminate(core *c);
core_status core_reset(core *c);

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

/* Events. *changed: 1 if the states have jumped. */
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
core_status core_set_input_slopes(core *c, const core_reference *ref, size_t n, const core_integer *order,
                                  const double *values);
core_status core_get_output_slopes(core *c, const core_reference *ref, size_t n, const core_integer *order,
                                   double *values);

core_status core_save(core *c, core_state **state);
core_status core_restore(core *c, const core_state *state);
void core_free_state(core *c, core_state *state);
size_t core_state_size(void);
core_status core_serialize(core *c, const core_state *state, char *bytes, size_t size);
core_status core_deserialize(core *c, const char *bytes, size_t size, core_state **state);

#endif
