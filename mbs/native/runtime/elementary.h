/* Elementary functions of many numbers at once, in vector lanes.
 *
 * Errors are below 3 units in the last place, those of tangents below 4. What the formulas do not
 * reach (infinities, what is not a number, subnormal arguments of logarithms) is left to libm, for
 * that lane alone, so that a lane never depends on its neighbours. */
#ifndef MBS_ELEMENTARY_H
#define MBS_ELEMENTARY_H

#include "lanes.h"

#define MBS_INLINE static inline __attribute__((always_inline, unused))

MBS_INLINE mbs_lanes mbs_select(mbs_bits mask, mbs_lanes a, mbs_lanes b) {
    return (mbs_lanes)((mask & (mbs_bits)a) | (~mask & (mbs_bits)b));
}

MBS_INLINE mbs_lanes mbs_flag(mbs_bits mask) { return (mbs_lanes)(mask & (mbs_bits)mbs_all(1.0)); }

#define MBS_SIGN ((mbs_bits)mbs_all(-0.0))
#define MBS_FALSE(x) ((mbs_bits)((x) == 0.0))
#define MBS_TRUE(x) ((mbs_bits)((x) != 0.0))

MBS_INLINE mbs_lanes mbs_fabs(mbs_lanes x) { return (mbs_lanes)((mbs_bits)x & ~MBS_SIGN); }

MBS_INLINE mbs_lanes mbs_copysign(mbs_lanes x, mbs_lanes y) {
    return (mbs_lanes)(((mbs_bits)x & ~MBS_SIGN) | ((mbs_bits)y & MBS_SIGN));
}

MBS_INLINE mbs_lanes mbs_lt(mbs_lanes x, mbs_lanes y) { return mbs_flag((mbs_bits)(x < y)); }
MBS_INLINE mbs_lanes mbs_le(mbs_lanes x, mbs_lanes y) { return mbs_flag((mbs_bits)(x <= y)); }
MBS_INLINE mbs_lanes mbs_eq(mbs_lanes x, mbs_lanes y) { return mbs_flag((mbs_bits)(x == y)); }
MBS_INLINE mbs_lanes mbs_ne(mbs_lanes x, mbs_lanes y) { return mbs_flag((mbs_bits)(x != y)); }
MBS_INLINE mbs_lanes mbs_not(mbs_lanes x) { return mbs_flag(MBS_FALSE(x)); }
MBS_INLINE mbs_lanes mbs_and(mbs_lanes x, mbs_lanes y) {
    return mbs_flag(MBS_TRUE(x) & MBS_TRUE(y));
}
MBS_INLINE mbs_lanes mbs_or(mbs_lanes x, mbs_lanes y) {
    return mbs_flag(MBS_TRUE(x) | MBS_TRUE(y));
}
MBS_INLINE mbs_lanes mbs_if_else_zero(mbs_lanes x, mbs_lanes y) {
    return (mbs_lanes)(MBS_TRUE(x) & (mbs_bits)y);
}

/* Of a number and NaN, the number. */
MBS_INLINE mbs_lanes mbs_fmin(mbs_lanes x, mbs_lanes y) {
    return mbs_select((mbs_bits)(x < y) | (mbs_bits)(y != y), x, y);
}
MBS_INLINE mbs_lanes mbs_fmax(mbs_lanes x, mbs_lanes y) {
    return mbs_select((mbs_bits)(x > y) | (mbs_bits)(y != y), x, y);
}

MBS_INLINE mbs_lanes mbs_sign(mbs_lanes x) {
    return mbs_select((mbs_bits)(x > 0.0), mbs_all(1.0),
                      mbs_select((mbs_bits)(x < 0.0), mbs_all(-1.0), x));
}

/* A function of libm, lane by lane. */
#define MBS_EACH(f)                                         \
    MBS_INLINE mbs_lanes mbs_each_##f(mbs_lanes x) {        \
        for (int l = 0; l < MBS_LANES; ++l) x[l] = f(x[l]); \
        return x;                                           \
    }
#define MBS_EACH_PAIR(f)                                          \
    MBS_INLINE mbs_lanes mbs_##f(mbs_lanes x, mbs_lanes y) {      \
        for (int l = 0; l < MBS_LANES; ++l) x[l] = f(x[l], y[l]); \
        return x;                                                 \
    }
MBS_EACH_PAIR(pow)
MBS_EACH_PAIR(fmod)
MBS_EACH_PAIR(remainder)
MBS_EACH_PAIR(hypot)
MBS_EACH(erf)
MBS_EACH(asinh)
MBS_EACH(acosh)
MBS_EACH(atanh)
MBS_EACH(log1p)

#if MBS_LANES == 8
MBS_INLINE mbs_lanes mbs_sqrt(mbs_lanes x) { return (mbs_lanes)_mm512_sqrt_pd((__m512d)x); }
MBS_INLINE mbs_lanes mbs_floor(mbs_lanes x) {
    return (mbs_lanes)_mm512_roundscale_pd((__m512d)x, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
}
MBS_INLINE mbs_lanes mbs_ceil(mbs_lanes x) {
    return (mbs_lanes)_mm512_roundscale_pd((__m512d)x, _MM_FROUND_TO_POS_INF | _MM_FROUND_NO_EXC);
}
#elif MBS_LANES == 4
MBS_INLINE mbs_lanes mbs_sqrt(mbs_lanes x) { return (mbs_lanes)_mm256_sqrt_pd((__m256d)x); }
MBS_INLINE mbs_lanes mbs_floor(mbs_lanes x) { return (mbs_lanes)_mm256_floor_pd((__m256d)x); }
MBS_INLINE mbs_lanes mbs_ceil(mbs_lanes x) { return (mbs_lanes)_mm256_ceil_pd((__m256d)x); }
#else
MBS_EACH(sqrt)
MBS_EACH(floor)
MBS_EACH(ceil)
#define mbs_sqrt mbs_each_sqrt
#define mbs_floor mbs_each_floor
#define mbs_ceil mbs_each_ceil
#endif

/* Replaces the lanes of `result` where `wrong` by libm's answer. */
#define MBS_RARE(wrong, result, answer)            \
    {                                              \
        const mbs_bits rare = (wrong);             \
        if (__builtin_expect(mbs_any(rare), 0))    \
            for (int l = 0; l < MBS_LANES; ++l)    \
                if (rare[l]) result[l] = (answer); \
    }

MBS_INLINE mbs_lanes mbs_tan(mbs_lanes x) {
    mbs_lanes s, c;
    mbs_sincos_lanes(x, &s, &c);
    mbs_lanes t = s / c;
    MBS_RARE(MBS_IS_LARGE(x), t, tan(x[l]))
    return t;
}

/* 2^n - 1 + 2^n q = exp(x) - 1, with n an integer and q = exp(r) - 1 of |r| < 0.35 as its series.
 */
MBS_INLINE mbs_lanes mbs_exp_parts(mbs_lanes x, mbs_bits *n) {
    const mbs_lanes to_integer = mbs_all(6755399441055744.0);
    const mbs_lanes shifted = x * 1.44269504088896340736 + to_integer;
    const mbs_lanes k = shifted - to_integer;
    *n = (mbs_bits)shifted - (mbs_bits)to_integer;
    const mbs_lanes r = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    const mbs_lanes z = r * r, z2 = z * z, z4 = z2 * z2;
    const mbs_lanes low = (0.5 + r * (1.0 / 6)) + z * (1.0 / 24 + r * (1.0 / 120));
    const mbs_lanes middle =
        (1.0 / 720 + r * (1.0 / 5040)) + z * (1.0 / 40320 + r * (1.0 / 362880));
    const mbs_lanes high =
        (1.0 / 3628800 + r * (1.0 / 39916800)) + z * (1.0 / 479001600 + r * (1.0 / 6227020800));
    return r + z * ((low + z2 * middle) + z4 * high);
}

MBS_INLINE mbs_lanes mbs_power_of_two(mbs_bits n) { return (mbs_lanes)((n + 1023) << 52); }

MBS_INLINE mbs_lanes mbs_within(mbs_lanes x, double low, double high) {
    x = mbs_select((mbs_bits)(x > high), mbs_all(high), x);
    return mbs_select((mbs_bits)(x < low), mbs_all(low), x);
}

MBS_INLINE mbs_lanes mbs_exp(mbs_lanes x) {
    mbs_bits n;
    const mbs_lanes q = mbs_exp_parts(mbs_within(x, -760.0, 720.0), &n);
    const mbs_bits half = n >> 1;
    return ((1.0 + q) * mbs_power_of_two(half)) * mbs_power_of_two(n - half);
}

MBS_INLINE mbs_lanes mbs_expm1(mbs_lanes x) {
    mbs_bits n;
    const mbs_lanes q = mbs_exp_parts(mbs_within(x, -60.0, 700.0), &n);
    const mbs_lanes scale = mbs_power_of_two(n);
    mbs_lanes y = mbs_select((mbs_bits)(n == 0), q, (scale - 1.0) + scale * q);
    MBS_RARE((mbs_bits)(x > 700.0), y, expm1(x[l]))
    return y;
}

MBS_INLINE mbs_lanes mbs_tanh(mbs_lanes x) {
    const mbs_lanes e = mbs_expm1(mbs_within(2.0 * mbs_fabs(x), 0.0, 60.0));
    return mbs_copysign(e / (e + 2.0), x);
}

MBS_INLINE mbs_lanes mbs_sinh(mbs_lanes x) {
    const mbs_lanes a = mbs_fabs(x), e = mbs_expm1(mbs_within(a, 0.0, 700.0));
    mbs_lanes y = mbs_copysign(0.5 * (e + e / (e + 1.0)), x);
    MBS_RARE((mbs_bits)(a > 700.0), y, sinh(x[l]))
    return y;
}

MBS_INLINE mbs_lanes mbs_cosh(mbs_lanes x) {
    const mbs_lanes a = mbs_fabs(x), e = mbs_exp(mbs_within(a, 0.0, 700.0));
    mbs_lanes y = 0.5 * e + 0.5 / e;
    MBS_RARE((mbs_bits)(a > 700.0), y, cosh(x[l]))
    return y;
}

/* x = 2^k (1 + f) with sqrt(1/2) <= 1 + f < sqrt(2), then fdlibm's polynomial. */
MBS_INLINE mbs_lanes mbs_log(mbs_lanes x) {
    const mbs_bits offset = (mbs_bits)mbs_all(0.70710678118654752440);
    const mbs_bits exponent = ((mbs_bits)x - offset) >> 52;
    const mbs_lanes f = (mbs_lanes)((mbs_bits)x - (exponent << 52)) - 1.0;
    const mbs_lanes to_integer = mbs_all(6755399441055744.0);
    const mbs_lanes k = (mbs_lanes)(exponent + (mbs_bits)to_integer) - to_integer;
    const mbs_lanes s = f / (2.0 + f), z = s * s, w = z * z, half = 0.5 * f * f;
    const mbs_lanes odd = w * (3.999999999940941908e-01 +
                               w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    const mbs_lanes even =
        z * (6.666666666666735130e-01 +
             w * (2.857142874366239149e-01 +
                  w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
    mbs_lanes y = k * 6.93147180369123816490e-01 -
                  ((half - (s * (half + (odd + even)) + k * 1.90821492927058770002e-10)) - f);
    MBS_RARE(~((mbs_bits)(x >= 2.2250738585072014e-308) & (mbs_bits)(x <= 1.7976931348623157e308)),
             y, log(x[l]))
    return y;
}

/* The angle of numerator / denominator: pi/2, pi/4 or 0 and a rational function of what remains
 * (Cephes's); numerator and denominator are not negative. */
MBS_INLINE mbs_lanes mbs_atan_ratio(mbs_lanes a, mbs_lanes b) {
    const mbs_bits big = (mbs_bits)(a > 2.41421356237309504880 * b);
    const mbs_bits middle = ~big & (mbs_bits)(a > 0.66 * b);
    const mbs_lanes x = mbs_select(big, -b, mbs_select(middle, a - b, a)) /
                        mbs_select(big, a, mbs_select(middle, a + b, b));
    const mbs_lanes turn =
        mbs_select(big, mbs_all(1.57079632679489661923),
                   (mbs_lanes)(middle & (mbs_bits)mbs_all(0.785398163397448309616)));
    const mbs_lanes rest =
        mbs_select(big, mbs_all(6.123233995736765886130e-17),
                   (mbs_lanes)(middle & (mbs_bits)mbs_all(0.5 * 6.123233995736765886130e-17)));
    const mbs_lanes z = x * x;
    const mbs_lanes p = (((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z -
                          7.500855792314704667340e1) *
                             z -
                         1.228866684490136173410e2) *
                            z -
                        6.485021904942025371773e1;
    const mbs_lanes q = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z +
                          4.328810604912902668951e2) *
                             z +
                         4.853903996359136964868e2) *
                            z +
                        1.945506571482613964425e2;
    return turn + ((x * (z * p / q) + rest) + x);
}

MBS_INLINE mbs_lanes mbs_atan(mbs_lanes x) {
    const mbs_lanes a = mbs_within(mbs_fabs(x), 0.0, 1e300);
    return mbs_copysign(mbs_atan_ratio(a, mbs_all(1.0)), x);
}

MBS_INLINE mbs_lanes mbs_atan2(mbs_lanes y, mbs_lanes x) {
    const mbs_lanes a = mbs_fabs(y), b = mbs_fabs(x), most = mbs_select((mbs_bits)(a > b), a, b);
    mbs_lanes angle = mbs_atan_ratio(a, b);
    const mbs_bits behind = (mbs_bits)x >> 63; /* of -0 too */
    angle = mbs_select(behind, 3.14159265358979323846 - (angle - 1.2246467991473532e-16), angle);
    angle = mbs_copysign(angle, y);
    MBS_RARE(~((mbs_bits)(most > 1e-290) & (mbs_bits)(most < 1e290) & (mbs_bits)(a == a) &
               (mbs_bits)(b == b)),
             angle, atan2(y[l], x[l]))
    return angle;
}

/* (asin(x) - x) / x of z = x^2 <= 1/4, fdlibm's. */
MBS_INLINE mbs_lanes mbs_asin_series(mbs_lanes z) {
    const mbs_lanes p =
        z * (1.66666666666666657415e-01 +
             z * (-3.25565818622400915405e-01 +
                  z * (2.01212532134862925881e-01 +
                       z * (-4.00555345006794114027e-02 +
                            z * (7.91534994289814532176e-04 + z * 3.47933107596021167570e-05)))));
    const mbs_lanes q =
        1.0 + z * (-2.40339491173441421878e+00 +
                   z * (2.02094576023350569471e+00 +
                        z * (-6.88283971605453293030e-01 + z * 7.70381505559019352791e-02)));
    return p / q;
}

MBS_INLINE mbs_lanes mbs_asin(mbs_lanes x) {
    const mbs_lanes a = mbs_fabs(x);
    const mbs_bits large = (mbs_bits)(a > 0.5);
    const mbs_lanes z = mbs_select(large, 0.5 * (1.0 - a), a * a);
    const mbs_lanes s = mbs_select(large, mbs_sqrt(z), a), r = s + s * mbs_asin_series(z);
    const mbs_lanes far = 1.57079632679489661923 - (2.0 * r - 6.123233995736765886130e-17);
    return mbs_copysign(mbs_select(large, far, r), x);
}

MBS_INLINE mbs_lanes mbs_acos(mbs_lanes x) {
    const mbs_lanes a = mbs_fabs(x);
    const mbs_bits large = (mbs_bits)(a > 0.5), negative = (mbs_bits)(x < 0.0);
    const mbs_lanes z = mbs_select(large, 0.5 * (1.0 - a), x * x);
    const mbs_lanes s = mbs_select(large, mbs_sqrt(z), x), r = s + s * mbs_asin_series(z);
    const mbs_lanes back = 3.14159265358979323846 - (2.0 * r - 1.2246467991473532e-16);
    const mbs_lanes near = 1.57079632679489661923 - (r - 6.123233995736765886130e-17);
    return mbs_select(large, mbs_select(negative, back, 2.0 * r), near);
}

#endif
