#include "passage_chart.h"

#include <math.h>
#include <string.h>

#include "dense.h"
#include "finite.h"
#include "passage_frame.h"
#include "passage_newton.h"
#include "skyline.h"

/* Smallest alignment of the tangents with the chart, 1 at its origin and 0 if orthogonal, at which
 * the chart is used. At 0.2 the tangents are rotated by 78 degrees, and errors of the velocities
 * are magnified five times. A value above 1 permits no chart. With 0.02 no motion of the tests
 * changes. */
#define MIN_ALIGNMENT 0.2

/* Largest move from a guide onto the rows [rad or m]. It separates trial states of an external
 * integrator near the branch of the guide from states on other branches. A parallelogram accepts a
 * state 0.05 rad away and refuses one 0.15 rad away; the distances of other branches were not
 * measured. */
#define GUIDE_DISTANCE 0.1

/* Largest difference of the velocities from the velocities of a guide, as a fraction of its largest
 * velocity. It separates the branch of the guide from other branches, where velocities differ by
 * about their own size. A parallelogram accepts a difference of 0.05 and refuses 0.3. */
#define GUIDE_VELOCITY 0.1

/* Smallest velocity [rad/s or m/s] that GUIDE_VELOCITY is a fraction of, so that errors of a guide
 * at rest do not count. A parallelogram at rest accepts trial velocities of 5e-5 rad/s and refuses
 * 5e-4 rad/s. */
#define GUIDE_REST 1e-3

void chart_rates(const passage *g, const passage_frame *p, const double *v, double *y) {
    int i, k;
    for (k = 0; k < g->chart.dimension; k++) y[k] = 0.0;
    for (i = 0; i < g->size.nq; i++) {
        double rate = frame_position_rate(g, &p->rows, i, v);
        for (k = 0; k < g->chart.dimension; k++)
            y[k] += g->chart.C[i * g->chart.dimension + k] * rate;
    }
}

void chart_rate_rows(const passage *g, const passage_rows *rows, double *D) {
    int nq = g->size.nq, nv = g->size.nv, d = g->chart.dimension, i, j, k;
    for (k = 0; k < d; k++)
        for (j = 0; j < nv; j++) {
            double value = 0.0;
            if (nq == nv)
                value = g->chart.C[j * d + k];
            else
                for (i = g->patterns.N.start[j]; i < g->patterns.N.start[j + 1]; i++)
                    value += g->chart.C[g->patterns.N.row[i] * d + k] * rows->N[i];
            D[k * nv + j] = value;
        }
}

int chart_make(passage *g) {
    passage_frame *p = &g->origin;
    int nq = g->size.nq, nv = g->size.nv, i, j, k, d = nv - p->rank;
    double *S = g->scratch.square, *B = g->scratch.matrix; /* (nv, nv), (nv, d) */
    g->chart.dimension = d;
    for (k = 0; k < d; k++) {
        double *column = B + k * nv; /* M T = L L' T */
        memset(column, 0, sizeof(double) * (size_t)nv);
        for (i = 0; i < nv; i++) {
            double sum = 0.0;
            for (j = i; j < p->L_end[i]; j++) sum += p->L[i * nv + j] * p->T[k * nv + j];
            for (j = i; j < p->L_end[i]; j++) column[j] += p->L[i * nv + j] * sum;
        }
    }
    if (nq == nv) {
        for (k = 0; k < d; k++)
            for (i = 0; i < nq; i++) g->chart.C[i * d + k] = B[k * nv + i];
        return 0;
    }
    for (i = 0; i < nv; i++)
        for (j = 0; j < nv; j++) S[j * nv + i] = 0.0;
    for (k = 0; k < nq; k++)
        for (i = g->patterns.N.begin[k]; i < g->patterns.N.begin[k + 1]; i++)
            for (j = g->patterns.N.begin[k]; j < g->patterns.N.begin[k + 1]; j++)
                S[g->patterns.N.column[j] * nv + g->patterns.N.column[i]] +=
                    p->rows.N[g->patterns.N.from[i]] * p->rows.N[g->patterns.N.from[j]];
    if (dense_solve_square(S, nv, B, d)) return 1;
    for (k = 0; k < d; k++)
        for (i = 0; i < nq; i++) {
            g->chart.C[i * d + k] = 0.0;
            for (j = g->patterns.N.begin[i]; j < g->patterns.N.begin[i + 1]; j++)
                g->chart.C[i * d + k] +=
                    p->rows.N[g->patterns.N.from[j]] * B[k * nv + g->patterns.N.column[j]];
        }
    return 0;
}

int chart_coordinates(passage *g, double t, const double *x, double *y) {
    int nq = g->size.nq, d = g->chart.dimension, i, k;
    if (frame_rows(g, t, x, &g->point.rows)) return 1;
    for (k = 0; k < d; k++) {
        y[k] = 0.0;
        for (i = 0; i < nq; i++) y[k] += g->chart.C[i * d + k] * (x[i] - g->origin_state[i]);
    }
    chart_rates(g, &g->point, x + nq, y + d);
    memcpy(y + 2 * d, x + nq + g->size.nv, sizeof(double) * (size_t)g->size.nz);
    return 0;
}

/* Predict the positions from the guide, or by tangent and curvature from the origin. The prediction
 * selects the branch. Returns 1 on failure. */
static int predict_positions(passage *g, double t, const double *xi, double *x) {
    const double *x0 = g->origin_state;
    int nq = g->size.nq, nv = g->size.nv, n = g->stepper->n, i, j, k;
    double dt = g->size.moving ? t - g->memory->origin_time : 1.0, *D = g->scratch.y,
           *bend = g->scratch.w;
    passage_frame *p = &g->point;
    if (g->guide.state) {
        for (i = 0; i < nq; i++) x[i] = g->guide.state[i] + g->guide.ahead * g->guide.rate[i];
        return 0;
    }
    for (i = 0; i < nv; i++) {
        D[i] = g->size.moving ? g->chart.drift[i] * dt : 0.0;
        for (k = 0; k < g->chart.dimension; k++) D[i] += g->origin.T[k * nv + i] * xi[k];
    }
    memset(bend, 0, sizeof(double) * (size_t)nv);
    if (dt != 0.0) {
        memcpy(x, x0, sizeof(double) * (size_t)n);
        for (i = 0; i < nv; i++) x[nq + i] = D[i] / dt;
        if (frame_rows(g, g->memory->origin_time, x, &p->rows)) return 1;
        frame_solve_rows(g, &g->origin, p->rows.c, bend);
        frame_velocity(g, &g->origin, bend);
    }
    for (j = 0; j < nv; j++) D[j] += 0.5 * bend[j] * dt * dt;
    for (i = 0; i < nq; i++) {
        x[i] = x0[i] + frame_position_rate(g, &g->origin.rows, i, D);
    }
    return 0;
}

/* Whether the velocities v differ from the velocities of the guide by more than GUIDE_VELOCITY. */
static int leaves_guide(const passage *g, const double *v) {
    const double *guide = g->guide.state + g->size.nq;
    double speed = GUIDE_REST, miss = 0.0;
    int i;
    for (i = 0; i < g->size.nv; i++) {
        speed = fmax(speed, fabs(guide[i]));
        miss = fmax(miss, fabs(v[i] - guide[i]));
    }
    return !(miss < GUIDE_VELOCITY * speed);
}

/* Compute the velocity v = T (C N T)^-1 (u - C N v_p) + v_p that has the rates u of the
 * coordinates and satisfies all rows, and the alignment of the tangents. Returns a status of the
 * stepper. */
static int velocity_at(passage *g, const double *u, double *v) {
    passage_frame *p = &g->point;
    int nv = g->size.nv, d = g->chart.dimension, i, k;
    double *S = g->scratch.square, *B = g->scratch.matrix, *w = g->scratch.w, size = 0.0;
    memset(v, 0, sizeof(double) * (size_t)nv);
    memcpy(w, u, sizeof(double) * (size_t)d);
    if (g->size.moving) {
        frame_particular_velocity(g, p, v);
        chart_rates(g, p, v, g->scratch.residual);
        for (k = 0; k < d; k++) w[k] -= g->scratch.residual[k];
    }
    for (k = 0; k < d; k++) chart_rates(g, p, p->T + k * nv, S + k * d);
    memset(B, 0, sizeof(double) * (size_t)(d * (d + 1))); /* (C N T)^-1 and the solution */
    for (k = 0; k < d; k++) B[k * d + k] = 1.0;
    memcpy(B + d * d, w, sizeof(double) * (size_t)d);
    if (dense_solve_square(S, d, B, d + 1)) return STEPPER_CHART_LEFT;
    for (k = 0; k < d * d; k++) size += B[k] * B[k];
    g->chart.alignment = sqrt((double)(d ? d : 1) / size);
    if (!(g->chart.alignment > MIN_ALIGNMENT)) return STEPPER_CHART_LEFT;
    for (k = 0; k < d; k++)
        for (i = 0; i < nv; i++) v[i] += p->T[k * nv + i] * B[d * d + k];
    return STEPPER_OK;
}

/* Compute the accelerations a from the forces: L^-1 f along the tangents, and the component that
 * the rows require. */
static void acceleration_at(passage *g, double *a) {
    passage_frame *p = &g->point;
    const sparse_pattern *J = &g->patterns.J;
    int nv = g->size.nv, i, j, k;
    for (i = 0; i < nv; i++) {
        double sum = p->f[i];
        for (j = J->start[i]; j < J->start[i + 1] && p->penalty > 0.0; j++)
            sum += p->penalty * p->rows.J[j] * p->rows.c[J->row[j]];
        a[i] = sum;
    }
    skyline_solve(p->L, p->L_end, nv, a);
    for (k = 0; k < p->rank; k++) sparse_qr_reflect(&p->qr, nv, k, a);
    frame_solve_rows(g, p, p->rows.c, a);
    frame_velocity(g, p, a);
}

/* Compute the slopes of x and y from the velocities in x and the accelerations in xdot. */
static void slopes_at(passage *g, const double *y, const double *x, double *xdot, double *ydot) {
    const passage_frame *p = &g->point;
    int nq = g->size.nq, nv = g->size.nv, nz = g->size.nz, d = g->chart.dimension, i, k;
    const double *v = x + nq, *a = xdot + nq;
    for (i = 0; i < nq; i++) xdot[i] = frame_position_rate(g, &p->rows, i, v);
    memcpy(xdot + nq + nv, p->rate, sizeof(double) * (size_t)nz);
    memcpy(ydot, y + d, sizeof(double) * (size_t)d);
    chart_rates(g, p, a, ydot + d);
    for (i = 0; i < nq; i++)
        for (k = 0; k < d; k++) ydot[d + k] += g->chart.C[i * d + k] * p->rows.bend[i];
    memcpy(ydot + 2 * d, p->rate, sizeof(double) * (size_t)nz);
}

int chart_state(passage *g, double t, const double *y, double *x, double *xdot, double *ydot) {
    passage_frame *p = &g->point;
    int nq = g->size.nq, nv = g->size.nv, d = g->chart.dimension, status;
    double distance, *v = x + nq;
    if (predict_positions(g, t, y, x)) return STEPPER_SINGULAR;
    memset(v, 0, sizeof(double) * (size_t)nv);
    memcpy(x + nq + nv, y + 2 * d, sizeof(double) * (size_t)g->size.nz);
    if (newton_project(g, t, y, x, &distance)) return STEPPER_SINGULAR;
    if (g->guide.state && distance > GUIDE_DISTANCE) return STEPPER_CHART_LEFT;
    if (frame_evaluate(g, p, t, x) || frame_factorize(g, p)) return STEPPER_SINGULAR;
    if (p->rank != g->origin.rank) return STEPPER_CHART_LEFT;
    status = velocity_at(g, y + d, v);
    if (status) return status;
    if (g->guide.state && leaves_guide(g, v)) return STEPPER_SINGULAR;
    if (frame_rows(g, t, x, &p->rows) ||
        g->model.forces(g->stepper->user, t, x, g->scratch.square, p->f, p->rate))
        return STEPPER_SINGULAR;
    acceleration_at(g, xdot + nq);
    slopes_at(g, y, x, xdot, ydot);
    return all_finite(xdot, g->stepper->n) ? STEPPER_OK : STEPPER_SINGULAR;
}
