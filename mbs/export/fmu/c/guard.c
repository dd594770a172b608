#include "guard.h"

#include <math.h>
#include <string.h>

#include "closure.h"
#include "internal.h"

#if NB > 0

/* Part of the velocities that may differ from what the accelerations at the ends make of a step. A
 * smooth motion differs by the cube of the step, a few hundredths in the longest steps that hosts
 * make; where branches cross under an angle, velocities change by about their own size. */
#define KINK 0.25

/* Part of their nominal values below which velocities are at rest, as on a stop: what changes there is
 * the rounding of the equations of closure, some 1e-13. A motion as slow takes a year for a turn. */
#define REST 1e-8

/* The signs of the determinants of the diagonal blocks, by elimination with row exchanges. */
static int signs(core *c, const double *x, const double *z, double *sign) {
    double J[NZ * NZ], A[NZ * NZ];
    int b, i, j, k, first = 0;
    c->arg[0] = x;
    c->arg[1] = z;
    c->arg[2] = c->m.values + PARAMETERS;
    c->res[0] = J;
    if (mbs_slopes(c->arg, c->res, c->iw, c->w, 0)) return 1;
    for (b = 0; b < NB; first = MODEL_BLOCKS[b++]) {
        int n = MODEL_BLOCKS[b] - first;
        sign[b] = 1.0;
        for (j = 0; j < n; j++)
            for (i = 0; i < n; i++)
                A[j * n + i] = J[MODEL_COLUMNS[first + j] * NZ + MODEL_ROWS[first + i]];
        for (k = 0; k < n; k++) {
            int pivot = k;
            for (i = k + 1; i < n; i++)
                if (fabs(A[k * n + i]) > fabs(A[k * n + pivot])) pivot = i;
            for (j = k; j < n && pivot != k; j++) {
                double kept = A[j * n + k];
                A[j * n + k] = A[j * n + pivot];
                A[j * n + pivot] = kept;
            }
            if (pivot != k) sign[b] = -sign[b];
            if (!isfinite(A[k * n + k]) || A[k * n + k] == 0.0) return 1;
            if (A[k * n + k] < 0.0) sign[b] = -sign[b];
            for (j = k + 1; j < n; j++)
                for (i = k + 1; i < n; i++)
                    A[j * n + i] -= A[k * n + i] * A[j * n + k] / A[k * n + k];
        }
    }
    return 0;
}

static core_status passed(core *c) {
    char where[CORE_WHERE];
    return core_refuse(
        c, "%s: between time %.9g and %.9g the motion comes to a singular configuration, where the "
           "states do not determine the dependent coordinates (at its end %s); choose other "
           "independent joints (assemble(active=...)), start elsewhere, or end the run before",
        c->name, c->m.watched.time, c->m.time, core_where(c, where));
}

/* The signs, velocities and accelerations at the present time. */
static core_status look(core *c, core_watched *now) {
    const double *x = c->m.values + STATES;
    double z[NZ], xdot[NX + 1], y[NY + 1];
    now->on = 1;
    now->time = c->m.time;
    if (closure_solve(c, x, z) || signs(c, x, z, now->sign) ||
        core_call_rhs(c, c->m.time, x, z, xdot, y))
        return passed(c);
    memcpy(now->v, y + PASSIVE_V, N_PASSIVE * sizeof *y);
    memcpy(now->a, y + PASSIVE_A, N_PASSIVE * sizeof *y);
    return CORE_OK;
}

core_status guard_restart(core *c) {
    core_status status = look(c, &c->m.watched);
    if (status) c->m.watched.on = 0;
    return status;
}

/* Velocities changed by other than what the accelerations make of the step. */
static int kinked(const core_watched *a, const core_watched *b) {
    double h = b->time - a->time, size = 0.0, most = 0.0;
    int i;
    for (i = 0; i < N_PASSIVE; i++) {
        double unit = MODEL_NOMINAL[OUTPUTS + PASSIVE_V + i];
        double half = 0.5 * h * fmax(fabs(a->a[i]), fabs(b->a[i]));
        most = fmax(most, fabs(b->v[i] - a->v[i] - 0.5 * h * (a->a[i] + b->a[i])) / unit);
        size = fmax(size, fmax(half, fmax(fabs(a->v[i]), fabs(b->v[i]))) / unit);
    }
    return most > fmax(KINK * size, REST);
}

core_status guard_pass(core *c) {
    core_watched now;
    core_status status;
    if (c->m.watched.on && c->m.watched.time >= c->m.time) return CORE_OK;
    memset(&now, 0, sizeof now);
    status = look(c, &now);
    if (status) return status;
    if (c->m.watched.on && (memcmp(now.sign, c->m.watched.sign, sizeof now.sign) ||
                            kinked(&c->m.watched, &now)))
        return passed(c);
    c->m.watched = now;
    return CORE_OK;
}

void guard_forget(core *c) { c->m.watched.on = 0; }

#else

core_status guard_restart(core *c) {
    (void)c;
    return CORE_OK;
}

core_status guard_pass(core *c) {
    (void)c;
    return CORE_OK;
}

void guard_forget(core *c) { (void)c; }

#endif
