/* Arrays of many states, seen from vector lanes: MBS_LANES states side by side. */
#ifndef MBS_ROWS_H
#define MBS_ROWS_H

#include <string.h>

#include "lanes.h"

/* Element (state, k) of an array stands at at[state * row + k * column]. `stream`: 1 to store past
 * the caches, for which `at` is aligned to 64 bytes. */
typedef struct {
    double *at;
    long long row, column, stream;
} mbs_port;

#define MBS_AHEAD 32 /* states that are fetched early */

#define MBS_ALWAYS static inline __attribute__((always_inline, unused))

MBS_ALWAYS void mbs_store_past(double *to, mbs_lanes x) {
#if MBS_LANES == 8
    _mm512_stream_pd(to, (__m512d)x);
#elif MBS_LANES == 4
    _mm256_stream_pd(to, (__m256d)x);
#else
    memcpy(to, &x, sizeof x);
#endif
}

MBS_ALWAYS void mbs_store_end(void) {
#if MBS_LANES > 2
    _mm_sfence();
#endif
}

/* Four elements of MBS_LANES states: of rows in memory, and of vectors of states. */
#if MBS_LANES == 8
#define MBS_FOUR 4
#define MBS_LOW _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13)
#define MBS_HIGH _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15)
MBS_ALWAYS void mbs_exchange(const __m512d *a, __m512d *b) {
    b[0] = _mm512_permutex2var_pd(a[0], MBS_LOW, a[2]);
    b[1] = _mm512_permutex2var_pd(a[1], MBS_LOW, a[3]);
    b[2] = _mm512_permutex2var_pd(a[0], MBS_HIGH, a[2]);
    b[3] = _mm512_permutex2var_pd(a[1], MBS_HIGH, a[3]);
}
MBS_ALWAYS void mbs_unpack(const __m512d *a, __m512d *b) {
    b[0] = _mm512_unpacklo_pd(a[0], a[1]), b[1] = _mm512_unpackhi_pd(a[0], a[1]);
    b[2] = _mm512_unpacklo_pd(a[2], a[3]), b[3] = _mm512_unpackhi_pd(a[2], a[3]);
}
MBS_ALWAYS void mbs_take_four(const double *from, long long row, mbs_lanes *lanes) {
    __m512d a[4], b[4];
    MBS_UNROLLED
    for (int l = 0; l < 4; ++l)
        a[l] = _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_loadu_pd(from + l * row)),
                                  _mm256_loadu_pd(from + (l + 4) * row), 1);
    mbs_unpack(a, b);
    mbs_exchange(b, (__m512d *)lanes);
}
MBS_ALWAYS void mbs_give_four(double *to, long long row, const mbs_lanes *lanes) {
    __m512d a[4], b[4];
    mbs_unpack((const __m512d *)lanes, a);
    mbs_exchange(a, b);
    MBS_UNROLLED
    for (int l = 0; l < 4; ++l) {
        _mm256_storeu_pd(to + l * row, _mm512_castpd512_pd256(b[l]));
        _mm256_storeu_pd(to + (l + 4) * row, _mm512_extractf64x4_pd(b[l], 1));
    }
}
#elif MBS_LANES == 4 && defined(MBS_PAIR)
#define MBS_FOUR 4
MBS_ALWAYS void mbs_take_four(const double *from, long long row, mbs_lanes *lanes) {
    MBS_UNROLLED
    for (int l = 0; l < 4; ++l) lanes[l] = *(const mbs_unaligned *)(from + l * row);
    mbs_transpose(lanes);
}
MBS_ALWAYS void mbs_give_four(double *to, long long row, const mbs_lanes *lanes) {
    mbs_lanes square[4] = {lanes[0], lanes[1], lanes[2], lanes[3]};
    mbs_transpose(square);
    MBS_UNROLLED
    for (int l = 0; l < 4; ++l) *(mbs_unaligned *)(to + l * row) = square[l];
}
#endif

/* One state in all lanes. */
MBS_ALWAYS void mbs_take_same(const mbs_port *port, int size, mbs_lanes *lanes) {
    for (int k = 0; k < size; ++k) lanes[k] = mbs_all(port->at[k * port->column]);
}

MBS_ALWAYS void mbs_take_each(const mbs_port *port, long long first, int many, int size,
                              mbs_lanes *lanes) {
    for (int l = 0; l < MBS_LANES; ++l) {
        const double *from = port->at + (first + (l < many ? l : many - 1)) * port->row;
        for (int k = 0; k < size; ++k) lanes[k][l] = from[k * port->column];
    }
}

/* States first .. first + many - 1 into lanes; lanes beyond them repeat the last one. */
MBS_ALWAYS void mbs_take(const mbs_port *port, long long first, int many, int size,
                         mbs_lanes *lanes) {
#if defined(MBS_FOUR)
    if (many == MBS_LANES && port->row == 1) {
        const double *from = port->at + first;
        for (int k = 0; k < size; ++k) lanes[k] = *(const mbs_unaligned *)(from + k * port->column);
        return;
    }
    if (many == MBS_LANES && port->column == 1 && size >= MBS_FOUR) {
        const double *from = port->at + first * port->row;
        for (int k = 0; k < size * MBS_LANES; k += 8)
            __builtin_prefetch(from + MBS_AHEAD * port->row + k);
        for (int k = 0; k < size; k += MBS_FOUR) {
            const int at = k + MBS_FOUR <= size ? k : size - MBS_FOUR;
            mbs_take_four(from + at, port->row, lanes + at);
        }
        return;
    }
#endif
    mbs_take_each(port, first, many, size, lanes);
}

/* Zero in the lanes of finite numbers, NaN in the others. */
MBS_ALWAYS mbs_lanes mbs_times_zero(const mbs_lanes *lanes, int size) {
    mbs_lanes sum = mbs_all(0.0);
    for (int k = 0; k < size; ++k) sum += lanes[k] * 0.0;
    return sum;
}

/* NaN in some lanes. */
MBS_ALWAYS void mbs_spoil(mbs_lanes *lanes, int size, mbs_bits where) {
    for (int l = 0; l < MBS_LANES; ++l)
        for (int k = 0; where[l] && k < size; ++k) lanes[k][l] = __builtin_nan("");
}

MBS_ALWAYS void mbs_give_each(const mbs_port *port, long long first, int many, int size,
                              const mbs_lanes *lanes) {
    for (int l = 0; l < many; ++l) {
        double *to = port->at + (first + l) * port->row;
        for (int k = 0; k < size; ++k) to[k * port->column] = lanes[k][l];
    }
}

#if defined(MBS_FOUR)
/* At least four elements of full lanes to rows; the last four overlap those before them. */
MBS_ALWAYS void mbs_give_rows(double *to, long long row, int size, const mbs_lanes *lanes) {
    for (int k = 0; k < size; k += MBS_FOUR) {
        const int at = k + MBS_FOUR <= size ? k : size - MBS_FOUR;
        mbs_give_four(to + at, row, lanes + at);
    }
}
#endif

/* Lanes to states first .. first + many - 1. */
MBS_ALWAYS void mbs_give(const mbs_port *port, long long first, int many, int size,
                         const mbs_lanes *lanes) {
#if defined(MBS_FOUR)
    if (many == MBS_LANES && port->row == 1) {
        double *to = port->at + first;
        if (port->stream)
            for (int k = 0; k < size; ++k) mbs_store_past(to + k * port->column, lanes[k]);
        else
            for (int k = 0; k < size; ++k) *(mbs_unaligned *)(to + k * port->column) = lanes[k];
        return;
    }
    if (many == MBS_LANES && port->column == 1 && size >= MBS_FOUR) {
        double *to = port->at + first * port->row;
        if (port->stream) {
            mbs_lanes rows[size];
            mbs_give_rows((double *)rows, size, size, lanes);
            for (int k = 0; k < size; ++k) mbs_store_past(to + k * MBS_LANES, rows[k]);
        } else
            mbs_give_rows(to, port->row, size, lanes);
        return;
    }
#endif
    mbs_give_each(port, first, many, size, lanes);
}

#endif
