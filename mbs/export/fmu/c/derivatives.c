/* Directional and adjoint derivatives and those by time, exact through closed loops. */
#include "internal.h"

#include "charts.h"

#include <math.h>
#include <string.h>

/* Numbers that belong to states, inputs, parameters and to what is calculated from them. */
typedef struct {
    double dt, dx[NX + 1], du[NU + 1], dp[NP + 1];
    double dslot[NX + 1], drate[NX + 1]; /* states and their derivatives outside */
    double dxdot[NX + 1], dy[NY + 1], dm[NM + 1], dz[NZ + 1], dg[NK + 1];
} tangents;

/* 1 where these are local tangent coordinates. */
static int in_chart(const core *c) {
#if MODEL_TREE_OUTSIDE
    return !c->m.cosimulation && (c->m.mode & RUNNING) && c->m.charts.tangent;
#else
    (void)c;
    return 0;
#endif
}

/* Where a reference has its seed; the kinds of variables follow each other, some of them empty. */
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

/* All references can be used, all seeds are finite, and the calculated values are up to date. */
static core_status ready(core *c, const core_reference *unknown, size_t n_unknown, const core_reference *known,
                         size_t n_known, const double *seed, size_t n_seed) {
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
    return core_refresh(c);
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

/* What changes with the seeds. */
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

/* The seeds times what each known moves. */
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

/* Inputs follow what was given of their derivatives, else they are constant. */
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
