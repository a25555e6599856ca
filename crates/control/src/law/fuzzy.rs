use super::pid::Errors;
use super::{Law, Plant, Tick, Tuned, fed_forward, is_free};
use crate::gains::law;
use crate::law::Pid;
use crate::model::Model;
use crate::number::{Memory, Number};
use physics::{above, at_least};

/// How the rules of a fuzzy controller become a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inference {
    /// Products and singletons: see [`sugeno`].
    #[default]
    Sugeno,
    /// Minimum, maximum and centroid: see [`mamdani`].
    Mamdani,
}

impl Inference {
    /// Their words.
    pub const WORDS: &'static [&'static str] = &["sugeno", "mamdani"];

    /// The one called so.
    pub fn called(word: &str) -> Option<Self> {
        [Inference::Sugeno, Inference::Mamdani]
            .into_iter()
            .zip(Self::WORDS)
            .find(|own| *own.1 == word)
            .map(|own| own.0)
    }
}

impl<S> Memory<S> for Inference {
    fn each(&mut self, _see: &mut dyn FnMut(&mut S)) {}
}

/// Sets on each side of zero: negative and positive big, medium, small.
const SETS: f64 = 3.0;

law! {
    /// A fuzzy controller: rules "if the error is big and its slope is small, then ...", in the place of the proportional
    /// and derivative part of [`Pid`](super::Pid), with the same feed-forward and integral.
    ///
    ///   u_fb = k_p e_max phi(e/e_max, T_d e'/e_max)
    ///
    /// Seven triangular sets for each of both, at -1, -2/3 .. 1, which overlap by half; the rule for sets i and j asks
    /// for the set i + j within -3 .. 3. How that becomes phi is chosen: see [`Inference`].
    pub struct Fuzzy {
        gain: "1/m", at_least(0.0), "k_p", rule "zeta omega/K_v";
        derivative_time: "s", at_least(0.0), "T_d", rule "0.5/omega";
        integral_time: "s", above(0.0), "T_i", rule "4/omega";
        filter_time: "s", at_least(0.0), "time constant of the slope of the error", rule "0.1/omega";
        friction_share: "1", at_least(0.0), "share of the friction that is fed forward", rule "0.5, assumed";
        error_range: "m", above(0.0), "e_max", rule "30 mm, assumed";
    } memory<S> { errors: Errors<S> = Errors::none(), inference: Inference = Inference::Sugeno }
}

/// Of an error and its slope, each as a share of its range, the lower one of the two sets that it belongs to, -3 .. 2, and
/// how much it belongs to the upper one.
fn belongs<S: Number>(e: S, de: S) -> [(S, S); 2] {
    let one = S::one();
    [e, de].map(|share| {
        let place = share.limited().times(SETS);
        // The first one, counted up.
        let lower = [-2.0, -1.0, 0.0, 1.0, 2.0]
            .iter()
            .fold(S::c(-SETS), |lower, &set| lower + S::select(place.lt(S::c(set)), S::zero(), one));
        (lower, place - lower)
    })
}

/// What the rules give with products as weights and singletons as outputs: a number of -1 .. 1. Where |i + j| <= 3 for all
/// rules that speak, it is the sum of both numbers: the law is the linear one there, and saturates beyond.
pub fn sugeno<S: Number>(e: S, de: S) -> S {
    let one = S::one();
    let [(i, by_i), (j, by_j)] = belongs(e, de);
    let rule = |i: S, j: S| (i + j).within(-SETS, SETS) / S::c(SETS);
    let row = |i: S| (one - by_j) * rule(i, j) + by_j * rule(i, j + one);
    (one - by_i) * row(i) + by_i * row(i + one)
}

/// What the rules give with the minimum as weight, output sets cut at it, the maximum of them all and its centroid
/// (Mamdani): a number of -1 .. 1, that of [`sugeno`] where both numbers are centres of sets. Output sets have the form of
/// the others, whole at both ends.
pub fn mamdani<S: Number>(e: S, de: S) -> S {
    let (zero, one) = (S::zero(), S::one());
    let [(i, by_i), (j, by_j)] = belongs(e, de);
    let (not_i, not_j) = (one - by_i, one - by_j);
    let weights = [not_i.min(not_j), not_i.min(by_j).max(by_i.min(not_j)), by_i.min(by_j)];
    let asked = [0.0, 1.0, 2.0].map(|more| (i + j + S::c(more)).within(-SETS, SETS));
    let height = |set: f64| {
        let cut = asked.into_iter().zip(weights);
        cut.fold(zero, |most, (asked, weight)| {
            most.max(S::select((asked - S::c(set)).abs().lt(S::c(0.5)), weight, zero))
        })
    };
    // Between the centres of two sets cut at a and b, not both above 1/2: area, and moment about the higher one's.
    let powers = |t: S| t * t * (S::c(0.5) - t.times(1.0 / 3.0));
    let between = |high: S, low: S| {
        let [far, near] = [one - low, one - high];
        let area = high + (low * low - high * high).times(0.5);
        let moment = (high * near * near + low * (one - far * far)).times(0.5) + powers(far) - powers(near);
        (area, moment)
    };
    let (mut area, mut moment, mut before) = (zero, zero, zero);
    for set in -3..=4 {
        let set = f64::from(set);
        let own = if set > SETS { zero } else { height(set) };
        let (more, from_higher) = between(before.max(own), before.min(own));
        let from_own = S::select(before.lt(own), from_higher, more - from_higher);
        (area, moment) = (area + more, moment + more.times(set) - from_own);
        before = own;
    }
    moment / area.times(SETS)
}

impl<S> Fuzzy<S> {
    /// The same with rules that become a number so.
    #[must_use]
    pub fn inferring(self, inference: Inference) -> Self {
        Fuzzy { inference, ..self }
    }

    /// How its rules become a number.
    pub fn inference(&self) -> Inference {
        self.inference
    }
}

impl Tuned for Fuzzy {
    const KEY: &'static str = "fuzzy";

    fn tuned(model: &Model, plant: &Plant) -> Self {
        let Pid { gain, derivative_time, integral_time, filter_time, friction_share, .. } =
            <Pid as Tuned>::tuned(model, plant);
        Fuzzy::new(gain, derivative_time, integral_time, filter_time, friction_share, 0.03)
    }
}

impl<S: Number> Law<S> for Fuzzy<S> {
    fn step(&mut self, tick: &Tick<S>) -> S {
        let [e, slope] = self.errors.seen(tick, self.filter_time);
        let range = self.error_range;
        let rules = match self.inference {
            Inference::Sugeno => sugeno,
            Inference::Mamdani => mamdani,
        };
        fed_forward(tick, &tick.now.1, self.friction_share)
            + self.gain * range * rules(e / range, self.derivative_time * slope / range)
            + self.errors.integral
    }

    fn given(&mut self, asked: S, tick: &Tick<S>) {
        self.errors.add_up(is_free(asked), self.gain / self.integral_time, tick);
    }
}
