#include "internal.h"

#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "charts.h"
#include "closure.h"
#include "guard.h"
#include "message.h"

#ifdef MODEL_TREE
#define IN_SINGULAR_START(c) ((c)->m.singular)
#else
#define IN_SINGULAR_START(c) 0
#endif

static const char *const CATEGORIES[] = {"logAll", "logStatusDiscard", "logStatusError"};
enum { LOG_ALL, LOG_DISCARD, LOG_ERROR, N_CATEGORIES };

const char *core_category(core_status status) {
    return CATEGORIES[status == CORE_DISCARD ? LOG_DISCARD : LOG_ERROR];
}

core_status core_set_logging(core *c, int on, const char *const *categories, size_t n) {
    size_t i;
    int discards = n == 0;
    for (i = 0; i < n; i++) {
        int k = 0;
        while (k < N_CATEGORIES &&
               !(categories && categories[i] && !strcmp(categories[i], CATEGORIES[k])))
            k++;
        if (k == N_CATEGORIES)
            return core_refuse(c, "%s: log category %u is unknown", c->name, (unsigned)i);
        discards = discards || k != LOG_ERROR;
    }
    c->discards = on && discards;
    return CORE_OK;
}

static core_status say(core *c, core_status status, const char *format, va_list args) {
    message m;
    if (!c->log || (status == CORE_DISCARD && !c->discards)) return status;
    message_begin(&m, c->text, sizeof c->text);
    message_format(&m, format, args);
    c->log(c->host, c->name, status, c->text);
    return status;
}

core_status core_refuse(core *c, const char *format, ...) {
    core_status status;
    va_list args;
    va_start(args, format);
    status = say(c, CORE_ERROR, format, args);
    va_end(args);
    return status;
}

/* Failed evaluation. An external integrator may try a shorter step. A co-simulation master can only
 * return to a saved state, and some masters repeat a discarded step forever: it gets an error. */
core_status core_no_answer(core *c, const char *format, ...) {
    core_status status = c->m.mode & CONTINUOUS ? CORE_DISCARD : CORE_ERROR;
    va_list args;
    va_start(args, format);
    status = say(c, status, format, args);
    va_end(args);
    return status;
}

const char *core_mode_name(int mode) {
    switch (mode) {
        case INSTANTIATED: return "before initialization";
        case INITIALIZATION: return "in initialization mode";
        case EVENT: return "in event mode";
        case CONTINUOUS: return "in continuous-time mode";
        case STEP: return "between steps";
        case INTERMEDIATE: return "during an intermediate update";
        default: return "after termination";
    }
}

int core_allowed(core *c, int modes, const char *action) {
    if (c->m.mode & modes) return 1;
    core_refuse(c, "%s: %s is not possible %s", c->name, action, core_mode_name(c->m.mode));
    return 0;
}

const char *core_where(core *c) {
    message m;
    int i;
    message_begin(&m, c->where, sizeof c->where);
    for (i = 0; i < NX; i++) {
        message_text(&m, i ? ", " : "");
        message_text(&m, MODEL_NAMES[STATES + i]);
        message_text(&m, " = ");
        message_number(&m, c->m.values[STATES + i], 6);
    }
    return c->where;
}

core_status core_before_stop(core *c, double time) {
    if (time <= c->m.stop + SAME_TIME * fmax(1.0, fabs(c->m.stop))) return CORE_OK;
    return core_refuse(c, "%s: time %.12g lies past the stop time %.12g of the experiment; end there "
                       "or set up a later one", c->name, time, c->m.stop);
}

void core_point(core *c, const double *t, const double *x, const double *z) {
    c->arg[0] = t;
    c->arg[1] = x;
    c->arg[2] = z;
    c->arg[3] = core_inputs(c, *t);
    c->arg[4] = c->m.values + PARAMETERS;
}

int core_call_rhs(core *c, double t, const double *x, const double *z, double *xdot, double *y) {
    core_point(c, &t, x, z);
    c->res[0] = xdot;
    c->res[1] = y;
    return mbs_rhs(c->arg, c->res, c->iw, c->w, 0);
}

static core_status closure_failed(core *c, int status) {
    if (status == CLOSURE_SINGULAR || status == CLOSURE_NEARLY)
        return core_no_answer(c, "%s: singular configuration at time %.9g (%s): the states do not determine "
                              "the dependent coordinates; start elsewhere or choose other states",
                              c->name, c->m.time, core_where(c));
    return core_no_answer(c, "%s: unclosable configuration at time %.9g (%s): no dependent coordinates near "
                          "the last ones close the loops; start elsewhere or move less",
                          c->name, c->m.time, core_where(c));
}

core_status core_accept_configuration(core *c, const double *x, const double *z) {
    if (closure_singular(&c->loops, x, z)) return closure_failed(c, CLOSURE_SINGULAR);
    memcpy(c->m.configuration_x, x, NX * sizeof *x);
    memcpy(c->m.configuration_z, z, NZ * sizeof *z);
    c->m.closed = 1;
    return CORE_OK;
}

core_status core_accept_states(core *c) {
    const double *x = c->m.values + STATES;
    int status = closure_solve(&c->loops, x, c->z);
    return status ? closure_failed(c, status) : core_accept_configuration(c, x, c->z);
}

/* Check that the calculated values are finite, and mark them as up to date. */
static core_status core_show(core *c) {
    double *v = c->m.values;
    int i;
#if NCUT > 0
    c->arg[0] = v + STATES;
    c->arg[1] = v + DEPENDENTS;
    c->arg[2] = v + PARAMETERS;
    c->res[0] = v + CUTS;
    if (mbs_cuts(c->arg, c->res, c->iw, c->w, 0))
        return core_no_answer(c, "%s: the cut joints have no positions at time %.9g", c->name,
                              c->m.time);
#endif
    for (i = 0; i < INDICATORS; i++) /* event indicators are checked when they are read */
        if (!isfinite(v[i]))
            return core_no_answer(c, "%s: %s is not finite at time %.9g; look for a singular "
                                  "configuration or a zero mass", c->name, MODEL_NAMES[i], c->m.time);
    c->m.stale = 0;
    return CORE_OK;
}

/* The same check if the joint coordinates are the states for the external integrator. */
static core_status show_joints(core *c) {
    double *v = c->m.values;
    memcpy(v + SLOTS, v + STATES, NS * sizeof *v);
    memcpy(v + RATES, v + DERIVATIVES, NS * sizeof *v);
    return core_show(c);
}

#ifdef MODEL_TREE
/* Compute all values at a start in a singular configuration. The accelerations belong to the
 * branch of the start velocities and come from configurations on both sides. */
static core_status show_start(core *c) {
    double none[NT], *v = c->m.values;
    int i;
    core_show_tree(c);
    if (passage_slope(c->passage, c->m.time, c->m.tree, c->m.slope, NULL) ||
        core_call_tree(c, c->m.tree, none, v + OUTPUTS))
        return core_no_answer(c, "%s: the equations have no solution at time %.9g", c->name,
                              c->m.time);
    core_show_slope(c->m.slope, v + OUTPUTS);
    for (i = 0; i < NX; i++) v[DERIVATIVES + i] = c->m.slope[MODEL_TREE_STATES[i]];
    return CORE_OK;
}
#endif

core_status core_refresh(core *c) {
    double *v = c->m.values, *x = v + STATES;
    int status;
    if (!c->m.stale) return CORE_OK;
#ifdef MODEL_TREE
    if (ON_TREE(c) && !(c->m.mode & (INSTANTIATED | INITIALIZATION))) {
        double slope[NT];
        int i;
        if (c->m.singular) {
            core_status found = show_start(c);
            return found ? found : show_joints(c);
        }
#if MODEL_TREE_OUTSIDE
        if (!c->m.cosimulation) {
            core_status found = charts_refresh(c);
            return found ? found : core_show(c);
        }
#endif
        core_show_tree(c);
        if (core_call_tree(c, c->m.tree, slope, v + OUTPUTS))
            return core_no_answer(c, "%s: the equations have no solution at time %.9g", c->name,
                                  c->m.time);
        for (i = 0; i < NX; i++) v[DERIVATIVES + i] = slope[MODEL_TREE_STATES[i]];
        return show_joints(c);
    }
#endif
    status = c->m.closed ? closure_solve(&c->loops, x, c->z) : closure_start(&c->loops, x, c->z);
#ifdef MODEL_TREE
    c->m.singular = 0;
    if (ON_TREE(c) && (status == CLOSURE_NEARLY || (!status && core_starts_singular(c, c->z)))) {
        status = (int)core_start_singular(c, c->z);
        if (!status) status = (int)show_start(c);
        return status ? (core_status)status : show_joints(c);
    }
#endif
    if (status) return closure_failed(c, status);
    if (c->m.mode == INITIALIZATION && core_first_modes(c)) return CORE_ERROR;
    if (core_call_rhs(c, c->m.time, x, c->z, v + DERIVATIVES, v + OUTPUTS))
        return core_no_answer(c, "%s: the equations have no solution at time %.9g", c->name,
                              c->m.time);
    memcpy(v + DEPENDENTS, c->z, NZ * sizeof *v);
    return show_joints(c);
}

static void to_start(core *c) {
    int cosimulation = c->m.cosimulation;
    memset(&c->m, 0, sizeof c->m);
    c->m.cosimulation = cosimulation;
    c->m.mode = INSTANTIATED;
    c->m.stale = 1;
    c->m.tolerance = MODEL_TOLERANCE;
    c->m.stop = HUGE_VAL;
    memcpy(c->m.values, MODEL_START, N_VALUES * sizeof *c->m.values);
    memcpy(c->m.guess, MODEL_START + DEPENDENTS, NZ * sizeof *c->m.guess);
    memcpy(c->m.cut, MODEL_START + CUTS, NCUT * sizeof *c->m.cut);
#ifdef MODEL_TREE
    memcpy(c->m.speeds, MODEL_START + OUTPUTS + PASSIVE_V, N_PASSIVE * sizeof *c->m.speeds);
#endif
}

static void init_loops(core *c) {
    loops l = {c->m.configuration_x, c->m.configuration_z, c->m.guess, c->m.cut,
               c->m.values + PARAMETERS, c->arg, c->res, c->iw, c->w};
    c->loops = l;
}

int core_init(core *c, const char *name, int cosimulation, core_logger log, void *host,
              core_supply supply) {
    memset(c, 0, sizeof *c);
    c->name = name;
    c->log = log;
    c->host = host;
    c->supply = supply;
    c->m.cosimulation = cosimulation;
    to_start(c);
    if (core_init_solver(c)) return 1;
    core_init_events(c);
    init_loops(c);
    return 0;
}

void core_end(core *c) {
#ifdef MODEL_TREE
    passage_free(c->passage);
#endif
    (void)c;
}

core_status core_setup(core *c, double tolerance, double start, double stop) {
    if (!core_allowed(c, INSTANTIATED, "setting up the experiment")) return CORE_ERROR;
    if (!isfinite(start)) return core_refuse(c, "%s: start time %g is not finite", c->name, start);
    if (!(stop >= start))
        return core_refuse(c, "%s: stop time %.12g lies before the start at %.12g; give a later one",
                           c->name, stop, start);
    if (!(tolerance > 0.0) || !isfinite(tolerance))
        return core_refuse(c, "%s: tolerance %g must be positive", c->name, tolerance);
    c->m.time = start;
    c->m.tolerance = tolerance;
    c->m.stop = stop;
    c->m.stale = 1;
    return CORE_OK;
}

core_status core_enter_initialization(core *c) {
    if (!core_allowed(c, INSTANTIATED, "entering initialization mode")) return CORE_ERROR;
    c->m.mode = INITIALIZATION;
    return CORE_OK;
}

/* Rules of the states hold from initialization on. Rules of parameters alone are checked again
 * later, because parameters may be set during a run. */
core_status core_check_rules(core *c) {
#ifdef MODEL_RULES
    double excess[MODEL_RULES];
    int i = c->m.mode == INITIALIZATION ? 0 : MODEL_RULES_AT_START;
    c->arg[0] = c->m.values + STATES;
    c->arg[1] = c->m.values + PARAMETERS;
    c->res[0] = excess;
    if (mbs_excess(c->arg, c->res, c->iw, c->w, 0)) excess[i] = NAN;
    for (; i < MODEL_RULES; i++)
        if (!(excess[i] <= 0.0)) return core_refuse(c, "%s: %s", c->name, MODEL_SENTENCES[i]);
#endif
    (void)c;
    return CORE_OK;
}

core_status core_exit_initialization(core *c) {
    core_status status;
    int changed;
    if (!core_allowed(c, INITIALIZATION, "leaving initialization mode")) return CORE_ERROR;
    if (core_check_rules(c)) return CORE_ERROR;
    status = core_refresh(c);
    if (status) return status;
    if (!IN_SINGULAR_START(c))
        status = core_accept_configuration(c, c->m.values + STATES, c->m.values + DEPENDENTS);
    if (status) return status;
    c->m.closed = 1;
    stepper_start(&c->solver, c->m.time);
#ifdef MODEL_TREE
    if (c->m.cosimulation && ON_TREE(c) && !c->m.singular) status = core_start_tree(c);
#endif
#if MODEL_TREE_OUTSIDE
    if (!status && !c->m.cosimulation) status = charts_start(c);
#endif
    if (!status) status = core_start_events(c);
    if (!status && !ON_TREE(c)) status = guard_restart(c);
    if (status) return status;
    if (!c->m.cosimulation || c->event_mode) {
        c->m.mode = EVENT;
        return CORE_OK;
    }
    status = core_settle(c, &changed);
    if (!status) c->m.mode = STEP;
    return status;
}

core_status core_terminate(core *c) {
    if (!core_allowed(c, RUNNING, "termination")) return CORE_ERROR;
    c->m.mode = TERMINATED;
    return CORE_OK;
}

core_status core_reset(core *c) {
    if (!core_allowed(c, ~INTERMEDIATE, "a reset")) return CORE_ERROR;
    to_start(c);
    return CORE_OK;
}
