#include "sparse_pattern.h"

#include <stdlib.h>

int sparse_pattern_make(sparse_pattern *p, int rows, int columns, const int *given) {
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

void sparse_pattern_free(sparse_pattern *p) {
    free(p->start);
    p->start = NULL;
}
