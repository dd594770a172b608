#include "closure.h"

#include <math.h>
#include <string.h>

#include "references.h"

#if NZ > 0

#ifdef REAL_IS_FLOAT /* rows are sums of some ten roundings of 6e-8 */
#define RESIDUAL REAL(2e-6)
#define MOVE REAL(3e-4)
#define NEXT REAL(1e-7)
#define EQUAL REAL(1e-3) /* difference of distances that count as equal [rad, or loop sizes] */
#else
#define RESIDUAL REAL(1e-12) /* largest closure residual, for coordinates of size 1 */
#define MOVE REAL(1e-9)      /* largest last Newton step; the next step would be its square */
#define NEXT REAL(1e-15)     /* largest next Newton step, extrapolated from the last two steps */
#define EQUAL REAL(1e-6)     /* difference of distances that count as equal [rad, or loop sizes] */
#endif
#define ITERATIONS 30
#define REACH REAL(0.5) /* largest Newton step that stays on the branch, in nominal sizes */
#define SMALLEST REAL(0.0009765625)
#define STEEPEST REAL(1e4) /* largest change of dependents per change of a state, nominal sizes */
/* Largest step of the continuation from the start values, in nominal sizes of the states that
 * determine the dependents. FIRST: fraction of it for the first step, which finds the slope. */
#define STRIDE REAL(0.2)
#define FIRST REAL(1e-3)
/* Largest deviation of the dependents from their linear extrapolation, relative to the step. On
 * another branch it is about the difference of the slopes, on the same branch half the step. */
#define BENT REAL(0.1)
/* Largest remaining length of a line that ends in a singular configuration, in nominal sizes.
 * Newton steps reach a distance of 1e-6; a branch that ends earlier can leave any length. */
#define LEFT REAL(1e-4)
#define TRIALS 64 /* number of initial configurations in the search for a branch */
#define HALF_TURN REAL(3.14159265358979)
/* Distance from the guesses below which the search for other configurations ends [rad, or sizes of
 * the mechanism]. Branches that are closer to each other meet there. */
#define CLOSE REAL(0.1)
#define UNBOUNDED REAL(HUGE_VAL)

/* Progress of a Newton iteration: largest residual before its last step, and size of that step. */
typedef struct {
    real residual, move;
} progress;

/* Whether the closure holds, or residual and step decrease so fast that this step closes it. */
static int converged(progress now, progress before, real size) {
    real ratio = now.move / before.move;
    if (now.residual < RESIDUAL * size && now.move < MOVE * size) return 1;
    return now.residual < REAL(10.0) * ratio * before.residual &&
           now.move * ratio * ratio < NEXT * size;
}

/* One Newton step from z to next, at the states x. Nonzero on failure. */
static int newton_step(const loops *l, const real *x, const real *z, real *next, real *residual) {
    l->arg[0] = x;
    l->arg[1] = z;
    l->arg[2] = l->p;
    l->res[0] = next;
    l->res[1] = residual;
    return mbs_closure(l->arg, l->res, l->iw, l->w, 0) || !real_finite(*residual);
}

/* Newton iteration at x from z. reach: largest allowed step, in nominal sizes. */
static int newton(const loops *l, const real *x, real *z, real reach) {
    progress before = {REAL(0.0), UNBOUNDED};
    real next[NZ];
    int k, i;
    for (k = 0; k < ITERATIONS; k++) {
        progress now = {REAL(0.0), REAL(0.0)};
        real size = REAL(1.0);
        if (newton_step(l, x, z, next, &now.residual)) return CLOSURE_SINGULAR;
        for (i = 0; i < NZ; i++) {
            real step = real_abs(next[i] - z[i]);
            if (!real_finite(step)) return CLOSURE_SINGULAR;
            if (step > reach * MODEL_NOMINAL[DEPENDENTS + i]) return CLOSURE_OPEN;
            size = real_max(size, real_abs(next[i]));
            now.move = real_max(now.move, step);
        }
        memcpy(z, next, sizeof next);
        if (converged(now, before, size)) return CLOSURE_OK;
        before = now;
    }
    return CLOSURE_OPEN;
}

/* One Newton solve from the last accepted configuration. If it fails, continuation along a straight
 * line in x in shorter steps. */
SHARED int closure_solve(const loops *l, const real *x, real *z) {
    const real *from = l->x;
    real at[NX + 1], trial[NZ], done = REAL(0.0), part = REAL(1.0);
    int i, status;
    memcpy(z, l->z, sizeof trial);
    while (done < REAL(1.0)) {
        real to = real_min(REAL(1.0), done + part);
        for (i = 0; i < NX; i++) at[i] = to < REAL(1.0) ? from[i] + to * (x[i] - from[i]) : x[i];
        memcpy(trial, z, sizeof trial);
        status = newton(l, at, trial, REACH);
        if (status == CLOSURE_OK) {
            memcpy(z, trial, sizeof trial);
            done = to;
            part *= REAL(2.0);
        } else {
            part /= REAL(2.0);
            if (part < SMALLEST) return status;
        }
    }
    return CLOSURE_OK;
}

/* Continuation from the accepted configuration to x along a straight line. Linear extrapolation of
 * z keeps to the branch, also where branches cross. */
static int follow(const loops *l, const real *x, real *z) {
    const real *from = l->x, *size = MODEL_NOMINAL;
    real at[NX + 1], trial[NZ], slope[NZ], length = REAL(0.0), done = REAL(0.0), largest, part;
    int i, known = 0, status;
    for (i = 0; i < NZ; i++) slope[i] = REAL(0.0);
    for (i = 0; i < NX; i++)
        if (MODEL_LEADS[i]) length = real_max(length, real_abs(x[i] - from[i]) / size[STATES + i]);
    largest = real_min(REAL(1.0), STRIDE / real_max(length, STRIDE));
    part = length > REAL(0.0) ? FIRST * largest : REAL(1.0);
    memcpy(z, l->z, sizeof trial);
    while (done < REAL(1.0)) {
        real to = real_min(REAL(1.0), done + part);
        for (i = 0; i < NX; i++) at[i] = to < REAL(1.0) ? from[i] + to * (x[i] - from[i]) : x[i];
        for (i = 0; i < NZ; i++) trial[i] = z[i] + (to - done) * slope[i];
        status = newton(l, at, trial, REACH);
        for (i = 0; i < NZ && status == CLOSURE_OK && known; i++) {
            real off = real_abs(trial[i] - z[i] - (to - done) * slope[i]);
            real most = real_max(length * size[DEPENDENTS + i], real_abs(slope[i]));
            /* the error of the Newton solve may exceed the curvature of a short step */
            if (off > BENT * (to - done) * most + MOVE * size[DEPENDENTS + i])
                status = CLOSURE_OPEN;
        }
        if (status != CLOSURE_OK) {
            part /= REAL(2.0);
            if (part >= SMALLEST * FIRST * largest) continue;
            if ((REAL(1.0) - done) * length > LEFT) return status;
            for (i = 0; i < NZ; i++) z[i] += (REAL(1.0) - done) * slope[i];
            return CLOSURE_NEARLY;
        }
        for (i = 0; i < NZ; i++) slope[i] = (trial[i] - z[i]) / (to - done);
        memcpy(z, trial, sizeof trial);
        known = 1;
        done = to;
        part = real_min(REAL(2.0) * part, largest);
    }
    return CLOSURE_OK;
}

/* Compute z at x on the branch of the start values. If these do not close the loops, because
 * parameters have changed, Newton steps begin at the start values of z. */
static int from_start(const loops *l, const real *x, real *z) {
    const real *start = MODEL_START + DEPENDENTS;
    memcpy(z, start, NZ * sizeof *z);
    if (newton(l, MODEL_START + STATES, z, UNBOUNDED) == CLOSURE_OK) {
        memcpy(l->x, MODEL_START + STATES, NX * sizeof *x);
        memcpy(l->z, z, NZ * sizeof *z);
        return follow(l, x, z);
    }
    memcpy(z, start, NZ * sizeof *z);
    return newton(l, x, z, UNBOUNDED);
}

/* Whether dependent coordinate i has a guess. */
static int guessed(const loops *l, int i) { return l->guess[i] != MODEL_START[DEPENDENTS + i]; }

#if NCUT > 0
/* Whether position i of the cut joints has a guess. */
static int cut_guessed(const loops *l, int i) { return l->cut[i] != MODEL_START[CUTS + i]; }
#endif

/* Whether a dependent coordinate or a cut joint has a guess. */
static int any_guessed(const loops *l) {
    int i;
    for (i = 0; i < NZ; i++)
        if (guessed(l, i)) return 1;
#if NCUT > 0
    for (i = 0; i < NCUT; i++)
        if (cut_guessed(l, i)) return 1;
#endif
    return 0;
}

/* Difference of two values of dependent coordinate i, or of position i - NZ of the cut joints [rad
 * or m], of angles modulo a revolution.
 * Half a revolution is always positive, so that rounding cannot change its sign (aligned bars). */
static real difference(int i, real z, real other) {
    real d = z - other;
    if (!MODEL_TURNS[i]) return d;
    d = real_within_half_turn(d);
    return d < EQUAL - HALF_TURN ? d + REAL(2.0) * HALF_TURN : d;
}

/* Largest distance of the cut joints from their guesses at x, z [rad, or sizes of the mechanism]. */
static real cut_distance(const loops *l, const real *x, const real *z) {
    real far = REAL(0.0);
#if NCUT > 0
    real at[NCUT];
    int i, k;
    for (i = 0; i < NCUT && !cut_guessed(l, i); i++) continue;
    if (i == NCUT) return far;
    l->arg[0] = x;
    l->arg[1] = z;
    l->arg[2] = l->p;
    l->res[0] = at;
    if (mbs_cuts(l->arg, l->res, l->iw, l->w, 0)) return UNBOUNDED;
    for (i = 0; i < NCUT; i++) { /* a quaternion and its negative are one orientation */
        real along = REAL(0.0);
        for (k = i; MODEL_QUATERNIONS[i] && k < i + 4; k++) along += at[k] * l->cut[k];
        for (k = i; along < REAL(0.0) && k < i + 4; k++) at[k] = -at[k];
    }
    for (i = 0; i < NCUT; i++)
        if (cut_guessed(l, i))
            far =
                real_max(far, real_abs(difference(NZ + i, at[i], l->cut[i])) / MODEL_SPANS[NZ + i]);
#else
    (void)l, (void)x, (void)z;
#endif
    return far;
}

/* Largest distance of z from the guesses at the states x [rad, or sizes of the mechanism]. all: 1
 * for all coordinates, 0 for the guessed coordinates. Cut joints count if they are guessed. */
static real distance_from_guess(const loops *l, const real *x, const real *z, int all) {
    real far = cut_distance(l, x, z);
    int i;
    for (i = 0; i < NZ; i++)
        if (all || guessed(l, i))
            far = real_max(far, real_abs(difference(i, z[i], l->guess[i])) / MODEL_SPANS[i]);
    return far;
}

/* Whether z is nearer to the guesses than `other`, in the order of mbs.loops.nearest: distance of
 * the guessed coordinates, then of all, then the larger value of the first different coordinate. */
static int is_nearer(const loops *l, const real *x, const real *z, const real *other) {
    int i, all;
    for (all = 0; all < 2; all++) {
        real more = distance_from_guess(l, x, z, all) - distance_from_guess(l, x, other, all);
        if (real_abs(more) > EQUAL) return more < REAL(0.0);
    }
    for (i = 0; i < NZ; i++) {
        real more = difference(i, z[i], other[i]);
        if (real_abs(more) > EQUAL) return more > REAL(0.0);
    }
    return 0;
}

/* Change angles of z by whole revolutions to within half a revolution of the guesses, if that
 * closes the loops. Across a gear it does not. */
static void unwind(const loops *l, const real *x, real *z) {
    real near[NZ];
    int i;
    for (i = 0; i < NZ; i++) near[i] = l->guess[i] + difference(i, z[i], l->guess[i]);
    if (newton(l, x, near, REAL(1e-3)) == CLOSURE_OK) memcpy(z, near, sizeof near);
}

/* Pseudo-random number from -1 to 1 for trial k and coordinate i, the same in every run. */
static real scattered(unsigned k, unsigned i) {
    unsigned s = (k * 7919u + i * 104729u + 1u) & 0xffffffffu;
    int pass;
    for (pass = 0; pass < 3; pass++) {
        s ^= (s << 13) & 0xffffffffu;
        s ^= s >> 17;
        s ^= (s << 5) & 0xffffffffu;
    }
    return (real)s / REAL(2147483648.0) - REAL(1.0);
}

/* Initial z of trial k. Guessed coordinates begin at the guesses, at random in odd trials after the
 * first two. Other coordinates begin at the start values (k = 0), at `near`, the configuration on
 * the branch of the start values (k = 1), or at random. */
static void trial_start(const loops *l, int k, const real *near, real *z) {
    int i;
    for (i = 0; i < NZ; i++) {
        z[i] = l->guess[i];
        if (k == 1 && !guessed(l, i)) z[i] = near[i];
        if (k > 1 && (k % 2 || !guessed(l, i)))
            z[i] +=
                (MODEL_TURNS[i] ? HALF_TURN : MODEL_SPANS[i]) * scattered((unsigned)k, (unsigned)i);
    }
}

/* Compute the z that is nearest to the guesses, as in mbs.loops.nearest, among the configuration on
 * the branch of the start values and the solutions of Newton steps from the trial configurations.
 * A guess of one coordinate is enough to select a branch. */
static int near_guesses(const loops *l, const real *x, real *z) {
    real near[NZ], trial[NZ];
    int k, status = from_start(l, x, near);
    int found = status == CLOSURE_OK || status == CLOSURE_NEARLY;
    if (!found) memcpy(near, MODEL_START + DEPENDENTS, sizeof near);
    memcpy(z, near, sizeof near);
    if (status == CLOSURE_OK) unwind(l, x, z);
    for (k = 0; k < TRIALS; k++) {
        trial_start(l, k, near, trial);
        if (newton(l, x, trial, UNBOUNDED) != CLOSURE_OK) continue;
        unwind(l, x, trial);
        if (!found || is_nearer(l, x, trial, z)) {
            memcpy(z, trial, sizeof trial);
            status = CLOSURE_OK;
            found = 1;
        }
        if (k == 0 && distance_from_guess(l, x, trial, 1) < CLOSE) {
            memcpy(z, trial, sizeof trial);
            return CLOSURE_OK;
        }
    }
    return status;
}

SHARED int closure_start(const loops *l, const real *x, real *z) {
    return any_guessed(l) ? near_guesses(l, x, z) : from_start(l, x, z);
}

SHARED int closure_singular(const loops *l, const real *x, const real *z) {
    real steepness = REAL(0.0);
    l->arg[0] = x;
    l->arg[1] = z;
    l->arg[2] = l->p;
    l->res[0] = &steepness;
    return mbs_sensitivity(l->arg, l->res, l->iw, l->w, 0) || !(steepness < STEEPEST);
}

#else

SHARED int closure_solve(const loops *l, const real *x, real *z) {
    (void)l, (void)x, (void)z;
    return CLOSURE_OK;
}

SHARED int closure_start(const loops *l, const real *x, real *z) {
    (void)l, (void)x, (void)z;
    return CLOSURE_OK;
}

SHARED int closure_singular(const loops *l, const real *x, const real *z) {
    (void)l, (void)x, (void)z;
    return 0;
}

#endif
