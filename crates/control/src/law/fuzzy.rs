use super::base::{Law, Tick, fed_forward, is_free};
use super::pid::{Errors, Pid};
use crate::gains::law;
use crate::model::Model;
use crate::number::Number;
use crate::types::Plant;
use physics::{above, at_least};

/// Sets on each side of zero: negative and positive big, medium, small.
const SETS: f64 = 3.0;

law! {
    /// A fuzzy controller. Rules "if the error is big and its slope is small, then ..." replace the feedback of
    /// [`Pid`](super::Pid) without its integral. Feed-forward and integral are those of `Pid`.
    ///
    ///   u_fb = k_p e_max phi(e/e_max, (T_d e' + T_a e'')/e_max).
    ///
    /// Both inputs have seven triangular sets at -1, -2/3 .. 1, which overlap by half. The rule for sets i and j asks
    /// for the set i + j within -3 .. 3. [`sugeno`] gives phi.
    pub struct Fuzzy {
        gain: "1/m", at_least(0.0), "k_p", rule "as of pid", factor "gain";
        derivative_time: "s", at_least(0.0), "T_d", rule "as of pid", factor "damping";
        acceleration_time: "s2", at_least(0.0), "T_a", rule "as of pid", factor "damping";
        integral_time: "s", above(0.0), "T_i", rule "as of pid";
        filter_time: "s", at_least(0.0), "time constant of T_d e' + T_a e''", rule "as of pid", factor "filter";
        friction_share: "1", at_least(0.0), "fraction of the friction that is fed forward", rule "0.5, assumed";
        error_range: "m", above(0.0), "e_max", rule "30 mm, assumed";
    } memory<S> { errors: Errors<S> }
}

/// Returns two pairs, for an error and its slope, each relative to its range. A pair is the lower one of its two
/// sets, -3 .. 2, and the degree of membership in the upper one.
fn belongs<S: Number>(e: S, de: S) -> [(S, S); 2] {
    let one = S::one();
    [e, de].map(|share| {
        let place = share.limited().times(SETS);
        // Index of the lower set.
        let lower = [-2.0, -1.0, 0.0, 1.0, 2.0]
            .iter()
            .fold(S::c(-SETS), |lower, &set| lower + S::select(place.lt(S::c(set)), S::zero(), one));
        (lower, place - lower)
    })
}

/// Returns the output of the rules, -1 .. 1, with products as weights and singletons as outputs. If |i + j| <= 3 for
/// all active rules, the output is the sum of both numbers. The law is linear there, and saturates beyond.
pub fn sugeno<S: Number>(e: S, de: S) -> S {
    let one = S::one();
    let [(i, by_i), (j, by_j)] = belongs(e, de);
    let rule = |i: S, j: S| (i + j).within(-SETS, SETS) / S::c(SETS);
    let row = |i: S| (one - by_j) * rule(i, j) + by_j * rule(i, j + one);
    (one - by_i) * row(i) + by_i * row(i + one)
}

impl Fuzzy {
    pub(super) fn tuned(model: &Model, plant: &Plant) -> Self {
        let Pid {
            gain, derivative_time, acceleration_time, integral_time, filter_time, friction_share, ..
        } = Pid::tuned(model, plant);
        Fuzzy::new(gain, derivative_time, acceleration_time, integral_time, filter_time, friction_share, 0.03)
    }
}

impl<S: Number> Law<S> for Fuzzy<S> {
    fn step(&mut self, tick: &Tick<S>) -> S {
        let factors = [self.derivative_time, self.acceleration_time];
        let [e, slopes] = self.errors.seen(tick, factors, self.filter_time);
        let range = self.error_range;
        fed_forward(tick, self.friction_share)
            + self.gain * range * sugeno(e / range, slopes / range)
            + self.errors.integral
    }

    fn given(&mut self, asked: S, tick: &Tick<S>) {
        self.errors.add_up(is_free(asked), self.gain / self.integral_time, tick);
    }
}
