//! Delayed effects of commands in a session. The schedule sets the values that the equations read, and the integration
//! ends exactly on each entry.

use super::Session;
use crate::assembly::schedule::{Due, ScheduledAction, behind_play};
use crate::component::{Timing, average};
use crate::part::valves::signal;
use math::Lane;

/// Distance from its end of travel at which an armature counts as arrived.
const ARRIVED: f64 = 1e-9;

impl<R: Lane> Session<R> {
    /// Applies a command from now on.
    pub(super) fn command(&mut self, timing: usize, value: f64) {
        let now = self.time();
        let what = self.assembly.timings[timing];
        self.act(what.commanded(), value);
        match what {
            Timing::Follow { play, delay, .. } => {
                let remembered = self.circuit().input(what.input(signal::REMEMBERED)).get(0);
                let acts = behind_play(remembered, value, play);
                self.act(what.input(signal::REMEMBERED), acts);
                if delay == 0.0 {
                    self.act(what.input(signal::ACTS), acts);
                } else {
                    self.later(now + delay, timing, Due::Act, acts);
                }
            }
            Timing::Average { times, dead, pulses, .. } => {
                self.act(what.input(signal::ACTS), average(value, times, dead, pulses));
            }
            Timing::Travel { pulses: None, .. } => self.switch(timing, value),
            // A command shorter than the dead time has no effect.
            Timing::Keep { .. } if value == 0.0 => self.forget(timing, Due::Start),
            Timing::Keep { .. } => self.switch(timing, f64::from(u8::from(value > 0.0))),
            Timing::Travel { pulses: Some(period), .. } => {
                if !self.is_due(timing, Due::Rise) {
                    self.later((now / period).ceil() * period, timing, Due::Rise, 0.0);
                }
            }
        }
    }

    /// Replays the schedule up to a time, s. Only valves move: their commands determine their motion.
    pub(crate) fn recall(&mut self, until: f64) {
        loop {
            let next = self.next(until);
            let to = next.map_or(until, |place| self.schedule[place].0.min(until));
            let (mut y, lapse) = (self.state().to_vec(), to - self.time());
            if lapse > 0.0 {
                let coast = |timing: &Timing| self.circuit().coast(timing.part(), &mut y, lapse, until - to);
                self.assembly.timings.iter().for_each(coast);
                self.stepper.skip(to, &y);
            }
            let Some(place) = next else { return };
            let (_, what, value) = self.schedule.remove(place);
            self.happen(what, value);
        }
    }

    /// Direction of an armature after its last switch: -1, 0 (at rest) or 1.
    fn goal(&self, timing: usize) -> f64 {
        let what = self.assembly.timings[timing];
        let entry =
            |due: Due| self.schedule.iter().find(|entry| entry.1 == ScheduledAction::Timing(timing, due));
        if let Some(&(_, _, to)) = entry(Due::Start) {
            return to;
        }
        let speed = self.circuit().input(what.input(signal::ACTS)).get(0);
        let left = entry(Due::Act).map_or(0.0, |(arrives, ..)| arrives - self.time());
        (self.circuit().part_state(what.part(), self.state()).get(0) + speed * left).round()
    }

    /// Switches an armature. The travel starts after the dead time, unless the valve is switched back before. A
    /// repeated switch in the
    /// present direction has no effect.
    fn switch(&mut self, timing: usize, to: f64) {
        let (Timing::Travel { dead, .. } | Timing::Keep { dead, .. }) = self.assembly.timings[timing] else {
            return;
        };
        if self.goal(timing) == to {
            return;
        }
        self.forget(timing, Due::Start);
        self.later(self.time() + dead[usize::from(to == 0.0)], timing, Due::Start, to);
    }

    /// Applies an entry of a timing that is due now.
    pub(super) fn happens(&mut self, timing: usize, due: Due, value: f64) {
        let (now, what) = (self.time(), self.assembly.timings[timing]);
        match (due, what) {
            (Due::Act, _) => self.act(what.input(signal::ACTS), value),
            (Due::Start, Timing::Travel { travel, .. } | Timing::Keep { travel, .. }) => {
                self.forget(timing, Due::Act);
                let left = value - self.circuit().part_state(what.part(), self.state()).get(0);
                let time = left.abs() * travel[usize::from(value == 0.0)];
                let moves = left.abs() > ARRIVED;
                self.act(what.input(signal::ACTS), if moves { left / time } else { 0.0 });
                if moves {
                    self.later(now + time, timing, Due::Act, 0.0);
                }
            }
            (Due::Rise, Timing::Travel { pulses: Some(period), .. }) => {
                let share = self.circuit().input(what.commanded()).get(0);
                self.switch(timing, f64::from(u8::from(share > 0.0)));
                if share > 0.0 && share < 1.0 {
                    self.later(now + share * period, timing, Due::Fall, 0.0);
                }
                self.later(((now / period).round() + 1.0) * period, timing, Due::Rise, 0.0);
            }
            (Due::Fall, _) => self.switch(timing, 0.0),
            _ => {}
        }
    }
}
