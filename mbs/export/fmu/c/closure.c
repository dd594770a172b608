#include "closure.h"

#include <math.h>
#include <string.h>

#if NZ > 0

#define RESIDUAL 1e-12   /* largest closure row, for coordinates of size 1 */
#define MOVE 1e-9        /* largest last Newton move: the next one would be its square */
#define NEXT 1e-15       /* largest next Newton move, as the last two of them foretell it */
#define ITERATIONS 30
#define REACH 0.5        /* largest Newton move, in nominal sizes, that stays on the branch */
#define SMALLEST (1.0 / 1024)
#define STEEPEST 1e4     /* nominal sizes that dependents move for one nominal size of the states */
/* A start is followed from the start values in steps of this length at most, of the states that lead the
 * dependents, in nominal sizes; the first one is shorter and tells the slope. */
#define STRIDE 0.2
#define FIRST 1e-3
/* Part of a move by which the dependents may end beside where their slope leads: on another branch
 * they differ by about the difference of the slopes, on the same one by half the step. */
#define BENT 0.1
#define TRIALS 64        /* postures from which a branch is looked for */
#define RANGE 3.14159265358979 /* of them about the start values, in nominal sizes */
#define ALIKE 1e-3       /* weight of the coordinates that were not guessed */

/* Where a Newton iteration stands: largest row before its last move, and that move. */
typedef struct {
    double residual, move;
} progress;

/* The closure holds; or rows and moves shrink together so fast that it does after this move. */
static int converged(progress now, progress before, double size) {
    double ratio = now.move / before.move;
    if (now.residual < RESIDUAL * size && now.move < MOVE * size) return 1;
    return now.residual < 10 * ratio * before.residual &&
           now.move * ratio * ratio < NEXT * size;
}

/* One Newton step at x, z to next. */
static int newton_step(core *c, const double *x, const double *z, double *next, double *residual) {
    c->arg[0] = x;
    c->arg[1] = z;
    c->arg[2] = c->m.values + PARAMETERS;
    c->res[0] = next;
    c->res[1] = residual;
    return mbs_closure(c->arg, c->res, c->iw, c->w, 0) || !isfinite(*residual);
}

/* Newton steps at x from z. reach: largest move that is trusted, in nominal sizes. */
static int newton(core *c, const double *x, double *z, double reach) {
    progress before = {0.0, HUGE_VAL};
    double next[NZ];
    int k, i;
    for (k = 0; k < ITERATIONS; k++) {
        progress now = {0.0, 0.0};
        double size = 1.0;
        if (newton_step(c, x, z, next, &now.residual)) return CLOSURE_SINGULAR;
        for (i = 0; i < NZ; i++) {
            double step = fabs(next[i] - z[i]);
            if (!isfinite(step)) return CLOSURE_SINGULAR;
            if (step > reach * MODEL_NOMINAL[DEPENDENTS + i]) return CLOSURE_OPEN;
            size = fmax(size, fabs(next[i]));
            now.move = fmax(now.move, step);
        }
        memcpy(z, next, sizeof next);
        if (converged(now, before, size)) return CLOSURE_OK;
        before = now;
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

/* From the accepted posture to x along a straight line, on the branch that the slopes lead to: it also
 * goes on where branches cross. */
static int follow(core *c, const double *x, double *z) {
    const double *from = c->m.posture_x, *size = MODEL_NOMINAL;
    double at[NX + 1], trial[NZ], slope[NZ] = {0}, length = 0.0, largest, part, done = 0.0;
    int i, known = 0, status;
    for (i = 0; i < NX; i++)
        if (MODEL_LEADS[i]) length = fmax(length, fabs(x[i] - from[i]) / size[STATES + i]);
    largest = fmin(1.0, STRIDE / fmax(length, STRIDE));
    part = length > 0.0 ? FIRST * largest : 1.0;
    memcpy(z, c->m.posture_z, sizeof trial);
    while (done < 1.0) {
        double to = fmin(1.0, done + part);
        for (i = 0; i < NX; i++) at[i] = to < 1.0 ? from[i] + to * (x[i] - from[i]) : x[i];
        for (i = 0; i < NZ; i++) trial[i] = z[i] + (to - done) * slope[i];
        status = newton(c, at, trial, REACH);
        for (i = 0; i < NZ && status == CLOSURE_OK && known; i++) {
            double off = fabs(trial[i] - z[i] - (to - done) * slope[i]);
            double most = fmax(length * size[DEPENDENTS + i], fabs(slope[i]));
            if (off > BENT * (to - done) * most) status = CLOSURE_OPEN;
        }
        if (status != CLOSURE_OK) {
            part /= 2;
            if (part < SMALLEST * FIRST * largest) return status;
            continue;
        }
        for (i = 0; i < NZ; i++) slope[i] = (trial[i] - z[i]) / (to - done);
        memcpy(z, trial, sizeof trial);
        known = 1;
        done = to;
        part = fmin(2 * part, largest);
    }
    return CLOSURE_OK;
}

/* z at x on the branch of the model's start values; near them where parameters open the loops. */
static int from_start(core *c, const double *x, double *z) {
    const double *start = MODEL_START + DEPENDENTS;
    memcpy(z, start, NZ * sizeof *z);
    if (newton(c, MODEL_START + STATES, z, HUGE_VAL) == CLOSURE_OK) {
        memcpy(c->m.posture_x, MODEL_START + STATES, NX * sizeof *x);
        memcpy(c->m.posture_z, z, NZ * sizeof *z);
        return follow(c, x, z);
    }
    memcpy(z, start, NZ * sizeof *z);
    return newton(c, x, z, HUGE_VAL);
}

static int guessed(const core *c, int i) { return c->m.guess[i] != MODEL_START[DEPENDENTS + i]; }

/* How far z is from the guesses and, with little weight, from the start values of the others. */
static double miss(const core *c, const double *z) {
    double far = 0.0, unlike = 0.0;
    int i;
    for (i = 0; i < NZ; i++) {
        double d = fabs(z[i] - c->m.guess[i]) / MODEL_NOMINAL[DEPENDENTS + i];
        if (guessed(c, i))
            far = fmax(far, d);
        else
            unlike = fmax(unlike, d);
    }
    return far + ALIKE * unlike;
}

/* Numbers from -1 to 1, the same in every run. */
static double scattered(unsigned k, unsigned i) {
    unsigned s = (k * 7919u + i * 104729u + 1u) & 0xffffffffu;
    int turn;
    for (turn = 0; turn < 3; turn++) {
        s ^= (s << 13) & 0xffffffffu;
        s ^= s >> 17;
        s ^= (s << 5) & 0xffffffffu;
    }
    return s / 2147483648.0 - 1.0;
}

/* Where trial k starts: at the guesses; the other coordinates at the start values, near the posture
 * that continues them, or anywhere. */
static void trial_start(const core *c, int k, const double *near, double *z) {
    int i;
    for (i = 0; i < NZ; i++) {
        z[i] = c->m.guess[i];
        if (guessed(c, i)) continue;
        if (k == 1) z[i] = near[i];
        if (k > 1)
            z[i] += RANGE * MODEL_NOMINAL[DEPENDENTS + i] * scattered((unsigned)k, (unsigned)i);
    }
}

/* Of the posture on the start values' branch and of those that Newton steps reach from other
 * places, the nearest to the guesses: a single guess is enough to choose a branch. */
static int near_guesses(core *c, const double *x, double *z) {
    double near[NZ], trial[NZ], best = HUGE_VAL;
    int k, status = from_start(c, x, near);
    if (status) memcpy(near, MODEL_START + DEPENDENTS, sizeof near);
    memcpy(z, near, sizeof near);
    if (status == CLOSURE_OK) best = miss(c, z);
    for (k = 0; k < TRIALS; k++) {
        trial_start(c, k, near, trial);
        if (newton(c, x, trial, HUGE_VAL) == CLOSURE_OK && miss(c, trial) < best) {
            best = miss(c, trial);
            memcpy(z, trial, sizeof trial);
            status = CLOSURE_OK;
        }
    }
    return status;
}

int closure_start(core *c, const double *x, double *z) {
    return c->m.guessed ? near_guesses(c, x, z) : from_start(c, x, z);
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
