/* Step-size control, dense output and projection of all one-step integration methods.
 *
 * Re-entrant: no globals and no allocation. The caller owns two arrays of doubles. `memory`
 * contains the state of the integrator between steps; a copy of it saves and restores an
 * integration bit for bit. `work` is scratch memory, except for the dense output of the last step.
 *
 * Source: Hairer, Norsett and Wanner 1993, II.4 to II.6. Unlike their code, the step size of the
 * error control is kept when an end time shortens a step, and a projection onto constraints may
 * follow each accepted step.
 */
#ifndef MBS_STEPPER_H
#define MBS_STEPPER_H

#include <stddef.h>

#define STEPPER_MEMORY(n) (6 + (n))

enum {
    STEPPER_OK = 0,
    STEPPER_MORE = 1,          /* the budget of steps is used up: call again */
    STEPPER_TOO_MANY_STEPS,    /* max_steps between two output times */
    STEPPER_STEP_TOO_SMALL,    /* error control reduced the step below the rounding of time */
    STEPPER_RHS_FAILED,        /* failures of the right-hand side reduced the step so far */
    STEPPER_PROJECTION_FAILED, /* failures of the projection reduced the step so far */
    STEPPER_NOT_FINITE,        /* values that are not finite reduced the step so far */
    STEPPER_SINGULAR,          /* a singular configuration reduced the step so far */
    STEPPER_ENDS_SINGULAR,     /* the step ends in a singular configuration: shorten it a little */
    STEPPER_NEAR_MISS,         /* branches of motion come near each other and do not meet */
    STEPPER_CHART_LEFT,        /* a stage lies outside the range of the local coordinates */
    STEPPER_UNDETERMINED       /* the start is singular and its velocities select no branch */
};

/* Callbacks of the model. They return 0, or nonzero on failure; the step is then shortened. */
typedef int (*stepper_rhs)(void *user, double t, const double *x, double *xdot);
typedef int (*stepper_project)(void *user, double t, double *x);

/* d rhs / d x (n, n), column by column, and d rhs / d t (n,). */
typedef int (*stepper_jacobian)(void *user, double t, const double *x, double *J, double *f_t);

typedef struct stepper stepper;

/* Functions of an integration method with an error estimate of order 4. `attempt` writes the new
 * state to stepper_candidate and its error to stepper_trial. */
typedef struct {
    int (*open)(stepper *s, const double *x); /* prepares data of all attempts of a step; or NULL */
    int (*attempt)(stepper *s, const double *x, double h);
    void (*keep)(stepper *s, const double *x, double h); /* stores the dense output */
    int (*close)(stepper *s, double t); /* stores the slope at the end of the step, if available */
    void (*interpolate)(const stepper *s, double a, double *row); /* state at fraction a */
    int (*slope)(stepper *s, const double *x); /* sets stepper_slope at x; NULL: right-hand side */
} stepper_method;

struct stepper {
    int n;
    const stepper_method *method;
    stepper_rhs rhs;
    stepper_project project;   /* projection onto the constraints, NULL without constraints */
    stepper_jacobian jacobian; /* Jacobian of the right-hand side, for implicit methods */
    void *user;
    double rtol, atol, h_max;
    double fixed;           /* fixed step size, 0 for error control */
    double afresh;          /* size of the first step after a jump, 0 to estimate it */
    const double *nominal;  /* typical size (n,) of each state, which scales atol; NULL: all 1 */
    const double *relative; /* factor (n,) of rtol for each state; NULL: all 1 */
    long max_steps;
    double *memory, *work;
    long steps, rejected, since_output;
    void *passage;   /* data of the steps through singular configurations (passage.h), or NULL */
    double noise;    /* rounding error of the last attempt, added to atol in the error norm */
    int cut;         /* whether the present attempt ends at a time limit */
    int kept_closed; /* whether the candidate satisfies the constraints without projection */
    int corrected;   /* whether the last projection changed the candidate by more than UNMOVED */
    const double *stops; /* (n_stops,) increasing times at which steps end; or NULL */
    const double *hard;  /* (n_stops,) 1 if functions of time may jump at the stop, else 0 */
    long n_stops, next;  /* number of stops and index of the first stop after the present time */
    double from, to;     /* time interval without jumps, to which stepper_law_time clamps times */
};

/* Initialise a stepper; called by the init function of each method. Defaults: max_steps = 100000,
 * infinite h_max, rtol = atol = 1e-8. */
void stepper_init(stepper *s, int n, const stepper_method *method, stepper_rhs rhs, void *user,
                  double *memory, double *work);

/* Begin an integration at time t: clears memory and the step counters. */
void stepper_start(stepper *s, double t);

/* Recompute the slope after a jump of an input or a parameter. The step size is kept. */
void stepper_restart(stepper *s);

/* Set the first and the largest step size to h. Call it before stepper_start. */
void stepper_fix(stepper *s, double h);

/* Recompute the slope and the step size after a jump of the state. The new step size is `fixed`,
 * `afresh`, or an estimate if both are 0. */
void stepper_restart_afresh(stepper *s);

/* Set the times at which steps end. Call it after stepper_start. The caller keeps the arrays. */
void stepper_stop_at(stepper *s, const double *stops, const double *hard, long count);

/* Continue after a stop at the present time, if there is a stop. Returns 1 if functions of time may
 * jump there, else 0. */
int stepper_pass_stop(stepper *s);

/* Return t, clamped to the interval without jumps that contains the present step. */
double stepper_law_time(const stepper *s, double t);

/* Present time, step size of the error control, and size of the last accepted step. */
double stepper_time(const stepper *s);
double stepper_wanted_step(const stepper *s);
double stepper_last_step(const stepper *s);

/* Make one accepted step that ends at `limit`, a later time, or before. Returns a status. On
 * failure x is the last accepted state. */
int stepper_step(stepper *s, double *x, double limit);

/* Write the projected state at a time t within the last step to row (n,). Returns a status. */
int stepper_state(const stepper *s, const double *x, double t, double *row);

/* Return to a time t within the last step. The dense output before t stays available. */
int stepper_rewind(stepper *s, double *x, double t);

/* Fill rows *done .. count-1 of table (count, n) with the states at times[], by dense output.
 * Each call attempts at most `budget` steps. STEPPER_MORE: call again to continue. */
int stepper_table(stepper *s, double *x, const double *times, long count, double *table, long *done,
                  long budget);

/* Functions for the implementation of methods. */
double *stepper_slope(const stepper *s);     /* slope (n,) at the start of the step */
double *stepper_trial(const stepper *s);     /* scratch (n,), error estimate of the last attempt */
double *stepper_candidate(const stepper *s); /* state (n,) at the end of the attempt */
void stepper_close(stepper *s, const double *slope); /* store the slope, NULL if unavailable */
/* Evaluate the right-hand side. Returns STEPPER_NOT_FINITE if an element is not finite. */
int stepper_evaluate(const stepper *s, double t, const double *x, double *xdot);

#endif
