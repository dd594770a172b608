/* Dormand and Prince's explicit Runge-Kutta pair of order 5(4), with dense output of order 4.
 *
 * Re-entrant: no globals and no allocation. The caller owns two arrays of doubles: `memory`, which
 * holds all that one step hands to the next (copy it to save and restore an integration bit for
 * bit), and `work`, which is scratch except for the dense output of the last step.
 *
 * Source: Dormand and Prince 1980; Hairer, Norsett and Wanner 1993, II.4 to II.6. Unlike their
 * code, the step that error control wants is remembered apart from the one that an end time cut
 * short, and a projection onto constraints may follow each accepted step.
 */
#ifndef MBS_DOPRI5_H
#define MBS_DOPRI5_H

#include <stddef.h>

#define DOPRI5_MEMORY(n) (5 + (n))
#define DOPRI5_WORK(n) (13 * (n))

enum {
    DOPRI5_OK = 0,
    DOPRI5_MORE = 1,          /* the budget of steps is used up: call again */
    DOPRI5_TOO_MANY_STEPS,    /* max_steps between two output times */
    DOPRI5_STEP_TOO_SMALL,    /* error control asks for a step below rounding of time */
    DOPRI5_RHS_FAILED,        /* so did failures of the right-hand side */
    DOPRI5_PROJECTION_FAILED, /* so did failures of the projection */
    DOPRI5_NOT_FINITE         /* so did values that are not finite */
};

/* Both return 0, or anything else when they have no answer there: the step is then shortened. */
typedef int (*dopri5_rhs)(void *user, double t, const double *x, double *xdot);
typedef int (*dopri5_project)(void *user, double t, double *x);

typedef struct {
    int n;
    dopri5_rhs rhs;
    dopri5_project project; /* NULL: no constraints */
    void *user;
    double rtol, atol, h_max;
    const double *nominal; /* typical size of each state, which scales atol; NULL: 1 */
    long max_steps;
    double *memory, *work;
    long steps, rejected, since_output;
} dopri5;

/* Start at time t. max_steps and h_max are then 100000 and infinite; change them at will. */
void dopri5_init(dopri5 *s, int n, dopri5_rhs rhs, void *user, double *memory, double *work);
void dopri5_start(dopri5 *s, double t);

/* Something jumped (an input, a parameter): the slope is computed anew, the step size is kept. */
void dopri5_restart(dopri5 *s);

double dopri5_time(const dopri5 *s);
double dopri5_wanted_step(const dopri5 *s);

/* One accepted step, no further than limit, which must lie ahead. Without a projection the last
 * call of the right-hand side was made at the new state. */
int dopri5_step(dopri5 *s, double *x, double limit);

/* Take x from the present time to t_end exactly. On failure x is the last accepted state. */
int dopri5_advance(dopri5 *s, double *x, double t_end);

/* Fill rows *done .. count-1 of table (count, n) with the states at times[], through dense output.
 * At most `budget` steps are tried in one call; DOPRI5_MORE means: call again to go on. */
int dopri5_table(dopri5 *s, double *x, const double *times, long count, double *table, long *done,
                 long budget);

#endif
