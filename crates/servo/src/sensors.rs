//! Sensors of an axis, sample by sample.

use crate::noise::Noise;
use crate::specification::Setup;

/// Channels of the noise of times, from this one on.
const JITTER: u32 = 16;

/// Sensors of an axis.
#[derive(Clone, Debug)]
pub struct Sensors {
    /// Instrumentation of the axis.
    pub setup: Setup,
    /// Both pressures at the last sample: true values, and values behind the lag of the sensors.
    last: Option<[[f64; 2]; 2]>,
}

impl Sensors {
    /// Returns the sensors before the first sample.
    pub fn new(setup: Setup) -> Self {
        Sensors { setup, last: None }
    }

    fn noise(&self, channel: u32) -> Noise {
        Noise { seed: self.setup.seed, member: self.setup.member, channel }
    }

    /// Returns the delay of a sample of a sensor, or of a command, s.
    pub fn late(&self, signal: usize, tick: u64) -> f64 {
        let jitter = self.setup.jitter_s[signal];
        if jitter > 0.0 { jitter * self.noise(JITTER + signal as u32).normal(tick) } else { 0.0 }
    }

    /// Returns the readings of a position, m, and of both pressures, Pa, at the sample `tick`. The arguments are true
    /// position, velocity and pressures. Under jitter, a reading is extrapolated by the slope of the signal.
    pub fn sample(&mut self, tick: u64, period: f64, [x, v, a, b]: [f64; 4]) -> (f64, Option<[f64; 2]>) {
        let position = self.setup.position.read(x + v * self.late(0, tick), self.noise(0), tick);
        let pressures = self.setup.pressures.map(|sensors| {
            let [before, behind] = self.last.unwrap_or([[a, b]; 2]);
            let now = [a, b];
            let lagged = [0, 1].map(|i| sensors[i].follow(behind[i], [before[i], now[i]], period));
            self.last = Some([now, lagged]);
            [0, 1].map(|i| {
                let slope = (lagged[i] - behind[i]) / period;
                let signal = lagged[i] + slope * self.late(1 + i, tick);
                sensors[i].read(signal, self.noise(1 + i as u32), tick)
            })
        });
        (position, pressures)
    }
}
