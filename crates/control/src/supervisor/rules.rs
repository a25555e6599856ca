//! Arguments of a supervisor: its rules, its inputs, and the prediction of the model for a sample.

use super::motion::MotionRules;
use crate::follower::Follower;
use crate::reference::Wanted;
use crate::thresholds::{BLOCK_SLOW, LIMIT_ROUNDING};
use crate::types::{Edges, State};
use physics::in_usual_unit;
use serde::Deserialize;

/// Reaction to a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reaction {
    /// The fault is reported. The model replaces a lost pressure.
    #[serde(alias = "model")]
    Tell,
    /// Stop ramp, then the law holds the position.
    Stop,
    /// The valve is shut immediately.
    Block,
    /// Stop ramp, then the valve is shut. The supervisor blocks a moving drive with a lost sensor in this way: the alarm
    /// may be false, and the load would bounce on the shut gas.
    #[serde(skip)]
    StopAndBlock,
}

impl Reaction {
    /// Returns the reaction to a lost sensor at a velocity, m/s.
    pub(super) fn at_speed(self, velocity: f64) -> Reaction {
        let moves = velocity.abs() > BLOCK_SLOW;
        if self == Reaction::Block && moves { Reaction::StopAndBlock } else { self }
    }

    /// Returns the reaction to faults of the position and of the gas at one sample.
    pub(super) fn first([position, gas]: [Option<Reaction>; 2]) -> Option<Reaction> {
        let blocks = [Reaction::Block, Reaction::StopAndBlock].map(Some);
        let is_position = gas.is_none() || (gas != blocks[0] && blocks.contains(&position));
        if is_position { position } else { gas }
    }
}

/// Rules of a supervisor.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rules {
    /// Positions that the drive may reach, m.
    #[serde(rename = "position_m")]
    pub position: [f64; 2],
    /// Speed, m/s.
    #[serde(rename = "speed_m_s")]
    pub speed: f64,
    /// Pa absolute.
    #[serde(rename = "pressure_pa")]
    pub pressure: [f64; 2],
    /// Deceleration of stop ramps, m/s2.
    #[serde(rename = "stop_deceleration_m_s2")]
    pub stop_deceleration: f64,
    /// Condition of a completed motion.
    pub motion: MotionRules,
    /// Reaction to a lost position sensor.
    pub on_position: Reaction,
    /// Reaction to a lost pressure sensor. The model then replaces its readings.
    pub on_pressure: Reaction,
    /// Reaction to a valve that does not respond.
    pub on_valve: Reaction,
    /// Reaction to a fallen supply.
    pub on_supply: Reaction,
}

impl Default for Rules {
    fn default() -> Self {
        Rules {
            position: [f64::NEG_INFINITY, f64::INFINITY],
            speed: f64::INFINITY,
            pressure: [0.0, f64::INFINITY],
            stop_deceleration: 10.0,
            motion: MotionRules::default(),
            on_position: Reaction::Block,
            on_pressure: Reaction::Tell,
            on_valve: Reaction::Block,
            on_supply: Reaction::Block,
        }
    }
}

impl Rules {
    /// Returns the reason why a reference is rejected, in words; `None` if it is accepted.
    pub fn refuses(&self, wanted: &Wanted, stroke: f64) -> Option<String> {
        let Wanted { position: x, velocity: v, .. } = *wanted;
        let [low, high] = [self.position[0].max(0.0), self.position[1].min(stroke)];
        if !(low - LIMIT_ROUNDING..=high + LIMIT_ROUNDING).contains(&x) {
            let whose = if [low, high] == [0.0, stroke] { "the stroke" } else { "limits.position" };
            let [x, low, high] = [x, low, high].map(|position| in_usual_unit(position, "m"));
            return Some(format!(
                "the reference has the position {x}: it must stay within {whose}, {low} to {high}"
            ));
        }
        (v.is_nan() || v.abs() > self.speed + LIMIT_ROUNDING).then(|| {
            let [v, fastest] = [v, self.speed].map(|speed| in_usual_unit(speed, "m/s"));
            format!("the reference has the speed {v}: limits.speed is {fastest}")
        })
    }
}

/// External inputs of the supervisor for one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// Whether the drive may move.
    pub enabled: bool,
    /// Emergency stop.
    pub emergency_stop: bool,
    /// Limit switches at x = 0 and at the stroke.
    pub switches: [bool; 2],
    /// Whether the law missed its deadline.
    pub late: bool,
    /// Standard deviation of the time at which a position is read, s.
    pub jitter: f64,
}

impl Default for Inputs {
    fn default() -> Self {
        Inputs { enabled: true, emergency_stop: false, switches: [false; 2], late: false, jitter: 0.0 }
    }
}

/// Prediction of the model for a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Believed<'a> {
    /// The law with its model.
    pub own: &'a Follower,
    /// Time of the sample, s.
    pub time: f64,
    /// The state at the last sample.
    pub last: &'a State,
    /// Predicted state.
    pub foreseen: &'a State,
    /// Openings of the edges since the last sample.
    pub edges: Edges<f64>,
}
