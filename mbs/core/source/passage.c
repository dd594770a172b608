#include "passage.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dense.h"
#include "dopri5.h"

/* Number of steps for which the regularity is extrapolated, a little more than the next step. */
#define AHEAD 1.2
/* Fraction of the largest sigma below which values are means of neighbours. The rounding error of
 * u' grows with the inverse square of this fraction, 3e-16 / (3e-5)^2 = 3e-7; at smaller sigma no
 * accuracy remains. A larger fraction smooths the motion near the singular configuration, such as
 * that of a delta robot whose legs become singular one after another. */
#define FLOOR 3e-5
#define AWAY 2.0      /* multiple of FLOOR above which a state is regular */
#define BESIDE 4.0    /* multiple of FLOOR between neighbours in means, so that they are regular */
/* Weights of neighbours 1, 2 and 3 on either side: the mean is exact up to degree five. */
static const double MEAN[3] = {0.75, -0.3, 0.05};
/* Alignment of the tangents with the chart (1 at its origin) below which the chart is left: the
 * tangents are then rotated by 78 degrees. */
#define TURNED 0.2
#define NEWTON 10       /* maximum Newton steps onto the rows; three or four are usual */
#define DEGENERATE (10 * DBL_EPSILON) /* fraction of the largest pivot that counts as zero */
/* Number of rows above which they are factorized without pivoting: the fill by pivoting costs more
 * than its better estimate of the smallest singular value (by a factor of two) is worth. */
#define MANY 32
#define LAST_MOVE 1e-9  /* size of a Newton step [rad or m] after which the next is rounding */
/* Fraction of the velocities, or of the distance that they move in a step, by which a state may
 * differ from the explicit result of the stages. The error control permits a hundredth of it. On
 * another branch the velocities differ by about their own size. */
#define BREAK 0.01
/* Rounding error of u' for accelerations and sigma of size one. It is added to the tolerance. */
#define NOISE 3e-16
/* Multiple of atol (half a tolerance) that limits the rounding error of a stage near a singular
 * configuration. A larger error rejects a step that starts further away. The next shorter step has
 * the singular configuration between two stages. */
#define DODGED 15.0
#define DODGES 8 /* consecutive rejected steps before more rounding is accepted: 0.83^8 = 0.2 */
#define MOST_NOISE 1000.0 /* multiple of atol that is accepted afterwards: 40 tolerances */
/* Limits if a guide selects the branch: the largest move from the guide onto the rows [rad or m],
 * the fraction of its velocities by which the velocities may differ, and the smallest speed for
 * this fraction [rad/s or m/s]. On another branch the velocities differ by about their own size. */
#define REACH 0.1
#define ASTRAY 0.1
#define IDLE 1e-3
/* Distance [rad or m], against the velocity, of the regular state for a start that is singular. */
#define BACK 0.02
#define HALVINGS 25 /* bisections of a step to locate dependent rows, to 3e-8 of its length */
/* Largest residual of the rows at a singular configuration at which branches meet. A larger
 * residual may explain why a motion stops. Positions satisfy the rows to 1e-13. */
#define APART 2e-13
/* Fraction of its velocities by which a singular start may differ from the branch. The mean of
 * neighbouring values has an error of 1e-9; a larger difference has energy across the branch. */
#define STRAY 1e-6
/* Fraction of the longest row below which a row is dependent when a start is projected. Where
 * branches cross, each Newton step halves the distance, until its square reaches the rounding error
 * of the rows. */
#define SETTLED 1e-8
#define PLACING 40     /* maximum Newton steps of a start: to 1e-12 of the first distance */
#define CLOSED 1e-12   /* largest residual of a start, for coordinates of size one */
/* Fraction of the longest row below which a row is dependent when the velocities of a start are
 * computed. It exceeds the distance from the crossing that a start projected to CLOSED has. */
#define DEPENDENT 1e-6
#define MASSLESS 1e-10 /* fraction of the largest inertia pivot below which a pivot is zero */

/* Offsets in `memory`. */
enum { SIGMA, LARGEST, REGULARITY, RISE, SEEN, SEEN_TIME, BASED, BASE_TIME, BASE };

/* Set of rows, with a bit for each row. */
typedef unsigned long long mask;
#define BITS 64
#define WORDS(n) (((n) + BITS - 1) / BITS)

/* Sparsity pattern of a matrix. Elements start[k] .. start[k + 1] - 1 belong to column k and have
 * the row indices row[], in ascending order. By rows: entries begin[i] .. begin[i + 1] - 1 belong
 * to row i, with the column index column[] and the index from[] in the order by columns. */
typedef struct {
    int columns, rows, *start, *row;
    int *begin, *column, *from;
} pattern;

/* Sparse factors A (n, m) = Q R by Householder reflections. Each reflection acts only on the rows
 * in which its column has elements, because each row of a loop depends on few joints. */
typedef struct {
    double *A, *weight;  /* A, replaced by R; weights of the reflections */
    double *tails;       /* vector of reflection k, from index k n on */
    int *moved, *count;  /* rows of reflection k, from index k n on, row[k] first; their number */
    int *order;          /* column k of R is stored in column order[k] of A */
    int *row;            /* row k of R is stored in row row[k] of A; rows without reflection last */
    double *size;        /* squared lengths of the remaining columns, by position in order */
    mask *where;         /* rows in which each remaining column may have elements, WORDS(n) words */
    int *last;           /* last position in order at which a row may have an element */
    mask *touched;       /* rows in which each column of A may have had elements, WORDS(n) words */
    int *upper, *uppers; /* rows of the elements above the diagonal of R, by columns of A; number */
    int height, columns; /* size of A when it was last filled. Elements outside touched are zero,
                            unless height is 0 */
} factors;

/* Constraint rows, forces and tangents at a state. */
typedef struct {
    passage_rows rows;
    double *inertia;      /* elements of M by its pattern */
    double *M, *f, *rate; /* M is replaced by its Cholesky factor L */
    int *end;             /* row after the last element of each column of L */
    factors qr;           /* factors of L^-1 J' */
    double *T;            /* (nv, d) tangents, orthonormal in the metric of M */
    int rank;
    double sigma; /* smallest pivot of R: distance from the loss of rank */
    double more;  /* factor of J' J that was added to M, usually 0 */
} frame;

struct passage {
    stepper *s;
    const stepper_method *inner;
    passage_size size;
    passage_model model;
    double *memory, *block;
    int *numbers;
    pattern slope, J, N, M;
    int *J_from; /* indices in slope of the elements of J, if nq equals nv */
    frame base, here; /* frames at the origin of the chart and at the present point */
    factors other; /* factors of temporary matrices */
    double *C;            /* (d, nq) matrix from positions to chart coordinates */
    const double *guide;  /* state that selects the branch, or NULL */
    double *guided, ahead; /* rates of its positions, and time by which they are extrapolated */
    double *drift;        /* (nv,) velocity of the base at u = 0, if rows depend on time */
    double *own, *trial;  /* (2 d + nz,) chart coordinates of the state and of a stage */
    double *slopes[7];    /* slopes of the chart coordinates at the stages */
    double *full[7];      /* slopes of x at the stages */
    double *dense;        /* (5, n) dense output of the last step */
    double *at, *side, *sum;       /* scratch: a state (n,), a direction (d,), neighbours */
    double *K, *r, *y, *w, *G;     /* scratch */
    double *across;       /* (5, n) dense output of the attempted step */
    double *ready_x;
    double ready_time, sigma;
    double alignment; /* alignment of the tangents with the chart: 1 at its origin, 0 orthogonal */
    int d, ready, charted, kept, singular, lasting;
    int opened; /* whether `open` of the wrapped method was called at the present state */
    int dodges; /* number of steps rejected in succession for the rounding of a stage */
    int missed; /* whether branches that do not meet were found since the last full step */
};

/* Solve L y = b in place. L (n, n) is stored by columns; column k has elements before end[k]. */
static void lower(const double *L, const int *end, int n, double *b) {
    int i, k;
    for (k = 0; k < n; k++) {
        if (b[k] == 0.0) continue; /* rows of loops depend on few joints */
        b[k] /= L[k * n + k];
        for (i = k + 1; i < end[k]; i++) b[i] -= L[k * n + i] * b[k];
    }
}

/* Bit of a row in its word. */
static mask bit(int row) { return (mask)1 << row % BITS; }

/* Index of the lowest bit of a nonzero word. */
static int lowest(mask bits) {
#ifdef __GNUC__
    return __builtin_ctzll(bits);
#else
    int row = 0;
    for (; !(bits & 1); bits >>= 1) row++;
    return row;
#endif
}

/* Solve L y = b in place for a sparse b. set: rows of its elements; rows that fill in are added. */
static void lower_among(const double *L, const int *end, int n, mask *set, double *b) {
    int word, i, k;
    for (word = 0; word < WORDS(n); word++) {
        mask done = 0, bits;
        while ((bits = set[word] & ~done) != 0) {
            k = word * BITS + lowest(bits);
            done |= bit(k);
            if (b[k] == 0.0) continue;
            b[k] /= L[k * n + k];
            for (i = k + 1; i < end[k]; i++) {
                b[i] -= L[k * n + i] * b[k];
                set[i / BITS] |= bit(i);
            }
        }
    }
}

/* Solve L' y = b in place. */
static void lower_transposed(const double *L, const int *end, int n, double *b) {
    int i, k;
    for (k = n - 1; k >= 0; k--) {
        double sum = b[k];
        for (i = k + 1; i < end[k]; i++) sum -= L[k * n + i] * b[i];
        b[k] = sum / L[k * n + k];
    }
}

/* Factorize M (n, n) = L L' in place. end: row after the last element of each column, on input of
 * M, on return of L. Returns 1 if a pivot is below MASSLESS of the largest diagonal element. */
static int cholesky(double *M, int *end, int n) {
    double largest = 0.0;
    int i, j, k;
    for (k = 0; k < n; k++) largest = fmax(largest, M[k * n + k]);
    for (k = 0; k < n; k++) {
        double *column = M + k * n;
        if (!(column[k] > MASSLESS * largest)) return 1;
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

/* Evaluate the rows at x. Returns 1 on failure. */
static int rows_at(passage *g, double t, const double *x, const passage_rows *rows) {
    int j, nv = g->size.nv;
    if (g->model.rows(g->s->user, t, x, rows)) return 1;
    if (g->size.nq > nv) return 0;
    memset(rows->bend, 0, sizeof(double) * (size_t)nv);
    for (j = 0; j < g->J.start[nv]; j++) rows->J[j] = rows->slope[g->J_from[j]];
    return 0;
}

/* Evaluate rows, inertia and forces at x. Returns 1 on failure. */
static int evaluate(passage *g, frame *p, double t, const double *x) {
    void *user = g->s->user;
    if (rows_at(g, t, x, &p->rows) || g->model.forces(user, t, x, p->inertia, p->f, p->rate))
        return 1;
    p->rank = (int)fmin(*p->rows.rank, fmin(g->size.nv, g->size.speeds));
    p->more = 0.0;
    return !stepper_all_finite(p->inertia, g->M.start[g->size.nv]) ||
           !stepper_all_finite(p->f, g->size.nv);
}

/* Write the elements of M over L, and the ends of its columns. */
static void place_mass(const passage *g, frame *p) {
    int n = g->size.nv, i, k;
    for (k = 0; k < n; k++) {
        double *column = p->M + k * n;
        int first = g->M.start[k], after = g->M.start[k + 1];
        for (i = k; i < p->end[k]; i++) column[i] = 0.0;
        p->end[k] = k + 1;
        for (i = first; i < after; i++) {
            if (g->M.row[i] < k) continue;
            column[g->M.row[i]] = p->inertia[i];
            p->end[k] = g->M.row[i] + 1;
        }
    }
}

/* Compute L from M. If links without mass make M singular, factorize M + more J' J, which gives the
 * same motion on the rows. Returns 1 if this matrix is singular, too. */
static int factor_mass(passage *g, frame *p) {
    int n = g->size.nv, m = g->size.speeds, i, j, k;
    double *square = g->G, mass = 0.0, length = 0.0;
    place_mass(g, p);
    if (!cholesky(p->M, p->end, n)) return 0;
    place_mass(g, p);
    for (k = 0; k < n; k++) mass += p->M[k * n + k];
    for (k = 0; k < g->J.start[n]; k++) length += p->rows.J[k] * p->rows.J[k];
    if (!(length > 0.0) || !(mass > 0.0)) return 1;
    p->more = mass / length;
    memset(square, 0, sizeof(double) * (size_t)(n * n));
    for (k = 0; k < m; k++)
        for (j = g->J.begin[k]; j < g->J.begin[k + 1]; j++)
            for (i = j; i < g->J.begin[k + 1]; i++)
                square[g->J.column[j] * n + g->J.column[i]] +=
                    p->rows.J[g->J.from[i]] * p->rows.J[g->J.from[j]];
    for (j = 0; j < n; j++) {
        for (i = j; i < n; i++) p->M[j * n + i] += p->more * square[j * n + i];
        p->end[j] = n;
    }
    return cholesky(p->M, p->end, n);
}

/* Apply reflection k to b (n,) in place. */
static void reflect(const factors *f, int n, int k, double *b) {
    const double *tail = f->tails + k * n;
    const int *rows = f->moved + k * n;
    double sum = b[rows[0]];
    int i, count = f->count[k];
    for (i = 1; i < count; i++) sum += tail[i] * b[rows[i]];
    sum *= f->weight[k];
    if (sum == 0.0) return;
    b[rows[0]] -= sum;
    for (i = 1; i < count; i++) b[rows[i]] -= sum * tail[i];
}

/* Set A (n, m) to zero, before it is filled by put. */
static void begin_columns(factors *f, int n, int m) {
    int known = f->height == n && f->columns >= m ? m : 0, words = WORDS(n), j, word;
    for (j = 0; j < known; j++)
        for (word = 0; word < words; word++) {
            mask *bits = f->touched + j * words + word;
            for (; *bits; *bits &= *bits - 1) f->A[j * n + word * BITS + lowest(*bits)] = 0.0;
        }
    if (!known) {
        memset(f->A, 0, sizeof *f->A * (size_t)(n * m));
        memset(f->touched, 0, sizeof *f->touched * (size_t)(m * words));
    }
    f->columns = known ? f->columns : m;
    f->height = n;
}

/* Set element (i, j) of A (n, m). */
static void put(factors *f, int n, int i, int j, double value) {
    f->A[j * n + i] = value;
    f->touched[j * WORDS(n) + i / BITS] |= bit(i);
}

/* Find the nonzero elements of A (n, m) if it was not filled by put. */
static void look_for_columns(factors *f, int n, int m) {
    int i, j;
    memset(f->touched, 0, sizeof *f->touched * (size_t)(m * WORDS(n)));
    for (j = 0; j < m; j++)
        for (i = 0; i < n; i++)
            if (f->A[j * n + i] != 0.0) f->touched[j * WORDS(n) + i / BITS] |= bit(i);
    f->height = 0;
}

/* Set the nonzero rows and the squared length of the column at position k. */
static void look_at(factors *f, int n, int k) {
    const double *column = f->A + f->order[k] * n;
    const mask *touched = f->touched + f->order[k] * WORDS(n);
    mask *where = f->where + k * WORDS(n);
    double size = 0.0;
    int word, i;
    for (word = 0; word < WORDS(n); word++) {
        mask bits = touched[word];
        for (where[word] = 0; bits; bits &= bits - 1) {
            i = word * BITS + lowest(bits);
            if (column[i] == 0.0) continue;
            where[word] |= bit(i);
            f->last[i] = k;
            size += column[i] * column[i];
        }
    }
    f->size[k] = size;
    f->uppers[f->order[k]] = 0;
}

/* Exchange the columns at positions k and j. */
static void exchange(factors *f, int n, int k, int j) {
    int i, words = WORDS(n), column = f->order[k];
    double kept = f->size[k];
    f->order[k] = f->order[j], f->order[j] = column;
    f->size[k] = f->size[j], f->size[j] = kept;
    for (i = 0; i < words; i++) {
        mask bits = f->where[k * words + i];
        f->where[k * words + i] = f->where[j * words + i];
        f->where[j * words + i] = bits;
    }
}

/* Make reflection k. Its column keeps one element: in the next row, or in the first row
 * with an element if there are many columns. */
static void make_reflection(factors *f, int n, int k, int many) {
    double *column = f->A + f->order[k] * n, *tail = f->tails + k * n;
    mask *where = f->where + k * WORDS(n);
    int *rows = f->moved + k * n, count = 0, first, word, i;
    if (!many) where[f->row[k] / BITS] |= bit(f->row[k]);
    for (word = 0; word < WORDS(n); word++) {
        mask bits = where[word];
        for (; bits; bits &= bits - 1) rows[count++] = word * BITS + lowest(bits);
    }
    if (count == 0) rows[count++] = f->row[k];
    for (i = 0; i < count; i++) tail[i] = column[rows[i]];
    f->weight[k] = dense_reflection(tail, count);
    column[rows[0]] = tail[0];
    f->touched[f->order[k] * WORDS(n) + rows[0] / BITS] |= bit(rows[0]);
    f->count[k] = count;
    for (first = k; f->row[first] != rows[0]; first++) continue;
    for (; first > k; first--) f->row[first] = f->row[first - 1];
    f->row[k] = rows[0];
}

/* Apply reflection k to the column at position j, if they have common rows. Update its nonzero rows
 * and, if sums is set, its remaining squared length. */
static void reflect_column(factors *f, int n, int k, int j, int sums) {
    int i, words = WORDS(n), done = f->row[k], own = f->order[j];
    mask *touched = f->touched + own * words, *where = f->where + j * words;
    const mask *other = f->where + k * words;
    double *column = f->A + own * n;
    for (i = 0; i < words && !(where[i] & other[i]); i++) continue;
    if (i == words) return;
    reflect(f, n, k, column);
    for (i = 0; i < words; i++) where[i] |= other[i], touched[i] |= where[i];
    where[done / BITS] &= ~bit(done);
    f->upper[own * n + f->uppers[own]++] = done;
    if (!sums) return;
    for (f->size[j] = 0.0, i = k + 1; i < n; i++)
        f->size[j] += column[f->row[i]] * column[f->row[i]];
}

/* Return the position after the last column that reflection k changes, and note its fill. */
static int reach_of(factors *f, int n, int k) {
    const int *rows = f->moved + k * n;
    int end = k + 1, i;
    for (i = 0; i < f->count[k]; i++)
        if (f->last[rows[i]] >= end) end = f->last[rows[i]] + 1;
    for (i = 0; i < f->count[k]; i++) f->last[rows[i]] = end - 1;
    return end;
}

/* Factorize A (n, m) = Q R up to `rank`, or until the remaining columns are shorter than `least`
 * times the first pivot. Returns the rank. The pivot is the longest remaining column. More than
 * MANY columns that are all required are factorized in order, because reflections of a chain of
 * loops then have few rows. */
static int factorize(factors *f, int n, int m, int rank, double least) {
    double first = 0.0;
    int i, j, k, end, in_order = m > MANY && rank == m && least == 0.0;
    for (i = 0; i < n; i++) f->row[i] = i;
    for (j = 0; j < m; j++) {
        f->order[j] = j;
        look_at(f, n, j);
    }
    for (k = 0; k < rank; k++) {
        int longest = k;
        for (j = k + 1; j < m && !in_order; j++)
            if (f->size[j] > f->size[longest]) longest = j;
        if (k == 0) first = f->size[longest];
        if (f->size[longest] < least * least * first) return k;
        if (longest != k) exchange(f, n, k, longest);
        make_reflection(f, n, k, m > MANY);
        end = in_order ? reach_of(f, n, k) : m;
        for (j = k + 1; j < end; j++) reflect_column(f, n, k, j, !in_order);
    }
    return rank;
}

/* Solve R' y = b for y = Q' x, so that A' x = b for the first `rank` columns in order of pivots. */
static void forward(const factors *f, int n, int rank, const double *b, double *y) {
    int i, k;
    for (k = 0; k < rank; k++) {
        const double *column = f->A + f->order[k] * n;
        double sum = b[f->order[k]];
        const int *upper = f->upper + f->order[k] * n;
        for (i = 0; i < f->uppers[f->order[k]]; i++) sum -= column[upper[i]] * y[upper[i]];
        y[f->row[k]] = sum / column[f->row[k]];
    }
}

/* Absolute value of pivot k. */
static double pivot_of(const factors *f, int n, int k) {
    return fabs(f->A[f->order[k] * n + f->row[k]]);
}

/* Compute y = Q y in place. */
static void reflect_back(const factors *f, int n, int rank, double *y) {
    int k;
    for (k = rank - 1; k >= 0; k--) reflect(f, n, k, y);
}

/* Factorize L^-1 J' = Q R up to the rank and set sigma. */
static void factor_rows(passage *g, frame *p) {
    int n = g->size.nv, m = g->size.speeds, i, j;
    factors *f = &p->qr;
    begin_columns(f, n, m);
    for (j = 0; j < m; j++) {
        for (i = g->J.begin[j]; i < g->J.begin[j + 1]; i++)
            put(f, n, g->J.column[i], j, p->rows.J[g->J.from[i]]);
        lower_among(p->M, p->end, n, f->touched + j * WORDS(n), f->A + j * n);
    }
    factorize(&p->qr, n, m, p->rank, 0.0);
    p->sigma = p->rank ? HUGE_VAL : 1.0;
    for (j = 0; j < p->rank; j++) p->sigma = fmin(p->sigma, pivot_of(&p->qr, n, j));
}

/* Compute the shortest y (n,) with A' y = b, where A (n, m) is in g->other. Rows of A' that are
 * dependent within the fraction `least` are omitted. */
static void shortest(passage *g, int n, int m, const double *b, double least, double *y) {
    factors *f = &g->other;
    int rank, k;
    look_for_columns(f, n, m);
    rank = factorize(f, n, m, n < m ? n : m, least);
    memset(y, 0, sizeof(double) * (size_t)n);
    for (k = 0; k < rank; k++) /* empty rows determine nothing */
        if (pivot_of(f, n, k) == 0.0) rank = k;
    forward(f, n, rank, b, y);
    reflect_back(f, n, rank, y);
}

/* Compute v = L^-T Q y in place. */
static void to_velocity(const passage *g, const frame *p, double *y) {
    int n = g->size.nv;
    reflect_back(&p->qr, n, p->rank, y);
    lower_transposed(p->M, p->end, n, y);
}

/* Compute the first `rank` elements of y such that J v = c for v = L^-T Q y. */
static void along_rows(const passage *g, const frame *p, const double *c, double *y) {
    forward(&p->qr, g->size.nv, p->rank, c, y);
}

/* Compute L, the factors of the rows, and the tangents T. Returns 1 on failure. */
static int factor(passage *g, frame *p) {
    int n = g->size.nv, j;
    if (factor_mass(g, p)) return 1;
    factor_rows(g, p);
    for (j = 0; j < n - p->rank; j++) {
        double *T = p->T + j * n;
        memset(T, 0, sizeof(double) * (size_t)n);
        T[p->qr.row[p->rank + j]] = 1.0;
        to_velocity(g, p, T);
    }
    return !isfinite(p->sigma);
}

/* Compute the velocity v with J v = b that is shortest in the metric of M. */
static void particular(const passage *g, const frame *p, double *v) {
    memset(v, 0, sizeof(double) * (size_t)g->size.nv);
    along_rows(g, p, p->rows.b, v);
    to_velocity(g, p, v);
}

/* Element i of N v. */
static double rate_of(const passage *g, const passage_rows *rows, int i, const double *v) {
    double rate = 0.0;
    int j;
    if (g->size.nq == g->size.nv) return v[i];
    for (j = g->N.begin[i]; j < g->N.begin[i + 1]; j++)
        rate += rows->N[g->N.from[j]] * v[g->N.column[j]];
    return rate;
}

/* Compute y = C N v, the rates of the chart coordinates. */
static void coordinates(const passage *g, const frame *p, const double *v, double *y) {
    int i, k;
    for (k = 0; k < g->d; k++) y[k] = 0.0;
    for (i = 0; i < g->size.nq; i++) {
        double rate = rate_of(g, &p->rows, i, v);
        for (k = 0; k < g->d; k++) y[k] += g->C[i * g->d + k] * rate;
    }
}

/* Factorize A (n, n) = L U with row exchanges, in place, and apply the row operations to b
 * (n, count). Returns the sign of the determinant, 0 if A is singular. */
static int eliminate(double *A, int n, double *b, int count) {
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

/* Compute b = A^-1 b (n, count) in place. A (n, n) is overwritten. Returns 1 if it is singular. */
static int solve(double *A, int n, double *b, int count) {
    int i, j, k;
    if (!eliminate(A, n, b, count)) return 1;
    for (j = 0; j < count; j++)
        for (k = n - 1; k >= 0; k--) {
            for (i = k + 1; i < n; i++) b[j * n + k] -= A[i * n + k] * b[j * n + i];
            b[j * n + k] /= A[k * n + k];
        }
    return 0;
}

/* Compute C = T' M N^+ at the base. Returns 1 on failure. */
static int coordinates_of_base(passage *g) {
    frame *p = &g->base;
    int nq = g->size.nq, nv = g->size.nv, i, j, k, d = nv - p->rank;
    double *S = g->G, *B = g->K; /* (nv, nv), (nv, d) */
    g->d = d;
    for (k = 0; k < d; k++) {
        double *column = B + k * nv; /* M T = L L' T */
        memset(column, 0, sizeof(double) * (size_t)nv);
        for (i = 0; i < nv; i++) {
            double sum = 0.0;
            for (j = i; j < p->end[i]; j++) sum += p->M[i * nv + j] * p->T[k * nv + j];
            for (j = i; j < p->end[i]; j++) column[j] += p->M[i * nv + j] * sum;
        }
    }
    if (nq == nv) {
        for (k = 0; k < d; k++)
            for (i = 0; i < nq; i++) g->C[i * d + k] = B[k * nv + i];
        return 0;
    }
    for (i = 0; i < nv; i++)
        for (j = 0; j < nv; j++) S[j * nv + i] = 0.0;
    for (k = 0; k < nq; k++)
        for (i = g->N.begin[k]; i < g->N.begin[k + 1]; i++)
            for (j = g->N.begin[k]; j < g->N.begin[k + 1]; j++)
                S[g->N.column[j] * nv + g->N.column[i]] +=
                    p->rows.N[g->N.from[i]] * p->rows.N[g->N.from[j]];
    if (solve(S, nv, B, d)) return 1;
    for (k = 0; k < d; k++)
        for (i = 0; i < nq; i++) {
            g->C[i * d + k] = 0.0;
            for (j = g->N.begin[i]; j < g->N.begin[i + 1]; j++)
                g->C[i * d + k] += p->rows.N[g->N.from[j]] * B[k * nv + g->N.column[j]];
        }
    return 0;
}

/* Replace the residuals r of the rows and of xi by the Newton step, by a QR factorization of the
 * slopes K (rows, nq). Returns 1 if they are dependent. */
static int newton_step(passage *g, int rows, double *r) {
    double *K = g->K, least = HUGE_VAL, most = 0.0;
    int nq = g->size.nq, i, j, k;
    for (k = 0; k < nq; k++) {
        double weight = dense_reflection(K + k * rows + k, rows - k);
        for (j = k + 1; j < nq; j++)
            dense_reflect(K + k * rows + k, weight, rows - k, K + j * rows + k);
        dense_reflect(K + k * rows + k, weight, rows - k, r + k);
        least = fmin(least, fabs(K[k * rows + k]));
        most = fmax(most, fabs(K[k * rows + k]));
    }
    if (!(least > DEGENERATE * most)) return 1;
    for (k = nq - 1; k >= 0; k--) {
        for (i = k + 1; i < nq; i++) r[k] -= K[i * rows + k] * r[i];
        r[k] /= K[k * rows + k];
    }
    return 0;
}

/* Complete a square matrix (n, n) whose first rows are factorized (transposed) and whose last rows
 * are D (d, n). Computes Z (d, n), a basis of the null space of the first rows, and S = D Z'
 * (d, d). */
static void border(const factors *f, int n, int d, const double *D, double *Z, double *S) {
    int m = n - d, i, j, k;
    memset(Z, 0, sizeof(double) * (size_t)(n * d));
    for (k = 0; k < d; k++) {
        Z[k * n + f->row[m + k]] = 1.0;
        reflect_back(f, n, m, Z + k * n);
        for (j = 0; j < d; j++)
            for (S[k * d + j] = 0.0, i = 0; i < n; i++) S[k * d + j] += D[j * n + i] * Z[k * n + i];
    }
}

/* Newton step as in newton_step, for as many rows as positions: first onto the sparse rows of the
 * loops, then in their null space by the dense rows D (d, nq) of xi. */
static int sparse_newton_step(passage *g, const double *slopes, const double *D, double *r) {
    factors *f = &g->other;
    int n = g->size.nq, d = g->d, m = n - d, i, j, k;
    double *step = g->y, *along = g->K + n * n, *S = g->G;
    double least = HUGE_VAL, most = 0.0;
    begin_columns(f, n, m);
    for (j = 0; j < m; j++)
        for (i = g->slope.begin[j]; i < g->slope.begin[j + 1]; i++)
            put(f, n, g->slope.column[i], j, slopes[g->slope.from[i]]);
    factorize(f, n, m, m, 0.0);
    for (k = 0; k < m; k++) {
        least = fmin(least, pivot_of(f, n, k));
        most = fmax(most, pivot_of(f, n, k));
    }
    if (!(least > DEGENERATE * most)) return 1;
    memset(step, 0, sizeof(double) * (size_t)n);
    forward(f, n, m, r, step);
    reflect_back(f, n, m, step);
    border(f, n, d, D, along, S);
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) r[m + k] -= D[k * n + i] * step[i];
    if (solve(S, d, r + m, 1)) return 1;
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) step[i] += along[k * n + i] * r[m + k];
    memcpy(r, step, sizeof(double) * (size_t)n);
    return 0;
}

/* Project the positions in x onto all rows at fixed xi by Newton steps. *distance: sum of their
 * largest elements. Returns 1 if they do not converge. */
static int onto_rows(passage *g, double t, const double *xi, double *x, double *distance) {
    frame *p = &g->here;
    const double *q0 = g->memory + BASE;
    int nq = g->size.nq, m = g->size.positions, d = g->d, rows = m + d, i, j, k, pass;
    int first = g->size.speeds - g->size.anchors, after = g->size.speeds;
    double *K = g->K, *r = g->r, total = 0.0;
    for (pass = 0; pass < NEWTON; pass++) {
        double move = 0.0;
        if (rows_at(g, t, x, &p->rows)) return 1;
        memcpy(r, p->rows.position, sizeof(double) * (size_t)m);
        for (i = first; i < after; i++) r[i] -= g->base.rows.position[i];
        if (rows != nq) {
            memset(K, 0, sizeof(double) * (size_t)(rows * nq));
            for (j = 0; j < nq; j++)
                for (i = g->slope.start[j]; i < g->slope.start[j + 1]; i++)
                    K[j * rows + g->slope.row[i]] = p->rows.slope[i];
        }
        for (k = 0; k < d; k++) { /* rows of about unit length */
            double size = 0.0, off = -xi[k];
            for (j = 0; j < nq; j++) size += g->C[j * d + k] * g->C[j * d + k];
            size = sqrt(size);
            for (j = 0; j < nq; j++) {
                K[rows == nq ? k * nq + j : j * rows + m + k] = g->C[j * d + k] / size;
                off += g->C[j * d + k] * (x[j] - q0[j]);
            }
            r[m + k] = off / size;
        }
        if (rows < nq || !stepper_all_finite(r, rows)) return 1;
        if (rows == nq ? sparse_newton_step(g, p->rows.slope, K, r) : newton_step(g, rows, r))
            return 1;
        for (k = 0; k < nq; k++) {
            x[k] -= r[k];
            move = fmax(move, fabs(r[k]));
        }
        total += move;
        if (!isfinite(total)) return 1;
        if (move < LAST_MOVE) {
            *distance = total;
            return 0;
        }
    }
    return 1;
}

/* Predict the positions from the guide, or by tangent and curvature from the base. The prediction
 * selects the branch. Returns 1 on failure. */
static int predict(passage *g, double t, const double *xi, double *x) {
    const double *x0 = g->memory + BASE;
    int nq = g->size.nq, nv = g->size.nv, n = g->s->n, i, j, k;
    double dt = g->size.moving ? t - g->memory[BASE_TIME] : 1.0, *D = g->y, *bend = g->w;
    frame *p = &g->here;
    if (g->guide) {
        for (i = 0; i < nq; i++) x[i] = g->guide[i] + g->ahead * g->guided[i];
        return 0;
    }
    for (i = 0; i < nv; i++) {
        D[i] = g->size.moving ? g->drift[i] * dt : 0.0;
        for (k = 0; k < g->d; k++) D[i] += g->base.T[k * nv + i] * xi[k];
    }
    memset(bend, 0, sizeof(double) * (size_t)nv);
    if (dt != 0.0) {
        memcpy(x, x0, sizeof(double) * (size_t)n);
        for (i = 0; i < nv; i++) x[nq + i] = D[i] / dt;
        if (rows_at(g, g->memory[BASE_TIME], x, &p->rows)) return 1;
        along_rows(g, &g->base, p->rows.c, bend);
        to_velocity(g, &g->base, bend);
    }
    for (j = 0; j < nv; j++) D[j] += 0.5 * bend[j] * dt * dt;
    for (i = 0; i < nq; i++) {
        x[i] = x0[i] + rate_of(g, &g->base.rows, i, D);
    }
    return 0;
}

/* Whether the velocities v differ from the velocities of the guide by more than ASTRAY. */
static int astray(const passage *g, const double *v) {
    const double *guide = g->guide + g->size.nq;
    double speed = IDLE, miss = 0.0;
    int i;
    for (i = 0; i < g->size.nv; i++) {
        speed = fmax(speed, fabs(guide[i]));
        miss = fmax(miss, fabs(v[i] - guide[i]));
    }
    return !(miss < ASTRAY * speed);
}

/* Compute the state x at the chart coordinates y = (xi, u, z), and the slopes of x and y. */
static int lift(passage *g, double t, const double *y, double *x, double *xdot, double *ydot) {
    frame *p = &g->here;
    int nq = g->size.nq, nv = g->size.nv, nz = g->size.nz, d = g->d, i, j, k;
    const double *u = y + d;
    double distance, size = 0.0, *v = x + nq, *a = xdot + nq;
    memcpy(x + nq + nv, y + 2 * d, sizeof(double) * (size_t)nz);
    if (predict(g, t, y, x)) return STEPPER_SINGULAR;
    memset(v, 0, sizeof(double) * (size_t)nv);
    memcpy(x + nq + nv, y + 2 * d, sizeof(double) * (size_t)nz);
    if (onto_rows(g, t, y, x, &distance)) return STEPPER_SINGULAR;
    if (g->guide && distance > REACH) return STEPPER_CHART_LEFT;
    if (evaluate(g, p, t, x) || factor(g, p)) return STEPPER_SINGULAR;
    if (p->rank != g->base.rank) return STEPPER_CHART_LEFT;
    /* velocities: v = T (C N T)^-1 (u - C N v_p) + v_p */
    memset(v, 0, sizeof(double) * (size_t)nv);
    memcpy(g->w, u, sizeof(double) * (size_t)d);
    if (g->size.moving) {
        particular(g, p, v);
        coordinates(g, p, v, g->r);
        for (k = 0; k < d; k++) g->w[k] -= g->r[k];
    }
    for (k = 0; k < d; k++) coordinates(g, p, p->T + k * nv, g->G + k * d);
    memset(g->K, 0, sizeof(double) * (size_t)(d * (d + 1)));
    for (k = 0; k < d; k++) g->K[k * d + k] = 1.0;
    memcpy(g->K + d * d, g->w, sizeof(double) * (size_t)d);
    if (solve(g->G, d, g->K, d + 1)) return STEPPER_CHART_LEFT;
    for (k = 0; k < d * d; k++) size += g->K[k] * g->K[k];
    g->alignment = sqrt((double)(d ? d : 1) / size);
    if (!(g->alignment > TURNED)) return STEPPER_CHART_LEFT;
    for (k = 0; k < d; k++)
        for (i = 0; i < nv; i++) v[i] += p->T[k * nv + i] * g->K[d * d + k];
    if (g->guide && astray(g, v)) return STEPPER_SINGULAR;
    /* accelerations: L^-1 f along the tangents, and the component that the rows require */
    if (rows_at(g, t, x, &p->rows) ||
        g->model.forces(g->s->user, t, x, g->G, p->f, p->rate))
        return STEPPER_SINGULAR;
    for (i = 0; i < nv; i++) {
        double sum = p->f[i];
        for (j = g->J.start[i]; j < g->J.start[i + 1] && p->more > 0.0; j++)
            sum += p->more * p->rows.J[j] * p->rows.c[g->J.row[j]];
        a[i] = sum;
    }
    lower(p->M, p->end, nv, a);
    for (k = 0; k < p->rank; k++) reflect(&p->qr, nv, k, a);
    along_rows(g, p, p->rows.c, a);
    to_velocity(g, p, a);
    for (i = 0; i < nq; i++) xdot[i] = rate_of(g, &p->rows, i, v);
    memcpy(xdot + nq + nv, p->rate, sizeof(double) * (size_t)nz);
    memcpy(ydot, u, sizeof(double) * (size_t)d);
    coordinates(g, p, a, ydot + d);
    for (i = 0; i < nq; i++)
        for (k = 0; k < d; k++) ydot[d + k] += g->C[i * d + k] * p->rows.bend[i];
    memcpy(ydot + 2 * d, p->rate, sizeof(double) * (size_t)nz);
    return stepper_all_finite(xdot, g->s->n) ? STEPPER_OK : STEPPER_SINGULAR;
}

/* Compute x and the slopes at y as weighted means of three neighbours on either side along the
 * motion. Returns 1 if a neighbour is not regular. */
static int mean_of(passage *g, double t, const double *y, double apart, const double *along,
                   double shift, double *x, double *xdot, double *ydot) {
    int n = g->s->n, d = g->d, ny = 2 * d + g->size.nz, i, j, side, status;
    double *at = g->sum, *slope = at + n, *rate = slope + n, *beside = rate + ny;
    memset(x, 0, sizeof(double) * (size_t)n);
    memset(xdot, 0, sizeof(double) * (size_t)n);
    memset(ydot, 0, sizeof(double) * (size_t)ny);
    for (j = 1; j <= 3; j++)
        for (side = -1; side <= 1; side += 2) {
            memcpy(beside, y, sizeof(double) * (size_t)ny);
            for (i = 0; i < d; i++) beside[i] += side * j * apart * along[i];
            g->ahead = side * j * apart;
            status = lift(g, t + side * j * shift, beside, at, slope, rate);
            g->ahead = 0.0;
            if (status) return 1;
            if (g->here.sigma < AWAY * FLOOR * g->memory[SIGMA]) return 1;
            for (i = 0; i < n; i++) x[i] += MEAN[j - 1] * at[i];
            for (i = 0; i < n; i++) xdot[i] += MEAN[j - 1] * slope[i];
            for (i = 0; i < ny; i++) ydot[i] += MEAN[j - 1] * rate[i];
        }
    memcpy(ydot, y + d, sizeof(double) * (size_t)d);
    return 0;
}

/* Compute x and the slopes at the chart coordinates y, by means of neighbours if y is singular. */
static int slope(passage *g, double t, const double *y, double *x, double *xdot, double *ydot) {
    int d = g->d, i, status = lift(g, t, y, x, xdot, ydot);
    double largest = g->memory[SIGMA], dt = t - g->memory[BASE_TIME], rho;
    double far = 0.0, speed = 0.0, apart, shift = 0.0, *along = g->side;
    g->singular = 0;
    if (!status && g->here.sigma >= FLOOR * largest) {
        g->memory[SIGMA] = fmax(largest, g->here.sigma);
        g->sigma = fmin(g->sigma, g->here.sigma / g->memory[SIGMA]);
        return STEPPER_OK;
    }
    if (status == STEPPER_CHART_LEFT) return status;
    g->singular = 1;
    rho = g->base.sigma / largest;
    for (i = 0; i < d; i++) far += y[i] * y[i], speed += y[d + i] * y[d + i];
    memcpy(along, y + d, sizeof(double) * (size_t)d);
    if (g->size.moving) {
        apart = shift = BESIDE * FLOOR * fabs(dt) / rho;
    } else {
        if (!(speed > 0.0)) return STEPPER_SINGULAR;
        apart = BESIDE * FLOOR * sqrt(far) / (rho * sqrt(speed));
    }
    if (!(apart > 0.0) || mean_of(g, t, y, apart, along, shift, x, xdot, ydot))
        return STEPPER_SINGULAR;
    memcpy(x + g->size.nq + g->size.nv, y + 2 * d, sizeof(double) * (size_t)g->size.nz);
    g->sigma = fmin(g->sigma, FLOOR);
    return STEPPER_OK;
}

/* Regularity at x, 0 on failure. Updates the largest value. */
static double regularity_at(passage *g, double t, const double *x) {
    double value = 0.0;
    if (g->model.regularity(g->s->user, t, x, &value) || !isfinite(value)) value = 0.0;
    g->memory[LARGEST] = fmax(g->memory[LARGEST], value);
    return value;
}

/* Make a regular base at the distance BACK before the singular state x, along its velocity.
 * Returns 1 if no branch has this velocity. */
static int base_behind(passage *g, double t, const double *x) {
    int nq = g->size.nq, nv = g->size.nv, n = g->s->n, i, pass;
    double *q = g->at, *v = g->w, *y = g->y, speed = 0.0, move = HUGE_VAL, behind, part;
    for (i = 0; i < nv; i++) speed = fmax(speed, fabs(x[nq + i]));
    if (!(speed > 0.0) || evaluate(g, &g->here, t, x)) return 1;
    behind = t - (g->size.moving ? BACK / speed : 0.0);
    memcpy(q, x, sizeof(double) * (size_t)n);
    for (i = 0; i < nv; i++) v[i] = -x[nq + i] * BACK / speed;
    for (i = 0; i < nq; i++) q[i] += rate_of(g, &g->here.rows, i, v);
    for (pass = 0; pass < NEWTON && !(move < LAST_MOVE); pass++) {
        if (evaluate(g, &g->base, behind, q) || factor(g, &g->base)) return 1;
        memset(y, 0, sizeof(double) * (size_t)nv);
        along_rows(g, &g->base, g->base.rows.position, y);
        to_velocity(g, &g->base, y);
        move = 0.0;
        for (i = 0; i < nv; i++) move = fmax(move, fabs(y[i]));
        for (i = 0; i < nq; i++) q[i] -= rate_of(g, &g->base.rows, i, y);
    }
    if (!(move < LAST_MOVE)) return 1;
    if (evaluate(g, &g->base, behind, q) || factor(g, &g->base)) return 1;
    part = regularity_at(g, behind, q) / g->memory[LARGEST];
    if (!(part > AWAY * FLOOR)) return 1;
    g->memory[SIGMA] = g->base.sigma / fmin(part, 1.0);
    g->memory[BASED] = 1.0;
    g->memory[BASE_TIME] = behind;
    memcpy(g->memory + BASE, q, sizeof(double) * (size_t)n);
    return 0;
}

/* Compute the chart coordinates y = (xi, u, z) of x. */
static int coordinates_of(passage *g, double t, const double *x, double *y) {
    int nq = g->size.nq, d = g->d, i, k;
    if (rows_at(g, t, x, &g->here.rows)) return 1;
    for (k = 0; k < d; k++) {
        y[k] = 0.0;
        for (i = 0; i < nq; i++) y[k] += g->C[i * d + k] * (x[i] - g->memory[BASE + i]);
    }
    coordinates(g, &g->here, x + nq, y + d);
    memcpy(y + 2 * d, x + nq + g->size.nv, sizeof(double) * (size_t)g->size.nz);
    return 0;
}

/* Whether the velocities of a start x differ from the state `on` of the branch beyond STRAY. */
static int strays(const passage *g, const double *x, const double *on) {
    int first = g->size.nq, i;
    double speed = 0.0, miss = 0.0;
    for (i = first; i < first + g->size.nv; i++) {
        speed = fmax(speed, fabs(x[i]));
        miss = fmax(miss, fabs(x[i] - on[i]));
    }
    return !(miss <= STRAY * speed);
}

/* Make the chart at x, or at the last regular state if x is not regular, and compute the
 * coordinates of x in it. Returns a status of the stepper. */
static int prepare(passage *g, double t, const double *x) {
    double *m = g->memory, part;
    int n = g->s->n, first = !(m[BASED] > 0.0);
    if (g->ready && t == g->ready_time && !memcmp(x, g->ready_x, sizeof(double) * (size_t)n))
        return STEPPER_OK;
    g->ready = 0;
    if (evaluate(g, &g->base, t, x) || factor(g, &g->base)) return STEPPER_SINGULAR;
    part = regularity_at(g, t, x) / m[LARGEST];
    if (m[SIGMA] == 0.0 && part > AWAY * FLOOR) m[SIGMA] = g->base.sigma / fmin(part, 1.0);
    if (m[SIGMA] > 0.0 && g->base.sigma >= AWAY * FLOOR * m[SIGMA]) {
        m[SIGMA] = fmax(m[SIGMA], g->base.sigma);
        m[BASED] = 1.0;
        m[BASE_TIME] = t;
        memcpy(m + BASE, x, sizeof(double) * (size_t)n);
        first = 0;
    } else if (first) {
        if (base_behind(g, t, x)) return STEPPER_UNDETERMINED;
    } else if (evaluate(g, &g->base, m[BASE_TIME], m + BASE) || factor(g, &g->base)) {
        return STEPPER_SINGULAR;
    }
    if (coordinates_of_base(g)) return STEPPER_SINGULAR;
    if (g->size.moving) particular(g, &g->base, g->drift);
    if (coordinates_of(g, t, x, g->own)) return STEPPER_SINGULAR;
    if (first) {
        g->sigma = HUGE_VAL;
        if (slope(g, t, g->own, g->at, g->full[0], g->slopes[0]) || strays(g, x, g->at)) {
            m[BASED] = m[SIGMA] = 0.0; /* a second call then fails in the same way */
            return STEPPER_UNDETERMINED;
        }
    }
    memcpy(g->ready_x, x, sizeof(double) * (size_t)n);
    g->ready_time = t;
    g->ready = 1;
    return STEPPER_OK;
}

/* Whether the states x and `along` at the same time are on different branches, by their velocities
 * or by their positions after a step h. a: largest acceleration in the step. */
static int left_branch(const passage *g, const double *x, const double *along, double h, double a) {
    int nq = g->size.nq, nv = g->size.nv, i;
    double v = h * a, move = 0.0, change = 0.0, zero = g->s->atol; /* at rest */
    for (i = 0; i < nv; i++) {
        v = fmax(v, fmax(fabs(x[nq + i]), fabs(along[nq + i])));
        change = fmax(change, fabs(x[nq + i] - along[nq + i]));
    }
    for (i = 0; i < nq; i++) move = fmax(move, fabs(x[i] - along[i]));
    return change > BREAK * v + zero || move > BREAK * h * v + zero;
}

/* Compute the error estimate of a step in the chart, in the coordinates (n,) of the tree. */
static void error_of(const passage *g, double h, double *error) {
    int nq = g->size.nq, nv = g->size.nv, nz = g->size.nz, d = g->d, i, j, k;
    const double *T = g->base.T, *N = g->base.rows.N;
    double *e = g->w;
    for (i = 0; i < 2 * d + nz; i++) {
        double sum = 0.0;
        for (j = 0; j < 7; j++) sum += DOPRI5_E[j] * g->slopes[j][i];
        e[i] = h * sum;
    }
    memset(error, 0, sizeof(double) * (size_t)(nq + nv));
    for (i = 0; i < nv; i++) {
        double move = 0.0;
        for (k = 0; k < d; k++) {
            move += T[k * nv + i] * e[k];
            error[nq + i] += T[k * nv + i] * e[d + k];
        }
        if (nq == nv)
            error[i] += move;
        else
            for (j = g->N.start[i]; j < g->N.start[i + 1]; j++) error[g->N.row[j]] += N[j] * move;
    }
    memcpy(error + nq + nv, e + 2 * d, sizeof(double) * (size_t)nz);
}

/* Compute the dense output of a step from x to y as the cubic with the slopes at its ends. */
static void cubic(const passage *g, const double *x, const double *y, double h, const double *first,
                  const double *last, double *dense) {
    int n = g->s->n, i;
    for (i = 0; i < n; i++) {
        double rise = y[i] - x[i], bend = h * first[i] - rise;
        dense[i] = x[i];
        dense[n + i] = rise;
        dense[2 * n + i] = bend;
        dense[3 * n + i] = rise - h * last[i] - bend;
        dense[4 * n + i] = 0.0;
    }
}

/* Compute D = C N (d, nv), the rates of the chart coordinates per velocity. */
static void coordinate_rows(const passage *g, const passage_rows *rows, double *D) {
    int nq = g->size.nq, nv = g->size.nv, d = g->d, i, j, k;
    for (k = 0; k < d; k++)
        for (j = 0; j < nv; j++) {
            double value = 0.0;
            if (nq == nv)
                value = g->C[j * d + k];
            else
                for (i = g->N.start[j]; i < g->N.start[j + 1]; i++)
                    value += g->C[g->N.row[i] * d + k] * rows->N[i];
            D[k * nv + j] = value;
        }
}

/* Fill K (nv, nv) with the velocity rows that the base selected and the rows C N of the
 * coordinates, or with the transpose. K is singular if the rows are dependent. */
static void square(const passage *g, const passage_rows *rows, int transposed, double *K) {
    int nv = g->size.nv, rank = g->base.rank, j, k;
    double *D = g->G;
    coordinate_rows(g, rows, D);
    memset(K, 0, sizeof(double) * (size_t)(nv * nv));
    for (k = 0; k < rank; k++) {
        int row = g->base.qr.order[k];
        for (j = g->J.begin[row]; j < g->J.begin[row + 1]; j++) {
            int column = g->J.column[j];
            K[transposed ? k * nv + column : column * nv + k] = rows->J[g->J.from[j]];
        }
    }
    for (k = rank; k < nv; k++)
        for (j = 0; j < nv; j++)
            K[transposed ? k * nv + j : j * nv + k] = D[(k - rank) * nv + j];
}

/* Sign of the permutation order (n,), -1 if it is odd. seen (n,) is scratch. */
static int parity(const int *order, int n, int *seen) {
    int sign = 1, i, j;
    for (i = 0; i < n; i++) seen[i] = 0;
    for (i = 0; i < n; i++)
        for (j = order[i]; !seen[i] && j != i; j = order[j]) seen[j] = 1, sign = -sign;
    return sign;
}

/* Factorize the matrix K of square by its sparse rows: factors in g->other, Z and S of border. */
static void factor_square(passage *g, const passage_rows *rows, double *Z, double *S) {
    factors *f = &g->other;
    int n = g->size.nv, rank = g->base.rank, i, k;
    double *D = Z + n * g->d;
    begin_columns(f, n, rank);
    for (k = 0; k < rank; k++) {
        int row = g->base.qr.order[k];
        for (i = g->J.begin[row]; i < g->J.begin[row + 1]; i++)
            put(f, n, g->J.column[i], k, rows->J[g->J.from[i]]);
    }
    factorize(f, n, rank, rank, 0.0);
    coordinate_rows(g, rows, D);
    border(f, n, g->d, D, Z, S);
}

/* Sign of the determinant of the matrix of square, 0 if it is singular. Each reflection changes
 * it. */
static int sign_of_square(passage *g, const passage_rows *rows) {
    factors *f = &g->other;
    int n = g->size.nv, rank = g->base.rank, sign, k;
    double *S = g->G;
    factor_square(g, rows, g->K, S);
    sign = parity(f->row, n, f->last) * parity(f->order, rank, f->last);
    for (k = 0; k < rank; k++) {
        double pivot = f->A[f->order[k] * n + f->row[k]];
        if (!(fabs(pivot) > 0.0)) return 0;
        if ((pivot < 0.0) != (f->weight[k] != 0.0)) sign = -sign;
    }
    return sign * eliminate(S, g->d, NULL, 0);
}

/* Compute y = K^-1 y, or y = K^-T y if transposed, for the matrix K of square. Returns 1 if it is
 * singular. */
static int solve_square(passage *g, const passage_rows *rows, int transposed, double *y) {
    factors *f = &g->other;
    int n = g->size.nv, rank = g->base.rank, d = g->d, i, k;
    double *Z = g->K, *D = Z + n * d, *z = D + n * d, *S = g->G;
    factor_square(g, rows, Z, S);
    memset(z, 0, sizeof(double) * (size_t)n);
    for (k = 0; k < rank; k++)
        if (pivot_of(f, n, k) == 0.0) return 1;
    if (!transposed) { /* onto the first rows, then along them */
        forward(f, n, rank, y, z);
        reflect_back(f, n, rank, z);
        for (k = 0; k < d; k++)
            for (i = 0; i < n; i++) y[rank + k] -= D[k * n + i] * z[i];
        if (solve(S, d, y + rank, 1)) return 1;
        for (k = 0; k < d; k++)
            for (i = 0; i < n; i++) z[i] += Z[k * n + i] * y[rank + k];
        memcpy(y, z, sizeof(double) * (size_t)n);
        return 0;
    }
    for (k = 0; k < d; k++) { /* the last rows first: only they act in the null space Z */
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
    if (solve(S, d, z, 1)) return 1;
    for (k = 0; k < d; k++)
        for (i = 0; i < n; i++) y[i] -= D[k * n + i] * z[k];
    for (k = 0; k < rank; k++) reflect(f, n, k, y);
    for (k = rank - 1; k >= 0; k--) {
        int own = f->order[k];
        const double *column = f->A + own * n;
        z[d + own] = y[f->row[k]] / column[f->row[k]];
        for (i = 0; i < f->uppers[own]; i++)
            y[f->upper[own * n + i]] -= column[f->upper[own * n + i]] * z[d + own];
    }
    memcpy(y, z + d, sizeof(double) * (size_t)rank);
    memcpy(y + rank, z, sizeof(double) * (size_t)d);
    return 0;
}

/* Side of the singular configuration on which a state is: the sign of the determinant of square. */
static int side_of(passage *g, const passage_rows *rows) {
    if (g->base.rank > MANY) return sign_of_square(g, rows);
    square(g, rows, 0, g->K);
    return eliminate(g->K, g->size.nv, NULL, 0);
}

/* Residual of the rows that no change of positions removes at a singular configuration. It is zero
 * if branches of motion meet there. */
static double gap_of(passage *g, const passage_rows *rows) {
    int n = g->size.nv, first = g->size.speeds - g->size.anchors, i, pass, status;
    double *y = g->y, most = 0.0, sum = 0.0;
    for (i = 0; i < n; i++) y[i] = 1.0;
    for (pass = 0; pass < 2; pass++) { /* inverse iteration: right and left null vector */
        if (g->base.rank > MANY) {
            status = solve_square(g, rows, pass, y);
        } else {
            square(g, rows, pass, g->K);
            status = solve(g->K, n, y, 1);
        }
        if (status) return 0.0;
        for (most = 0.0, i = 0; i < n; i++) most = fmax(most, fabs(y[i]));
        for (i = 0; i < n; i++) y[i] /= most;
    }
    for (most = 0.0, i = 0; i < g->base.rank; i++) {
        int row = g->base.qr.order[i], anchored = row >= first && row < g->size.speeds;
        most = fmax(most, fabs(y[i]));
        sum += y[i] * (rows->position[row] - (anchored ? g->base.rows.position[row] : 0.0));
    }
    return most > 0.0 ? fabs(sum) / most : 0.0;
}

/* Whether a step crosses a singular configuration at which branches come near each other and do not
 * meet, so that the true motion reverses. For rows f = gap + k s w, with s along one branch and w
 * along the other, sigma is sqrt(2 k gap) at the reversal. If it is below AWAY times FLOOR, the
 * step passes as if the branches met. */
static int jumps(passage *g, double t, const double *x, double h, const double *y,
                 const double *first, const double *last) {
    double low = 0.0, high = 1.0, speed = 0.0, gap, *at = g->at, sigma = g->here.sigma;
    int n = g->s->n, nq = g->size.nq, nv = g->size.nv, before, i, j, k;
    const double *v = y + nq;
    if (g->base.rank == 0 || g->singular) return 0;
    for (j = 0; j < nv; j++) { /* |v| in the metric of M = L L' */
        double sum = 0.0;
        for (i = j; i < g->here.end[j]; i++) sum += g->here.M[j * nv + i] * v[i];
        speed += sum * sum;
    }
    if (rows_at(g, t, x, &g->here.rows)) return 0;
    before = side_of(g, &g->here.rows);
    if (rows_at(g, t + h, y, &g->here.rows)) return 0;
    if (before * side_of(g, &g->here.rows) >= 0) return 0;
    cubic(g, x, y, h, first, last, g->across);
    for (k = 0; k < HALVINGS; k++) {
        double middle = 0.5 * (low + high);
        dopri5_interpolate(g->across, n, middle, at);
        if (rows_at(g, t + middle * h, at, &g->here.rows)) return 0;
        if (before * side_of(g, &g->here.rows) > 0)
            low = middle;
        else
            high = middle;
    }
    gap = gap_of(g, &g->here.rows);
    if (gap > APART) g->missed = 1;
    if (!(speed > 0.0) || !(high < 1.0)) return 0;
    gap *= 2.0 * sigma / ((1.0 - high) * h * sqrt(speed));
    return sqrt(gap) > AWAY * FLOOR * g->memory[SIGMA];
}

/* Rounding error of a velocity change. sigma: fraction of the largest sigma. */
static double rounding(double change, double sigma) { return NOISE * change / (sigma * sigma); }

/* Attempt one step of dopri5 in the chart. Returns a status of the stepper. */
static int chart_attempt(passage *g, const double *x, double h) {
    stepper *s = g->s;
    double t = stepper_time(s), a = 0.0, *candidate = stepper_candidate(s);
    int nq = g->size.nq, nv = g->size.nv, ny, begun, i, j, k, status = prepare(g, t, x);
    if (status) return status;
    ny = 2 * g->d + g->size.nz;
    g->sigma = HUGE_VAL;
    for (k = 0; k < 7; k++) {
        double *to = k == 6 ? candidate : g->at;
        for (i = 0; i < ny; i++) {
            double sum = 0.0;
            for (j = 0; j < k; j++) sum += DOPRI5_A[k][j] * g->slopes[j][i];
            g->trial[i] = g->own[i] + h * sum;
        }
        status = slope(g, t + DOPRI5_C[k] * h, g->trial, to, g->full[k], g->slopes[k]);
        if (status) return status;
        for (i = 0; i < nv; i++) a = fmax(a, fabs(g->full[k][nq + i]));
    }
    /* A step may end in the singular configuration at a limit, or if it began there: a slow motion
     * needs many steps to leave it. */
    begun = g->memory[BASE_TIME] != t || memcmp(g->memory + BASE, x, sizeof *x * (size_t)s->n);
    if (!s->cut && !begun && (g->singular || g->here.sigma < AWAY * FLOOR * g->memory[SIGMA]))
        return STEPPER_ENDS_SINGULAR;
    if (jumps(g, t, x, h, candidate, g->full[0], g->full[6])) return STEPPER_CHART_LEFT;
    for (i = 0; i < s->n; i++) { /* explicit result of the stages, without the rows */
        double sum = 0.0;
        for (j = 0; j < 6; j++) sum += DOPRI5_A[6][j] * g->full[j][i];
        g->at[i] = x[i] + h * sum;
    }
    if (left_branch(g, candidate, g->at, h, a)) return STEPPER_CHART_LEFT;
    error_of(g, h, stepper_trial(s));
    s->noise = rounding(h * a, g->sigma);
    if (!begun && !s->cut && !g->missed && rounding(h * a, g->base.sigma / g->memory[SIGMA]) < DODGED * s->atol &&
        s->noise > (g->dodges < DODGES ? DODGED : MOST_NOISE) * s->atol) {
        g->dodges++;
        return STEPPER_ENDS_SINGULAR;
    }
    s->kept_closed = 1;
    return STEPPER_OK;
}

/* Smallest regularity expected in the next step h, by linear extrapolation. */
static double foreseen(passage *g, double t, const double *x, double h) {
    double *m = g->memory;
    if (!(m[SEEN] > 0.0) || t != m[SEEN_TIME]) {
        m[REGULARITY] = regularity_at(g, t, x);
        m[SEEN_TIME] = t;
        m[SEEN] = 1.0;
    }
    return fmin(m[REGULARITY], m[REGULARITY] + AHEAD * h * m[RISE]);
}

/* Attempt a step of the wrapped method, or a step in the chart if the regularity is too small. */
static int attempt(stepper *s, const double *x, double h) {
    passage *g = s->passage;
    double t = stepper_time(s), ahead = foreseen(g, t, x, h), on = PASSAGE_ON * g->memory[LARGEST];
    int status;
    g->charted = s->kept_closed = 0;
    s->noise = 0.0;
    if (ahead >= on) {
        status = g->opened || !g->inner->open ? STEPPER_OK : g->inner->open(s, x);
        if (status) return status;
        g->opened = 1;
        status = g->inner->attempt(s, x, h);
        if (status || regularity_at(g, t + h, stepper_candidate(s)) >= on) {
            g->missed = 0;
            return status;
        }
    }
    g->charted = 1;
    status = chart_attempt(g, x, h);
    if (g->missed && (status == STEPPER_SINGULAR || status == STEPPER_ENDS_SINGULAR))
        return STEPPER_NEAR_MISS;
    return status;
}

static void keep(stepper *s, const double *x, double h) {
    passage *g = s->passage;
    double *m = g->memory, t = stepper_time(s) + h, *y = stepper_candidate(s), value;
    int n = s->n, i, j;
    value = regularity_at(g, t, y);
    m[RISE] = (value - m[REGULARITY]) / h;
    m[REGULARITY] = value;
    m[SEEN_TIME] = t;
    g->kept = g->charted;
    g->dodges = 0;
    if (!g->charted) {
        g->inner->keep(s, x, h);
        return;
    }
    cubic(g, x, y, h, g->full[0], g->full[6], g->dense);
    for (i = 0; i < n; i++) {
        double sum = 0.0;
        for (j = 0; j < 7; j++) sum += DOPRI5_D[j] * g->full[j][i];
        g->dense[4 * n + i] = h * sum;
    }
}

static int close(stepper *s, double t) {
    passage *g = s->passage;
    g->opened = 0;
    if (!g->charted) return g->inner->close(s, t);
    stepper_close(s, g->full[6]);
    return STEPPER_OK;
}

static void interpolate(const stepper *s, double a, double *row) {
    const passage *g = s->passage;
    if (g->kept)
        dopri5_interpolate(g->dense, s->n, a, row);
    else
        g->inner->interpolate(s, a, row);
}

/* Postpone `open` of the wrapped method, which may compute a Jacobian, until a full step is made:
 * near singular configurations the Jacobian may have no value. */
static int open(stepper *s, const double *x) {
    passage *g = s->passage;
    (void)x;
    g->opened = 0;
    return STEPPER_OK;
}

/* Set the slope at the start of a step, from the chart if the rows are nearly dependent. */
static int opening(stepper *s, const double *x) {
    return passage_slope(s->passage, stepper_time(s), x, stepper_slope(s), NULL);
}

int passage_project(passage *g, double t, double *x) {
    double *y = g->trial, h;
    if (!g->kept || !g->ready) return 1;
    if (coordinates_of(g, t, x, y)) return 0;
    h = stepper_last_step(g->s);
    if (!slope(g, t, y, g->at, g->full[1], g->slopes[1]) && !left_branch(g, g->at, x, h, 0.0))
        memcpy(x, g->at, sizeof(double) * (size_t)g->s->n);
    return 0;
}

void passage_start(passage *g) {
    memset(g->memory, 0, sizeof(double) * (size_t)PASSAGE_MEMORY(g->s->n));
    g->memory[LARGEST] = g->model.typical;
    passage_forget(g);
}

void passage_forget(passage *g) { g->ready = g->kept = g->charted = g->lasting = g->missed = g->opened = 0; }

/* Recompute the chart from memory, unless it is valid. Returns 1 on failure. */
static int restored(passage *g) {
    const double *m = g->memory;
    if (g->lasting) return 0;
    if (evaluate(g, &g->base, m[BASE_TIME], m + BASE) || factor(g, &g->base)) return 1;
    if (coordinates_of_base(g)) return 1;
    g->lasting = 1;
    return 0;
}

int passage_chart(passage *g, double t, const double *x) {
    int status;
    g->ready = 0;
    status = prepare(g, t, x);
    g->ready = 0;
    g->lasting = !status;
    return status;
}

int passage_coordinates(passage *g, double t, const double *x, double *y) {
    return restored(g) || coordinates_of(g, t, x, y) ? STEPPER_SINGULAR : STEPPER_OK;
}

int passage_jumps(passage *g, double t, const double *x, const double *first, double h,
                  const double *y, const double *last) {
    return jumps(g, t, x, h, y, first, last);
}

int passage_state(passage *g, double t, const double *y, const double *guide, double *x,
                  double *slope_x, double *slope_y, double *alignment) {
    double largest = g->memory[SIGMA];
    int nq = g->size.nq, i, status;
    if (restored(g) || rows_at(g, t, guide, &g->here.rows)) return STEPPER_SINGULAR;
    for (i = 0; i < nq; i++) g->guided[i] = rate_of(g, &g->here.rows, i, guide + nq);
    g->guide = guide;
    g->sigma = HUGE_VAL;
    status = slope(g, t, y, x, slope_x, slope_y);
    g->guide = NULL;
    g->memory[SIGMA] = largest;
    *alignment = g->alignment;
    return status;
}

int passage_singular(passage *g, double t, const double *x) {
    return !(regularity_at(g, t, x) > AWAY * FLOOR * g->memory[LARGEST]);
}

int passage_place(passage *g, double t, double *x, const int *loose, int count) {
    int m = g->size.positions, first = g->size.speeds - g->size.anchors, i, j, pass;
    double worst = HUGE_VAL, move = HUGE_VAL, *A = g->other.A, *r = g->r;
    g->other.height = 0;
    for (pass = 0; pass <= PLACING; pass++) {
        if (rows_at(g, t, x, &g->here.rows)) return 1;
        for (worst = 0.0, j = 0; j < m; j++) {
            int free = j >= first && j < g->size.speeds; /* locked by stops or friction */
            r[j] = free ? 0.0 : -g->here.rows.position[j];
            worst = fmax(worst, fabs(r[j]));
            memset(A + j * count, 0, sizeof(double) * (size_t)count);
        }
        for (i = 0; i < count; i++)
            for (j = g->slope.start[loose[i]]; j < g->slope.start[loose[i] + 1]; j++) {
                int row = g->slope.row[j], free = row >= first && row < g->size.speeds;
                if (!free) A[row * count + i] = g->here.rows.slope[j];
            }
        if (!isfinite(worst) || !stepper_all_finite(A, m * count)) return 1;
        if (move < LAST_MOVE || pass == PLACING) break;
        shortest(g, count, m, r, SETTLED, g->y);
        for (move = 0.0, i = 0; i < count; i++) {
            x[loose[i]] += g->y[i];
            move = fmax(move, fabs(g->y[i]));
        }
    }
    return !(worst < CLOSED);
}

int passage_velocities(passage *g, double t, double *x, const int *kept, int count) {
    int nq = g->size.nq, nv = g->size.nv, m = g->size.speeds, i, j;
    double *A = g->other.A, *r = g->r, *v = x + nq, *y = g->y, speed = 0.0, miss = 0.0;
    if (rows_at(g, t, x, &g->here.rows)) return 1;
    for (j = 0; j < m + count; j++) {
        int anchored = j >= m - g->size.anchors && j < m;
        r[j] = j < m ? g->here.rows.b[j] : v[kept[j - m]];
        memset(A + j * nv, 0, sizeof(double) * (size_t)nv);
        for (i = j < m ? g->J.begin[j] : 0; j < m && i < g->J.begin[j + 1] && !anchored; i++)
            A[j * nv + g->J.column[i]] = g->here.rows.J[g->J.from[i]];
        if (j >= m) A[j * nv + kept[j - m]] = 1.0;
    }
    if (!stepper_all_finite(A, (m + count) * nv)) return 1;
    shortest(g, nv, m + count, r, DEPENDENT, y);
    for (i = 0; i < nv; i++) speed = fmax(speed, fabs(y[i]));
    for (j = 0; j < m + count; j++) {
        double off = j < m ? -r[j] : y[kept[j - m]] - r[j];
        if (j >= m - g->size.anchors && j < m) continue;
        for (i = j < m ? g->J.begin[j] : 0; j < m && i < g->J.begin[j + 1]; i++)
            off += g->here.rows.J[g->J.from[i]] * y[g->J.column[i]];
        miss = fmax(miss, fabs(off));
        if (j >= m) speed = fmax(speed, fabs(r[j]));
    }
    memcpy(v, y, sizeof(double) * (size_t)nv);
    return !(miss <= STRAY * speed);
}

int passage_slope(passage *g, double t, const double *x, double *xdot, double *on) {
    int status, n = g->s->n;
    if (regularity_at(g, t, x) >= PASSAGE_ON * g->memory[LARGEST]) {
        if (on) memcpy(on, x, sizeof(double) * (size_t)n);
        return stepper_evaluate(g->s, t, x, xdot);
    }
    status = prepare(g, t, x);
    g->sigma = HUGE_VAL;
    if (!status) status = slope(g, t, g->own, g->at, xdot, g->slopes[0]);
    if (!status && on) memcpy(on, g->at, sizeof(double) * (size_t)n);
    return status;
}

int passage_loosest(passage *g, double t, const double *x, const double *unit) {
    int nv = g->size.nv, found = -1, i, j, k, first;
    double most = 0.0, *B = g->K, *moves = g->y;
    if (evaluate(g, &g->here, t, x) || factor(g, &g->here) || !g->here.rank) return -1;
    first = g->here.rank - 1;
    memset(moves, 0, sizeof(double) * (size_t)nv);
    for (k = first; k < nv; k++) { /* the directions that rows constrain least, orthonormal */
        double *v = B + (k - first) * nv, size = 0.0;
        memset(v, 0, sizeof(double) * (size_t)nv);
        v[g->here.qr.row[k]] = 1.0;
        to_velocity(g, &g->here, v);
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
        if (moves[i] > most + 1e-6) most = moves[i], found = i;
    return found;
}

int passage_grip(passage *g, double t, const double *x, const int *independent, const double *unit,
                 double *grip) {
    double *S = g->G, *B = g->K, most = 1.0;
    int nv = g->size.nv, d, i, j, k;
    if (evaluate(g, &g->here, t, x) || factor(g, &g->here)) return 1;
    d = nv - g->here.rank;
    for (k = 0; k < d; k++) { /* v = T S^-1 v[independent], transposed */
        for (i = 0; i < d; i++) {
            int number = independent[i];
            S[i * d + k] = g->here.T[k * nv + number] * unit[number];
        }
        for (j = 0; j < nv; j++) B[j * d + k] = g->here.T[k * nv + j] * unit[j];
    }
    *grip = 0.0;
    if (solve(S, d, B, nv)) return 0;
    for (j = 0; j < nv * d; j++) most = fmax(most, fabs(B[j]));
    *grip = isfinite(most) ? 1.0 / most : 0.0;
    return 0;
}

double passage_regularity(passage *g, double t, const double *x) {
    return regularity_at(g, t, x) / g->memory[LARGEST];
}

/* Return memory for `count` doubles (or integers and masks, which are no longer) from a block. With
 * block NULL only the size is counted. */
static void *take(double *block, size_t *used, size_t count) {
    double *found = block ? block + *used : NULL;
    *used += count + 1;
    return found;
}

static void lay_factors(factors *f, size_t n, size_t m, double *block, size_t *used) {
    f->A = take(block, used, n * m);
    f->weight = take(block, used, n);
    f->tails = take(block, used, n * n);
    f->size = take(block, used, m);
    f->where = take(block, used, m * WORDS(n));
    f->touched = take(block, used, m * WORDS(n));
}

static int *lay_numbers(factors *f, size_t n, size_t m, int *numbers) {
    f->order = numbers;
    f->row = f->order + m;
    f->count = f->row + n;
    f->last = f->count + n;
    f->moved = f->last + n;
    f->uppers = f->moved + n * n;
    f->upper = f->uppers + m;
    return f->upper + n * m;
}

static void lay_frame(frame *p, const passage_size *z, double *block, size_t *used) {
    size_t nq = (size_t)z->nq, nv = (size_t)z->nv, m = (size_t)z->speeds, l = (size_t)z->positions;
    p->rows.position = take(block, used, l);
    p->rows.slope = take(block, used, l * nq);
    p->rows.J = take(block, used, m * nv);
    p->rows.b = take(block, used, m);
    p->rows.c = take(block, used, m);
    p->rows.N = take(block, used, nq * nv);
    p->rows.bend = take(block, used, nq);
    p->rows.rank = take(block, used, 1);
    p->inertia = take(block, used, nv * nv);
    p->M = take(block, used, nv * nv);
    p->end = take(block, used, nv);
    p->f = take(block, used, nv);
    p->rate = take(block, used, (size_t)z->nz);
    lay_factors(&p->qr, nv, m, block, used);
    p->T = take(block, used, nv * nv);
}

/* Assign all arrays in the block. Returns its size in doubles; block may be NULL for that. */
static size_t lay(passage *g, double *block) {
    const passage_size *z = &g->size;
    size_t nq = (size_t)z->nq, nv = (size_t)z->nv, n = (size_t)g->s->n, ny = 2 * nv + (size_t)z->nz;
    size_t rows = (size_t)z->positions + nv, used = 0;
    int k;
    lay_frame(&g->base, z, block, &used);
    lay_frame(&g->here, z, block, &used);
    lay_factors(&g->other, nq, rows, block, &used);
    g->C = take(block, &used, nv * nq);
    g->guided = take(block, &used, nq);
    g->drift = take(block, &used, nv);
    g->own = take(block, &used, ny);
    g->trial = take(block, &used, ny);
    for (k = 0; k < 7; k++) {
        g->slopes[k] = take(block, &used, ny);
        g->full[k] = take(block, &used, n);
    }
    g->dense = take(block, &used, 5 * n);
    g->at = take(block, &used, n);
    g->side = take(block, &used, nv);
    g->sum = take(block, &used, 2 * n + 2 * ny);
    g->K = take(block, &used, rows * nq + nq * (nq + 1));
    g->r = take(block, &used, rows + nv);
    g->y = take(block, &used, ny);
    g->w = take(block, &used, ny);
    g->G = take(block, &used, nv * nv);
    g->across = take(block, &used, 5 * n);
    g->ready_x = take(block, &used, n);
    return used;
}

/* Make the pattern of a matrix (rows, columns). given: start, then row, or NULL for a dense matrix.
 * Returns 1 if no memory is left. */
static int make_pattern(pattern *p, int rows, int columns, const int *given) {
    int count = given ? given[columns] : rows * columns, j, k;
    size_t size = 2 * (size_t)count + (size_t)columns + (size_t)rows + 2;
    p->rows = rows;
    p->columns = columns;
    p->start = calloc(size + (size_t)count, sizeof *p->start);
    if (!p->start) return 1;
    p->row = p->start + columns + 1;
    p->begin = p->row + count;
    p->column = p->begin + rows + 1;
    p->from = p->column + count;
    for (k = 0; k <= columns; k++) p->start[k] = given ? given[k] : k * rows;
    for (k = 0; k < count; k++) p->row[k] = given ? given[columns + 1 + k] : k % rows;
    for (k = 0; k < count; k++) p->begin[p->row[k] + 1]++;
    for (k = 0; k < rows; k++) p->begin[k + 1] += p->begin[k];
    for (j = 0; j < columns; j++)
        for (k = p->start[j]; k < p->start[j + 1]; k++) {
            int to = p->begin[p->row[k]]++;
            p->column[to] = j;
            p->from[to] = k;
        }
    for (k = rows; k > 0; k--) p->begin[k] = p->begin[k - 1];
    p->begin[0] = 0;
    return 0;
}

/* Make the pattern of J, whose rows are the first rows of slope. Returns 1 if no memory is left. */
static int pattern_of_slopes(passage *g) {
    const pattern *all = &g->slope;
    int columns = all->columns, count = all->start[columns], status, j, k, n = 0;
    int *given = calloc((size_t)(columns + 1 + count), sizeof *given);
    g->J_from = calloc((size_t)count + 1, sizeof *g->J_from);
    for (j = 0; j < columns && given && g->J_from; j++) {
        for (k = all->start[j]; k < all->start[j + 1]; k++) {
            if (all->row[k] >= g->size.speeds) continue;
            given[columns + 1 + n] = all->row[k];
            g->J_from[n++] = k;
        }
        given[j + 1] = n;
    }
    status = !given || !g->J_from || make_pattern(&g->J, g->size.speeds, columns, given);
    free(given);
    return status;
}

static int make_patterns(passage *g, const passage_patterns *given) {
    static const passage_patterns dense = {NULL, NULL, NULL, NULL};
    const passage_size *z = &g->size;
    if (!given) given = &dense;
    if (make_pattern(&g->slope, z->positions, z->nq, given->slope)) return 1;
    if (make_pattern(&g->M, z->nv, z->nv, given->M)) return 1;
    if (z->nq == z->nv) return pattern_of_slopes(g);
    return make_pattern(&g->J, z->speeds, z->nv, given->J) ||
           make_pattern(&g->N, z->nq, z->nv, given->N);
}

passage *passage_new(stepper *s, const passage_size *size, const passage_patterns *patterns,
                     const passage_model *model, double *memory) {
    static const stepper_method hybrid = {open, attempt, keep, close, interpolate, opening};
    passage *g = calloc(1, sizeof *g);
    size_t nq = (size_t)size->nq, nv = (size_t)size->nv, m = (size_t)size->speeds;
    size_t rows = (size_t)size->positions + nv;
    int *next;
    if (!g) return NULL;
    g->s = s;
    g->size = *size;
    g->model = *model;
    g->memory = memory;
    g->block = calloc(lay(g, NULL), sizeof *g->block);
    g->numbers = calloc(2 * (2 * m + nv * (nv + m + 3)) + 2 * rows + nq * (nq + rows + 3) + 1,
                        sizeof *g->numbers);
    if (!g->block || !g->numbers || make_patterns(g, patterns)) {
        passage_free(g);
        return NULL;
    }
    lay(g, g->block);
    next = lay_numbers(&g->here.qr, nv, m, lay_numbers(&g->base.qr, nv, m, g->numbers));
    lay_numbers(&g->other, nq, rows, next);
    g->here.qr.height = g->base.qr.height = size->nv; /* the block is zero */
    g->here.qr.columns = g->base.qr.columns = size->speeds;
    g->other.height = size->nq;
    g->other.columns = (int)rows;
    g->inner = s->method;
    s->method = &hybrid;
    s->passage = g;
    passage_start(g);
    return g;
}

void passage_free(passage *g) {
    if (!g) return;
    free(g->block);
    free(g->numbers);
    free(g->slope.start);
    free(g->J.start);
    free(g->N.start);
    free(g->M.start);
    free(g->J_from);
    free(g);
}
