#include "passage_crossing.h"

#include <math.h>
#include <string.h>

#include "passage_chart.h"

/* Distance between neighbours in means, in floors along the motion. It is larger than
 * FLOORS_REGULAR, so that the nearest neighbours, which are at least 4 - 1 = 3 floors away, are
 * regular. A tenth of it refuses starts on a branch; ten times more changes no motion of the
 * tests. */
#define FLOORS_BETWEEN 4.0

/* Weights of neighbours 1, 2 and 3 on either side: the mean is exact up to degree five. */
static const double MEAN_WEIGHTS[3] = {0.75, -0.3, 0.05};

double crossing_regularity(passage *g, double t, const double *x) {
    double value = 0.0;
    if (g->model.regularity(g->stepper->user, t, x, &value) || !isfinite(value)) value = 0.0;
    g->memory->regularity_max = fmax(g->memory->regularity_max, value);
    return value;
}

/* Compute x and the slopes at y as weighted means of three neighbours on either side. They are
 * `apart` from each other in direction `along` of the coordinates, and `shift` in time [s]. Returns
 * 1 if a neighbour is not regular. */
static int mean_of_neighbours(passage *g, double t, const double *y, double apart,
                              const double *along, double shift, double *x, double *xdot,
                              double *ydot) {
    int n = g->stepper->n, d = g->chart.dimension, ny = 2 * d + g->size.nz, i, j, side, status;
    double *at = g->scratch.neighbours, *slope = at + n, *rate = slope + n, *beside = rate + ny;
    memset(x, 0, sizeof(double) * (size_t)n);
    memset(xdot, 0, sizeof(double) * (size_t)n);
    memset(ydot, 0, sizeof(double) * (size_t)ny);
    for (j = 1; j <= 3; j++)
        for (side = -1; side <= 1; side += 2) {
            memcpy(beside, y, sizeof(double) * (size_t)ny);
            for (i = 0; i < d; i++) beside[i] += side * j * apart * along[i];
            g->guide.ahead = side * j * apart;
            status = chart_state(g, t + side * j * shift, beside, at, slope, rate);
            g->guide.ahead = 0.0;
            if (status) return 1;
            if (g->point.sigma < SIGMA_REGULAR * g->memory->sigma_max) return 1;
            for (i = 0; i < n; i++) x[i] += MEAN_WEIGHTS[j - 1] * at[i];
            for (i = 0; i < n; i++) xdot[i] += MEAN_WEIGHTS[j - 1] * slope[i];
            for (i = 0; i < ny; i++) ydot[i] += MEAN_WEIGHTS[j - 1] * rate[i];
        }
    memcpy(ydot, y + d, sizeof(double) * (size_t)d);
    return 0;
}

int crossing_state(passage *g, double t, const double *y, double *x, double *xdot, double *ydot) {
    int d = g->chart.dimension, i, status = chart_state(g, t, y, x, xdot, ydot);
    double largest = g->memory->sigma_max, dt = t - g->memory->origin_time, rho;
    double far = 0.0, speed = 0.0, apart, shift = 0.0, *along = g->scratch.direction;
    g->step.singular = 0;
    if (!status && g->point.sigma >= SIGMA_FLOOR * largest) {
        g->memory->sigma_max = fmax(largest, g->point.sigma);
        g->step.sigma = fmin(g->step.sigma, g->point.sigma / g->memory->sigma_max);
        return STEPPER_OK;
    }
    if (status == STEPPER_CHART_LEFT) return status;
    g->step.singular = 1;
    rho = g->origin.sigma / largest;
    for (i = 0; i < d; i++) far += y[i] * y[i], speed += y[d + i] * y[d + i];
    memcpy(along, y + d, sizeof(double) * (size_t)d);
    if (g->size.moving) {
        apart = shift = FLOORS_BETWEEN * SIGMA_FLOOR * fabs(dt) / rho;
    } else {
        if (!(speed > 0.0)) return STEPPER_SINGULAR;
        apart = FLOORS_BETWEEN * SIGMA_FLOOR * sqrt(far) / (rho * sqrt(speed));
    }
    if (!(apart > 0.0) || mean_of_neighbours(g, t, y, apart, along, shift, x, xdot, ydot))
        return STEPPER_SINGULAR;
    memcpy(x + g->size.nq + g->size.nv, y + 2 * d, sizeof(double) * (size_t)g->size.nz);
    g->step.sigma = fmin(g->step.sigma, SIGMA_FLOOR);
    return STEPPER_OK;
}
