//! Sampled control: a controller reads outputs with a period, and its command holds in between.

use super::Session;
use crate::circuit::Look;
use crate::ground::Error;
use ode::Method;

/// Reading and command of a sampled controller.
#[derive(Clone, Debug)]
pub struct Sampling {
    /// Columns that the controller reads.
    pub columns: Vec<usize>,
    /// Input that it sets.
    pub input: usize,
    /// Time between two samples, s.
    pub period: f64,
    /// Number of periods.
    pub periods: usize,
}

impl Session {
    /// Continues until a time, s, with a separate limit on attempts and the method that suits the length of the call.
    pub fn go_on(&mut self, until: f64, look: &mut Look<'_>) -> Result<(), Error> {
        if until.is_finite() {
            self.allow_until(until);
        }
        let (lasts, before) = (until - self.time(), self.statistics().factorisations);
        self.stepper.begin_with(Method::Rodas3, self.calls.low_order(lasts));
        let mut drawn = self.drawn.take();
        let gone = self.advance(until, &mut drawn, look);
        self.drawn = drawn;
        self.stepper.begin_with(Method::default(), 0);
        if gone.is_ok() && lasts > 0.0 {
            self.calls.register(lasts, self.statistics().factorisations - before);
        }
        gone
    }

    /// Runs a controller. At each sample it receives the time, s, and the columns. It returns the value of the input
    /// until the next sample, or `None` to end the run. The last sample sets nothing. Returns a row of the columns and
    /// this value for each sample.
    pub fn control(
        &mut self,
        sampling: &Sampling,
        controller: &mut dyn FnMut(f64, &[f64]) -> Option<f64>,
        look: &mut Look<'_>,
    ) -> Result<Vec<f64>, Error> {
        let Sampling { columns, input, period, periods } = sampling;
        let begin = self.time();
        let width = columns.len() + 1;
        let mut rows = Vec::new();
        for sample in 0..=*periods {
            let time = begin + sample as f64 * period;
            if sample > 0 {
                self.go_on(time, look)?;
            }
            let first = rows.len();
            rows.extend(columns.iter().map(|&column| self.read(column)));
            let Some(value) = controller(time, &rows[first..]) else { break };
            rows.push(value);
            if sample < *periods {
                self.set(*input, value)?;
            }
        }
        rows.truncate(rows.len() / width * width);
        Ok(rows)
    }
}
