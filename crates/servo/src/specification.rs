//! Descriptions in SI units, as they arrive from Python.

use crate::sensor::{Encoder, Sensor};
use circuit::specification::{self, Circuit};
use control::{COEFFICIENTS, Effort, Efforts, FACTORS, MotionRules, Move, Piece, Reaction, Reference, Rules};
use serde::Deserialize;
use std::collections::BTreeMap;

specification::from_json!(Controller, Motion, Setup);

/// A controller: a law, and its model of the drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Its word.
    pub law: String,
    /// s.
    pub period_s: f64,
    /// Gains by their keys; gains that are left out are derived from the drive.
    #[serde(default)]
    pub gains: BTreeMap<String, f64>,
    /// Factors of its gains: gain, damping, filter.
    #[serde(default = "ones")]
    pub factors: [f64; FACTORS.len()],
    /// Numbers of the valves by their keys, unless there is one proportional valve; numbers that are left out are
    /// derived from the drive.
    #[serde(default)]
    pub valves: BTreeMap<String, f64>,
    /// Holding at rest; `None`: the drive is never held.
    pub hold: Option<Hold>,
    /// Whether the controller learns friction and valve of its drive during the run.
    #[serde(default = "yes")]
    pub adaptation: bool,
    /// Supervisor of the law; `None`: one with the usual rules.
    pub supervision: Option<Supervision>,
    /// The controller model of the drive.
    #[serde(deserialize_with = "specification::within")]
    pub belief: Circuit,
}

fn once() -> u32 {
    1
}

fn ones() -> [f64; FACTORS.len()] {
    [1.0; FACTORS.len()]
}

fn yes() -> bool {
    true
}

/// Standing still.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hold {
    /// m.
    pub band_m: f64,
    /// s.
    pub after_s: f64,
}

/// Reference of the drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Motion {
    /// Moves, one after the other.
    Moves {
        /// m.
        start_m: f64,
        /// Begin, s, duration, s, and position, m, of each.
        moves: Vec<[f64; 3]>,
    },
    /// A sine about a centre.
    Sine {
        /// m.
        centre_m: f64,
        /// m.
        amplitude_m: f64,
        /// Hz.
        frequency_hz: f64,
    },
    /// Polynomials, one after the other.
    Pieces {
        /// m.
        start_m: f64,
        /// For each polynomial: begin, s, duration, s, and coefficients, m, of the powers of the elapsed fraction of
        /// the duration.
        pieces: Vec<[f64; 2 + COEFFICIENTS]>,
        /// Moving mass and load along them.
        #[serde(default)]
        efforts: Option<MotionEfforts>,
    },
}

/// Moving mass and load at times at equal distances.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionEfforts {
    /// s.
    pub period_s: f64,
    /// Mass, kg, load, N, and its rate, N/s, at each time.
    pub rows: Vec<[f64; 3]>,
    /// Part of the force of each axis of the run that acts as a load, at each time.
    #[serde(default)]
    pub others: Vec<Vec<f64>>,
}

impl From<&Motion> for Reference {
    fn from(motion: &Motion) -> Self {
        match motion {
            Motion::Moves { start_m, moves } => Reference::Moves {
                start: *start_m,
                moves: moves.iter().map(|&[begin, duration, to]| Move { begin, duration, to }).collect(),
            },
            Motion::Sine { centre_m, amplitude_m, frequency_hz } => {
                Reference::Sine { centre: *centre_m, amplitude: *amplitude_m, frequency: *frequency_hz }
            }
            Motion::Pieces { start_m, pieces, efforts } => Reference::Pieces {
                start: *start_m,
                pieces: (pieces.iter())
                    .map(|own| Piece {
                        begin: own[0],
                        duration: own[1],
                        coefficients: std::array::from_fn(|i| own[2 + i]),
                    })
                    .collect(),
                efforts: efforts.as_ref().map(|own| Efforts {
                    period: own.period_s,
                    others: own.others.clone(),
                    rows: (own.rows.iter())
                        .map(|&[mass, load, load_rate]| Effort { mass, load, load_rate })
                        .collect(),
                }),
            },
        }
    }
}

/// An encoder.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionSensor {
    /// m; zero: none.
    pub resolution_m: f64,
    /// m.
    pub noise_m: f64,
}

impl From<PositionSensor> for Encoder {
    fn from(own: PositionSensor) -> Self {
        Encoder { resolution: own.resolution_m, noise: own.noise_m }
    }
}

/// A pressure sensor.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PressureSensor {
    /// Range, Pa absolute.
    pub range_pa: [f64; 2],
    /// Resolution over the range; zero: none.
    pub bits: u32,
    /// Pa.
    pub noise_pa: f64,
    /// Pa.
    pub zero_pa: f64,
    /// Relative.
    pub gain_error: f64,
    /// Time constant, s.
    pub lag_s: f64,
}

impl From<PressureSensor> for Sensor {
    fn from(own: PressureSensor) -> Self {
        let PressureSensor { range_pa: [low, high], bits, noise_pa, zero_pa, gain_error, lag_s } = own;
        Sensor { low, high, bits, noise: noise_pa, zero: zero_pa, gain_error, lag: lag_s }
    }
}

/// Instrumentation between a drive and its law.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Sensor of the position.
    pub position: PositionSensor,
    /// Sensors of the pressures in chambers a and b; `None` without such sensors.
    pub pressures: Option<[PressureSensor; 2]>,
    /// Resolution of the command over -1 .. 1; zero: none.
    pub command_bits: u32,
    /// Time from a sample to its command, s.
    pub computing_time_s: f64,
    /// Times, s, from which on an external force, N, acts.
    pub forces: Vec<[f64; 2]>,
    /// Seed of the noise.
    pub seed: u64,
    /// Number of the axis among those of one run; each has its own noise.
    #[serde(default)]
    pub member: u32,
    /// Number of repeats of each step of the law, to measure its time.
    #[serde(default = "once")]
    pub step_repeats: u32,
    /// Standard deviation of the times of samples, s: of the position, of chambers a and b; and of the computing time.
    #[serde(default)]
    pub jitter_s: [f64; 4],
    /// Positions of limit switches at x = 0 and at the stroke, m.
    #[serde(default)]
    pub switches_m: Option<[f64; 2]>,
    /// Faults of the run.
    #[serde(default)]
    pub faults: Vec<Fault>,
}

/// Target of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// The position.
    Position,
    /// Pressure of chamber a.
    PressureA,
    /// Pressure of chamber b.
    PressureB,
}

/// Kinds of faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// A channel keeps its value.
    Stuck,
    /// A channel reads NaN.
    Nan,
    /// A channel shows `value`.
    Saturated,
    /// A channel reads too high by `value`.
    Offset,
    /// A single sample of a channel reads too high by `value`.
    Jump,
    /// The clock jumps back by `value`, s.
    Clock,
    /// The spool of the valve stops at its present position.
    ValveStuck,
    /// The spool of the valve moves to its centre.
    ValveDead,
    /// The supply has the pressure `value`, Pa absolute.
    SupplyFallen,
    /// The law is not ready in time.
    Late,
    /// The reference is NaN, or is fixed at `value`, m.
    Reference,
    /// Enable is lost.
    EnableLost,
    /// Emergency stop.
    EmergencyStop,
}

impl FaultKind {
    /// The number belongs to the valve.
    pub fn is_of_valve(self) -> bool {
        matches!(self, FaultKind::ValveStuck | FaultKind::ValveDead)
    }
}

/// A fault.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Channel of the fault.
    pub channel: Option<Channel>,
    /// s.
    pub begin_s: f64,
    /// End of the fault, s; `None`: it is permanent.
    pub end_s: Option<f64>,
    /// See the kinds.
    pub value: Option<f64>,
}

impl Fault {
    /// Time at which the fault begins, s.
    pub fn acts(&self, t: f64) -> bool {
        self.begin_s <= t && self.end_s.is_none_or(|end| t < end)
    }
}

/// Reaction to a fault.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Answering {
    /// The fault is reported.
    Tell,
    /// The model replaces the lost signal.
    Model,
    /// A stop ramp, and then holding at rest.
    Stop,
    /// The valve is shut immediately.
    Block,
}

impl From<Answering> for Reaction {
    fn from(own: Answering) -> Self {
        match own {
            Answering::Tell | Answering::Model => Reaction::Tell,
            Answering::Stop => Reaction::Stop,
            Answering::Block => Reaction::Block,
        }
    }
}

/// A supervisor.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Supervision {
    /// Positions that the drive may reach, m; none: those of its stroke.
    pub position_m: Option<[f64; 2]>,
    /// m/s.
    pub speed_m_s: Option<f64>,
    /// Pa absolute.
    pub pressure_pa: Option<[f64; 2]>,
    /// m/s2.
    pub stop_deceleration_m_s2: f64,
    /// Error within which a motion is complete, m, the time for which it must be within, s, and the time allowed for
    /// this, s.
    pub motion: [f64; 3],
    /// On a lost position sensor.
    pub on_position: Answering,
    /// On a lost pressure sensor.
    pub on_pressure: Answering,
    /// Reaction to a valve that does not react.
    pub on_valve: Answering,
    /// On a fallen supply.
    pub on_supply: Answering,
    /// Standby law; `None`: the usual one, which does not replace custom laws.
    pub standby: Option<String>,
}

impl From<&Supervision> for Rules {
    fn from(own: &Supervision) -> Self {
        let free = Rules::default();
        let [tolerance, settled_for, timeout] = own.motion;
        Rules {
            position: own.position_m.unwrap_or(free.position),
            speed: own.speed_m_s.unwrap_or(free.speed),
            pressure: own.pressure_pa.unwrap_or(free.pressure),
            stop_deceleration: own.stop_deceleration_m_s2,
            motion: MotionRules { tolerance, settled_for, timeout },
            on_position: own.on_position.into(),
            on_pressure: own.on_pressure.into(),
            on_valve: own.on_valve.into(),
            on_supply: own.on_supply.into(),
        }
    }
}
