use super::{At, Law, Levels, dry, sliding};
use crate::parameter::{above, at_least};
use math::{Over, Real};

/// |v/vs| below this is taken as this in a general exponent, where the slope at zero would be
/// infinite: it changes the weight by less than 1e-6 for exponents from 0.5.
const SMALLEST_RATIO: f64 = 1e-12;

/// exp(-|v/vs|^n): how much of Fs - Fc is left at velocity `v`; `gaussian` says that n = 2.
#[inline(always)]
pub fn weight<P: Real, S: Over<P>>(v: S, vs: P, exponent: P, gaussian: bool) -> S {
    let ratio = v * S::from(P::one() / vs);
    if gaussian {
        (-(ratio * ratio)).exp()
    } else {
        (-ratio.abs().max(S::c(SMALLEST_RATIO)).pow(S::from(exponent))).exp()
    }
}

crate::parameters! {
    /// Friction of a lip seal in steady sliding (Stribeck curve), with exact sticking.
    ///
    ///   F(v) = [Fc + (Fs - Fc) exp(-|v/vs|^n)] sgn(v) + Fv v          [N], opposes v > 0
    ///   at rest: F = applied force, as long as |applied| <= Fs
    ///
    /// Stick and slip are modes with located events: v = 0 exactly for as long as it sticks. No
    /// presliding, no memory (use `lugre`). Source: [armstrong1994].
    pub struct Stribeck {
        /// Coulomb force Fc
        coulomb: "N", above(0.0);
        /// Breakaway force Fs, the limit of sliding for v -> 0
        breakaway: "N", above(0.0);
        /// Stribeck velocity vs
        stribeck_velocity: "m/s", above(0.0);
        /// Stribeck exponent n
        stribeck_exponent: "-", above(0.0), default 2.0;
        /// Viscous coefficient Fv
        viscous: "N s/m", at_least(0.0), default 0.0;
    } with {
        /// n = 2: a square instead of a power
        gaussian: bool,
    }
}

impl Stribeck<f64> {
    pub(super) fn from_values(values: &[f64]) -> Self {
        Stribeck {
            coulomb: values[0],
            breakaway: values[1],
            stribeck_velocity: values[2],
            stribeck_exponent: values[3],
            viscous: values[4],
            gaussian: values[3] == 2.0,
        }
    }

    pub(super) fn warning(&self, _levels: &Levels<f64>) -> Option<String> {
        None
    }
}

impl<P: Real> Stribeck<P> {
    fn weight<S: Over<P>>(&self, v: S) -> S {
        weight(v, self.stribeck_velocity, self.stribeck_exponent, self.gaussian)
    }
}

impl<P: Real> Law<P> for Stribeck<P> {
    const KEY: &'static str = "stribeck";
    const TITLE: &'static str = "Stribeck curve with Coulomb and viscous friction, exact sticking";
    const SOURCE: &'static str = "armstrong1994";
    const STICKS: bool = true;

    fn levels(&self) -> Levels<P> {
        Levels { coulomb: self.coulomb, breakaway: self.breakaway }
    }

    #[inline(always)]
    fn prepare<S: Over<P>>(&self, v: S) -> S {
        self.weight(v)
    }

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], _dz: &mut [S], mode: P) -> S {
        dry::force(at, mode, S::from(mode) * levels.at(at.prepared) + S::from(self.viscous) * at.v)
    }

    fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, mode: P) -> S {
        dry::event(at, levels.breakaway, mode)
    }

    fn next_mode(&self, mode: f64, applied: f64, levels: &Levels<f64>) -> f64 {
        dry::next_mode(mode, applied, levels.breakaway)
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        sliding(v, levels.at(self.weight(v)), self.viscous)
    }
}
