/* Events of an integration: where indicators reach zero, the state and the modes jump.
 *
 * Between events every indicator is positive. An event is where one of them is not any more. It is
 * located in the dense output of the step to the rounding of time; the earliest comes first. After
 * a jump, an indicator that is negative, or falls from zero, asks for another jump at the same
 * time; zero is what is smaller than the absolute tolerance. One that rises from zero or stands
 * there must leave it upwards, else it fires as soon as it is seen below.
 *
 * The step is then made once more, to the event alone: where laws change behind it, stages there have
 * bent the dense output.
 *
 * The indicators and their slopes are looked at twice in each step. What falls at one look and rises
 * at the next may have been below zero between them: tangents show where to look again.
 *
 * `approaches` has for each indicator the bound of its rate at the present speed, the reciprocal of
 * the shortest time in which it falls to zero and rises again, and 1 where the equations depend on
 * it. Such an indicator is looked at until two looks are so near each other that it cannot have
 * fallen to zero between them, or has not had the time to. Where the equations depend on one that
 * leaves the curve which both ends of the step give, the step has missed a part of their law: it is
 * made once more, to that look.
 *
 * Source: Cellier and Kofman 2006, chapter 9; Dowell and Jarratt 1971 for the location; Mirtich 1996
 * for looks by the bound of the rate.
 */
#ifndef MBS_EVENTS_H
#define MBS_EVENTS_H

#include "stepper.h"

#define EVENTS_MEMORY(k) (4 + 6 * (k))
#define EVENTS_WORK(n, k) ((n) + 15 * (k))

enum {
    EVENTS_FIRED = -1, /* an event has just been settled; a table ends there: call again */
    EVENTS_INDICATORS_FAILED = STEPPER_UNDETERMINED + 1,
    EVENTS_JUMP_FAILED,
    EVENTS_DO_NOT_SETTLE, /* the jumps at one time do not come to an end */
    EVENTS_STAND_STILL    /* many events, and time hardly advances */
};

/* Indicators, or how fast they rise along the motion, asked right after the indicators at the same
 * place; 0 when they have values. */
typedef int (*events_values)(void *user, double t, const double *x, double *values);
/* Changes x, and the modes that rhs, project and the indicators read; fired: 0 or 1 for each. */
typedef int (*events_jump)(void *user, double t, double *x, const double *fired);

typedef struct {
    events_values indicators, rates;
    events_jump jump;
    events_values approaches; /* NULL, or 3 columns: see above */
} events_model;

/* memory, which the caller owns, holds all that one step hands to the next, as in the stepper. */
typedef struct {
    stepper *solver;
    int count;
    const events_model *model;
    double *memory, *work;
    double near_at; /* time at which the approaches of the last look are known; NAN: none */
} events;

void events_init(events *e, stepper *solver, int count, const events_model *model, double *memory,
                 double *work);

/* Look at the first state: an indicator may ask for a jump there. */
int events_start(events *e, const double *x);

/* Something jumped (an input, a parameter): the next step, or events_look, looks at the present
 * state anew, which may ask for a jump. */
void events_restart(events *e);
int events_look(events *e, const double *x);

/* A jump is due at the present time: no step is made before it is settled. */
int events_pending(const events *e);

/* One accepted step, cut at its first event, which is then pending. No step at all where the state
 * at its start asks for a jump. */
int events_step(events *e, double *x, double limit);

/* Jumps until no indicator asks for another one; then EVENTS_FIRED. */
int events_settle(events *e, double *x, double limit);

/* For an integrator outside, which sees indicators + offsets: what is not positive, is due. What the
 * jump leaves where it is, but does not fall any more, waits: it was overshot. */
int events_found(events *e, const double *x, const double *offset);

/* The state of the pending event was moved to where the indicators have these values. */
void events_overshoot(events *e, const double *value);

/* Which indicators asked for jumps at the last event: 0 or 1 for each; which of them ask for the
 * pending one; which can fire; and their values when they were last looked at. */
const double *events_fired(const events *e);
const double *events_due(const events *e);
const double *events_armed(const events *e);
const double *events_seen(const events *e);

/* As stepper_table; a row at the time of an event holds the state after it. */
int events_table(events *e, double *x, const double *times, long count, double *table, long *done,
                 long budget);

#endif
