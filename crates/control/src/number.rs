//! Number types of laws: values, or records of each operation for code generation.

use math::Over;

/// A number of a state: it holds constants, and the numbers `P` of its model that may be learned.
pub trait StateOf<P: Over<f64>>: Over<f64> + Over<P> {}

impl<P: Over<f64>, S: Over<f64> + Over<P>> StateOf<P> for S {}

/// A number of a law; zero by default.
pub trait Number: Over<f64> + Default {
    /// Runs `a` or `b` on a memory and returns its number: `a` if the mask is true, else `b`.
    fn either<M: Memory<Self>>(
        mask: Self::Mask,
        memory: &mut M,
        a: impl FnOnce(&mut M) -> Self,
        b: impl FnOnce(&mut M) -> Self,
    ) -> Self;

    /// Clips a number to -1 .. 1. NaN stays NaN.
    fn limited(self) -> Self {
        self.within(-1.0, 1.0)
    }

    /// Within two bounds.
    fn within(self, low: f64, high: f64) -> Self {
        self.max(Self::c(low)).min(Self::c(high))
    }
}

/// State of a law or an observer, as numbers.
pub trait Memory<S>: Clone {
    /// Visits each number, always in the same order.
    fn each(&mut self, see: &mut dyn FnMut(&mut S));
}

/// Returns a visitor that sets numbers to these values, in order. Without a value, a number stays.
pub(crate) fn set_to<S: Copy>(values: &[S]) -> impl FnMut(&mut S) {
    let mut values = values.iter();
    move |own| *own = values.next().copied().unwrap_or(*own)
}

/// Returns 1 if `a` is less than `b`, else 0.
pub(crate) fn flag<S: Number>(a: S, b: S) -> S {
    S::select(a.lt(b), S::one(), S::zero())
}

/// Changes a memory if a flag is 1.
pub(crate) fn change<S: Number, M: Memory<S>>(flag: S, memory: &mut M, how: impl FnOnce(&mut M)) {
    let changed = |memory: &mut M| {
        how(memory);
        S::zero()
    };
    S::either(S::c(0.5).lt(flag), memory, changed, |_| S::zero());
}

/// Defines a state of stored numbers that are zero at first. It may have numbers that are not stored.
macro_rules! memory {
    ($(#[$about:meta])* $of:vis struct $name:ident<$number:ident> {
        $($(#[$stored_about:meta])* $of_stored:vis $stored:ident: $type:ty,)*
    }
    $(beside { $($(#[$other_about:meta])* $of_other:vis $other:ident: $of_type:ty,)* })?) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, Default)]
        $of struct $name<$number = f64> {
            $($($(#[$other_about])* $of_other $other: $of_type,)*)?
            $($(#[$stored_about])* $of_stored $stored: $type,)*
        }

        impl<$number: $crate::number::Number> $crate::number::Memory<$number> for $name<$number> {
            fn each(&mut self, see: &mut dyn FnMut(&mut $number)) {
                $($crate::number::Memory::each(&mut self.$stored, see);)*
            }
        }
    };
}
pub(crate) use memory;

impl<S: Number> Memory<S> for S {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        see(self);
    }
}

impl<S, M: Memory<S>, const N: usize> Memory<S> for [M; N] {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.iter_mut().for_each(|own| own.each(see));
    }
}

impl<S, M: Memory<S>> Memory<S> for Option<M> {
    fn each(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.iter_mut().for_each(|own| own.each(see));
    }
}

impl Number for f64 {
    fn either<M: Memory<f64>>(
        mask: bool,
        memory: &mut M,
        a: impl FnOnce(&mut M) -> f64,
        b: impl FnOnce(&mut M) -> f64,
    ) -> f64 {
        if mask { a(memory) } else { b(memory) }
    }
}
