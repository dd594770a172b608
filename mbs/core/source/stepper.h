/* Steps with error control, dense output and projection: what all one-step methods share.
 *
 * Re-entrant: no globals and no allocation. The caller owns two arrays of doubles: `memory`, which
 * holds all that one step hands to the next (copy it to save and restore an integration bit for
 * bit), and `work`, which is scratch except for the dense output of the last step.
 *
 * Source: Hairer, Norsett and Wanner 1993, II.4 to II.6. Unlike their code, the step that error
 * control asks for is remembered apart from the one that an end time cut short, and a projection
 * onto constraints may follow each accepted step.
 */
#ifndef MBS_STEPPER_H
#define MBS_STEPPER_H

#include <stddef.h>

#define STEPPER_MEMORY(n) (6 + (n))

enum {
    STEPPER_OK = 0,
    STEPPER_MORE = 1,          /* the budget of steps is used up: call again */
    STEPPER_TOO_MANY_STEPS,    /* max_steps between two output times */
    STEPPER_STEP_TOO_SMALL,    /* error control asks for a step below rounding of time */
    STEPPER_RHS_FAILED,        /* so did failures of the right-hand side */
    STEPPER_PROJECTION_FAILED, /* so did failures of the projection */
    STEPPER_NOT_FINITE,        /* so did values that are not finite */
    STEPPER_SINGULAR,          /* so did a singular configuration, as in the next four cases */
    STEPPER_ENDS_SINGULAR,     /* the step ends in one: shorten it a little */
    STEPPER_NEAR_MISS,         /* it does, or nearly: branches come near and do not meet */
    STEPPER_CHART_LEFT,        /* a stage lies beyond what the coordinates of the step describe */
    STEPPER_UNDETERMINED       /* the motion begins in one, and its velocities choose no branch */
};

/* All return 0, or anything else when they have no answer there: the step is then shortened. */
typedef int (*stepper_rhs)(void *user, double t, const double *x, double *xdot);
typedef int (*stepper_project)(void *user, double t, double *x);

/* d rhs / d x (n, n), column by column, and d rhs / d t (n,). */
typedef int (*stepper_jacobian)(void *user, double t, const double *x, double *J, double *f_t);

typedef struct stepper stepper;

/* A method whose error estimate is of order 4. `attempt` leaves the new state in
 * stepper_candidate and its error in stepper_trial. */
typedef struct {
    int (*open)(stepper *s, const double *x); /* what rejected tries of a step share; or NULL */
    int (*attempt)(stepper *s, const double *x, double h);
    void (*keep)(stepper *s, const double *x, double h); /* the dense output of the attempt */
    int (*close)(stepper *s, double t); /* the slope that opens the next step, if it is known */
    void (*interpolate)(const stepper *s, double a, double *row); /* a: 0 .. 1 within the step */
    int (*slope)(stepper *s, const double *x); /* stepper_slope at x; NULL: the right-hand side */
} stepper_method;

struct stepper {
    int n;
    const stepper_method *method;
    stepper_rhs rhs;
    stepper_project project;   /* NULL: no constraints */
    stepper_jacobian jacobian; /* for implicit methods */
    void *user;
    double rtol, atol, h_max;
    double fixed;  /* length of all steps; 0: error control finds it */
    double afresh; /* length of the first step after a jump; 0: it is estimated */
    const double *nominal; /* typical size of each state, which scales atol; NULL: 1 */
    const double *relative; /* factor of rtol of each state; NULL: 1 */
    long max_steps;
    double *memory, *work;
    long steps, rejected, since_output;
    void *passage;   /* of a method that passes singular configurations, or NULL */
    double noise;    /* what rounding adds to atol in the last attempt */
    int cut;         /* the present attempt ends at a limit */
    int kept_closed; /* the candidate is on the constraints: nothing projects it */
    int corrected;   /* whether the last projection changed the candidate beyond tolerances */
    const double *stops; /* (n_stops) increasing times at which steps end; or NULL */
    const double *hard;  /* 1 where laws of time may jump, so that a step begins anew; 0 elsewhere */
    long n_stops, next;  /* the next one is the first that lies ahead */
    double from, to;     /* laws of time are asked between these: on one side of their jumps */
};

/* What the init of a method calls. max_steps and h_max are then 100000 and infinite. */
void stepper_init(stepper *s, int n, const stepper_method *method, stepper_rhs rhs, void *user,
                  double *memory, double *work);

void stepper_start(stepper *s, double t);

/* Something jumped (an input, a parameter): the slope is computed anew, the step size is kept. */
void stepper_restart(stepper *s);

/* Before stepper_start: begin with steps of this length, and make no longer ones. */
void stepper_fix(stepper *s, double h);

/* The state jumped: the step size is found anew too, where it is neither fixed nor given. */
void stepper_restart_afresh(stepper *s);

/* After stepper_start: steps end at these times. The arrays stay with the caller. */
void stepper_stop_at(stepper *s, const double *stops, const double *hard, long count);

/* Go on behind a stop at the present time, if there is one. 1: laws of time may have jumped there. */
int stepper_pass_stop(stepper *s);

/* A time moved to the side of the jumps of laws on which the present step is. */
double stepper_law_time(const stepper *s, double t);

double stepper_time(const stepper *s);
double stepper_wanted_step(const stepper *s);
double stepper_last_step(const stepper *s);

/* One accepted step, no further than limit, which must lie ahead. On failure x is the last
 * accepted state. */
int stepper_step(stepper *s, double *x, double limit);

/* The state at a time within the last step, projected. */
int stepper_state(const stepper *s, const double *x, double t, double *row);

/* Back to a time within the last step; states at earlier times of it remain at hand. */
int stepper_rewind(stepper *s, double *x, double t);

/* Fill rows *done .. count-1 of table (count, n) with the states at times[], through dense output.
 * At most `budget` steps are tried in one call; STEPPER_MORE means: call again to go on. */
int stepper_table(stepper *s, double *x, const double *times, long count, double *table, long *done,
                  long budget);

/* For methods. */
double *stepper_slope(const stepper *s); /* at the start of the step */
double *stepper_trial(const stepper *s);
double *stepper_candidate(const stepper *s);
void stepper_close(stepper *s, const double *slope); /* NULL: not known */
int stepper_evaluate(const stepper *s, double t, const double *x, double *xdot);
int stepper_all_finite(const double *v, int n);

#endif
