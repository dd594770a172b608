/* Sparsity patterns of matrices by columns and by rows, and sets of rows.
 *
 * Re-entrant: no globals.
 */
#ifndef MBS_SPARSE_PATTERN_H
#define MBS_SPARSE_PATTERN_H

/* Elements start[k] .. start[k + 1] - 1 belong to column k and have the row indices row[], in
 * ascending order. By rows: entries begin[i] .. begin[i + 1] - 1 belong to row i, with the column
 * index column[] and the index from[] in the order by columns. */
typedef struct {
    int columns, rows, *start, *row;
    int *begin, *column, *from;
} sparse_pattern;

/* Make the pattern of a matrix (rows, columns). given: start, then row, or NULL for a dense matrix.
 * Returns 1 if no memory is left. */
int sparse_pattern_make(sparse_pattern *p, int rows, int columns, const int *given);
void sparse_pattern_free(sparse_pattern *p);

/* Set of rows, with one bit per row: ROW_WORDS(n) words for n rows. */
typedef unsigned long long row_set;
#define ROW_BITS 64
#define ROW_WORDS(n) (((n) + ROW_BITS - 1) / ROW_BITS)

/* Bit of a row in its word. */
static inline row_set row_bit(int row) { return (row_set)1 << (unsigned)row % ROW_BITS; }

/* Index of the lowest bit of a nonzero word. */
static inline int lowest_row(row_set bits) {
#ifdef __GNUC__
    return __builtin_ctzll(bits);
#else
    int row = 0;
    for (; !(bits & 1); bits >>= 1) row++;
    return row;
#endif
}

#endif
