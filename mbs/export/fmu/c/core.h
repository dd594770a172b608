/* A model that runs: instance, modes, closed loops, integration, derivatives, saved states.
 *
 * Nothing here depends on a version of FMI; fmi2.c and fmi3.c are thin faces over it. A value
 * reference is a place in `values`, in the order of the enumeration below. All that makes one run
 * differ from another is in `core_memory`, a flat block, so a saved state is a copy of it.
 */
#ifndef MBS_CORE_H
#define MBS_CORE_H

#include <stddef.h>

#include "model.h"
#include "solver.h"

enum {
    STATES = 0,
    DERIVATIVES = STATES + NX,
    INPUTS = DERIVATIVES + NX,
    OUTPUTS = INPUTS + NU,
    PARAMETERS = OUTPUTS + NY,
    DEPENDENTS = PARAMETERS + NP,
    N_VALUES = DEPENDENTS + NZ
};

typedef enum { CORE_OK, CORE_DISCARD, CORE_ERROR } core_status;

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    TERMINATED = 32
} core_mode;

typedef void (*core_logger)(void *host, const char *name, core_status status, const char *message);

typedef struct {
    int mode, cosimulation;
    int stale;   /* the calculated values do not belong to the others any more */
    int closed;  /* a posture that closes the loops is known */
    int guessed; /* the host gave guesses of the dependent coordinates, other than the start */
    double time, tolerance;
    double values[N_VALUES + 1];
    double guess[NZ + 1];
    double posture_x[NX + 1], posture_z[NZ + 1]; /* the last accepted posture: warm start */
    double solver[STEPPER_MEMORY(NX)];
} core_memory;

typedef struct {
    core_memory m;
    char *name;
    core_logger log;
    void *host;
    int discards; /* messages of discarded calls are wanted; those of errors always are */
    stepper solver;
    double work[SOLVER_WORK(NX) + 1], z[NZ + 1];
    const double **arg;
    double **res;
    long long *iw;
    double *w;
} core;

typedef struct core_state core_state;

core *core_new(const char *name, int cosimulation, core_logger log, void *host);
void core_free(core *c);
core_status core_set_logging(core *c, int on, const char *const *categories, size_t n);
const char *core_category(core_status status);
core_status core_refuse(core *c, const char *format, ...);

core_status core_setup(core *c, double tolerance, double start);
core_status core_enter_initialization(core *c);
core_status core_exit_initialization(core *c);
core_status core_terminate(core *c);
core_status core_reset(core *c);

core_status core_get(core *c, const unsigned *ref, size_t n, double *values);
core_status core_set(core *c, const unsigned *ref, size_t n, const double *values);

/* derivatives of unknowns by knowns, along a direction or against it */
core_status core_directional(core *c, const unsigned *unknown, size_t n_unknown,
                             const unsigned *known, size_t n_known, const double *seed,
                             double *answer);
core_status core_adjoint(core *c, const unsigned *unknown, size_t n_unknown,
                         const unsigned *known, size_t n_known, const double *seed,
                         double *answer);

/* model exchange */
core_status core_enter_event_mode(core *c);
core_status core_update_discrete_states(core *c);
core_status core_enter_continuous_mode(core *c);
core_status core_completed_step(core *c);
core_status core_set_time(core *c, double time);
core_status core_set_states(core *c, const double *x, size_t n);
core_status core_get_states(core *c, double *x, size_t n);
core_status core_get_derivatives(core *c, double *xdot, size_t n);
core_status core_get_nominals(core *c, double *nominal, size_t n);

/* co-simulation */
core_status core_do_step(core *c, double time, double h);

core_status core_save(core *c, core_state **state);
core_status core_restore(core *c, const core_state *state);
void core_free_state(core_state *state);
size_t core_state_size(void);
core_status core_serialize(core *c, const core_state *state, char *bytes, size_t size);
core_status core_deserialize(core *c, const char *bytes, size_t size, core_state **state);

#endif
