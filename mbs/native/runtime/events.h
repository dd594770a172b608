/* Events of an integration: where indicators reach zero, the state and the modes jump.
 *
 * Between events every indicator is positive. An event is where one of them is not any more. It is
 * located in the dense output of the step to the rounding of time; the earliest comes first. After
 * a jump, an indicator that is negative, or falls from zero, asks for another jump at the same
 * time; zero is what is smaller than the absolute tolerance. One that rises from zero or stands
 * there must leave it upwards, else it fires as soon as it is seen below.
 *
 * The indicators and their slopes are looked at twice in each step. What falls at one look and rises
 * at the next may have been below zero between them: tangents tell where to look again.
 *
 * Source: Cellier and Kofman 2006, chapter 9; Dowell and Jarratt 1971 for the location.
 */
#ifndef MBS_EVENTS_H
#define MBS_EVENTS_H

#include "stepper.h"

#define EVENTS_WORK(n, k) ((n) + 9 * (k))

enum {
    EVENTS_FIRED = -1, /* the table ends at an event: read it and call again */
    EVENTS_INDICATORS_FAILED = STEPPER_NOT_FINITE + 1,
    EVENTS_JUMP_FAILED,
    EVENTS_DO_NOT_SETTLE, /* the jumps at one time do not come to an end */
    EVENTS_STAND_STILL    /* many events, and time hardly advances */
};

/* Indicators, or how fast they rise along the motion; 0 when they have values. */
typedef int (*events_values)(void *user, double t, const double *x, double *values);
/* Changes x, and the modes that rhs, project and the indicators read; fired: 0 or 1 for each. */
typedef int (*events_jump)(void *user, double t, double *x, const double *fired);

typedef struct {
    stepper *solver;
    int count;
    events_values indicators, rates;
    events_jump jump;
    double *work;
    double last; /* time of the last event */
    int idle;    /* events since time advanced */
    int pending; /* a jump is due at the present time */
} events;

void events_init(events *e, stepper *solver, int count, events_values indicators,
                 events_values rates, events_jump jump, double *work);

/* Look at the first state: an indicator may ask for a jump there. */
int events_start(events *e, const double *x);

/* Which indicators asked for jumps at the last event: 0 or 1 for each. */
const double *events_fired(const events *e);

/* As stepper_table; a row at the time of an event holds the state after it. */
int events_table(events *e, double *x, const double *times, long count, double *table, long *done,
                 long budget);

#endif
