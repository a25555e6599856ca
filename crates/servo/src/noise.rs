//! Random numbers by count: a pure function of seed, channel and tick, so that they are the same in any order.

use std::f64::consts::TAU;

/// Noise of one channel of one run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Noise {
    /// Seed of the run.
    pub seed: u64,
    /// Member of a spread of runs.
    pub member: u32,
    /// Channel of the run.
    pub channel: u32,
}

/// One block of Philox4x32 with ten rounds. Source: [salmon2011].
pub fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    let product = |a: u32, b: u32| {
        let whole = u64::from(a) * u64::from(b);
        [(whole >> 32) as u32, whole as u32]
    };
    for _ in 0..10 {
        let [high_0, low_0] = product(0xD251_1F53, counter[0]);
        let [high_1, low_1] = product(0xCD9E_8D57, counter[2]);
        counter = [high_1 ^ counter[1] ^ key[0], low_1, high_0 ^ counter[3] ^ key[1], low_0];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

impl Noise {
    /// A number above 0 and up to 1, evenly distributed, and another one from 0 to below 1.
    pub fn uniform(&self, tick: u64) -> [f64; 2] {
        let counter = [tick as u32, (tick >> 32) as u32, self.channel, self.member];
        let [a, b, c, d] = philox(counter, [self.seed as u32, (self.seed >> 32) as u32]);
        let unit = |high: u32, low: u32| {
            (u64::from(high) << 21 | u64::from(low) >> 11) as f64 / (1_u64 << 53) as f64
        };
        [1.0 - unit(a, b), unit(c, d)]
    }

    /// A number of the standard normal distribution.
    pub fn normal(&self, tick: u64) -> f64 {
        let [radius, angle] = self.uniform(tick);
        (-2.0 * math::elementary::ln(radius)).sqrt() * math::elementary::cos(TAU * angle)
    }
}
