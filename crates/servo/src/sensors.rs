//! Sensors of an axis, sample by sample.

use crate::noise::Noise;
use crate::sensor::{Encoder, Sensor};
use crate::specification::Setup;

/// Channels of the noise of times, from this one on.
const JITTER: u32 = 16;

/// Sensors of an axis.
#[derive(Clone, Debug)]
pub struct Sensors {
    encoder: Encoder,
    pressures: Option<[Sensor; 2]>,
    seed: u64,
    member: u32,
    /// Standard deviation of the times of samples, s: of the position, of chambers a and b, and of commands.
    pub jitter: [f64; 4],
    /// Both pressures at the last sample: true values, and values behind the lag of the sensors.
    last: Option<[[f64; 2]; 2]>,
}

impl From<&Setup> for Sensors {
    fn from(setup: &Setup) -> Self {
        Sensors {
            encoder: setup.position.into(),
            pressures: setup.pressures.map(|own| own.map(Sensor::from)),
            seed: setup.seed,
            member: setup.member,
            jitter: setup.jitter_s,
            last: None,
        }
    }
}

impl Sensors {
    /// Returns the delay of a sample of a sensor, or of a command, s.
    pub fn late(&self, what: usize, tick: u64) -> f64 {
        let jitter = self.jitter[what];
        let channel = JITTER + what as u32;
        if jitter > 0.0 {
            jitter * Noise { seed: self.seed, member: self.member, channel }.normal(tick)
        } else {
            0.0
        }
    }

    /// Returns the readings of a position, m, and of both pressures, Pa, at the sample `tick`. The arguments are true
    /// position, velocity and pressures. Under jitter, a reading is extrapolated by the slope of the signal.
    pub fn sample(&mut self, tick: u64, period: f64, [x, v, a, b]: [f64; 4]) -> (f64, Option<[f64; 2]>) {
        let (seed, member) = (self.seed, self.member);
        let noise = |channel| Noise { seed, member, channel };
        let late = [1, 2].map(|what| self.late(what, tick));
        let position = self.encoder.read(x + v * self.late(0, tick), noise(0), tick);
        let pressures = self.pressures.map(|sensors| {
            let [before, behind] = self.last.unwrap_or([[a, b]; 2]);
            let now = [a, b];
            let lagged = [0, 1].map(|i| sensors[i].follow(behind[i], [before[i], now[i]], period));
            self.last = Some([now, lagged]);
            [0, 1].map(|i| {
                let slope = (lagged[i] - behind[i]) / period;
                sensors[i].read(lagged[i] + slope * late[i], noise(1 + i as u32), tick)
            })
        });
        (position, pressures)
    }
}
