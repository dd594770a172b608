#include "sparse_qr.h"

#include <math.h>
#include <string.h>

#include "dense.h"

void sparse_qr_reflect(const sparse_qr *f, int n, int k, double *b) {
    const double *tail = f->tails + k * n;
    const int *rows = f->reflected + k * n;
    double sum = b[rows[0]];
    int i, count = f->reflected_count[k];
    for (i = 1; i < count; i++) sum += tail[i] * b[rows[i]];
    sum *= f->weight[k];
    if (sum == 0.0) return;
    b[rows[0]] -= sum;
    for (i = 1; i < count; i++) b[rows[i]] -= sum * tail[i];
}

void sparse_qr_begin(sparse_qr *f, int n, int m) {
    int known = f->height == n && f->columns >= m ? m : 0, words = ROW_WORDS(n), j, word;
    for (j = 0; j < known; j++)
        for (word = 0; word < words; word++) {
            row_set *bits = f->filled + j * words + word;
            for (; *bits; *bits &= *bits - 1)
                f->A[j * n + word * ROW_BITS + lowest_row(*bits)] = 0.0;
        }
    if (!known) {
        memset(f->A, 0, sizeof *f->A * (size_t)(n * m));
        memset(f->filled, 0, sizeof *f->filled * (size_t)(m * words));
    }
    f->columns = known ? f->columns : m;
    f->height = n;
}

void sparse_qr_scan(sparse_qr *f, int n, int m) {
    int i, j;
    memset(f->filled, 0, sizeof *f->filled * (size_t)(m * ROW_WORDS(n)));
    for (j = 0; j < m; j++)
        for (i = 0; i < n; i++)
            if (f->A[j * n + i] != 0.0) f->filled[j * ROW_WORDS(n) + i / ROW_BITS] |= row_bit(i);
    f->height = 0;
}

/* Set the nonzero rows and the squared length of the column at position k. */
static void begin_column(sparse_qr *f, int n, int k) {
    const double *column = f->A + f->pivot_column[k] * n;
    const row_set *touched = f->filled + f->pivot_column[k] * ROW_WORDS(n);
    row_set *where = f->nonzero + k * ROW_WORDS(n);
    double size = 0.0;
    int word, i;
    for (word = 0; word < ROW_WORDS(n); word++) {
        row_set bits = touched[word];
        for (where[word] = 0; bits; bits &= bits - 1) {
            i = word * ROW_BITS + lowest_row(bits);
            if (column[i] == 0.0) continue;
            where[word] |= row_bit(i);
            f->last_column[i] = k;
            size += column[i] * column[i];
        }
    }
    f->length2[k] = size;
    f->upper_count[f->pivot_column[k]] = 0;
}

/* Exchange the columns at positions k and j. */
static void exchange_columns(sparse_qr *f, int n, int k, int j) {
    int i, words = ROW_WORDS(n), column = f->pivot_column[k];
    double kept = f->length2[k];
    f->pivot_column[k] = f->pivot_column[j], f->pivot_column[j] = column;
    f->length2[k] = f->length2[j], f->length2[j] = kept;
    for (i = 0; i < words; i++) {
        row_set bits = f->nonzero[k * words + i];
        f->nonzero[k * words + i] = f->nonzero[j * words + i];
        f->nonzero[j * words + i] = bits;
    }
}

/* Make reflection k. Its column keeps one element: in the next row, or in the first row
 * with an element if there are many columns. */
static void make_reflection(sparse_qr *f, int n, int k, int many) {
    double *column = f->A + f->pivot_column[k] * n, *tail = f->tails + k * n;
    row_set *where = f->nonzero + k * ROW_WORDS(n);
    int *rows = f->reflected + k * n, count = 0, first, word, i;
    if (!many) where[f->pivot_row[k] / ROW_BITS] |= row_bit(f->pivot_row[k]);
    for (word = 0; word < ROW_WORDS(n); word++) {
        row_set bits = where[word];
        for (; bits; bits &= bits - 1) rows[count++] = word * ROW_BITS + lowest_row(bits);
    }
    if (count == 0) rows[count++] = f->pivot_row[k];
    for (i = 0; i < count; i++) tail[i] = column[rows[i]];
    f->weight[k] = dense_reflection(tail, count);
    column[rows[0]] = tail[0];
    f->filled[f->pivot_column[k] * ROW_WORDS(n) + rows[0] / ROW_BITS] |= row_bit(rows[0]);
    f->reflected_count[k] = count;
    for (first = k; f->pivot_row[first] != rows[0]; first++) continue;
    for (; first > k; first--) f->pivot_row[first] = f->pivot_row[first - 1];
    f->pivot_row[k] = rows[0];
}

/* Apply reflection k to the column at position j, if they have common rows. Update its nonzero rows
 * and, if sums is set, its remaining squared length. */
static void reflect_column(sparse_qr *f, int n, int k, int j, int sums) {
    int i, words = ROW_WORDS(n), done = f->pivot_row[k], own = f->pivot_column[j];
    row_set *touched = f->filled + own * words, *where = f->nonzero + j * words;
    const row_set *other = f->nonzero + k * words;
    double *column = f->A + own * n;
    for (i = 0; i < words && !(where[i] & other[i]); i++) continue;
    if (i == words) return;
    sparse_qr_reflect(f, n, k, column);
    for (i = 0; i < words; i++) where[i] |= other[i], touched[i] |= where[i];
    where[done / ROW_BITS] &= ~row_bit(done);
    f->upper[own * n + f->upper_count[own]++] = done;
    if (!sums) return;
    for (f->length2[j] = 0.0, i = k + 1; i < n; i++)
        f->length2[j] += column[f->pivot_row[i]] * column[f->pivot_row[i]];
}

/* Return the position after the last column that reflection k changes. Store its fill. */
static int last_reflected_column(sparse_qr *f, int n, int k) {
    const int *rows = f->reflected + k * n;
    int end = k + 1, i;
    for (i = 0; i < f->reflected_count[k]; i++)
        if (f->last_column[rows[i]] >= end) end = f->last_column[rows[i]] + 1;
    for (i = 0; i < f->reflected_count[k]; i++) f->last_column[rows[i]] = end - 1;
    return end;
}

int sparse_qr_factorize(sparse_qr *f, int n, int m, int rank, double least) {
    double first = 0.0;
    int i, j, k, end, in_order = m > MANY_ROWS && rank == m && least == 0.0;
    for (i = 0; i < n; i++) f->pivot_row[i] = i;
    for (j = 0; j < m; j++) {
        f->pivot_column[j] = j;
        begin_column(f, n, j);
    }
    for (k = 0; k < rank; k++) {
        int longest = k;
        for (j = k + 1; j < m && !in_order; j++)
            if (f->length2[j] > f->length2[longest]) longest = j;
        if (k == 0) first = f->length2[longest];
        if (f->length2[longest] < least * least * first) return k;
        if (longest != k) exchange_columns(f, n, k, longest);
        make_reflection(f, n, k, m > MANY_ROWS);
        end = in_order ? last_reflected_column(f, n, k) : m;
        for (j = k + 1; j < end; j++) reflect_column(f, n, k, j, !in_order);
    }
    return rank;
}

void sparse_qr_solve_transposed(const sparse_qr *f, int n, int rank, const double *b, double *y) {
    int i, k;
    for (k = 0; k < rank; k++) {
        const double *column = f->A + f->pivot_column[k] * n;
        double sum = b[f->pivot_column[k]];
        const int *upper = f->upper + f->pivot_column[k] * n;
        for (i = 0; i < f->upper_count[f->pivot_column[k]]; i++)
            sum -= column[upper[i]] * y[upper[i]];
        y[f->pivot_row[k]] = sum / column[f->pivot_row[k]];
    }
}

double sparse_qr_pivot(const sparse_qr *f, int n, int k) {
    return fabs(f->A[f->pivot_column[k] * n + f->pivot_row[k]]);
}

void sparse_qr_multiply(const sparse_qr *f, int n, int rank, double *y) {
    int k;
    for (k = rank - 1; k >= 0; k--) sparse_qr_reflect(f, n, k, y);
}

void sparse_qr_border(const sparse_qr *f, int n, int d, const double *D, double *Z, double *S) {
    int m = n - d, i, j, k;
    memset(Z, 0, sizeof(double) * (size_t)(n * d));
    for (k = 0; k < d; k++) {
        Z[k * n + f->pivot_row[m + k]] = 1.0;
        sparse_qr_multiply(f, n, m, Z + k * n);
        for (j = 0; j < d; j++)
            for (S[k * d + j] = 0.0, i = 0; i < n; i++) S[k * d + j] += D[j * n + i] * Z[k * n + i];
    }
}
