use super::{Law, Plant, Tick, fed_forward};
use crate::gains::law;
use crate::model::Model;
use physics::{above, at_least};

/// An error with its slope behind a filter, and its integral, from the position as it is measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Errors {
    last: Option<f64>,
    slope: f64,
    /// Of the error, as a share of opening.
    pub integral: f64,
}

impl Errors {
    /// The error and its slope.
    pub fn seen(&mut self, tick: &Tick, filter_time: f64) -> [f64; 2] {
        let (position, wanted) = tick.now;
        let e = wanted.position - position;
        let slope = self.last.map_or(0.0, |last| (e - last) / tick.period);
        self.slope += (slope - self.slope) * tick.period / (tick.period + filter_time);
        self.last = Some(e);
        [e, self.slope]
    }

    /// The integral goes on at a rate for each metre, 1/(m s), where the command was not at its limit.
    pub fn add_up(&mut self, is_free: bool, rate: f64, tick: &Tick) {
        if is_free {
            self.integral += rate * (tick.now.1.position - tick.now.0) * tick.period;
        }
    }
}

law! {
    /// PID with feed-forward of velocity, acceleration, jerk and friction; it needs a position sensor alone:
    ///
    ///   u = (v_d + 2 zeta a_d/omega + (j_d + share F_fr'/M)/omega^2)/K_v + k_p (e + T_d e') + k_p/T_i int e
    ///
    /// omega and zeta of the mass on its air, K_v its speed for each share of opening. The integral stands while the
    /// command is at its limit.
    pub struct Pid {
        gain: "1/m", at_least(0.0), "k_p", rule "zeta omega/K_v";
        derivative_time: "s", at_least(0.0), "T_d", rule "0.5/omega";
        integral_time: "s", above(0.0), "T_i", rule "4/omega";
        filter_time: "s", at_least(0.0), "time constant of the slope of the error", rule "0.1/omega";
        friction_share: "1", at_least(0.0), "share of the friction that is fed forward", rule "0.5, assumed";
    } memory { errors: Errors = Errors::default() }
}

impl Law for Pid {
    const KEY: &'static str = "pid";

    fn tuned(_model: &Model, plant: &Plant) -> Self {
        let w = plant.natural_frequency;
        Pid::new(plant.damping_ratio * w / plant.speed, 0.5 / w, 4.0 / w, 0.1 / w, 0.5)
    }

    fn step(&mut self, tick: &Tick) -> f64 {
        let [e, slope] = self.errors.seen(tick, self.filter_time);
        fed_forward(tick, &tick.now.1, self.friction_share)
            + self.gain * (e + self.derivative_time * slope)
            + self.errors.integral
    }

    fn given(&mut self, asked: f64, given: f64, tick: &Tick) {
        self.errors.add_up(asked == given, self.gain / self.integral_time, tick);
    }
}
