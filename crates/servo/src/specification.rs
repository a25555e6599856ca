//! Descriptions in SI units, as they arrive from Python.

use crate::sensor::{Encoder, Sensor};
use circuit::specification::{self, Circuit};
use control::{FACTORS, Reference, Rules};
use serde::Deserialize;
use std::collections::BTreeMap;

specification::from_json!(Controller, ReferenceForm, Setup);

/// Reference of a drive.
#[derive(Clone, Debug, Deserialize)]
pub struct ReferenceForm(pub Reference);

/// A controller: a law, and its model of the drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Its word.
    pub law: String,
    /// Period, s.
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
    /// Error, m, below which the drive is held at rest after a time, s; `None`: it is never held.
    pub hold: Option<[f64; 2]>,
    /// Whether the controller learns friction and valve of its drive during the run.
    pub adaptation: bool,
    /// Rules of its supervisor.
    #[serde(default)]
    pub supervision: Rules,
    /// Standby law; `None`: the usual one, which does not replace custom laws.
    #[serde(default)]
    pub standby: Option<String>,
    /// The controller model of the drive.
    #[serde(deserialize_with = "specification::within")]
    pub belief: Circuit,
}

fn ones() -> [f64; FACTORS.len()] {
    [1.0; FACTORS.len()]
}

/// Instrumentation between a drive and its law.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Sensor of the position.
    pub position: Encoder,
    /// Sensors of the pressures in chambers a and b; `None` without such sensors.
    pub pressures: Option<[Sensor; 2]>,
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
    /// Number of runs of each step of the law, to measure its time; below 2, a step runs once.
    #[serde(default)]
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
pub enum SensorChannel {
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
    pub channel: Option<SensorChannel>,
    /// Time at which it begins, s.
    pub begin_s: f64,
    /// End of the fault, s; `None`: it is permanent.
    pub end_s: Option<f64>,
    /// See the kinds.
    pub value: Option<f64>,
}

impl Fault {
    /// Whether the fault acts at a time, s.
    pub fn acts(&self, t: f64) -> bool {
        self.begin_s <= t && self.end_s.is_none_or(|end| t < end)
    }
}
