use super::base::{Features, Law, Tick};
use crate::gains::law;
use crate::model::Model;
use crate::number::Number;
use crate::types::{Coupled, Plant};
use physics::{above, at_least};

law! {
    /// Inversion of force and flow:
    ///
    ///   `F_d  = M (a_d + 2 lambda e' + lambda^2 e) - load - d + F_fr`
    ///   `F_d' = M (j_d + 2 lambda e'' + lambda^2 e') + F_fr'`
    ///   `F'   = F_d' + k_f (F_d - F),   k_f = 1.5 lambda,   lambda = 0.22/lag`
    ///
    /// F_fr is the friction along the reference. Under the opening, the force of the gas changes at the rate F'.
    ///
    /// On several axes that move one body, M times the feedback becomes the sum of [`Coupled`]. The term in e'' becomes
    /// 2 lambda times the error of the axis's own force.
    pub struct Inversion {
        bandwidth: "rad/s", above(0.0), "lambda", rule "0.22/lag, with a lag of at least 3 ms", factor "gain";
        force_gain: "1/s", at_least(0.0), "k_f", rule "1.5 lambda";
    } memory<S> {}
}

impl Inversion {
    pub(super) fn tuned(_model: &Model, plant: &Plant) -> Self {
        let bandwidth = plant.bandwidth();
        Inversion::new(bandwidth, 1.5 * bandwidth)
    }
}

impl<S: Number> Law<S> for Inversion<S> {
    const FEATURES: Features = Features { push: 0.6, ..Features::USUAL };

    fn step(&mut self, tick: &Tick<S>) -> S {
        let [e, e1, e2] = tick.errors();
        let (l, model) = (self.bandwidth, tick.model);
        let [friction, friction_rate] = tick.friction;
        let wanted = &tick.wanted;
        let mut force = (wanted.acceleration + l.times(2.0) * e1 + l * l * e) * model.mass
            - S::c(model.load)
            - tick.state.disturbance
            + friction;
        let mut rate = (wanted.jerk + l.times(2.0) * e2 + l * l * e1) * model.mass + friction_rate;
        let gas = model.gas_force(tick.state.pressures);
        if let Some(Coupled { loads: [load, _], feedback: [every, every_rate] }) = tick.coupled {
            let [own, own_rate] = self.feedback(tick).map(|own| own * model.mass);
            force += S::c(every + load) - own;
            rate += S::c(every_rate) + l.times(2.0 * load) - own_rate;
        }
        tick.opening_for(rate + self.force_gain * (force - gas))
    }

    fn feedback(&self, tick: &Tick<S>) -> [S; 2] {
        let ([e, e1, _], l) = (tick.errors(), self.bandwidth);
        let twice = l.times(2.0);
        let unknown = tick.state.disturbance / tick.model.mass;
        [twice * e1 + l * l * e - unknown, l * l * e1 - twice * unknown]
    }
}
