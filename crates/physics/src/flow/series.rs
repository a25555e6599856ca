use math::Real;

/// Least critical pressure ratio of the rule.
const LEAST_RATIO: f64 = 1e-3;

/// Returns sonic conductance and critical pressure ratio of two paths in series, the first upstream:
///
///   `a = C_1/(C_2 b_1),   q = (1 - b_1)/b_1`
///   `C = C_1                                                                         a <= 1`
///   `C = C_2 a (a b_1 + (1 - b_1) sqrt(a^2 + q^2 - 1))/(a^2 + q^2)                   a > 1`
///   `b = 1 - C^2 ((1 - b_1)/C_1^2 + (1 - b_2)/C_2^2)`
///
/// C is exact for paths with the subsonic index 0.5. Subsonic flow is right to 1 % for a valve and a tube. Source:
/// [iso6358-2013], part 3.
pub fn in_series<P: Real>([c1, b1]: [P; 2], [c2, b2]: [P; 2]) -> [P; 2] {
    let one = P::one();
    let b1 = b1.max(P::c(LEAST_RATIO));
    let (a, q) = (c1 / (c2 * b1), (one - b1) / b1);
    let chokes_first = a.lt(one);
    let a = a.max(one);
    let sum = a * a + q * q;
    let second = c2 * a * (a * b1 + (one - b1) * (sum - one).sqrt()) / sum;
    let c = P::select(chokes_first, c1, second);
    let left = |own: P, b: P| (one - b) * (c / own) * (c / own);
    [c, one - left(c1, b1) - left(c2, b2)]
}
