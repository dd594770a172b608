#include "passage_data.h"

#include <stdlib.h>

/* Return memory for `count` doubles from a block. Integers and words of row sets are not longer
 * than doubles. With block NULL only the size is counted. */
static void *take(double *block, size_t *used, size_t count) {
    double *found = block ? block + *used : NULL;
    *used += count + 1;
    return found;
}

/* Assign the arrays of doubles and row sets of the factors of a matrix (n, m). */
static void place_qr_numbers(sparse_qr *f, size_t n, size_t m, double *block, size_t *used) {
    f->A = take(block, used, n * m);
    f->weight = take(block, used, n);
    f->tails = take(block, used, n * n);
    f->length2 = take(block, used, m);
    f->nonzero = take(block, used, m * ROW_WORDS(n));
    f->filled = take(block, used, m * ROW_WORDS(n));
}

/* Assign the arrays of indices of the factors of a matrix (n, m). Returns the memory after them. */
static int *place_qr_indices(sparse_qr *f, size_t n, size_t m, int *numbers) {
    f->pivot_column = numbers;
    f->pivot_row = f->pivot_column + m;
    f->reflected_count = f->pivot_row + n;
    f->last_column = f->reflected_count + n;
    f->reflected = f->last_column + n;
    f->upper_count = f->reflected + n * n;
    f->upper = f->upper_count + m;
    return f->upper + n * m;
}

/* Assign the arrays of a frame. */
static void place_frame(passage_frame *p, const passage_size *z, double *block, size_t *used) {
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
    p->L = take(block, used, nv * nv);
    p->L_end = take(block, used, nv);
    p->f = take(block, used, nv);
    p->rate = take(block, used, (size_t)z->nz);
    place_qr_numbers(&p->qr, nv, m, block, used);
    p->T = take(block, used, nv * nv);
}

/* Assign all arrays in the block. Returns its size in doubles; block may be NULL for that. */
static size_t place_arrays(passage *g, double *block) {
    const passage_size *z = &g->size;
    size_t nq = (size_t)z->nq, nv = (size_t)z->nv, n = (size_t)g->stepper->n,
           ny = 2 * nv + (size_t)z->nz;
    size_t rows = (size_t)z->positions + nv, used = 0;
    int k;
    place_frame(&g->origin, z, block, &used);
    place_frame(&g->point, z, block, &used);
    place_qr_numbers(&g->scratch.qr, nq, rows, block, &used);
    g->chart.C = take(block, &used, nv * nq);
    g->guide.rate = take(block, &used, nq);
    g->chart.drift = take(block, &used, nv);
    g->prepared.y = take(block, &used, ny);
    g->stages.y = take(block, &used, ny);
    for (k = 0; k < 7; k++) {
        g->stages.slope_y[k] = take(block, &used, ny);
        g->stages.slope_x[k] = take(block, &used, n);
    }
    g->dense.accepted = take(block, &used, 5 * n);
    g->scratch.state = take(block, &used, n);
    g->scratch.direction = take(block, &used, nv);
    g->scratch.neighbours = take(block, &used, 2 * n + 2 * ny);
    g->scratch.matrix = take(block, &used, rows * nq + nq * (nq + 1));
    g->scratch.residual = take(block, &used, rows + nv);
    g->scratch.y = take(block, &used, ny);
    g->scratch.w = take(block, &used, ny);
    g->scratch.square = take(block, &used, nv * nv);
    g->dense.attempted = take(block, &used, 5 * n);
    g->prepared.x = take(block, &used, n);
    return used;
}

/* Make the pattern of J, whose rows are the first rows of slope. Returns 1 if no memory is left. */
static int make_pattern_of_J(passage *g) {
    const sparse_pattern *all = &g->patterns.slope;
    int columns = all->columns, count = all->start[columns], status, j, k, n = 0;
    int *given = calloc((size_t)(columns + 1 + count), sizeof *given);
    g->patterns.J_from = calloc((size_t)count + 1, sizeof *g->patterns.J_from);
    for (j = 0; j < columns && given && g->patterns.J_from; j++) {
        for (k = all->start[j]; k < all->start[j + 1]; k++) {
            if (all->row[k] >= g->size.speeds) continue;
            given[columns + 1 + n] = all->row[k];
            g->patterns.J_from[n++] = k;
        }
        given[j + 1] = n;
    }
    status = !given || !g->patterns.J_from ||
             sparse_pattern_make(&g->patterns.J, g->size.speeds, columns, given);
    free(given);
    return status;
}

/* Make the patterns of the model. given: NULL if all matrices are dense. Returns 1 if no memory is
 * left. */
static int make_patterns(passage *g, const passage_patterns *given) {
    static const passage_patterns dense = {NULL, NULL, NULL, NULL};
    const passage_size *z = &g->size;
    if (!given) given = &dense;
    if (sparse_pattern_make(&g->patterns.slope, z->positions, z->nq, given->slope)) return 1;
    if (sparse_pattern_make(&g->patterns.M, z->nv, z->nv, given->M)) return 1;
    if (z->nq == z->nv) return make_pattern_of_J(g);
    return sparse_pattern_make(&g->patterns.J, z->speeds, z->nv, given->J) ||
           sparse_pattern_make(&g->patterns.N, z->nq, z->nv, given->N);
}

int passage_allocate(passage *g, const passage_patterns *given) {
    size_t nq = (size_t)g->size.nq, nv = (size_t)g->size.nv, m = (size_t)g->size.speeds;
    size_t rows = (size_t)g->size.positions + nv;
    size_t indices = 2 * (2 * m + nv * (nv + m + 3)) + 2 * rows + nq * (nq + rows + 3) + 1;
    int *next;
    g->storage.numbers = calloc(place_arrays(g, NULL), sizeof *g->storage.numbers);
    g->storage.indices = calloc(indices, sizeof *g->storage.indices);
    if (!g->storage.numbers || !g->storage.indices || make_patterns(g, given)) return 1;
    place_arrays(g, g->storage.numbers);
    next = place_qr_indices(&g->origin.qr, nv, m, g->storage.indices);
    next = place_qr_indices(&g->point.qr, nv, m, next);
    place_qr_indices(&g->scratch.qr, nq, rows, next);
    g->point.qr.height = g->origin.qr.height = g->size.nv; /* the block is zero */
    g->point.qr.columns = g->origin.qr.columns = g->size.speeds;
    g->scratch.qr.height = g->size.nq;
    g->scratch.qr.columns = (int)rows;
    return 0;
}

void passage_release(passage *g) {
    free(g->storage.numbers);
    free(g->storage.indices);
    sparse_pattern_free(&g->patterns.slope);
    sparse_pattern_free(&g->patterns.J);
    sparse_pattern_free(&g->patterns.N);
    sparse_pattern_free(&g->patterns.M);
    free(g->patterns.J_from);
}
