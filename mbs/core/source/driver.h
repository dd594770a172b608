/* Integration of a model with events, projections and steps through singular configurations. */
#ifndef MBS_DRIVER_H
#define MBS_DRIVER_H

#include "events.h"
#include "model.h"
#include "passage.h"

#define DRIVER_STOPPED 100 /* status: an evaluation returned MODEL_STOP */

/* Functions of the integrated model. The inputs of each function are t, x (n,) and p (n_p,). The
 * last n_modes elements of p are the modes, which jumps change. */
typedef struct {
    int n, n_p, n_modes, n_indicators;
    model_function rhs;      /* -> x' (n,) */
    model_function project;  /* -> x after a Newton step onto the constraints, its residual */
    model_function jacobian; /* -> d rhs / d x (n, n), d rhs / d t; selects RODAS5P */
    model_function indicators, rates; /* -> (n_indicators,) values, and their rates of change */
    model_function approaches;        /* -> (n_indicators, 3), see events.h */
    model_function jump; /* with the fired indicators as input 4 -> x, modes (n_modes,) */
    model_function rows, forces, regularity; /* see passage.h */
    passage_size size;                       /* dimensions of rows */
    passage_patterns patterns; /* sparsity patterns of the matrices of rows and forces */
    double typical;            /* regularity at a common configuration */
} driver_model;

typedef struct {
    double rtol, atol, max_step, first_step; /* first_step: after an event [s], 0 to estimate it */
    const double *absolute, *relative; /* (n,) factors of the tolerances of each state, or NULL */
    const double *stops, *jumps; /* (n_stops,) stop times; 1 if functions of time may jump there */
    long n_stops;
} driver_control;

typedef struct driver driver;

/* Create an integration that starts at time t. p is copied; the caller keeps all other arrays.
 * Returns NULL if no memory is left. */
driver *driver_new(const driver_model *model, const double *p, const driver_control *control,
                   double t);
void driver_free(driver *d);

/* Replace the functions of the model by functions with the same values and sizes. */
void driver_replace(driver *d, const driver_model *model);

/* Project the first state x (n,) and evaluate the indicators there. Returns a status. */
int driver_begin(driver *d, double *x);

/* Fill rows *done .. count - 1 of table (count, n) with the states at times[]. Return after
 * `budget` steps (STEPPER_MORE), after an event (EVENTS_FIRED), or with another status. */
int driver_table(driver *d, double *x, const double *times, long count, double *table, long *done,
                 long budget);

/* After driver_begin: whether x is a singular configuration that the motion leaves on one branch;
 * slope (n,) is then x' on this branch. */
int driver_leaves(driver *d, const double *x, double *slope);

double driver_time(const driver *d);
double driver_step(const driver *d);         /* the next step that error control requires [s] */
const double *driver_fired(const driver *d); /* (n_indicators,) 1 if fired last */
const double *driver_modes(const driver *d); /* (n_modes,) present modes */

#endif
