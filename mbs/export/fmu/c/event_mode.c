#include "event_mode.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "calculated.h"
#include "finite.h"
#include "guard.h"
#include "internal_step.h"
#include "tree_state.h"

#define PASSES 4 /* iterations; near a contact at rest each reduces the distance to a quarter */

/* Time [s] whose rounding error is the shortest interval of two events. Events at shorter intervals
 * count as chattering. */
#define CHATTER_SPAN 1e3

/* 1 if an external integrator has charts and needs no other events: indicators stay positive. */
#ifndef MODEL_CHARTS_ALONE
#define MODEL_CHARTS_ALONE 0
#endif

#if NK > 0

/* Call an event function of the tree or of the states. */
#ifdef MODEL_TREE
#define CALL(tree, f) machine_call(m, (tree) ? mbs_tree_##f : mbs_##f)
#else
#define CALL(tree, f) machine_call(m, mbs_##f)
#endif

/* Set the arguments of an event function at the coordinates x. On the states the loops are closed
 * first. Returns 0, or nonzero if they cannot be closed. */
static int event_point(core_solver *s, const double *t, const double *x) {
    machine *m = s->machine;
    if (!solver_on_tree(s) && closure_solve(&m->loops, x, m->z)) return 1;
    machine_point(m, t, x, m->z);
    return 0;
}

/* Event indicators g (NK,). Nonzero on failure. */
static int indicators(void *user, double t, const double *x, double *g) {
    core_solver *s = user;
    machine *m = s->machine;
    if (event_point(s, &t, x)) return 1;
    m->res[0] = g;
    return CALL(solver_on_tree(s), indicators);
}

/* Rates of the indicators along the motion. Call it right after `indicators` at the same x, which
 * computes the dependent coordinates. */
static int indicator_rates(void *user, double t, const double *x, double *rise) {
    core_solver *s = user;
    machine *m = s->machine;
    double du[NU + 1];
    machine_point(m, &t, x, m->z);
    machine_input_rates(m, t, du);
    m->arg[5] = du;
    m->res[0] = rise;
    return CALL(solver_on_tree(s), rates);
}

#ifdef MODEL_APPROACHES
/* Bounds of the indicators between samples, see events.h. */
static int approaches(void *user, double t, const double *x, double *near) {
    core_solver *s = user;
    machine *m = s->machine;
    if (event_point(s, &t, x)) return 1;
    m->res[0] = near;
    return CALL(solver_on_tree(s), approaches);
}
#define APPROACHES approaches
#else
#define APPROACHES NULL
#endif

/* Coordinates and modes after the jump of the indicators `fired`. Nonzero on failure. */
static int jump(void *user, double t, double *x, const double *fired) {
    core_solver *s = user;
    machine *m = s->machine;
    double next[N_INTEGRATED + 1], modes[NM + 1];
    if (event_point(s, &t, x)) return 1;
    m->arg[5] = fired;
    m->res[0] = next;
    m->res[1] = modes;
    if (CALL(solver_on_tree(s), jump) || !all_finite(modes, NM)) return 1;
    memcpy(x, next, (size_t)s->stepper.n * sizeof *x);
    memcpy(m->values + MODES, modes, NM * sizeof *modes);
    return 0;
}

void event_mode_init(core_events *e, core_solver *s, core_event_memory *memory) {
    static const events_model model = {indicators, indicator_rates, jump, APPROACHES};
    e->solver = s;
    e->memory = memory;
    events_init(&e->detection, &s->stepper, NK, &model, memory->detection, e->work);
}

/* Prepare the solver for events. With an external integrator it holds only the present time. */
static void synchronize(core_solver *s) {
    solver_prepare(s);
    if (s->machine->run->cosimulation) return;
    solver_take_coordinates(s, solver_on_tree(s));
    stepper_start(&s->stepper, s->machine->run->time);
}

/* Set the offsets of indicators that cannot fire yet. */
static void set_offsets(core_events *e) {
    const double *armed = events_armed(&e->detection), *value = events_seen(&e->detection);
    double tolerance = e->solver->memory->tolerance;
    int k;
    for (k = 0; k < NK; k++)
        e->memory->offset[k] = armed[k] > 0.0 ? 0.0 : 2.0 * fmax(tolerance, -value[k]);
}

core_status event_mode_start(core_events *e) {
    core_solver *s = e->solver;
    int status, external = !s->machine->run->cosimulation;
    if (MODEL_CHARTS_ALONE && external) return CORE_OK;
    synchronize(s);
    status = events_start(&e->detection, solver_coordinates(s));
    if (external) solver_take_coordinates(s, 1);
    if (status) return internal_step_failed(e, status);
    if (external) set_offsets(e);
    return CORE_OK;
}

/* Find the events that are due in the present state. Returns a status of events.h. */
static int find_events(core_events *e) {
    core_solver *s = e->solver;
    synchronize(s);
    if (s->machine->run->cosimulation || event_is_pending(e))
        return events_look(&e->detection, solver_coordinates(s));
    return events_found(&e->detection, solver_coordinates(s), e->memory->offset);
}

#if MODEL_TREE_OUTSIDE
/* Move the state back to the time when the first pending indicator was zero. An external integrator
 * locates events slightly late; without this step, successive bounces in tangent coordinates would
 * move further and further beyond a limit. */
static core_status move_back(core_events *e) {
    core_solver *s = e->solver;
    core_tree *tree = s->tree;
    double value[NK], rise[NK], X[NT], slope[NT], t = s->machine->run->time;
    int pass, k, first = -1;
    if (indicators(s, t, tree->X, value)) return internal_step_failed(e, EVENTS_INDICATORS_FAILED);
    for (pass = 0; pass < PASSES; pass++) {
        double back = 0.0, beyond;
        if (indicator_rates(s, t, tree->X, rise))
            return internal_step_failed(e, EVENTS_INDICATORS_FAILED);
        for (k = 0; k < NK; k++)
            if (events_due(&e->detection)[k] > 0.0 && value[k] < 0.0 && rise[k] < 0.0 &&
                value[k] / rise[k] > back)
                back = value[k] / rise[k], first = k;
        if (!(back > 0.0)) break;
        beyond = -value[first];
        memcpy(X, tree->X, sizeof X);
        memcpy(slope, tree->slope, sizeof slope);
        do { /* halve the step back if it ends before the approach, or too far before the limit */
            memcpy(tree->X, X, sizeof X);
            memcpy(tree->slope, slope, sizeof slope);
            tree_back(tree, back);
            if (indicators(s, t, tree->X, value) || indicator_rates(s, t, tree->X, rise))
                return internal_step_failed(e, EVENTS_INDICATORS_FAILED);
            back *= 0.5;
        } while (value[first] > beyond || rise[first] >= 0.0);
    }
    events_overshoot(&e->detection, value);
    return CORE_OK;
}
#endif

/* Make the jumps that are due at the present coordinates. */
static core_status iterate(core_events *e, int *changed) {
    core_solver *s = e->solver;
    machine *m = s->machine;
    double *x = solver_coordinates(s), before[N_INTEGRATED + 1];
    core_status status = internal_step_project(e);
    size_t size;
    int found;
    if (status) return status;
    found = find_events(e);
    if (found) return internal_step_failed(e, found);
    if (!event_is_pending(e)) return CORE_OK;
#if MODEL_TREE_OUTSIDE
    if (!m->run->cosimulation && solver_on_tree(s)) status = move_back(e);
    if (status) return status;
#endif
    size = (size_t)s->stepper.n * sizeof *x;
    memcpy(before, x, size);
    solver_leave_start(s);
#ifdef MODEL_TREE
    if (solver_on_tree(s)) passage_forget(s->passage); /* new modes, new chart */
#endif
    found = events_settle(&e->detection, x, fmax(m->run->time, CHATTER_SPAN));
    m->variables->stale = 1;
    if (found != EVENTS_FIRED) return internal_step_failed(e, found);
    if (memcmp(before, x, size)) *changed = 1;
    if (!m->run->cosimulation) set_offsets(e);
    guard_forget(m);
    return internal_step_accept(s, 0);
}

core_status event_mode_iterate(core_events *e, int *changed) {
    core_status status = iterate(e, changed);
    /* the solver keeps the coordinates of the tree between events */
    if (!e->solver->machine->run->cosimulation) solver_take_coordinates(e->solver, 1);
    return status;
}

core_status event_mode_show_indicators(core_events *e) {
    core_solver *s = e->solver;
    machine *m = s->machine;
    double *shown = m->values + INDICATORS;
    core_status status = calculate(s);
    int k, tree = solver_on_tree(s) && !(m->run->mode & STARTING);
    if (status) return status;
    if (MODEL_CHARTS_ALONE && !m->run->cosimulation) {
        for (k = 0; k < NK; k++) shown[k] = 1.0;
        return CORE_OK;
    }
    machine_point(m, &m->run->time, tree ? solver_coordinates(s) : m->values + STATES,
                  m->values + DEPENDENTS);
    m->res[0] = shown;
    if (CALL(tree, indicators))
        return log_failed(m->log, "the event indicators have no value at time %.9g (%s)",
                          m->run->time, log_where(m->log));
    for (k = 0; k < NK; k++) {
        shown[k] += e->memory->offset[k];
        if (shown[k] == 0.0) shown[k] = -DBL_MIN;
        if (!isfinite(shown[k]))
            return log_failed(m->log, "%s is not finite at time %.9g (%s)",
                              MODEL_NAMES[INDICATORS + k], m->run->time, log_where(m->log));
    }
    return CORE_OK;
}

core_status event_mode_arm_indicators(core_events *e) {
    const double *shown = e->solver->machine->values + INDICATORS;
    core_status status = event_mode_show_indicators(e);
    double *offset = e->memory->offset;
    int k;
    for (k = 0; k < NK && !status; k++)
        if (shown[k] - offset[k] > e->solver->memory->tolerance) offset[k] = 0.0;
    return status;
}

#else

void event_mode_init(core_events *e, core_solver *s) { e->solver = s; }

core_status event_mode_start(core_events *e) {
    (void)e;
    return CORE_OK;
}

core_status event_mode_iterate(core_events *e, int *changed) {
    (void)e, (void)changed;
    return CORE_OK;
}

core_status event_mode_show_indicators(core_events *e) { return calculate(e->solver); }

core_status event_mode_arm_indicators(core_events *e) { return calculate(e->solver); }

#endif
