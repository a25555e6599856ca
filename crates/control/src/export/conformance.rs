//! Exported code, run by the core sample by sample. A file of its inputs and results checks a compiled copy bit for
//! bit.

use super::guard::GUARD;
use super::{LawProgram, RESULTS};
use crate::reference::{between, blend};
use std::fmt::Write;

/// State of the exported code between two samples.
#[derive(Clone, Debug)]
pub struct Remembered {
    /// State of the checks, then the velocity of the last command.
    guard: Vec<f64>,
    kept: Vec<f64>,
}

/// Number of samples in the file.
const SAMPLES: u32 = 600;
/// Sample at which a move begins, and its number of samples.
const MOVES: [u32; 2] = [20, 180];
/// Samples of these events: two readings are lost, the reference jumps, the drive is disabled, it is enabled, the
/// sensor is lost.
const EVENTS: [u32; 5] = [120, 300, 400, 420, 520];
/// Pressure of both chambers, Pa absolute: an arbitrary usual value.
const PRESSURE: f64 = 4e5;

impl LawProgram {
    /// Returns the state before the first sample.
    pub fn remembered(&self) -> Remembered {
        Remembered { guard: vec![0.0; GUARD + 1], kept: vec![0.0; self.memory[0]] }
    }

    /// Runs a sample. Returns the [`RESULTS`], then the status.
    pub fn step(&self, own: &mut Remembered, inputs: &[f64]) -> Vec<f64> {
        let parameters: Vec<f64> = self.parameters.iter().map(|own| own.1).collect();
        let checked = self.check.run(&[inputs, &parameters, &own.guard].concat());
        let ([opens, begins, status], rest) = checked.split_first_chunk().expect("the flags come first");
        let (inputs, guard) = rest.split_at(inputs.len());
        own.guard[..GUARD].copy_from_slice(guard);
        let mut results = vec![0.0; RESULTS.len()];
        if *opens > 0.5 {
            let sample = if *begins > 0.5 { &self.begin } else { &self.observe };
            let seen = sample.run(&[inputs, &parameters, &own.kept].concat());
            results = self.command.run(&[inputs, &parameters, &seen].concat());
            own.kept = results.split_off(RESULTS.len());
        }
        own.guard[GUARD] = results[1];
        results.push(*status);
        results
    }

    /// Returns a file of samples: the bits of each input and result in hexadecimal digits. The drive rests, moves and
    /// loses two readings. After that the reference jumps, the code is disabled and enabled, and the position sensor
    /// fails.
    pub fn conformance(&self) -> String {
        let names = self.inputs.iter().map(|own| own.0);
        let results = RESULTS.iter().map(|own| own.0).chain(["status"]);
        let mut text = format!(
            "# Bits of the inputs of {} and of its results, a line for each sample.\n# {} | {}\n",
            self.name,
            names.collect::<Vec<_>>().join(" "),
            results.collect::<Vec<_>>().join(" ")
        );
        let mut own = self.remembered();
        for k in 0..SAMPLES {
            let inputs = self.sample(k);
            let results = self.step(&mut own, &inputs);
            let bits = |own: &[f64]| {
                let each = own.iter().map(|x| format!("{:016x}", x.to_bits()));
                each.collect::<Vec<_>>().join(" ")
            };
            let _ = writeln!(text, "{} | {}", bits(&inputs), bits(&results));
        }
        text
    }

    /// Inputs of a sample of the file.
    fn sample(&self, k: u32) -> Vec<f64> {
        let limit = |name: &str| {
            let found = self.parameters.iter().find(|own| own.0.0 == name);
            found.map_or(0.0, |own| own.1)
        };
        let [low, high] = ["position_low", "position_high"].map(limit);
        let middle = 0.5 * (low + high);
        let end = middle + 0.1 * (high - low);
        let [begin, lasts] = MOVES.map(|own| f64::from(own) * self.period);
        let at = |t: f64| between([middle, end], blend((t - begin) / lasts), 1.0 / lasts);
        let [lost, jumps, off, on, gone] = EVENTS;
        let t = f64::from(k) * self.period;
        let [mut now, then, late] = [t, t + self.ahead, t - 2.0 * self.period].map(at);
        // Noise of a few counts, and pressures that differ slightly.
        let mut position = late.position + 2e-6 * f64::from((k * 7919) % 5);
        if (lost..lost + 2).contains(&k) || k >= gone {
            position = f64::NAN;
        }
        if k == jumps {
            now.position += 5e-3;
        }
        let lean = 2e3 * late.acceleration.clamp(-20.0, 20.0);
        let mut inputs = vec![position];
        if self.inputs.iter().any(|own| own.0 == "pressure_a") {
            inputs.extend([PRESSURE + lean, PRESSURE - lean]);
        }
        for own in [now, then] {
            inputs.extend(own.numbers());
        }
        let stands = t + self.ahead < begin || t > begin + lasts;
        let enabled = k > 1 && !(off..on).contains(&k);
        inputs.extend([stands, enabled].map(|own| f64::from(u8::from(own))));
        inputs
    }
}
