//! Gains of laws, each listed once: its key, unit, bounds, meaning, and the rule by which it follows from a drive.

use physics::Bounds;

/// A gain of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Name in a controller file.
    pub key: &'static str,
    /// Its unit in SI; `1` for a pure number.
    pub unit: &'static str,
    /// Allowed values.
    pub bounds: Bounds,
    /// Its meaning, in words.
    pub meaning: &'static str,
    /// Rule that determines the value, in words.
    pub rule: &'static str,
    /// Factors of a controller file that multiply it, of [`FACTORS`].
    pub factors: &'static [&'static str],
}

/// Names of the factors.
pub const FACTORS: [&str; 3] = ["gain", "damping", "filter"];

/// Allowed values of a factor.
pub const FACTOR_BOUNDS: Bounds = physics::within(0.1, 10.0);

/// A law or choice with gains.
pub trait Gains {
    /// Its gains.
    const GAINS: &'static [Gain];

    /// Values of the gains, in that order.
    fn gains_mut(&mut self) -> Vec<&mut f64>;
}

/// Gains with their values.
pub(crate) fn listed<G: Gains>(own: &mut G) -> Vec<(&'static Gain, &mut f64)> {
    G::GAINS.iter().zip(own.gains_mut()).collect()
}

/// Defines a law: a struct of its gains and of its memory, with the initial values of the memory.
macro_rules! law {
    ($(#[$attribute:meta])* pub struct $name:ident {
        $($gain:ident: $unit:literal, $bounds:expr, $meaning:literal, rule $rule:literal $(, factor $factor:literal)?;)*
    } memory<$number:ident> { $($memory:ident: $type:ty = $begins:expr),* $(,)? }) => {
        $(#[$attribute])*
        #[derive(Clone, Debug)]
        pub struct $name<$number = f64> {
            $(#[doc = $meaning] pub $gain: $number,)*
            $($memory: $type,)*
        }

        impl<$number: $crate::number::Number> $name<$number> {
            /// Returns the law with these gains and its initial memory.
            #[allow(clippy::too_many_arguments)]
            pub fn new($($gain: $number),*) -> Self {
                $name { $($gain,)* $($memory: $begins,)* }
            }
        }

        impl $name {
            /// The same law on another number type. The callback gets key and value of each gain; the state is not
            /// copied.
            pub fn in_numbers<$number: $crate::number::Number>(
                &self,
                mut gain: impl FnMut(&'static str, f64) -> $number,
            ) -> $name<$number> {
                $name::new($(gain(stringify!($gain), self.$gain)),*)
            }
        }

        impl<$number: $crate::number::Number> $crate::number::Memory<$number> for $name<$number> {
            fn each(&mut self, _see: &mut dyn FnMut(&mut $number)) {
                $($crate::number::Memory::each(&mut self.$memory, _see);)*
            }
        }

        impl $crate::gains::Gains for $name {
            const GAINS: &'static [$crate::gains::Gain] = &[$($crate::gains::Gain {
                key: stringify!($gain), unit: $unit, bounds: $bounds, meaning: $meaning, rule: $rule,
                factors: &[$($factor)?],
            },)*];

            fn gains_mut(&mut self) -> Vec<&mut f64> {
                vec![$(&mut self.$gain),*]
            }
        }
    };
}
pub(crate) use law;
