/* The machine: values of its variables, its accepted configuration and its equations.
 *
 * Functions of this header evaluate the generated functions of model.h and keep no data of an
 * integration. The pointers refer to data of the instance that owns the machine.
 */
#ifndef MBS_MACHINE_H
#define MBS_MACHINE_H

#include "closure.h"
#include "inputs.h"
#include "log.h"
#include "references.h"
#include "run.h"
#include "watch.h"

/* Values that the importer sets or reads. */
typedef struct {
    int stale;                   /* 1 if the calculated values are out of date */
    double values[N_VALUES + 1]; /* by value reference, in SI units */
    double guess[NZ + 1];        /* guesses of the dependent coordinates at the start */
    double cut[NCUT + 1];        /* guesses of the positions of cut joints at the start */
#ifdef MODEL_TREE
    double speeds[N_PASSIVE + 1]; /* start velocities of dependent joints: values other than
                                     MODEL_START select the branch of a singular start */
#endif
} core_variables;

/* Last accepted configuration: start of the Newton steps of the closure. */
typedef struct {
    int known;                   /* 1 if a configuration that closes the loops is known */
    double x[NX + 1], z[NZ + 1]; /* states, dependent coordinates */
    watched watched;             /* reference of the checks in guard.h */
} core_configuration;

typedef struct {
    core_run *run;
    core_log *log;
    core_variables *variables;
    double *values; /* variables->values */
    core_inputs *inputs;
    core_configuration *accepted;
    loops loops; /* data of the closure; refers to `accepted` and the arrays below */
    double z[NZ + 1], u[NU + 1];   /* dependent coordinates and inputs of the last evaluation */
    const double *arg[SZ_ARG + 1]; /* arguments, results and scratch of the generated functions */
    double *res[SZ_RES + 1];
    long long iw[SZ_IW + 1];
    double w[SZ_W + 1];
} machine;

/* A generated function. Returns 0, or nonzero if it has no value. */
typedef int (*machine_function)(const double **arg, double **res, long long *iw, double *w,
                                int mem);

/* Connect a machine with the data of its instance. */
void machine_init(machine *m, core_run *run, core_log *log, core_variables *variables,
                  core_inputs *inputs, core_configuration *accepted);

/* Set all values to those of the model description. */
void machine_reset(machine *m);

/* Call a generated function with the arguments in m->arg and the results in m->res. */
static inline int machine_call(machine *m, machine_function f) {
    return f(m->arg, m->res, m->iw, m->w, 0);
}

/* Set the arguments t, x, z, u, p, with which most generated functions begin. */
void machine_point(machine *m, const double *t, const double *x, const double *z);

/* Set the arguments x, z, p of the functions of closed loops. */
void machine_loop_point(machine *m, const double *x, const double *z);

/* Compute derivatives xdot (NX,) and outputs y (NY,) or NULL. Returns 0, or nonzero if the
 * equations have no solution. */
int machine_rhs(machine *m, double t, const double *x, const double *z, double *xdot, double *y);

/* Compute the time derivatives du (NU,) of the inputs at time t [s]. */
void machine_input_rates(const machine *m, double t, double *du);

/* Set the modes of the start from the states. Error if the start is beyond an event. */
core_status machine_first_modes(machine *m);

/* Error if states or parameters violate a rule of the model. Rules of the states hold from
 * initialization on. Rules of parameters alone are checked again later, because parameters may be
 * set during a run. */
core_status machine_check_rules(machine *m);

/* Log that the equations have no solution at the present time. */
core_status machine_unsolved(machine *m);

/* Error that derivatives do not exist near a singular configuration. sine: distance from it. */
core_status machine_not_differentiable(machine *m, double sine);

#endif
