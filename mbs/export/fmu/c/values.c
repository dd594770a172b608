/* Values by value reference. Modes are integers, all other variables are real. Modes can also be
 * read as real numbers, for importers without integers such as CasADi. */
#include <float.h>
#include <limits.h>
#include <math.h>
#include <string.h>

#include "calculated.h"
#include "chart_choice.h"
#include "charts.h"
#include "core.h"
#include "event_mode.h"
#include "internal_step.h"

/* Error if a value reference does not exist. */
static core_status known_reference(core_log *l, core_reference ref) {
    if (ref < N_VALUES) return CORE_OK;
    return log_error(l, "value reference %u is unknown; the last one is %d", (unsigned)ref,
                     (int)N_VALUES - 1);
}

/* Whether first <= ref < end, for a kind of variables that may be empty. */
static int among(core_reference ref, core_reference first, core_reference end) {
    return ref - first < end - first;
}

static int is_mode(core_reference ref) { return among(ref, MODES, DEPENDENTS); }

/* Whether a value is stored and needs no calculation in a mode of the state machine. */
static int given(int mode, core_reference ref) {
    if (ref < DERIVATIVES) return !NS || (mode & STARTING) != 0;
    if (among(ref, INPUTS, OUTPUTS)) return 1;
    if (among(ref, CHART_STATES, CHART_RATES)) return !(mode & STARTING);
    return ref >= PARAMETERS && ref < (mode == INITIALIZATION ? MODES : DEPENDENTS);
}

/* Calculate the value of a reference, if it is not given. */
static core_status update(core *c, core_reference ref) {
    if (among(ref, INDICATORS, CHART_STATES)) return event_mode_show_indicators(&c->events);
#if MODEL_TREE_OUTSIDE
    if (ref == CHART_INDICATOR && !c->m.run.cosimulation)
        return chart_choice_show_indicator(&c->solver);
#endif
    return given(c->m.run.mode, ref) ? CORE_OK : calculate(&c->solver);
}

/* Inputs (NU,) at the present time. */
static const double *present_inputs(core *c) {
    return inputs_at(&c->m.inputs, c->m.variables.values + INPUTS, c->m.run.time, c->machine.u);
}

core_status core_get(core *c, const core_reference *ref, size_t n, double *values) {
    const double *v = c->m.variables.values;
    core_status status = CORE_OK;
    size_t i;
    if (!log_allowed(&c->log, READABLE, "getting values")) return CORE_ERROR;
    if (n && (!ref || !values)) return log_error(&c->log, "the array is NULL");
    for (i = 0; i < n && !status; i++) status = known_reference(&c->log, ref[i]);
    for (i = 0; i < n && !status; i++) {
        core_reference r = ref[i];
        status = update(c, r);
        values[i] = among(r, INPUTS, OUTPUTS) ? present_inputs(c)[r - INPUTS] : v[r];
    }
    return status;
}

core_status core_get_modes(core *c, const core_reference *ref, size_t n, core_integer *values) {
    core_status status = CORE_OK;
    size_t i;
    if (!log_allowed(&c->log, READABLE, "getting values")) return CORE_ERROR;
    if (n && (!ref || !values)) return log_error(&c->log, "the array is NULL");
    for (i = 0; i < n; i++)
        if (!is_mode(ref[i]))
            return log_error(&c->log, "value reference %u is no integer variable; those are modes",
                             (unsigned)ref[i]);
    for (i = 0; i < n && !status; i++) {
        double value;
        if (!given(c->m.run.mode, ref[i])) status = calculate(&c->solver);
        value = c->m.variables.values[ref[i]];
        if (value != floor(value) || fabs(value) > INT_MAX)
            return log_failed(&c->log,
                              "the mode %s is %g, which is no integer; let it count or name",
                              MODEL_NAMES[ref[i]], value);
        values[i] = (int)value;
    }
    return status;
}

/* Whether ref is the velocity of a dependent joint. Its start value selects a branch. */
static int is_speed(unsigned ref) {
#ifdef MODEL_TREE
    return among(ref, OUTPUTS + PASSIVE_V, OUTPUTS + PASSIVE_V + N_PASSIVE);
#else
    (void)ref;
    return 0;
#endif
}

/* Modes in which a variable may be set, 0 for a calculated variable. */
static int settable(int cosimulation, core_reference ref) {
    if (ref < DERIVATIVES && NS) return cosimulation ? STARTING : STARTING | EVENT;
    if (ref < DERIVATIVES || among(ref, CHART_STATES, CHART_RATES))
        return cosimulation ? STARTING : STARTING | EVENT | CONTINUOUS;
    if (ref < INPUTS) return 0;
    if (ref < OUTPUTS) return STARTING | RUNNING;
    if (is_speed(ref)) return STARTING;
    if (ref < PARAMETERS) return 0;
    if (ref < MODES) return MODEL_FIXED[ref] ? STARTING : STARTING | EVENT | STEP;
    return among(ref, DEPENDENTS, INDICATORS) || ref >= CUTS ? STARTING : 0;
}

/* Check the bounds of a parameter. The smallest normal number as lower bound means "positive". */
static core_status within_bounds(core_log *l, core_reference ref, double value) {
    double low = MODEL_MIN[ref], high = MODEL_MAX[ref];
    const char *name = MODEL_NAMES[ref];
    if (value >= low && value <= high) return CORE_OK;
    if (isfinite(low) && isfinite(high))
        return log_error(l, "parameter %s is %g; give a number from %g to %g", name, value, low,
                         high);
    if (value > high) return log_error(l, "parameter %s is %g; give %g or less", name, value, high);
    if (low == DBL_MIN) return log_error(l, "parameter %s is %g; give more than zero", name, value);
    return log_error(l, "parameter %s is %g; give %g or more", name, value, low);
}

/* Error if a variable cannot be set now, or not to this value. */
static core_status settable_value(core_log *l, core_reference ref, double value) {
    const core_run *run = l->run;
    const char *name;
    int modes;
    if (known_reference(l, ref)) return CORE_ERROR;
    name = MODEL_NAMES[ref];
    modes = settable(run->cosimulation, ref);
    if (!modes) return log_error(l, "%s is calculated and cannot be set", name);
    if (!(modes & run->mode))
        return log_error(l, "%s cannot be set %s", name, log_mode_name(run->mode));
    if (!isfinite(value)) return log_error(l, "%s = %g is not finite", name, value);
    return among(ref, PARAMETERS, MODES) ? within_bounds(l, ref, value) : CORE_OK;
}

/* Mark calculated values as out of date after a change of data on which derivatives depend. */
static void changed(core *c) {
    c->m.variables.stale = 1;
    if (c->m.run.mode & STARTING)
        c->m.configuration.known = 0;
    else
        internal_step_restart(&c->events);
}

/* Store a guess of a dependent coordinate or a cut joint. A guess equal to the start value of the
 * model description has no effect, because many importers set all start values. */
static void set_guess(core *c, core_reference ref, double value) {
    core_variables *v = &c->m.variables;
    double *guess = ref < CUTS ? v->guess + (ref - DEPENDENTS) : v->cut + (ref - CUTS);
    if (*guess == value) return;
    *guess = value;
    changed(c);
}

/* Store a start velocity of a dependent joint. */
static void set_speed(core *c, unsigned ref, double value) {
#ifdef MODEL_TREE
    double *speed = c->m.variables.speeds + (ref - OUTPUTS - PASSIVE_V);
    if (*speed == value) return;
    *speed = value;
    changed(c);
#else
    (void)c, (void)ref, (void)value;
#endif
}

/* Set a state of an independent joint by its reference for external integrators. Before the start,
 * a value equal to that in the model description has no effect. */
static void set_chart_state(core *c, core_reference ref, double value) {
    int before = (c->m.run.mode & STARTING) != 0;
    double *at = c->m.variables.values + (before ? ref - CHART_STATES + STATES : ref);
    if (*at == value || (before && value == MODEL_START[ref])) return;
    *at = value;
    changed(c);
}

/* Make the joints the states, if they are not, before event mode sets a joint or a parameter. */
static core_status joints_set(core *c, core_reference ref) {
#if MODEL_TREE_OUTSIDE
    int ours = ref < DERIVATIVES || ref >= PARAMETERS;
    if (ours && !c->m.run.cosimulation && c->m.run.mode == EVENT)
        return chart_choice_set_joints(&c->solver);
#endif
    (void)c, (void)ref;
    return CORE_OK;
}

core_status core_set(core *c, const core_reference *ref, size_t n, const double *values) {
    double *v = c->m.variables.values;
    size_t i;
    if (n && (!ref || !values)) return log_error(&c->log, "the array is NULL");
    for (i = 0; i < n; i++)
        if (settable_value(&c->log, ref[i], values[i])) return CORE_ERROR;
    for (i = 0; i < n; i++) {
        if (ref[i] >= CUTS) {
            set_guess(c, ref[i], values[i]);
        } else if (ref[i] >= CHART_STATES) {
            set_chart_state(c, ref[i], values[i]);
        } else if (ref[i] >= DEPENDENTS) {
            set_guess(c, ref[i], values[i]);
        } else if (is_speed(ref[i])) {
            set_speed(c, ref[i], values[i]);
        } else if (v[ref[i]] != values[i]) {
            if (joints_set(c, ref[i])) return CORE_ERROR;
            v[ref[i]] = values[i];
            if (among(ref[i], STATES, STATES + NS)) v[CHART_STATES + ref[i]] = values[i];
            changed(c);
        }
    }
    return CORE_OK;
}
