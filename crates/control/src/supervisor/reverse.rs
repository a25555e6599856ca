//! Commands that act in reverse, as a force without pressure sensors tells it.

use crate::observer::State;

/// Time over which force and velocity are compared with what they have been, s (assumed).
const LATELY: f64 = 0.01;
/// Change of the unknown force against the command, as a share of the Coulomb friction, and of the velocity, m/s, from which
/// on a command acts in reverse, and for how long, s (assumed).
const FORCE: f64 = 1.0;
const VELOCITY: f64 = 0.01;
const FOR: f64 = 3e-3;

/// A supply that presses less than the chamber that a command opens to it takes air from that chamber: the force that the
/// command should give is missing more and more, and the drive is driven against the command.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reverse {
    /// Unknown force, N, and velocity, m/s, as they have been lately.
    lately: Option<[f64; 2]>,
    /// For how long both have gone against the command, s.
    seen_for: f64,
}

impl Reverse {
    /// The way of commands that act in reverse, if that is seen by now: from the command of the last sample and the state.
    pub fn watch(&mut self, command: f64, state: &State, coulomb: f64, period: f64) -> Option<f64> {
        let now = [state.disturbance, state.velocity];
        let lately = self.lately.get_or_insert(now);
        let way = command.signum();
        let [force, velocity] = [0, 1].map(|i| way * (now[i] - lately[i]));
        let share = period / (period + LATELY);
        lately.iter_mut().zip(now).for_each(|(own, now)| *own += share * (now - *own));
        let is_driven = velocity < -VELOCITY && way * state.velocity < 0.0;
        let is_seen = command != 0.0 && force < -FORCE * coulomb && is_driven;
        self.seen_for = if is_seen { self.seen_for + period } else { 0.0 };
        (self.seen_for >= FOR).then_some(way)
    }
}
