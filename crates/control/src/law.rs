//! Laws: the command that takes a drive where it is to go.

mod fuzzy;
mod inversion;
/// Nonlinear predictive control.
pub mod nmpc;
mod pid;
mod sliding;

use crate::course::Course;
use crate::gains::{Choice, Factor, Gains};
use crate::model::Model;
use crate::number::{Memory, Number};
use crate::observer::State;
use crate::reference::Wanted;
use crate::spool::Spool;
use crate::thresholds::LEAST_LAG;
pub use fuzzy::{Fuzzy, sugeno};
pub use inversion::Inversion;
pub use nmpc::{Nmpc, Predicting, Predictor};
pub use pid::Pid;
pub use sliding::{Sliding, SuperTwisting};

/// Choices of laws.
pub const CHOICES: &[Choice] = &[Choice {
    law: "nmpc",
    key: "predictor",
    options: &["model", "circuit"],
    meaning: "who runs the horizon: the model in fixed steps, or the circuit that the law believes in, whatever it has",
}];

/// What a factor of a controller file multiplies; a factor that stands for no gain of a law means nothing to it.
pub const FACTORED: &[Factor] = &[
    Factor { law: "pid", key: "gain", gain: "gain" },
    Factor { law: "pid", key: "damping", gain: "derivative_time" },
    Factor { law: "pid", key: "filter", gain: "filter_time" },
    Factor { law: "fuzzy", key: "gain", gain: "gain" },
    Factor { law: "fuzzy", key: "damping", gain: "derivative_time" },
    Factor { law: "fuzzy", key: "filter", gain: "filter_time" },
    Factor { law: "sliding-mode", key: "gain", gain: "bandwidth" },
    Factor { law: "sliding-mode", key: "damping", gain: "width" },
    Factor { law: "super-twisting", key: "gain", gain: "bandwidth" },
    Factor { law: "super-twisting", key: "damping", gain: "band" },
    Factor { law: "inversion", key: "gain", gain: "bandwidth" },
    Factor { law: "nmpc", key: "gain", gain: "bandwidth" },
    Factor { law: "nmpc", key: "damping", gain: "move_penalty" },
];

/// What a drive is to its law at a place, from its description alone.
#[derive(Clone, Copy, Debug)]
pub struct Plant {
    /// Natural frequency of the mass on its air, shut in, rad/s.
    pub natural_frequency: f64,
    /// Its damping ratio.
    pub damping_ratio: f64,
    /// Steady speed for each share of opening, m/s.
    pub speed: f64,
    /// Rate of the force of a chamber at full opening, N/s.
    pub force_rate: f64,
    /// Time by which a command acts late, s: dead time, spool, half of the time for which it acts.
    pub lag: f64,
    /// Coulomb friction, N.
    pub coulomb: f64,
}

impl Plant {
    /// Bandwidth that leaves a margin for the lag, 0.22/lag, rad/s.
    pub fn bandwidth(&self) -> f64 {
        0.22 / self.lag.max(LEAST_LAG)
    }

    /// Of a model with its piston at x between the pressures `p` Pa, sampled with a period:
    ///
    ///   omega^2 = k (p_a A_a^2/V_a + p_b A_b^2/V_b)/M,   K_v = C rho0 R T/A,   zeta = Fv/(2 M omega)
    pub fn of(model: &Model, x: f64, p: [f64; 2], period: f64) -> Self {
        let k = model.gas.heat_capacity_ratio;
        let stiffness: f64 =
            (model.sides.iter().zip(p)).map(|(side, p)| k * p * side.area * side.area / side.volume(x)).sum();
        let natural_frequency = (stiffness / model.mass).sqrt();
        let [coulomb, viscous] = model.friction_levels([x, 1.0], p);
        let area = 0.5 * (model.sides[0].area + model.sides[1].area);
        // Choked exhaust: the gas leaves at its density times this volume flow.
        let volume_flow = model.volume_flow();
        let volume = 0.5 * (model.sides[0].volume(x) + model.sides[1].volume(x));
        Plant {
            natural_frequency,
            damping_ratio: viscous / (2.0 * model.mass * natural_frequency),
            speed: volume_flow / area,
            force_rate: k * volume_flow * model.supply.pressure * area / volume,
            lag: model.valve.lag() + 0.5 * model.valve.arrangement.acts_for(period),
            coulomb,
        }
    }
}

/// What a law is given at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Tick<'a, S = f64> {
    /// The belief.
    pub model: &'a Model,
    /// What the drive is about mid-stroke.
    pub plant: &'a Plant,
    /// The period, s.
    pub period: f64,
    /// The state when a command of now will act.
    pub state: State<S>,
    /// Its acceleration, m/s2.
    pub acceleration: S,
    /// Where the drive is to be then.
    pub wanted: Wanted<S>,
    /// Friction force along the reference, N, and its rate, N/s.
    pub friction: [S; 2],
    /// Position as it is measured now, m, and where the drive is to be now.
    pub now: (S, Wanted<S>),
    /// When a command of now will act, s: then the state is that of `state`.
    pub acts: f64,
    /// The spool then.
    pub spool: &'a Spool<S>,
    /// Where the drive is to go.
    pub preview: &'a Course<'a>,
}

impl<S: Number> Tick<'_, S> {
    /// Error of position, m, velocity and acceleration: wanted minus what will be.
    pub fn errors(&self) -> [S; 3] {
        let Wanted { position, velocity, acceleration, .. } = self.wanted;
        [position - self.state.position, velocity - self.state.velocity, acceleration - self.acceleration]
    }

    /// The share of opening under which the force of the gas changes at a rate, N/s, or the nearest that there is.
    pub fn opening_for(&self, rate: S) -> S {
        let (way, share) = self.model.opening_for(&self.state, rate);
        way * share.within(0.0, 1.0)
    }
}

/// The share of opening that makes a mass on its air follow a motion, with a share of the friction along it,
///
///   (v_d + 2 zeta a_d/omega + (j_d + share F_fr'/M)/omega^2)/K_v
fn fed_forward<S: Number>(tick: &Tick<S>, wanted: &Wanted<S>, share: S) -> S {
    let (w, zeta) = (tick.plant.natural_frequency, tick.plant.damping_ratio);
    let jerk = wanted.jerk + share * tick.friction[1] / S::c(tick.model.mass);
    (wanted.velocity + wanted.acceleration.times(2.0 * zeta / w) + jerk / S::c(w * w))
        / S::c(tick.plant.speed)
}

/// Whether a share of opening can be given as it is asked for.
fn is_free<S: Number>(asked: S) -> S::Mask {
    asked.abs().lt(S::c(1.0 + f64::EPSILON))
}

/// A law whose gains follow from the drive.
pub trait Tuned: Gains + Sized {
    /// Its word in a controller file.
    const KEY: &'static str;

    /// With gains that follow from the drive.
    fn tuned(model: &Model, plant: &Plant) -> Self;
}

/// A law. Its memory is numbers; it has no clock.
pub trait Law<S: Number = f64>: Memory<S> {
    /// It predicts the spool by itself: its state is that behind the dead time, not behind all of the lag.
    fn predicts(&self) -> bool {
        false
    }

    /// Rate at which a force grows that breaks a resting drive away, as a share of the bandwidth; zero: the law has
    /// a way of its own, or none.
    fn push(&self) -> f64 {
        0.0
    }

    /// The share of opening, -1 .. 1, before the overlap is taken into account; it may lie beyond.
    fn step(&mut self, tick: &Tick<S>) -> S;

    /// Told that the share that it asked for was given, within limits.
    fn given(&mut self, _asked: S, _tick: &Tick<S>) {}
}
