//! Descriptions in SI units, as they arrive from Python.

use crate::sensor::{Encoder, Sensor};
use circuit::specification::Circuit;
use control::{COEFFICIENTS, Move, Piece, Reference};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A controller: a law, and what it is told of the drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controller {
    /// Its word.
    pub law: String,
    /// s.
    pub period_s: f64,
    /// Gains by their keys; those that are left out follow from the drive.
    #[serde(default)]
    pub gains: BTreeMap<String, f64>,
    /// Standing still; none: it never holds.
    pub hold: Option<Hold>,
    /// It learns friction and valve of its drive while it runs.
    #[serde(default = "yes")]
    pub adaptation: bool,
    /// The drive as the law believes it to be.
    pub belief: Circuit,
}

fn once() -> u32 {
    1
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

/// Where the drive is to go.
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
        /// Begin, s, and duration, s, of each, and its numbers of the powers of the share of the duration, m.
        pieces: Vec<[f64; 2 + COEFFICIENTS]>,
    },
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
            Motion::Pieces { start_m, pieces } => Reference::Pieces {
                start: *start_m,
                pieces: (pieces.iter())
                    .map(|own| Piece {
                        begin: own[0],
                        duration: own[1],
                        coefficients: std::array::from_fn(|i| own[2 + i]),
                    })
                    .collect(),
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

/// What stands between a drive and its law.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Of the position.
    pub position: PositionSensor,
    /// Of chambers a and b; none: there are none.
    pub pressures: Option<[PressureSensor; 2]>,
    /// Resolution of the command over -1 .. 1; zero: none.
    pub command_bits: u32,
    /// Time from a sample to its command, s.
    pub computing_time_s: f64,
    /// Times, s, from which on an external force, N, acts.
    pub forces: Vec<[f64; 2]>,
    /// Of the noise.
    pub seed: u64,
    /// Times that each step of the law is run, for its time.
    #[serde(default = "once")]
    pub step_repeats: u32,
}
