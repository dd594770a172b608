#include "watch.h"

#include <math.h>

#if NB > 0

/* Part of the velocities that may differ from what the accelerations at the ends make of a step. A
 * smooth motion differs by the cube of the step, a few hundredths in the longest steps that hosts
 * make; where branches cross under an angle, velocities change by about their own size. */
#define KINK REAL(0.25)

/* Part of their nominal values below which velocities are at rest, as on a stop: what changes there is
 * the rounding of the equations of closure, some 1e-13 (1e-5 in single precision). A motion as slow
 * takes a year for a revolution (half a day). */
#ifdef REAL_IS_FLOAT
#define REST REAL(1e-4)
#else
#define REST REAL(1e-8)
#endif

#define AT(i, j) J[MODEL_COLUMNS[first + (j)] * NZ + MODEL_ROWS[first + (i)]]

/* Elimination with row exchanges, block after block. */
SHARED int watch_signs(const loops *l, const real *x, const real *z, real *sign, real *J) {
    int b, i, j, k, first = 0;
    l->arg[0] = x;
    l->arg[1] = z;
    l->arg[2] = l->p;
    l->res[0] = J;
    if (mbs_slopes(l->arg, l->res, l->iw, l->w, 0)) return 1;
    for (b = 0; b < NB; first = MODEL_BLOCKS[b++]) {
        int n = MODEL_BLOCKS[b] - first;
        sign[b] = REAL(1.0);
        for (k = 0; k < n; k++) {
            int pivot = k;
            for (i = k + 1; i < n; i++)
                if (real_abs(AT(i, k)) > real_abs(AT(pivot, k))) pivot = i;
            for (j = k; j < n && pivot != k; j++) {
                real kept = AT(k, j);
                AT(k, j) = AT(pivot, j);
                AT(pivot, j) = kept;
            }
            if (pivot != k) sign[b] = -sign[b];
            if (!real_finite(AT(k, k)) || !(real_abs(AT(k, k)) > REAL(0.0))) return 1;
            if (AT(k, k) < REAL(0.0)) sign[b] = -sign[b];
            for (j = k + 1; j < n; j++)
                for (i = k + 1; i < n; i++) AT(i, j) -= AT(i, k) * AT(k, j) / AT(k, k);
        }
    }
    return 0;
}

/* Velocities changed by other than what the accelerations make of the step. */
static int kinked(const watched *a, const watched *b, const real *unit) {
    real h = b->time - a->time, size = REAL(0.0), most = REAL(0.0);
    int i;
    for (i = 0; i < N_PASSIVE; i++) {
        real half = REAL(0.5) * h * real_max(real_abs(a->a[i]), real_abs(b->a[i]));
        real change = b->v[i] - a->v[i] - REAL(0.5) * h * (a->a[i] + b->a[i]);
        most = real_max(most, real_abs(change) / unit[i]);
        size = real_max(
            size, real_max(half, real_max(real_abs(a->v[i]), real_abs(b->v[i]))) / unit[i]);
    }
    return most > real_max(KINK * size, REST);
}

SHARED int watch_differ(const watched *before, const watched *now, const real *unit) {
    int b;
    for (b = 0; b < NB; b++)
        if (before->sign[b] * now->sign[b] < REAL(0.0)) return 1;
    return kinked(before, now, unit);
}

#endif
