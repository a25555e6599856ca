use super::base::{Law, Tick, fed_forward, is_free};
use crate::gains::law;
use crate::model::Model;
use crate::number::{Number, memory};
use crate::thresholds::LAW_BANDWIDTH;
use crate::types::Plant;
use physics::{above, at_least};

memory! {
    /// Filtered slopes of the error, m, and its integral.
    pub(super) struct Errors<S> {
        slopes: S,
        /// Integral of the error, as a fraction of opening.
        pub integral: S,
    }
}

impl<S: Number> Errors<S> {
    /// Returns the error, and its first and second derivative times these factors, filtered, m.
    pub fn seen(&mut self, tick: &Tick<S>, [first, second]: [S; 2], filter_time: S) -> [S; 2] {
        let ([e, e1, e2], period) = (tick.errors(), S::c(tick.period));
        let slopes = first * e1 + second * e2;
        self.slopes += (slopes - self.slopes) * period / (period + filter_time);
        [e, self.slopes]
    }

    /// Integrates the error at a rate, 1/(m s), unless the command was at its limit.
    pub fn add_up(&mut self, is_free: S::Mask, rate: S, tick: &Tick<S>) {
        let grown = self.integral + rate * (tick.now.1.position - tick.now.0) * S::c(tick.period);
        self.integral = S::select(is_free, grown, self.integral);
    }
}

law! {
    /// PID with feedback of acceleration, as usual for pneumatic axes. Velocity, acceleration, jerk and friction of the
    /// reference are fed forward. The opening is
    ///
    ///   u = (v_d + 2 zeta a_d/omega + (j_d + share F_fr'/M)/omega^2)/K_v + k_p (e + T_d e' + T_a e'') + k_p/T_i int e.
    ///
    /// The mass on its air has the natural frequency omega, the damping ratio zeta, and the speed K_v per fraction of
    /// opening. Without the integral, the gains place three poles at -lambda. The observer estimates velocity and
    /// acceleration. The integral is kept while the command is at its limit.
    pub struct Pid {
        gain: "1/m", at_least(0.0), "k_p", rule "lambda^3/(K_v omega^2), lambda = 48 rad/s, assumed", factor "gain";
        derivative_time: "s", at_least(0.0), "T_d", rule "(3 lambda^2 - omega^2)/lambda^3", factor "damping";
        acceleration_time: "s2", at_least(0.0), "T_a", rule "(3 lambda - 2 zeta omega)/lambda^3", factor "damping";
        integral_time: "s", above(0.0), "T_i", rule "8/lambda";
        filter_time: "s", at_least(0.0), "time constant of T_d e' + T_a e''", rule "0.02/lambda", factor "filter";
        friction_share: "1", at_least(0.0), "fraction of the friction that is fed forward", rule "0.5, assumed";
    } memory<S> { errors: Errors<S> }
}

impl Pid {
    pub(super) fn tuned(_model: &Model, plant: &Plant) -> Self {
        let Plant { natural_frequency: w, damping_ratio, speed, .. } = *plant;
        let l = LAW_BANDWIDTH;
        let cube = l * l * l;
        let derivative_time = (3.0 * l * l - w * w).max(0.0) / cube;
        let acceleration_time = (3.0 * l - 2.0 * damping_ratio * w).max(0.0) / cube;
        Pid::new(cube / (speed * w * w), derivative_time, acceleration_time, 8.0 / l, 0.02 / l, 0.5)
    }
}

impl<S: Number> Law<S> for Pid<S> {
    fn step(&mut self, tick: &Tick<S>) -> S {
        let factors = [self.derivative_time, self.acceleration_time];
        let [e, slopes] = self.errors.seen(tick, factors, self.filter_time);
        fed_forward(tick, self.friction_share) + self.gain * (e + slopes) + self.errors.integral
    }

    fn given(&mut self, asked: S, tick: &Tick<S>) {
        self.errors.add_up(is_free(asked), self.gain / self.integral_time, tick);
    }
}
