#include <math.h>
#include <string.h>

#include "dense.h"
#include "eigenvalues.h"
#include "raghavan_roth.h"
#include "rigid.h"

enum { OFFSETS = 8 };
static const double FIRST_OFFSET = 0.2731; /* generic angle [rad] for usual designs */
static const double WELL = 1e-3;           /* regularity at which no other offset is tried */
static const double FAR_ROUNDING = 1e-15;  /* relative pivot that is rounding */
static const double OFF_CIRCLE = 0.5;      /* largest |log |e^(iu)|| of a kept root */

/* Matrix A at infinite x = tan((u - offset) / 2). */
static void far_matrix(const roth_matrix *m, double offset, double *A) {
    double weights[3];
    int i, k;
    roth_weights(m->parts, offset + PI, weights);
    for (i = 0; i < m->size * m->size; i++) {
        A[i] = 0.0;
        for (k = 0; k < m->parts; k++) A[i] += weights[k] * m->M[k][i];
    }
}

static void factorize_at(const roth_matrix *m, double offset, dense_qr *f) {
    far_matrix(m, offset, f->A);
    f->rows = f->columns = f->steps = m->size;
    dense_factorize(f);
}

double roth_regularity(const roth_matrix *m, double *best) {
    double far[ROTH_SIZE * ROTH_SIZE];
    dense_qr f;
    double most = -1.0;
    int i;
    for (i = 0; i < OFFSETS; i++) {
        double offset = FIRST_OFFSET + i * PI / 4.0, regularity;
        f.A = far;
        factorize_at(m, offset, &f);
        regularity = dense_regularity(&f);
        if (regularity <= most) continue;
        most = regularity;
        *best = offset;
        if (regularity > WELL) break;
    }
    return most;
}

/* Coefficients of 1, x of the matrix polynomial, or of 1 alone for degree one. */
static void lower_factors(const roth_matrix *m, double offset, double *lower) {
    double weights[3];
    int i, count = m->size * m->size;
    const double *A = m->M[0], *B = m->M[1], *C = m->M[2];
    roth_weights(m->parts, offset, weights);
    for (i = 0; i < count; i++) {
        if (m->parts == 2) {
            lower[i] = weights[0] * A[i] + weights[1] * B[i];
            continue;
        }
        lower[i] = A[i] + weights[1] * B[i] + weights[2] * C[i];
        lower[count + i] = 2.0 * (weights[1] * C[i] - weights[2] * B[i]);
    }
}

/* Companion matrix of the transposed polynomial; its row blocks are the unknowns 1, x. */
static int companion(const roth_matrix *m, double offset, double *A) {
    double far[ROTH_SIZE * ROTH_SIZE], lower[2 * ROTH_SIZE * ROTH_SIZE];
    int i, j, n = m->size, degree = m->parts - 1, all = degree * n;
    dense_qr f;
    f.A = far;
    factorize_at(m, offset, &f);
    lower_factors(m, offset, lower);
    dense_solve(&f, lower, all, FAR_ROUNDING);
    memset(A, 0, (size_t)(all * all) * sizeof(double));
    for (i = 0; i < all - n; i++) A[i * all + n + i] = 1.0;
    for (i = 0; i < n; i++)
        for (j = 0; j < all; j++) A[(all - n + i) * all + j] = -lower[j * n + i];
    return all;
}

static int ascending(double *u, int count) {
    int i, k;
    for (i = 1; i < count; i++) {
        double value = u[i];
        for (k = i; k > 0 && u[k - 1] > value; k--) u[k] = u[k - 1];
        u[k] = value;
    }
    return count;
}

int roth_roots(const roth_matrix *m, double offset, double *u) {
    double A[ROTH_ROOTS * ROTH_ROOTS], real[ROTH_ROOTS], imaginary[ROTH_ROOTS];
    int i, count = 0, all = companion(m, offset, A), failed = eigenvalues(all, A, real, imaginary);
    /* the eigenvalue steps may not converge for multiple roots, as with three translations */
    for (i = 0; failed && i < OFFSETS; i++) {
        offset = FIRST_OFFSET + i * PI / 4.0;
        all = companion(m, offset, A);
        failed = eigenvalues(all, A, real, imaginary);
    }
    if (failed) return 0;
    for (i = 0; i < all; i++) {
        double x = real[i], y = imaginary[i];
        double above = x * x + (1.0 - y) * (1.0 - y), below = x * x + (1.0 + y) * (1.0 + y);
        double size = above > 0.0 && below > 0.0 ? 0.5 * log(above / below) : HUGE_VAL;
        if (!(fabs(size) < OFF_CIRCLE)) continue;
        u[count++] = remainder(offset + atan2(2.0 * x, 1.0 - x * x - y * y), 2.0 * PI);
    }
    return ascending(u, count);
}
