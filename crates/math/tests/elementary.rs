//! Accuracy and special values of the elementary functions.
//!
//! Every function stays within the error that its doc block states, measured in units in the last
//! place (ulp) against a second route: Taylor series in double-double arithmetic (106 bits), which
//! shares no code and no reduction with the product. That route is itself held to values computed
//! by mpmath at 200 bits. Bits must not depend on the machine, nor on vectorisation: a fingerprint
//! of the results is committed, and arrays are compared with scalars.

use math::elementary::{cos, exp, ln, pow, sin, tanh};
use oracle::{Exact, ulps};
use std::hint::black_box;

const SAMPLES: u64 = 40_000;
const INF: f64 = f64::INFINITY;
const NAN: f64 = f64::NAN;

/// A function of one argument, the error in ulp that its doc block states, and the second route.
struct Function(&'static str, fn(f64) -> f64, f64, fn(f64) -> Exact);

const EXP: Function = Function("exp", exp, 0.65, |x| oracle::exp(x.into()));
const LN: Function = Function("ln", ln, 0.85, |x| oracle::ln(x).into());
const SIN: Function = Function("sin", sin, 0.81, |x| oracle::sin(x, 0).into());
const COS: Function = Function("cos", cos, 0.81, |x| oracle::sin(x, 1).into());
const TANH: Function = Function("tanh", tanh, 0.97, |x| oracle::tanh(x).into());
const POW_BOUND: f64 = 0.75;

/// Arguments where a reduction loses most or whose result lies next to the middle of two doubles,
/// and the correctly rounded results (mpmath 1.3, 200 bits). Rows:
/// (x, f(x)), (x, sin x, cos x), (x, y, x^y).
#[rustfmt::skip]
#[allow(clippy::approx_constant)] // what mpmath printed, not constants
mod table {
    pub const EXP: &[(f64, f64)] = &[
        (-5.551115123125783e-17, 1.0), (1.1102230246251565e-16, 1.0000000000000002),
        (0.3465735902799727, 1.4142135623730951), (-0.34657359027997264, 0.7071067811865476),
        (-185.41118830946755, 2.99877605288848e-81), (709.78, 1.7928227943945155e308),
        (-708.39, 2.2394014988804677e-308), (0.2370612780786594, 1.2675187865114659),
        (-12.555406123713674, 3.5257896813421623e-6),
    ];
    pub const LN: &[(f64, f64)] = &[
        (5e-324, -744.4400719213812), (2.2250738585072014e-308, -708.3964185322641),
        (1.0000000000000002, 2.2204460492503128e-16),
        (0.9999999999999999, -1.1102230246251565e-16), (0.7071067811865475, -0.34657359027997275),
        (1.4142135623730951, 0.3465735902799727), (0.7052923033456738, -0.3491429474240672),
        (1.4038221144735996, 0.3391985984837335), (1.7976931348623157e308, 709.782712893384),
        (21.922892616353472, 3.0875314157984244),
    ];
    pub const TANH: &[(f64, f64)] = &[
        (5e-324, 5e-324), (7.450580596923828e-9, 7.450580596923828e-9),
        (0.1732867951399863, 0.17157287525380988), (0.17679647744292382, 0.1749771782216541),
        (1.416606672028109, 0.8888888888888891), (5.0, 0.9999092042625951),
        (18.826601581443143, 0.9999999999999999), (19.061547465398494, 0.9999999999999999),
        (19.0615474653985, 1.0),
    ];
    pub const SIN_COS: &[(f64, f64, f64)] = &[
        (0.7853981633974483, 0.7071067811865475, 0.7071067811865476),
        (1.5707963267948968, 1.0, -1.6081226496766366e-16),
        (45.553093477052, 1.0, -6.189806365883577e-19),
        (11661.591930125313, 1.5845904296661957e-16, 1.0),
        (46066.74387591393, -1.0, 1.3593070393188837e-16),
        (99999.0, 0.860248280789742, -0.5098753724179009),
        (44523.41800798059, 0.6939217157691194, 0.720050451276882),
        (14461176.67027838, -1.0, -1.6985038298986004e-18),
        (1698673.2849629424, 1.0, -5.038136613397025e-17),
        (4294967295.9999995, -0.4619861566131461, -0.8868871354900879),
    ];
    pub const POW: &[(f64, f64, f64)] = &[
        (1.0000000000000002, 3e18, 1.98719262165461e289),
        (0.9999999999999999, -6e18, 1.987192621654831e289),
        (1.4040303267422953, 1984.596131857987, 3.0395488066368637e292),
        (0.7071067811865476, -2019.0, 7.758551062948431e303),
        (1.7976931348623157e308, 0.999, 8.840174632999172e307),
        (5e-324, -0.9, 9.45352569147208e290), (5e-324, 0.95, 7.229286294568597e-308),
        (0.5283, 0.2857142857142857, 0.8333415414611319),
        (1.0000000001, 7000000000000.0, 1.014290763491529e304),
    ];
}

/// Number i of a sequence in [low, high), the same on every machine.
fn sample(i: u64, low: f64, high: f64) -> f64 {
    let mut z = i.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    let unit = ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
    unit.mul_add(high - low, low)
}

/// A positive double of any size: its bits are drawn, not its value.
fn sample_any_size(i: u64) -> f64 {
    sample_between(i, f64::from_bits(1), f64::INFINITY)
}

/// The same between two of them.
fn sample_between(i: u64, low: f64, high: f64) -> f64 {
    f64::from_bits(sample(i, low.to_bits() as f64, high.to_bits() as f64) as u64)
}

impl Function {
    fn assert_at(&self, x: f64) {
        let &Function(name, value, bound, exact) = self;
        assert_within(bound, name, x, value(x), exact(x));
    }

    /// The oracle's 106 bits must round to the same double as mpmath's 200.
    fn assert_table(&self, x: f64, rounded: f64) {
        assert_within(0.5, "oracle", x, rounded, self.3(x));
        self.assert_at(x);
    }
}

fn assert_within(bound: f64, name: &str, x: f64, result: f64, exact: Exact) {
    let error = ulps(result, exact);
    assert!(error <= bound, "{name}({x:?}) = {result:?}: {error} ulp, not {bound}");
}

fn assert_pow_at(x: f64, y: f64) {
    let name = format!("y = {y:?}, pow");
    assert_within(POW_BOUND, &name, x, pow(x, y), oracle::pow(x, y));
}

fn assert_same_bits(name: &str, x: f64, result: f64, expected: f64) {
    let same = result.to_bits() == expected.to_bits() || (result.is_nan() && expected.is_nan());
    assert!(same, "{name}({x:?}) = {result:?}, expected {expected:?}");
}

#[test]
fn the_oracle_agrees_with_mpmath_and_so_do_the_functions() {
    for (function, table) in [(EXP, table::EXP), (LN, table::LN), (TANH, table::TANH)] {
        for &(x, rounded) in table {
            function.assert_table(x, rounded);
        }
    }
    for &(x, sin_x, cos_x) in table::SIN_COS {
        SIN.assert_table(x, sin_x);
        COS.assert_table(x, cos_x);
    }
    for &(x, y, rounded) in table::POW {
        assert_within(0.5, "oracle of pow", x, rounded, oracle::pow(x, y));
        assert_pow_at(x, y);
    }
}

#[test]
fn exp_keeps_its_error_over_the_whole_range() {
    for i in 0..SAMPLES {
        EXP.assert_at(sample(i, -708.3, 709.78));
        EXP.assert_at(sample(i, -0.7, 0.7));
        // A subnormal result is rounded a second time.
        let x = sample(i, -745.13, -708.3);
        assert_within(EXP.2 + 0.25, "exp", x, exp(x), oracle::exp(x.into()));
    }
}

#[test]
fn ln_keeps_its_error_at_every_size_and_next_to_one() {
    for i in 0..SAMPLES {
        LN.assert_at(sample(i, 0.5, 2.0));
        LN.assert_at(sample_any_size(i));
        LN.assert_at(f64::from_bits(1.0f64.to_bits() + 1 + i));
        LN.assert_at(f64::from_bits(1.0f64.to_bits() - 1 - i));
    }
}

#[test]
fn pow_keeps_its_error_for_results_of_every_size() {
    for i in 0..SAMPLES {
        for x in [sample(i, 0.5, 2.0), sample_any_size(i)] {
            // As far as the result stays normal.
            let largest = 700.0 / oracle::ln(x).0.abs();
            assert_pow_at(x, sample(i + SAMPLES, -largest, largest));
            assert_pow_at(x, sample(i + SAMPLES, -3.0, 3.0).clamp(-largest, largest));
        }
    }
}

#[test]
fn sin_and_cos_keep_their_error_where_the_reduction_cancels() {
    for i in 0..SAMPLES {
        let quarter_turns = sample(i, 1.0, 2.7e9).floor();
        let multiple = (quarter_turns * std::f64::consts::FRAC_PI_2).to_bits();
        for function in [SIN, COS] {
            function.assert_at(sample(i, -10.0, 10.0));
            function.assert_at(sample(i, -1e5, 1e5));
            function.assert_at(sample(i, -4e9, 4e9));
            function.assert_at(f64::from_bits(multiple + i % 3 - 1));
            function.assert_at(sample_any_size(i).min(1.0));
        }
    }
}

#[test]
fn tanh_keeps_its_error_from_the_smallest_numbers_to_saturation() {
    for i in 0..SAMPLES {
        TANH.assert_at(sample(i, -1.5, 1.5));
        TANH.assert_at(sample(i, -20.0, 20.0));
        TANH.assert_at(sample_any_size(i).min(30.0));
    }
}

#[test]
#[rustfmt::skip]
fn special_values() {
    type Case = (&'static str, fn(f64) -> f64, &'static [(f64, f64)]);
    let cases: [Case; 6] = [
        ("exp", exp, &[
            (0.0, 1.0), (-0.0, 1.0), (INF, INF), (-INF, 0.0), (NAN, NAN), (709.7827128933841, INF),
            (f64::MAX, INF), (-745.1332191019411, 5e-324), (-745.1332191019412, 0.0),
            (f64::MIN, 0.0),
        ]),
        ("ln", ln, &[
            (1.0, 0.0), (0.0, -INF), (-0.0, -INF), (INF, INF), (-1.0, NAN), (NAN, NAN),
        ]),
        ("sin", sin, &[(0.0, 0.0), (-0.0, -0.0), (4294967296.0, NAN), (INF, NAN), (NAN, NAN)]),
        ("cos", cos, &[(0.0, 1.0), (-0.0, 1.0), (4294967296.0, NAN), (-INF, NAN), (NAN, NAN)]),
        ("tanh", tanh, &[
            (0.0, 0.0), (-0.0, -0.0), (19.07, 1.0), (-19.07, -1.0), (f64::MAX, 1.0), (INF, 1.0),
            (-INF, -1.0), (5e-324, 5e-324), (NAN, NAN),
        ]),
        ("x^0, x = ", |x| pow(x, 0.0), &[(0.0, 1.0), (2.0, 1.0), (-2.0, 1.0), (NAN, 1.0)]),
    ];
    for (name, function, pairs) in cases {
        pairs.iter().for_each(|&(x, expected)| assert_same_bits(name, x, function(x), expected));
    }
}

#[test]
#[rustfmt::skip]
fn special_values_of_pow() {
    for (x, y, expected) in [
        (0.0, 0.5, 0.0), (-0.0, 2.0, 0.0), (0.0, -0.5, INF), (0.0, INF, 0.0), (0.0, -INF, INF),
        (1.0, INF, 1.0), (1.0, NAN, 1.0), (1.0, -1e300, 1.0), (2.0, INF, INF), (2.0, -INF, 0.0),
        (0.5, INF, 0.0), (0.5, -INF, INF), (INF, 0.5, INF), (INF, -0.5, 0.0), (NAN, 1.0, NAN),
        (2.0, NAN, NAN), (-1.0, 2.0, NAN), (-INF, 1.0, NAN), (2.0, 1024.0, INF), (2.0, 1e300, INF),
        (2.0, -1074.0, 5e-324), (2.0, -1076.0, 0.0), (0.5, 1e300, 0.0), (10.0, 22.0, 1e22),
        (4.0, 0.5, 2.0), (1e-320, 1.0, 1e-320),
    ] {
        assert_same_bits(&format!("y = {y:?}, pow"), x, pow(x, y), expected);
    }
}

/// Results of a loop over an array, which the compiler vectorises, against single calls.
macro_rules! assert_array_equals_scalar {
    ($function:ident, $block:expr) => {
        let block: [f64; 8] = black_box($block);
        let mut array = [0.0; 8];
        for (y, x) in array.iter_mut().zip(block) {
            *y = $function(x);
        }
        for (y, x) in black_box(array).into_iter().zip(block) {
            assert_same_bits(stringify!($function), x, y, $function(black_box(x)));
        }
    };
}

#[test]
fn an_array_gives_the_bits_of_its_elements() {
    const SPECIAL: [f64; 8] = [0.0, -0.0, 1.0, INF, -INF, NAN, 5e-324, f64::MAX];
    let root = |x: f64| pow(x, 0.2857);
    for i in 0..5000 {
        let mut block = [0, 1, 2, 3, 4, 5, 6, 7].map(|lane| sample(8 * i + lane, -30.0, 30.0));
        block[(i % 8) as usize] = SPECIAL[(i / 8 % 8) as usize];
        assert_array_equals_scalar!(exp, block);
        assert_array_equals_scalar!(ln, block.map(f64::abs));
        assert_array_equals_scalar!(sin, block);
        assert_array_equals_scalar!(cos, block);
        assert_array_equals_scalar!(tanh, block);
        assert_array_equals_scalar!(root, block.map(f64::abs));
    }
}

/// FNV-1a over the bits of 10 000 results.
fn fingerprint(low: f64, high: f64, function: impl Fn(f64) -> f64) -> u64 {
    (0..10_000).fold(0xCBF2_9CE4_8422_2325, |hash, i| {
        (hash ^ function(sample(i, low, high)).to_bits()).wrapping_mul(0x0100_0000_01B3)
    })
}

#[test]
fn bits_are_the_same_on_every_machine() {
    let root = |x| pow(x, 2.0 / 7.0);
    // A change here moves every trajectory: see "Numbers that move" in the changelog.
    assert_eq!(fingerprint(-745.0, 709.0, exp), 0xC975_0A4E_8CB1_9304);
    assert_eq!(fingerprint(0.01, 100.0, ln), 0x7546_710F_1868_D1A0);
    assert_eq!(fingerprint(0.01, 100.0, root), 0xAA6D_B4F4_A368_C400);
    assert_eq!(fingerprint(-100.0, 100.0, sin), 0xDE05_FAD4_9035_0024);
    assert_eq!(fingerprint(-100.0, 100.0, cos), 0x65BD_7A3B_3FB9_FA97);
    assert_eq!(fingerprint(-20.0, 20.0, tanh), 0x1557_40E2_444C_FF35);
}

#[test]
fn exp_undoes_ln() {
    for i in 0..SAMPLES {
        let x = sample_between(i, f64::MIN_POSITIVE, f64::INFINITY);
        // An error of one ulp in ln x is an error of |ln x| ulp in x.
        let bound = (ln(x).abs() + 1.0) * f64::EPSILON;
        assert!((exp(ln(x)) / x - 1.0).abs() <= bound, "{x:?}");
    }
}

#[test]
fn pow_agrees_with_products_and_roots() {
    let close = |a: f64, b: f64| (a / b - 1.0).abs() <= 2.0 * f64::EPSILON;
    for i in 0..SAMPLES {
        let x = sample_between(i, 2.0f64.powi(-511), 2.0f64.powi(511)); // the square is a normal number
        assert_same_bits("y = 1, pow", x, pow(x, 1.0), x);
        assert!(close(pow(x, 2.0), x * x), "{x:?}");
        assert!(close(pow(x, -1.0), 1.0 / x), "{x:?}");
        assert!(close(pow(x, 0.5), x.sqrt()), "{x:?}");
    }
}

#[test]
fn odd_and_even() {
    for i in 0..SAMPLES {
        let x = sample(i, -1e5, 1e5);
        assert_same_bits("sin", -x, sin(-x), -sin(x));
        assert_same_bits("cos", -x, cos(-x), cos(x));
        assert_same_bits("tanh", -x / 1e4, tanh(-x / 1e4), -tanh(x / 1e4));
        assert!(sin(x).abs() <= 1.0 && cos(x).abs() <= 1.0 && tanh(x / 1e4).abs() <= 1.0, "{x:?}");
    }
}

#[test]
fn trigonometric_identities() {
    for i in 0..SAMPLES {
        let x = sample(i, -1e5, 1e5);
        let (s, c) = (sin(x), cos(x));
        assert!((s.mul_add(s, c * c) - 1.0).abs() <= 2.0 * f64::EPSILON, "{x:?}");
        assert!((sin(2.0 * x) - 2.0 * s * c).abs() <= 2.0 * f64::EPSILON, "{x:?}");
        assert!((cos(2.0 * x) - (c - s) * (c + s)).abs() <= 4.0 * f64::EPSILON, "{x:?}");
    }
}

/// The second route: double-double numbers and series, slow and plain.
mod oracle {
    use std::f64::consts::{FRAC_PI_2, LN_2};
    use std::ops::{Add, Div, Mul, Sub};

    const LN_2_PARTS: [f64; 3] = [LN_2, 2.3190468138462996e-17, 5.707708438416212e-34];
    const FRAC_PI_2_PARTS: [f64; 3] = [FRAC_PI_2, 6.123233995736766e-17, -1.4973849048591698e-33];

    /// a - k (the sum of the parts).
    fn subtract_multiple(a: Pair, k: f64, parts: [f64; 3]) -> Pair {
        a - product(k, parts[0]) - product(k, parts[1]) - product(k, parts[2])
    }

    /// The sum of two doubles, the second below half an ulp of the first.
    #[derive(Clone, Copy)]
    pub struct Pair(pub f64, pub f64);

    fn sum(a: f64, b: f64) -> Pair {
        let hi = a + b;
        let b_part = hi - a;
        Pair(hi, (a - (hi - b_part)) + (b - b_part))
    }

    fn product(a: f64, b: f64) -> Pair {
        let hi = a * b;
        Pair(hi, a.mul_add(b, -hi))
    }

    impl From<f64> for Pair {
        fn from(hi: f64) -> Pair {
            Pair(hi, 0.0)
        }
    }

    macro_rules! operator {
        ($trait:ident, $method:ident, $a:ident, $b:ident, $value:expr) => {
            impl $trait for Pair {
                type Output = Pair;
                fn $method(self, $b: Pair) -> Pair {
                    let $a = self;
                    $value
                }
            }
        };
    }
    operator!(Add, add, a, b, {
        let (high, low) = (sum(a.0, b.0), sum(a.1, b.1));
        let first = sum(high.0, high.1 + low.0);
        sum(first.0, first.1 + low.1)
    });
    operator!(Sub, sub, a, b, a + Pair(-b.0, -b.1));
    operator!(Mul, mul, a, b, {
        let high = product(a.0, b.0);
        sum(high.0, high.1 + (a.0 * b.1 + a.1 * b.0))
    });
    operator!(Div, div, a, b, {
        let first = a.0 / b.0;
        let rest = a - b * first.into();
        let second = rest.0 / b.0;
        let rest = rest - b * second.into();
        sum(first, second) + (rest.0 / b.0).into()
    });

    /// value 2^exponent.
    pub struct Exact(Pair, i32);

    impl From<Pair> for Exact {
        fn from(value: Pair) -> Exact {
            Exact(value, 0)
        }
    }

    fn two_to(exponent: i32) -> f64 {
        f64::from_bits(u64::try_from(exponent + 1023).unwrap() << 52)
    }

    /// x 2^exponent, exact as long as the result is normal.
    fn scale(x: f64, exponent: i32) -> f64 {
        let half = exponent / 2;
        x * two_to(half) * two_to(exponent - half)
    }

    /// |result - exact| in ulp of the exact value.
    pub fn ulps(result: f64, exact: Exact) -> f64 {
        let Exact(Pair(hi, lo), exponent) = exact;
        // Bring the value near 1, so that nothing below is subnormal.
        let lift = if hi.abs() < two_to(-500) { 600 } else { 0 };
        let value = Pair(scale(hi, lift), scale(lo, lift));
        let exponent = exponent - lift;
        // Just below a power of two the ulp is half of that above it.
        let inside = value.0.to_bits() - u64::from(value.1 * value.0 < 0.0);
        let binade = ((inside >> 52) & 0x7FF) as i32 - 1023;
        let ulp = (binade + exponent - 52).max(-1074);
        let difference = Pair::from(scale(result, -exponent)) - value;
        (difference.0 / two_to(ulp - exponent)).abs()
    }

    /// (e^r - 1, k) with a = k ln 2 + r: Taylor on r/1024, then ten doublings of the argument.
    fn expm1_reduced(a: Pair) -> (Pair, i32) {
        let k = (a.0 / LN_2).round();
        let r = subtract_multiple(a, k, LN_2_PARTS);
        let small = Pair(r.0 / 1024.0, r.1 / 1024.0);
        let mut series = Pair::from(0.0);
        for n in (1..=12).rev() {
            series = (small + small * series) / f64::from(n).into();
        }
        for _ in 0..10 {
            series = series + series + series * series;
        }
        (series, k as i32)
    }

    pub fn exp(a: Pair) -> Exact {
        let (fraction, exponent) = expm1_reduced(a);
        Exact(fraction + 1.0.into(), exponent)
    }

    fn expm1(a: Pair) -> Pair {
        let (fraction, k) = expm1_reduced(a);
        let power = Pair::from(two_to(k));
        power * fraction + (power - 1.0.into())
    }

    /// One Newton step from a rough logarithm; the exponent is taken out by repeated doubling.
    pub fn ln(x: f64) -> Pair {
        let (mut m, mut k) = (x, 0.0);
        while m > 1.5 {
            (m, k) = (m / 2.0, k + 1.0);
        }
        while m < 0.75 {
            (m, k) = (m * 2.0, k - 1.0);
        }
        let rough = m.ln();
        let inverse = expm1(Pair::from(-rough));
        let m_minus_1 = sum(m, -1.0);
        let error = m_minus_1 + m_minus_1 * inverse + inverse; // m e^-rough - 1
        let ln_m = Pair::from(rough) + error - error * error * 0.5.into();
        subtract_multiple(ln_m, -k, LN_2_PARTS)
    }

    pub fn pow(x: f64, y: f64) -> Exact {
        exp(ln(x) * y.into())
    }

    pub fn tanh(x: f64) -> Pair {
        if x.abs() < 1e-100 {
            return x.into(); // the next term, x^3/3, is 200 digits below
        }
        let e = expm1(Pair::from(2.0 * x));
        e / (e + 2.0.into())
    }

    /// sin(x + quarter_turns pi/2).
    pub fn sin(x: f64, quarter_turns: i64) -> Pair {
        let k = (x / FRAC_PI_2).round();
        let r = subtract_multiple(x.into(), k, FRAC_PI_2_PARTS);
        let quadrant = (k as i64 + quarter_turns).rem_euclid(4);
        let odd_series = quadrant % 2 == 0;
        let square = r * r;
        let first = if odd_series { r } else { 1.0.into() };
        let mut series = Pair::from(0.0);
        for n in (1..=15).rev() {
            let m = 2 * n + i32::from(odd_series);
            series = (square + square * series) / f64::from(-m * (m - 1)).into();
        }
        let value = first + first * series;
        if quadrant < 2 { value } else { Pair(-value.0, -value.1) }
    }
}
