#include "least_squares.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CANCELLED 1e-4
#define EQUAL 1e-6
#define STALLED 1e-14
#define LAST_DIGITS 1e-2
#define SHORTEST 1e-6

/* The sum of a (n,) in the order of NumPy: eight partial sums, of halves beyond 128 elements. */
static double sum(const double *a, int n) {
    double part[8], total = 0.0;
    int i, j, half = n / 2;
    if (n < 8) {
        for (i = 0; i < n; i++) total += a[i];
        return total;
    }
    if (n > 128) {
        half -= half % 8;
        return sum(a, half) + sum(a + half, n - half);
    }
    for (j = 0; j < 8; j++) part[j] = a[j];
    for (i = 8; i < n - n % 8; i += 8)
        for (j = 0; j < 8; j++) part[j] += a[i + j];
    total = ((part[0] + part[1]) + (part[2] + part[3])) +
            ((part[4] + part[5]) + (part[6] + part[7]));
    for (; i < n; i++) total += a[i];
    return total;
}

/* The sums of the columns of a (m, n), row by row; a single column is summed as above. */
static void column_sums(const double *a, int m, int n, double *sums) {
    int i, j;
    if (n == 1) {
        sums[0] = sum(a, m);
        return;
    }
    memset(sums, 0, sizeof(double) * (size_t)n);
    for (i = 0; i < m; i++)
        for (j = 0; j < n; j++) sums[j] += a[i * n + j];
}

static double norm(const double *a, int n, double *squares) {
    int i;
    for (i = 0; i < n; i++) squares[i] = a[i] * a[i];
    return sqrt(sum(squares, n));
}

/* Reflect the columns of W (m, n), rows `stride` apart, so that the first one has its first element
 * alone; others are left as they are below it. */
static void reflect(double *W, int m, int n, int stride, double *v, int *rows, double *products,
                    double *sums) {
    int i, j, count = 0;
    double size, first;
    for (i = 0; i < m; i++) v[i] = W[i * stride];
    size = norm(v, m, products);
    first = v[0] > 0.0 ? -size : size;
    v[0] -= first;
    for (i = 0; i < m; i++)
        if (v[i] != 0.0) {
            rows[count] = i;
            v[count++] = v[i];
        }
    for (i = 0; i < count; i++)
        for (j = 1; j < n; j++)
            products[i * (n - 1) + j - 1] = v[i] * W[rows[i] * stride + j];
    column_sums(products, count, n - 1, sums);
    for (j = 0; j < n - 1; j++) sums[j] /= first * v[0];
    for (i = 0; i < count; i++)
        for (j = 1; j < n; j++) W[rows[i] * stride + j] += v[i] * sums[j - 1];
    W[0] = first;
}

static int any(const double *a, int n) {
    int i;
    for (i = 0; i < n; i++)
        if (a[i] != 0.0) return 1;
    return 0;
}

/* Space for a solution, one block. */
typedef struct {
    double *W, *products, *F; /* (m, n + 1), scratch, (n, n) */
    double *squares, *exact, *v, *sums, *y;
    int *order, *rows;
} space;

static void *opened(space *w, int m, int n) {
    size_t most = (size_t)(m > n ? m : n) + 1, area = most * most;
    char *block = malloc(sizeof(double) * (3 * area + 5 * most) + sizeof(int) * 2 * most);
    double *next = (double *)block;
    if (!block) return NULL;
    w->W = next;
    w->products = w->W + area;
    w->F = w->products + area;
    w->squares = w->F + area;
    w->exact = w->squares + most;
    w->v = w->exact + most;
    w->sums = w->v + most;
    w->y = w->sums + most;
    w->order = (int *)(w->y + most);
    w->rows = w->order + most;
    return block;
}

/* The squares of what is left of columns from row k on, summed anew. */
static void sum_anew(space *w, int m, int n, int k) {
    int i, j;
    for (j = k; j < n; j++) {
        if (!(w->squares[j] < CANCELLED * w->exact[j])) continue;
        for (i = k; i < m; i++) w->v[i - k] = w->W[i * (n + 1) + j];
        for (i = 0; i < m - k; i++) w->products[i] = w->v[i] * w->v[i];
        w->squares[j] = w->exact[j] = sum(w->products, m - k);
    }
}

static void exchange(space *w, int m, int n, int k, int other) {
    int i, kept = w->order[k];
    double value;
    w->order[k] = w->order[other];
    w->order[other] = kept;
    value = w->squares[k], w->squares[k] = w->squares[other], w->squares[other] = value;
    value = w->exact[k], w->exact[k] = w->exact[other], w->exact[other] = value;
    for (i = 0; i < m; i++) {
        double *row = w->W + i * (n + 1);
        value = row[k], row[k] = row[other], row[other] = value;
    }
}

/* W = Q R with pivots, up to its rank, which is returned. */
static int factorized(space *w, int m, int n, double gap) {
    int width = n + 1, steps = m < n ? m : n, i, j, k;
    double longest = 0.0;
    for (i = 0; i < m; i++)
        for (j = 0; j < n; j++) w->products[i * n + j] = w->W[i * width + j] * w->W[i * width + j];
    column_sums(w->products, m, n, w->squares);
    for (j = 0; j < n; j++) {
        w->exact[j] = w->squares[j];
        longest = fmax(longest, w->squares[j]);
        w->order[j] = j;
    }
    for (k = 0; k < steps; k++) {
        double most = 0.0, *row = w->W + k * width;
        int pivot = k;
        sum_anew(w, m, n, k);
        for (j = k; j < n; j++) most = j == k ? w->squares[j] : fmax(most, w->squares[j]);
        if (most <= gap * gap * longest) return k;
        while (pivot < n && !(w->squares[pivot] >= (1 - EQUAL) * most)) pivot++;
        if (pivot < n && pivot != k) exchange(w, m, n, k, pivot);
        reflect(row + k, m - k, width - k, width, w->v, w->rows, w->products, w->sums);
        for (j = 0; j < n; j++) w->squares[j] -= row[j] * row[j];
    }
    return steps;
}

static void solved(space *w, int m, int n, const double *A, const double *b, double gap, double *x) {
    int width = n + 1, height = 0, loose, rank, i, j, k;
    double *F = w->F, *u = w->v, *y = w->y;
    for (i = 0; i < m; i++) {
        if (!any(A + i * n, n)) continue;
        memcpy(w->W + height * width, A + i * n, sizeof(double) * (size_t)n);
        w->W[height++ * width + n] = b[i];
    }
    rank = factorized(w, height, n, gap);
    loose = n - rank;
    /* back substitution: the right side, and the columns that are free */
    for (k = rank - 1; k >= 0; k--) {
        double *row = w->W + k * width;
        for (j = rank; j < width; j++) row[j] /= row[k];
        for (i = 0; i < k; i++)
            for (j = rank; j < width; j++)
                w->W[i * width + j] -= w->W[i * width + k] * row[j];
    }
    for (i = 0; i < n; i++) {
        y[i] = i < rank ? w->W[i * width + n] : 0.0;
        for (j = 0; j < loose; j++)
            F[i * loose + j] = i < rank ? -w->W[i * width + rank + j] : (double)(i - rank == j);
    }
    /* what they free is taken out */
    for (k = 0; k < loose; k++) {
        int rest = loose - k - 1;
        double size;
        for (i = 0; i < n; i++) w->products[i] = F[i * loose + k] * F[i * loose + k];
        size = pow(sum(w->products, n), 0.5);
        for (i = 0; i < n; i++) u[i] = F[i * loose + k] / size;
        for (i = 0; i < n; i++)
            for (j = 0; j < rest; j++)
                w->products[i * rest + j] = u[i] * F[i * loose + k + 1 + j];
        if (rest) column_sums(w->products, n, rest, w->sums);
        for (i = 0; i < n; i++)
            for (j = 0; j < rest; j++) F[i * loose + k + 1 + j] -= u[i] * w->sums[j];
        for (i = 0; i < n; i++) w->products[i] = u[i] * y[i];
        size = sum(w->products, n);
        for (i = 0; i < n; i++) y[i] -= size * u[i];
    }
    for (i = 0; i < n; i++) x[w->order[i]] = y[i];
}

int mbs_smallest_solution(int m, int n, const double *A, const double *b, double gap, double *x) {
    space w;
    void *block = opened(&w, m, n);
    if (block) solved(&w, m, n, A, b, gap, x);
    free(block);
    return !block;
}

static int all_finite(const double *a, int n) {
    int i;
    for (i = 0; i < n; i++)
        if (!isfinite(a[i])) return 0;
    return 1;
}

/* Whether every row is below a part of its tolerance. */
static int below(const least_squares *s, double part) {
    int i;
    for (i = 0; i < s->rows; i++)
        if (!(fabs(s->r[i]) <= part * s->tolerance[i])) return 0;
    return 1;
}

static void place(const least_squares *s, const double *x, double length, const double *step) {
    int i;
    for (i = 0; i < s->unknowns; i++) s->q[s->free[i]] = x[i] + length * step[i];
}

/* The Jacobian by the unknowns, row by row; 1 where it or the residual is not finite. */
static int spread(const least_squares *s, double *J) {
    int k, n = s->unknowns;
    memset(J, 0, sizeof(double) * (size_t)(s->rows * n));
    for (k = 0; k < s->elements; k++)
        if (s->column[k] >= 0) J[s->row[k] * n + s->column[k]] = s->e[k];
    return !all_finite(s->r, s->rows) || !all_finite(J, s->rows * n);
}

int mbs_gauss_newton(least_squares *s, double *residual) {
    int n = s->unknowns, m = s->rows, i, iteration, status = LEAST_SQUARES_FAILED;
    size_t most = (size_t)(m > n ? m : n) + 1;
    double *block = malloc(sizeof(double) * ((size_t)(m * n) + 5 * most)), size, *J = block;
    double *x = J + m * n, *step = x + most, *b = step + most, *squares = b + most;
    double *kept = squares + most;
    space w;
    void *other = opened(&w, m, n);
    if (!block || !other || s->equations()) goto end;
    for (i = 0; i < n; i++) x[i] = s->q[s->free[i]];
    if (spread(s, J)) {
        *residual = HUGE_VAL;
        status = LEAST_SQUARES_OPEN;
        goto end;
    }
    size = norm(s->r, m, squares);
    for (iteration = 0; iteration < s->iterations; iteration++) {
        int reached = below(s, 1.0), found = 0;
        double length = 1.0, next = size;
        if (reached && below(s, LAST_DIGITS)) break;
        memcpy(kept, s->r, sizeof(double) * (size_t)m);
        for (i = 0; i < m; i++) b[i] = -s->r[i];
        solved(&w, m, n, J, b, s->gap, step);
        for (; length > (reached ? 0.5 : SHORTEST); length /= 2) {
            place(s, x, length, step);
            if (s->values()) goto end;
            if (!(norm(s->r, m, squares) < size)) continue;
            if (s->equations()) goto end;
            next = norm(s->r, m, squares);
            if (next < size && !spread(s, J)) {
                found = 1;
                break;
            }
        }
        if (!found) { /* the last iterate */
            for (i = 0; i < n; i++) s->q[s->free[i]] = x[i];
            memcpy(s->r, kept, sizeof(double) * (size_t)m);
            break;
        }
        for (i = 0; i < n; i++) x[i] = s->q[s->free[i]];
        size = next;
        if (length * norm(step, n, squares) < STALLED || reached) break;
    }
    *residual = size;
    status = below(s, 1.0) ? LEAST_SQUARES_CONVERGED : LEAST_SQUARES_OPEN;
end:
    free(block);
    free(other);
    return status;
}
