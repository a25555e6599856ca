use super::{Law, Plant, Tick, Tuned, fed_forward};
use crate::gains::law;
use crate::model::Model;
use crate::number::Number;
use physics::above;

law! {
    /// Feedback of position, velocity and acceleration with feed-forward, three poles at -lambda:
    ///
    ///   u = (v_d + 2 zeta a_d/omega + (j_d + F_fr'/M)/omega^2)/K_v
    ///       + c ((3 lambda - 2 zeta omega) e'' + (3 lambda^2 - omega^2) e' + lambda^3 e),   c = 1/(K_v omega^2)
    ///
    /// Accelerations come from pressures.
    pub struct Pva {
        bandwidth: "rad/s", above(0.0), "lambda", rule "40 rad/s, assumed";
    } memory<S> {}
}

impl Tuned for Pva {
    const KEY: &'static str = "pva";

    fn tuned(_model: &Model, _plant: &Plant) -> Self {
        Pva::new(40.0)
    }
}

impl<S: Number> Law<S> for Pva<S> {
    fn step(&mut self, tick: &Tick<S>) -> S {
        let [e, e1, e2] = tick.errors();
        let (w, zeta, l) = (tick.plant.natural_frequency, tick.plant.damping_ratio, self.bandwidth);
        let c = 1.0 / (tick.plant.speed * w * w);
        let gains = [l * l * l, (l.times(3.0) * l - S::c(w * w)), l.times(3.0) - S::c(2.0 * zeta * w)];
        fed_forward(tick, &tick.wanted, S::one()) + (gains[2] * e2 + gains[1] * e1 + gains[0] * e).times(c)
    }
}
