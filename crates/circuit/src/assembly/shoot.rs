//! Several runs of an assembly, each from its own start, with derivatives, for multiple shooting.

use crate::assembly::session::Session;
use crate::assembly::variables::{Assembly, Target, values_of};
use crate::circuit::{Circuit, Look, budget};
use crate::component::Quantity;
use crate::ground::{Error, Net, refuse, run_jobs};
use math::Lane;
use ode::{Options, Output, System};
use std::sync::atomic::{AtomicBool, Ordering};

/// Values of an input, each constant from its time, s, to the next.
#[derive(Clone, Debug)]
pub struct InputPlan {
    /// Name of the input.
    pub input: String,
    /// Times, increasing.
    pub times: Vec<f64>,
    /// A value for each time.
    pub values: Vec<f64>,
}

/// A request: segments of a record, each from its own start. Lengths of lists agree, and times increase.
#[derive(Clone, Debug)]
pub struct Shooting {
    /// Values of inputs.
    pub plans: Vec<InputPlan>,
    /// s, increasing; the first is the start of the first segment, the last the end of the last one.
    pub sample_times: Vec<f64>,
    /// Sample index at which each segment starts.
    pub starts: Vec<usize>,
    /// The start of each segment, row by row; see [`Assembly::start_names`].
    pub initial: Vec<f64>,
    /// Numbers of the description to differentiate by, as paths of its JSON.
    pub parameters: Vec<String>,
    /// Groups of start values to differentiate by, by index in [`Assembly::start_names`]. The values of a group move
    /// together. `None`: every start value.
    pub by_start: Option<Vec<Vec<usize>>>,
    /// Columns of a run.
    pub outputs: Vec<String>,
    /// Relative tolerance of the integrator.
    pub options: Options,
    /// Largest number of threads for segments.
    pub threads: usize,
}

/// Number of commands before a segment that determine the state of its valves: at one a millisecond, 1 s, more than any
/// dead time and travel (assumed).
const RECALLED: usize = 1000;

/// The result; arrays row by row, derivatives last.
#[derive(Clone, Debug)]
pub struct Shot {
    /// (samples, outputs). The outputs of a segment's first sample belong to its start.
    pub values: Vec<f64>,
    /// (samples, outputs, directions)
    pub sensitivities: Vec<f64>,
    /// (segments, states of a start): the end of each segment.
    pub ends: Vec<f64>,
    /// (segments, states, directions)
    pub end_sensitivities: Vec<f64>,
    /// Reasons why segments failed. Later numbers of a failed segment are not finite.
    pub failures: Vec<Option<String>>,
    /// Number of derivatives of each value.
    pub directions: usize,
}

/// Number of values of a start, for a valid request.
fn check(asked: &Shooting, of: &Assembly) -> Result<usize, Error> {
    let last = asked.sample_times.len() - 1;
    for InputPlan { times, .. } in &asked.plans {
        if times.first().is_none_or(|&first| first > asked.sample_times[0]) {
            return refuse!("the first command must come at or before {} s", asked.sample_times[0]);
        }
    }
    let ordered = asked.starts.windows(2).all(|pair| pair[0] < pair[1]);
    if asked.starts.first() != Some(&0) || !ordered || asked.starts.last() >= Some(&last) {
        return refuse!("starts must be increasing samples from 0 to below {last}");
    }
    let width = of.start_names().len();
    for (j, row) in asked.initial.chunks_exact(width).enumerate() {
        if let Some((name, value, rule)) = of.impossible_start(row, true) {
            return refuse!("initial: {name} = {value} of segment {j} must be {rule}");
        }
    }
    Ok(width)
}

/// All runs of a request.
pub(in crate::assembly) struct All<'a> {
    asked: &'a Shooting,
    /// Index of the input of each plan.
    inputs: Vec<usize>,
    columns: Vec<usize>,
    states: usize,
    by_start: Vec<Vec<usize>>,
    n_parameters: usize,
    pub directions: usize,
}

/// Result of one run: the outputs at its samples, and the end state.
struct Done<P> {
    rows: Vec<P>,
    end: Vec<P>,
    failure: Option<String>,
}

impl<'a> All<'a> {
    /// Checked request for an assembly.
    pub fn of(asked: &'a Shooting, plain: &Assembly) -> Result<Self, Error> {
        let states = check(asked, plain)?;
        let columns = asked.outputs.iter().map(|name| plain.variables.column(name));
        let columns = columns.collect::<Result<Vec<_>, _>>()?;
        let inputs = asked.plans.iter().map(|plan| plain.variables.input(&plan.input));
        let inputs = inputs.collect::<Result<Vec<_>, _>>()?;
        let n_parameters = asked.parameters.len();
        let by_start = match &asked.by_start {
            None => (0..states).map(|place| vec![place]).collect(),
            Some(groups) => groups.clone(),
        };
        let directions = n_parameters + by_start.len();
        Ok(All { asked, inputs, columns, states, by_start, n_parameters, directions })
    }

    /// Runs every segment with the assembly of each pass.
    pub fn run<P: Lane>(
        &self,
        drives: &[Assembly<P>],
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Shot, Error> {
        let (segments, samples) = (self.asked.starts.len(), self.asked.sample_times.len());
        let (outputs, directions) = (self.columns.len(), self.directions);
        let mut shot = Shot {
            values: vec![f64::NAN; samples * outputs],
            sensitivities: vec![f64::NAN; samples * outputs * directions],
            ends: vec![f64::NAN; segments * self.states],
            end_sensitivities: vec![f64::NAN; segments * self.states * directions],
            failures: vec![None; segments],
            directions,
        };
        let jobs = segments * drives.len();
        let of = |job: usize| (job / drives.len(), job % drives.len());
        let whole = run_jobs(
            (self.asked.threads, jobs),
            || (),
            |(), job, stop| {
                let (segment, pass) = of(job);
                self.segment(&drives[pass], segment, pass, stop)
            },
            |job, done| {
                let (segment, pass) = of(job);
                self.enter(&mut shot, segment, pass, done?);
                Ok(())
            },
            &mut || interrupted(self.asked.sample_times[0]),
        )?;
        if !whole {
            return Err(Error::Interrupted { t: self.asked.sample_times[0] });
        }
        Ok(shot)
    }

    /// The samples of a segment: from its start to the last sample before the next segment.
    fn samples(&self, segment: usize) -> std::ops::Range<usize> {
        let starts = &self.asked.starts;
        starts[segment]..starts.get(segment + 1).copied().unwrap_or(self.asked.sample_times.len())
    }

    fn segment<P: Lane>(
        &self,
        drive: &Assembly<P>,
        segment: usize,
        pass: usize,
        stop: &AtomicBool,
    ) -> Result<Done<P>, Error> {
        let asked = self.asked;
        let samples = self.samples(segment);
        let last = asked.starts.get(segment + 1).copied().unwrap_or(samples.end - 1);
        let (from, end) = (asked.sample_times[samples.start], asked.sample_times[last]);
        let row = &asked.initial[segment * self.states..][..self.states];
        let first = pass * P::DIRECTIONS;
        let seed = |i: usize, direction: usize| {
            let of = direction.checked_sub(self.n_parameters).and_then(|k| self.by_start.get(k));
            f64::from(u8::from(of.is_some_and(|group| group.contains(&i))))
        };
        let start: Vec<P> = (0..self.states)
            .map(|i| P::from_parts(|part| if part == 0 { row[i] } else { seed(i, first + part - 1) }))
            .collect();
        let at = |times: &[f64]| times.partition_point(|&time| time <= from) - 1;
        let since =
            |times: &[f64]| at(times).saturating_sub(if drive.timings.is_empty() { 0 } else { RECALLED });
        let plans = self.inputs.iter().zip(&asked.plans);
        // A valve starts at rest, as in a run, then its commands follow.
        let is_held = |input: usize| !matches!(drive.variables.inputs[input].target, Target::Timed(_));
        let held = plans.clone().filter(|(input, _)| is_held(**input));
        let held: Vec<(usize, P)> =
            held.map(|(&input, plan)| (input, P::c(plan.values[since(&plan.times)]))).collect();
        let begun = drive.begin(&start, &held);
        let quantities = self.columns.iter().map(|&column| drive.variables.quantities[column]).collect();
        let (times, net) = (&asked.sample_times[samples], begun.0.work());
        let mut tracker = Tracker { quantities, times, next: 0, net, rows: Vec::new() };
        let changes = |times: &[f64]| times.partition_point(|&time| time < end) - at(times);
        let commands = asked.plans.iter().map(|plan| changes(&plan.times)).sum();
        let work = budget(end - from, commands, begun.0.n_states());
        let options = Options { max_attempts: asked.options.max_attempts.min(work), ..asked.options };
        let first = plans.clone().map(|(_, plan)| plan.times[since(&plan.times)]).fold(from, f64::min);
        let mut session = Session::new(drive, first, begun, options);
        for (&input, InputPlan { times, values, .. }) in plans {
            let entries = times.iter().copied().zip(values.iter().copied()).skip(since(times));
            session.plan(input, entries.take_while(|(time, _)| *time < end));
        }
        session.recall(from);
        let mut stopped = |_| stop.load(Ordering::Relaxed);
        match session.advance(end, &mut tracker, &mut Look::new(&mut stopped)) {
            Ok(()) => {
                tracker.finish(&session);
                Ok(Done { rows: tracker.rows, end: session.outside(), failure: None })
            }
            Err(Error::Stopped(message)) => {
                Ok(Done { rows: tracker.rows, end: Vec::new(), failure: Some(message) })
            }
            Err(other) => Err(other),
        }
    }

    /// Writes the result of one pass of one segment.
    fn enter<P: Lane>(&self, shot: &mut Shot, segment: usize, pass: usize, done: Done<P>) {
        let first = pass * P::DIRECTIONS;
        let write = |values: &mut [f64], derivatives: &mut [f64], numbers: &[P]| {
            for (i, number) in numbers.iter().enumerate() {
                if pass == 0 {
                    values[i] = number.get(0);
                }
                for direction in first..self.directions.min(first + P::DIRECTIONS) {
                    derivatives[i * self.directions + direction] = number.part(1 + direction - first);
                }
            }
        };
        let row = self.samples(segment).start * self.columns.len();
        write(&mut shot.values[row..], &mut shot.sensitivities[row * self.directions..], &done.rows);
        let row = segment * self.states;
        write(&mut shot.ends[row..], &mut shot.end_sensitivities[row * self.directions..], &done.end);
        shot.failures[segment] = done.failure;
    }
}

/// Keeps the outputs at the samples of one segment.
struct Tracker<'a, P> {
    quantities: Vec<Quantity>,
    times: &'a [f64],
    next: usize,
    net: Net<P>,
    rows: Vec<P>,
}

impl<P: Lane> Tracker<'_, P> {
    /// The remaining samples are due at the end.
    fn finish(&mut self, session: &Session<P>) {
        let y = session.settled();
        while self.next < self.times.len() {
            self.sample(0, self.times[self.next], &y, session.circuit());
        }
    }
}

impl<P: Lane> Output<P, Circuit<P>> for Tracker<'_, P> {
    fn due(&self, _lane: usize) -> f64 {
        self.times.get(self.next).copied().unwrap_or(f64::INFINITY)
    }

    fn sample(&mut self, _lane: usize, t: f64, y: &[P], circuit: &Circuit<P>) {
        let first = self.rows.len();
        self.rows.resize(first + self.quantities.len(), P::zero());
        values_of(&self.quantities, circuit, P::c(t), y, &mut self.net, &mut self.rows[first..]);
        self.next += 1;
    }
}
