/* Continuous states of closed loops in model exchange: choice of their coordinates (charts.h). */
#ifndef MBS_CHART_CHOICE_H
#define MBS_CHART_CHOICE_H

#include "event_data.h"

#if MODEL_TREE_OUTSIDE

/* Choose the states at the end of the initialization. */
core_status chart_choice_start(core_solver *s);

/* Make the joint coordinates the states again, before event mode sets a joint value or a length. */
core_status chart_choice_set_joints(core_solver *s);

/* Prepare for event mode. */
core_status chart_choice_enter_event_mode(core_solver *s);

/* Calculate the event indicator of a change of coordinates. If it is positive, the present state is
 * accepted: the branch is followed from it. */
core_status chart_choice_show_indicator(core_solver *s);

/* Accept the states after an integrator step. *event: 1 if the coordinates must change. */
core_status chart_choice_completed_step(core_solver *s, int *event);

/* Handle jumps and changes of coordinates in event mode. *changed: 1 if the states changed. */
core_status chart_choice_update(core_events *e, int *changed);

#endif
#endif
