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

/// Gains with their values.
pub type GainValues<'a> = Vec<(&'static Gain, &'a mut f64)>;

/// Defines a law: a struct of its gains and of its memory, whose numbers are zero at first.
macro_rules! law {
    ($(#[$attribute:meta])* pub struct $name:ident {
        $($gain:ident: $unit:literal, $bounds:expr, $meaning:literal, rule $rule:literal $(, factor $factor:literal)?;)*
    } memory<$number:ident> { $($memory:ident: $type:ty),* $(,)? }) => {
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
                $name { $($gain,)* $($memory: Default::default(),)* }
            }

            /// Returns the law with gains in the order of its list; `None` if there are fewer.
            pub fn of(gains: &[$number]) -> Option<Self> {
                let [$($gain,)* ..] = *gains else { return None };
                Some($name::new($($gain),*))
            }
        }

        impl $name {
            /// Its gains.
            pub const GAINS: &'static [$crate::gains::Gain] = &[$($crate::gains::Gain {
                key: stringify!($gain), unit: $unit, bounds: $bounds, meaning: $meaning, rule: $rule,
                factors: &[$($factor)?],
            },)*];

            /// Its gains with their values.
            pub fn gains(&mut self) -> $crate::gains::GainValues<'_> {
                Self::GAINS.iter().zip([$(&mut self.$gain),*]).collect()
            }
        }

        impl<$number: $crate::number::Number> $crate::number::Memory<$number> for $name<$number> {
            fn each(&mut self, _see: &mut dyn FnMut(&mut $number)) {
                $($crate::number::Memory::each(&mut self.$memory, _see);)*
            }
        }
    };
}
pub(crate) use law;
