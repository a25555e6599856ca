use super::stribeck::stribeck_parameters;
use super::{At, Choices, Claims, Described, Law, Levels, Shape, dry, levels_of, sliding};
use crate::parameter::above;
use math::{Over, Real};

stribeck_parameters! {
    /// Karnopp: a band |v| <= Dv in which the mass counts as at rest.
    ///
    ///   `F(v) = [Fc + (Fs - Fc) s(v)] sgn(v) + Fv v,  s = exp(-|v/vs|^n)                   [N], opposes v > 0`
    ///   `|v| <= Dv: v = 0 and F = applied force, as long as |applied| <= Fs`
    ///
    /// The modes are as follows. Slip in the direction s = +-1 holds while s v > Dv or s applied > Fs. Otherwise the
    /// mass stops with v = 0 exactly, and sticks while |applied| <= Fs. A mass that leaves stick has a separate mode, s
    /// = +-2, until it has left the band or stops again. Without this mode, a force near Fs would stop it at every
    /// instant. It then slides on the curve, where the source uses Fs. The difference is the fall of the curve over the
    /// band. The kinetic energy lost in the stop, at most m Dv^2/2, is booked as friction heat at that instant. In the
    /// limit Dv -> 0 this is `stribeck`, which
    /// needs no band. No presliding, no memory.
    /// Source: [karnopp1985].
    pub struct Karnopp {
        /// Velocity Dv below which the mass counts as at rest
        dead_zone: "m/s", above(0.0);
    }
}

/// Size of the mode of a mass that leaves stick and is still in the band.
const LEAVING: f64 = 2.0;

/// Returns the direction of a mode.
#[inline(always)]
fn way<P: Real>(mode: P) -> P {
    P::select(dry::is_stick(mode), P::zero(), P::select(mode.lt(P::zero()), -P::one(), P::one()))
}

/// Returns whether the mode is that of leaving stick.
fn is_leaving<P: Real>(mode: P) -> P::Mask {
    P::c(0.5 * (1.0 + LEAVING)).lt(mode.abs())
}

impl Described for Karnopp<f64> {
    fn build(values: &[f64], choices: &Choices) -> Self {
        Karnopp::from_values(values, Shape::of(choices, values[3]))
    }

    fn warning(&self, _levels: &Levels<f64>) -> Option<String> {
        (self.dead_zone >= self.stribeck_velocity).then(|| {
            format!(
                "friction.dead_zone = {} mm/s is not below friction.stribeck_velocity = {} mm/s: the Stribeck curve lies \
                 in the band that counts as rest; a hundredth of it keeps the curve, law = \"stribeck\" needs no band",
                1e3 * self.dead_zone,
                1e3 * self.stribeck_velocity
            )
        })
    }
}

impl<P: Real> Law<P> for Karnopp<P> {
    const KEY: &'static str = "karnopp";
    const TITLE: &'static str = "Karnopp: Stribeck curve with a band of velocity that counts as rest";
    const SOURCE: &'static str = "karnopp1985";
    const STICKS: bool = true;
    const CLAIMS: Claims = Claims { no_drift: true, always_passive: true, ..Claims::USUAL };

    levels_of!(coulomb breakaway viscous);

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], _dz: &mut [S], mode: P) -> S {
        let level = levels.at(self.weight(at.v));
        dry::force(at, mode, S::from(way(mode)) * level + levels.viscous * at.v)
    }

    fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], mode: P) -> S {
        let (along, push) = (S::from(way(mode)) * at.v, S::from(way(mode)) * at.applied);
        let faster = along - S::from(self.dead_zone);
        let slips = S::select(is_leaving(mode), along.min(-faster), faster.max(push - levels.breakaway));
        S::select(dry::is_stick(mode), levels.breakaway - at.applied.abs(), slips)
    }

    fn next_mode(&self, mode: P, at: &At<P>, levels: &Levels<P>, _z: &mut [P]) -> P {
        let stopped = P::c(LEAVING) * dry::next_mode(mode, at.applied, levels.breakaway);
        let left = (P::c(0.5) * self.dead_zone).lt(way(mode) * at.v);
        P::select(is_leaving(mode), P::select(left, way(mode), stopped), stopped)
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        sliding(v, levels.at(self.weight(v)), levels.viscous)
    }
}
