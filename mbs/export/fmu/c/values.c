/* Values by their references, and directional derivatives. */
#include "internal.h"

#include <math.h>
#include <string.h>

static core_status known_reference(core *c, unsigned ref) {
    if (ref < N_VALUES) return CORE_OK;
    return core_refuse(c, "%s: value reference %u is unknown; the last one is %d", c->name, ref,
                       (int)N_VALUES - 1);
}

core_status core_get(core *c, const unsigned *ref, size_t n, double *values) {
    core_status status = CORE_OK;
    size_t i;
    if (!core_allowed(c, INITIALIZATION | RUNNING | TERMINATED, "getting values")) return CORE_ERROR;
    if (n && (!ref || !values)) return core_refuse(c, "%s: the array is NULL", c->name);
    for (i = 0; i < n && !status; i++) status = known_reference(c, ref[i]);
    for (i = 0; i < n && !status; i++) {
        unsigned r = ref[i];
        int given = (r < DERIVATIVES) || (r >= INPUTS && r < OUTPUTS) ||
                    (r >= PARAMETERS && r < DEPENDENTS);
        if (!given) status = core_refresh(c);
        values[i] = c->m.values[r];
    }
    return status;
}

/* Modes in which a variable may be set; 0: it is calculated. */
static int settable(const core *c, unsigned ref) {
    int before = INSTANTIATED | INITIALIZATION;
    if (ref < DERIVATIVES) return c->m.cosimulation ? before : before | EVENT | CONTINUOUS;
    if (ref < INPUTS) return 0;
    if (ref < OUTPUTS) return before | RUNNING;
    if (ref < PARAMETERS) return 0;
    if (ref < DEPENDENTS) return before | EVENT | STEP;
    return before;
}

static core_status settable_value(core *c, unsigned ref, double value) {
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
    if (ref >= PARAMETERS && ref < DEPENDENTS &&
        (value < MODEL_MIN[ref] || value > MODEL_MAX[ref]))
        return core_refuse(c, "%s: parameter %s = %g is outside %g to %g", c->name, name, value,
                           MODEL_MIN[ref], MODEL_MAX[ref]);
    return CORE_OK;
}

/* Something that the slopes depend on changed. */
static void changed(core *c) {
    c->m.stale = 1;
    if (c->m.mode & (INSTANTIATED | INITIALIZATION))
        c->m.closed = 0;
    else
        stepper_restart(&c->solver);
}

/* A guess equal to the start value in the model description says nothing: many hosts write all. */
static void set_guess(core *c, unsigned ref, double value) {
    int i;
    if (c->m.guess[ref - DEPENDENTS] == value) return;
    c->m.guess[ref - DEPENDENTS] = value;
    c->m.guessed = 0;
    for (i = 0; i < NZ; i++)
        if (c->m.guess[i] != MODEL_START[DEPENDENTS + i]) c->m.guessed = 1;
    changed(c);
}

core_status core_set(core *c, const unsigned *ref, size_t n, const double *values) {
    size_t i;
    if (n && (!ref || !values)) return core_refuse(c, "%s: the array is NULL", c->name);
    for (i = 0; i < n; i++)
        if (settable_value(c, ref[i], values[i])) return CORE_ERROR;
    for (i = 0; i < n; i++) {
        if (ref[i] >= DEPENDENTS) {
            set_guess(c, ref[i], values[i]);
        } else if (c->m.values[ref[i]] != values[i]) {
            c->m.values[ref[i]] = values[i];
            changed(c);
        }
    }
    return CORE_OK;
}

typedef struct {
    double dx[NX + 1], du[NU + 1], dp[NP + 1], dxdot[NX + 1], dy[NY + 1], dz[NZ + 1];
} tangents;

static double *seed_of(tangents *d, unsigned ref) {
    if (ref < DERIVATIVES) return d->dx + (ref - STATES);
    if (ref >= INPUTS && ref < OUTPUTS) return d->du + (ref - INPUTS);
    if (ref >= PARAMETERS && ref < DEPENDENTS) return d->dp + (ref - PARAMETERS);
    return NULL;
}

static double *answer_of(tangents *d, unsigned ref) {
    if (ref < DERIVATIVES) return d->dx + (ref - STATES);
    if (ref < INPUTS) return d->dxdot + (ref - DERIVATIVES);
    if (ref >= OUTPUTS && ref < PARAMETERS) return d->dy + (ref - OUTPUTS);
    if (ref >= DEPENDENTS && ref < N_VALUES) return d->dz + (ref - DEPENDENTS);
    return NULL;
}

static int call_tangent(core *c, tangents *d) {
    const double *v = c->m.values;
    c->arg[0] = &c->m.time;
    c->arg[1] = v + STATES;
    c->arg[2] = v + DEPENDENTS;
    c->arg[3] = v + INPUTS;
    c->arg[4] = v + PARAMETERS;
    c->arg[5] = d->dx;
    c->arg[6] = d->du;
    c->arg[7] = d->dp;
    c->res[0] = d->dxdot;
    c->res[1] = d->dy;
    c->res[2] = d->dz;
    return mbs_tangent(c->arg, c->res, c->iw, c->w, 0);
}

core_status core_directional(core *c, const unsigned *unknown, size_t n_unknown,
                             const unsigned *known, size_t n_known, const double *seed,
                             double *answer) {
    tangents d;
    size_t i;
    core_status status;
    if (!core_allowed(c, INITIALIZATION | RUNNING, "a derivative")) return CORE_ERROR;
    memset(&d, 0, sizeof d);
    for (i = 0; i < n_known; i++) {
        double *place = seed_of(&d, known[i]);
        if (!place || !isfinite(seed[i]))
            return core_refuse(c, "%s: no derivative with respect to value reference %u, seed %g; "
                               "use states, inputs and parameters", c->name, known[i], seed[i]);
        *place += seed[i];
    }
    for (i = 0; i < n_unknown; i++)
        if (!answer_of(&d, unknown[i]))
            return core_refuse(c, "%s: value reference %u has no derivative; use outputs and "
                               "derivatives of states", c->name, unknown[i]);
    status = core_refresh(c);
    if (status) return status;
    if (call_tangent(c, &d))
        return core_no_answer(c, "%s: no derivative at time %.9g", c->name, c->m.time);
    for (i = 0; i < n_unknown; i++) {
        answer[i] = *answer_of(&d, unknown[i]);
        if (!isfinite(answer[i]))
            return core_no_answer(c, "%s: the derivative of %s is not finite at time %.9g", c->name,
                             MODEL_NAMES[unknown[i]], c->m.time);
    }
    return CORE_OK;
}
