#include "closure.h"

#include <math.h>
#include <string.h>

#if NZ > 0

#define RESIDUAL 1e-12   /* largest closure row, for coordinates of size 1 */
#define MOVE 1e-9        /* largest last Newton move: the next one would be its square */
#define ITERATIONS 30
#define REACH 0.5        /* largest Newton move, in nominal sizes, that stays on the branch */
#define SMALLEST (1.0 / 1024)
#define STEEPEST 1e4     /* nominal sizes that dependents move for one nominal size of the states */

/* Newton steps at x from z. reach: largest move that is trusted, in nominal sizes. */
static int newton(core *c, const double *x, double *z, double reach) {
    const double *p = c->m.values + PARAMETERS;
    double next[NZ];
    int k, i;
    for (k = 0; k < ITERATIONS; k++) {
        double residual = 0.0, move = 0.0, size = 1.0;
        c->arg[0] = x;
        c->arg[1] = z;
        c->arg[2] = p;
        c->res[0] = next;
        c->res[1] = &residual;
        if (mbs_closure(c->arg, c->res, c->iw, c->w, 0) || !isfinite(residual))
            return CLOSURE_SINGULAR;
        for (i = 0; i < NZ; i++) {
            double step = fabs(next[i] - z[i]);
            if (!isfinite(step)) return CLOSURE_SINGULAR;
            if (step > reach * MODEL_NOMINAL[DEPENDENTS + i]) return CLOSURE_OPEN;
            size = fmax(size, fabs(next[i]));
            move = fmax(move, step);
        }
        memcpy(z, next, sizeof next);
        if (residual < RESIDUAL * size && move < MOVE * size) return CLOSURE_OK;
    }
    return CLOSURE_OPEN;
}

/* From the accepted posture to x in one go, or along a straight line in shorter ones. */
int closure_solve(core *c, const double *x, double *z) {
    const double *from = c->m.posture_x;
    double at[NX + 1], trial[NZ], done = 0.0, part = 1.0;
    int i, status;
    memcpy(z, c->m.posture_z, sizeof trial);
    while (done < 1.0) {
        double to = fmin(1.0, done + part);
        for (i = 0; i < NX; i++) at[i] = to < 1.0 ? from[i] + to * (x[i] - from[i]) : x[i];
        memcpy(trial, z, sizeof trial);
        status = newton(c, at, trial, REACH);
        if (status == CLOSURE_OK) {
            memcpy(z, trial, sizeof trial);
            done = to;
            part *= 2;
        } else {
            part /= 2;
            if (part < SMALLEST) return status;
        }
    }
    return CLOSURE_OK;
}

int closure_start(core *c, const double *x, double *z) {
    memcpy(z, c->m.guess, NZ * sizeof *z);
    if (!c->m.guessed && newton(c, MODEL_START + STATES, z, HUGE_VAL) == CLOSURE_OK) {
        memcpy(c->m.posture_x, MODEL_START + STATES, NX * sizeof *x);
        memcpy(c->m.posture_z, z, NZ * sizeof *z);
        if (closure_solve(c, x, z) == CLOSURE_OK) return CLOSURE_OK;
    }
    memcpy(z, c->m.guess, NZ * sizeof *z);
    return newton(c, x, z, HUGE_VAL);
}

int closure_singular(core *c, const double *x, const double *z) {
    double steepness = 0.0;
    c->arg[0] = x;
    c->arg[1] = z;
    c->arg[2] = c->m.values + PARAMETERS;
    c->res[0] = &steepness;
    return mbs_sensitivity(c->arg, c->res, c->iw, c->w, 0) || !(steepness < STEEPEST);
}

#else

int closure_solve(core *c, const double *x, double *z) {
    (void)c, (void)x, (void)z;
    return CLOSURE_OK;
}

int closure_start(core *c, const double *x, double *z) {
    (void)c, (void)x, (void)z;
    return CLOSURE_OK;
}

int closure_singular(core *c, const double *x, const double *z) {
    (void)c, (void)x, (void)z;
    return 0;
}

#endif
