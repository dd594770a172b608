/* Event mode: modes, jumps and event iteration, and event indicators for an external integrator.
 *
 * After a jump, or at rest on a contact, an indicator is near zero. The external integrator then
 * gets it with an offset, which exceeds the magnitude of its negative values. So no sign changes
 * until the indicator is clearly positive or decreases again. Its value is never exactly zero.
 */
#ifndef MBS_EVENT_MODE_H
#define MBS_EVENT_MODE_H

#include "event_data.h"

/* Connect the events with a solver, once per instance. */
#if NK > 0
void event_mode_init(core_events *e, core_solver *s, core_event_memory *memory);
#else
void event_mode_init(core_events *e, core_solver *s);
#endif

/* Evaluate the first indicators, at the end of the initialization. */
core_status event_mode_start(core_events *e);

/* Make the jumps that the present state requires (event iteration). *changed: set to 1 if they
 * change the states, otherwise kept. */
core_status event_mode_iterate(core_events *e, int *changed);

/* Calculate the event indicators for an external integrator. */
core_status event_mode_show_indicators(core_events *e);

/* Arm the indicators that have left zero after a step of an external integrator: from then on they
 * can fire. */
core_status event_mode_arm_indicators(core_events *e);

#endif
