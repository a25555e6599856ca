//! The scalar trait.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A number of a physical law: value, dual number, set of lanes, or set of dependencies.
///
/// A `Real` cannot be a condition of `if`. [`Real::select`] evaluates both sides, and both must be finite, because the
/// derivatives of the side not taken are also computed.
pub trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// Truth values of a comparison, one for each lane.
    type Mask: Copy;

    /// Whether systems of any kind use it. Otherwise only systems with their own Jacobian do, and nothing is compiled
    /// for others.
    const GENERAL: bool = true;

    /// Whether operations of dual numbers over this type are large and therefore out of line.
    const LARGE: bool = false;

    /// Runs an operation of a dual number over this type, out of line if such numbers are large.
    #[inline(always)]
    fn once<T>(operation: impl FnOnce() -> T) -> T {
        operation()
    }
    /// Returns the constant `x`.
    fn c(x: f64) -> Self;
    /// Returns `self * a + b`, rounded once in the value. Derivatives are rounded normally.
    fn fma(self, a: Self, b: Self) -> Self;
    /// Returns the square root.
    fn sqrt(self) -> Self;
    /// Returns e to the power of this.
    fn exp(self) -> Self;
    /// Returns the natural logarithm.
    fn ln(self) -> Self;
    /// Returns `self^exponent` for `self > 0`.
    fn pow(self, exponent: Self) -> Self;
    /// Returns the sine of an angle in rad.
    fn sin(self) -> Self;
    /// Returns the cosine of an angle in rad.
    fn cos(self) -> Self;
    /// Returns the hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Returns the mask in which this is less than the other.
    fn lt(self, other: Self) -> Self::Mask;
    /// Returns `self * a + b` with a constant `a`.
    #[inline(always)]
    fn fma_c(self, a: f64, b: Self) -> Self {
        self.fma(Self::c(a), b)
    }
    /// Returns `a` if `mask` holds, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// Returns the same value with the derivatives of `x` times a slope.
    #[inline(always)]
    fn sloped(self, _x: Self, _slope: impl FnOnce() -> Self) -> Self {
        self
    }

    /// Returns whether this is known to be zero.
    #[inline(always)]
    fn is_zero(&self) -> bool {
        false
    }

    /// Returns 0.
    #[inline(always)]
    fn zero() -> Self {
        Self::c(0.0)
    }
    /// Returns 1.
    #[inline(always)]
    fn one() -> Self {
        Self::c(1.0)
    }
    /// Returns the absolute value.
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.lt(Self::zero()), -self, self)
    }
    /// Returns the lesser of both, or this one if they are equal.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::select(other.lt(self), other, self)
    }
    /// Returns the greater of both, or this one if they are equal.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
}

/// States over parameters: `S: Over<P>` can hold every `P` as a constant and branches on the same lanes.
pub trait Over<P: Real>: Real<Mask = P::Mask> + From<P> {
    /// Returns `self * a`. The derivatives of a parameter by a state are zero and are not multiplied.
    #[inline(always)]
    fn times(self, a: P) -> Self {
        self * Self::from(a)
    }

    /// Returns `self * a + b`, rounded once in the value.
    #[inline(always)]
    fn times_plus(self, a: P, b: Self) -> Self {
        self.fma(Self::from(a), b)
    }

    /// A function of a small number of arguments. Its derivatives by these are computed first if there are more
    /// directions than arguments.
    #[inline(always)]
    fn composed<const K: usize>(f: &impl Function<P, K>, x: [Self; K]) -> Self {
        f.at(x)
    }

    /// A function of several numbers with several results, whose slopes are known. `memory` keeps the slopes for the
    /// next call at the same values. Its caller clears it when the function changes.
    #[inline(always)]
    fn mapped(f: &impl Map<P>, x: &[Self], out: &mut [Self], _memory: &mut Vec<Self>) {
        f.at(x, out);
    }
}

impl<P: Real> Over<P> for P {}

/// Largest number of arguments of a [`Map`].
pub const MOST_ARGUMENTS: usize = 18;
/// Largest number of results of a [`Map`].
pub const MOST_RESULTS: usize = 12;

/// A function of several numbers of any kind with several results.
pub trait Map<P: Real> {
    /// Writes its results at `x`.
    fn at<S: Over<P>>(&self, x: &[S], out: &mut [S]);

    /// Writes its results at `x`, and the derivatives of each result by each argument. The array is zero at entry.
    fn slopes(&self, x: &[P], out: &mut [P], slopes: &mut [[P; MOST_ARGUMENTS]]);
}

/// A function of K numbers of any kind.
pub trait Function<P: Real, const K: usize> {
    /// Returns its value at `x`.
    fn at<S: Over<P>>(&self, x: [S; K]) -> S;
}

/// A piece of work on numbers of one type. Its method must be inlined, with every function that it calls often.
pub trait Work {
    /// Result of the work.
    type Out;
    /// Does the work.
    fn work(self) -> Self::Out;
}

/// A task that works for any numbers side by side.
pub trait Task {
    /// Result of the task.
    type Out;
    /// Runs the task.
    fn run<R: Lane<Plain = R>>(self) -> Self::Out;
}

/// A number made of `L` independent `f64` lanes, or of one `f64` and its derivatives. Only step control and loading use
/// it.
pub trait Lane: Real + From<Self::Plain> {
    /// The number without its derivatives.
    type Plain: Lane<Mask = Self::Mask, Plain = Self::Plain>;
    /// Number of lanes.
    const L: usize;
    /// Number of derivatives.
    const DIRECTIONS: usize = 0;

    /// Does work with all instructions that these numbers are made for.
    #[inline(always)]
    fn within<W: Work>(work: W) -> W::Out {
        work.work()
    }

    /// Returns the number in a lane.
    fn get(&self, lane: usize) -> f64;
    /// Sets one lane to a constant.
    fn put(&mut self, lane: usize, value: f64);

    /// Returns the value without derivatives.
    fn plain(&self) -> Self::Plain;

    /// Returns the same derivatives with another value.
    #[inline(always)]
    fn with_value(self, value: Self::Plain) -> Self {
        Self::from(value)
    }

    /// Returns `self * a`.
    #[inline(always)]
    fn scale(self, a: Self::Plain) -> Self {
        self * Self::from(a)
    }

    /// Returns `self * a + b`.
    #[inline(always)]
    fn fma_plain(self, a: Self::Plain, b: Self) -> Self {
        self.fma(Self::from(a), b)
    }

    /// Returns a mask as bits: bit `i` is lane `i`.
    fn mask_bits(mask: Self::Mask) -> u64;

    /// Returns the mask that holds in these lanes.
    fn mask_of(bits: u64) -> Self::Mask;

    /// Copies one lane unchanged, including derivatives.
    #[inline(always)]
    fn take(&mut self, lane: usize, from: &Self) {
        self.put(lane, from.get(lane));
    }

    /// Returns the value (part 0) or the derivative in direction `part - 1`, of a number of one lane.
    #[inline(always)]
    fn part(&self, _part: usize) -> f64 {
        self.get(0)
    }

    /// Returns the number with these parts.
    #[inline(always)]
    fn from_parts(part: impl Fn(usize) -> f64) -> Self {
        Self::c(part(0))
    }

    /// Returns one number from one `f64` for each lane.
    #[inline(always)]
    fn from_lanes(f: impl Fn(usize) -> f64) -> Self {
        let mut out = Self::zero();
        for lane in 0..Self::L {
            out.put(lane, f(lane));
        }
        out
    }
}

/// Inside `impl Real`: functions of one number, by the functions of a module or a type, of the number or of each of
/// its numbers.
macro_rules! functions {
    (call $of:ident: $($name:ident)*) => {$(
        #[inline(always)]
        fn $name(self) -> Self {
            $of::$name(self)
        }
    )*};
    (map $of:ident: $($name:ident)*) => {$(
        #[inline(always)]
        fn $name(self) -> Self {
            self.map($of::$name)
        }
    )*};
    (same: $($name:ident)*) => {$(
        fn $name(self) -> Self {
            self
        }
    )*};
}
pub(crate) use functions;

/// Implements an operator of a type, from the result for `a` and `b`.
#[macro_export]
macro_rules! operator {
    ([$($generics:tt)*] $name:ty, |$a:ident, $b:ident| $trait:ident $method:ident $result:expr) => {
        impl<$($generics)*> std::ops::$trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, $b: Self) -> Self {
                let $a = self;
                $result
            }
        }
    };
}

/// Implements the operators of a number type, from the results for `a` and `b`, and for `a` alone.
#[macro_export]
macro_rules! operators {
    ([$($generics:tt)*] $name:ty, |$a:ident, $b:ident|
        +: $add:expr, -: $sub:expr, *: $mul:expr, /: $div:expr, neg: $neg:expr $(,)?) => {
        $crate::operator!([$($generics)*] $name, |$a, $b| Add add $add);
        $crate::operator!([$($generics)*] $name, |$a, $b| Sub sub $sub);
        $crate::operator!([$($generics)*] $name, |$a, $b| Mul mul $mul);
        $crate::operator!([$($generics)*] $name, |$a, $b| Div div $div);
        $crate::assign_operators!([$($generics)*] $name);

        impl<$($generics)*> std::ops::Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let $a = self;
                $neg
            }
        }
    };
}

/// Implements `+=`, `-=` and `*=` of a number type by its operators `+`, `-` and `*`.
#[macro_export]
macro_rules! assign_operators {
    ([$($generics:tt)*] $name:ty) => {
        $crate::assign_operators!(@each [$($generics)*] $name, AddAssign add_assign +);
        $crate::assign_operators!(@each [$($generics)*] $name, SubAssign sub_assign -);
        $crate::assign_operators!(@each [$($generics)*] $name, MulAssign mul_assign *);
    };
    (@each [$($generics:tt)*] $name:ty, $trait:ident $method:ident $operator:tt) => {
        impl<$($generics)*> std::ops::$trait for $name {
            #[inline(always)]
            fn $method(&mut self, other: Self) {
                *self = *self $operator other;
            }
        }
    };
}

/// Largest number of lanes.
const MOST_LANES: usize = 16;

/// A field of each lane's struct, as a type without memory.
pub struct Fields<'e, U> {
    each: [&'e U; MOST_LANES],
    lanes: usize,
}

impl<'e, U> std::ops::Deref for Fields<'e, U> {
    type Target = [&'e U];
    #[inline(always)]
    fn deref(&self) -> &[&'e U] {
        &self.each[..self.lanes]
    }
}

/// A field of each lane's struct. See [`Lane::of_each`].
#[inline(never)]
pub fn field<'e, T, U>(each: &[&'e T], field: fn(&'e T) -> &'e U) -> Fields<'e, U> {
    let mut fields = [field(each[0]); MOST_LANES];
    for (own, one) in fields.iter_mut().zip(each) {
        *own = field(one);
    }
    Fields { each: fields, lanes: each.len() }
}

/// Returns `base^exponent`, out of line, for laws whose usual exponent is two or a half.
#[inline(never)]
pub fn power<S: Real>(base: S, exponent: S) -> S {
    base.pow(exponent)
}
