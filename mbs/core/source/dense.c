#include "dense.h"

#include <math.h>
#include <string.h>

static double square(const double *v, int n) {
    double sum = 0.0;
    int i;
    for (i = 0; i < n; i++) sum += v[i] * v[i];
    return sum;
}

static void exchange(dense_qr *f, int k, int other) {
    double *a = f->A + k * f->rows, *b = f->A + other * f->rows;
    int i, kept = f->order[k];
    if (k == other) return;
    f->order[k] = f->order[other];
    f->order[other] = kept;
    for (i = 0; i < f->rows; i++) {
        double value = a[i];
        a[i] = b[i];
        b[i] = value;
    }
}

static int longest(const dense_qr *f, int k) {
    double most = -1.0;
    int j, best = k;
    for (j = k; j < f->columns; j++) {
        double size = square(f->A + j * f->rows + k, f->rows - k);
        if (size > most) {
            most = size;
            best = j;
        }
    }
    return best;
}

void dense_reflect(const double *tail, double weight, int count, double *column) {
    double sum = column[0];
    int i;
    for (i = 1; i < count; i++) sum += tail[i] * column[i];
    sum *= weight;
    if (sum == 0.0) return; /* columns of loops without common joint */
    column[0] -= sum;
    for (i = 1; i < count; i++) column[i] -= sum * tail[i];
}

double dense_reflection(double *v, int count) {
    double size = sqrt(square(v, count)), first = v[0];
    int i;
    if (size == 0.0 || count == 1) return 0.0;
    if (first > 0.0) size = -size;
    for (i = 1; i < count; i++) v[i] /= first - size;
    v[0] = size;
    return (size - first) / size;
}

void dense_factorize(dense_qr *f) {
    int j, k, m = f->rows;
    for (k = 0; k < f->columns; k++) f->order[k] = k;
    for (k = 0; k < f->steps; k++) {
        double *v = f->A + k * m + k;
        exchange(f, k, longest(f, k));
        f->weight[k] = dense_reflection(v, m - k);
        for (j = k + 1; j < f->columns; j++)
            dense_reflect(v, f->weight[k], m - k, f->A + j * m + k);
    }
}

void dense_turn(const dense_qr *f, double *B, int count) {
    int j, k, m = f->rows;
    for (j = 0; j < count; j++)
        for (k = 0; k < f->steps; k++)
            dense_reflect(f->A + k * m + k, f->weight[k], m - k, B + j * m + k);
}

void dense_solve(const dense_qr *f, double *B, int count, double least) {
    double x[DENSE_MOST];
    int i, j, k, m = f->rows, n = f->columns;
    dense_turn(f, B, count);
    for (j = 0; j < count; j++) {
        double *b = B + j * m;
        for (k = n - 1; k >= 0; k--) {
            double pivot = f->A[k * m + k], smallest = least * fabs(f->A[0]);
            if (fabs(pivot) < smallest) pivot = pivot < 0.0 ? -smallest : smallest;
            x[f->order[k]] = b[k] /= pivot == 0.0 ? 1.0 : pivot;
            for (i = 0; i < k; i++) b[i] -= f->A[k * m + i] * b[k];
        }
        memcpy(b, x, (size_t)n * sizeof(double));
    }
}

double dense_regularity(const dense_qr *f) {
    double first = fabs(f->A[0]);
    int last = f->steps - 1;
    return first > 0.0 ? fabs(f->A[last * f->rows + last]) / first : 0.0;
}

void dense_complement(const dense_qr *f, double *V, int count) {
    int j, k, m = f->rows;
    memset(V, 0, (size_t)(m * count) * sizeof(double));
    for (j = 0; j < count; j++) {
        V[j * m + m - count + j] = 1.0;
        for (k = f->steps - 1; k >= 0; k--)
            dense_reflect(f->A + k * m + k, f->weight[k], m - k, V + j * m + k);
    }
}

int dense_eliminate(double *A, int n, double *b, int count) {
    int sign = 1, i, j, k;
    for (k = 0; k < n; k++) {
        double *column = A + k * n;
        int pivot = k;
        for (i = k + 1; i < n; i++)
            if (fabs(column[i]) > fabs(column[pivot])) pivot = i;
        if (!(fabs(column[pivot]) > 0.0)) return 0;
        for (j = k; j < n + count && pivot != k; j++) {
            double *other = j < n ? A + j * n : b + (j - n) * n, kept = other[k];
            other[k] = other[pivot];
            other[pivot] = kept;
        }
        if ((column[k] < 0.0) != (pivot != k)) sign = -sign;
        for (i = k + 1; i < n; i++) column[i] /= column[k];
        for (j = k + 1; j < n + count; j++) {
            double *other = j < n ? A + j * n : b + (j - n) * n, part = other[k];
            for (i = k + 1; i < n && part != 0.0; i++) other[i] -= column[i] * part;
        }
    }
    return sign;
}

int dense_solve_square(double *A, int n, double *b, int count) {
    int i, j, k;
    if (!dense_eliminate(A, n, b, count)) return 1;
    for (j = 0; j < count; j++)
        for (k = n - 1; k >= 0; k--) {
            for (i = k + 1; i < n; i++) b[j * n + k] -= A[i * n + k] * b[j * n + i];
            b[j * n + k] /= A[k * n + k];
        }
    return 0;
}
