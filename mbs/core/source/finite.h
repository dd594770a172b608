/* Test of arrays for numbers that are not finite. */
#ifndef MBS_FINITE_H
#define MBS_FINITE_H

#include <math.h>

/* Whether all elements of v (n,) are finite. */
static inline int all_finite(const double *v, int n) {
    int i;
    for (i = 0; i < n; i++)
        if (!isfinite(v[i])) return 0;
    return 1;
}

#endif
