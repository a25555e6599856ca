//! Elementary functions on `f64`: the same bits on every machine, and vectorisable by the compiler.
//!
//! The libm functions of operating systems differ in the last bits, and a call into them cannot be vectorised. The
//! functions here use only operations that IEEE 754 rounds correctly (+, -, *, /, fused multiply-add) and integer
//! operations on the bits. Their order is fixed. A choice is a select on values, never a jump. A loop over an array
//! therefore becomes vector code with the scalar's bits. Only the sign and payload of a NaN depend on the machine.
//!
//! Conventions of this file:
//!
//! * `ulp`: distance between the two doubles around the exact result.
//! * `hi`, `lo`: an unevaluated sum of the rounded value and its rounding error.
//! * `k`: the integer removed by a range reduction, as a double.
//!
//! The polynomials are minimax fits of this project: a Remez exchange in 60-digit arithmetic with fixed leading terms,
//! and coefficients rounded to double afterwards. Each doc block states the interval and the error of the fit. Errors
//! "measured" are bounds, rounded up, on 20 million arguments against 113-bit arithmetic. The methods are range
//! reduction and error-free transforms.

use crate::real::Real;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, LN_2, LOG2_E};

/// Constant 1.5 * 2^52. A sum with this constant has no bits for a fraction. The sum is rounded to an integer, which is
/// then in
/// the lowest bits
/// of the sum. Holds for |x| < 2^51.
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// 2^52: or-ing an integer < 2^52 into its bits makes 2^52 + that integer. This converts an integer to a double in
/// vector code too, for which AVX2 has no instruction.
const TWO_52: f64 = 4_503_599_627_370_496.0;
const TWO_54: f64 = 18_014_398_509_481_984.0;
const FRACTION_BITS: u32 = 52;
const FRACTION_MASK: u64 = (1 << FRACTION_BITS) - 1;
const EXPONENT_BIAS: u64 = 1023;
const SIGN_MASK: u64 = 1 << 63;
/// 2^32 rad: the reduction is verified up to this value. Beyond it, `sin` and `cos` return NaN, because an angle of
/// this size is a mistake.
const ANGLE_LIMIT: f64 = 4_294_967_296.0;

/// Numbers with accessible bits: one double, or a register of them.
pub trait Bits: Real {
    /// The bits of each as an integer.
    type Word: Copy;
    /// The bits.
    fn word(self) -> Self::Word;
    /// The integers plus `n`, modulo 2^64.
    fn plus(word: Self::Word, n: u64) -> Self::Word;
    /// The integers in two parts each, the first half of it rounded down.
    fn halves(word: Self::Word) -> [Self::Word; 2];
    /// 2^(biased - 1023) of each.
    fn power_of_two(biased: Self::Word) -> Self;
}

impl Bits for f64 {
    type Word = u64;
    #[inline(always)]
    fn word(self) -> u64 {
        self.to_bits()
    }
    #[inline(always)]
    fn plus(word: u64, n: u64) -> u64 {
        word.wrapping_add(n)
    }
    #[inline(always)]
    fn halves(word: u64) -> [u64; 2] {
        [word >> 1, word - (word >> 1)]
    }
    #[inline(always)]
    fn power_of_two(biased: u64) -> f64 {
        f64::from_bits(biased << FRACTION_BITS)
    }
}

/// ln 2 in two parts. The first has 12 trailing zero bits, so that k * LN_2_HI is exact for every
/// exponent k of a double.
const LN_2_HI: f64 = f64::from_bits(LN_2.to_bits() & !0xFFF);
/// ln 2 - LN_2_HI, rounded.
const LN_2_LO: f64 = 2.823_529_056_303_157_7e-13;

/// a * b rounded to an integer: (as a double, bits whose lowest ones are that integer).
#[inline(always)]
fn round_product<T: Bits>(a: T, b: T) -> (T, T::Word) {
    let shifted = a.fma(b, T::c(ROUNDER));
    (shifted - T::c(ROUNDER), shifted.word())
}

/// (hi, lo) = a + b exactly, for |a| >= |b|, or a a multiple of the last bit of b.
#[inline(always)]
fn fast_two_sum<T: Bits>(a: T, b: T) -> (T, T) {
    let hi = a + b;
    (hi, b - (hi - a))
}

/// (hi, lo) = a * b exactly.
#[inline(always)]
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let hi = a * b;
    (hi, a.mul_add(b, -hi))
}

/// exp(hi + lo) = 2^k exp(r + r_lo), |r| <= 0.3466, |r_lo| <= ulp(r)/2.
/// Returns (r, r_lo, k + 2046).
#[inline(always)]
fn reduce_exponent<T: Bits>(hi: T, lo: T) -> (T, T, T::Word) {
    const TWICE_BIAS: u64 = (2 * EXPONENT_BIAS).wrapping_sub(ROUNDER.to_bits());
    let (k, bits) = round_product(hi, T::c(LOG2_E));
    let coarse = k.fma_c(-LN_2_HI, hi); // exact
    let (r, r_lo) = fast_two_sum(coarse, k.fma_c(-LN_2_LO, lo));
    (r, r_lo, T::plus(bits, TWICE_BIAS))
}

/// q(r) with exp(r) = 1 + r + r^2 q(r) for |r| <= 0.3466; the error of the fit is 2^-63 of exp(r).
#[inline(always)]
fn exp_series<T: Bits>(r: T) -> T {
    let pair = |slope: f64, value: f64| r.fma_c(slope, T::c(value));
    let r2 = r * r;
    let r4 = r2 * r2;
    let a = pair(0.166_666_666_666_666_88, 0.5);
    let b = pair(0.008_333_333_333_312_968, 0.041_666_666_666_666_845);
    let c = pair(0.000_198_412_699_062_263_77, 0.001_388_888_888_875_711_8);
    let d = pair(2.755_722_527_339_955e-6, 2.480_158_762_988_045_3e-5);
    let e = pair(2.511_529_071_081_862_4e-8, 2.755_697_883_627_742e-7);
    let top = r2.fma_c(2.101_427_460_532_362e-9, e);
    r4.fma(r4.fma(top, r2.fma(d, c)), r2.fma(b, a))
}

/// exp(x + lo), |lo| <= ulp(x): the one body of `exp` and `pow`.
#[inline(always)]
fn exp_sum<T: Bits>(x: T, lo: T) -> T {
    // Beyond these bounds the result is inf or 0 in any case. Inside them, k fits two exponents. The comparison is
    // written so that a NaN fails it and stays.
    let x = T::select(T::c(710.0).lt(x), T::c(710.0), x);
    let x = T::select(x.lt(T::c(-746.0)), T::c(-746.0), x);
    let (r, r_lo, twice_bias) = reduce_exponent(x, lo);
    let (one, one_lo) = fast_two_sum(T::one(), r);
    let fraction = one + (r * r).fma(exp_series(r), one.fma(r_lo, one_lo));
    // 2^k in two factors, as k reaches from -1076 to 1024 and an exponent from -1022 to 1023.
    let [half, rest] = T::halves(twice_bias);
    fraction * T::power_of_two(half) * T::power_of_two(rest)
}

/// exp(x).
///
///   `exp(x) = 2^k exp(r),  k = round(x / ln 2),  r = x - k ln 2 in two doubles`
///   exp(r) = 1 + r + r^2 q(r), the sum 1 + r kept exactly until the last addition
///
/// Range: all doubles. exp(0) = 1 exactly. The result is inf above 709.7827, subnormal below -708.4 (gradual
/// underflow), 0 below -745.14, and NaN for NaN. Error: 0.65 ulp measured; a subnormal result is rounded twice, 0.9
/// ulp.
#[inline(always)]
pub fn exp<T: Bits>(x: T) -> T {
    exp_sum(x, T::zero())
}

/// x = 2^k m, sqrt(1/2) <= m < sqrt(2), for finite x > 0 (subnormal included). Returns (k, m).
#[inline(always)]
fn split(x: f64) -> (f64, f64) {
    // The exponent steps at sqrt(1/2) instead of at 1, so that ln(x) near 1 has k = 0.
    const SQRT_HALF: u64 = std::f64::consts::FRAC_1_SQRT_2.to_bits();
    const SHIFT: u64 = (EXPONENT_BIAS << FRACTION_BITS) - SQRT_HALF;
    let subnormal = x < f64::MIN_POSITIVE;
    let scaled = if subnormal { x * TWO_54 } else { x };
    let offset = if subnormal { TWO_52 + 1077.0 } else { TWO_52 + 1023.0 };
    let bits = scaled.to_bits().wrapping_add(SHIFT);
    let k = f64::from_bits((bits >> FRACTION_BITS) | TWO_52.to_bits()) - offset;
    (k, f64::from_bits((bits & FRACTION_MASK) + SQRT_HALF))
}

/// `finite` for 0 < x < inf, and the limits outside: -inf at 0, inf at inf, NaN for x < 0 and NaN.
#[inline(always)]
fn ln_limits(x: f64, finite: f64) -> f64 {
    let positive = if x == f64::INFINITY { f64::INFINITY } else { finite };
    let not_zero = if x > 0.0 { positive } else { f64::NAN };
    if x == 0.0 { f64::NEG_INFINITY } else { not_zero }
}

/// ln(x).
///
///   `x = 2^k (1 + f),  s = f / (2 + f),  z = s^2`
///   `ln(1 + f) = 2 artanh(s) = f - f^2/2 + s (f^2/2 + z R(z)),  z <= 0.0295`
///   `ln(x) = k ln 2 + ln(1 + f), the sum of k ln 2 (high part) and f kept exactly`
///
/// Range: all positive doubles, including subnormal ones. ln(1) = 0 exactly, ln(0) = ln(-0) = -inf, and
/// ln(inf) = inf. Negative x and NaN give NaN. Fit of R: 2^-59.5 of ln(1 + f).
/// Error: 0.85 ulp measured.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
    let (k, m) = split(x);
    let f = m - 1.0; // exact, as 1/2 <= m <= 2
    let s = f / (2.0 + f);
    let z = s * s;
    let z2 = z * z;
    let a = z.mul_add(0.399_999_999_994_143_2, 0.666_666_666_666_673_4);
    let b = z.mul_add(0.222_221_985_634_979_38, 0.285_714_287_424_747_25);
    let c = z.mul_add(0.153_140_358_470_622_13, 0.181_835_648_661_305_17);
    let top = z2.mul_add(0.147_961_054_063_341_75, c);
    let series = z2.mul_add(z2.mul_add(top, b), a);
    let half_square = 0.5 * f * f;
    let (hi, lo) = fast_two_sum(k * LN_2_HI, f);
    let small = k.mul_add(LN_2_LO, s * z.mul_add(series, half_square));
    ln_limits(x, hi + (lo + (small - half_square)))
}

/// ln(x) as hi + lo, relative error 2^-63.9, for finite x > 0. For other x, hi is that of `ln`.
///
///   `ln(1 + f) = 2 s + s z (2/3 + z R(z)),  with s, z, the bracket and the products in two doubles`
#[inline(always)]
fn ln_two(x: f64) -> (f64, f64) {
    const TWO_THIRDS: f64 = 2.0 / 3.0;
    const TWO_THIRDS_LO: f64 = 3.700_743_415_417_188e-17;
    let (k, m) = split(x);
    let f = m - 1.0; // exact, as 1/2 <= m <= 2
    let (d, d_lo) = fast_two_sum(1.0, m);
    let reciprocal = 1.0 / d;
    let s = f * reciprocal;
    let s_lo = s.mul_add(-d_lo, s.mul_add(-d, f)) * reciprocal;
    let (z, z_rounding) = two_product(s, s);
    let z_lo = (2.0 * s).mul_add(s_lo, z_rounding);
    let series = ln_series(z);
    let (bracket, rounding) = fast_two_sum(TWO_THIRDS, z * series);
    let bracket_lo = rounding + z_lo.mul_add(series, TWO_THIRDS_LO);
    let (v, v_rounding) = two_product(z, bracket);
    let v_lo = z.mul_add(bracket_lo, z_lo.mul_add(bracket, v_rounding));
    let (w, w_rounding) = two_product(s, v);
    let w_lo = s.mul_add(v_lo, s_lo.mul_add(v, w_rounding));
    let (one_f, one_f_lo) = fast_two_sum(2.0 * s, w);
    let (hi, hi_rounding) = fast_two_sum(k * LN_2_HI, one_f);
    let lo = hi_rounding + (k.mul_add(LN_2_LO, one_f_lo) + 2.0f64.mul_add(s_lo, w_lo));
    (ln_limits(x, hi), lo)
}

/// R(z) with 2 artanh(s) / s = 2 + z (2/3 + z R(z)), z = s^2 <= 0.0295; fit 2^-73 of artanh.
#[inline(always)]
fn ln_series(z: f64) -> f64 {
    let z2 = z * z;
    let a = z.mul_add(0.285_714_285_714_451_1, 0.399_999_999_999_999_8);
    let b = z.mul_add(0.181_818_188_703_149_28, 0.222_222_222_175_364_6);
    let c = z.mul_add(0.133_363_174_203_872_95, 0.153_845_568_709_747_92);
    let d = z.mul_add(0.119_890_136_087_837_5, 0.116_748_184_671_789_81);
    (z2 * z2).mul_add(z2.mul_add(d, c), z2.mul_add(b, a))
}

/// x to the power y, for x >= 0.
///
///   `pow(x, y) = exp(y ln x), with ln x and the product in two doubles`
///
/// Range: x >= 0 and all y. pow(x, 0) = 1 and pow(1, y) = 1 for every x and y, including NaN, as in IEEE 754. pow(x, 1)
/// = x. pow(0, y > 0) = 0 and pow(0, y < 0) = inf. x < 0 gives NaN, even for integer y: laws with a signed power write
/// |x|^y and the sign. Overflow to inf and
/// gradual underflow as in `exp`.
/// Error: 0.75 ulp measured.
#[inline(always)]
pub fn pow(x: f64, y: f64) -> f64 {
    let (l, l_lo) = ln_two(x);
    let (p, p_rounding) = two_product(y, l);
    let p_lo = y.mul_add(l_lo, p_rounding);
    // Beyond the range of exp, the low part is NaN (inf - inf).
    let p_lo = if p.abs() < 800.0 { p_lo } else { 0.0 };
    let power = exp_sum(p, p_lo);
    if (y == 0.0) | (x == 1.0) { 1.0 } else { power }
}

/// |x| = k pi/2 + r + r_lo for |x| < ANGLE_LIMIT.
/// Returns (r, r_lo, bits whose lowest two are k mod 4).
///
/// The constant is pi/2 in three doubles (161 bits). The difference |x| - k FRAC_PI_2 is exact in one fused multiply-add, because both terms are
/// multiples of 2^-53 and the difference is below 1. The second product is split exactly, so that a difference with
/// cancellation keeps its digits.
#[inline(always)]
fn reduce_angle(magnitude: f64) -> (f64, f64, u64) {
    const FRAC_PI_2_MID: f64 = 6.123_233_995_736_766e-17;
    const FRAC_PI_2_LO: f64 = -1.497_384_904_859_169_8e-33;
    let (k, bits) = round_product(magnitude, FRAC_2_PI);
    let coarse = k.mul_add(-FRAC_PI_2, magnitude);
    let (mid, mid_rounding) = two_product(k, -FRAC_PI_2_MID);
    let (r, rounding) = fast_two_sum(coarse, mid);
    (r, k.mul_add(-FRAC_PI_2_LO, rounding + mid_rounding), bits)
}

/// sin(r + r_lo) and cos(r + r_lo) for |r| <= pi/4.
///
///   `sin r = r + r z S(z),  cos r = 1 - z/2 + z^2 C(z),  z = r^2`
///   `sin(r + r_lo) = sin r + r_lo cos r,  cos(r + r_lo) = cos r - r_lo r`
///
/// Fits: S 2^-58 of sin r, C 2^-64. 1 - z/2 is kept exactly until the last addition.
#[inline(always)]
fn sin_cos_reduced(r: f64, r_lo: f64) -> (f64, f64) {
    let z = r * r;
    let z2 = z * z;
    let a = z.mul_add(0.008_333_333_333_322_316, -0.166_666_666_666_666_32);
    let b = z.mul_add(2.755_731_366_205_286_3e-6, -0.000_198_412_698_297_251_91);
    let c = z.mul_add(1.589_650_490_529_493_6e-10, -2.505_075_326_380_582e-8);
    let series = z2.mul_add(z2.mul_add(c, b), a);
    let low_cos = (-0.5 * z).mul_add(r_lo, r_lo);
    let sin = r + (r * z).mul_add(series, low_cos);

    let a = z.mul_add(-0.001_388_888_888_887_399, 0.041_666_666_666_666_6);
    let b = z.mul_add(-2.755_731_432_602_904_6e-7, 2.480_158_728_939_492_5e-5);
    let c = z.mul_add(-1.135_944_866_425_776_8e-11, 2.087_571_955_843_111_5e-9);
    let series = z2.mul_add(z2.mul_add(c, b), a);
    let half = -0.5 * r;
    let one = half.mul_add(r, 1.0);
    let one_lo = half.mul_add(r, 1.0 - one);
    let cos = one + z2.mul_add(series, r_lo.mul_add(-r, one_lo));
    (sin, cos)
}

/// sin(|x| + quarter_turns pi/2).
#[inline(always)]
fn sin_turned(magnitude: f64, quarter_turns: u64) -> f64 {
    let (r, r_lo, bits) = reduce_angle(magnitude);
    let (sin, cos) = sin_cos_reduced(r, r_lo);
    let quadrant = bits.wrapping_add(quarter_turns);
    let value = if quadrant & 1 == 0 { sin } else { cos };
    let signed = f64::from_bits(value.to_bits() ^ ((quadrant & 2) << 62));
    if magnitude < ANGLE_LIMIT { signed } else { f64::NAN }
}

/// sin(x), x in rad.
///
///   `|x| = k pi/2 + r,  sin |x| = +-sin r for even k, +-cos r for odd k,  sin(-x) = -sin(x)`
///
/// Range: |x| < 2^32; beyond it, at inf and NaN the result is NaN. sin(-0) = -0.
/// Error: 0.81 ulp measured over the whole range, multiples of pi/2 included.
#[inline(always)]
pub fn sin(x: f64) -> f64 {
    let value = sin_turned(x.abs(), 0);
    f64::from_bits(value.to_bits() ^ (x.to_bits() & SIGN_MASK))
}

/// cos(x), x in rad: cos(x) = sin(|x| + pi/2).
///
/// Range: |x| < 2^32; beyond it, at inf and NaN the result is NaN. cos(0) = 1.
/// Error: 0.81 ulp measured over the whole range, multiples of pi/2 included.
#[inline(always)]
pub fn cos(x: f64) -> f64 {
    sin_turned(x.abs(), 1)
}

/// tanh(x).
///
///   `E = exp(2 |x|) - 1 = (2^k - 1) + 2^k (r + r^2 q(r))`
///   `tanh |x| = E / (E + 2) = Q,  and 1 - 2 / (E + 2) where E > 16`
///
/// No cancellation at small x, where k = 0. The rounding errors of E, E + 2 and the quotient are corrected to first
/// order, with 1 / (E + 2) = (1 - Q) / 2. The second form does not need this.
///
/// Range: all doubles. The function is odd bit for bit, with tanh(-0) = -0. It is exactly +-1 from |x| = 19.07. NaN
/// gives NaN. Error: 0.97 ulp measured.
#[inline(always)]
pub fn tanh(x: f64) -> f64 {
    let magnitude = x.abs();
    let twice = 2.0 * if magnitude > 22.0 { 22.0 } else { magnitude };
    let (r, r_lo, twice_bias) = reduce_exponent(twice, 0.0);
    let scale = f64::power_of_two(twice_bias - EXPONENT_BIAS);
    let (hi, hi_rounding) = fast_two_sum(scale - 1.0, scale * r);
    let tail = (r * r).mul_add(exp_series(r), r_lo);
    let (e, e_lo) = fast_two_sum(hi, scale.mul_add(tail, hi_rounding));
    let (d, d_rounding) = fast_two_sum(2.0, e);
    let near_one = e > 16.0;
    let quotient = if near_one { 2.0 } else { e } / d;
    let remainder = quotient.mul_add(-d, e) + quotient.mul_add(-(d_rounding + e_lo), e_lo);
    let corrected = remainder.mul_add((-0.5f64).mul_add(quotient, 0.5), quotient);
    let value = if near_one { 1.0 - quotient } else { corrected };
    f64::from_bits(value.to_bits() ^ (x.to_bits() & SIGN_MASK))
}
