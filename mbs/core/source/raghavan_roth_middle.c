#include <math.h>
#include <string.h>

#include "dense.h"
#include "eigenvalues.h"
#include "raghavan_roth.h"

static const double MIX = 0.6180339887; /* weight of x5 in x4 + MIX x5, generic: different sums */
static const double ROUNDING = 1e-13;   /* relative pivot that is rounding */

typedef double block[ROTH_SHARED * ROTH_SHARED];

/* Orthonormal basis V (size, count) of the null space of A (size, size), row by row. A is
 * overwritten. */
static void null_space(double *A, int size, int count, double *V) {
    dense_qr f;
    f.rows = f.columns = size;
    f.steps = size - count;
    f.A = A;
    dense_factorize(&f);
    dense_complement(&f, V, count);
}

/* Least-squares solution X (count, count), column by column, of low X = high. `low` has all rows of
 * V except the highest power of an unknown, `high` all rows except the lowest power. */
static void shift(const double *V, int size, int count, int block_size, int step, double *X) {
    double low[ROTH_SIZE * ROTH_SHARED], high[ROTH_SIZE * ROTH_SHARED];
    int i, j, rows = 0;
    dense_qr f;
    for (i = 0; i < size; i++) rows += i % block_size < block_size - step;
    for (j = 0; j < count; j++) {
        int row = j * rows;
        for (i = 0; i < size; i++) {
            if (i % block_size >= block_size - step) continue;
            low[row] = V[j * size + i];
            high[row++] = V[j * size + i + step];
        }
    }
    f.rows = rows;
    f.columns = f.steps = count;
    f.A = low;
    dense_factorize(&f);
    dense_solve(&f, high, count, ROUNDING);
    for (j = 0; j < count; j++)
        memcpy(X + j * count, high + j * rows, (size_t)count * sizeof(double));
}

/* Mean of v' X v over the columns of V (n, count), which are orthonormal. */
static double rayleigh(const double *X, const double *V, int n, int count) {
    double sum = 0.0;
    int i, j, k;
    for (k = 0; k < count; k++)
        for (j = 0; j < n; j++)
            for (i = 0; i < n; i++) sum += V[k * n + i] * X[j * n + i] * V[k * n + j];
    return sum / count;
}

/* Invariant subspace V (n, 1 or 2) of X (n, n), column by column, for the real eigenvalue a or the
 * pair a + ib, a - ib. Returns its dimension. */
static int directions(const double *X, int n, double a, double b, double *V) {
    block shifted, square;
    int i, j, k;
    for (j = 0; j < n; j++)
        for (i = 0; i < n; i++) shifted[i * n + j] = X[j * n + i] - (i == j ? a : 0.0);
    if (b == 0.0) {
        null_space(shifted, n, 1, V);
        return 1;
    }
    for (i = 0; i < n; i++)
        for (j = 0; j < n; j++) {
            square[i * n + j] = i == j ? b * b : 0.0;
            for (k = 0; k < n; k++) square[i * n + j] += shifted[i * n + k] * shifted[k * n + j];
        }
    null_space(square, n, 2, V);
    return 2;
}

static int smaller(int a, int b) { return a < b ? a : b; }

int roth_middle(const roth_loop *r, const roth_matrix *m, double u, int count, double *x4,
                double *x5) {
    double A[ROTH_SIZE * ROTH_SIZE], V[ROTH_SIZE * ROTH_SHARED], weights[3];
    double real[ROTH_SHARED], imaginary[ROTH_SHARED];
    block X4, X5, X;
    int i, k, n = m->size, wide = r->raised ? r->powers[4] + 1 : r->powers[4];
    count = smaller(smaller(count, ROTH_SHARED), smaller(n - wide, n - n / wide));
    roth_weights(m->parts, u, weights);
    for (i = 0; i < n * n; i++) {
        A[i] = 0.0;
        for (k = 0; k < m->parts; k++) A[i] += weights[k] * m->M[k][i];
    }
    null_space(A, n, count, V);
    shift(V, n, count, n, wide, X4);
    shift(V, n, count, wide, 1, X5);
    x4[0] = X4[0];
    x5[0] = X5[0];
    if (count == 1) return 1;
    for (i = 0; i < count; i++)
        for (k = 0; k < count; k++) X[k * count + i] = X4[i * count + k] + MIX * X5[i * count + k];
    if (eigenvalues(count, X, real, imaginary)) return 0;
    for (i = 0; i < count * count; i++) X[i] = X4[i] + MIX * X5[i];
    for (i = 0; i < count; i++) {
        int planes = directions(X, count, real[i], imaginary[i], V);
        x4[i] = rayleigh(X4, V, count, planes);
        x5[i] = rayleigh(X5, V, count, planes);
    }
    return count;
}
