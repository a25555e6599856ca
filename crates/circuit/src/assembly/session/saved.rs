//! A session as bytes.

use super::{Session, ShortCalls, refuse};
use crate::assembly::schedule::ScheduledAction;
use crate::ground::Error;
use ode::System;

/// First bytes of a saved session, and the version of the format.
const MAGIC: &[u8; 8] = b"pnd-ses\x06";

/// FNV-1a hash.
fn mark_of(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

impl Session {
    /// Does the same with saved bytes that only sessions of this description accept.
    pub fn of_description(mut self, json: &str) -> Self {
        let version = env!("CARGO_PKG_VERSION").bytes();
        self.mark = mark_of(json.bytes().chain(self.rtol.to_bits().to_le_bytes()).chain(version));
        self
    }

    /// Returns the whole session as bytes, or `None` after a failure.
    pub fn save(&self) -> Result<Vec<u8>, Error> {
        self.alive()?;
        let Some(stepper) = self.stepper.save() else { return refuse("the session cannot go on") };
        let circuit = self.circuit();
        let mut words = vec![self.mark, self.schedule.len() as u64, u64::from(circuit.has_met())];
        words.push(circuit.stops_laid_out_for().unwrap_or(0.0).to_bits());
        words.extend([u64::from(self.calls.left), self.calls.lasted.to_bits()]);
        words.extend(circuit.inputs().iter().map(|(id, ..)| circuit.input(*id).to_bits()));
        circuit.clone().change_modes(|mode| words.push(mode.to_bits()));
        words.extend(stepper);
        for &(time, what, value) in &self.schedule {
            words.extend([time.to_bits(), what.code(self.inputs().len()), value.to_bits()]);
        }
        let mut bytes = MAGIC.to_vec();
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        bytes.extend(mark_of(bytes.iter().copied()).to_le_bytes());
        Ok(bytes)
    }

    /// Restores the session from saved bytes, bit for bit, even after a failure.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let Some(rest) = bytes.strip_prefix(MAGIC) else {
            return refuse("these bytes are not a session, or have another version of the format");
        };
        let (words, _) = rest.as_chunks::<8>();
        let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
        let whole = rest.len().is_multiple_of(8)
            && words.last() == Some(&mark_of(bytes[..bytes.len() - 8].iter().copied()));
        if !whole || words.len() < 7 {
            return refuse("these bytes of a session are damaged");
        }
        if words[0] != self.mark {
            return refuse(
                "these bytes are of a session of another drive, another tolerance or another version of pneudrive",
            );
        }
        let mut n_modes = 0;
        self.circuit().clone().change_modes(|_| n_modes += 1);
        let ids = self.circuit().inputs();
        let (values, rest) = words[6..words.len() - 1].split_at_checked(ids.len()).unwrap_or_default();
        let (modes, rest) = rest.split_at_checked(n_modes).unwrap_or_default();
        let (stepper, entries) = rest.split_at_checked(self.stepper.words()).unwrap_or_default();
        let (entries, left) = entries.as_chunks::<3>();
        let fits = left.is_empty() && entries.len() as u64 == words[1];
        let number = |word: &u64| f64::from_bits(*word);
        let (n_inputs, n_timings) = (self.inputs().len(), self.assembly.timings.len());
        let entry = |[t, code, value]: &[u64; 3]| {
            Some((number(t), ScheduledAction::of(*code, n_inputs, n_timings)?, number(value)))
        };
        let schedule: Option<Vec<_>> = entries.iter().map(entry).collect();
        let (true, false, Some(schedule)) = (fits, stepper.is_empty(), schedule) else {
            return refuse("these bytes of a session are damaged");
        };
        let circuit = self.stepper.system_mut();
        circuit.clone_from(&self.assembly.circuit);
        if words[2] != 0 {
            circuit.meet(0);
        }
        circuit.lay_out_stops(number(&words[3]));
        for ((id, ..), value) in ids.into_iter().zip(values) {
            circuit.set_input(id, 0, number(value));
        }
        let mut modes = modes.iter();
        circuit.change_modes(|mode| *mode = modes.next().map_or(0.0, number));
        self.stepper.restore(stepper);
        self.schedule = schedule;
        self.calls = ShortCalls { left: words[4] as u32, lasted: number(&words[5]) };
        (self.failed, self.is_read) = (None, false);
        Ok(())
    }
}
