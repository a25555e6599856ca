//! Platforms on several legs: axes whose positions are functions of a few coordinates.
//!
//! A mechanism is one function from its coordinates to weighted points and to the positions of its legs. Mass matrix,
//! forces, Jacobian, energy and their derivatives follow from that function. A new mechanism is a type that implements
//! [`Mechanism`], a line in `mechanisms!` and a table of its component.

#![allow(clippy::needless_range_loop)] // indices are those of the equations

use math::Real;

/// Receives the weighted points of a mechanism: weight in the kinetic energy, mass in the field of gravity, and place.
pub trait Points<P, T>: FnMut([P; 2], [T; 3]) {}
impl<P, T, F: FnMut([P; 2], [T; 3])> Points<P, T> for F {}

/// A mechanism with `N` coordinates and `N` legs.
pub trait Mechanism<const N: usize> {
    /// Returns the position of each leg, m. Calls `point` for each weighted point of the mechanism. The weight of a unit
    /// vector is in kg m2.
    fn see<P: Real, T: Smooth<P>>(g: &Geometry<P>, q: &[T; N], point: &mut impl Points<P, T>) -> [T; N];

    /// Returns coordinates near those at which the legs have these positions: the start of Newton's method.
    fn near<P: Real>(geometry: &Geometry<P>, x: &[P; N]) -> [P; N];
}

/// Largest number of coordinates.
pub(crate) const MOST: usize = 6;

macro_rules! mechanisms {
    ($($kind:ident: $n:literal, [$($name:literal $rate:literal),*];)*) => {
        /// Kind of a mechanism.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum MechanismKind {
            $(#[doc = concat!("See [`", stringify!($kind), "`].")] $kind,)*
        }

        impl MechanismKind {
            /// Returns the number of coordinates and legs.
            pub const fn count(self) -> usize {
                match self { $(MechanismKind::$kind => $n,)* }
            }

            /// Returns the names of the coordinates and of their rates.
            pub fn names(self) -> &'static [[&'static str; 2]] {
                match self { $(MechanismKind::$kind => &[$([$name, $rate]),*],)* }
            }
        }

        /// Evaluates an expression with the type `$m` and the number `$n` of a kind.
        macro_rules! each {
            ($value:expr, $m:ident, $count:ident => $body:expr) => {
                match $value {
                    $($crate::part::mechanism::MechanismKind::$kind => {
                        type $m = $crate::part::mechanism::$kind;
                        const $count: usize = $n;
                        $body
                    })*
                }
            };
        }
    };
}

mechanisms! {
    Rps3: 3, ["heave_m" "heave_rate_m_s", "tilt_1" "tilt_1_rate_1_s", "tilt_2" "tilt_2_rate_1_s"];
    Upu3: 3, ["x_m" "x_rate_m_s", "y_m" "y_rate_m_s", "z_m" "z_rate_m_s"];
    Ups6: 6, [
        "x_m" "x_rate_m_s", "y_m" "y_rate_m_s", "z_m" "z_rate_m_s",
        "tilt_1" "tilt_1_rate_1_s", "tilt_2" "tilt_2_rate_1_s", "tilt_3" "tilt_3_rate_1_s"
    ];
    LinearDelta: 3, ["x_m" "x_rate_m_s", "y_m" "y_rate_m_s", "z_m" "z_rate_m_s"];
    Rail: 1, ["position_m" "impulse_n_s"];
}

// After the macro that they use.
mod dynamics;
mod geometry;
mod jet;
mod kinematics;
mod platform;

pub use geometry::{Geometry, LinearDelta, Rail, Rps3, Ups6, Upu3};
pub use jet::Smooth;
pub use kinematics::Evaluated;
pub(crate) use kinematics::Unreached;
pub use platform::Platform;
