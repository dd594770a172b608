/* Directional and adjoint derivatives and time derivatives, exact also for closed loops. */
#include "internal.h"

#include "charts.h"

#include <math.h>
#include <string.h>

/* Seeds, or derivatives, of time, states, inputs, parameters and all calculated values. */
typedef struct {
    double dt, dx[NX + 1], du[NU + 1], dp[NP + 1];
    double dslot[NX + 1], drate[NX + 1]; /* states of the external integrator, their rates */
    double dxdot[NX + 1], dy[NY + 1], dm[NM + 1], dz[NZ + 1], dg[NK + 1];
} tangents;

/* Whether the states of the external integrator are local tangent coordinates. */
static int in_chart(const core *c) {
#if MODEL_TREE_OUTSIDE
    return !c->m.cosimulation && (c->m.mode & RUNNING) && c->m.charts.tangent;
#else
    (void)c;
    return 0;
#endif
}

/* Address of the seed of a value reference, or NULL if derivatives by it do not exist. */
static double *known_of(const core *c, tangents *d, core_reference ref) {
    if (ref == TIME_REFERENCE && c->timed) return &d->dt;
    if (ref < DERIVATIVES) return in_chart(c) ? NULL : d->dx + (ref - STATES);
    if (ref < INPUTS) return NULL;
    if (ref < OUTPUTS) return d->du + (ref - INPUTS);
    if (ref < PARAMETERS) return NULL;
    if (ref < MODES) return d->dp + (ref - PARAMETERS);
    if (ref < SLOTS) return NULL;
    return ref < RATES ? d->dslot + (ref - SLOTS) : NULL;
}

static double *unknown_of(tangents *d, core_reference ref) {
    if (ref < DERIVATIVES) return d->dx + (ref - STATES);
    if (ref < INPUTS) return d->dxdot + (ref - DERIVATIVES);
    if (ref < OUTPUTS) return NULL;
    if (ref < PARAMETERS) return d->dy + (ref - OUTPUTS);
    if (ref < MODES) return NULL;
    if (ref < DEPENDENTS) return d->dm + (ref - MODES); /* constant */
    if (ref < INDICATORS) return d->dz + (ref - DEPENDENTS);
    if (ref < SLOTS) return d->dg + (ref - INDICATORS);
    if (ref < RATES) return d->dslot + (ref - SLOTS);
    return ref < CHART ? d->drate + (ref - RATES) : NULL;
}

#ifdef MODEL_SINES

/* Squared sine below which rounding of dependent positions is noticeable in second derivatives. */
#define ROUNDED 2.5e-3
/* Displacement of the states in the test of rounding, in nominal sizes. It changes exact
 * derivatives by about this fraction, and derivatives without accuracy by more. */
#define TRIAL_MOVE 1e-12
#define TRIALS 3
/* Largest effect of rounding, relative to the derivatives. */
#define ROUNDING 1e-5
/* Largest effect of rounding on derivatives that are zero, relative to squared speeds in nominal
 * sizes. */
#define ROUNDING_OF_SPEEDS 1e-10

/* Compute the derivative of the accelerations along a direction of all states, in nominal sizes, at
 * a configuration displaced by trial move number `trial`. Velocities stay those of the state. */
static int trial_accelerations(core *c, int trial, double *accelerations) {
    static const double MOVES[TRIALS] = {-TRIAL_MOVE, TRIAL_MOVE, 2.0 * TRIAL_MOVE};
    const double *nominal = MODEL_NOMINAL;
    double x[NX + 1], z[NZ + 1], next[NZ + 1], residual, none;
    tangents d;
    int i, pass;
    memset(&d, 0, sizeof d);
    for (i = 0; i < NX; i++) {
        x[i] = c->m.values[STATES + i] + (MODEL_LEADS[i] ? MOVES[trial] * nominal[STATES + i] : 0.0);
        d.dx[i] = nominal[STATES + i] * (1.0 + (double)i / NX);
    }
    memcpy(z, c->m.values + DEPENDENTS, NZ * sizeof *z);
    for (pass = 0; pass < 2; pass++) {
        c->arg[0] = x;
        c->arg[1] = z;
        c->arg[2] = c->m.values + PARAMETERS;
        c->res[0] = next;
        c->res[1] = &residual;
        if (mbs_closure(c->arg, c->res, c->iw, c->w, 0)) return 1;
        memcpy(z, next, NZ * sizeof *z);
    }
    core_point(c, &c->m.time, x, z);
    c->arg[5] = &none;
    none = 0.0;
    c->arg[6] = d.dx;
    c->arg[7] = d.du;
    c->arg[8] = d.dp;
    c->res[0] = d.dxdot;
    c->res[1] = d.dy;
    c->res[2] = d.dz;
    c->res[3] = d.dg;
    if (mbs_tangent(c->arg, c->res, c->iw, c->w, 0)) return 1;
    for (i = 0; i < NX; i++) accelerations[i] = d.dxdot[i] / nominal[STATES + i];
    for (i = 0; i < N_PASSIVE; i++)
        accelerations[NX + i] = d.dy[PASSIVE_A + i] / nominal[OUTPUTS + PASSIVE_A + i];
    return 0;
}

/* Whether derivatives are independent of rounding errors of the dependent positions. */
static int is_accurate(core *c) {
    double found[TRIALS][NX + N_PASSIVE + 1], size = 0.0, difference = 0.0, speed = 0.0;
    int i, k;
    for (k = 0; k < TRIALS; k++)
        if (trial_accelerations(c, k, found[k])) return 0;
    for (i = 0; i < NX + N_PASSIVE; i++) {
        size = fmax(size, fabs(found[0][i]));
        for (k = 1; k < TRIALS; k++) difference = fmax(difference, fabs(found[k][i] - found[0][i]));
    }
    for (i = 0; i < NX; i++)
        speed = fmax(speed, fabs(c->m.values[DERIVATIVES + i]) / MODEL_NOMINAL[STATES + i]);
    for (i = 0; i < N_PASSIVE; i++)
        speed = fmax(speed, fabs(c->m.values[OUTPUTS + PASSIVE_V + i]) /
                                MODEL_NOMINAL[OUTPUTS + PASSIVE_V + i]);
    return difference <= ROUNDING * size + ROUNDING_OF_SPEEDS * speed * speed;
}

#endif

/* Check that derivatives are accurate. Second derivatives of the loops magnify rounding errors of a
 * closed configuration by the third power of the inverse sine, and by squared speeds. */
static core_status differentiable(core *c) {
#ifdef MODEL_SINES
    double sines[2], sine;
    c->arg[0] = c->m.values + STATES;
    c->arg[1] = c->m.values + DEPENDENTS;
    c->arg[2] = c->m.values + PARAMETERS;
    c->res[0] = sines;
    if (mbs_sines(c->arg, c->res, c->iw, c->w, 0)) sines[0] = sines[1] = 0.0;
    sine = sines[in_chart(c)];
    if (sine > ROUNDED || (sine > MODEL_SINES && (in_chart(c) || is_accurate(c)))) return CORE_OK;
    return core_not_differentiable(c, sqrt(fmax(sine, 0.0)));
#else
    (void)c;
    return CORE_OK;
#endif
}

core_status core_not_differentiable(core *c, double sine) {
    return core_refuse(c, "%s: at time %.9g the configuration is so near a singular one (%s; sine %.2g) "
                       "that second derivatives of the loops have no accuracy at these velocities; ask "
                       "for derivatives at another configuration, at smaller velocities, or choose "
                       "other independent joints (assemble(active=...))", c->name, c->m.time,
                       core_where(c), sine);
}

/* Check references and seeds, and update the calculated values. */
static core_status ready(core *c, const core_reference *unknown, size_t n_unknown, const core_reference *known,
                         size_t n_known, const double *seed, size_t n_seed) {
    core_status status;
    tangents d;
    size_t i;
    if (!core_allowed(c, INITIALIZATION | RUNNING | INTERMEDIATE, "a derivative"))
        return CORE_ERROR;
    for (i = 0; i < n_known; i++)
        if (!known_of(c, &d, known[i]))
            return core_refuse(c, "%s: no derivative with respect to value reference %u; use "
                               "states, inputs and parameters", c->name, (unsigned)known[i]);
    for (i = 0; i < n_unknown; i++)
        if (!unknown_of(&d, unknown[i]))
            return core_refuse(c, "%s: value reference %u has no derivative; use outputs and "
                               "derivatives of states", c->name, (unsigned)unknown[i]);
    for (i = 0; i < n_seed; i++)
        if (!isfinite(seed[i]))
            return core_refuse(c, "%s: seed %g of a derivative is not finite", c->name, seed[i]);
    status = core_refresh(c);
    return status ? status : differentiable(c);
}

static void point(core *c) {
    core_point(c, &c->m.time, c->m.values + STATES, c->m.values + DEPENDENTS);
}

static core_status finite_answer(core *c, core_reference ref, double value) {
    if (isfinite(value)) return CORE_OK;
    return core_no_answer(c, "%s: the derivative of or by %s is not finite at time %.9g", c->name,
                          ref < N_VALUES ? MODEL_NAMES[ref] : "time", c->m.time);
}

#if MODEL_TREE_OUTSIDE

static core_status move_in_chart(core *c, tangents *d) {
    charts_tangent along;
    core_status status;
    memset(&along, 0, sizeof along);
    along.dt = d->dt;
    memcpy(along.dx, d->dslot, sizeof d->dslot);
    memcpy(along.du, d->du, sizeof d->du);
    memcpy(along.dp, d->dp, sizeof d->dp);
    status = charts_difference(c, &along);
    memcpy(d->drate, along.dxdot, sizeof d->drate);
    memcpy(d->dx, along.djoints, sizeof d->dx);
    memcpy(d->dxdot, along.dslopes, sizeof d->dxdot);
    memcpy(d->dy, along.dy, sizeof d->dy);
    memcpy(d->dz, along.dz, sizeof d->dz);
    return status;
}

#endif

/* Compute the directional derivatives of all calculated values along the seeds in d. */
static core_status move(core *c, tangents *d) {
    int i;
#if MODEL_TREE_OUTSIDE
    if (in_chart(c)) return move_in_chart(c, d);
#endif
    for (i = 0; i < NX; i++) d->dx[i] += d->dslot[i];
    point(c);
    c->arg[5] = &d->dt;
    c->arg[6] = d->dx;
    c->arg[7] = d->du;
    c->arg[8] = d->dp;
    c->res[0] = d->dxdot;
    c->res[1] = d->dy;
    c->res[2] = d->dz;
    c->res[3] = d->dg;
    if (mbs_tangent(c->arg, c->res, c->iw, c->w, 0))
        return core_no_answer(c, "%s: no derivative at time %.9g", c->name, c->m.time);
    memcpy(d->drate, d->dxdot, sizeof d->drate);
    return CORE_OK;
}

core_status core_directional(core *c, const core_reference *unknown, size_t n_unknown,
                             const core_reference *known, size_t n_known, const double *seed,
                             double *answer) {
    tangents d;
    size_t i;
    core_status status = ready(c, unknown, n_unknown, known, n_known, seed, n_known);
    if (status) return status;
    memset(&d, 0, sizeof d);
    for (i = 0; i < n_known; i++) *known_of(c, &d, known[i]) += seed[i];
    status = move(c, &d);
    for (i = 0; i < n_unknown && !status; i++) {
        answer[i] = *unknown_of(&d, unknown[i]);
        status = finite_answer(c, unknown[i], answer[i]);
    }
    return status;
}

#ifdef MODEL_ADJOINT

/* Adjoint derivative from one directional derivative for each known. */
static core_status transposed(core *c, const core_reference *unknown, size_t n_unknown,
                              const core_reference *known, size_t n_known, const double *seed,
                              double *answer) {
    core_status status = CORE_OK;
    tangents d;
    size_t i, k;
    for (i = 0; i < n_known && !status; i++) {
        memset(&d, 0, sizeof d);
        *known_of(c, &d, known[i]) = 1.0;
        status = move(c, &d);
        answer[i] = 0.0;
        for (k = 0; k < n_unknown && !status; k++)
            answer[i] += seed[k] * *unknown_of(&d, unknown[k]);
        if (!status) status = finite_answer(c, known[i], answer[i]);
    }
    return status;
}

core_status core_adjoint(core *c, const core_reference *unknown, size_t n_unknown,
                         const core_reference *known, size_t n_known, const double *seed,
                         double *answer) {
    tangents w, g;
    size_t i;
    core_status status = ready(c, unknown, n_unknown, known, n_known, seed, n_unknown);
    if (status) return status;
    if (in_chart(c)) return transposed(c, unknown, n_unknown, known, n_known, seed, answer);
    memset(&w, 0, sizeof w);
    for (i = 0; i < n_unknown; i++) *unknown_of(&w, unknown[i]) += seed[i];
    for (i = 0; i < NX; i++) {
        w.dx[i] += w.dslot[i];
        w.dxdot[i] += w.drate[i];
    }
    point(c);
    c->arg[5] = w.dxdot;
    c->arg[6] = w.dy;
    c->arg[7] = w.dz;
    c->arg[8] = w.dg;
    c->res[0] = &g.dt;
    c->res[1] = g.dx;
    c->res[2] = g.du;
    c->res[3] = g.dp;
    if (mbs_adjoint(c->arg, c->res, c->iw, c->w, 0))
        return core_no_answer(c, "%s: no derivative at time %.9g", c->name, c->m.time);
    for (i = 0; i < NX; i++) g.dx[i] += w.dx[i]; /* a state may be an output */
    memcpy(g.dslot, g.dx, sizeof g.dslot);
    for (i = 0; i < n_known && !status; i++) {
        answer[i] = *known_of(c, &g, known[i]);
        status = finite_answer(c, known[i], answer[i]);
    }
    return status;
}

#endif

/* Time derivatives of outputs. Inputs follow their given derivatives, else they are constant. */
core_status core_get_output_slopes(core *c, const core_reference *ref, size_t n, const core_integer *order,
                                   double *values) {
    core_status status;
    tangents d;
    size_t i;
    if (n && (!ref || !order || !values))
        return core_refuse(c, "%s: the array is NULL", c->name);
    status = ready(c, ref, n, NULL, 0, NULL, 0);
    if (status) return status;
    for (i = 0; i < n; i++)
        if (order[i] != 1)
            return core_refuse(c, "%s: derivative %d of %s is not known; use order 1", c->name,
                               (int)order[i], MODEL_NAMES[ref[i]]);
    memset(&d, 0, sizeof d);
    d.dt = 1.0;
    memcpy(d.dx, c->m.values + DERIVATIVES, sizeof d.dx - sizeof *d.dx);
    core_input_rates(c, c->m.time, d.du);
    status = move(c, &d);
    for (i = 0; i < n && !status; i++) {
        values[i] = *unknown_of(&d, ref[i]);
        status = finite_answer(c, ref[i], values[i]);
    }
    return status;
}
