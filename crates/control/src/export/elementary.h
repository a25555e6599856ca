/*
 * Elementary functions on double, a copy in C of crates/math/src/elementary.rs, which describes methods and errors.
 * Compiled by gcc on x86-64, they have the bits of the core of pneudrive.
 *
 * Only +, -, *, /, fma and sqrt are used, which IEEE 754 rounds correctly. The compiler must not contract a product and a sum
 * into one operation: the pragmas below forbid it.
 *
 * A processor without this operation, such as Cortex-M4, may have a C library that rounds twice (newlib). There, or if
 * PNEUDRIVE_SOFTWARE_FMA is defined, it is computed from integers, with the same bits.
 */
#ifndef PNEUDRIVE_MATH_H
#define PNEUDRIVE_MATH_H

#include <stdint.h>

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

#if !defined(__FP_FAST_FMA) && !defined(__x86_64__) && !defined(__aarch64__) && !defined(PNEUDRIVE_SOFTWARE_FMA)
#define PNEUDRIVE_SOFTWARE_FMA
#endif

double fma(double, double, double);
double sqrt(double);

typedef union {
    double number;
    uint64_t bits;
} pneudrive_word;

typedef struct {
    double hi;
    double lo;
} pneudrive_two;

typedef struct {
    double r;
    double r_lo;
    uint64_t twice_bias;
} pneudrive_reduced;

#define PNEUDRIVE_ROUNDER 6755399441055744.0
#define PNEUDRIVE_LN_2_HI 0x1.62e42fefa3p-1
#define PNEUDRIVE_LN_2_LO 2.8235290563031577e-13
#define PNEUDRIVE_SIGN (UINT64_C(1) << 63)

static inline uint64_t pneudrive_bits(double x)
{
    pneudrive_word word;
    word.number = x;
    return word.bits;
}

static inline double pneudrive_number(uint64_t bits)
{
    pneudrive_word word;
    word.bits = bits;
    return word.number;
}

#ifdef PNEUDRIVE_SOFTWARE_FMA
/* The number (hi 2^64 + lo) 2^exponent. */
typedef struct {
    uint64_t hi;
    uint64_t lo;
    int exponent;
    uint64_t sign;
} pneudrive_wide;

/* Moves the number to the right; the last bit keeps whether a bit that fell off was set. */
static inline void pneudrive_move_right(pneudrive_wide *x, int by)
{
    uint64_t lost = 0;
    x->exponent += by;
    if (by > 127) {
        lost = x->hi | x->lo;
        x->hi = x->lo = 0;
    } else if (by > 63) {
        lost = x->lo | (by > 64 ? x->hi << (128 - by) : 0);
        x->lo = x->hi >> (by - 64);
        x->hi = 0;
    } else if (by > 0) {
        lost = x->lo << (64 - by);
        x->lo = x->hi << (64 - by) | x->lo >> by;
        x->hi >>= by;
    }
    x->lo |= lost != 0;
}

/* A finite number as an integer below 2^53, in lo. */
static inline pneudrive_wide pneudrive_taken_apart(double x)
{
    const uint64_t bits = pneudrive_bits(x);
    const int biased = (int)(bits >> 52 & 0x7ff);
    pneudrive_wide apart;
    apart.hi = 0;
    apart.lo = (bits & ((UINT64_C(1) << 52) - 1)) | (biased > 0 ? UINT64_C(1) << 52 : 0);
    apart.exponent = (biased > 0 ? biased : 1) - 1075;
    apart.sign = bits & PNEUDRIVE_SIGN;
    return apart;
}

/* The number as a double, to nearest, ties to even. */
static inline double pneudrive_rounded(pneudrive_wide x)
{
    uint64_t mantissa, rest;
    if ((x.hi | x.lo) == 0) {
        return 0.0;
    }
    while (x.hi >> 63 == 0) {
        x.hi = x.hi << 1 | x.lo >> 63;
        x.lo <<= 1;
        x.exponent -= 1;
    }
    if (x.exponent < -1149) { /* below the smallest normal number */
        pneudrive_move_right(&x, -1149 - x.exponent);
    } else if (x.exponent > 896) {
        return pneudrive_number(x.sign | UINT64_C(0x7ff0000000000000));
    }
    rest = (x.hi & 0x7ff) << 1 | (x.lo != 0);
    mantissa = x.hi >> 11;
    mantissa += rest > 0x800 || (rest == 0x800 && (mantissa & 1));
    /* A carry out of the mantissa is the next exponent. */
    return pneudrive_number(x.sign | (((uint64_t)(x.exponent + 1149) << 52) + mantissa));
}

static inline double pneudrive_fma(double a, double b, double c)
{
    const pneudrive_wide of_a = pneudrive_taken_apart(a), of_b = pneudrive_taken_apart(b);
    pneudrive_wide sum, other;
    uint64_t low, middle;
    if (!(a * 0.0 == 0.0 && b * 0.0 == 0.0) || a == 0.0 || b == 0.0) {
        return a * b + c; /* an exact product */
    }
    if (!(c * 0.0 == 0.0)) {
        return c;
    }
    if (c == 0.0) {
        return a * b;
    }
    /* The product, times 2^20: below 2^126. */
    {
        const uint64_t x = of_a.lo << 10, y = of_b.lo << 10;
        const uint64_t x0 = x & 0xffffffff, x1 = x >> 32, y0 = y & 0xffffffff, y1 = y >> 32;
        low = x0 * y0;
        middle = x1 * y0 + (low >> 32);
        other.hi = x1 * y1 + (middle >> 32);
        middle = x0 * y1 + (middle & 0xffffffff);
        other.hi += middle >> 32;
        other.lo = middle << 32 | (low & 0xffffffff);
        other.exponent = of_a.exponent + of_b.exponent - 20;
        other.sign = of_a.sign ^ of_b.sign;
    }
    sum = pneudrive_taken_apart(c);
    sum.hi = sum.lo << 9;
    sum.lo = 0;
    sum.exponent -= 73;
    if (sum.exponent < other.exponent) {
        pneudrive_move_right(&sum, other.exponent - sum.exponent);
    } else {
        pneudrive_move_right(&other, sum.exponent - other.exponent);
    }
    if (sum.sign == other.sign) {
        sum.lo += other.lo;
        sum.hi += other.hi + (sum.lo < other.lo);
        return pneudrive_rounded(sum);
    }
    if (sum.hi < other.hi || (sum.hi == other.hi && sum.lo < other.lo)) {
        const pneudrive_wide smaller = sum;
        sum = other;
        other = smaller;
    }
    sum.hi -= other.hi + (sum.lo < other.lo);
    sum.lo -= other.lo;
    return pneudrive_rounded(sum);
}
#else
static inline double pneudrive_fma(double a, double b, double c)
{
    return fma(a, b, c);
}
#endif

static inline double pneudrive_abs(double x)
{
    return x < 0.0 ? -x : x;
}

static inline double pneudrive_magnitude(double x)
{
    return pneudrive_number(pneudrive_bits(x) & ~PNEUDRIVE_SIGN);
}

static inline double pneudrive_nan(void)
{
    return pneudrive_number(UINT64_C(0x7ff8000000000000));
}

static inline double pneudrive_infinity(void)
{
    return pneudrive_number(UINT64_C(0x7ff0000000000000));
}

static inline pneudrive_two pneudrive_two_sum(double a, double b)
{
    pneudrive_two sum;
    sum.hi = a + b;
    sum.lo = b - (sum.hi - a);
    return sum;
}

static inline pneudrive_two pneudrive_two_product(double a, double b)
{
    pneudrive_two product;
    product.hi = a * b;
    product.lo = pneudrive_fma(a, b, -product.hi);
    return product;
}

static inline pneudrive_reduced pneudrive_reduce_exponent(double hi, double lo)
{
    const double shifted = pneudrive_fma(hi, 0x1.71547652b82fep+0, PNEUDRIVE_ROUNDER);
    const double k = shifted - PNEUDRIVE_ROUNDER;
    const double coarse = pneudrive_fma(k, -PNEUDRIVE_LN_2_HI, hi);
    const pneudrive_two r = pneudrive_two_sum(coarse, pneudrive_fma(k, -PNEUDRIVE_LN_2_LO, lo));
    pneudrive_reduced reduced;
    reduced.r = r.hi;
    reduced.r_lo = r.lo;
    reduced.twice_bias = pneudrive_bits(shifted) + (UINT64_C(2046) - pneudrive_bits(PNEUDRIVE_ROUNDER));
    return reduced;
}

static inline double pneudrive_exp_series(double r)
{
    const double r2 = r * r;
    const double r4 = r2 * r2;
    const double a = pneudrive_fma(r, 0.16666666666666688, 0.5);
    const double b = pneudrive_fma(r, 0.008333333333312968, 0.041666666666666845);
    const double c = pneudrive_fma(r, 0.00019841269906226377, 0.0013888888888757118);
    const double d = pneudrive_fma(r, 2.755722527339955e-6, 2.4801587629880453e-5);
    const double e = pneudrive_fma(r, 2.5115290710818624e-8, 2.755697883627742e-7);
    const double top = pneudrive_fma(r2, 2.101427460532362e-9, e);
    return pneudrive_fma(r4, pneudrive_fma(r4, top, pneudrive_fma(r2, d, c)), pneudrive_fma(r2, b, a));
}

static inline double pneudrive_exp_sum(double x, double lo)
{
    double most = 710.0 < x ? 710.0 : x;
    pneudrive_reduced own;
    pneudrive_two one;
    double fraction;
    uint64_t half;
    most = most < -746.0 ? -746.0 : most;
    own = pneudrive_reduce_exponent(most, lo);
    one = pneudrive_two_sum(1.0, own.r);
    fraction = one.hi + pneudrive_fma(own.r * own.r, pneudrive_exp_series(own.r), pneudrive_fma(one.hi, own.r_lo, one.lo));
    half = own.twice_bias >> 1;
    return fraction * pneudrive_number(half << 52) * pneudrive_number((own.twice_bias - half) << 52);
}

static inline double pneudrive_exp(double x)
{
    return pneudrive_exp_sum(x, 0.0);
}

/* x = 2^hi lo, sqrt(1/2) <= lo < sqrt(2). */
static inline pneudrive_two pneudrive_split(double x)
{
    const uint64_t half = UINT64_C(0x3fe6a09e667f3bcd);
    const int subnormal = x < 0x1p-1022;
    const double scaled = subnormal ? x * 18014398509481984.0 : x;
    const double offset = 4503599627370496.0 + (subnormal ? 1077.0 : 1023.0);
    const uint64_t bits = pneudrive_bits(scaled) + ((UINT64_C(1023) << 52) - half);
    pneudrive_two split;
    split.hi = pneudrive_number((bits >> 52) | pneudrive_bits(4503599627370496.0)) - offset;
    split.lo = pneudrive_number((bits & ((UINT64_C(1) << 52) - 1)) + half);
    return split;
}

static inline double pneudrive_ln_limits(double x, double finite)
{
    const double positive = x == pneudrive_infinity() ? pneudrive_infinity() : finite;
    const double not_zero = x > 0.0 ? positive : pneudrive_nan();
    return x == 0.0 ? -pneudrive_infinity() : not_zero;
}

static inline double pneudrive_ln(double x)
{
    const pneudrive_two split = pneudrive_split(x);
    const double k = split.hi;
    const double f = split.lo - 1.0;
    const double s = f / (2.0 + f);
    const double z = s * s;
    const double z2 = z * z;
    const double a = pneudrive_fma(z, 0.3999999999941432, 0.6666666666666734);
    const double b = pneudrive_fma(z, 0.22222198563497938, 0.28571428742474725);
    const double c = pneudrive_fma(z, 0.15314035847062213, 0.18183564866130517);
    const double top = pneudrive_fma(z2, 0.14796105406334175, c);
    const double series = pneudrive_fma(z2, pneudrive_fma(z2, top, b), a);
    const double half_square = 0.5 * f * f;
    const pneudrive_two sum = pneudrive_two_sum(k * PNEUDRIVE_LN_2_HI, f);
    const double small = pneudrive_fma(k, PNEUDRIVE_LN_2_LO, s * pneudrive_fma(z, series, half_square));
    return pneudrive_ln_limits(x, sum.hi + (sum.lo + (small - half_square)));
}

static inline double pneudrive_ln_series(double z)
{
    const double z2 = z * z;
    const double a = pneudrive_fma(z, 0.2857142857144511, 0.3999999999999998);
    const double b = pneudrive_fma(z, 0.18181818870314928, 0.2222222221753646);
    const double c = pneudrive_fma(z, 0.13336317420387295, 0.15384556870974792);
    const double d = pneudrive_fma(z, 0.1198901360878375, 0.11674818467178981);
    return pneudrive_fma(z2 * z2, pneudrive_fma(z2, d, c), pneudrive_fma(z2, b, a));
}

static inline pneudrive_two pneudrive_ln_two(double x)
{
    const double two_thirds = 2.0 / 3.0;
    const double two_thirds_lo = 3.700743415417188e-17;
    const pneudrive_two split = pneudrive_split(x);
    const double k = split.hi;
    const double m = split.lo;
    const double f = m - 1.0;
    const pneudrive_two d = pneudrive_two_sum(1.0, m);
    const double reciprocal = 1.0 / d.hi;
    const double s = f * reciprocal;
    const double s_lo = pneudrive_fma(s, -d.lo, pneudrive_fma(s, -d.hi, f)) * reciprocal;
    const pneudrive_two z = pneudrive_two_product(s, s);
    const double z_lo = pneudrive_fma(2.0 * s, s_lo, z.lo);
    const double series = pneudrive_ln_series(z.hi);
    const pneudrive_two bracket = pneudrive_two_sum(two_thirds, z.hi * series);
    const double bracket_lo = bracket.lo + pneudrive_fma(z_lo, series, two_thirds_lo);
    const pneudrive_two v = pneudrive_two_product(z.hi, bracket.hi);
    const double v_lo = pneudrive_fma(z.hi, bracket_lo, pneudrive_fma(z_lo, bracket.hi, v.lo));
    const pneudrive_two w = pneudrive_two_product(s, v.hi);
    const double w_lo = pneudrive_fma(s, v_lo, pneudrive_fma(s_lo, v.hi, w.lo));
    const pneudrive_two one_f = pneudrive_two_sum(2.0 * s, w.hi);
    const pneudrive_two sum = pneudrive_two_sum(k * PNEUDRIVE_LN_2_HI, one_f.hi);
    pneudrive_two ln;
    ln.hi = pneudrive_ln_limits(x, sum.hi);
    ln.lo = sum.lo + (pneudrive_fma(k, PNEUDRIVE_LN_2_LO, one_f.lo) + pneudrive_fma(2.0, s_lo, w_lo));
    return ln;
}

static inline double pneudrive_pow(double x, double y)
{
    const pneudrive_two l = pneudrive_ln_two(x);
    const pneudrive_two p = pneudrive_two_product(y, l.hi);
    const double sum = pneudrive_fma(y, l.lo, p.lo);
    const double lo = pneudrive_magnitude(p.hi) < 800.0 ? sum : 0.0;
    const double power = pneudrive_exp_sum(p.hi, lo);
    return ((y == 0.0) | (x == 1.0)) ? 1.0 : power;
}

/* sin(|x| + quarter_turns pi/2). */
static inline double pneudrive_sin_turned(double magnitude, uint64_t quarter_turns)
{
    const double shifted = pneudrive_fma(magnitude, 0x1.45f306dc9c883p-1, PNEUDRIVE_ROUNDER);
    const double k = shifted - PNEUDRIVE_ROUNDER;
    const double coarse = pneudrive_fma(k, -0x1.921fb54442d18p+0, magnitude);
    const pneudrive_two mid = pneudrive_two_product(k, -6.123233995736766e-17);
    const pneudrive_two reduced = pneudrive_two_sum(coarse, mid.hi);
    const double r = reduced.hi;
    const double r_lo = pneudrive_fma(k, 1.4973849048591698e-33, reduced.lo + mid.lo);
    const double z = r * r;
    const double z2 = z * z;
    const double half = -0.5 * r;
    const double one = pneudrive_fma(half, r, 1.0);
    const double one_lo = pneudrive_fma(half, r, 1.0 - one);
    const uint64_t quadrant = pneudrive_bits(shifted) + quarter_turns;
    double a = pneudrive_fma(z, 0.008333333333322316, -0.16666666666666632);
    double b = pneudrive_fma(z, 2.7557313662052863e-6, -0.00019841269829725191);
    double c = pneudrive_fma(z, 1.5896504905294936e-10, -2.505075326380582e-8);
    double series = pneudrive_fma(z2, pneudrive_fma(z2, c, b), a);
    const double sine = r + pneudrive_fma(r * z, series, pneudrive_fma(-0.5 * z, r_lo, r_lo));
    double cosine;
    double value;
    a = pneudrive_fma(z, -0.001388888888887399, 0.0416666666666666);
    b = pneudrive_fma(z, -2.7557314326029046e-7, 2.4801587289394925e-5);
    c = pneudrive_fma(z, -1.1359448664257768e-11, 2.0875719558431115e-9);
    series = pneudrive_fma(z2, pneudrive_fma(z2, c, b), a);
    cosine = one + pneudrive_fma(z2, series, pneudrive_fma(r_lo, -r, one_lo));
    value = (quadrant & 1) == 0 ? sine : cosine;
    value = pneudrive_number(pneudrive_bits(value) ^ ((quadrant & 2) << 62));
    return magnitude < 4294967296.0 ? value : pneudrive_nan();
}

static inline double pneudrive_sin(double x)
{
    const double value = pneudrive_sin_turned(pneudrive_magnitude(x), 0);
    return pneudrive_number(pneudrive_bits(value) ^ (pneudrive_bits(x) & PNEUDRIVE_SIGN));
}

static inline double pneudrive_cos(double x)
{
    return pneudrive_sin_turned(pneudrive_magnitude(x), 1);
}

static inline double pneudrive_tanh(double x)
{
    const double magnitude = pneudrive_magnitude(x);
    const double twice = 2.0 * (magnitude > 22.0 ? 22.0 : magnitude);
    const pneudrive_reduced own = pneudrive_reduce_exponent(twice, 0.0);
    const double scale = pneudrive_number((own.twice_bias - 1023) << 52);
    const pneudrive_two hi = pneudrive_two_sum(scale - 1.0, scale * own.r);
    const double tail = pneudrive_fma(own.r * own.r, pneudrive_exp_series(own.r), own.r_lo);
    const pneudrive_two e = pneudrive_two_sum(hi.hi, pneudrive_fma(scale, tail, hi.lo));
    const pneudrive_two d = pneudrive_two_sum(2.0, e.hi);
    const int near_one = e.hi > 16.0;
    const double quotient = (near_one ? 2.0 : e.hi) / d.hi;
    const double remainder = pneudrive_fma(quotient, -d.hi, e.hi) + pneudrive_fma(quotient, -(d.lo + e.lo), e.lo);
    const double corrected = pneudrive_fma(remainder, pneudrive_fma(-0.5, quotient, 0.5), quotient);
    const double value = near_one ? 1.0 - quotient : corrected;
    return pneudrive_number(pneudrive_bits(value) ^ (pneudrive_bits(x) & PNEUDRIVE_SIGN));
}

#endif
