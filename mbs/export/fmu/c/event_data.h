/* Events of an instance: detection, pending events and hysteresis of the event indicators.
 *
 * The modes are variables of the model; an event changes them (event_mode.h).
 */
#ifndef MBS_EVENT_DATA_H
#define MBS_EVENT_DATA_H

#include "solver.h"

#if NK > 0
#include "events.h"

/* Data that a run changes. */
typedef struct {
    double offset[NK]; /* hysteresis: added to an indicator that has not left zero yet */
    double detection[EVENTS_MEMORY(NK)];
} core_event_memory;
#endif

typedef struct {
    core_solver *solver;
#if NK > 0
    core_event_memory *memory;
    events detection;
    double work[EVENTS_WORK(N_INTEGRATED, NK) + 1];
#endif
} core_events;

/* Whether an event is pending at the present time. */
static inline int event_is_pending(const core_events *e) {
#if NK > 0
    return events_pending(&e->detection);
#else
    (void)e;
    return 0;
#endif
}

#endif
