//! Events of a supervisor.

macro_rules! events {
    ($($name:ident: $key:literal, $unit:literal, $text:literal;)*) => {
        /// Kinds of events.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum EventKind {
            $(#[doc = $text] $name,)*
        }

        impl EventKind {
            /// Key of each kind, unit of its value in SI (`1` for a pure number), and meaning of kind and value.
            pub const ALL: &'static [(&'static str, &'static str, &'static str)] = &[$(($key, $unit, $text)),*];

            /// Its key.
            pub fn key(self) -> &'static str {
                Self::ALL[self as usize].0
            }
        }
    };
}

events! {
    Reference: "reference", "m", "the reference is no number, jumps or leaves the limits: stop ramp; value: the position of the reference";
    Clock: "clock", "s", "the clock goes back or skips samples: stop ramp; value: the error of the clock";
    PositionPredicted: "position-predicted", "m", "a reading of the position is not credible and is replaced by the model; value: its distance from the model";
    PositionLost: "position-lost", "m", "three readings of the position in a row are not credible; value: the distance from the model";
    PressureLost: "pressure-lost", "1", "a pressure sensor is not credible: that chamber runs by the model; value: 0 chamber a, 1 chamber b";
    Supply: "supply", "Pa", "the supply pressure has fallen, or the valve does not open; value: the supply pressure that explains the filling, or the pressure of a chamber that is not filled";
    Valve: "valve", "Pa", "the valve does not react: one chamber is not filled and the other one does not vent; value: the missing change of pressure";
    EndStop: "end-stop", "m/s", "the drive nears an end stop faster than it can be braked: full braking; value: the velocity";
    Limit: "limit", "m", "a limit of position, speed or pressure is passed: stop ramp; value: the position";
    LimitSwitch: "limit-switch", "m", "a limit switch is reached: the command may only lead away; value: the position";
    EmergencyStop: "emergency-stop", "m/s", "emergency stop: stop ramp, then hold; value: the velocity";
    Disabled: "disabled", "m/s", "enable is lost: the valve is shut, the law rests; value: the velocity";
    Enabled: "enabled", "m", "the drive is enabled again and returns to the reference; value: the distance from the reference";
    Late: "late", "1", "a step of the law is late: the last command stays; value: late steps in a row";
    LawFailed: "law-failed", "1", "the law returns no number: the last command is kept; value: number of such steps in a row";
    StandBy: "stand-by", "1", "the stand-by law takes over; value: its number among the laws";
    Stopped: "stopped", "m", "the drive is at rest after a stop ramp; value: the position";
    NoAir: "no-air", "Pa", "the drive does not move: there is no air pressure; value: the higher gauge pressure";
    Blocked: "blocked", "N", "the drive does not move: its air force is above its friction; value: the air force";
    Stuck: "stuck", "N", "the drive does not move: its air force is within its friction; value: the air force";
    NotSettled: "not-settled", "m", "the drive rests outside its tolerance; value: the error";
    LimitCycle: "limit-cycle", "m", "the drive swings about its target or along its reference: a limit cycle; value: peak to peak";
    RestLost: "rest-lost", "m", "a drive that is held leaves its rest: holding ends and the law takes over; value: the distance";
}

/// Something that happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Time, s.
    pub time: f64,
    /// Kind of the event.
    pub kind: EventKind,
    /// The value, in the unit of its kind.
    pub value: f64,
}

/// Largest number of events that are stored.
const KEPT: usize = 256;

/// Events in the order of their times.
#[derive(Clone, Debug)]
pub struct Log {
    /// The first events.
    pub events: Vec<Event>,
}

impl Default for Log {
    fn default() -> Self {
        Log { events: Vec::with_capacity(KEPT) }
    }
}

impl Log {
    pub(super) fn tell(&mut self, time: f64, kind: EventKind, value: f64) {
        if self.events.len() < KEPT {
            self.events.push(Event { time, kind, value });
        }
    }
}
