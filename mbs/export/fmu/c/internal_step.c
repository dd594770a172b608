#include "internal_step.h"

#include <math.h>

#include "configuration.h"
#include "guard.h"
#include "message.h"
#include "tree_state.h"

/* Whether z belongs to the end of the step: the last evaluation is at the end, unless events are
 * located after the step or an implicit method has other stages. */
#if NK > 0 || defined MODEL_RODAS
#define ENDS_AT_HAND 0
#else
#define ENDS_AT_HAND 1
#endif

/* Copy the last accepted state of the tree to the states, for messages. */
static void show_state(core_solver *s) {
#ifdef MODEL_TREE
    if (solver_on_tree(s)) tree_show(s);
#else
    (void)s;
#endif
}

core_status internal_step_failed(core_events *e, int status) {
    static const char *const reason[] = {
        "",
        "",
        "too many steps",
        "the step size became too small",
        "the loops cannot be closed or the equations have no solution (unclosable or singular "
        "configuration)",
        "the projection failed",
        "a derivative is not finite (singular configuration?)",
        "a singular configuration is not passed",
        "a singular configuration is not passed",
        "branches of motion come near each other and do not meet, by too little to distinguish "
        "what reverses from what goes on; make them meet, miss by more, or ask for a looser "
        "tolerance",
        "a singular configuration is not passed",
        "it starts in a singular configuration, and its velocities choose no branch of motion",
        "an event indicator has no value (unclosable or singular configuration)",
        "a jump has no solution",
        "its jumps do not come to an end",
        "chattering, events follow each other and time stands still"};
    const char *why = status < (int)(sizeof reason / sizeof *reason) ? reason[status] : "";
    core_solver *s = e->solver;
    core_log *l = s->machine->log;
    double t = s->machine->run->time;
#if NK > 0
    char names[512];
    message m;
    int k;
    message_begin(&m, names, sizeof names);
    for (k = 0; k < NK && status >= EVENTS_JUMP_FAILED; k++)
        if (events_fired(&e->detection)[k] > 0.0) {
            message_text(&m, m.length ? ", " : "; it concerns ");
            message_text(&m, MODEL_INDICATORS[k]);
        }
    show_state(s);
    if (status >= EVENTS_JUMP_FAILED)
        return log_failed(l, "the event at time %.9g (%s) cannot be handled: %s%s", t, log_where(l),
                          why, names);
#endif
    show_state(s);
    return log_failed(l, "integration stopped at time %.9g (%s) with step %.3g: %s", t,
                      log_where(l), stepper_wanted_step(&s->stepper), why);
}

core_status internal_step_project(core_events *e) {
#ifdef MODEL_TREE
    core_solver *s = e->solver;
    const core_run *run = s->machine->run;
    if (!solver_on_tree(s) || !s->tree->loose || !run->cosimulation) return CORE_OK;
    passage_forget(s->passage);
    if (solver_project_tree(s, run->time, s->tree->X))
        return internal_step_failed(e, STEPPER_PROJECTION_FAILED);
    s->tree->loose = 0;
#else
    (void)e;
#endif
    return CORE_OK;
}

void internal_step_restart(core_events *e) {
    stepper_restart(&e->solver->stepper);
#if NK > 0
    events_restart(&e->detection);
#endif
#ifdef MODEL_TREE
    e->solver->tree->loose = 1;
#endif
    guard_forget(e->solver->machine);
}

core_status internal_step_accept(core_solver *s, int at_hand) {
    machine *m = s->machine;
#ifdef MODEL_TREE
    if (solver_on_tree(s)) {
        tree_show(s);
        return CORE_OK;
    }
#endif
    return at_hand ? configuration_accept(m, m->values + STATES, m->z)
                   : configuration_accept_states(m);
}

core_status internal_step(core_events *e, double limit) {
    core_solver *s = e->solver;
    machine *m = s->machine;
    double *x = solver_coordinates(s);
    core_status status = internal_step_project(e);
    int stopped;
    solver_leave_start(s);
    if (!status && !solver_on_tree(s) && !m->accepted->watched.on) status = guard_restart(m);
    if (status) return status;
#if NK > 0
    e->detection.near_at = NAN; /* the state may have changed */
    stopped = events_step(&e->detection, x, limit);
#else
    stopped = stepper_step(&s->stepper, x, limit);
#endif
    m->run->time = stepper_time(&s->stepper);
    m->variables->stale = 1;
    status = stopped ? internal_step_failed(e, stopped) : internal_step_accept(s, ENDS_AT_HAND);
    return status || solver_on_tree(s) ? status : guard_pass(m);
}
