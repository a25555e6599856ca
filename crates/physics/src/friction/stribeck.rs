use super::{At, Choices, Claims, Described, Law, Levels, dry, levels_of};
use math::{Over, Real, power};

/// Lower limit of |v/vs| for a general exponent, whose slope at zero would be infinite. It changes the weight by less
/// than 1e-6 for exponents from 0.5.
const SMALLEST_RATIO: f64 = 1e-12;

/// Upper limit of |v/vs|^n: exp(-746) is 0. Without the limit, an infinite power would have the derivative 0 * inf.
const LARGEST_POWER: f64 = 746.0;

/// Fall of the excess of breakaway over Coulomb force with the velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// exp(-(v/vs)^2): a square instead of a power.
    Gaussian,
    /// Free exponent: exp(-|v/vs|^n).
    Power,
    /// 1/(1 + (v/vs)^2): a heavier tail.
    Lorentzian,
}

impl Shape {
    /// Returns the shape that a description chooses, or that of its exponent.
    pub(super) fn of(choices: &Choices, exponent: f64) -> Self {
        choices.shape.unwrap_or(if exponent == 2.0 { Shape::Gaussian } else { Shape::Power })
    }
}

/// Returns the remaining fraction of Fs - Fc at velocity `v`.
#[inline(always)]
pub fn weight<P: Real, S: Over<P>>(v: S, vs: P, exponent: P, shape: Shape) -> S {
    let ratio = v * S::from(P::one() / vs);
    match shape {
        Shape::Gaussian => (-(ratio * ratio)).exp(),
        Shape::Power => {
            let size = power(ratio.abs().max(S::c(SMALLEST_RATIO)), S::from(exponent));
            (-size.min(S::c(LARGEST_POWER))).exp()
        }
        Shape::Lorentzian => S::one() / ratio.fma(ratio, S::one()),
    }
}

/// [`crate::parameters!`] of a law with a Stribeck curve: its five parameters and its shape, then the specific ones.
macro_rules! stribeck_parameters {
    ($(#[$attribute:meta])* pub struct $name:ident { $($own:tt)* } $(with { $($choice:tt)* })?) => {
        $crate::parameters! {
            $(#[$attribute])*
            pub struct $name {
                /// Coulomb force Fc
                coulomb: "N", $crate::parameter::above(0.0);
                /// Breakaway force Fs, the limit of sliding for v -> 0
                breakaway: "N", $crate::parameter::above(0.0);
                /// Stribeck velocity vs
                stribeck_velocity: "m/s", $crate::parameter::above(0.0);
                /// Stribeck exponent n
                stribeck_exponent: "-", $crate::parameter::above(0.0), default 2.0;
                /// Viscous coefficient Fv
                viscous: "N s/m", $crate::parameter::at_least(0.0), default 0.0;
                $($own)*
            } with {
                /// Shape of the Stribeck curve
                shape: $crate::friction::Shape,
                $($($choice)*)?
            }
        }

        impl<P: math::Real> $name<P> {
            #[inline(always)]
            fn weight<S: math::Over<P>>(&self, v: S) -> S {
                $crate::friction::weight(v, self.stribeck_velocity, self.stribeck_exponent, self.shape)
            }
        }
    };
}
pub(super) use stribeck_parameters;

stribeck_parameters! {
    /// Friction of a lip seal in steady sliding (Stribeck curve), with exact sticking.
    ///
    ///   `F(v) = [Fc + (Fs - Fc) s(v)] sgn(v) + Fv v,  s = exp(-|v/vs|^n)   [N], opposes v > 0`
    ///   `at rest: F = applied force, as long as |applied| <= Fs`
    ///
    /// Stick and slip are modes with located events: v = 0 exactly during stick. The law has neither presliding nor
    /// memory (use `lugre`). Source: [armstrong1994].
    pub struct Stribeck {}
}

impl Described for Stribeck<f64> {
    fn build(values: &[f64], choices: &Choices) -> Self {
        Stribeck::from_values(values, Shape::of(choices, values[3]))
    }
}

impl<P: Real> Law<P> for Stribeck<P> {
    const KEY: &'static str = "stribeck";
    const TITLE: &'static str = "Stribeck curve with Coulomb and viscous friction, exact sticking";
    const SOURCE: &'static str = "armstrong1994";
    const STICKS: bool = true;
    const CLAIMS: Claims = Claims { no_drift: true, always_passive: true, ..Claims::USUAL };

    levels_of!(coulomb breakaway viscous);

    #[inline(always)]
    fn prepare<S: Over<P>>(&self, v: S) -> S {
        self.weight(v)
    }

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], _dz: &mut [S], mode: P) -> S {
        dry::force(at, mode, S::from(mode) * levels.at(at.prepared) + levels.viscous * at.v)
    }

    fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], mode: P) -> S {
        dry::event(at, levels.breakaway, mode)
    }

    fn next_mode(&self, mode: P, at: &At<P>, levels: &Levels<P>, _z: &mut [P]) -> P {
        dry::next_mode(mode, at.applied, levels.breakaway)
    }
}
