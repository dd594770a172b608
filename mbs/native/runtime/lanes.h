/* Columns side by side in vector lanes, MBS_GROUP of them in memory row by row. */
#ifndef MBS_LANES_H
#define MBS_LANES_H

#include <stdint.h>

#include "sincos.h"

#define MBS_GROUP 8
#define MBS_ROW (MBS_GROUP / MBS_LANES) /* vectors in a row */

static inline __attribute__((always_inline)) mbs_lanes mbs_all(double x) {
    return x - (mbs_lanes){0};
}

static inline __attribute__((unused)) double *mbs_aligned(double *p) {
    return (double *)(((uintptr_t)p + 63) & ~(uintptr_t)63);
}

/* Transposition of a square: MBS_PAIR exchanges blocks between rows a and b. */
#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector) && MBS_LANES >= 4
typedef double mbs_unaligned __attribute__((vector_size(8 * MBS_LANES), may_alias, aligned(8)));
#define MBS_PAIR(a, b, low, high)                            \
    {                                                        \
        const mbs_lanes x = s[a], y = s[b];                  \
        s[a] = __builtin_shufflevector(x, y, MBS_LIST low);  \
        s[b] = __builtin_shufflevector(x, y, MBS_LIST high); \
    }
#define MBS_UNROLLED _Pragma("GCC unroll 8")
#define MBS_LIST(...) __VA_ARGS__
static inline __attribute__((always_inline, unused)) void mbs_transpose(mbs_lanes *s) {
#if MBS_LANES == 8
    MBS_UNROLLED
    for (int k = 0; k < 8; k += 2)
        MBS_PAIR(k, k + 1, (0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15))
    MBS_UNROLLED
    for (int k = 0; k < 4; ++k)
        MBS_PAIR(k + k / 2 * 2, k + k / 2 * 2 + 2, (0, 1, 8, 9, 4, 5, 12, 13),
                 (2, 3, 10, 11, 6, 7, 14, 15))
    MBS_UNROLLED
    for (int k = 0; k < 4; ++k)
        MBS_PAIR(k, k + 4, (0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15))
#else
    MBS_UNROLLED
    for (int k = 0; k < 4; k += 2) MBS_PAIR(k, k + 1, (0, 4, 2, 6), (1, 5, 3, 7))
    MBS_UNROLLED
    for (int k = 0; k < 2; ++k) MBS_PAIR(k, k + 2, (0, 1, 4, 5), (2, 3, 6, 7))
#endif
}
#endif
#endif

static inline __attribute__((always_inline)) int mbs_any(mbs_bits mask) {
#if MBS_LANES == 8
    return _mm512_movepi64_mask((__m512i)mask) != 0;
#elif MBS_LANES == 4
    return _mm256_movemask_pd((__m256d)mask) != 0;
#else
    return (mask[0] | mask[1]) != 0;
#endif
}

#define MBS_IS_LARGE(x) ((mbs_bits)(x > MBS_LARGE) | ~(mbs_bits)(x >= -MBS_LARGE))

static inline __attribute__((always_inline)) void mbs_sincos_wide(mbs_lanes x, mbs_lanes *sine,
                                                                  mbs_lanes *cosine) {
    const mbs_bits large = MBS_IS_LARGE(x);
    mbs_sincos_lanes(x, sine, cosine);
    if (__builtin_expect(mbs_any(large), 0))
        for (int l = 0; l < MBS_LANES; ++l)
            if (large[l]) {
                (*sine)[l] = sin(x[l]);
                (*cosine)[l] = cos(x[l]);
            }
}

static __attribute__((noinline, unused)) void mbs_sincos_wide_call(mbs_lanes x, mbs_lanes *sine,
                                                                   mbs_lanes *cosine) {
    mbs_sincos_wide(x, sine, cosine);
}

/* Rows of lanes to the columns that they are of, a square of MBS_LANES rows at a time; the last
 * square overlaps the one before it. */
static inline __attribute__((unused)) void mbs_columns(const mbs_lanes *rows, int count,
                                                       int columns, double *const *to) {
    int first = 0;
#if defined(MBS_PAIR)
    while (count >= MBS_LANES && first < count) {
        mbs_lanes square[MBS_LANES];
        if (first > count - MBS_LANES) first = count - MBS_LANES;
        MBS_UNROLLED
        for (int r = 0; r < MBS_LANES; ++r) square[r] = rows[first + r];
        mbs_transpose(square);
        if (columns == MBS_LANES) {
            MBS_UNROLLED
            for (int l = 0; l < MBS_LANES; ++l) *(mbs_unaligned *)(to[l] + first) = square[l];
        } else {
            for (int l = 0; l < columns; ++l) *(mbs_unaligned *)(to[l] + first) = square[l];
        }
        first += MBS_LANES;
    }
#endif
    const double *from = (const double *)rows;
    for (int l = 0; l < columns; ++l)
        for (int r = first; r < count; ++r) to[l][r] = from[r * MBS_LANES + l];
}

#endif
