use super::base::{Law, Tick, Tuned, fed_forward, is_free};
use crate::gains::law;
use crate::model::Model;
use crate::number::{Number, memory};
use crate::types::Plant;
use physics::{above, at_least};

memory! {
    /// Error of the measured position, its filtered slope and its integral.
    pub(super) struct Errors<S> {
        /// The last error, and whether it exists: 0 or 1.
        last: [S; 2],
        slope: S,
        /// Integral of the error, as a fraction of opening.
        pub integral: S,
    }
}

impl<S: Number> Errors<S> {
    /// Returns the error and its slope.
    pub fn seen(&mut self, tick: &Tick<S>, filter_time: S) -> [S; 2] {
        let (position, wanted) = tick.now;
        let e = wanted.position - position;
        let period = S::c(tick.period);
        let [last, is_there] = self.last;
        let slope = S::select(S::zero().lt(is_there), (e - last) / period, S::zero());
        self.slope += (slope - self.slope) * period / (period + filter_time);
        self.last = [e, S::one()];
        [e, self.slope]
    }

    /// Integrates the error at a rate, 1/(m s), unless the command was at its limit.
    pub fn add_up(&mut self, is_free: S::Mask, rate: S, tick: &Tick<S>) {
        let grown = self.integral + rate * (tick.now.1.position - tick.now.0) * S::c(tick.period);
        self.integral = S::select(is_free, grown, self.integral);
    }
}

law! {
    /// PID with feed-forward of velocity, acceleration, jerk and friction; it needs a position sensor alone:
    ///
    ///   u = (v_d + 2 zeta a_d/omega + (j_d + share F_fr'/M)/omega^2)/K_v + k_p (e + T_d e') + k_p/T_i int e
    ///
    /// omega and zeta are those of the mass on its air, and K_v is its speed per fraction of opening. The integral is
    /// kept while the command is at its limit.
    pub struct Pid {
        gain: "1/m", at_least(0.0), "k_p", rule "zeta omega/K_v", factor "gain";
        derivative_time: "s", at_least(0.0), "T_d", rule "0.5/omega", factor "damping";
        integral_time: "s", above(0.0), "T_i", rule "4/omega";
        filter_time: "s", at_least(0.0), "time constant of the slope of the error", rule "0.1/omega", factor "filter";
        friction_share: "1", at_least(0.0), "fraction of the friction that is fed forward", rule "0.5, assumed";
    } memory<S> { errors: Errors<S> = Errors::new() }
}

impl Tuned for Pid {
    const KEY: &'static str = "pid";

    fn tuned(_model: &Model, plant: &Plant) -> Self {
        let w = plant.natural_frequency;
        Pid::new(plant.damping_ratio * w / plant.speed, 0.5 / w, 4.0 / w, 0.1 / w, 0.5)
    }
}

impl<S: Number> Law<S> for Pid<S> {
    fn step(&mut self, tick: &Tick<S>) -> S {
        let [e, slope] = self.errors.seen(tick, self.filter_time);
        fed_forward(tick, &tick.now.1, self.friction_share)
            + self.gain * (e + self.derivative_time * slope)
            + self.errors.integral
    }

    fn given(&mut self, asked: S, tick: &Tick<S>) {
        self.errors.add_up(is_free(asked), self.gain / self.integral_time, tick);
    }
}
