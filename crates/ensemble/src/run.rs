//! Members in chunks, chunks on threads.

use crate::lanes;
use crate::reduction::{Follower, Reduction, What};
use circuit::{
    Assembly, Circuit, Drive, Error, Look, Members, Names, Network, Session, Starting, budget, run_jobs,
    sample_times,
    specification::{self, FromJson},
};
use math::{Lane, Task, has_eight, with_eight};
use ode::{Options, System};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest number of members that a thread takes from the queue in one step.
const MOST: usize = 256;

/// Numbers of members: one row for all, or one for each.
#[derive(Clone, Debug)]
pub struct Column<'a> {
    /// Values, row by row.
    pub values: Cow<'a, [f64]>,
    /// Numbers in a row.
    pub width: usize,
}

impl<'a> Column<'a> {
    /// Creates rows of this width.
    pub fn new(values: impl Into<Cow<'a, [f64]>>, width: usize) -> Self {
        Column { values: values.into(), width }
    }

    /// Returns the row of a member.
    pub fn row(&self, member: usize) -> &[f64] {
        let all = &self.values[..];
        if all.len() == self.width { all } else { &all[member * self.width..][..self.width] }
    }

    fn check(&self, what: &str, members: usize) -> Result<(), Error> {
        let n = self.values.len();
        if n == self.width || n == members * self.width {
            return Ok(());
        }
        refuse(format!(
            "{what} has {n} numbers: it must have {} for all members, or {} for each of the {members}",
            self.width, self.width
        ))
    }
}

/// An input with its times, s, and its values from each time on. The values are one row for all members, or
/// one row for each.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// Name of the input.
    pub input: String,
    /// Times, s, increasing.
    pub times: Vec<f64>,
    /// Values, one row with as many numbers as times.
    pub values: Column<'a>,
}

/// Request for the run of an ensemble.
#[derive(Clone, Debug)]
pub struct Asked<'a> {
    /// Number of members.
    pub members: usize,
    /// Numbers in which the members differ, one row for each member.
    pub values: &'a [f64],
    /// Commands of the inputs.
    pub plans: Vec<Plan<'a>>,
    /// Duration of the runs, s: one number for all, or one for each.
    pub duration: Column<'a>,
    /// Start values in the order of [`Ensemble::start_names`]: one row for all, or one for each.
    pub initial: Column<'a>,
    /// Rest time of all contacts before the start, s.
    pub contact_age: f64,
    /// Reductions of each member.
    pub outputs: Vec<Reduction>,
    /// Relative tolerance.
    pub rtol: f64,
    /// Limit on the step attempts of each member. `None` uses the default.
    pub budget: Option<u64>,
    /// Largest number of threads.
    pub threads: usize,
    /// Kernel that runs the members, with the same bits for each choice. `None` uses the fastest.
    pub kernel: Option<Kernel>,
}

/// Kernel that runs members: one by one, or several side by side in the registers of a processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// One after the other.
    Scalar,
    /// Four numbers of AVX2: the register width of every supported processor.
    Base,
    /// Eight numbers in the registers of AVX-512. Circuits with events, and circuits that need nodes for
    /// their evaluation, still run four at a time.
    Eight,
}

impl Kernel {
    /// Returns the fastest kernel of this processor.
    pub fn best() -> Self {
        if has_eight() { Kernel::Eight } else { Kernel::Base }
    }

    /// Returns whether this processor supports the kernel.
    pub fn is_there(self) -> bool {
        self != Kernel::Eight || has_eight()
    }
}

/// Number of values in a register of every processor that this build supports.
#[cfg(target_feature = "avx2")]
type Base = math::V4;
#[cfg(not(target_feature = "avx2"))]
type Base = math::Lanes<2>;

/// Outcome of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// The run reached its end.
    Done = 0,
    /// The run failed, and its numbers are not finite.
    Stopped = 1,
    /// The numbers of the member are inconsistent. It did not run.
    Refused = 2,
}

/// Results of an ensemble.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// For each output the numbers of all members, one member after the other.
    pub columns: Vec<Vec<f64>>,
    /// Outcome of each member: see [`Status`].
    pub status: Vec<u8>,
    /// Reasons why members have no numbers, by member.
    pub reasons: Vec<(usize, String)>,
    /// Step attempts of all members together.
    pub attempts: u64,
}

/// Members of one description.
#[derive(Clone, Debug)]
pub struct Ensemble {
    members: Members,
}

fn refuse<T>(message: impl Into<String>) -> Result<T, Error> {
    Err(Error::Specification(message.into()))
}

fn read<T: FromJson>(json: &str) -> Result<T, Error> {
    T::from_json(json)
        .map_err(|error| Error::Specification(format!("the description does not fit the core: {error}")))
}

impl Ensemble {
    /// Creates an ensemble of a drive, from its description (JSON). `paths` are the places in the description
    /// of the numbers that differ.
    pub fn of_drive(json: &str, names: &[String]) -> Result<Self, Error> {
        let spec: specification::Drive = read(json)?;
        Ok(Ensemble { members: Drive::assemble(&spec, false)?.members(json, names)? })
    }

    /// Creates an ensemble of a circuit in the same way. Names have the form "left.bore".
    pub fn of_circuit(json: &str, names: &[String]) -> Result<Self, Error> {
        Ensemble::called(json, names, Arc::default())
    }

    /// Returns the same under short names.
    pub fn called(json: &str, names: &[String], short: Arc<Names>) -> Result<Self, Error> {
        let spec: specification::Circuit = read(json)?;
        Ok(Ensemble { members: Network::called(&spec, false, short)?.members(json, names)?.general()? })
    }

    /// Circuit that all members share.
    pub fn template(&self) -> &Assembly {
        self.members.template()
    }

    /// Names of the numbers in which members differ.
    pub fn names(&self) -> &[String] {
        self.members.names()
    }

    /// Returns the names of the start values.
    pub fn start_names(&self) -> Vec<&str> {
        self.template().given_names()
    }

    /// Runs all members. `interrupted` receives the number of finished members from time to time, and returns
    /// whether to stop.
    pub fn run(&self, asked: &Asked, interrupted: &mut dyn FnMut(f64) -> bool) -> Result<Outcome, Error> {
        let plan = Planned::of(self, asked)?;
        let widths: Vec<usize> = asked.outputs.iter().map(|output| plan.width(output)).collect();
        let total: usize = widths.iter().sum();
        let mut outcome = Outcome {
            columns: widths.iter().map(|width| vec![f64::NAN; width * asked.members]).collect(),
            status: vec![Status::Done as u8; asked.members],
            reasons: Vec::new(),
            attempts: 0,
        };
        let whole = plan.run((total, &widths), &mut outcome, interrupted)?;
        if !whole {
            return Err(Error::Interrupted { t: 0.0 });
        }
        outcome.reasons.sort_by_key(|(member, _)| *member);
        Ok(outcome)
    }
}

/// A run of the members of a plan into an outcome. Counts are per member and per output.
struct Run<'r, 'a> {
    plan: &'r Planned<'a>,
    total: usize,
    widths: &'r [usize],
    outcome: &'r mut Outcome,
    interrupted: &'r mut dyn FnMut(f64) -> bool,
}

impl Task for Run<'_, '_> {
    type Out = Result<bool, Error>;

    fn run<R: Lane<Plain = R>>(self) -> Self::Out {
        let Run { plan, total, widths, outcome, interrupted } = self;
        let asked = plan.asked;
        let done = std::cell::Cell::new(0);
        // A small number of members is divided among all threads.
        let chunk = asked.members.div_ceil(asked.threads.max(1)).clamp(1, MOST);
        let take = |at: usize, came: Vec<Came>| {
            let first = at * chunk;
            for (i, Came { row, failure, attempts }) in came.into_iter().enumerate() {
                let member = first + i;
                outcome.attempts += attempts;
                done.set(done.get() + 1);
                if let Some((status, reason)) = failure {
                    outcome.status[member] = status as u8;
                    outcome.reasons.push((member, reason));
                    continue;
                }
                let mut rest = &row[..];
                for (column, &width) in outcome.columns.iter_mut().zip(widths) {
                    let (own, others) = rest.split_at(width);
                    column[member * width..][..width].copy_from_slice(own);
                    rest = others;
                }
            }
            Ok(())
        };
        run_jobs(
            (asked.threads, asked.members.div_ceil(chunk)),
            || plan.worker::<R>(total),
            |worker, at, stop| worker.run_all(at * chunk..asked.members.min((at + 1) * chunk), stop),
            take,
            &mut || interrupted(done.get() as f64),
        )
    }
}

/// Result of a member.
pub(crate) struct Came {
    pub row: Vec<f64>,
    pub failure: Option<(Status, String)>,
    pub attempts: u64,
}

impl Came {
    pub fn refused(error: &Error) -> Self {
        Came { row: Vec::new(), failure: Some((Status::Refused, error.to_string())), attempts: 0 }
    }
}

/// Checked request.
pub(crate) struct Planned<'a> {
    pub ensemble: &'a Ensemble,
    pub asked: &'a Asked<'a>,
    /// Index of the input of each plan.
    pub inputs: Vec<usize>,
    pub options: Options,
    kernel: Kernel,
}

impl<'a> Planned<'a> {
    fn of(ensemble: &'a Ensemble, asked: &'a Asked<'a>) -> Result<Self, Error> {
        let (template, k) = (ensemble.template(), ensemble.names().len());
        if asked.values.len() != asked.members * k {
            return refuse(format!(
                "values has {} numbers: it must have a row of {k} for each of the {} members",
                asked.values.len(),
                asked.members
            ));
        }
        for (member, row) in asked.values.chunks_exact(k.max(1)).enumerate() {
            for (place, &value) in row.iter().enumerate() {
                ensemble.members.check(place, value).map_err(|error| in_row(member, &error))?;
            }
        }
        let names = ensemble.start_names();
        asked.initial.check("initial", asked.members)?;
        if asked.initial.width != names.len() {
            return refuse(format!("initial must have a number for each of {}", names.join(", ")));
        }
        check_start(template, &asked.initial)?;
        asked.duration.check("duration", asked.members)?;
        if let Some(duration) = asked.duration.values.iter().find(|d| !d.is_finite() || **d <= 0.0) {
            return refuse(format!("duration = {duration} s must be above zero"));
        }
        let mut rates = asked.outputs.iter().filter_map(|output| match output.what {
            What::Samples { rate } => Some(rate),
            _ => None,
        });
        if let Some(rate) = rates.next() {
            if !(rate.is_finite() && rate > 0.0) || rates.any(|other| other != rate) {
                return refuse("all samples must have one rate, above zero");
            }
            if asked.duration.values.len() > 1 {
                return refuse("samples need one duration for all members");
            }
        }
        let inputs = asked.plans.iter().map(|plan| check_plan(template, plan, asked.members));
        let options = Options { rtol: asked.rtol, ..Options::default() };
        let kernel = asked.kernel.unwrap_or_else(Kernel::best);
        if !kernel.is_there() {
            return refuse("the kernel of eight members needs a processor with AVX-512: leave it out");
        }
        Ok(Planned { inputs: inputs.collect::<Result<_, _>>()?, ensemble, asked, options, kernel })
    }

    /// Limit on the step attempts of a member, independent of its neighbours.
    pub fn budget(&self, member: usize) -> u64 {
        let commands = self.asked.plans.iter().map(|plan| plan.times.len()).sum();
        let states = self.ensemble.template().circuit.n_states();
        let duration = self.asked.duration.row(member)[0];
        self.asked.budget.unwrap_or_else(|| budget(duration, commands, states))
    }

    /// Returns the numbers that an output has for each member.
    fn width(&self, output: &Reduction) -> usize {
        match output.what {
            What::Samples { rate } => sample_times(self.asked.duration.row(0)[0], rate).len(),
            _ => 1,
        }
    }

    /// Runs all members and returns whether the run reached its end.
    fn run(
        &self,
        (total, widths): (usize, &[usize]),
        outcome: &mut Outcome,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<bool, Error> {
        let circuit = &self.ensemble.template().circuit;
        let run = Run { plan: self, total, widths, outcome, interrupted };
        match self.kernel {
            Kernel::Eight if circuit.is_fused() && circuit.n_events() == 0 => with_eight(run),
            _ => run.run::<Base>(),
        }
    }

    fn worker<R: Lane>(&self, width: usize) -> Worker<'_, R> {
        let (template, duration) = (self.ensemble.template(), self.asked.duration.row(0)[0]);
        // Timings that start with a command need a separate schedule for each member.
        let beside = self.kernel != Kernel::Scalar && template.timings.is_empty();
        Worker {
            planned: self,
            members: self.ensemble.members.clone(),
            follower: Follower::new(template, &self.asked.outputs, duration),
            side_by_side: beside.then(|| Follower::new(template, &self.asked.outputs, duration)),
            width,
        }
    }

    /// Returns the commands of a member in the order of their times.
    pub fn due(&self, member: usize) -> Vec<(f64, usize, f64)> {
        let duration = self.asked.duration.row(member)[0];
        let each = self.inputs.iter().zip(&self.asked.plans).flat_map(|(&input, plan)| {
            let entries = plan.times.iter().zip(plan.values.row(member));
            entries.map(move |(time, value)| (*time, input, *value))
        });
        let mut due: Vec<_> = each.filter(|(time, ..)| *time < duration).collect();
        due.sort_by(|one, other| one.0.total_cmp(&other.0));
        due
    }
}

fn in_row(member: usize, error: &Error) -> Error {
    Error::Specification(format!("member {member}: {error}"))
}

fn check_start(template: &Assembly, initial: &Column) -> Result<(), Error> {
    let starts = template.variables.starts.iter();
    let rules = starts.flat_map(|(starting, names)| {
        let rule = match starting {
            Starting::Gas(_) => "above zero",
            Starting::Kept(_) => "0 or 1",
            _ => "finite",
        };
        let given = if matches!(starting, Starting::Inner(_)) { 0 } else { names.len() };
        names.iter().take(given).map(move |name| (name, rule))
    });
    let rules: Vec<(&String, &str)> = rules.collect();
    for (member, row) in initial.values.chunks_exact(initial.width.max(1)).enumerate() {
        for ((name, rule), &value) in rules.iter().zip(row) {
            let fits = match *rule {
                "above zero" => value > 0.0,
                "0 or 1" => value == 0.0 || value == 1.0,
                _ => true,
            };
            if !(value.is_finite() && fits) {
                return refuse(format!("member {member}: the start {name} = {value} must be {rule}"));
            }
        }
    }
    Ok(())
}

/// Checks a plan and returns the index of its input.
fn check_plan(template: &Assembly, plan: &Plan, members: usize) -> Result<usize, Error> {
    let inputs = &template.variables.inputs;
    let Some(input) = inputs.iter().position(|own| own.name == plan.input) else {
        let names: Vec<&str> = inputs.iter().map(|own| &*own.name).collect();
        return refuse(format!("there is no input \"{}\"; there are {}", plan.input, names.join(", ")));
    };
    let increasing = plan.times.windows(2).all(|pair| pair[0] < pair[1]);
    if plan.times.first() != Some(&0.0) || !increasing || plan.values.width != plan.times.len() {
        return refuse(format!(
            "the times of {} must increase from 0, and there must be one value for each",
            plan.input
        ));
    }
    plan.values.check(&plan.input, members)?;
    let bounds = inputs[input].bounds;
    if let Some(value) =
        plan.values.values.iter().find(|value| !value.is_finite() || !bounds.contain(**value))
    {
        return refuse(format!("{} = {value} is out of bounds: it must be {bounds}", plan.input));
    }
    Ok(input)
}

/// A thread's worker for the members of a chunk.
pub(crate) struct Worker<'a, R: Lane> {
    pub planned: &'a Planned<'a>,
    members: Members,
    follower: Follower<'a, f64>,
    /// Follower of several members side by side, if the circuit allows it.
    side_by_side: Option<Follower<'a, R>>,
    pub width: usize,
}

impl<R: Lane> Worker<'_, R> {
    fn run_all(&mut self, members: Range<usize>, stop: &AtomicBool) -> Vec<Came> {
        if let Some(mut follower) = self.side_by_side.take() {
            let came = lanes::run(self, &mut follower, members, stop);
            self.side_by_side = Some(follower);
            return came;
        }
        members.map_while(|member| (!stop.load(Ordering::Relaxed)).then(|| self.run(member, stop))).collect()
    }

    fn run(&mut self, member: usize, stop: &AtomicBool) -> Came {
        match self.member(member) {
            Ok(assembly) => self.run_alone(&assembly, member, stop),
            Err(error) => Came::refused(&error),
        }
    }

    /// Returns the assembly of a member with its numbers.
    pub fn member(&mut self, member: usize) -> Result<Assembly, Error> {
        let k = self.planned.ensemble.names().len();
        self.members.member(&self.planned.asked.values[member * k..][..k])
    }

    /// Returns the start of a member with these equations.
    pub fn start(
        &self,
        circuit: Circuit<f64>,
        assembly: &Assembly,
        member: usize,
    ) -> (Circuit<f64>, Vec<f64>) {
        let Planned { asked, inputs, .. } = self.planned;
        let plans = inputs.iter().zip(&asked.plans);
        let first: Vec<_> = plans.map(|(&input, plan)| (input, plan.values.row(member)[0])).collect();
        assembly.stand_in(circuit, &first, asked.initial.row(member), asked.contact_age)
    }

    /// Runs a member without neighbours.
    pub fn run_alone(&mut self, assembly: &Assembly, member: usize, stop: &AtomicBool) -> Came {
        self.follower.init(0);
        let duration = self.planned.asked.duration.row(member)[0];
        let start = self.start(Circuit::clone(&assembly.circuit), assembly, member);
        let options = Options { max_attempts: self.planned.budget(member), ..self.planned.options };
        let mut session = Session::new(assembly, 0.0, start, options);
        for (time, input, value) in self.planned.due(member) {
            session.plan(input, [(time, value)]);
        }
        session.settle_schedule();
        let mut stopped = |_| stop.load(Ordering::Relaxed);
        let outcome = session.advance(duration, &mut self.follower, &mut Look::new(&mut stopped));
        let attempts = session.statistics().factorisations;
        let mut row = vec![f64::NAN; self.width];
        let failure = match outcome {
            Ok(()) => {
                self.follower.finish(0, (duration, &session.settled()), session.circuit(), &mut row);
                None
            }
            Err(error) => Some((Status::Stopped, error.to_string())),
        };
        Came { row, failure, attempts }
    }
}
