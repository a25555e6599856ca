//! A controller: a law with its observer behind a supervisor. It turns samples into commands.

use crate::follower::{Answer, Follower};
use crate::law::{AnyLaw, Law};
use crate::model::Model;
use crate::reference::{Effort, Reference};
use crate::supervisor::{Rules, Supervisor};
use crate::types::Sample;
use std::ops::{Deref, DerefMut};

/// A law that follows references, and its supervisor. The members of the [`Follower`] are used as its own.
#[derive(Clone, Debug)]
pub struct Controller {
    follower: Follower,
    /// Supervisor of the law, if there is one.
    pub supervisor: Option<Box<Supervisor>>,
}

/// Standby law, unless the user names another one.
const STANDBY: &str = "inversion";

impl Controller {
    /// Returns the controller with the law of this key and gains from the model alone. The period is in s and the
    /// deviation of the position sensor in m.
    pub fn tuned(key: &str, model: &Model, period: f64, deviation: f64) -> Option<Self> {
        let follower = Follower::tuned(key, model, period, deviation)?;
        let standby = AnyLaw::tuned(STANDBY, model, &follower.plant)?;
        Some(Controller { follower, supervisor: Some(Box::new(Supervisor::new(Rules::default(), standby))) })
    }

    /// Returns the command for a sample along a reference, and passes it to the valve unchanged.
    pub fn step(&mut self, sample: &Sample, reference: &Reference) -> Answer {
        let answer = self.decide(sample, reference);
        let time = self.supervisor.as_ref().map_or(sample.time, |own| own.corrected(sample.time));
        self.give(time, answer.command);
        answer
    }

    /// Returns the command for a sample along a reference; [`Follower::give`] comes next. Without a supervisor, a
    /// sample that is not a number gives a command that is not a number.
    pub fn decide(&mut self, sample: &Sample, reference: &Reference) -> Answer {
        let Controller { follower, supervisor } = self;
        if let Some(Effort { mass, load, .. }) = reference.effort(sample.time) {
            // A law that predicts would let the deviations of now last through its horizon, and swing with the others.
            follower.coupled = follower.coupled.filter(|_| !follower.law.features().predicts);
            let load = load + follower.coupled.map_or(0.0, |own| own.loads[0]);
            match &mut follower.adaptation {
                Some(adaptation) => adaptation.expect(&mut follower.model, mass, load),
                None => (follower.model.mass, follower.model.load) = (mass, load),
            }
        }
        if let Some(supervisor) = supervisor {
            return supervisor.decide(follower, sample, reference);
        }
        let numbers = [sample.position].into_iter().chain(sample.pressures.into_iter().flatten());
        if numbers.into_iter().any(|own| !own.is_finite()) {
            return follower.rest(reference.at(sample.time), f64::NAN);
        }
        follower.learn(sample, true);
        follower.ask(sample, &reference.into())
    }
}

impl Deref for Controller {
    type Target = Follower;

    fn deref(&self) -> &Follower {
        &self.follower
    }
}

impl DerefMut for Controller {
    fn deref_mut(&mut self) -> &mut Follower {
        &mut self.follower
    }
}
