//! Gains of laws, each listed once: its key, unit, bounds, meaning, and the rule by which it follows from a drive.

use physics::Bounds;

/// A gain of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Its name in a controller file.
    pub key: &'static str,
    /// Its unit in SI; `1` for a pure number.
    pub unit: &'static str,
    /// The values that it may take.
    pub bounds: Bounds,
    /// Its meaning, in words.
    pub meaning: &'static str,
    /// What it follows from, in words.
    pub rule: &'static str,
}

/// What has gains.
pub trait Gains {
    /// Its gains.
    const GAINS: &'static [Gain];

    /// Their values, in that order.
    fn gains_mut(&mut self) -> Vec<&mut f64>;
}

/// A law: a struct of its gains and of its memory, which begins as it is said here.
macro_rules! law {
    ($(#[$attribute:meta])* pub struct $name:ident {
        $($gain:ident: $unit:literal, $bounds:expr, $meaning:literal, rule $rule:literal;)*
    } memory { $($memory:ident: $type:ty = $begins:expr),* $(,)? }) => {
        $(#[$attribute])*
        #[derive(Clone, Debug)]
        pub struct $name {
            $(#[doc = $meaning] pub $gain: f64,)*
            $($memory: $type,)*
        }

        impl $name {
            /// With gains, and nothing remembered.
            #[allow(clippy::too_many_arguments)]
            pub fn new($($gain: f64),*) -> Self {
                $name { $($gain,)* $($memory: $begins,)* }
            }
        }

        impl $crate::gains::Gains for $name {
            const GAINS: &'static [$crate::gains::Gain] = &[$($crate::gains::Gain {
                key: stringify!($gain), unit: $unit, bounds: $bounds, meaning: $meaning, rule: $rule,
            },)*];

            fn gains_mut(&mut self) -> Vec<&mut f64> {
                vec![$(&mut self.$gain),*]
            }
        }
    };
}
pub(crate) use law;
