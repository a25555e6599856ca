//! Common types of all controllers: their inputs for one sample, and their traits.

use crate::course::Course;
use crate::model::Model;
use crate::number::{Memory, Number};
use crate::reference::Wanted;
use crate::spool::Spool;
use crate::types::{Coupled, Plant, State};

/// Inputs of a law for one sample.
#[derive(Clone, Copy, Debug)]
pub struct Tick<'a, S = f64> {
    /// The belief.
    pub model: &'a Model<S>,
    /// Linear model of the drive at mid-stroke.
    pub plant: &'a Plant,
    /// The period, s.
    pub period: f64,
    /// Predicted state when the present command acts.
    pub state: State<S>,
    /// Its acceleration, m/s2.
    pub acceleration: S,
    /// Wanted state at the time when the command acts.
    pub wanted: Wanted<S>,
    /// Friction force along the reference, N, and the rate of friction and load there, N/s.
    pub friction: [S; 2],
    /// Measured position now, m, and wanted state now.
    pub now: (S, Wanted<S>),
    /// Time at which the present command acts, s: the time of `state`.
    pub acts: f64,
    /// The spool then.
    pub spool: &'a Spool<S>,
    /// Course of the drive.
    pub preview: &'a Course<'a>,
    /// Influence of other axes that move the same body.
    pub coupled: Option<Coupled>,
}

impl<S: Number> Tick<'_, S> {
    /// Returns the errors of position, m, velocity and acceleration: wanted minus predicted.
    pub fn errors(&self) -> [S; 3] {
        let Wanted { position, velocity, acceleration, .. } = self.wanted;
        [position - self.state.position, velocity - self.state.velocity, acceleration - self.acceleration]
    }

    /// Returns the fraction of opening under which the force of the gas changes at a rate, N/s, or the nearest
    /// possible one.
    pub fn opening_for(&self, rate: S) -> S {
        let (way, share) = self.model.opening_for(&self.state, rate);
        way * share.within(0.0, 1.0)
    }
}

/// Returns the fraction of opening that makes a mass on its air follow a motion, with a fraction of the friction:
///
///   (v_d + 2 zeta a_d/omega + (j_d + share F_fr'/M)/omega^2)/K_v
pub(super) fn fed_forward<S: Number>(tick: &Tick<S>, share: S) -> S {
    let Tick { wanted, .. } = tick;
    let (w, zeta) = (tick.plant.natural_frequency, tick.plant.damping_ratio);
    let jerk = wanted.jerk + share * tick.friction[1] / tick.model.mass;
    (wanted.velocity + wanted.acceleration.times(2.0 * zeta / w) + jerk / S::c(w * w))
        / S::c(tick.plant.speed)
}

/// Returns whether a fraction of opening is possible without saturation.
pub(super) fn is_free<S: Number>(asked: S) -> S::Mask {
    asked.abs().lt(S::c(1.0 + f64::EPSILON))
}

/// Features of a law that its observer and its follower need.
#[derive(Clone, Copy, Debug)]
pub struct Features {
    /// Whether the law predicts the spool. The state is then predicted over the dead time only, not over the whole lag.
    pub predicts: bool,
    /// Expected random walk of the unexplained force in the observer, relative to the usual value.
    pub wander: f64,
    /// Growth rate of the force that breaks a resting drive away, relative to the bandwidth. Zero means that the law
    /// does not add such a force.
    pub push: f64,
}

impl Features {
    /// Features of most laws.
    pub const USUAL: Self = Features { predicts: false, wander: 1.0, push: 0.0 };
}

/// A law. The memory of a law consists of numbers. A law has no clock.
pub trait Law<S: Number = f64>: Memory<S> {
    /// Features of the law.
    const FEATURES: Features = Features::USUAL;

    /// Returns the features of this law.
    fn features(&self) -> Features {
        Self::FEATURES
    }

    /// Returns the fraction of opening, before the overlap is added. It may exceed -1 .. 1.
    fn step(&mut self, tick: &Tick<S>) -> S;

    /// Returns acceleration, m/s2, and jerk, m/s3, that the law adds to those of the reference, if it inverts a model.
    fn feedback(&self, _tick: &Tick<S>) -> [S; 2] {
        [S::zero(); 2]
    }

    /// Called with the requested fraction of opening after saturation, for anti-windup.
    fn given(&mut self, _asked: S, _tick: &Tick<S>) {}
}
