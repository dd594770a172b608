/* Event detection: the state and the modes jump when an event indicator reaches zero.
 *
 * Between events every indicator is positive. An event is the first time at which an indicator is
 * not positive. It is located in the dense output of the step, to the rounding of time. After a
 * jump, an indicator that is negative or falls from zero triggers another jump at the same time.
 * Values below the absolute tolerance count as zero. An indicator that is constant at zero or rises
 * from it must become positive; otherwise it fires at the first sample at which it is negative.
 *
 * The step is then repeated, with its end at the event. The equations may change at the event, and
 * stages after it distort the dense output.
 *
 * Each step samples the indicators and their rates at its middle and end. An indicator that falls
 * at one sample and rises at the next may be negative in between. Tangents give the next sample
 * time.
 *
 * `approaches` has three columns with one value per indicator: a bound of its rate at the present
 * speed, the reciprocal of the shortest time in which it falls to zero and rises again, and 1 if
 * the equations depend on it. More samples are added until the indicator cannot have reached zero
 * between two of them. If the equations depend on an indicator that deviates from the cubic Hermite
 * curve through both ends of the step, the step has missed a change of the equations. It is then
 * repeated, with its end at that sample.
 *
 * Source: Cellier and Kofman 2006, chapter 9; Dowell and Jarratt 1971 for the location; Mirtich
 * 1996 for sample times from the bound of the rate.
 */
#ifndef MBS_EVENTS_H
#define MBS_EVENTS_H

#include "stepper.h"

#define EVENTS_MEMORY(k) (4 + 6 * (k))
#define EVENTS_WORK(n, k) ((n) + 15 * (k))

enum {
    EVENTS_FIRED = -1, /* an event was processed; events_table returns there: call again */
    EVENTS_INDICATORS_FAILED = STEPPER_UNDETERMINED + 1,
    EVENTS_JUMP_FAILED,
    EVENTS_DO_NOT_SETTLE, /* the sequence of jumps at one time does not end */
    EVENTS_STAND_STILL    /* many events in succession without progress of time */
};

/* Write the indicators, or their rates along the motion, to values. The rates are evaluated right
 * after the indicators at the same t and x. Returns 0, or nonzero on failure. */
typedef int (*events_values)(void *user, double t, const double *x, double *values);
/* Change x and the modes that rhs, project and the indicators read. fired: 0 or 1 for each
 * indicator. Returns 0, or nonzero on failure. */
typedef int (*events_jump)(void *user, double t, double *x, const double *fired);

typedef struct {
    events_values indicators, rates;
    events_jump jump;
    events_values approaches; /* writes 3 columns of `count` values, see above; or NULL */
} events_model;

/* State of the event detection. The caller owns memory, which contains all data between steps, and
 * work. */
typedef struct {
    stepper *solver;
    int count;
    const events_model *model;
    double *memory, *work;
    double near_at; /* time of the stored approaches, NAN if nothing is stored */
} events;

/* Initialise the event detection of a stepper with `count` indicators. memory has
 * EVENTS_MEMORY(count) elements, work EVENTS_WORK(n, count). */
void events_init(events *e, stepper *solver, int count, const events_model *model, double *memory,
                 double *work);

/* Evaluate the indicators at the first state, which may make a jump pending. */
int events_start(events *e, const double *x);

/* Mark the indicators as outdated after a jump of an input or a parameter. The next events_step or
 * events_look evaluates them at the present state, which may make a jump pending. */
void events_restart(events *e);
int events_look(events *e, const double *x);

/* Whether a jump is pending at the present time. No step is made before events_settle. */
int events_pending(const events *e);

/* Make one accepted step, shortened to its first event, which is then pending. No step is made if
 * the state at its start makes a jump pending. */
int events_step(events *e, double *x, double limit);

/* Apply jumps until none is pending. Returns EVENTS_FIRED, or a status on failure. */
int events_settle(events *e, double *x, double limit);

/* Set the pending jump for an external integrator whose indicators are indicators + offset: each
 * sum that is not positive is due. An indicator that keeps its negative value in the jump and does
 * not fall afterwards triggers no further jump, because the integrator overshot the event. */
int events_found(events *e, const double *x, const double *offset);

/* Store the indicator values to which an external integrator overshot the pending event. */
void events_overshoot(events *e, const double *value);

/* Arrays (count,): flags of the indicators that fired at the last event, that trigger the pending
 * jump, and that can fire; then the indicator values at the last sample. */
const double *events_fired(const events *e);
const double *events_due(const events *e);
const double *events_armed(const events *e);
const double *events_seen(const events *e);

/* Fill a table as stepper_table does. A row at the time of an event contains the state after it. */
int events_table(events *e, double *x, const double *times, long count, double *table, long *done,
                 long budget);

#endif
