#include "passage_near_miss.h"

#include <math.h>
#include <string.h>

#include "dense.h"
#include "dopri5.h"
#include "passage_chart.h"
#include "passage_crossing.h"
#include "passage_frame.h"

/* Number of bisections that locate dependent rows in a step, to 3e-8 of its length. With 10
 * bisections a miss by 1e-8 m is jumped over at a tolerance of 1e-3. */
#define BISECTIONS 25

/* Largest residual of the rows [rad or m] at a singular configuration at which branches meet. A
 * larger residual may explain why a motion stops. Positions satisfy the rows to 1e-13; with 2e-12
 * the message at a miss by 1e-12 does not name the reason. */
#define BRANCHES_MEET 2e-13

/* Fill K (nv, nv) with the velocity rows that the origin selected and the rows C N of the
 * coordinates, or with the transpose. K is singular if the rows are dependent. */
static void bordered_matrix(const passage *g, const passage_rows *rows, int transposed, double *K) {
    int nv = g->size.nv, rank = g->origin.rank, j, k;
    double *D = g->scratch.square;
    chart_rate_rows(g, rows, D);
    memset(K, 0, sizeof(double) * (size_t)(nv * nv));
    for (k = 0; k < rank; k++) {
        int row = g->origin.qr.pivot_column[k];
        for (j = g->patterns.J.begin[row]; j < g->patterns.J.begin[row + 1]; j++) {
            int column = g->patterns.J.column[j];
            K[transposed ? k * nv + column : column * nv + k] = rows->J[g->patterns.J.from[j]];
        }
    }
    for (k = rank; k < nv; k++)
        for (j = 0; j < nv; j++) K[transposed ? k * nv + j : j * nv + k] = D[(k - rank) * nv + j];
}

/* Sign of the permutation order (n,), -1 if it is odd. seen (n,) is scratch. */
static int permutation_sign(const int *order, int n, int *seen) {
    int sign = 1, i, j;
    for (i = 0; i < n; i++) seen[i] = 0;
    for (i = 0; i < n; i++)
        for (j = order[i]; !seen[i] && j != i; j = order[j]) seen[j] = 1, sign = -sign;
    return sign;
}

/* Factorize the bordered matrix by its sparse rows: factors in the scratch memory, Z and S of
 * sparse_qr_border. */
static void factorize_bordered(passage *g, const passage_rows *rows, double *Z, double *S) {
    sparse_qr *f = &g->scratch.qr;
    int n = g->size.nv, rank = g->origin.rank, i, k;
    double *D = Z + n * g->chart.dimension;
    sparse_qr_begin(f, n, rank);
    for (k = 0; k < rank; k++) {
        int row = g->origin.qr.pivot_column[k];
        for (i = g->patterns.J.begin[row]; i < g->patterns.J.begin[row + 1]; i++)
            sparse_qr_put(f, n, g->patterns.J.column[i], k, rows->J[g->patterns.J.from[i]]);
    }
    sparse_qr_factorize(f, n, rank, rank, 0.0);
    chart_rate_rows(g, rows, D);
    sparse_qr_border(f, n, g->chart.dimension, D, Z, S);
}

/* Sign of the determinant of the bordered matrix by its sparse rows, 0 if it is singular. Each
 * reflection changes the sign. */
static int sign_of_bordered(passage *g, const passage_rows *rows) {
    sparse_qr *f = &g->scratch.qr;
    int n = g->size.nv, rank = g->origin.rank, sign, k;
    double *S = g->scratch.square;
    factorize_bordered(g, rows, g->scratch.matrix, S);
    sign = permutation_sign(f->pivot_row, n, f->last_column) *
           permutation_sign(f->pivot_column, rank, f->last_column);
    for (k = 0; k < rank; k++) {
        double pivot = f->A[f->pivot_column[k] * n + f->pivot_row[k]];
        if (!(fabs(pivot) > 0.0)) return 0;
        if ((pivot < 0.0) != (f->weight[k] != 0.0)) sign = -sign;
    }
    return sign * dense_eliminate(S, g->chart.dimension, NULL, 0);
}

/* Solve K y = b in place: onto the constraint rows, then along their null space Z. */
static int solve_bordered_plain(passage *g, const double *Z, const double *D, double *S, double *z,
                                double *y) {
    const sparse_qr *f = &g->scratch.qr;
    int n = g->size.nv, rank = g->origin.rank, d = g->chart.dimension, i, k;
    sparse_qr_solve_transposed(f, n, rank, y, z);
    sparse_qr_multiply(f, n, rank, z);
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) y[rank + k] -= D[k * n + i] * z[i];
    if (dense_solve_square(S, d, y + rank, 1)) return 1;
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) z[i] += Z[k * n + i] * y[rank + k];
    memcpy(y, z, sizeof(double) * (size_t)n);
    return 0;
}

/* Solve K' y = b in place: the coordinate rows first, because only they act in the null space Z. */
static int solve_bordered_transposed(passage *g, const double *Z, const double *D, double *S,
                                     double *z, double *y) {
    const sparse_qr *f = &g->scratch.qr;
    int n = g->size.nv, rank = g->origin.rank, d = g->chart.dimension, i, k;
    for (k = 0; k < d; k++) {
        double sum = 0.0;
        for (i = 0; i < n; i++) sum += Z[k * n + i] * y[i];
        z[k] = sum;
    }
    for (k = 0; k < d; k++) /* S transposed */
        for (i = 0; i < k; i++) {
            double kept = S[k * d + i];
            S[k * d + i] = S[i * d + k];
            S[i * d + k] = kept;
        }
    if (dense_solve_square(S, d, z, 1)) return 1;
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) y[i] -= D[k * n + i] * z[k];
    for (k = 0; k < rank; k++) sparse_qr_reflect(f, n, k, y);
    for (k = rank - 1; k >= 0; k--) {
        int own = f->pivot_column[k];
        const double *column = f->A + own * n;
        z[d + own] = y[f->pivot_row[k]] / column[f->pivot_row[k]];
        for (i = 0; i < f->upper_count[own]; i++)
            y[f->upper[own * n + i]] -= column[f->upper[own * n + i]] * z[d + own];
    }
    memcpy(y, z + d, sizeof(double) * (size_t)rank);
    memcpy(y + rank, z, sizeof(double) * (size_t)d);
    return 0;
}

/* Compute y = K^-1 y, or y = K^-T y if transposed, for the bordered matrix K by its sparse rows.
 * Returns 1 if it is singular. */
static int solve_bordered(passage *g, const passage_rows *rows, int transposed, double *y) {
    int n = g->size.nv, rank = g->origin.rank, d = g->chart.dimension, k;
    double *Z = g->scratch.matrix, *D = Z + n * d, *z = D + n * d, *S = g->scratch.square;
    factorize_bordered(g, rows, Z, S);
    memset(z, 0, sizeof(double) * (size_t)n);
    for (k = 0; k < rank; k++)
        if (sparse_qr_pivot(&g->scratch.qr, n, k) == 0.0) return 1;
    return transposed ? solve_bordered_transposed(g, Z, D, S, z, y)
                      : solve_bordered_plain(g, Z, D, S, z, y);
}

/* Sign of the determinant of the bordered matrix: the side of the singular configuration on which a
 * state is. */
static int determinant_sign(passage *g, const passage_rows *rows) {
    if (g->origin.rank > MANY_ROWS) return sign_of_bordered(g, rows);
    bordered_matrix(g, rows, 0, g->scratch.matrix);
    return dense_eliminate(g->scratch.matrix, g->size.nv, NULL, 0);
}

/* Residual of the rows that no change of positions removes at a singular configuration. It is zero
 * if branches of motion meet there. */
static double closure_gap(passage *g, const passage_rows *rows) {
    int n = g->size.nv, first = g->size.speeds - g->size.anchors, i, pass, status;
    double *y = g->scratch.y, most = 0.0, sum = 0.0;
    for (i = 0; i < n; i++) y[i] = 1.0;
    for (pass = 0; pass < 2; pass++) { /* inverse iteration: right and left null vector */
        if (g->origin.rank > MANY_ROWS) {
            status = solve_bordered(g, rows, pass, y);
        } else {
            bordered_matrix(g, rows, pass, g->scratch.matrix);
            status = dense_solve_square(g->scratch.matrix, n, y, 1);
        }
        if (status) return 0.0;
        for (most = 0.0, i = 0; i < n; i++) most = fmax(most, fabs(y[i]));
        for (i = 0; i < n; i++) y[i] /= most;
    }
    for (most = 0.0, i = 0; i < g->origin.rank; i++) {
        int row = g->origin.qr.pivot_column[i], anchored = row >= first && row < g->size.speeds;
        most = fmax(most, fabs(y[i]));
        sum += y[i] * (rows->position[row] - (anchored ? g->origin.rows.position[row] : 0.0));
    }
    return most > 0.0 ? fabs(sum) / most : 0.0;
}

/* Locate the singular configuration in a step by bisection of the sign of the determinant, before
 * which it is `sign`. *fraction: part of the step at its end. Leaves the rows there in g->point.
 * Returns 1 on failure. */
static int locate_crossing(passage *g, double t, double h, int sign, double *fraction) {
    double low = 0.0, high = 1.0, *at = g->scratch.state;
    int k;
    for (k = 0; k < BISECTIONS; k++) {
        double middle = 0.5 * (low + high);
        dopri5_interpolate(g->dense.attempted, g->stepper->n, middle, at);
        if (frame_rows(g, t + middle * h, at, &g->point.rows)) return 1;
        if (sign * determinant_sign(g, &g->point.rows) > 0)
            low = middle;
        else
            high = middle;
    }
    *fraction = high;
    return 0;
}

/* Squared length of v in the metric of M = L L' at the present state. */
static double squared_speed(const passage *g, const double *v) {
    const passage_frame *p = &g->point;
    double speed = 0.0;
    int nv = g->size.nv, i, j;
    for (j = 0; j < nv; j++) {
        double sum = 0.0;
        for (i = j; i < p->L_end[j]; i++) sum += p->L[j * nv + i] * v[i];
        speed += sum * sum;
    }
    return speed;
}

/* For rows f = gap + k s w, with s along one branch and w along the other, sigma is sqrt(2 k gap)
 * at the reversal. If it is below SIGMA_REGULAR, the step passes as if the branches met. */
int near_miss_jumped(passage *g, double t, const double *x, double h, const double *y,
                     const double *first, const double *last) {
    double high, speed, gap, sigma = g->point.sigma;
    passage_rows *rows = &g->point.rows;
    int before;
    if (g->origin.rank == 0 || g->step.singular) return 0;
    speed = squared_speed(g, y + g->size.nq);
    if (frame_rows(g, t, x, rows)) return 0;
    before = determinant_sign(g, rows);
    if (frame_rows(g, t + h, y, rows)) return 0;
    if (before * determinant_sign(g, rows) >= 0) return 0;
    dopri5_hermite(g->stepper->n, x, y, h, first, last, g->dense.attempted);
    if (locate_crossing(g, t, h, before, &high)) return 0;
    gap = closure_gap(g, rows);
    if (gap > BRANCHES_MEET) g->step.missed = 1;
    if (!(speed > 0.0) || !(high < 1.0)) return 0;
    gap *= 2.0 * sigma / ((1.0 - high) * h * sqrt(speed));
    return sqrt(gap) > SIGMA_REGULAR * g->memory->sigma_max;
}
