//! Sensors sample by sample.

use crate::noise::Noise;
use serde::Deserialize;

/// A sensor with a lag, an amplifier and a converter.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Range, Pa absolute; signals outside saturate.
    #[serde(rename = "range_pa")]
    pub range: [f64; 2],
    /// Resolution of the converter over the range; zero: none.
    pub bits: u32,
    /// Standard deviation of the noise of a sample, Pa.
    #[serde(rename = "noise_pa")]
    pub noise: f64,
    /// Reading at zero, Pa.
    #[serde(rename = "zero_pa")]
    pub zero: f64,
    /// Relative error of the gain.
    pub gain_error: f64,
    /// Time constant of the amplifier, s.
    #[serde(rename = "lag_s")]
    pub lag: f64,
}

impl Sensor {
    /// Returns the lagged signal after a period. `behind` is its value at the last sample; the signal has changed
    /// linearly since then.
    pub fn follow(&self, behind: f64, [from, to]: [f64; 2], period: f64) -> f64 {
        if self.lag == 0.0 {
            return to;
        }
        // Response to a ramp: it ends the lag times the slope behind, and the initial deviation from this decays.
        let delayed = self.lag * (to - from) / period;
        to - delayed + (behind - from + delayed) * (-period / self.lag).exp()
    }

    /// Returns the reading of the signal behind its lag.
    pub fn read(&self, signal: f64, noise: Noise, tick: u64) -> f64 {
        let mut seen = (1.0 + self.gain_error) * signal + self.zero;
        if self.noise > 0.0 {
            seen += self.noise * noise.normal(tick);
        }
        let [low, high] = self.range;
        let seen = seen.clamp(low, high);
        if self.bits == 0 {
            return seen;
        }
        let step = (high - low) / ((1_u64 << self.bits) - 1) as f64;
        low + step * ((seen - low) / step).round_ties_even()
    }
}

/// An incremental encoder.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Encoder {
    /// Distance between two counts, m; zero: it shows the signal itself.
    #[serde(rename = "resolution_m")]
    pub resolution: f64,
    /// Standard deviation of the noise before it counts, m.
    #[serde(rename = "noise_m")]
    pub noise: f64,
}

impl Encoder {
    /// The last count of the encoder.
    pub fn read(&self, signal: f64, noise: Noise, tick: u64) -> f64 {
        let seen = if self.noise > 0.0 { signal + self.noise * noise.normal(tick) } else { signal };
        if self.resolution > 0.0 { (seen / self.resolution).floor() * self.resolution } else { seen }
    }

    /// Standard deviation of a reading, m: of noise and of a count that may lie anywhere.
    pub fn deviation(&self) -> f64 {
        (self.resolution * self.resolution / 12.0 + self.noise * self.noise).sqrt().max(LEAST)
    }
}

/// Least deviation for an observer, m. With zero deviation, it would follow each sample exactly.
const LEAST: f64 = 1e-7;
