/* Directional and adjoint derivatives and time derivatives, exact also for closed loops. */
#include <math.h>
#include <string.h>

#include "calculated.h"
#include "charts.h"
#include "core.h"

/* Seeds, or derivatives, of time, states, inputs, parameters and all calculated values. */
typedef struct {
    double dt, dx[NX + 1], du[NU + 1], dp[NP + 1];
    double dchart[NX + 1], drate[NX + 1]; /* states of the external integrator, their rates */
    double dxdot[NX + 1], dy[NY + 1], dm[NM + 1], dz[NZ + 1], dg[NK + 1];
} tangents;

/* Whether the states of the external integrator are local tangent coordinates. */
static int in_chart(const core_solver *s) {
#if MODEL_TREE_OUTSIDE
    const core_run *run = s->machine->run;
    return !run->cosimulation && (run->mode & RUNNING) && s->charts->tangent;
#else
    (void)s;
    return 0;
#endif
}

/* Address of the seed of a value reference, or NULL if derivatives by it do not exist. */
static double *known_of(const core *c, tangents *d, core_reference ref) {
    if (ref == TIME_REFERENCE && c->host.timed) return &d->dt;
    if (ref < DERIVATIVES) return in_chart(&c->solver) ? NULL : d->dx + (ref - STATES);
    if (ref < INPUTS) return NULL;
    if (ref < OUTPUTS) return d->du + (ref - INPUTS);
    if (ref < PARAMETERS) return NULL;
    if (ref < MODES) return d->dp + (ref - PARAMETERS);
    if (ref < CHART_STATES) return NULL;
    return ref < CHART_RATES ? d->dchart + (ref - CHART_STATES) : NULL;
}

/* Address of the derivative of a value reference, or NULL if it has none. */
static double *unknown_of(tangents *d, core_reference ref) {
    if (ref < DERIVATIVES) return d->dx + (ref - STATES);
    if (ref < INPUTS) return d->dxdot + (ref - DERIVATIVES);
    if (ref < OUTPUTS) return NULL;
    if (ref < PARAMETERS) return d->dy + (ref - OUTPUTS);
    if (ref < MODES) return NULL;
    if (ref < DEPENDENTS) return d->dm + (ref - MODES); /* constant */
    if (ref < INDICATORS) return d->dz + (ref - DEPENDENTS);
    if (ref < CHART_STATES) return d->dg + (ref - INDICATORS);
    if (ref < CHART_RATES) return d->dchart + (ref - CHART_STATES);
    return ref < CHART_INDICATOR ? d->drate + (ref - CHART_RATES) : NULL;
}

/* Compute the directional derivatives of all calculated values along the seeds in d, at the point
 * in the arguments. Nonzero on failure. */
static int directional(machine *m, tangents *d) {
    m->arg[5] = &d->dt;
    m->arg[6] = d->dx;
    m->arg[7] = d->du;
    m->arg[8] = d->dp;
    m->res[0] = d->dxdot;
    m->res[1] = d->dy;
    m->res[2] = d->dz;
    m->res[3] = d->dg;
    return machine_call(m, mbs_tangent);
}

#ifdef MODEL_SINES

/* Squared sine below which rounding of dependent positions is noticeable in second derivatives. */
#define ROUNDED 2.5e-3
/* Displacement of the states in the test of rounding, in nominal sizes. It changes exact
 * derivatives by about this fraction, and derivatives without accuracy by more. */
#define TRIAL_MOVE 1e-12
#define TRIAL_MOVES 3
/* Largest effect of rounding, relative to the derivatives. */
#define ROUNDING 1e-5
/* Largest effect of rounding on derivatives that are zero, relative to squared speeds in nominal
 * sizes. */
#define ROUNDING_OF_SPEEDS 1e-10

/* Compute the derivative of the accelerations along a direction of all states, in nominal sizes, at
 * a configuration displaced by trial move number `trial`. Velocities stay those of the state. */
static int trial_accelerations(machine *m, int trial, double *accelerations) {
    static const double MOVES[TRIAL_MOVES] = {-TRIAL_MOVE, TRIAL_MOVE, 2.0 * TRIAL_MOVE};
    const double *nominal = MODEL_NOMINAL;
    double x[NX + 1], z[NZ + 1], next[NZ + 1], residual;
    tangents d;
    int i, pass;
    memset(&d, 0, sizeof d);
    for (i = 0; i < NX; i++) {
        x[i] = m->values[STATES + i] + (MODEL_LEADS[i] ? MOVES[trial] * nominal[STATES + i] : 0.0);
        d.dx[i] = nominal[STATES + i] * (1.0 + (double)i / NX);
    }
    memcpy(z, m->values + DEPENDENTS, NZ * sizeof *z);
    for (pass = 0; pass < 2; pass++) {
        machine_loop_point(m, x, z);
        m->res[0] = next;
        m->res[1] = &residual;
        if (machine_call(m, mbs_closure)) return 1;
        memcpy(z, next, NZ * sizeof *z);
    }
    machine_point(m, &m->run->time, x, z);
    if (directional(m, &d)) return 1;
    for (i = 0; i < NX; i++) accelerations[i] = d.dxdot[i] / nominal[STATES + i];
    for (i = 0; i < N_PASSIVE; i++)
        accelerations[NX + i] = d.dy[PASSIVE_A + i] / nominal[OUTPUTS + PASSIVE_A + i];
    return 0;
}

/* Whether derivatives are independent of rounding errors of the dependent positions. */
static int is_accurate(machine *m) {
    double found[TRIAL_MOVES][NX + N_PASSIVE + 1], size = 0.0, difference = 0.0, speed = 0.0;
    int i, k;
    for (k = 0; k < TRIAL_MOVES; k++)
        if (trial_accelerations(m, k, found[k])) return 0;
    for (i = 0; i < NX + N_PASSIVE; i++) {
        size = fmax(size, fabs(found[0][i]));
        for (k = 1; k < TRIAL_MOVES; k++)
            difference = fmax(difference, fabs(found[k][i] - found[0][i]));
    }
    for (i = 0; i < NX; i++)
        speed = fmax(speed, fabs(m->values[DERIVATIVES + i]) / MODEL_NOMINAL[STATES + i]);
    for (i = 0; i < N_PASSIVE; i++)
        speed = fmax(speed, fabs(m->values[OUTPUTS + PASSIVE_V + i]) /
                                MODEL_NOMINAL[OUTPUTS + PASSIVE_V + i]);
    return difference <= ROUNDING * size + ROUNDING_OF_SPEEDS * speed * speed;
}

#endif

/* Check that derivatives are accurate. Second derivatives of the loops magnify rounding errors of a
 * closed configuration by the third power of the inverse sine, and by squared speeds. */
static core_status differentiable(core_solver *s) {
#ifdef MODEL_SINES
    machine *m = s->machine;
    double sines[2], sine;
    int chart = in_chart(s);
    machine_loop_point(m, m->values + STATES, m->values + DEPENDENTS);
    m->res[0] = sines;
    if (machine_call(m, mbs_sines)) sines[0] = sines[1] = 0.0;
    sine = sines[chart];
    if (sine > ROUNDED || (sine > MODEL_SINES && (chart || is_accurate(m)))) return CORE_OK;
    return machine_not_differentiable(m, sqrt(fmax(sine, 0.0)));
#else
    (void)s;
    return CORE_OK;
#endif
}

/* Check references and seeds, and update the calculated values. */
static core_status ready(core *c, const core_reference *unknown, size_t n_unknown,
                         const core_reference *known, size_t n_known, const double *seed,
                         size_t n_seed) {
    core_status status;
    tangents d;
    size_t i;
    if (!log_allowed(&c->log, INITIALIZATION | RUNNING | INTERMEDIATE, "a derivative"))
        return CORE_ERROR;
    for (i = 0; i < n_known; i++)
        if (!known_of(c, &d, known[i]))
            return log_error(&c->log,
                             "no derivative with respect to value reference %u; use "
                             "states, inputs and parameters",
                             (unsigned)known[i]);
    for (i = 0; i < n_unknown; i++)
        if (!unknown_of(&d, unknown[i]))
            return log_error(&c->log,
                             "value reference %u has no derivative; use outputs and "
                             "derivatives of states",
                             (unsigned)unknown[i]);
    for (i = 0; i < n_seed; i++)
        if (!isfinite(seed[i]))
            return log_error(&c->log, "seed %g of a derivative is not finite", seed[i]);
    status = calculate(&c->solver);
    return status ? status : differentiable(&c->solver);
}

/* Set the arguments of the generated functions to the present values. */
static void present_point(machine *m) {
    machine_point(m, &m->run->time, m->values + STATES, m->values + DEPENDENTS);
}

/* Error if a derivative of or by a variable is not finite. */
static core_status finite_answer(core_log *l, core_reference ref, double value) {
    if (isfinite(value)) return CORE_OK;
    return log_failed(l, "the derivative of or by %s is not finite at time %.9g",
                      ref < N_VALUES ? MODEL_NAMES[ref] : "time", l->run->time);
}

#if MODEL_TREE_OUTSIDE

/* The same while the states are local tangent coordinates. */
static core_status move_in_chart(core_solver *s, tangents *d) {
    charts_tangent along;
    core_status status;
    memset(&along, 0, sizeof along);
    along.dt = d->dt;
    memcpy(along.dx, d->dchart, sizeof d->dchart);
    memcpy(along.du, d->du, sizeof d->du);
    memcpy(along.dp, d->dp, sizeof d->dp);
    status = charts_difference(s, &along);
    memcpy(d->drate, along.dxdot, sizeof d->drate);
    memcpy(d->dx, along.djoints, sizeof d->dx);
    memcpy(d->dxdot, along.dslopes, sizeof d->dxdot);
    memcpy(d->dy, along.dy, sizeof d->dy);
    memcpy(d->dz, along.dz, sizeof d->dz);
    return status;
}

#endif

/* Compute the directional derivatives of all calculated values along the seeds in d. */
static core_status move(core_solver *s, tangents *d) {
    machine *m = s->machine;
    int i;
#if MODEL_TREE_OUTSIDE
    if (in_chart(s)) return move_in_chart(s, d);
#endif
    for (i = 0; i < NX; i++) d->dx[i] += d->dchart[i];
    present_point(m);
    if (directional(m, d)) return log_failed(m->log, "no derivative at time %.9g", m->run->time);
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
    status = move(&c->solver, &d);
    for (i = 0; i < n_unknown && !status; i++) {
        answer[i] = *unknown_of(&d, unknown[i]);
        status = finite_answer(&c->log, unknown[i], answer[i]);
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
        status = move(&c->solver, &d);
        answer[i] = 0.0;
        for (k = 0; k < n_unknown && !status; k++)
            answer[i] += seed[k] * *unknown_of(&d, unknown[k]);
        if (!status) status = finite_answer(&c->log, known[i], answer[i]);
    }
    return status;
}

core_status core_adjoint(core *c, const core_reference *unknown, size_t n_unknown,
                         const core_reference *known, size_t n_known, const double *seed,
                         double *answer) {
    machine *m = &c->machine;
    tangents w, g;
    size_t i;
    core_status status = ready(c, unknown, n_unknown, known, n_known, seed, n_unknown);
    if (status) return status;
    if (in_chart(&c->solver))
        return transposed(c, unknown, n_unknown, known, n_known, seed, answer);
    memset(&w, 0, sizeof w);
    for (i = 0; i < n_unknown; i++) *unknown_of(&w, unknown[i]) += seed[i];
    for (i = 0; i < NX; i++) {
        w.dx[i] += w.dchart[i];
        w.dxdot[i] += w.drate[i];
    }
    present_point(m);
    m->arg[5] = w.dxdot;
    m->arg[6] = w.dy;
    m->arg[7] = w.dz;
    m->arg[8] = w.dg;
    m->res[0] = &g.dt;
    m->res[1] = g.dx;
    m->res[2] = g.du;
    m->res[3] = g.dp;
    if (machine_call(m, mbs_adjoint))
        return log_failed(m->log, "no derivative at time %.9g", m->run->time);
    for (i = 0; i < NX; i++) g.dx[i] += w.dx[i]; /* a state may be an output */
    memcpy(g.dchart, g.dx, sizeof g.dchart);
    for (i = 0; i < n_known && !status; i++) {
        answer[i] = *known_of(c, &g, known[i]);
        status = finite_answer(&c->log, known[i], answer[i]);
    }
    return status;
}

#endif

/* Time derivatives of outputs. Inputs follow their given derivatives, else they are constant. */
core_status core_get_output_slopes(core *c, const core_reference *ref, size_t n,
                                   const core_integer *order, double *values) {
    core_status status;
    tangents d;
    size_t i;
    if (n && (!ref || !order || !values)) return log_error(&c->log, "the array is NULL");
    status = ready(c, ref, n, NULL, 0, NULL, 0);
    if (status) return status;
    for (i = 0; i < n; i++)
        if (order[i] != 1)
            return log_error(&c->log, "derivative %d of %s is not known; use order 1",
                             (int)order[i], MODEL_NAMES[ref[i]]);
    memset(&d, 0, sizeof d);
    d.dt = 1.0;
    memcpy(d.dx, c->m.variables.values + DERIVATIVES, sizeof d.dx - sizeof *d.dx);
    machine_input_rates(&c->machine, c->m.run.time, d.du);
    status = move(&c->solver, &d);
    for (i = 0; i < n && !status; i++) {
        values[i] = *unknown_of(&d, ref[i]);
        status = finite_answer(&c->log, ref[i], values[i]);
    }
    return status;
}
