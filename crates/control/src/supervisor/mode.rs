//! Modes of a drive: it follows its reference, returns to it, stops, or rests with its valve shut.

use super::event::{EventKind, Log};
use crate::course::{Course, Fade};
use crate::follower::Follower;
use crate::reference::{Reference, Wanted};
use crate::thresholds::{STOP_APART, STOP_NEAR};
use crate::types::State;

/// Mode of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Mode {
    #[default]
    Follows,
    /// Back to the reference.
    Returns(Fade),
    /// Stop ramp to rest, then the law holds the position.
    Stops {
        fade: Fade,
        at: f64,
        stood: bool,
        /// The valve is shut at rest.
        shuts: bool,
    },
    /// The valve is shut.
    Shut,
    /// The valve is shut until the drive is enabled.
    Off,
}

impl Mode {
    /// The valve is shut, and the law is suspended.
    pub fn is_shut(&self) -> bool {
        matches!(self, Mode::Shut | Mode::Off)
    }

    /// The drive follows its reference, or returns to it.
    pub fn moves(&self) -> bool {
        matches!(self, Mode::Follows | Mode::Returns(_))
    }

    /// Returns a stop ramp with a deceleration, m/s2. It begins at the wanted position, or at the actual position if the
    /// two differ, and ends before the end stop.
    pub fn stop(
        time: f64,
        own: &Follower,
        state: &State,
        followed: Option<Wanted>,
        deceleration: f64,
    ) -> Self {
        let (model, period) = (&own.model, own.period);
        let seen = [state.position, state.velocity, model.acceleration(state)];
        let from = followed.map_or(seen, |last| {
            let Wanted { position, velocity, acceleration, jerk } = last;
            let x = position + period * (velocity + 0.5 * period * acceleration);
            let v = velocity + period * acceleration;
            if (x - state.position).abs() < STOP_NEAR { [x, v, acceleration + period * jerk] } else { seen }
        });
        let ahead = if from[1] > 0.0 { model.stroke - from[0] } else { from[0] };
        let (fade, at) = Fade::stop(time, from, deceleration, ahead - STOP_APART);
        Mode::Stops { fade, at, stood: false, shuts: false }
    }

    /// Returns the course at a time, s, and notes that a ramp has ended.
    pub fn course<'a>(
        &mut self,
        time: f64,
        state: &State,
        reference: &'a Reference,
        log: &mut Log,
    ) -> Course<'a> {
        match self {
            Mode::Returns(fade) if fade.end() > time => Course { fade: Some(*fade), ..reference.into() },
            Mode::Stops { fade, at, stood, shuts } => {
                if fade.end() <= time && !*stood {
                    *stood = true;
                    log.tell(time, EventKind::Stopped, state.position);
                }
                let course = Course { reference: None, stands_at: *at, fade: Some(*fade) };
                if *stood && *shuts {
                    *self = Mode::Shut;
                }
                course
            }
            Mode::Shut | Mode::Off => reference.into(),
            mode => {
                *mode = Mode::Follows;
                reference.into()
            }
        }
    }
}
