/* Sines and cosines of many angles at once, in vector lanes.
 *
 * Reduction by multiples of pi/2 (Cody & Waite 1980), then the minimax polynomials of degree 13
 * and 14 on [-pi/4, pi/4] (fdlibm's, evaluated as Estrin's tree). The error is less than
 * 1.7e-16, and 2.5 units in the last place, up to MBS_LARGE; beyond it, and for what is not
 * finite, libm answers. */
#ifndef MBS_SINCOS_H
#define MBS_SINCOS_H

#include <math.h>

#if defined(__AVX512F__) && defined(__AVX512DQ__)
#define MBS_LANES 8
#elif defined(__AVX__)
#define MBS_LANES 4
#else
#define MBS_LANES 2
#endif

#if MBS_LANES > 2
#include <immintrin.h>
#endif

#define MBS_LARGE 1e5

typedef double mbs_lanes __attribute__((vector_size(8 * MBS_LANES), may_alias));
typedef long long mbs_bits __attribute__((vector_size(8 * MBS_LANES)));

static inline __attribute__((always_inline)) void mbs_sincos_lanes(mbs_lanes x, mbs_lanes *sine,
                                                                   mbs_lanes *cosine) {
    const double to_integer = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to an integer */
    const mbs_lanes shifted = x * 0.63661977236758134308 + to_integer;
    const mbs_lanes k = shifted - to_integer;
    const mbs_bits quadrant = (mbs_bits)shifted;
    const mbs_lanes r = ((x - k * 1.57079632673412561417e+00) - k * 6.07710050630396597660e-11) -
                        k * 2.02226624879595063154e-21; /* the first two products are exact */
    const mbs_lanes z = r * r, z2 = z * z;
    const mbs_lanes ps = (-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03) +
                         z2 * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                               z2 * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10));
    const mbs_lanes pc = (4.16666666666666019037e-02 - z * 1.38888888888741095749e-03) +
                         z2 * ((2.48015872894767294178e-05 - z * 2.75573143513906633035e-07) +
                               z2 * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11));
    const mbs_lanes s = r + (r * z) * ps;
    const mbs_lanes c = (1.0 - 0.5 * z) + z2 * pc;
    const mbs_bits next = quadrant + 1, sb = (mbs_bits)s, cb = (mbs_bits)c;
#if MBS_LANES == 8
    const __mmask8 swap = _mm512_test_epi64_mask((__m512i)quadrant, _mm512_set1_epi64(1));
    const mbs_bits sine_bits = (mbs_bits)_mm512_mask_blend_epi64(swap, (__m512i)sb, (__m512i)cb);
    const mbs_bits cosine_bits = (mbs_bits)_mm512_mask_blend_epi64(swap, (__m512i)cb, (__m512i)sb);
#else
    const mbs_bits swap = -(quadrant & 1);
    const mbs_bits sine_bits = (sb & ~swap) | (cb & swap), cosine_bits = (cb & ~swap) | (sb & swap);
#endif
    *sine = (mbs_lanes)(sine_bits ^ ((quadrant & 2) << 62));
    *cosine = (mbs_lanes)(cosine_bits ^ ((next & 2) << 62));
}

static __attribute__((noinline, cold)) void mbs_sincos_libm(const double *x, double *sc) {
    for (int i = 0; i < 8; ++i) {
        sc[i] = sin(x[i]);
        sc[8 + i] = cos(x[i]);
    }
}

/* Of eight angles: sc[0..7] are the sines and sc[8..15] the cosines. */
static inline __attribute__((always_inline)) void mbs_sincos8(double a, double b, double c,
                                                              double d, double e, double f,
                                                              double g, double h, double *sc) {
    mbs_lanes *out = (mbs_lanes *)sc;
#if MBS_LANES == 8
    mbs_sincos_lanes((mbs_lanes){a, b, c, d, e, f, g, h}, out, out + 1);
#elif MBS_LANES == 4
    mbs_sincos_lanes((mbs_lanes){a, b, c, d}, out, out + 2);
    mbs_sincos_lanes((mbs_lanes){e, f, g, h}, out + 1, out + 3);
#else
    mbs_sincos_lanes((mbs_lanes){a, b}, out, out + 4);
    mbs_sincos_lanes((mbs_lanes){c, d}, out + 1, out + 5);
    mbs_sincos_lanes((mbs_lanes){e, f}, out + 2, out + 6);
    mbs_sincos_lanes((mbs_lanes){g, h}, out + 3, out + 7);
#endif
    const double largest = (a * a + b * b) + (c * c + d * d) + (e * e + f * f) + (g * g + h * h);
    if (__builtin_expect(!(largest <= MBS_LARGE * MBS_LARGE), 0)) {
        const double x[8] = {a, b, c, d, e, f, g, h};
        mbs_sincos_libm(x, sc);
    }
}

static __attribute__((noinline, unused)) void mbs_sincos8_call(double a, double b, double c,
                                                               double d, double e, double f,
                                                               double g, double h, double *sc) {
    mbs_sincos8(a, b, c, d, e, f, g, h, sc);
}

#endif
