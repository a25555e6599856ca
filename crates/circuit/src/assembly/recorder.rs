//! Output of a session: samples, impacts and balances.

use super::glances::Glances;
use super::session::Session;
use super::variables::values_of;
use crate::circuit::{Balance, Circuit, Entry, Impact, Impacts, Look, closed};
use crate::component::Quantity;
use crate::ground::{Error, Net, refuse};
use ode::{Accepted, Output, Statistics, System};

/// Results of a run.
pub struct Run {
    /// One vector for each column, in the order of the assembly's names.
    pub columns: Vec<Vec<f64>>,
    /// Work counts of the integrator.
    pub statistics: Statistics,
    /// The closed balances. `None` for a circuit without balances.
    pub balance: Option<Balance>,
    /// Contacts with end stops.
    pub impacts: Vec<Impact>,
}

/// Rows that are collected before they are written to the columns in ranges.
const ROWS_OF_A_BLOCK: usize = 64;

/// Turns states into columns while the integration runs.
pub(crate) struct Recorder {
    quantities: Vec<Quantity>,
    glances: Option<Glances>,
    times: Vec<f64>,
    next: usize,
    net: Net<f64>,
    columns: Vec<Vec<f64>>,
    block: Vec<f64>,
    rows: usize,
    entries: Option<Vec<Entry>>,
    impacts: Vec<Impacts>,
}

impl Recorder {
    pub fn new(circuit: &Circuit<f64>, quantities: Vec<Quantity>, times: Vec<f64>) -> Self {
        let n = quantities.len();
        Recorder {
            next: 0,
            net: circuit.work(),
            columns: (0..n).map(|_| Vec::with_capacity(times.len())).collect(),
            block: vec![0.0; n * ROWS_OF_A_BLOCK],
            rows: 0,
            glances: Glances::of(circuit, &quantities),
            entries: (!circuit.channels().is_empty()).then(Vec::new),
            impacts: circuit.impacts(),
            quantities,
            times,
        }
    }

    /// Takes the samples at the end of a run: those of its last instant.
    fn complete(&mut self, session: &Session) {
        let y = &session.settled()[..];
        while self.next < self.times.len() {
            self.sample(0, self.times[self.next], y, session.circuit());
        }
    }

    /// Writes the rows of the block into the columns.
    fn spill(&mut self) {
        let n = self.columns.len();
        let rows = &self.block[..n * self.rows];
        for (i, column) in self.columns.iter_mut().enumerate() {
            column.extend(rows.chunks_exact(n).map(|row| row[i]));
        }
        self.rows = 0;
    }

    /// Returns the results of a complete run.
    pub fn finish(mut self, session: &Session) -> Run {
        self.complete(session);
        self.spill();
        let statistics = session.statistics();
        let balance = self.entries.as_ref().map(|entries| closed(session.circuit(), entries));
        let mut impacts: Vec<Impact> = self.impacts.into_iter().flat_map(Impacts::finish).collect();
        impacts.sort_by(|one, other| one.time.total_cmp(&other.time));
        Run { columns: self.columns, statistics, balance, impacts }
    }
}

impl Output<f64, Circuit<f64>> for Recorder {
    fn due(&self, _lane: usize) -> f64 {
        self.times.get(self.next).copied().unwrap_or(f64::INFINITY)
    }

    fn sample(&mut self, _lane: usize, t: f64, y: &[f64], circuit: &Circuit<f64>) {
        let n = self.columns.len();
        let row = &mut self.block[n * self.rows..][..n];
        match &self.glances {
            Some(glances) => glances.row(circuit, t, y, row),
            None => values_of(&self.quantities, circuit, t, y, &mut self.net, row),
        }
        self.rows += 1;
        if self.rows == ROWS_OF_A_BLOCK {
            self.spill();
        }
        if let Some(entries) = &mut self.entries {
            entries.push(circuit.books(y));
        }
        self.next += 1;
    }

    fn step(
        &mut self,
        _lane: usize,
        t: f64,
        h: f64,
        states: &mut Accepted<'_, f64>,
        _circuit: &Circuit<f64>,
    ) {
        for impacts in &mut self.impacts {
            impacts.step(t, h, states);
        }
    }
}

/// Returns k/rate for k = 0 .. round(duration rate), with the last one at the duration.
pub fn sample_times(duration: f64, rate: f64) -> Vec<f64> {
    let n = (duration * rate).round().max(1.0) as usize;
    let mut times = Vec::with_capacity(n + 1);
    times.extend((0..n).map(|k| k as f64 / rate));
    while times.pop_if(|t| *t > duration).is_some() {}
    times.push(duration);
    times
}

impl Session {
    /// Continues until a time, s, with a separate limit on attempts, and returns some columns at `times`, s, on the way. The times ascend from the present time.
    pub fn record(
        &mut self,
        until: f64,
        times: Vec<f64>,
        columns: &[usize],
        look: &mut Look<'_>,
    ) -> Result<Run, Error> {
        if !times.is_sorted() || times.first().is_some_and(|first| *first < self.time()) {
            let what = "the times of samples must ascend, and none may have passed";
            return refuse(what);
        }
        if until.is_finite() {
            self.allow_until(until);
        }
        let quantities = columns.iter().map(|&column| self.assembly.variables.quantities[column]);
        let mut recorder = Recorder::new(&self.assembly.circuit, quantities.collect(), times);
        self.advance(until, &mut recorder, look)?;
        Ok(recorder.finish(self))
    }
}
