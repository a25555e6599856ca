//! Short callers of `Stepper::advance`: segments of constant inputs, samples, errors in words.

use crate::circuit::Circuit;
use crate::ledger::{Balance, balance};
use crate::net::Net;
use math::Lane;
use ode::{Failure, Output, Paused, Statistics, Stepper, System};

/// Why a description or a run cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("{0}")]
    Specification(String),
    #[error("{0}")]
    Stopped(String),
    #[error("interrupted at t = {t} s")]
    Interrupted { t: f64 },
}

/// Attempts between two looks at whether the user wants to stop: some 20 ms of work.
const ATTEMPTS_PER_LOOK: u64 = 20_000;

/// What a run leaves behind.
pub struct Run {
    /// One vector for each column, in the order of the recorder's names.
    pub columns: Vec<Vec<f64>>,
    pub statistics: Statistics,
    pub balance: Option<Balance>,
}

/// Turns states into columns while the integration runs.
pub struct Recorder<F> {
    times: Vec<f64>,
    next: usize,
    net: Net<f64>,
    /// Writes one row: (circuit, time, state, nodes, row).
    row: F,
    pub columns: Vec<Vec<f64>>,
    buffer: Vec<f64>,
    states: Option<Vec<Vec<f64>>>,
}

impl<F: FnMut(&Circuit<f64>, f64, &[f64], &mut Net<f64>, &mut [f64])> Recorder<F> {
    pub fn new(circuit: &Circuit<f64>, times: Vec<f64>, n_columns: usize, row: F) -> Self {
        let columns = vec![Vec::with_capacity(times.len()); n_columns];
        let states = (!circuit.channels().is_empty()).then(Vec::new);
        Recorder { next: 0, net: circuit.work(), row, columns, buffer: vec![0.0; n_columns], states, times }
    }

    /// The samples that are due now: at the end of a run, those at its last instant.
    pub fn finish(&mut self, circuit: &Circuit<f64>, y: &[f64]) {
        while self.next < self.times.len() {
            let t = self.times[self.next];
            self.sample(0, t, y, circuit);
        }
    }

    /// The accounts of the run, where the circuit keeps them.
    pub fn balance(&self, circuit: &Circuit<f64>) -> Option<Balance> {
        self.states.as_ref().map(|states| balance(circuit, states))
    }
}

impl<F: FnMut(&Circuit<f64>, f64, &[f64], &mut Net<f64>, &mut [f64])> Output<f64, Circuit<f64>>
    for Recorder<F>
{
    fn due(&self, _lane: usize) -> f64 {
        self.times.get(self.next).copied().unwrap_or(f64::INFINITY)
    }

    fn sample(&mut self, _lane: usize, t: f64, y: &[f64], circuit: &Circuit<f64>) {
        (self.row)(circuit, t, y, &mut self.net, &mut self.buffer);
        for (column, value) in self.columns.iter_mut().zip(&self.buffer) {
            column.push(*value);
        }
        if let Some(states) = &mut self.states {
            states.push(y.to_vec());
        }
        self.next += 1;
    }
}

/// Keeps states as they are integrated, row by row.
pub struct States {
    times: Vec<f64>,
    next: usize,
    n: usize,
    rows: Vec<f64>,
}

impl States {
    /// For states of length `n`.
    pub fn new(times: Vec<f64>, n: usize) -> Self {
        States { next: 0, n, rows: Vec::with_capacity(times.len() * n), times }
    }

    #[inline]
    fn keep(&mut self, y: &[f64]) {
        self.rows.extend_from_slice(&y[..self.n]);
        self.next += 1;
    }

    /// All rows, the samples still due being those at the end.
    pub fn finish(mut self, y: &[f64]) -> Vec<f64> {
        while self.next < self.times.len() {
            self.keep(y);
        }
        self.rows
    }
}

impl Output<f64, Circuit<f64>> for States {
    #[inline]
    fn due(&self, _lane: usize) -> f64 {
        self.times.get(self.next).copied().unwrap_or(f64::INFINITY)
    }
    #[inline]
    fn sample(&mut self, _lane: usize, _t: f64, y: &[f64], _circuit: &Circuit<f64>) {
        self.keep(y);
    }
}

/// k/rate for k = 0 .. round(duration rate), the last one at the duration.
pub fn sample_times(duration: f64, rate: f64) -> Vec<f64> {
    let n = (duration * rate).round().max(1.0) as usize;
    let mut times: Vec<f64> = (0..=n).map(|k| k as f64 / rate).collect();
    times[n] = duration;
    times.retain(|&t| t <= duration);
    times
}

/// Advances to `until`, looking at `interrupted` now and then.
pub fn advance<R: Lane>(
    stepper: &mut Stepper<R, Circuit<R>>,
    until: f64,
    output: &mut impl Output<R, Circuit<R>>,
    interrupted: &mut dyn FnMut() -> bool,
) -> Result<(), Error> {
    loop {
        let paused = stepper.advance(until, ATTEMPTS_PER_LOOK, output);
        if let Some(failure) = stepper.failure(0) {
            return Err(Error::Stopped(in_words(failure, stepper)));
        }
        if paused == Paused::Arrived {
            return Ok(());
        }
        if interrupted() {
            return Err(Error::Interrupted { t: stepper.time(0) });
        }
    }
}

/// When, in which state, with which value, and what to try.
fn in_words<R: Lane>(failure: Failure, stepper: &Stepper<R, Circuit<R>>) -> String {
    let (circuit, y) = (stepper.system(), stepper.state());
    let names = circuit.state_names();
    let state = |i: usize| {
        names.get(i).map_or("an account".to_string(), |name| format!("{name} = {:.6e}", y[i].get(0)))
    };
    let (t, reason, remedy) = match failure {
        Failure::StepTooSmall { t, h, state: i } => (
            t,
            format!("the step fell to {h:.1e} s in {}", state(i)),
            "a looser rtol, a softer end stop or a larger dead volume",
        ),
        Failure::NotFinite { t, state: i } => (
            t,
            format!("a rate is not finite near {}", state(i)),
            "a larger dead volume or a stiffer end stop",
        ),
        Failure::Chatter { t, .. } => (
            t,
            "stick and slip alternate without time passing".to_string(),
            "law = \"lugre\", or a breakaway force above the Coulomb force",
        ),
        Failure::TooManyAttempts { t, attempts } => {
            (t, format!("{attempts} attempts at a step are used up"), "a shorter duration or a looser rtol")
        }
    };
    let (reason, remedy) = match circuit.vanished(y) {
        Some(volume) => (
            format!(
                "a chamber has vanished (volume {:.3e} m3): the piston went through its end stop",
                volume
            ),
            "a larger cylinder.end_stop.stiffness or cylinder.dead_volume",
        ),
        None => (reason, remedy),
    };
    let shown: Vec<String> = (0..circuit.n_states().min(SHOWN)).map(state).collect();
    format!(
        "the simulation cannot go on at t = {t:.6} s: {reason}. State: {}. Try {remedy}.",
        shown.join(", ")
    )
}

/// How many states a message shows: those of one cylinder.
const SHOWN: usize = 7;
