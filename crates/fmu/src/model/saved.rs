//! A model as bytes.

use super::FmuModel;
use crate::refusal::{CallRefusal, refuse};

/// First bytes of a stored state.
const MAGIC: &[u8; 8] = b"pnd-fmu\x02";

impl FmuModel {
    /// Returns the whole model as bytes.
    pub fn save(&self) -> Result<Vec<u8>, CallRefusal> {
        if self.plan.law.is_some() {
            return refuse("the state of a controller can be saved in memory, but not as bytes");
        }
        let mut bytes = MAGIC.to_vec();
        let flags = [self.begun, self.outside, self.running.is_some()];
        let words = [self.t0, self.rtol, self.values.len() as f64].into_iter();
        let words =
            words.chain(flags.map(|flag| f64::from(u8::from(flag)))).chain(self.values.iter().copied());
        bytes.extend(words.flat_map(f64::to_le_bytes));
        if let Some(running) = &self.running {
            bytes.extend(running.origin.iter().copied().flat_map(f64::to_le_bytes));
            bytes.extend(running.session.save()?);
        }
        Ok(bytes)
    }

    /// Returns a model of the same plan from bytes.
    pub fn restored(&self, bytes: &[u8]) -> Result<Self, CallRefusal> {
        const HEAD: usize = 6;
        let Some(rest) = bytes.strip_prefix(MAGIC) else {
            return refuse("these bytes are not a state of this FMU");
        };
        let n = HEAD + self.values.len();
        let damaged = || CallRefusal { message: "these bytes of a state are damaged".into(), discard: false };
        let (words, session) = rest.split_at_checked(8 * n).ok_or_else(damaged)?;
        let words = numbers(words);
        if words[2] != self.values.len() as f64 || words[4] != f64::from(u8::from(self.outside)) {
            return refuse("these bytes are of a state of another FMU");
        }
        let mut model = FmuModel::new(self.plan.clone(), self.outside);
        (model.t0, model.rtol, model.values) = (words[0], words[1], words[HEAD..].to_vec());
        if words[5] != 0.0 {
            let running = model.running()?;
            let (origin, session) = session.split_at_checked(8 * running.origin.len()).ok_or_else(damaged)?;
            running.origin = numbers(origin);
            running.session.restore(session)?;
        }
        model.begun = words[3] != 0.0;
        Ok(model)
    }
}

/// Returns the numbers in bytes.
fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|word| f64::from_le_bytes(*word)).collect()
}
