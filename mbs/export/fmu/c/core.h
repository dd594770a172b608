/* A model that runs: instance, modes, closed loops, integration, derivatives, saved states.
 *
 * Nothing here depends on a version of FMI; fmi2.c and fmi3.c are thin faces over it. A value
 * reference is a place in `values`, in the order of the enumeration below. All that makes one run
 * differ from another is in `core_memory`, a flat block, so a saved state is a copy of it. An
 * instance is a `core` of the caller; what it needs beside it comes from a `core_supply`.
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
    SLOTS = INDICATORS + NK, /* the states where the integrator is outside and loops are closed, */
    RATES = SLOTS + NS,      /* their derivatives, */
    CHART = RATES + NS,      /* and the indicator of other coordinates: charts.h */
    N_VALUES = CHART + NC,
    TIME_REFERENCE = N_VALUES /* the independent variable, where the face has it as a variable */
};

/* The states, and their derivatives, where the integrator is outside. */
#if MODEL_TREE_OUTSIDE
enum { OUTSIDE = SLOTS, OUTSIDE_RATES = RATES };
#else
enum { OUTSIDE = STATES, OUTSIDE_RATES = DERIVATIVES };
#endif

/* What co-simulation integrates: all coordinates of the tree where they are known, else the states. */
#ifdef MODEL_TREE
#define NT MODEL_TREE
/* They are what moves. */
#define ON_TREE(c) ((c)->m.cosimulation ? MODEL_TREE_INSIDE : MODEL_TREE_OUTSIDE)
#else
#define NT NX
#define ON_TREE(c) 0
#endif
#define MOST(a, b) ((a) > (b) ? (a) : (b))

#define CORE_TEXT 1024
#define CORE_WHERE 512

#define INPUT_ORDERS 3 /* derivatives of an input that a communication step may follow */

/* Value references and integers as the version of FMI has them; 3.0 alone has adjoint derivatives. */
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
    INTERMEDIATE = 64 /* within a communication step, where the host may look */
} core_mode;

/* Inputs are held; follow their derivatives; have followed them up to the present time. */
typedef enum { INPUTS_HELD, INPUTS_MOVE, INPUTS_MOVED } core_input_motion;

typedef void (*core_logger)(void *host, const char *name, core_status status, const char *message);
/* Told after every internal step; 1: return at *until, or now where that has passed. */
typedef int (*core_watch)(void *host, double time, int may_return, double *until);

/* Where the memory of saved states comes from: aligned for doubles; NULL: none is left. */
typedef struct {
    void *(*take)(void *owner, size_t size);
    void (*drop)(void *owner, void *memory);
    void *owner;
} core_supply;

typedef struct {
    int event, early; /* an event waits to be handled; the step ended before its end */
} core_stop;

#if MODEL_TREE_OUTSIDE
/* Which coordinates the states are read in: charts.h. */
typedef struct {
    int tangent;   /* local tangent coordinates */
    int loose;     /* joints were set: they are to be the states again */
    int settled;   /* the coordinates of the next steps are chosen */
    double alignment; /* of the tangents with those of the chart: 1 there, 0 across */
    double time, X[NT], slope[NT]; /* of the last states that were on the motion */
} core_charts;
#endif

typedef struct {
    int mode, cosimulation;
    int stale;   /* the calculated values do not belong to the others any more */
    int closed;  /* a configuration that closes the loops is known */
    int inputs;  /* a core_input_motion */
    double time, tolerance, stop; /* stop: the end of the experiment, HUGE_VAL where none is given */
    double values[N_VALUES + 1];
    double guess[NZ + 1];
    double configuration_x[NX + 1], configuration_z[NZ + 1]; /* the last accepted configuration: warm start */
    double input_time;                  /* to which the inputs and their derivatives belong */
    double slopes[INPUT_ORDERS * NU + 1]; /* first derivatives of all inputs, then second ones */
    watched watched;
#if NK > 0
    double offset[NK]; /* added to an indicator that has not left zero yet: hysteresis */
    double events[EVENTS_MEMORY(NK)];
#endif
#ifdef MODEL_TREE
    int loose; /* the tree is to be projected onto its rows first */
    double tree[NT], passage[PASSAGE_MEMORY(NT)];
    double slope[NT]; /* of it, where it starts or the integrator is outside */
    double speeds[N_PASSIVE + 1]; /* of dependent joints: where they are not MODEL_START, they choose
                                     the branch of a start in a singular configuration */
    int singular; /* it is in such a start */
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
    char text[CORE_TEXT], where[CORE_WHERE]; /* of the last message */
    int discards; /* messages of discarded calls are asked for; those of errors always are */
    int timed;    /* TIME_REFERENCE is a value reference */
    int event_mode, early_return; /* the host of a co-simulation handles events; takes part steps */
    core_watch watch;             /* or NULL */
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

/* 1: no memory is left. The name stays that of the caller. */
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

/* derivatives of unknowns by knowns, along a direction or against it */
core_status core_directional(core *c, const core_reference *unknown, size_t n_unknown,
                             const core_reference *known, size_t n_known, const double *seed,
                             double *answer);
#ifdef MODEL_ADJOINT
core_status core_adjoint(core *c, const core_reference *unknown, size_t n_unknown,
                         const core_reference *known, size_t n_known, const double *seed,
                         double *answer);
#endif

/* events; changed: 1 where the states have jumped */
core_status core_enter_event_mode(core *c);
core_status core_update_discrete_states(core *c, int *changed);

/* model exchange */
core_status core_enter_continuous_mode(core *c);
core_status core_completed_step(core *c, int *event); /* 1: event mode is to follow */
core_status core_set_time(core *c, double time);
core_status core_set_states(core *c, const double *x, size_t n);
core_status core_get_states(core *c, double *x, size_t n);
core_status core_get_derivatives(core *c, double *xdot, size_t n);
core_status core_get_nominals(core *c, double *nominal, size_t n);
core_status core_get_indicators(core *c, double *indicators, size_t n);

/* co-simulation; derivatives of inputs are taken at the start of the next step, those of outputs
 * are along the motion */
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
