#include "passage_newton.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "dense.h"
#include "finite.h"
#include "passage_frame.h"

/* Pivot of the Newton matrix that counts as zero, as a fraction of the largest pivot. It is ten
 * times the rounding error of the factorization, so that a matrix that is singular in exact
 * arithmetic is recognized. */
#define ZERO_PIVOT (10 * DBL_EPSILON)

/* Replace the residuals r of the rows and of xi by the least-squares Newton step, by a QR
 * factorization of the slopes (rows, nq). Returns 1 if they are dependent. */
static int least_squares_newton_step(passage *g, int rows, double *r) {
    double *K = g->scratch.matrix, least = HUGE_VAL, most = 0.0;
    int nq = g->size.nq, i, j, k;
    for (k = 0; k < nq; k++) {
        double weight = dense_reflection(K + k * rows + k, rows - k);
        for (j = k + 1; j < nq; j++)
            dense_reflect(K + k * rows + k, weight, rows - k, K + j * rows + k);
        dense_reflect(K + k * rows + k, weight, rows - k, r + k);
        least = fmin(least, fabs(K[k * rows + k]));
        most = fmax(most, fabs(K[k * rows + k]));
    }
    if (!(least > ZERO_PIVOT * most)) return 1;
    for (k = nq - 1; k >= 0; k--) {
        for (i = k + 1; i < nq; i++) r[k] -= K[i * rows + k] * r[i];
        r[k] /= K[k * rows + k];
    }
    return 0;
}

/* Newton step as in least_squares_newton_step, for as many rows as positions: first onto the sparse
 * rows of the loops, then in their null space by the dense rows D (d, nq) of xi. */
static int sparse_newton_step(passage *g, const double *slopes, const double *D, double *r) {
    sparse_qr *f = &g->scratch.qr;
    int n = g->size.nq, d = g->chart.dimension, m = n - d, i, j, k;
    double *step = g->scratch.y, *along = g->scratch.matrix + n * n, *S = g->scratch.square;
    double least = HUGE_VAL, most = 0.0;
    sparse_qr_begin(f, n, m);
    for (j = 0; j < m; j++)
        for (i = g->patterns.slope.begin[j]; i < g->patterns.slope.begin[j + 1]; i++)
            sparse_qr_put(f, n, g->patterns.slope.column[i], j, slopes[g->patterns.slope.from[i]]);
    sparse_qr_factorize(f, n, m, m, 0.0);
    for (k = 0; k < m; k++) {
        least = fmin(least, sparse_qr_pivot(f, n, k));
        most = fmax(most, sparse_qr_pivot(f, n, k));
    }
    if (!(least > ZERO_PIVOT * most)) return 1;
    memset(step, 0, sizeof(double) * (size_t)n);
    sparse_qr_solve_transposed(f, n, m, r, step);
    sparse_qr_multiply(f, n, m, step);
    sparse_qr_border(f, n, d, D, along, S);
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) r[m + k] -= D[k * n + i] * step[i];
    if (dense_solve_square(S, d, r + m, 1)) return 1;
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) step[i] += along[k * n + i] * r[m + k];
    memcpy(r, step, sizeof(double) * (size_t)n);
    return 0;
}

/* Append the rows of xi: to the matrix K the rows of C / |row|, to r the residuals C (x - q0) -
 * xi. */
static void add_coordinate_rows(const passage *g, const double *xi, const double *x, int rows,
                                double *K, double *r) {
    const double *q0 = g->origin_state, *C = g->chart.C;
    int nq = g->size.nq, m = g->size.positions, d = g->chart.dimension, j, k;
    for (k = 0; k < d; k++) {
        double size = 0.0, off = -xi[k];
        for (j = 0; j < nq; j++) size += C[j * d + k] * C[j * d + k];
        size = sqrt(size);
        for (j = 0; j < nq; j++) {
            K[rows == nq ? k * nq + j : j * rows + m + k] = C[j * d + k] / size;
            off += C[j * d + k] * (x[j] - q0[j]);
        }
        r[m + k] = off / size;
    }
}

int newton_project(passage *g, double t, const double *xi, double *x, double *distance) {
    passage_frame *p = &g->point;
    int nq = g->size.nq, m = g->size.positions, rows = m + g->chart.dimension, i, j, k, pass;
    int first = g->size.speeds - g->size.anchors, after = g->size.speeds;
    double *K = g->scratch.matrix, *r = g->scratch.residual, total = 0.0;
    for (pass = 0; pass < NEWTON_STEPS; pass++) {
        double move = 0.0;
        if (frame_rows(g, t, x, &p->rows)) return 1;
        memcpy(r, p->rows.position, sizeof(double) * (size_t)m);
        for (i = first; i < after; i++) r[i] -= g->origin.rows.position[i];
        if (rows != nq) {
            memset(K, 0, sizeof(double) * (size_t)(rows * nq));
            for (j = 0; j < nq; j++)
                for (i = g->patterns.slope.start[j]; i < g->patterns.slope.start[j + 1]; i++)
                    K[j * rows + g->patterns.slope.row[i]] = p->rows.slope[i];
        }
        add_coordinate_rows(g, xi, x, rows, K, r);
        if (rows < nq || !all_finite(r, rows)) return 1;
        if (rows == nq ? sparse_newton_step(g, p->rows.slope, K, r)
                       : least_squares_newton_step(g, rows, r))
            return 1;
        for (k = 0; k < nq; k++) {
            x[k] -= r[k];
            move = fmax(move, fabs(r[k]));
        }
        total += move;
        if (!isfinite(total)) return 1;
        if (move < NEWTON_CONVERGED) {
            *distance = total;
            return 0;
        }
    }
    return 1;
}
