use super::base::{Features, Law, Tick, is_free};
use crate::gains::law;
use crate::model::Model;
use crate::number::Number;
use crate::thresholds::{LAW_BANDWIDTH, SLIDING_GAIN};
use crate::types::Plant;
use physics::{above, at_least};

/// Returns the surface s = e'' + 2 lambda e' + lambda^2 e, and the jerk that keeps the drive on it.
fn surface<S: Number>(tick: &Tick<S>, l: S) -> [S; 2] {
    let [e, e1, e2] = tick.errors();
    let twice = l.times(2.0);
    [e2 + twice * e1 + l * l * e, tick.wanted.jerk + twice * e2 + l * l * e1]
}

/// Returns the opening that produces a jerk, m/s3.
fn opening<S: Number>(tick: &Tick<S>, jerk: S) -> S {
    tick.opening_for(jerk * tick.model.mass + tick.friction[1])
}

law! {
    /// Sliding mode: the jerk of the surface plus K_s sat(s/phi), inverted.
    pub struct Sliding {
        bandwidth: "rad/s", above(0.0), "lambda of the surface", rule "48 rad/s, assumed", factor "gain";
        gain: "m/s3", at_least(0.0), "K_s", rule "a tenth of the rate of the force over the mass";
        width: "m/s2", above(0.0), "phi", rule "K_s/72", factor "damping";
    } memory<S> {}
}

impl Sliding {
    pub(super) fn tuned(model: &Model, plant: &Plant) -> Self {
        let gain = SLIDING_GAIN * plant.force_rate / model.mass;
        Sliding::new(LAW_BANDWIDTH, gain, gain / 72.0)
    }
}

impl<S: Number> Law<S> for Sliding<S> {
    fn step(&mut self, tick: &Tick<S>) -> S {
        let [s, jerk] = surface(tick, self.bandwidth);
        opening(tick, jerk + self.gain * (s / self.width).limited())
    }
}

law! {
    /// Super-twisting: k_1 |s|^0.5 sgn s + w with w' = k_2 sgn s in place of K_s sat(s/phi), linear in a band about s =
    /// 0, because a sampled law would chatter there.
    pub struct SuperTwisting {
        bandwidth: "rad/s", above(0.0), "lambda of the surface", rule "48 rad/s, assumed", factor "gain";
        root_gain: "m^0.5/s2", at_least(0.0), "k_1", rule "K_s/phi^0.5 of the sliding mode";
        integral_gain: "m/s4", at_least(0.0), "k_2", rule "0.3 K_s^2/phi";
        band: "m/s2", above(0.0), "half width of the band", rule "0.2 phi", factor "damping";
    } memory<S> { integral: S }
}

impl SuperTwisting {
    pub(super) fn tuned(model: &Model, plant: &Plant) -> Self {
        let Sliding { bandwidth, gain, width } = Sliding::tuned(model, plant);
        SuperTwisting::new(bandwidth, gain / width.sqrt(), 0.3 * gain * gain / width, 0.2 * width)
    }
}

impl<S: Number> Law<S> for SuperTwisting<S> {
    const FEATURES: Features = Features { push: 0.1, ..Features::USUAL };

    fn step(&mut self, tick: &Tick<S>) -> S {
        let [s, jerk] = surface(tick, self.bandwidth);
        let root = self.root_gain * s / s.abs().max(self.band).sqrt();
        opening(tick, jerk + root + self.integral)
    }

    fn given(&mut self, asked: S, tick: &Tick<S>) {
        let [s, _] = surface(tick, self.bandwidth);
        let grown = self.integral + self.integral_gain * (s / self.band).limited() * S::c(tick.period);
        self.integral = S::select(is_free(asked), grown, self.integral);
    }
}
