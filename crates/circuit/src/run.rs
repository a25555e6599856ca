//! Output of a session: samples, impacts, balances, and error messages.

use crate::assembly::evaluate::glances::Glances;
use crate::assembly::{Assembly, Session};
use crate::circuit::{Circuit, Lacking, Scarce};
use crate::impacts::{Impact, Impacts};
use crate::ledger::{Balance, Entry, closed};
use crate::net::Net;
use math::Lane;
use ode::{Accepted, Failure, Output, Paused, Statistics, Stepper, System};

/// Errors of a description or a run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The description or the request is refused, with the reason.
    #[error("{0}")]
    Specification(String),
    /// A run failed, with the reason.
    #[error("{0}")]
    Stopped(String),
    /// The user wants to stop.
    #[error("interrupted at t = {t} s")]
    Interrupted {
        /// Simulated time, s.
        t: f64,
    },
}

/// Step attempts between two checks for an interruption, fewer with derivatives: about 20 ms of work.
const ATTEMPTS_PER_LOOK: u64 = 20_000;

/// Default limit on step attempts: for each second of motion, for each step of the command, and for the run itself.
/// Kinks and events cause most of the attempts, at any tolerance.
const BUDGET: [f64; 3] = [100_000.0, 100.0, 220_000.0];
/// Number of states for which the limit is defined, and the least factor on it. An attempt with more states costs more.
const BUDGET_STATES: f64 = 10.0;
const LEAST_BUDGET: f64 = 0.5;

/// Returns the limit on attempts for a run of `duration` s with this many commands and states.
pub fn budget(duration: f64, commands: usize, states: usize) -> u64 {
    let [second, command, run] = BUDGET;
    let dearer = (BUDGET_STATES / states as f64).clamp(LEAST_BUDGET, 1.0);
    (dearer * (second * duration + command * commands as f64 + run)) as u64
}

/// Called regularly with the simulated time; returns whether the user wants to stop.
pub struct Look<'a> {
    interrupted: &'a mut dyn FnMut(f64) -> bool,
    left: u64,
}

impl<'a> Look<'a> {
    /// Creates it with a function that receives the simulated time, s, and returns whether to stop.
    pub fn new(interrupted: &'a mut dyn FnMut(f64) -> bool) -> Self {
        Look { interrupted, left: ATTEMPTS_PER_LOOK }
    }
}

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
    assembly: Assembly,
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
    pub fn new(assembly: &Assembly, times: Vec<f64>) -> Self {
        let (circuit, n) = (&assembly.circuit, assembly.columns().len());
        Recorder {
            next: 0,
            net: circuit.work(),
            columns: (0..n).map(|_| Vec::with_capacity(times.len())).collect(),
            block: vec![0.0; n * ROWS_OF_A_BLOCK],
            rows: 0,
            glances: Glances::of(assembly),
            entries: (!circuit.channels().is_empty()).then(Vec::new),
            impacts: circuit.impacts(),
            assembly: assembly.clone(),
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

    /// Returns the columns of a run that may have stopped before its end.
    pub(crate) fn columns(mut self, session: &Session) -> Vec<Vec<f64>> {
        if session.failed().is_none() {
            self.complete(session);
        }
        self.spill();
        self.columns
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
            None => self.assembly.row(circuit, t, y, &mut self.net, row),
        }
        self.rows += 1;
        if self.rows == ROWS_OF_A_BLOCK {
            self.spill();
        }
        if let Some(entries) = &mut self.entries {
            entries.push(Entry::of(circuit, y));
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

/// Takes the state at the end of a run as a sample.
pub(crate) fn settled<R: Lane>(circuit: &Circuit<R>, y: &[R]) -> Vec<R> {
    let mut y = y.to_vec();
    circuit.settle(&mut y);
    y
}

/// Numbers that are copied together.
const PIECE: usize = 4;

/// Keeps states during integration, row by row.
pub struct States {
    times: Vec<f64>,
    next: usize,
    n: usize,
    rows: Vec<f64>,
}

impl States {
    /// Creates it for states of length `n`.
    pub fn new(times: Vec<f64>, n: usize) -> Self {
        States { next: 0, n, rows: Vec::with_capacity(times.len() * n), times }
    }

    /// A row of usual length is copied in two overlapping pieces, because a copy of variable length needs a function
    /// call.
    #[inline]
    fn keep(&mut self, y: &[f64]) {
        let y = &y[..self.n];
        match (y.first_chunk::<PIECE>(), y.last_chunk::<PIECE>()) {
            (Some(first), Some(last)) if self.n <= 2 * PIECE => {
                let end = self.rows.len() + self.n;
                self.rows.extend_from_slice(first);
                self.rows.truncate(end - PIECE);
                self.rows.extend_from_slice(last);
            }
            _ => self.rows.extend_from_slice(y),
        }
        self.next += 1;
    }

    /// Returns all rows. The remaining samples are those at the end.
    pub fn finish(mut self, session: &Session) -> Vec<f64> {
        let y = &session.settled()[..];
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

/// Writes a number with its unit.
pub(crate) fn with_unit(value: f64, unit: &str) -> String {
    if unit == "1" { value.to_string() } else { format!("{value} {unit}") }
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

/// Advances to `until` and regularly checks whether to continue.
pub fn advance<R: Lane>(
    stepper: &mut Stepper<R, Circuit<R>>,
    until: f64,
    output: &mut impl Output<R, Circuit<R>>,
    look: &mut Look<'_>,
) -> Result<(), Error> {
    let most = ATTEMPTS_PER_LOOK / (1 + R::DIRECTIONS as u64);
    look.left = look.left.min(most);
    loop {
        let before = stepper.statistics(0).factorisations;
        let paused = stepper.advance(until, look.left, output);
        if let Some(failure) = (0..R::L).find_map(|lane| failure_of(stepper, lane)) {
            return Err(Error::Stopped(failure));
        }
        if paused == Paused::Arrived {
            look.left -= stepper.statistics(0).factorisations - before;
            look.left = look.left.max(1);
            return Ok(());
        }
        look.left = most;
        if (look.interrupted)(stepper.time(0)) {
            return Err(Error::Interrupted { t: stepper.time(0) });
        }
    }
}

/// Returns why a lane has stopped early, if it has: the time, the state, and a remedy.
pub fn failure_of<R: Lane>(stepper: &Stepper<R, Circuit<R>>, lane: usize) -> Option<String> {
    Some(in_words(stepper.failure(lane)?, lane, stepper))
}

/// Returns the message of a failed run: time, state, value and remedy.
fn in_words<R: Lane>(failure: Failure, lane: usize, stepper: &Stepper<R, Circuit<R>>) -> String {
    let (circuit, y) = (stepper.system(), stepper.state());
    let names = circuit.state_names();
    let state = |i: usize| {
        names.get(i).map_or("an account".to_string(), |(name, _)| format!("{name} = {:.6e}", y[i].get(lane)))
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
        Failure::Outside { t } => {
            (t, "no shorter step keeps the state valid".to_string(), "another start, or a tighter rtol")
        }
        Failure::Chatter { t, .. } => (
            t,
            "stick and slip alternate without progress in time".to_string(),
            "law = \"lugre\", or a breakaway force above the Coulomb force",
        ),
        Failure::TooManyAttempts { t, attempts } => (
            t,
            format!("its budget of {attempts} attempts at a step is used up"),
            "a larger budget (budget = ... in Python, --budget on the command line), a shorter duration or a looser rtol",
        ),
    };
    let scarce = circuit.scarcest(y, lane).filter(|scarce| scarce.share < 2.0 * scarce.what.least());
    let (reason, remedy) = match scarce {
        Some(Scarce { volume, what: Lacking::Room, share }) => (
            format!(
                "the piston has gone through the end stop to the cover of {volume}, where {:.2} % of the dead volume is left",
                100.0 * share
            ),
            match volume.split_once('.') {
                Some((of, end)) => {
                    format!(
                        "a larger {of}.end_stop_stiffness, a larger {of}.dead_volume_{end} or a slower approach"
                    )
                }
                None => {
                    "a larger cylinder.end_stop.stiffness, a larger cylinder.dead_volume or a slower approach"
                        .into()
                }
            },
        ),
        Some(Scarce { volume, what: Lacking::Gas, .. }) => (
            format!("no gas is left in {volume}"),
            if volume.starts_with("chamber ") {
                "another start or command, or a larger cylinder.dead_volume".into()
            } else {
                format!("another start or command, or more volume in {volume}")
            },
        ),
        None => match circuit.stretched(y, lane) {
            Some(leg) => (leg, "another start or command, shorter strokes or longer arms".into()),
            None => (reason, remedy.to_string()),
        },
    };
    let shown: Vec<String> = (0..circuit.n_states().min(SHOWN)).map(state).collect();
    format!(
        "the simulation cannot go on at t = {t:.6} s: {reason}. State: {}. Try {remedy}.",
        shown.join(", ")
    )
}

/// Largest number of states in a message: those of one cylinder.
const SHOWN: usize = 7;
