#include "passage_external.h"

#include <math.h>
#include <string.h>

#include "dense.h"
#include "passage_chart.h"
#include "passage_crossing.h"
#include "passage_frame.h"
#include "passage_near_miss.h"
#include "passage_origin.h"

int passage_chart(passage *g, double t, const double *x) {
    int status;
    g->prepared.valid = 0;
    status = origin_prepare(g, t, x);
    g->prepared.valid = 0;
    g->chart.valid = !status;
    return status;
}

int passage_coordinates(passage *g, double t, const double *x, double *y) {
    return origin_restore(g) || chart_coordinates(g, t, x, y) ? STEPPER_SINGULAR : STEPPER_OK;
}

int passage_state(passage *g, double t, const double *y, const double *guide, double *x,
                  double *slope_x, double *slope_y, double *alignment) {
    double largest = g->memory->sigma_max;
    int nq = g->size.nq, i, status;
    if (origin_restore(g) || frame_rows(g, t, guide, &g->point.rows)) return STEPPER_SINGULAR;
    for (i = 0; i < nq; i++)
        g->guide.rate[i] = frame_position_rate(g, &g->point.rows, i, guide + nq);
    g->guide.state = guide;
    g->step.sigma = HUGE_VAL;
    status = crossing_state(g, t, y, x, slope_x, slope_y);
    g->guide.state = NULL;
    g->memory->sigma_max = largest;
    *alignment = g->chart.alignment;
    return status;
}

int passage_jumps(passage *g, double t, const double *x, const double *first, double h,
                  const double *y, const double *last) {
    return near_miss_jumped(g, t, x, h, y, first, last);
}

int passage_grip(passage *g, double t, const double *x, const int *independent, const double *unit,
                 double *grip) {
    double *S = g->scratch.square, *B = g->scratch.matrix, most = 1.0;
    int nv = g->size.nv, d, i, j, k;
    if (frame_evaluate(g, &g->point, t, x) || frame_factorize(g, &g->point)) return 1;
    d = nv - g->point.rank;
    for (k = 0; k < d; k++) { /* v = T S^-1 v[independent], transposed */
        for (i = 0; i < d; i++) {
            int number = independent[i];
            S[i * d + k] = g->point.T[k * nv + number] * unit[number];
        }
        for (j = 0; j < nv; j++) B[j * d + k] = g->point.T[k * nv + j] * unit[j];
    }
    *grip = 0.0;
    if (dense_solve_square(S, d, B, nv)) return 0;
    for (j = 0; j < nv * d; j++) most = fmax(most, fabs(B[j]));
    *grip = isfinite(most) ? 1.0 / most : 0.0;
    return 0;
}

double passage_regularity(passage *g, double t, const double *x) {
    return crossing_regularity(g, t, x) / g->memory->regularity_max;
}
