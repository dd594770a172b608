#include "projection.h"

#include <math.h>
#include <string.h>

#include "finite.h"
#include "stepper.h"

/* Residual, relative to the largest state or 1: above rounding, and below the residual before the
 * last step, 1e-8. */
#define TOLERANCE 1e-12
#define STEPS 10 /* maximum Newton steps: each squares the error, more do not help */

int projection_converge(int n, projection_step step, void *user, double t, double *x,
                        double *after) {
    int k, i;
    for (k = 0; k < STEPS; k++) {
        double residual = 0.0, scale = 1.0; /* without constraints no residual is written */
        if (step(user, t, x, after, &residual) || !isfinite(residual)) return 1;
        for (i = 0; i < n; i++) scale = fmax(scale, fabs(x[i]));
        if (all_finite(after, n))
            memcpy(x, after, sizeof(double) * (size_t)n);
        else if (!(residual < TOLERANCE * scale)) /* else x satisfies dependent rows */
            return 1;
        if (residual < TOLERANCE * scale) return 0;
    }
    return 1;
}
