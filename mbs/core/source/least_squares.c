#include "least_squares.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "finite.h"

/* Fraction of a squared column length below which the remaining square is summed again: four of its
 * sixteen digits are then lost by cancellation. */
#define CANCELLED 1e-4
/* Relative difference of lengths that count as equal: the first of equal columns is the pivot,
 * since rounding decides which of them is the longest. */
#define EQUAL 1e-6
#define STALLED 1e-14    /* length of a step [rad or m] that changes no digit that matters */
#define LAST_DIGITS 1e-2 /* fraction of the tolerance above which another step is made */
#define SHORTEST 1e-6    /* fraction of a step at which the halving ends */

/* Sum a (n,) in the order of NumPy: eight partial sums, and by halves above 128 elements. */
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
    total =
        ((part[0] + part[1]) + (part[2] + part[3])) + ((part[4] + part[5]) + (part[6] + part[7]));
    for (; i < n; i++) total += a[i];
    return total;
}

/* Sum the columns of a (m, n), row by row. A single column is summed by `sum`. */
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

/* Reflect the columns of W (m, n), with a row stride of `stride`, so that the first column becomes
 * a multiple of the first unit vector. Its elements below the first are not overwritten. */
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
        for (j = 1; j < n; j++) products[i * (n - 1) + j - 1] = v[i] * W[rows[i] * stride + j];
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

/* Scratch arrays of a solution, in one block. */
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

/* Recompute the squared lengths of the columns from row k on, if cancellation spoiled them. */
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

/* Factorize W = Q R with column pivoting. Returns the rank. */
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

static void solved(space *w, int m, int n, const double *A, const double *b, double gap,
                   double *x) {
    int width = n + 1, height = 0, loose, rank, i, j, k;
    double *F = w->F, *u = w->v, *y = w->y;
    for (i = 0; i < m; i++) {
        if (!any(A + i * n, n)) continue;
        memcpy(w->W + height * width, A + i * n, sizeof(double) * (size_t)n);
        w->W[height++ * width + n] = b[i];
    }
    rank = factorized(w, height, n, gap);
    loose = n - rank;
    /* back substitution of the right side and of the dependent columns */
    for (k = rank - 1; k >= 0; k--) {
        double *row = w->W + k * width;
        for (j = rank; j < width; j++) row[j] /= row[k];
        for (i = 0; i < k; i++)
            for (j = rank; j < width; j++) w->W[i * width + j] -= w->W[i * width + k] * row[j];
    }
    for (i = 0; i < n; i++) {
        y[i] = i < rank ? w->W[i * width + n] : 0.0;
        for (j = 0; j < loose; j++)
            F[i * loose + j] = i < rank ? -w->W[i * width + rank + j] : (double)(i - rank == j);
    }
    /* remove the null space from the solution */
    for (k = 0; k < loose; k++) {
        int rest = loose - k - 1;
        double size;
        for (i = 0; i < n; i++) w->products[i] = F[i * loose + k] * F[i * loose + k];
        size = pow(sum(w->products, n), 0.5);
        for (i = 0; i < n; i++) u[i] = F[i * loose + k] / size;
        for (i = 0; i < n; i++)
            for (j = 0; j < rest; j++) w->products[i * rest + j] = u[i] * F[i * loose + k + 1 + j];
        if (rest) column_sums(w->products, n, rest, w->sums);
        for (i = 0; i < n; i++)
            for (j = 0; j < rest; j++) F[i * loose + k + 1 + j] -= u[i] * w->sums[j];
        for (i = 0; i < n; i++) w->products[i] = u[i] * y[i];
        size = sum(w->products, n);
        for (i = 0; i < n; i++) y[i] -= size * u[i];
    }
    for (i = 0; i < n; i++) x[w->order[i]] = y[i];
}

int shortest_solution(int m, int n, const double *A, const double *b, double gap, double *x) {
    space w;
    void *block = opened(&w, m, n);
    if (block) solved(&w, m, n, A, b, gap, x);
    free(block);
    return !block;
}

/* Whether every residual is at most `part` times its tolerance. */
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

/* Write the elements of the Jacobian by the unknowns to J (rows, unknowns), by rows. */
static void spread(const least_squares *s, double *J) {
    int k, n = s->unknowns;
    memset(J, 0, sizeof(double) * (size_t)(s->rows * n));
    for (k = 0; k < s->elements; k++)
        if (s->column[k] >= 0) J[s->row[k] * n + s->column[k]] = s->e[k];
}

static int is_finite(const least_squares *s) {
    int k;
    if (!all_finite(s->r, s->rows)) return 0;
    for (k = 0; k < s->elements; k++)
        if (s->column[k] >= 0 && !isfinite(s->e[k])) return 0;
    return 1;
}

static int evaluate(const least_squares *s, const model_function *f) {
    const double *arg[2];
    double *res[2];
    arg[0] = s->q;
    arg[1] = s->p;
    res[0] = s->r;
    res[1] = s->e;
    return f->evaluate(f->self, arg, res);
}

typedef struct {
    double *J, *x, *step, *b, *squares, *kept; /* J: NULL if the model makes the steps */
    space space;
} iteration;

static void *open_iteration(iteration *t, const least_squares *s) {
    int m = s->rows, n = s->unknowns, dense = !s->step.evaluate;
    size_t most = (size_t)(m > n ? m : n) + 1, area = dense ? (size_t)(m * n) : 0;
    double *block = malloc(sizeof(double) * (area + 5 * most));
    if (!block) return NULL;
    t->J = dense ? block : NULL;
    t->x = block + area;
    t->step = t->x + most;
    t->b = t->step + most;
    t->squares = t->b + most;
    t->kept = t->squares + most;
    return block;
}

static int make_step(const least_squares *s, iteration *t) {
    int i, m = s->rows, n = s->unknowns;
    const double *arg[2];
    for (i = 0; i < m; i++) t->b[i] = -s->r[i];
    if (!t->J) {
        arg[0] = s->e;
        arg[1] = t->b;
        return s->step.evaluate(s->step.self, arg, &t->step);
    }
    spread(s, t->J);
    solved(&t->space, m, n, t->J, t->b, s->gap, t->step);
    return 0;
}

/* Halve the step until the residual decreases. Returns 0 on success, 1 if no length suffices, and
 * -1 if a function failed. */
static int line_search(least_squares *s, iteration *t, int reached, double *size, double *length) {
    int m = s->rows;
    for (*length = 1.0; *length > (reached ? 0.5 : SHORTEST); *length /= 2) {
        double next;
        place(s, t->x, *length, t->step);
        if (s->values.evaluate) {
            if (evaluate(s, &s->values)) return -1;
            if (!(norm(s->r, m, t->squares) < *size)) continue;
        }
        if (evaluate(s, &s->equations)) return -1;
        next = norm(s->r, m, t->squares);
        if (next < *size && is_finite(s)) {
            *size = next;
            return 0;
        }
    }
    return 1;
}

static int iterate(least_squares *s, iteration *t, double *residual) {
    int n = s->unknowns, m = s->rows, i, count, searched;
    double size, length;
    if (evaluate(s, &s->equations)) return LEAST_SQUARES_FAILED;
    *residual = HUGE_VAL;
    if (!is_finite(s)) return LEAST_SQUARES_OPEN;
    for (i = 0; i < n; i++) t->x[i] = s->q[s->free[i]];
    size = norm(s->r, m, t->squares);
    for (count = 0; count < s->iterations; count++) {
        int reached = below(s, 1.0);
        if (reached && below(s, LAST_DIGITS)) break;
        memcpy(t->kept, s->r, sizeof(double) * (size_t)m);
        if (make_step(s, t)) return LEAST_SQUARES_FAILED;
        searched = line_search(s, t, reached, &size, &length);
        if (searched < 0) return LEAST_SQUARES_FAILED;
        if (searched > 0) { /* return to the last iterate */
            for (i = 0; i < n; i++) s->q[s->free[i]] = t->x[i];
            memcpy(s->r, t->kept, sizeof(double) * (size_t)m);
            break;
        }
        for (i = 0; i < n; i++) t->x[i] = s->q[s->free[i]];
        if (length * norm(t->step, n, t->squares) < STALLED || reached) break;
    }
    *residual = size;
    return below(s, 1.0) ? LEAST_SQUARES_CONVERGED : LEAST_SQUARES_OPEN;
}

int gauss_newton(least_squares *s, double *residual) {
    iteration t;
    int status = LEAST_SQUARES_FAILED;
    void *block = open_iteration(&t, s);
    void *other = block && t.J ? opened(&t.space, s->rows, s->unknowns) : block;
    if (block && other) status = iterate(s, &t, residual);
    if (other != block) free(other);
    free(block);
    return status;
}
