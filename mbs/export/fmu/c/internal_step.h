/* Internal steps of co-simulation, up to the next event. */
#ifndef MBS_INTERNAL_STEP_H
#define MBS_INTERNAL_STEP_H

#include "event_data.h"

/* Make one internal step, at most to `limit` [s]. It ends at its first event, which is then
 * pending. */
core_status internal_step(core_events *e, double limit);

/* Restart the solver after a change of data on which derivatives and indicators depend. */
void internal_step_restart(core_events *e);

/* Project the tree onto its closure rows after data of the rows have changed. The chart of the last
 * step is discarded. */
core_status internal_step_project(core_events *e);

/* Accept the configuration after a step or jump. at_hand: 1 if the dependent coordinates of the
 * machine are those of the present states. */
core_status internal_step_accept(core_solver *s, int at_hand);

/* Log why a step or an event has failed. status: of stepper.h or events.h. */
core_status internal_step_failed(core_events *e, int status);

#endif
