#include "skyline.h"

#include <math.h>

/* Pivot that counts as zero, as a fraction of the largest diagonal element. It separates velocities
 * without inertia, whose pivots are the rounding error of the diagonal (1e-16 of it), from light
 * links. A link with 1e-10 of the inertia of another one may count as either: both treatments give
 * the same motion. */
#define MASSLESS_PIVOT 1e-10

int skyline_cholesky(double *M, int *end, int n) {
    double largest = 0.0;
    int i, j, k;
    for (k = 0; k < n; k++) largest = fmax(largest, M[k * n + k]);
    for (k = 0; k < n; k++) {
        double *column = M + k * n;
        if (!(column[k] > MASSLESS_PIVOT * largest)) return 1;
        column[k] = sqrt(column[k]);
        for (; end[k] > k + 1 && column[end[k] - 1] == 0.0; end[k]--) continue;
        for (i = k + 1; i < end[k]; i++) column[i] /= column[k];
        for (j = k + 1; j < end[k]; j++) {
            if (column[j] == 0.0) continue;
            for (i = j; i < end[k]; i++) M[j * n + i] -= column[i] * column[j];
            if (end[j] < end[k]) end[j] = end[k];
        }
    }
    return 0;
}

void skyline_solve(const double *L, const int *end, int n, double *b) {
    int i, k;
    for (k = 0; k < n; k++) {
        if (b[k] == 0.0) continue; /* rows of loops depend on few joints */
        b[k] /= L[k * n + k];
        for (i = k + 1; i < end[k]; i++) b[i] -= L[k * n + i] * b[k];
    }
}

void skyline_solve_sparse(const double *L, const int *end, int n, row_set *set, double *b) {
    int word, i, k;
    for (word = 0; word < ROW_WORDS(n); word++) {
        row_set done = 0, bits;
        while ((bits = set[word] & ~done) != 0) {
            k = word * ROW_BITS + lowest_row(bits);
            done |= row_bit(k);
            if (b[k] == 0.0) continue;
            b[k] /= L[k * n + k];
            for (i = k + 1; i < end[k]; i++) {
                b[i] -= L[k * n + i] * b[k];
                set[i / ROW_BITS] |= row_bit(i);
            }
        }
    }
}

void skyline_solve_transposed(const double *L, const int *end, int n, double *b) {
    int i, k;
    for (k = n - 1; k >= 0; k--) {
        double sum = b[k];
        for (i = k + 1; i < end[k]; i++) sum -= L[k * n + i] * b[i];
        b[k] = sum / L[k * n + k];
    }
}
