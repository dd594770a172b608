#include "passage_start.h"

#include <math.h>
#include <string.h>

#include "dense.h"
#include "finite.h"
#include "passage_chart.h"
#include "passage_crossing.h"
#include "passage_frame.h"
#include "passage_newton.h"
#include "passage_origin.h"

/* Fraction of the longest row below which a row is dependent when the positions of a start are
 * projected. Where branches cross, each Newton step halves the distance, until its square reaches
 * the rounding error of the rows: 1e-8 is the square root of 1e-16. */
#define DEPENDENT_POSITIONS 1e-8

/* Maximum number of Newton steps of a start. At one half per step they reduce the first distance to
 * 1e-12. */
#define START_NEWTON_STEPS 40

/* Largest residual of the rows of a start, for coordinates of size one. It is far above the
 * rounding error of the rows, so that a slider that starts 1e-12 m beyond its dead centre is
 * refused. With 1e-11 it starts. */
#define START_CLOSED 1e-12

/* Fraction of the longest row below which a row is dependent when the velocities of a start are
 * computed. It exceeds the distance from the crossing that a start projected to START_CLOSED has,
 * 1e-6 = sqrt(1e-12). */
#define DEPENDENT_VELOCITIES 1e-6

/* Difference of squared moves by which a joint is less constrained than another one. It separates
 * joints that move alike by symmetry, which differ by rounding, from joints that move more. */
#define MOVES_MORE 1e-6

/* Compute the shortest y (n,) with A' y = b, where A (n, m) is in the scratch memory. Rows of A'
 * that are dependent within the fraction `least` are omitted. */
static void minimum_norm_solution(passage *g, int n, int m, const double *b, double least,
                                  double *y) {
    sparse_qr *f = &g->scratch.qr;
    int rank, k;
    sparse_qr_scan(f, n, m);
    rank = sparse_qr_factorize(f, n, m, n < m ? n : m, least);
    memset(y, 0, sizeof(double) * (size_t)n);
    for (k = 0; k < rank; k++) /* empty rows determine nothing */
        if (sparse_qr_pivot(f, n, k) == 0.0) rank = k;
    sparse_qr_solve_transposed(f, n, rank, b, y);
    sparse_qr_multiply(f, n, rank, y);
}

int passage_singular(passage *g, double t, const double *x) {
    return !(crossing_regularity(g, t, x) > SIGMA_REGULAR * g->memory->regularity_max);
}

int passage_place(passage *g, double t, double *x, const int *loose, int count) {
    int m = g->size.positions, first = g->size.speeds - g->size.anchors, i, j, pass;
    double worst = HUGE_VAL, move = HUGE_VAL, *A = g->scratch.qr.A, *r = g->scratch.residual;
    g->scratch.qr.height = 0;
    for (pass = 0; pass <= START_NEWTON_STEPS; pass++) {
        if (frame_rows(g, t, x, &g->point.rows)) return 1;
        for (worst = 0.0, j = 0; j < m; j++) {
            int free = j >= first && j < g->size.speeds; /* locked by stops or friction */
            r[j] = free ? 0.0 : -g->point.rows.position[j];
            worst = fmax(worst, fabs(r[j]));
            memset(A + j * count, 0, sizeof(double) * (size_t)count);
        }
        for (i = 0; i < count; i++)
            for (j = g->patterns.slope.start[loose[i]]; j < g->patterns.slope.start[loose[i] + 1];
                 j++) {
                int row = g->patterns.slope.row[j], free = row >= first && row < g->size.speeds;
                if (!free) A[row * count + i] = g->point.rows.slope[j];
            }
        if (!isfinite(worst) || !all_finite(A, m * count)) return 1;
        if (move < NEWTON_CONVERGED || pass == START_NEWTON_STEPS) break;
        minimum_norm_solution(g, count, m, r, DEPENDENT_POSITIONS, g->scratch.y);
        for (move = 0.0, i = 0; i < count; i++) {
            x[loose[i]] += g->scratch.y[i];
            move = fmax(move, fabs(g->scratch.y[i]));
        }
    }
    return !(worst < START_CLOSED);
}

int passage_velocities(passage *g, double t, double *x, const int *kept, int count) {
    int nq = g->size.nq, nv = g->size.nv, m = g->size.speeds, i, j;
    double *A = g->scratch.qr.A, *r = g->scratch.residual, *v = x + nq, *y = g->scratch.y,
           speed = 0.0, miss = 0.0;
    if (frame_rows(g, t, x, &g->point.rows)) return 1;
    for (j = 0; j < m + count; j++) {
        int anchored = j >= m - g->size.anchors && j < m;
        r[j] = j < m ? g->point.rows.b[j] : v[kept[j - m]];
        memset(A + j * nv, 0, sizeof(double) * (size_t)nv);
        for (i = j < m ? g->patterns.J.begin[j] : 0;
             j < m && i < g->patterns.J.begin[j + 1] && !anchored; i++)
            A[j * nv + g->patterns.J.column[i]] = g->point.rows.J[g->patterns.J.from[i]];
        if (j >= m) A[j * nv + kept[j - m]] = 1.0;
    }
    if (!all_finite(A, (m + count) * nv)) return 1;
    minimum_norm_solution(g, nv, m + count, r, DEPENDENT_VELOCITIES, y);
    for (i = 0; i < nv; i++) speed = fmax(speed, fabs(y[i]));
    for (j = 0; j < m + count; j++) {
        double off = j < m ? -r[j] : y[kept[j - m]] - r[j];
        if (j >= m - g->size.anchors && j < m) continue;
        for (i = j < m ? g->patterns.J.begin[j] : 0; j < m && i < g->patterns.J.begin[j + 1]; i++)
            off += g->point.rows.J[g->patterns.J.from[i]] * y[g->patterns.J.column[i]];
        miss = fmax(miss, fabs(off));
        if (j >= m) speed = fmax(speed, fabs(r[j]));
    }
    memcpy(v, y, sizeof(double) * (size_t)nv);
    return !(miss <= START_VELOCITY * speed);
}

int passage_slope(passage *g, double t, const double *x, double *xdot, double *on) {
    int status, n = g->stepper->n;
    if (crossing_regularity(g, t, x) >= PASSAGE_ON * g->memory->regularity_max) {
        if (on) memcpy(on, x, sizeof(double) * (size_t)n);
        return stepper_evaluate(g->stepper, t, x, xdot);
    }
    status = origin_prepare(g, t, x);
    g->step.sigma = HUGE_VAL;
    if (!status)
        status = crossing_state(g, t, g->prepared.y, g->scratch.state, xdot, g->stages.slope_y[0]);
    if (!status && on) memcpy(on, g->scratch.state, sizeof(double) * (size_t)n);
    return status;
}

int passage_loosest(passage *g, double t, const double *x, const double *unit) {
    int nv = g->size.nv, found = -1, i, j, k, first;
    double most = 0.0, *B = g->scratch.matrix, *moves = g->scratch.y;
    if (frame_evaluate(g, &g->point, t, x) || frame_factorize(g, &g->point) || !g->point.rank)
        return -1;
    first = g->point.rank - 1;
    memset(moves, 0, sizeof(double) * (size_t)nv);
    for (k = first; k < nv; k++) { /* the directions that rows constrain least, orthonormal */
        double *v = B + (k - first) * nv, size = 0.0;
        memset(v, 0, sizeof(double) * (size_t)nv);
        v[g->point.qr.pivot_row[k]] = 1.0;
        frame_velocity(g, &g->point, v);
        for (i = 0; i < nv; i++) v[i] *= unit[i];
        for (j = 0; j < k - first; j++) {
            double part = 0.0;
            for (i = 0; i < nv; i++) part += B[j * nv + i] * v[i];
            for (i = 0; i < nv; i++) v[i] -= part * B[j * nv + i];
        }
        for (i = 0; i < nv; i++) size += v[i] * v[i];
        for (i = 0; i < nv; i++) v[i] /= sqrt(size), moves[i] += v[i] * v[i];
    }
    for (i = 0; i < nv; i++) /* the first of joints with equal moves */
        if (moves[i] > most + MOVES_MORE) most = moves[i], found = i;
    return found;
}
