/* Values by value reference. Modes are integers, all other variables are real. Modes can also be
 * read as real numbers, for hosts without integers such as CasADi. */
#include "internal.h"

#include "charts.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <string.h>

static core_status known_reference(core *c, core_reference ref) {
    if (ref < N_VALUES) return CORE_OK;
    return core_refuse(c, "%s: value reference %u is unknown; the last one is %d", c->name,
                       (unsigned)ref, (int)N_VALUES - 1);
}

/* Whether first <= ref < end, for a kind of variables that may be empty. */
static int among(core_reference ref, core_reference first, core_reference end) { return ref - first < end - first; }

static int is_mode(core_reference ref) { return among(ref, MODES, DEPENDENTS); }

/* Whether a value is stored and needs no calculation. */
static int given(const core *c, core_reference ref) {
    if (ref < DERIVATIVES) return !NS || (c->m.mode & (INSTANTIATED | INITIALIZATION)) != 0;
    if (among(ref, INPUTS, OUTPUTS)) return 1;
    if (among(ref, SLOTS, RATES)) return !(c->m.mode & (INSTANTIATED | INITIALIZATION));
    return ref >= PARAMETERS && ref < (c->m.mode == INITIALIZATION ? MODES : DEPENDENTS);
}

core_status core_get(core *c, const core_reference *ref, size_t n, double *values) {
    core_status status = CORE_OK;
    size_t i;
    if (!core_allowed(c, READABLE, "getting values")) return CORE_ERROR;
    if (n && (!ref || !values)) return core_refuse(c, "%s: the array is NULL", c->name);
    for (i = 0; i < n && !status; i++) status = known_reference(c, ref[i]);
    for (i = 0; i < n && !status; i++) {
        core_reference r = ref[i];
        if (among(r, INDICATORS, SLOTS))
            status = core_show_indicators(c);
#if MODEL_TREE_OUTSIDE
        else if (r == CHART)
            status = c->m.cosimulation ? core_refresh(c) : charts_show_indicator(c);
#endif
        else if (!given(c, r))
            status = core_refresh(c);
        values[i] = among(r, INPUTS, OUTPUTS) ? core_inputs(c, c->m.time)[r - INPUTS]
                                              : c->m.values[r];
    }
    return status;
}

core_status core_get_modes(core *c, const core_reference *ref, size_t n, core_integer *values) {
    core_status status = CORE_OK;
    size_t i;
    if (!core_allowed(c, READABLE, "getting values")) return CORE_ERROR;
    if (n && (!ref || !values)) return core_refuse(c, "%s: the array is NULL", c->name);
    for (i = 0; i < n; i++)
        if (!is_mode(ref[i]))
            return core_refuse(c, "%s: value reference %u is no integer variable; those are modes",
                               c->name, (unsigned)ref[i]);
    for (i = 0; i < n && !status; i++) {
        double value;
        if (!given(c, ref[i])) status = core_refresh(c);
        value = c->m.values[ref[i]];
        if (value != floor(value) || fabs(value) > INT_MAX)
            return core_no_answer(c, "%s: the mode %s is %g, which is no integer; let it count or "
                                  "name", c->name, MODEL_NAMES[ref[i]], value);
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
static int settable(const core *c, core_reference ref) {
    int before = INSTANTIATED | INITIALIZATION;
    if (ref < DERIVATIVES && NS) return c->m.cosimulation ? before : before | EVENT;
    if (ref < DERIVATIVES || among(ref, SLOTS, RATES))
        return c->m.cosimulation ? before : before | EVENT | CONTINUOUS;
    if (ref < INPUTS) return 0;
    if (ref < OUTPUTS) return before | RUNNING;
    if (is_speed(ref)) return before;
    if (ref < PARAMETERS) return 0;
    if (ref < MODES) return MODEL_FIXED[ref] ? before : before | EVENT | STEP;
    return among(ref, DEPENDENTS, INDICATORS) || ref >= CUTS ? before : 0;
}

/* Check the bounds of a parameter. The smallest normal number as lower bound means "positive". */
static core_status within_bounds(core *c, core_reference ref, double value) {
    double low = MODEL_MIN[ref], high = MODEL_MAX[ref];
    const char *name = MODEL_NAMES[ref];
    if (value >= low && value <= high) return CORE_OK;
    if (isfinite(low) && isfinite(high))
        return core_refuse(c, "%s: parameter %s is %g; give a number from %g to %g", c->name, name,
                           value, low, high);
    if (value > high)
        return core_refuse(c, "%s: parameter %s is %g; give %g or less", c->name, name, value, high);
    if (low == DBL_MIN)
        return core_refuse(c, "%s: parameter %s is %g; give more than zero", c->name, name, value);
    return core_refuse(c, "%s: parameter %s is %g; give %g or more", c->name, name, value, low);
}

static core_status settable_value(core *c, core_reference ref, double value) {
    const char *name;
    int modes;
    if (known_reference(c, ref)) return CORE_ERROR;
    name = MODEL_NAMES[ref];
    modes = settable(c, ref);
    if (!modes) return core_refuse(c, "%s: %s is calculated and cannot be set", c->name, name);
    if (!(modes & c->m.mode))
        return core_refuse(c, "%s: %s cannot be set %s", c->name, name, core_mode_name(c->m.mode));
    if (!isfinite(value))
        return core_refuse(c, "%s: %s = %g is not finite", c->name, name, value);
    return among(ref, PARAMETERS, MODES) ? within_bounds(c, ref, value) : CORE_OK;
}

/* Mark calculated values as out of date after a change of data on which derivatives depend. */
static void changed(core *c) {
    c->m.stale = 1;
    if (c->m.mode & (INSTANTIATED | INITIALIZATION))
        c->m.closed = 0;
    else
        core_restart(c);
}

/* Store a guess of a dependent coordinate or a cut joint. A guess equal to the start value of the
 * model description has no effect, because many hosts set all start values. */
static void set_guess(core *c, core_reference ref, double value) {
    double *at = ref < CUTS ? c->m.guess + (ref - DEPENDENTS) : c->m.cut + (ref - CUTS);
    if (*at == value) return;
    *at = value;
    changed(c);
}

static void set_speed(core *c, unsigned ref, double value) {
#ifdef MODEL_TREE
    double *speed = c->m.speeds + (ref - OUTPUTS - PASSIVE_V);
    if (*speed == value) return;
    *speed = value;
    changed(c);
#else
    (void)c, (void)ref, (void)value;
#endif
}

/* Set a state of an independent joint by its reference for external integrators. Before the start,
 * a value equal to that in the model description has no effect. */
static void set_slot(core *c, core_reference ref, double value) {
    int before = (c->m.mode & (INSTANTIATED | INITIALIZATION)) != 0;
    double *at = c->m.values + (before ? ref - SLOTS + STATES : ref);
    if (*at == value || (before && value == MODEL_START[ref])) return;
    *at = value;
    changed(c);
}

/* Make the joints the states, if they are not, before event mode sets a joint or a parameter. */
static core_status joints_set(core *c, core_reference ref) {
#if MODEL_TREE_OUTSIDE
    int ours = ref < DERIVATIVES || ref >= PARAMETERS;
    if (ours && !c->m.cosimulation && c->m.mode == EVENT) return charts_set(c);
#endif
    (void)c, (void)ref;
    return CORE_OK;
}

core_status core_set(core *c, const core_reference *ref, size_t n, const double *values) {
    size_t i;
    if (n && (!ref || !values)) return core_refuse(c, "%s: the array is NULL", c->name);
    for (i = 0; i < n; i++)
        if (settable_value(c, ref[i], values[i])) return CORE_ERROR;
    for (i = 0; i < n; i++) {
        if (ref[i] >= CUTS) {
            set_guess(c, ref[i], values[i]);
        } else if (ref[i] >= SLOTS) {
            set_slot(c, ref[i], values[i]);
        } else if (ref[i] >= DEPENDENTS) {
            set_guess(c, ref[i], values[i]);
        } else if (is_speed(ref[i])) {
            set_speed(c, ref[i], values[i]);
        } else if (c->m.values[ref[i]] != values[i]) {
            if (joints_set(c, ref[i])) return CORE_ERROR;
            c->m.values[ref[i]] = values[i];
            if (among(ref[i], STATES, STATES + NS)) c->m.values[SLOTS + ref[i]] = values[i];
            changed(c);
        }
    }
    return CORE_OK;
}
