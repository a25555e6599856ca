//! Forward-mode automatic differentiation.

use crate::real::{Function, Lane, MOST_ARGUMENTS, MOST_RESULTS, Map, Over, Real};

/// `re + sum_i eps[i] e_i` with `e_i e_j = 0`: a value with `N` directional derivatives. It works over any `Real`, so
/// that lanes can have derivatives and derivatives can have lanes.
#[derive(Clone, Copy, Debug)]
pub struct Dual<R, const N: usize> {
    /// The value.
    pub re: R,
    /// Derivatives in N directions.
    pub eps: [R; N],
}

/// Runs an operation over `R`, out of line if `R` is [large](Real::LARGE). This keeps even closures out of line.
macro_rules! once {
    ($operation:expr) => {
        if R::LARGE { R::once(|| $operation) } else { $operation }
    };
}

impl<R: Real, const N: usize> Dual<R, N> {
    /// Replaces the derivatives of this value in place, because numbers with second derivatives are large.
    #[inline(always)]
    fn with(mut self, re: R, f: impl Fn(usize, R) -> R) -> Self {
        self.re = re;
        for (i, eps) in self.eps.iter_mut().enumerate() {
            *eps = f(i, *eps);
        }
        self
    }

    /// Returns the independent variable of direction `i`.
    #[inline(always)]
    pub fn variable(re: R, i: usize) -> Self {
        let mut eps = [R::zero(); N];
        eps[i] = R::one();
        Dual { re, eps }
    }

    /// Returns `f` with value `re` and derivative `slope` with respect to `self`.
    #[inline(always)]
    fn chain(self, re: R, slope: R) -> Self {
        once!(self.with(re, |_, eps| eps * slope))
    }
}

impl<R: Real, const N: usize> From<R> for Dual<R, N> {
    #[inline(always)]
    fn from(re: R) -> Self {
        Dual { re, eps: [R::zero(); N] }
    }
}

crate::operators! {
    [R: Real, const N: usize] Dual<R, N>, |a, b|
    +: once!(a.with(a.re + b.re, |i, eps| eps + b.eps[i])),
    -: once!(a.with(a.re - b.re, |i, eps| eps - b.eps[i])),
    *: once!(a.with(a.re * b.re, |i, eps| eps.fma(b.re, a.re * b.eps[i]))),
    /: once!({
        let re = a.re / b.re;
        let inverse = R::one() / b.re;
        a.with(re, |i, eps| (eps - re * b.eps[i]) * inverse)
    }),
    neg: once!(a.with(-a.re, |_, eps| -eps)),
}

impl<R: Real, const N: usize> Real for Dual<R, N> {
    type Mask = R::Mask;

    const GENERAL: bool = N == OF_ANY_KIND;
    const LARGE: bool = N > 1;
    /// Numbers with second derivatives. If they were inlined, a right-hand side would exceed the processor's caches.
    #[inline(never)]
    fn once<T>(operation: impl FnOnce() -> T) -> T {
        operation()
    }
    #[inline(always)]
    fn c(x: f64) -> Self {
        Self::from(R::c(x))
    }
    #[inline(always)]
    fn fma(self, a: Self, b: Self) -> Self {
        once!(self.with(self.re.fma(a.re, b.re), |i, eps| eps.fma(a.re, self.re.fma(a.eps[i], b.eps[i]))))
    }
    #[inline(always)]
    fn fma_c(self, a: f64, b: Self) -> Self {
        b.with(self.re.fma_c(a, b.re), |i, eps| self.eps[i].fma_c(a, eps))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let re = self.re.sqrt();
        self.chain(re, R::c(0.5) / re)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let re = self.re.exp();
        self.chain(re, re)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.re.ln(), R::one() / self.re)
    }
    #[inline(always)]
    fn pow(self, exponent: Self) -> Self {
        once!({
            let re = self.re.pow(exponent.re);
            let (by_base, by_exponent) = (exponent.re / self.re, self.re.ln());
            self.with(re, |i, eps| re * eps.fma(by_base, exponent.eps[i] * by_exponent))
        })
    }
    #[inline(always)]
    fn sin(self) -> Self {
        self.chain(self.re.sin(), self.re.cos())
    }
    #[inline(always)]
    fn cos(self) -> Self {
        self.chain(self.re.cos(), -self.re.sin())
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let re = self.re.tanh();
        self.chain(re, R::one() - re * re)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> R::Mask {
        self.re.lt(other.re)
    }
    #[inline(always)]
    fn select(mask: R::Mask, a: Self, b: Self) -> Self {
        once!(a.with(R::select(mask, a.re, b.re), |i, eps| R::select(mask, eps, b.eps[i])))
    }
    #[inline(always)]
    fn sloped(self, x: Self, slope: impl FnOnce() -> Self) -> Self {
        let slope = slope().re;
        once!(x.with(self.re, |_, eps| eps * slope))
    }
}

impl<R: Real, const N: usize> Over<R> for Dual<R, N> {
    #[inline(always)]
    fn times(self, a: R) -> Self {
        once!(self.with(self.re * a, |_, eps| eps * a))
    }
    #[inline(always)]
    fn times_plus(self, a: R, b: Self) -> Self {
        once!(self.with(self.re.fma(a, b.re), |i, eps| eps.fma(a, b.eps[i])))
    }
    #[inline(always)]
    fn composed<const K: usize>(f: &impl Function<R, K>, x: [Self; K]) -> Self {
        if K >= N {
            return f.at(x);
        }
        let own = f.at(std::array::from_fn(|k| Dual::<R, K>::variable(x[k].re, k)));
        let slopes = |i: usize| (0..K).fold(R::zero(), |sum, k| x[k].eps[i].fma(own.eps[k], sum));
        Dual { re: own.re, eps: std::array::from_fn(slopes) }
    }
    fn mapped(f: &impl Map<R>, x: &[Self], out: &mut [Self], memory: &mut Vec<Self>) {
        let (k, m) = (x.len(), out.len());
        let is_known = memory.len() == k + m + m * k;
        if !is_known || !x.iter().zip(&*memory).all(|(x, own)| (x.re - own.re).is_zero()) {
            let (mut values, mut results) = ([R::zero(); MOST_ARGUMENTS], [R::zero(); MOST_RESULTS]);
            let mut slopes = [[R::zero(); MOST_ARGUMENTS]; MOST_RESULTS];
            for (value, x) in values.iter_mut().zip(x) {
                *value = x.re;
            }
            f.slopes(&values[..k], &mut results[..m], &mut slopes);
            let rows = slopes[..m].iter().flat_map(|row| &row[..k]);
            memory.clear();
            memory
                .extend(values[..k].iter().chain(&results[..m]).chain(rows).map(|value| Self::from(*value)));
        }
        let (results, slopes) = memory[k..].split_at(m);
        for ((out, own), row) in out.iter_mut().zip(results).zip(slopes.chunks_exact(k)) {
            *out = *own;
            for (x, slope) in x.iter().zip(row) {
                for (eps, own) in out.eps.iter_mut().zip(x.eps) {
                    *eps = own.fma(slope.re, *eps);
                }
            }
        }
    }
}

/// Numbers with this many derivatives serve systems of any kind.
const OF_ANY_KIND: usize = 8;

/// Step control and events use only the value.
impl<const N: usize> Lane for Dual<f64, N> {
    type Plain = f64;
    const L: usize = 1;
    const DIRECTIONS: usize = N;
    #[inline(always)]
    fn plain(&self) -> f64 {
        self.re
    }
    #[inline(always)]
    fn with_value(self, re: f64) -> Self {
        Dual { re, ..self }
    }
    #[inline(always)]
    fn scale(self, a: f64) -> Self {
        self.with(self.re * a, |_, eps| eps * a)
    }
    #[inline(always)]
    fn fma_plain(self, a: f64, b: Self) -> Self {
        self.fma_c(a, b)
    }
    #[inline(always)]
    fn mask_bits(mask: bool) -> u64 {
        u64::from(mask)
    }
    #[inline(always)]
    fn mask_of(bits: u64) -> bool {
        bits != 0
    }
    #[inline(always)]
    fn get(&self, _lane: usize) -> f64 {
        self.re
    }
    #[inline(always)]
    fn put(&mut self, _lane: usize, value: f64) {
        *self = Self::from(value);
    }
    #[inline(always)]
    fn take(&mut self, _lane: usize, from: &Self) {
        *self = *from;
    }
    #[inline(always)]
    fn part(&self, part: usize) -> f64 {
        if part == 0 { self.re } else { self.eps[part - 1] }
    }
    #[inline(always)]
    fn from_parts(part: impl Fn(usize) -> f64) -> Self {
        Self::zero().with(part(0), |i, _| part(i + 1))
    }
}
