#include "passage_frame.h"

#include <math.h>
#include <string.h>

#include "finite.h"
#include "skyline.h"

int frame_rows(passage *g, double t, const double *x, const passage_rows *rows) {
    int j, nv = g->size.nv;
    if (g->model.rows(g->stepper->user, t, x, rows)) return 1;
    if (g->size.nq > nv) return 0;
    memset(rows->bend, 0, sizeof(double) * (size_t)nv);
    for (j = 0; j < g->patterns.J.start[nv]; j++) rows->J[j] = rows->slope[g->patterns.J_from[j]];
    return 0;
}

int frame_evaluate(passage *g, passage_frame *p, double t, const double *x) {
    void *user = g->stepper->user;
    if (frame_rows(g, t, x, &p->rows) || g->model.forces(user, t, x, p->inertia, p->f, p->rate))
        return 1;
    p->rank = (int)fmin(*p->rows.rank, fmin(g->size.nv, g->size.speeds));
    p->penalty = 0.0;
    return !all_finite(p->inertia, g->patterns.M.start[g->size.nv]) ||
           !all_finite(p->f, g->size.nv);
}

/* Write the elements of M over L, and the ends of its columns. */
static void copy_inertia(const passage *g, passage_frame *p) {
    int n = g->size.nv, i, k;
    for (k = 0; k < n; k++) {
        double *column = p->L + k * n;
        int first = g->patterns.M.start[k], after = g->patterns.M.start[k + 1];
        for (i = k; i < p->L_end[k]; i++) column[i] = 0.0;
        p->L_end[k] = k + 1;
        for (i = first; i < after; i++) {
            if (g->patterns.M.row[i] < k) continue;
            column[g->patterns.M.row[i]] = p->inertia[i];
            p->L_end[k] = g->patterns.M.row[i] + 1;
        }
    }
}

/* Compute L from M. If links without mass make M singular, factorize M + more J' J, which gives the
 * same motion on the rows. Returns 1 if this matrix is singular, too. */
static int factorize_inertia(passage *g, passage_frame *p) {
    int n = g->size.nv, m = g->size.speeds, i, j, k;
    double *square = g->scratch.square, mass = 0.0, length = 0.0;
    copy_inertia(g, p);
    if (!skyline_cholesky(p->L, p->L_end, n)) return 0;
    copy_inertia(g, p);
    for (k = 0; k < n; k++) mass += p->L[k * n + k];
    for (k = 0; k < g->patterns.J.start[n]; k++) length += p->rows.J[k] * p->rows.J[k];
    if (!(length > 0.0) || !(mass > 0.0)) return 1;
    p->penalty = mass / length;
    memset(square, 0, sizeof(double) * (size_t)(n * n));
    for (k = 0; k < m; k++)
        for (j = g->patterns.J.begin[k]; j < g->patterns.J.begin[k + 1]; j++)
            for (i = j; i < g->patterns.J.begin[k + 1]; i++)
                square[g->patterns.J.column[j] * n + g->patterns.J.column[i]] +=
                    p->rows.J[g->patterns.J.from[i]] * p->rows.J[g->patterns.J.from[j]];
    for (j = 0; j < n; j++) {
        for (i = j; i < n; i++) p->L[j * n + i] += p->penalty * square[j * n + i];
        p->L_end[j] = n;
    }
    return skyline_cholesky(p->L, p->L_end, n);
}

/* Factorize L^-1 J' = Q R up to the rank and set sigma. */
static void factorize_rows(passage *g, passage_frame *p) {
    int n = g->size.nv, m = g->size.speeds, i, j;
    sparse_qr *f = &p->qr;
    sparse_qr_begin(f, n, m);
    for (j = 0; j < m; j++) {
        for (i = g->patterns.J.begin[j]; i < g->patterns.J.begin[j + 1]; i++)
            sparse_qr_put(f, n, g->patterns.J.column[i], j, p->rows.J[g->patterns.J.from[i]]);
        skyline_solve_sparse(p->L, p->L_end, n, f->filled + j * ROW_WORDS(n), f->A + j * n);
    }
    sparse_qr_factorize(&p->qr, n, m, p->rank, 0.0);
    p->sigma = p->rank ? HUGE_VAL : 1.0;
    for (j = 0; j < p->rank; j++) p->sigma = fmin(p->sigma, sparse_qr_pivot(&p->qr, n, j));
}

void frame_velocity(const passage *g, const passage_frame *p, double *y) {
    int n = g->size.nv;
    sparse_qr_multiply(&p->qr, n, p->rank, y);
    skyline_solve_transposed(p->L, p->L_end, n, y);
}

void frame_solve_rows(const passage *g, const passage_frame *p, const double *c, double *y) {
    sparse_qr_solve_transposed(&p->qr, g->size.nv, p->rank, c, y);
}

int frame_factorize(passage *g, passage_frame *p) {
    int n = g->size.nv, j;
    if (factorize_inertia(g, p)) return 1;
    factorize_rows(g, p);
    for (j = 0; j < n - p->rank; j++) {
        double *T = p->T + j * n;
        memset(T, 0, sizeof(double) * (size_t)n);
        T[p->qr.pivot_row[p->rank + j]] = 1.0;
        frame_velocity(g, p, T);
    }
    return !isfinite(p->sigma);
}

void frame_particular_velocity(const passage *g, const passage_frame *p, double *v) {
    memset(v, 0, sizeof(double) * (size_t)g->size.nv);
    frame_solve_rows(g, p, p->rows.b, v);
    frame_velocity(g, p, v);
}
