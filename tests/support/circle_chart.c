/* A point of mass 1 on the unit circle, for steps in local tangent coordinates (passage_external.h).
 *
 * The tangent at the angle a is (-sin a, cos a), so that its alignment with the tangent at angle 0
 * is cos a.
 */
#include <math.h>
#include <string.h>

#include "dopri5.h"
#include "passage_external.h"

enum { N = 4 }; /* state: position (2,) and velocity (2,) */

static int rows(void *user, double t, const double *x, const passage_rows *rows) {
    (void)user;
    (void)t;
    rows->position[0] = x[0] * x[0] + x[1] * x[1] - 1.0;
    rows->slope[0] = 2.0 * x[0];
    rows->slope[1] = 2.0 * x[1];
    rows->b[0] = 0.0;
    rows->c[0] = -2.0 * (x[2] * x[2] + x[3] * x[3]);
    rows->rank[0] = 1.0;
    return 0;
}

static int forces(void *user, double t, const double *x, double *M, double *f, double *rate) {
    (void)user;
    (void)t;
    (void)x;
    (void)rate;
    M[0] = M[3] = 1.0;
    M[1] = M[2] = f[0] = f[1] = 0.0;
    return 0;
}

static int regularity(void *user, double t, const double *x, double *value) {
    (void)user;
    (void)t;
    (void)x;
    *value = 1.0;
    return 0;
}

static int rhs(void *user, double t, const double *x, double *xdot) {
    (void)user;
    (void)t;
    (void)x;
    memset(xdot, 0, sizeof(double) * N);
    return 0;
}

static void state_at(double angle, double *x) {
    x[0] = cos(angle);
    x[1] = sin(angle);
    x[2] = -sin(angle);
    x[3] = cos(angle);
}

/* Compute the state (4,) at an angle [rad] and speed 1 by the chart at angle 0, and the alignment
 * of the tangents. Returns a status of the stepper, or -1 without memory. */
int circle_state(double angle, double *x, double *alignment) {
    static const passage_size size = {2, 2, 0, 1, 0, 1, 0};
    static const passage_model model = {rows, forces, regularity, 1.0};
    double memory[STEPPER_MEMORY(N)], work[DOPRI5_WORK(N)], chart_origin[N];
    passage_memory own;
    double origin[N], guide[N], y[2], slope_x[N], slope_y[2];
    passage *chart;
    stepper s;
    int status;
    dopri5_init(&s, N, rhs, NULL, memory, work);
    chart = passage_new(&s, &size, NULL, &model, &own, chart_origin);
    if (!chart) return -1;
    stepper_start(&s, 0.0);
    state_at(0.0, origin);
    state_at(angle, guide);
    status = passage_chart(chart, 0.0, origin);
    if (!status) status = passage_coordinates(chart, 0.0, guide, y);
    if (!status)
        status = passage_state(chart, 0.0, y, guide, x, slope_x, slope_y, alignment);
    passage_free(chart);
    return status;
}
