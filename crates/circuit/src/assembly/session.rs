//! A running circuit: its inputs are set now or later, and it is advanced, read, saved, restored and linearised. All
//! other runs of a circuit use a session.

use super::timing::{Due, Timing, What};
use super::variables::{Assembly, Quantity, Settable, Starting, Target, Variables};
use crate::circuit::Circuit;
use crate::drawn::Drawn;
use crate::net::Net;
use crate::part::InputId;
use crate::run::{Error, Look, Recorder, Run, advance, budget, settled, with_unit};
use math::{Dual, Lane, Real};
use ode::{Method, Options, Output, Statistics, Stepper, System, same_time};
use std::sync::Arc;

/// First bytes of a saved session, and the version of the format.
const MAGIC: &[u8; 8] = b"pnd-ses\x05";

/// Directions of one pass of a linearisation.
const DIRECTIONS: usize = 8;
type Seeded = Dual<f64, DIRECTIONS>;

/// x' = A x + B u, y = C x + D u about the present state: rows one after the other.
#[derive(Clone, Debug)]
pub struct Linear {
    /// A: derivatives of the rates by the states.
    pub a: Vec<f64>,
    /// B: derivatives of the rates by the inputs.
    pub b: Vec<f64>,
    /// C: derivatives of the outputs by the states.
    pub c: Vec<f64>,
    /// D: derivatives of the outputs by the inputs.
    pub d: Vec<f64>,
    /// Columns of the outputs.
    pub columns: Vec<usize>,
    /// State at the point of linearisation.
    pub state: Vec<f64>,
    /// Rates at this point.
    pub rates: Vec<f64>,
    /// Outputs at this point.
    pub outputs: Vec<f64>,
}

/// A running circuit.
#[derive(Clone)]
pub struct Session<R: Lane = f64> {
    assembly: Assembly<R>,
    pub(super) stepper: Stepper<R, Circuit<R>>,
    /// Pending entries (time, target, value) in reverse order of time.
    pub(super) schedule: Vec<(f64, What, f64)>,
    pub(super) net: Net<R>,
    row: Vec<R>,
    /// Whether `row` belongs to the present state and inputs.
    pub(super) is_read: bool,
    failed: Option<String>,
    pub(super) rtol: f64,
    /// Hash of the description and the tolerance.
    mark: u64,
    /// Gas drawn from outside, if it is recorded.
    drawn: Option<Box<Drawn<R>>>,
}

/// FNV-1a hash.
fn mark_of(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Returns whether two times are equal within the resolution of the clock.
fn has_come(time: f64, at: f64) -> bool {
    time <= at || same_time(time, at)
}

fn refuse<T>(message: impl Into<String>) -> Result<T, Error> {
    Err(Error::Specification(message.into()))
}

impl<R: Lane> Session<R> {
    /// Returns the circuit of an assembly at a time, with its inputs and state.
    pub fn new(assembly: &Assembly<R>, t: f64, (circuit, y): (Circuit<R>, Vec<R>), options: Options) -> Self {
        Session {
            net: circuit.work(),
            row: vec![R::zero(); assembly.columns().len()],
            assembly: assembly.clone(),
            stepper: Stepper::new(circuit, t, &y, options),
            schedule: Vec::new(),
            is_read: false,
            failed: None,
            rtol: options.rtol,
            mark: 0,
            drawn: None,
        }
    }

    /// Returns the present time, s.
    pub fn time(&self) -> f64 {
        self.stepper.time(0)
    }

    /// Returns the work counts of the integrator.
    pub fn statistics(&self) -> Statistics {
        self.stepper.statistics(0)
    }

    /// Returns the equations with their present inputs and modes.
    pub fn circuit(&self) -> &Circuit<R> {
        self.stepper.system()
    }

    /// Returns the present state with its balances.
    pub fn state(&self) -> &[R] {
        self.stepper.state()
    }

    /// Passes the present state on as a sample.
    pub fn settled(&self) -> Vec<R> {
        settled(self.circuit(), self.state())
    }

    /// Returns the reason why the session cannot continue, if any.
    pub fn failed(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    fn alive(&self) -> Result<(), Error> {
        match &self.failed {
            Some(reason) => refuse(format!("the session cannot continue: {reason}")),
            None => Ok(()),
        }
    }

    fn not_before(&self, what: &str, t: f64) -> Result<(), Error> {
        if t.is_finite() && t >= self.time() {
            return Ok(());
        }
        let why = if t.is_finite() { "has passed" } else { "is not a time" };
        refuse(format!(
            "{what} = {t} s {why}: it must be finite and not before the present, {} s",
            self.time()
        ))
    }

    /// Sets an input from now on, without a check of its bounds.
    pub(crate) fn put(&mut self, input: usize, value: f64) {
        if let Target::Timed(timing) = self.assembly.variables.inputs[input].target {
            return self.command(timing, value);
        }
        let circuit = self.stepper.system_mut();
        for lane in 0..R::L {
            self.assembly.set(circuit, input, lane, R::c(value));
        }
        self.is_read = false;
    }

    /// Sets an input of a part.
    pub(super) fn act(&mut self, id: InputId, value: f64) {
        let circuit = self.stepper.system_mut();
        (0..R::L).for_each(|lane| circuit.set_input(id, lane, R::c(value)));
        self.is_read = false;
    }

    /// Delayed effects of commands.
    pub(super) fn timings(&self) -> &[Timing] {
        &self.assembly.timings
    }

    /// Adds an entry of a timing at a future time, after entries due at the same time.
    pub(super) fn later(&mut self, time: f64, timing: usize, due: Due, value: f64) {
        let place = self.schedule.partition_point(|entry| entry.0 > time);
        self.schedule.insert(place, (time, What::Timing(timing, due), value));
    }

    pub(super) fn is_due(&self, timing: usize, due: Due) -> bool {
        self.schedule.iter().any(|entry| entry.1 == What::Timing(timing, due))
    }

    pub(super) fn forget(&mut self, timing: usize, due: Due) {
        self.schedule.retain(|entry| entry.1 != What::Timing(timing, due));
    }

    /// Sets an input at future times, without a check of its bounds. The integration ends exactly on each of them.
    pub fn plan(&mut self, input: usize, entries: impl IntoIterator<Item = (f64, f64)>) {
        let mut schedule: Vec<_> =
            entries.into_iter().map(|(time, value)| (time, What::Input(input), value)).collect();
        schedule.reverse();
        schedule.append(&mut self.schedule);
        // From last to first. The sort is stable: of entries at one time, those that were there before come first.
        schedule.sort_by(|one, other| other.0.total_cmp(&one.0));
        self.schedule = schedule;
    }

    /// Returns the index of the next entry until a time, s, if any. A valve that samples its command takes inputs set
    /// at the same time. At the end of the run such a valve waits, because inputs may still be set.
    fn next(&self, until: f64) -> Option<usize> {
        let place = self.schedule.len().checked_sub(1)?;
        let first = &self.schedule[place];
        if !has_come(first.0, until) {
            return None;
        }
        if !first.1.waits() {
            return Some(place);
        }
        let ends = same_time(first.0, until);
        let is_before = |what: What| if ends { !what.waits() } else { matches!(what, What::Input(_)) };
        let other = self.schedule.iter().rposition(|entry| has_come(entry.0, first.0) && is_before(entry.1));
        other.or((!ends).then_some(place))
    }

    fn happen(&mut self, what: What, value: f64) {
        match what {
            What::Input(input) => self.put(input, value),
            What::Timing(timing, due) => self.happens(timing, due, value),
        }
    }

    /// Applies the entries that are due now. No further input is set at this time.
    pub fn settle_schedule(&mut self) {
        let now = self.time();
        while let Some((_, what, value)) = self.schedule.pop_if(|entry| has_come(entry.0, now)) {
            self.happen(what, value);
        }
    }

    /// Returns whether an entry is due now.
    pub fn is_due_now(&self) -> bool {
        self.schedule.last().is_some_and(|entry| has_come(entry.0, self.time()))
    }

    /// Sets the method of the next steps.
    pub(crate) fn use_method(&mut self, method: Method) {
        self.stepper.use_method(method);
    }

    /// Allows the usual number of attempts for a run to a time.
    pub fn allow_until(&mut self, until: f64) {
        let due = self.schedule.iter().filter(|entry| entry.0 <= until).count();
        let states = self.circuit().n_states();
        self.stepper.allow(budget(until - self.time(), due + 1, states));
    }

    /// Continues until a time, s. Entries within the clock's resolution of that time are applied there, and those
    /// within the resolution of the present time now. A sampling valve's entries are the exception.
    pub fn advance(
        &mut self,
        until: f64,
        output: &mut impl Output<R, Circuit<R>>,
        look: &mut Look<'_>,
    ) -> Result<(), Error> {
        self.alive()?;
        self.not_before("until", until)?;
        self.is_read = false;
        loop {
            let next = self.next(until);
            let now = self.time();
            let target = match next.map(|place| self.schedule[place].0) {
                Some(t) if same_time(t, now) => now,
                Some(t) if !same_time(t, until) => t,
                _ => until,
            };
            match advance(&mut self.stepper, target, output, look) {
                Err(Error::Stopped(message)) => {
                    self.failed = Some(message.clone());
                    return Err(Error::Stopped(message));
                }
                other => other?,
            }
            let Some(place) = next else { return Ok(()) };
            let (_, what, value) = self.schedule.remove(place);
            self.happen(what, value);
        }
    }

    /// Returns a column at the present state and inputs.
    pub fn read(&mut self, column: usize) -> R {
        if !self.is_read {
            let y = self.settled();
            let (circuit, t) = (self.stepper.system(), self.stepper.time(0));
            self.assembly.row(circuit, R::c(t), &y, &mut self.net, &mut self.row);
            self.is_read = true;
        }
        self.row[column]
    }

    /// Returns the start values at the present state.
    pub fn outside(&mut self) -> Vec<R> {
        self.assembly.outside(self.stepper.system(), self.stepper.state(), &mut self.net)
    }
}

impl Session {
    /// Does the same with saved bytes that only sessions of this description accept.
    pub fn of_description(mut self, json: &str) -> Self {
        let version = env!("CARGO_PKG_VERSION").bytes();
        self.mark = mark_of(json.bytes().chain(self.rtol.to_bits().to_le_bytes()).chain(version));
        self
    }

    /// Returns the inputs.
    pub fn inputs(&self) -> &[Settable] {
        &self.assembly.variables.inputs
    }

    /// Returns the names of the start values.
    pub(super) fn starts(&self) -> &[(Starting, Vec<String>)] {
        &self.assembly.variables.starts
    }

    /// Returns whether an input acts immediately and has no history.
    pub fn is_continuous(&self, input: usize) -> bool {
        !matches!(self.inputs()[input].target, Target::Timed(_))
    }

    /// Returns the outputs.
    pub fn columns(&self) -> &[String] {
        self.assembly.columns()
    }

    /// Returns an output at the present state and inputs. It is compiled here, so that callers need not compile the
    /// equations again.
    pub fn now(&mut self, column: usize) -> f64 {
        self.read(column)
    }

    /// Returns the value of an input. The command is NaN while the edges are set directly.
    pub fn input(&self, input: usize) -> f64 {
        self.assembly.get(self.circuit(), input)
    }

    fn check(&self, input: usize, value: f64) -> Result<(), Error> {
        let Settable { name, unit, bounds, target, .. } = &self.inputs()[input];
        let whole = matches!(target, Target::Timed(timing) if self.timings()[*timing].is_whole());
        if value.is_finite() && bounds.contain(value) {
            if whole && value.fract() != 0.0 {
                return refuse(format!(
                    "{name} = {value}: a switching valve accepts whole numbers only. Set a pulse frequency to command a fraction"
                ));
            }
            return Ok(());
        }
        let (value, rule) = (with_unit(value, unit), bounds.rule(value));
        refuse(format!("{name} = {value} is out of bounds: it must be {rule}"))
    }

    /// Sets an input from now on.
    pub fn set(&mut self, input: usize, value: f64) -> Result<(), Error> {
        self.check(input, value)?;
        self.alive()?;
        self.put(input, value);
        Ok(())
    }

    /// Sets an input at future times.
    pub fn schedule(&mut self, input: usize, times: &[f64], values: &[f64]) -> Result<(), Error> {
        self.alive()?;
        if times.len() != values.len() {
            return refuse(format!(
                "{} times and {} values: there must be one value for each time",
                times.len(),
                values.len()
            ));
        }
        for (&time, &value) in times.iter().zip(values) {
            self.check(input, value)?;
            self.not_before("t", time)?;
        }
        self.plan(input, times.iter().copied().zip(values.iter().copied()));
        Ok(())
    }

    /// Continues until a time, s, with a separate limit on attempts.
    pub fn go_on(&mut self, until: f64, look: &mut Look<'_>) -> Result<(), Error> {
        if until.is_finite() {
            self.allow_until(until);
        }
        let mut drawn = self.drawn.take();
        let gone = self.advance(until, &mut drawn, look);
        self.drawn = drawn;
        gone
    }

    /// From now on, records the gas drawn from outside while [`Session::go_on`] runs. Saved bytes do not contain this
    /// record.
    pub fn follow_drawn(&mut self) {
        self.drawn = Some(Box::new(Drawn::of(self.circuit())));
    }

    /// Returns the net mass that entered from each reservoir and compressor since then, kg. Gas that leaves through an
    /// exhaust does not count. `None` if the gas is not recorded.
    pub fn drawn(&self) -> Option<f64> {
        self.drawn.as_ref().map(|own| own.mass())
    }

    /// Does the same, and returns some columns at `times`, s, on the way. The times ascend from the present time.
    pub fn record(
        &mut self,
        until: f64,
        times: Vec<f64>,
        columns: &[usize],
        look: &mut Look<'_>,
    ) -> Result<Run, Error> {
        if !times.is_sorted() || times.first().is_some_and(|first| *first < self.time()) {
            return refuse("the times of samples must ascend, and none may have passed");
        }
        if until.is_finite() {
            self.allow_until(until);
        }
        let all = &self.assembly.variables;
        let shown = Variables {
            columns: columns.iter().map(|&column| all.columns[column].clone()).collect(),
            quantities: columns.iter().map(|&column| all.quantities[column]).collect(),
            ..Variables::default()
        };
        let assembly = Assembly { variables: Arc::new(shown), ..self.assembly.clone() };
        let mut recorder = Recorder::new(&assembly, times);
        self.advance(until, &mut recorder, look)?;
        Ok(recorder.finish(self))
    }

    /// Returns the whole session as bytes, or `None` after a failure.
    pub fn save(&self) -> Result<Vec<u8>, Error> {
        self.alive()?;
        let Some(stepper) = self.stepper.save() else { return refuse("the session cannot go on") };
        let circuit = self.circuit();
        let mut words = vec![self.mark, self.schedule.len() as u64, u64::from(circuit.has_met())];
        words.push(circuit.stops_laid_out_for().unwrap_or(0.0).to_bits());
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
        if !whole || words.len() < 5 {
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
        let (values, rest) = words[4..words.len() - 1].split_at_checked(ids.len()).unwrap_or_default();
        let (modes, rest) = rest.split_at_checked(n_modes).unwrap_or_default();
        let (stepper, entries) = rest.split_at_checked(self.stepper.words()).unwrap_or_default();
        let (entries, left) = entries.as_chunks::<3>();
        let fits = left.is_empty() && entries.len() as u64 == words[1];
        let number = |word: &u64| f64::from_bits(*word);
        let (n_inputs, n_timings) = (self.inputs().len(), self.timings().len());
        let entry = |[t, code, value]: &[u64; 3]| {
            Some((number(t), What::of(*code, n_inputs, n_timings)?, number(value)))
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
        (self.failed, self.is_read) = (None, false);
        Ok(())
    }

    /// Returns the names and units of the states.
    pub fn state_names(&self) -> &[(String, &'static str)] {
        self.circuit().state_names()
    }

    /// Returns the exact derivatives of rates and outputs by the states and by some inputs. Outputs are all columns
    /// except time and command.
    pub fn linearise(&self, inputs: &[usize]) -> Result<Linear, Error> {
        self.alive()?;
        let commands: Vec<(usize, usize, f64)> = (inputs.iter().enumerate())
            .filter(|(_, input)| matches!(self.inputs()[**input].target, Target::Edges(_)))
            .map(|(direction, &input)| (direction, input, self.input(input)))
            .collect();
        for (_, input, u) in &commands {
            let name = &self.inputs()[*input].name;
            if *u == 0.0 {
                return refuse(format!(
                    "{name} = 0: the valve is shut, and its flow has one slope towards extending and another towards retracting. \
                     Set a small command in one direction, or linearise by the openings of the edges"
                ));
            }
            if u.is_nan() {
                return refuse(format!(
                    "the edges of the valve are set directly: there is no {name} to differentiate by. Linearise by their openings"
                ));
            }
        }
        for &input in inputs {
            let Settable { name, target, .. } = &self.inputs()[input];
            if matches!(target, Target::Timed(timing) if self.timings()[*timing].smooth().is_none()) {
                return refuse(format!(
                    "{name} switches: the circuit has no derivative by it. Linearise by the other inputs"
                ));
            }
        }
        let (circuit, n) = (self.stepper.system(), self.stepper.system().n_states());
        let mut y0 = self.stepper.state().to_vec();
        circuit.settle(&mut y0);
        let quantities = &self.assembly.variables.quantities;
        let columns: Vec<usize> = (0..quantities.len())
            .filter(|&i| !matches!(quantities[i], Quantity::Time | Quantity::Command(_) | Quantity::Input(_)))
            .collect();
        let directions = n + inputs.len();
        let lifted = Circuit::<Seeded>::gather(&[circuit]);
        let (mut dy, mut row) = (vec![Seeded::zero(); y0.len()], vec![Seeded::zero(); self.row.len()]);
        let mut slopes = vec![vec![0.0; directions]; n + columns.len()];
        for first in (0..directions).step_by(DIRECTIONS) {
            let seeded = |value: f64, direction: usize| Dual {
                re: value,
                eps: std::array::from_fn(|k| f64::from(u8::from(first + k == direction))),
            };
            let mut circuit = lifted.clone();
            for &(k, input, u) in &commands {
                self.assembly.set(&mut circuit, input, 0, seeded(u, n + k));
            }
            for (k, &input) in inputs.iter().enumerate() {
                let id = match self.inputs()[input].target {
                    Target::Input(id) => Some(id),
                    Target::Timed(timing) => self.timings()[timing].smooth(),
                    Target::Edges(_) => None,
                };
                if let Some(id) = id {
                    // An edge moves with the command and independently.
                    let value = circuit.input(id) + seeded(0.0, n + k);
                    circuit.set_input(id, 0, value);
                }
            }
            let y: Vec<Seeded> = y0.iter().enumerate().map(|(i, &value)| seeded(value, i)).collect();
            let mut net = circuit.work::<Seeded>();
            circuit.rhs(Seeded::zero(), &y, &mut dy, &mut net);
            self.assembly.row(&circuit, Seeded::c(self.time()), &y, &mut net, &mut row);
            let numbers = dy[..n].iter().chain(columns.iter().map(|&column| &row[column]));
            for (slopes, number) in slopes.iter_mut().zip(numbers) {
                let pass = first..directions.min(first + DIRECTIONS);
                slopes[pass.clone()].copy_from_slice(&number.eps[..pass.len()]);
            }
        }
        let part = |rows: std::ops::Range<usize>, of: std::ops::Range<usize>| {
            slopes[rows].iter().flat_map(|row| row[of.clone()].to_vec()).collect::<Vec<_>>()
        };
        let all = n + columns.len();
        Ok(Linear {
            a: part(0..n, 0..n),
            b: part(0..n, n..directions),
            c: part(n..all, 0..n),
            d: part(n..all, n..directions),
            state: y0[..n].to_vec(),
            rates: dy[..n].iter().map(|rate| rate.re).collect(),
            outputs: columns.iter().map(|&column| row[column].re).collect(),
            columns,
        })
    }
}
