/* Events: modes, jumps, and event indicators for an external integrator.
 *
 * After a jump, or at rest on a contact, an indicator is near zero. The external integrator then
 * gets it with an offset, which exceeds the magnitude of its negative values. So no sign changes
 * until the indicator is clearly positive or decreases again. Its value is never exactly zero.
 */
#include "internal.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "charts.h"
#include "closure.h"
#include "guard.h"
#include "message.h"

#define PASSES 4 /* iterations; near a contact at rest each reduces the distance to a quarter */

/* Time [s] whose rounding error is the shortest interval of two events. Events at shorter intervals
 * count as chattering. */
#define CHATTER_SPAN 1e3

/* Whether z belongs to the end of the step: the last evaluation is at the end, unless events are
 * located after the step or an implicit method has other stages. */
#if NK > 0 || defined MODEL_RODAS
#define ENDS_AT_HAND 0
#else
#define ENDS_AT_HAND 1
#endif

/* Whether events are evaluated on the state of the tree, else on the states of the joints. */
#if MODEL_TREE_OUTSIDE
#define EVENTS_ON_TREE(c) ((c)->m.cosimulation ? MODEL_TREE_INSIDE : (c)->m.charts.tangent)
#define TAKE_STATES(c, tree) core_take_states(c, tree)
#else
#define EVENTS_ON_TREE(c) ON_TREE(c)
#define TAKE_STATES(c, tree) ((void)0)
#endif

#ifdef MODEL_TREE
#define SHOW_TREE(c) (EVENTS_ON_TREE(c) ? core_show_tree(c) : (void)0)
#define LEAVE_START(c) ((c)->m.singular = 0)
#else
#define LEAVE_START(c) ((void)0)
#define SHOW_TREE(c) ((void)0)
#endif

static core_status step_failed(core *c, int status) {
    static const char *const reason[] = {
        "", "", "too many steps", "the step size became too small",
        "the loops cannot be closed or the equations have no solution (unclosable or singular "
        "configuration)", "the projection failed", "a derivative is not finite (singular configuration?)",
        "a singular configuration is not passed", "a singular configuration is not passed",
        "branches of motion come near each other and do not meet, by too little to distinguish "
        "what reverses from what goes on; make them meet, miss by more, or ask for a looser tolerance",
        "a singular configuration is not passed",
        "it starts in a singular configuration, and its velocities choose no branch of motion",
        "an event indicator has no value (unclosable or singular configuration)",
        "a jump has no solution", "its jumps do not come to an end",
        "chattering, events follow each other and time stands still"};
    const char *why = status < (int)(sizeof reason / sizeof *reason) ? reason[status] : "";
#if NK > 0
    char names[512];
    message m;
    int k;
    message_begin(&m, names, sizeof names);
    for (k = 0; k < NK && status >= EVENTS_JUMP_FAILED; k++)
        if (events_fired(&c->events)[k] > 0.0) {
            message_text(&m, m.length ? ", " : "; it concerns ");
            message_text(&m, MODEL_INDICATORS[k]);
        }
    SHOW_TREE(c);
    if (status >= EVENTS_JUMP_FAILED)
        return core_no_answer(c, "%s: the event at time %.9g (%s) cannot be handled: %s%s", c->name,
                              c->m.time, core_where(c), why, names);
#endif
    SHOW_TREE(c); /* the last state that was accepted */
    return core_no_answer(c, "%s: integration stopped at time %.9g (%s) with step %.3g: %s", c->name,
                          c->m.time, core_where(c), stepper_wanted_step(&c->solver), why);
}

/* Coordinates that are integrated: those of the tree, or the states. */
static double *moving(core *c) {
#ifdef MODEL_TREE
    if (EVENTS_ON_TREE(c)) return c->m.tree;
#endif
    return c->m.values + STATES;
}

/* Project the tree onto its closure rows after data of the rows have changed. The chart of the last
 * step is discarded. */
static core_status tighten(core *c) {
#ifdef MODEL_TREE
    if (!EVENTS_ON_TREE(c) || !c->m.loose || !c->m.cosimulation) return CORE_OK;
    passage_forget(c->passage);
    if (c->solver.project(c, c->m.time, c->m.tree))
        return step_failed(c, STEPPER_PROJECTION_FAILED);
    c->m.loose = 0;
#else
    (void)c;
#endif
    return CORE_OK;
}

void core_restart(core *c) {
    stepper_restart(&c->solver);
#if NK > 0
    events_restart(&c->events);
#endif
#ifdef MODEL_TREE
    c->m.loose = 1;
#endif
    guard_forget(c);
}

/* Update the accepted configuration after a step or jump. at_hand: 1 if c->z is up to date. */
static core_status accept(core *c, int at_hand) {
#ifdef MODEL_TREE
    if (EVENTS_ON_TREE(c)) {
        core_show_tree(c);
        return CORE_OK;
    }
#endif
    return at_hand ? core_accept_configuration(c, c->m.values + STATES, c->z) : core_accept_states(c);
}

core_status core_step(core *c, double limit) {
    double *x = moving(c);
    core_status status = tighten(c);
    int stopped;
    LEAVE_START(c);
    if (!status && !EVENTS_ON_TREE(c) && !c->m.watched.on) status = guard_restart(c);
    if (status) return status;
#if NK > 0
    c->events.near_at = NAN; /* the state may have changed */
    stopped = events_step(&c->events, x, limit);
#else
    stopped = stepper_step(&c->solver, x, limit);
#endif
    c->m.time = stepper_time(&c->solver);
    c->m.stale = 1;
    status = stopped ? step_failed(c, stopped) : accept(c, ENDS_AT_HAND);
    return status || EVENTS_ON_TREE(c) ? status : guard_pass(c);
}

#if NK > 0

#ifdef MODEL_TREE
#define CALL(tree, f) ((tree) ? mbs_tree_##f : mbs_##f)(c->arg, c->res, c->iw, c->w, 0)
#else
#define CALL(tree, f) mbs_##f(c->arg, c->res, c->iw, c->w, 0)
#endif

/* Set the arguments of an event function at x. On the joint states the loops are closed first. */
static int place(core *c, const double *t, const double *x) {
    if (!EVENTS_ON_TREE(c) && closure_solve(&c->loops, x, c->z)) return 1;
    core_point(c, t, x, c->z);
    return 0;
}

static int indicators(void *user, double t, const double *x, double *g) {
    core *c = user;
    if (place(c, &t, x)) return 1;
    c->res[0] = g;
    return CALL(EVENTS_ON_TREE(c), indicators);
}

/* Rates of the indicators along the motion. Call it right after `indicators` at the same x, which
 * computes the dependent coordinates. */
static int rates(void *user, double t, const double *x, double *rise) {
    core *c = user;
    double du[NU + 1];
    core_point(c, &t, x, c->z);
    core_input_rates(c, t, du);
    c->arg[5] = du;
    c->res[0] = rise;
    return CALL(EVENTS_ON_TREE(c), rates);
}

/* 1 if an external integrator has charts and needs no other events: indicators stay positive. */
#ifndef MODEL_CHARTS_ALONE
#define MODEL_CHARTS_ALONE 0
#endif

#ifdef MODEL_APPROACHES
static int approaches(void *user, double t, const double *x, double *near) {
    core *c = user;
    if (place(c, &t, x)) return 1;
    c->res[0] = near;
    return CALL(EVENTS_ON_TREE(c), approaches);
}
#define APPROACHES approaches
#else
#define APPROACHES NULL
#endif

static int jump(void *user, double t, double *x, const double *fired) {
    core *c = user;
    double next[MOST(NX, NT) + 1], modes[NM + 1];
    if (place(c, &t, x)) return 1;
    c->arg[5] = fired;
    c->res[0] = next;
    c->res[1] = modes;
    if (CALL(EVENTS_ON_TREE(c), jump) || !stepper_all_finite(modes, NM)) return 1;
    memcpy(x, next, (size_t)c->solver.n * sizeof *x);
    memcpy(c->m.values + MODES, modes, NM * sizeof *modes);
    return 0;
}

void core_init_events(core *c) {
    static const events_model model = {indicators, rates, jump, APPROACHES};
    events_init(&c->events, &c->solver, NK, &model, c->m.events, c->event_work);
}

core_status core_first_modes(core *c) {
    double beyond[NK], modes[NM + 1];
    int k;
    core_point(c, &c->m.time, c->m.values + STATES, c->z);
    c->res[0] = modes;
    c->res[1] = beyond;
    if (mbs_first(c->arg, c->res, c->iw, c->w, 0) || !stepper_all_finite(modes, NM) ||
        !stepper_all_finite(beyond, NK))
        return core_no_answer(c, "%s: the first modes have no value at time %.9g", c->name,
                              c->m.time);
    memcpy(c->m.values + MODES, modes, NM * sizeof *modes);
    for (k = 0; k < NK; k++)
        if (beyond[k] > 0.0)
            return core_no_answer(c, "%s: the start values lie beyond %s by %.3g; start inside",
                                  c->name, MODEL_INDICATORS[k], beyond[k]);
    return CORE_OK;
}

/* Prepare the solver for events. With an external integrator it holds only the present time. */
static void synchronize(core *c) {
    core_prepare_solver(c);
    if (c->m.cosimulation) return;
    TAKE_STATES(c, EVENTS_ON_TREE(c));
    stepper_start(&c->solver, c->m.time);
}

/* Set the offsets of indicators that cannot fire yet. */
static void set_offsets(core *c) {
    const double *armed = events_armed(&c->events), *value = events_seen(&c->events);
    int k;
    for (k = 0; k < NK; k++)
        c->m.offset[k] = armed[k] > 0.0 ? 0.0 : 2.0 * fmax(c->m.tolerance, -value[k]);
}

core_status core_start_events(core *c) {
    int status;
    if (MODEL_CHARTS_ALONE && !c->m.cosimulation) return CORE_OK;
    synchronize(c);
    status = events_start(&c->events, moving(c));
    if (!c->m.cosimulation) TAKE_STATES(c, 1);
    if (status) return step_failed(c, status);
    if (!c->m.cosimulation) set_offsets(c);
    return CORE_OK;
}

int core_pending(const core *c) { return events_pending(&c->events); }

/* Find the events that are due in the present state. */
static int find(core *c) {
    synchronize(c);
    if (c->m.cosimulation || core_pending(c)) return events_look(&c->events, moving(c));
    return events_found(&c->events, moving(c), c->m.offset);
}

#if MODEL_TREE_OUTSIDE
/* Move the state back to the time when the first pending indicator was zero. An external integrator
 * locates events slightly late; without this step, successive bounces in tangent coordinates would
 * move further and further beyond a limit. */
static core_status go_back(core *c) {
    double value[NK], rise[NK], X[NT], slope[NT];
    int pass, k, first = -1;
    if (indicators(c, c->m.time, c->m.tree, value)) return step_failed(c, EVENTS_INDICATORS_FAILED);
    for (pass = 0; pass < PASSES; pass++) {
        double back = 0.0, beyond;
        if (rates(c, c->m.time, c->m.tree, rise)) return step_failed(c, EVENTS_INDICATORS_FAILED);
        for (k = 0; k < NK; k++)
            if (events_due(&c->events)[k] > 0.0 && value[k] < 0.0 && rise[k] < 0.0 &&
                value[k] / rise[k] > back)
                back = value[k] / rise[k], first = k;
        if (!(back > 0.0)) break;
        beyond = -value[first];
        memcpy(X, c->m.tree, sizeof X);
        memcpy(slope, c->m.slope, sizeof slope);
        do { /* halve the step back if it ends before the approach, or too far before the limit */
            memcpy(c->m.tree, X, sizeof X);
            memcpy(c->m.slope, slope, sizeof slope);
            charts_back(c, back);
            if (indicators(c, c->m.time, c->m.tree, value) || rates(c, c->m.time, c->m.tree, rise))
                return step_failed(c, EVENTS_INDICATORS_FAILED);
            back *= 0.5;
        } while (value[first] > beyond || rise[first] >= 0.0);
    }
    events_overshoot(&c->events, value);
    return CORE_OK;
}
#endif

static core_status settle(core *c, int *changed) {
    double *x = moving(c), before[MOST(NX, NT) + 1];
    size_t size;
    int status = tighten(c);
    if (status) return status;
    status = find(c);
    if (status) return step_failed(c, status);
    if (!core_pending(c)) return CORE_OK;
#if MODEL_TREE_OUTSIDE
    if (!c->m.cosimulation && EVENTS_ON_TREE(c)) status = (int)go_back(c);
    if (status) return (core_status)status;
#endif
    size = (size_t)c->solver.n * sizeof *x;
    memcpy(before, x, size);
    LEAVE_START(c);
#ifdef MODEL_TREE
    if (EVENTS_ON_TREE(c)) passage_forget(c->passage); /* new modes, new chart */
#endif
    status = events_settle(&c->events, x, fmax(c->m.time, CHATTER_SPAN));
    c->m.stale = 1;
    if (status != EVENTS_FIRED) return step_failed(c, status);
    if (memcmp(before, x, size)) *changed = 1;
    if (!c->m.cosimulation) set_offsets(c);
    guard_forget(c);
    return accept(c, 0);
}

core_status core_settle(core *c, int *changed) {
    core_status status = settle(c, changed);
    if (!c->m.cosimulation) TAKE_STATES(c, 1); /* the solver keeps the tree as state */
    return status;
}

core_status core_show_indicators(core *c) {
    double *shown = c->m.values + INDICATORS;
    core_status status = core_refresh(c);
    int k, tree = EVENTS_ON_TREE(c) && !(c->m.mode & (INSTANTIATED | INITIALIZATION));
    if (status) return status;
    if (MODEL_CHARTS_ALONE && !c->m.cosimulation) {
        for (k = 0; k < NK; k++) shown[k] = 1.0;
        return CORE_OK;
    }
    core_point(c, &c->m.time, tree ? moving(c) : c->m.values + STATES, c->m.values + DEPENDENTS);
    c->res[0] = shown;
    if (CALL(tree, indicators))
        return core_no_answer(c, "%s: the event indicators have no value at time %.9g (%s)", c->name,
                              c->m.time, core_where(c));
    for (k = 0; k < NK; k++) {
        shown[k] += c->m.offset[k];
        if (shown[k] == 0.0) shown[k] = -DBL_MIN;
        if (!isfinite(shown[k]))
            return core_no_answer(c, "%s: %s is not finite at time %.9g (%s)", c->name,
                                  MODEL_NAMES[INDICATORS + k], c->m.time, core_where(c));
    }
    return CORE_OK;
}

core_status core_arm_indicators(core *c) {
    core_status status = core_show_indicators(c);
    int k;
    for (k = 0; k < NK && !status; k++)
        if (c->m.values[INDICATORS + k] - c->m.offset[k] > c->m.tolerance) c->m.offset[k] = 0.0;
    return status;
}

#else

void core_init_events(core *c) { (void)c; }

core_status core_first_modes(core *c) {
    (void)c;
    return CORE_OK;
}

core_status core_start_events(core *c) {
    (void)c;
    return CORE_OK;
}

int core_pending(const core *c) {
    (void)c;
    return 0;
}

core_status core_settle(core *c, int *changed) {
    (void)c, (void)changed;
    return CORE_OK;
}

core_status core_show_indicators(core *c) { return core_refresh(c); }

core_status core_arm_indicators(core *c) { return core_refresh(c); }

#endif
