#include "eigenvalues.h"

#include <float.h>
#include <math.h>

#include "finite.h"

enum { SWEEPS = 90, PATIENCE = 10 }; /* iterations: limit, interval of other shifts */

static double off_diagonal_row(int n, const double *A, int i) {
    double sum = 0.0;
    int j;
    for (j = 0; j < n; j++) sum += j == i ? 0.0 : fabs(A[i * n + j]);
    return sum;
}

static double off_diagonal_column(int n, const double *A, int i) {
    double sum = 0.0;
    int j;
    for (j = 0; j < n; j++) sum += j == i ? 0.0 : fabs(A[j * n + i]);
    return sum;
}

static double norm(int n, const double *A) {
    double sum = 0.0;
    int i;
    for (i = 0; i < n * n; i++) sum += A[i] * A[i];
    return sqrt(sum);
}

/* Scale A by a power of two to elements of at most 1. Returns the exponent. */
static int scale_rows(int n, double *A) {
    double most = 0.0;
    int i, exponent = 0;
    for (i = 0; i < n * n; i++) most = fmax(most, fabs(A[i]));
    frexp(most, &exponent);
    for (i = 0; i < n * n; i++) A[i] = ldexp(A[i], -exponent);
    return exponent;
}

/* Balance A = D^-1 A D so that rows and columns have about the same size. */
static void balance(int n, double *A) {
    int i, j, changed = 1;
    while (changed) {
        changed = 0;
        for (i = 0; i < n; i++) {
            double row = off_diagonal_row(n, A, i), column = off_diagonal_column(n, A, i);
            double sum = row + column, factor = 1.0;
            if (row == 0.0 || column == 0.0) continue;
            for (; column < 0.5 * row; column *= 4.0) factor *= 2.0;
            for (; column > 2.0 * row; column *= 0.25) factor *= 0.5;
            if ((column + row) / factor >= 0.95 * sum) continue;
            changed = 1;
            for (j = 0; j < n; j++) A[i * n + j] /= factor;
            for (j = 0; j < n; j++) A[j * n + i] *= factor;
        }
    }
}

/* Replace v (m,) by the vector of the reflection I - weight v v' that maps the old v to a multiple
 * of the first unit vector, and return the weight. *first: the remaining first element. */
static double reflector(int m, double *v, double *first) {
    double size = 0.0, most = 0.0, weight;
    int i;
    for (i = 0; i < m; i++) most = fmax(most, fabs(v[i]));
    if (most == 0.0) {
        *first = 0.0;
        return 0.0;
    }
    for (i = 0; i < m; i++) {
        v[i] /= most;
        size += v[i] * v[i];
    }
    size = v[0] > 0.0 ? -sqrt(size) : sqrt(size);
    v[0] -= size;
    weight = -1.0 / (size * v[0]);
    *first = size * most;
    return weight;
}

static void reduce_to_hessenberg(int n, double *A) {
    double v[EIGENVALUES_MOST], w[EIGENVALUES_MOST];
    int i, j, k;
    for (k = 0; k < n - 2; k++) {
        double first, weight;
        for (i = k + 1; i < n; i++) v[i] = A[i * n + k];
        weight = reflector(n - k - 1, v + k + 1, &first);
        if (weight == 0.0) continue;
        for (j = k; j < n; j++) w[j] = 0.0;
        for (i = k + 1; i < n; i++)
            for (j = k; j < n; j++) w[j] += v[i] * A[i * n + j];
        for (i = k + 1; i < n; i++)
            for (j = k; j < n; j++) A[i * n + j] -= weight * v[i] * w[j];
        for (i = 0; i < n; i++) {
            double sum = 0.0;
            for (j = k + 1; j < n; j++) sum += A[i * n + j] * v[j];
            for (j = k + 1; j < n; j++) A[i * n + j] -= weight * sum * v[j];
        }
        A[(k + 1) * n + k] = first;
        for (i = k + 2; i < n; i++) A[i * n + k] = 0.0;
    }
}

/* First row of the block that ends at row `last`: the subdiagonal element before it is below the
 * rounding error of its diagonal neighbours, or of `least`. */
static int block_start(int n, double *H, int last, double least) {
    int l;
    for (l = last; l > 0; l--) {
        double size = fabs(H[(l - 1) * n + l - 1]) + fabs(H[l * n + l]);
        if (size < least) size = least;
        if (fabs(H[l * n + l - 1]) <= DBL_EPSILON * size) {
            H[l * n + l - 1] = 0.0;
            return l;
        }
    }
    return 0;
}

/* Two shifts: the eigenvalues of a matrix (2, 2) with diagonal x, y. `cross` is the product of its
 * off-diagonal elements. */
typedef struct {
    double x, y, cross;
} shifts;

/* First column of (H - s1)(H - s2) from row m on, divided by the subdiagonal element. Diagonal
 * differences are formed first, because they are small if eigenvalues are close. */
static void first_column(int n, const double *H, int m, const shifts *s, double *v) {
    double a = H[m * n + m], below = H[(m + 1) * n + m], x = s->x - a, y = s->y - a;
    v[0] = (x * y - s->cross) / below + H[m * n + m + 1];
    v[1] = H[(m + 1) * n + m + 1] - a - x - y;
    v[2] = H[(m + 2) * n + m + 1];
}

/* Row at which a step may start, because two successive subdiagonal elements are small. The block
 * has three rows or more. */
static int step_start(int n, const double *H, int first, int last, const shifts *s) {
    double v[3];
    int m;
    for (m = last - 2; m > first; m--) {
        double left, right;
        first_column(n, H, m, s, v);
        left = fabs(H[m * n + m - 1]) * (fabs(v[1]) + fabs(v[2]));
        right = fabs(v[0]) *
                (fabs(H[(m - 1) * n + m - 1]) + fabs(H[m * n + m]) + fabs(H[(m + 1) * n + m + 1]));
        if (left < DBL_EPSILON * right) break;
    }
    return m;
}

/* Reflect rows k .. k + size - 1 in columns k .. last, then these columns in rows first .. end. */
static void reflect(int n, double *H, int k, int size, double weight, const double *v, int first,
                    int last) {
    double a = weight * v[0], b = weight * v[1], c = size == 3 ? weight * v[2] : 0.0;
    double z = size == 3 ? v[2] : 0.0;
    double *top = H + k * n, *middle = top + n, *low = size == 3 ? middle + n : middle;
    int i, end = k + 3 < last ? k + 3 : last;
    for (i = k; i <= last; i++) {
        double sum = v[0] * top[i] + v[1] * middle[i] + z * low[i];
        top[i] -= a * sum;
        middle[i] -= b * sum;
        if (size == 3) low[i] -= c * sum;
    }
    for (i = first; i <= end; i++) {
        double *row = H + i * n + k, third = size == 3 ? row[2] : 0.0;
        double sum = v[0] * row[0] + v[1] * row[1] + z * third;
        row[0] -= a * sum;
        row[1] -= b * sum;
        if (size == 3) row[2] -= c * sum;
    }
}

static void francis_step(int n, double *H, int first, int last, const shifts *s) {
    int k, start = step_start(n, H, first, last, s);
    for (k = start; k < last; k++) {
        int i, size = k < last - 1 ? 3 : 2;
        double v[3], weight, left = 0.0;
        if (k == start)
            first_column(n, H, k, s, v);
        else
            for (i = 0; i < size; i++) v[i] = H[(k + i) * n + k - 1];
        weight = reflector(size, v, &left);
        if (weight == 0.0) continue;
        if (k > start) {
            for (i = 1; i < size; i++) H[(k + i) * n + k - 1] = 0.0;
            H[k * n + k - 1] = left;
        } else if (k > first) {
            H[k * n + k - 1] *= 1.0 - weight * v[0] * v[0];
        }
        reflect(n, H, k, size, weight, v, first, last);
    }
}

static void pair_at(const double *row, const double *next, double *real, double *imaginary) {
    double half = 0.5 * (row[0] - next[1]), product = row[1] * next[0];
    double root = half * half + product, size = sqrt(fabs(root));
    if (root < 0.0) {
        real[0] = real[1] = next[1] + half;
        imaginary[0] = size;
        imaginary[1] = -size;
        return;
    }
    size = half + (half >= 0.0 ? size : -size);
    real[0] = next[1] + size;
    real[1] = size == 0.0 ? real[0] : next[1] - product / size;
    imaginary[0] = imaginary[1] = 0.0;
}

/* Shifts from the last two rows of a block. Every PATIENCE iterations exceptional shifts are used,
 * which end cycles. */
static shifts shifts_of(int n, const double *row, int last, int sweeps) {
    shifts s;
    s.x = row[last];
    s.y = row[last - 1 - n];
    s.cross = row[last - n] * row[last - 1];
    if (sweeps % PATIENCE == 0) {
        double size = fabs(row[last - 1]) + fabs(row[last - 2 - n]);
        s.x = s.y = row[last] + 0.75 * size;
        s.cross = -0.4375 * size * size;
    }
    return s;
}

int eigenvalues(int n, double *A, double *real, double *imaginary) {
    int k, exponent, last = n - 1, sweeps = 0;
    double size;
    if (!all_finite(A, n * n)) return 1;
    exponent = scale_rows(n, A);
    balance(n, A);
    reduce_to_hessenberg(n, A);
    size = norm(n, A);
    while (last >= 0) {
        double *row = A + last * n;
        int first = block_start(n, A, last, sweeps < PATIENCE ? 0.0 : size);
        shifts s;
        if (first < last - 1) {
            if (++sweeps > SWEEPS) return 1;
            s = shifts_of(n, row, last, sweeps);
            francis_step(n, A, first, last, &s);
            continue;
        }
        real[last] = row[last];
        imaginary[last] = 0.0;
        if (first < last)
            pair_at(row - n + last - 1, row + last - 1, real + last - 1, imaginary + last - 1);
        last = first - 1;
        sweeps = 0;
    }
    for (k = 0; k < n; k++) {
        real[k] = ldexp(real[k], exponent);
        imaginary[k] = ldexp(imaginary[k], exponent);
    }
    return 0;
}
