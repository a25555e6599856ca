//! What runs: a circuit whose inputs are set, now or at times to come, that is advanced and read, saved and put back,
//! and linearised. Everything else that runs a circuit calls it.

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

/// Bytes of a session begin with this, and the version of their form.
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
    /// Which of the columns the outputs are.
    pub columns: Vec<usize>,
    /// The state there.
    pub state: Vec<f64>,
    /// Its rates.
    pub rates: Vec<f64>,
    /// The outputs there.
    pub outputs: Vec<f64>,
}

/// A running circuit.
#[derive(Clone)]
pub struct Session<R: Lane = f64> {
    assembly: Assembly<R>,
    pub(super) stepper: Stepper<R, Circuit<R>>,
    /// (time, what is set, value), by time; what comes first is last.
    pub(super) schedule: Vec<(f64, What, f64)>,
    pub(super) net: Net<R>,
    row: Vec<R>,
    /// `row` is of the present state and inputs.
    pub(super) is_read: bool,
    failed: Option<String>,
    rtol: f64,
    /// Of the description and the tolerance.
    mark: u64,
    /// What it draws, where somebody asked for it.
    drawn: Option<Box<Drawn<R>>>,
}

/// FNV-1a.
fn mark_of(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Whether a time has come at another one, which the clock may not be able to tell from it.
fn has_come(time: f64, at: f64) -> bool {
    time <= at || same_time(time, at)
}

fn refuse<T>(message: impl Into<String>) -> Result<T, Error> {
    Err(Error::Specification(message.into()))
}

impl<R: Lane> Session<R> {
    /// The circuit of an assembly at a time, with its inputs and state there.
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

    /// The present time, s.
    pub fn time(&self) -> f64 {
        self.stepper.time(0)
    }

    /// Work of the integrator, by count.
    pub fn statistics(&self) -> Statistics {
        self.stepper.statistics(0)
    }

    /// The equations with their present inputs and modes.
    pub fn circuit(&self) -> &Circuit<R> {
        self.stepper.system()
    }

    /// The present state, accounts included.
    pub fn state(&self) -> &[R] {
        self.stepper.state()
    }

    /// The present state as a sample.
    pub fn settled(&self) -> Vec<R> {
        settled(self.circuit(), self.state())
    }

    /// Reason why it cannot go on, if any.
    pub fn failed(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    fn alive(&self) -> Result<(), Error> {
        match &self.failed {
            Some(reason) => refuse(format!("the session cannot go on: {reason}")),
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

    /// Sets an input at future times, without a check of its bounds: the integration ends on each of them exactly.
    pub fn plan(&mut self, input: usize, entries: impl IntoIterator<Item = (f64, f64)>) {
        self.schedule.extend(entries.into_iter().map(|(time, value)| (time, What::Input(input), value)));
        // Stable, and from the last to the first: of entries at one time the one given last holds.
        self.schedule.reverse();
        self.schedule.sort_by(|one, other| other.0.total_cmp(&one.0));
    }

    /// The place of the entry that happens next until a time, s, if any. A valve that samples its command does so behind
    /// inputs that are set at that time, and where the way ends there it waits for those that may still be set.
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

    /// Applies the entries that are due now: no input is set any more.
    pub fn settle_schedule(&mut self) {
        let now = self.time();
        while let Some((_, what, value)) = self.schedule.pop_if(|entry| has_come(entry.0, now)) {
            self.happen(what, value);
        }
    }

    /// Whether an entry is due now.
    pub fn is_due_now(&self) -> bool {
        self.schedule.last().is_some_and(|entry| has_come(entry.0, self.time()))
    }

    /// Takes the next steps by a method.
    pub(crate) fn use_method(&mut self, method: Method) {
        self.stepper.use_method(method);
    }

    /// Allows as many attempts at a step as a run to a time usually may take.
    pub fn allow_until(&mut self, until: f64) {
        let due = self.schedule.iter().filter(|entry| entry.0 <= until).count();
        let states = self.circuit().n_states();
        self.stepper.allow(budget(until - self.time(), due + 1, states));
    }

    /// Goes on until a time, s. An entry of the schedule that the clock cannot tell from it happens there, unless a valve
    /// samples its command by it, and one that it cannot tell from the present happens now.
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

    /// A column at the present state and inputs.
    pub fn read(&mut self, column: usize) -> R {
        if !self.is_read {
            let y = self.settled();
            let (circuit, t) = (self.stepper.system(), self.stepper.time(0));
            self.assembly.row(circuit, R::c(t), &y, &mut self.net, &mut self.row);
            self.is_read = true;
        }
        self.row[column]
    }

    /// The numbers of a start at the present state.
    pub fn outside(&mut self) -> Vec<R> {
        self.assembly.outside(self.stepper.system(), self.stepper.state(), &mut self.net)
    }
}

impl Session {
    /// The same, and bytes of it are taken by sessions of this description alone.
    pub fn of_description(mut self, json: &str) -> Self {
        let version = env!("CARGO_PKG_VERSION").bytes();
        self.mark = mark_of(json.bytes().chain(self.rtol.to_bits().to_le_bytes()).chain(version));
        self
    }

    /// The inputs.
    pub fn inputs(&self) -> &[Settable] {
        &self.assembly.variables.inputs
    }

    /// The numbers of a start.
    pub(super) fn starts(&self) -> &[(Starting, Vec<String>)] {
        &self.assembly.variables.starts
    }

    /// Whether an input acts at once and has no history.
    pub fn is_continuous(&self, input: usize) -> bool {
        !matches!(self.inputs()[input].target, Target::Timed(_))
    }

    /// The outputs.
    pub fn columns(&self) -> &[String] {
        self.assembly.columns()
    }

    /// An output at the present state and inputs; compiled here, so that callers need not compile the equations again.
    pub fn now(&mut self, column: usize) -> f64 {
        self.read(column)
    }

    /// The value of an input; the command is not a number while edges are set by themselves.
    pub fn input(&self, input: usize) -> f64 {
        self.assembly.get(self.circuit(), input)
    }

    fn check(&self, input: usize, value: f64) -> Result<(), Error> {
        let Settable { name, unit, bounds, target, .. } = &self.inputs()[input];
        let whole = matches!(target, Target::Timed(timing) if self.timings()[*timing].is_whole());
        if value.is_finite() && bounds.contain(value) {
            if whole && value.fract() != 0.0 {
                return refuse(format!(
                    "{name} = {value}: a switching valve takes whole numbers. Set a pulse frequency to command a share"
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

    /// Goes on until a time, s, with a budget of its own.
    pub fn go_on(&mut self, until: f64, look: &mut Look<'_>) -> Result<(), Error> {
        if until.is_finite() {
            self.allow_until(until);
        }
        let mut drawn = self.drawn.take();
        let gone = self.advance(until, &mut drawn, look);
        self.drawn = drawn;
        gone
    }

    /// From now on it follows the gas that it draws from outside, as [`Session::go_on`] takes it on. Saved bytes do not
    /// contain it.
    pub fn follow_drawn(&mut self) {
        self.drawn = Some(Box::new(Drawn::of(self.circuit())));
    }

    /// Mass that came in from reservoirs and compressors since then, kg: of each path over the boundary what it gave on
    /// balance, so that what leaves through an exhaust does not count. None where nobody follows it.
    pub fn drawn(&self) -> Option<f64> {
        self.drawn.as_ref().map(|own| own.mass())
    }

    /// The same, with some columns at `times` s on the way, which ascend from the present on.
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

    /// The whole session as bytes; a failed one has none.
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

    /// Restores the session from saved bytes, bit for bit; a failed one too.
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

    /// The names and units of the states.
    pub fn state_names(&self) -> &[(String, &'static str)] {
        self.circuit().state_names()
    }

    /// The exact derivatives of rates and outputs by the states and by some inputs. Outputs are the columns but time
    /// and command.
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
                    "the edges of the valve are set by themselves: there is no {name} to differentiate by. Linearise by their openings"
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
                    // An edge moves with the command and by itself.
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
