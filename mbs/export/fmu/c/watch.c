#include "watch.h"

#include <math.h>

#if NB > 0

/* Largest difference between the change of a velocity and the trapezoidal integral of its
 * acceleration, relative to the velocity. In a smooth motion it is of third order in the step, a
 * few hundredths in the longest usual steps. At a crossing of branches it is about 1. */
#define KINK REAL(0.25)

/* Velocity that counts as rest, relative to the nominal value. A mechanism at rest on a stop shows
 * rounding errors of the closure equations, about 1e-13 (1e-5 in single precision). At the limit a
 * revolution takes a year (half a day in single precision). */
#ifdef REAL_IS_FLOAT
#define REST REAL(1e-4)
#else
#define REST REAL(1e-8)
#endif

#define AT(i, j) J[MODEL_COLUMNS[first + (j)] * NZ + MODEL_ROWS[first + (i)]]

/* Gaussian elimination with row exchanges, block by block. */
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

/* Whether a velocity change differs from the trapezoidal integral of the acceleration: an impact or
 * discontinuity. */
static int kinked(const watched *a, const watched *b, const real *unit) {
    real h = b->time - a->time, size = REAL(0.0), most = REAL(0.0);
    int i;
    for (i = 0; i < N_PASSIVE; i++) {
        real half = REAL(0.5) * h * real_max(real_abs(a->a[i]), real_abs(b->a[i]));
        real change = b->v[i] - a->v[i] - REAL(0.5) * h * (a->a[i] + b->a[i]);
        most = real_max(most, real_abs(change) / unit[i]);
        size = real_max(size,
                        real_max(half, real_max(real_abs(a->v[i]), real_abs(b->v[i]))) / unit[i]);
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
