#include "chart_choice.h"

#if MODEL_TREE_OUTSIDE

#include <float.h>
#include <math.h>
#include <string.h>

#include "calculated.h"
#include "charts.h"
#include "event_mode.h"
#include "guard.h"
#include "passage_external.h"

/* Smallest grip (independent velocities / largest joint velocity) at which the joints are the
 * states. Errors of the states are magnified by its inverse. Below it, tangent coordinates are
 * used. */
#define HOLD 0.1
#define LEAVE 1.5  /* room above which the joints are the states again: hysteresis above 1 */
#define NEAR 1e-6  /* tolerance of the room at 1: importers locate it better, on either side */
#define TURNED 0.5 /* smallest alignment, 60 degrees: well before a chart ends (passage.c) */

/* Margin of the independent joints as states: above 1 they can be used, 0 in a singular
 * configuration. */
static double room(core_solver *s) {
    double grip = 0.0, t = s->machine->run->time;
    if (passage_grip(s->passage, t, s->tree->X, MODEL_TREE_HELD, MODEL_TREE_UNITS, &grip))
        return 0.0;
    return fmin(passage_regularity(s->passage, t, s->tree->X) / PASSAGE_ON, grip / HOLD);
}

/* Choose the coordinates of the next steps, which begin at the state of the tree: the joints if the
 * room exceeds `least`, else tangent coordinates. */
static core_status choose(core_solver *s, double least) {
    machine *m = s->machine;
    double *states = m->values + CHART_STATES, t = m->run->time;
    int i;
    m->variables->stale = 1;
    s->charts->settled = 1;
    s->charts->tangent = !(room(s) > least);
    if (!s->charts->tangent) {
        for (i = 0; i < NX; i++) states[i] = s->tree->X[MODEL_TREE_STATES[i]];
        return CORE_OK;
    }
    memset(states, 0, NX * sizeof *states);
    s->charts->alignment = 1.0;
    if (!passage_chart(s->passage, t, s->tree->X) &&
        !passage_coordinates(s->passage, t, s->tree->X, states))
        return CORE_OK;
    return log_failed(m->log,
                      "at time %.9g the motion is in a singular configuration (%s), and its "
                      "velocities choose no branch; start elsewhere",
                      t, log_where(m->log));
}

/* Compute the state of the tree from the joints, and choose the coordinates of the next steps. */
static core_status begin(core_solver *s) {
    core_status status;
    s->charts->tangent = s->charts->loose = 0;
    status = charts_calculate(s);
    if (status) return status;
    charts_accept(s);
    return choose(s, 1.0);
}

core_status chart_choice_start(core_solver *s) {
    charts_show_joints(s);
    if (s->tree->singular) {
        s->tree->singular = 0;
        charts_accept(s);
        return choose(s, 1.0);
    }
    passage_start(s->passage);
    return begin(s);
}

core_status chart_choice_set_joints(core_solver *s) {
    core_status status = s->charts->tangent ? calculate(s) : CORE_OK;
    s->charts->tangent = 0;
    s->charts->loose = 1;
    charts_show_joints(s);
    return status;
}

core_status chart_choice_enter_event_mode(core_solver *s) {
    s->charts->settled = 0;
    return s->charts->tangent ? CORE_OK : guard_pass(s->machine);
}

/* Event indicator: not positive if the coordinates must change. */
static double indicator(core_solver *s) {
    return s->charts->tangent ? s->charts->alignment - TURNED : room(s) - 1.0;
}

/* Accept the present states, if the motion to them has not left its branch. */
static core_status accept_states(core_solver *s) {
    core_status status = s->charts->tangent ? CORE_OK : guard_pass(s->machine);
    if (!status) charts_accept(s);
    return status;
}

core_status chart_choice_show_indicator(core_solver *s) {
    core_status status = calculate(s);
    double shown;
    if (status) return status;
    shown = indicator(s);
    if (shown > 0.0) status = accept_states(s);
    if (status) return status;
    s->machine->values[CHART_INDICATOR] = shown == 0.0 ? -DBL_MIN : shown;
    return CORE_OK;
}

core_status chart_choice_completed_step(core_solver *s, int *event) {
    core_status status = calculate(s);
    if (!status) status = accept_states(s);
    if (status) return status;
    *event = !(indicator(s) > 0.0) || (s->charts->tangent && room(s) > LEAVE);
    return CORE_OK;
}

/* Make the jumps that are due. The next steps begin at the state of the tree after them. */
static core_status jump_from_chart(core_events *e, int *jumped) {
#if NK > 0 && !MODEL_CHARTS_ALONE
    core_solver *s = e->solver;
    machine *m = s->machine;
    core_status status = calculate(s);
    *jumped = 0;
    if (!status) status = event_mode_iterate(e, jumped);
    if (status || !m->variables->stale) return status;
    if (s->charts->tangent) {
        s->charts->time = m->run->time;
        memcpy(s->charts->X, s->tree->X, sizeof s->charts->X);
        memset(s->charts->slope, 0, sizeof s->charts->slope);
        status = choose(s, 1.0);
    } else {
        charts_show_joints(s);
    }
    if (!status) status = calculate(s);
    if (!status) charts_accept(s);
    return status;
#else
    (void)e;
    *jumped = 0;
    return CORE_OK;
#endif
}

core_status chart_choice_update(core_events *e, int *changed) {
    core_solver *s = e->solver;
    const double *states = s->machine->values + CHART_STATES;
    double before[NX + 1];
    core_status status;
    int jumped;
    *changed = s->charts->loose;
    if (s->charts->loose) {
        status = begin(s);
        if (status) return status;
    }
    status = jump_from_chart(e, &jumped);
    *changed = *changed || jumped;
    if (status || s->charts->settled) return status;
    memcpy(before, states, sizeof before);
    status = calculate(s);
    if (status) return status;
    charts_accept(s);
    status = choose(s, s->charts->tangent ? LEAVE : 1.0 + NEAR);
    *changed = memcmp(before, states, NX * sizeof *before) != 0;
    return status;
}

#endif
