use super::stribeck::stribeck_parameters;
use super::{At, Choices, Claims, Law, Levels, Shape, dry, sliding};
use crate::parameter::above;
use math::{Over, Real};

stribeck_parameters! {
    /// Karnopp: a band |v| <= Dv in which the mass counts as at rest.
    ///
    ///   F(v) = [Fc + (Fs - Fc) s(v)] sgn(v) + Fv v   for |v| > Dv,  s = exp(-|v/vs|^n)     [N], opposes v > 0
    ///   in the band: F = applied force, as long as |applied| <= Fs, else Fs sgn(applied)
    ///
    /// As modes: slip in the direction s = +-1 holds while s v > Dv or s applied > Fs, else the mass stops, v = 0 exactly, and
    /// sticks while |applied| <= Fs. What the stop takes, m Dv^2/2 at most, is booked as heat of friction at that
    /// instant. In the limit Dv -> 0 this is `stribeck`, which needs no band. No presliding, no memory.
    /// Source: [karnopp1985].
    pub struct Karnopp {
        /// Velocity Dv below which the mass counts as at rest
        dead_zone: "m/s", above(0.0);
    }
}

impl Karnopp<f64> {
    pub(super) fn build(values: &[f64], choices: &Choices) -> Self {
        Karnopp::from_values(values, Shape::of(choices, values[3]))
    }

    pub(super) fn warning(&self, _levels: &Levels<f64>) -> Option<String> {
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

impl<P: Real> Karnopp<P> {
    /// The level of slip with its viscous part, for a velocity along the direction of slip.
    #[inline(always)]
    fn along<S: Over<P>>(&self, along: S, levels: &Levels<S>) -> S {
        let slipping = levels.viscous.fma(along, levels.at(self.weight(along)));
        S::select(S::from(self.dead_zone).lt(along), slipping, levels.breakaway)
    }
}

impl<P: Real> Law<P> for Karnopp<P> {
    const KEY: &'static str = "karnopp";
    const TITLE: &'static str = "Karnopp: Stribeck curve with a band of velocity that counts as rest";
    const SOURCE: &'static str = "karnopp1985";
    const STICKS: bool = true;
    const CLAIMS: Claims = Claims { no_drift: true, always_passive: true, ..Claims::USUAL };

    fn levels(&self) -> Levels<P> {
        self.own_levels()
    }

    #[inline(always)]
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], _dz: &mut [S], mode: P) -> S {
        let way = S::from(mode);
        dry::force(at, mode, way * self.along(way * at.v, levels))
    }

    fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, _z: &[S], mode: P) -> S {
        let way = S::from(mode);
        let (faster, pushed) = (way * at.v - S::from(self.dead_zone), way * at.applied - levels.breakaway);
        S::select(dry::is_stick(mode), levels.breakaway - at.applied.abs(), faster.max(pushed))
    }

    fn next_mode(&self, mode: P, at: &At<P>, levels: &Levels<P>, _z: &mut [P]) -> P {
        dry::next_mode(mode, at.applied, levels.breakaway)
    }

    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        sliding(v, self.along(v.abs(), levels), S::zero())
    }
}
