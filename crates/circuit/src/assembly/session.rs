//! A running circuit: its inputs are set now or later, and it is advanced, read, saved, restored and linearised. All
//! other runs of a circuit use a session.

mod linear;
mod sampled;
mod saved;
mod timed;

pub use linear::Linear;
pub use sampled::Sampling;

use crate::assembly::glances::Glances;
use crate::assembly::schedule::{Due, ScheduledAction};
use crate::assembly::variables::{Assembly, Settable, Target};
use crate::circuit::{Circuit, Drawn, Look, advance, budget, settled};
use crate::ground::{Error, Net, check_bounds, refuse};
use crate::part::InputId;
use math::Lane;
use ode::{Options, Output, Statistics, Stepper, System, same_time};

/// A running circuit.
#[derive(Clone)]
pub struct Session<R: Lane = f64> {
    /// The circuit with its names.
    pub assembly: Assembly<R>,
    pub(super) stepper: Stepper<R, Circuit<R>>,
    /// Pending entries (time, target, value) in reverse order of time.
    pub(super) schedule: Vec<(f64, ScheduledAction, f64)>,
    pub(super) net: Net<R>,
    row: Vec<R>,
    /// Fast outputs of the circuit, if it has them, from the first reading on.
    glances: Option<Option<Glances>>,
    /// Whether `row` belongs to the present state and inputs.
    pub(super) is_read: bool,
    failed: Option<String>,
    pub(super) calls: ShortCalls,
    pub(super) rtol: f64,
    /// Hash of the description and the tolerance.
    mark: u64,
    /// Gas drawn from outside, if it is recorded.
    drawn: Option<Box<Drawn<R>>>,
}

/// Integration method of the next call. A low-order method makes its first attempts if calls of this length needed few
/// attempts. A low-order step needs less work, and the end of the call limits the length of a step anyway.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ShortCalls {
    /// Calls of few attempts until low order is tried again.
    pub left: u32,
    /// Duration of the last call, s.
    pub lasted: f64,
}

impl ShortCalls {
    /// Largest number of attempts in a call for which low order is efficient: one high-order attempt costs as much as
    /// two.
    const FEW: u64 = 2;
    /// Attempts of low order in one call. A call that needs more is continued by the high-order method.
    const MOST: u64 = 2 * Self::FEW;
    /// Calls of few attempts after which low order is tried again: tries then cost a few percent (assumed).
    const PAUSE: u32 = 16;
    /// Largest ratio of a duration to the last one that counts as equal (assumed).
    const LONGER: f64 = 1.5;

    /// Returns the number of attempts by low order in a call that lasts this long, s.
    pub fn low_order(&self, lasts: f64) -> u64 {
        if self.left == 0 && lasts <= Self::LONGER * self.lasted { Self::MOST } else { 0 }
    }

    /// Registers a call: how long it lasted, s, and its number of attempts.
    pub fn register(&mut self, lasted: f64, attempts: u64) {
        let left = if attempts > Self::FEW { Self::PAUSE } else { self.left.saturating_sub(1) };
        *self = ShortCalls { left, lasted };
    }
}

/// Returns whether two times are equal within the resolution of the clock.
fn has_come(time: f64, at: f64) -> bool {
    time <= at || same_time(time, at)
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
            glances: None,
            is_read: false,
            failed: None,
            calls: ShortCalls::default(),
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
            Some(reason) => refuse!("the session cannot continue: {reason}"),
            None => Ok(()),
        }
    }

    fn not_before(&self, what: &str, t: f64) -> Result<(), Error> {
        if t.is_finite() && t >= self.time() {
            return Ok(());
        }
        let why = if t.is_finite() { "has passed" } else { "is not a time" };
        refuse!("{what} = {t} s {why}: it must be finite and not before the present, {} s", self.time())
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

    /// Adds an entry of a timing at a future time, after entries due at the same time.
    pub(super) fn later(&mut self, time: f64, timing: usize, due: Due, value: f64) {
        let place = self.schedule.partition_point(|entry| entry.0 > time);
        self.schedule.insert(place, (time, ScheduledAction::Timing(timing, due), value));
    }

    pub(super) fn is_due(&self, timing: usize, due: Due) -> bool {
        self.schedule.iter().any(|entry| entry.1 == ScheduledAction::Timing(timing, due))
    }

    pub(super) fn forget(&mut self, timing: usize, due: Due) {
        self.schedule.retain(|entry| entry.1 != ScheduledAction::Timing(timing, due));
    }

    /// Sets an input at future times, without a check of its bounds. The integration ends exactly on each of them.
    pub fn plan(&mut self, input: usize, entries: impl IntoIterator<Item = (f64, f64)>) {
        let mut schedule: Vec<_> =
            entries.into_iter().map(|(time, value)| (time, ScheduledAction::Input(input), value)).collect();
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
        let is_before = |what: ScheduledAction| {
            if ends { !what.waits() } else { matches!(what, ScheduledAction::Input(_)) }
        };
        let other = self.schedule.iter().rposition(|entry| has_come(entry.0, first.0) && is_before(entry.1));
        other.or((!ends).then_some(place))
    }

    fn happen(&mut self, what: ScheduledAction, value: f64) {
        match what {
            ScheduledAction::Input(input) => self.put(input, value),
            ScheduledAction::Timing(timing, due) => self.happens(timing, due, value),
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

    /// Returns the start values at the present state.
    pub fn outside(&mut self) -> Vec<R> {
        self.assembly.outside(self.stepper.system(), self.stepper.state(), &mut self.net)
    }
}

impl Session {
    /// Returns the inputs.
    pub fn inputs(&self) -> &[Settable] {
        &self.assembly.variables.inputs
    }

    /// Returns whether an input acts immediately and has no history.
    pub fn is_continuous(&self, input: usize) -> bool {
        !matches!(self.inputs()[input].target, Target::Timed(_))
    }

    /// Returns a column at the present state and inputs.
    pub fn read(&mut self, column: usize) -> f64 {
        if !self.is_read {
            let y = self.settled();
            let (circuit, t) = (self.stepper.system(), self.stepper.time(0));
            match self.glances.get_or_insert_with(|| {
                Glances::of(&self.assembly.circuit, &self.assembly.variables.quantities)
            }) {
                Some(glances) => glances.row(circuit, t, &y, &mut self.row),
                None => self.assembly.row(circuit, t, &y, &mut self.net, &mut self.row),
            }
            self.is_read = true;
        }
        self.row[column]
    }

    /// Returns the value of an input. The command is NaN while the edges are set directly.
    pub fn input(&self, input: usize) -> f64 {
        self.assembly.get(self.circuit(), input)
    }

    fn check(&self, input: usize, value: f64) -> Result<(), Error> {
        let Settable { name, unit, bounds, target, .. } = &self.inputs()[input];
        check_bounds(name, value, unit, bounds)?;
        let whole = matches!(target, Target::Timed(timing) if self.assembly.timings[*timing].is_whole());
        if whole && value.fract() != 0.0 {
            let positions = if bounds.contain(-1.0) { "-1, 0 or 1" } else { "0 or 1" };
            return refuse!(
                "{name} = {value}: it must be {positions}, because it switches. Take a proportional valve for fractions, or 2/2 \
                 or 3/2 valves with pwm_frequency"
            );
        }
        Ok(())
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
            return refuse!(
                "{} times and {} values: there must be one value for each time",
                times.len(),
                values.len()
            );
        }
        for (&time, &value) in times.iter().zip(values) {
            self.check(input, value)?;
            self.not_before("t", time)?;
        }
        self.plan(input, times.iter().copied().zip(values.iter().copied()));
        Ok(())
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
}
