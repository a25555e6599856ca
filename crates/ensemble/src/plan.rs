//! What members run, as asked and checked.

use crate::reduction::{Reduction, Statistic};
use circuit::{
    Assembly, Error, Members, Names, Network, budget, refuse, sample_times,
    specification::{self, FromJson},
};
use math::has_eight;
use ode::Options;
use std::borrow::Cow;
use std::sync::Arc;

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
        refuse!(
            "{what} has {n} numbers: it must have {} for all members, or {} for each of the {members}",
            self.width,
            self.width
        )
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
pub struct EnsembleRequest<'a> {
    /// Number of members.
    pub members: usize,
    /// Numbers in which the members differ, one row for each member.
    pub values: &'a [f64],
    /// Commands of the inputs.
    pub plans: Vec<Plan<'a>>,
    /// Duration of the runs, s: one number for all, or one for each.
    pub duration: Column<'a>,
    /// Start values in the order of [`given_names`](Assembly::given_names): one row for all, or one for each.
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

/// Members of one description.
#[derive(Clone, Debug)]
pub struct Ensemble {
    /// The circuit that they share, and the numbers in which they differ.
    pub members: Members,
}

fn read<T: FromJson>(json: &str) -> Result<T, Error> {
    T::from_json(json)
        .map_err(|error| Error::Specification(format!("the description does not fit the core: {error}")))
}

impl Ensemble {
    /// Creates an ensemble of a circuit, from its description (JSON), under short names. Numbers that differ have names
    /// such as "left.bore".
    pub fn called(json: &str, names: &[String], short: Arc<Names>) -> Result<Self, Error> {
        let spec: specification::Circuit = read(json)?;
        Ok(Ensemble { members: Network::called(&spec, false, short)?.members(json, names)?.general()? })
    }
}

/// Checked request.
pub(crate) struct Planned<'a> {
    pub ensemble: &'a Ensemble,
    pub asked: &'a EnsembleRequest<'a>,
    /// Index of the input of each plan.
    pub inputs: Vec<usize>,
    pub options: Options,
    pub kernel: Kernel,
}

impl<'a> Planned<'a> {
    pub fn of(ensemble: &'a Ensemble, asked: &'a EnsembleRequest<'a>) -> Result<Self, Error> {
        let (template, k) = (&ensemble.members.template, ensemble.members.names.len());
        if asked.values.len() != asked.members * k {
            return refuse!(
                "values has {} numbers: it must have a row of {k} for each of the {} members",
                asked.values.len(),
                asked.members
            );
        }
        for (member, row) in asked.values.chunks_exact(k.max(1)).enumerate() {
            for (place, &value) in row.iter().enumerate() {
                ensemble
                    .members
                    .check(place, value)
                    .map_err(|error| Error::Specification(format!("member {member}: {error}")))?;
            }
        }
        let names = template.given_names();
        asked.initial.check("initial", asked.members)?;
        if asked.initial.width != names.len() {
            return refuse!("initial must have a number for each of {}", names.join(", "));
        }
        check_start(template, &asked.initial)?;
        asked.duration.check("duration", asked.members)?;
        if let Some(duration) = asked.duration.values.iter().find(|d| !d.is_finite() || **d <= 0.0) {
            return refuse!("duration = {duration} s must be above zero");
        }
        let mut rates = asked.outputs.iter().filter_map(|output| match output.what {
            Statistic::Samples { rate } => Some(rate),
            _ => None,
        });
        if let Some(rate) = rates.next() {
            if !(rate.is_finite() && rate > 0.0) || rates.any(|other| other != rate) {
                return refuse!("all samples must have one rate, above zero");
            }
            if asked.duration.values.len() > 1 {
                return refuse!("samples need one duration for all members");
            }
        }
        let inputs = asked.plans.iter().map(|plan| check_plan(template, plan, asked.members));
        let options = Options { rtol: asked.rtol, ..Options::default() };
        let kernel = asked.kernel.unwrap_or_else(Kernel::best);
        if !kernel.is_there() {
            return refuse!("the kernel of eight members needs a processor with AVX-512: leave it out");
        }
        Ok(Planned { inputs: inputs.collect::<Result<_, _>>()?, ensemble, asked, options, kernel })
    }

    /// Limit on the step attempts of a member, independent of its neighbours.
    pub fn budget(&self, member: usize) -> u64 {
        let commands = self.asked.plans.iter().map(|plan| plan.times.len()).sum();
        let states = self.ensemble.members.template.circuit.n_states();
        let duration = self.asked.duration.row(member)[0];
        self.asked.budget.unwrap_or_else(|| budget(duration, commands, states))
    }

    /// Returns the numbers that an output has for each member.
    pub fn width(&self, output: &Reduction) -> usize {
        match output.what {
            Statistic::Samples { rate } => sample_times(self.asked.duration.row(0)[0], rate).len(),
            _ => 1,
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

fn check_start(template: &Assembly, initial: &Column) -> Result<(), Error> {
    for (member, row) in initial.values.chunks_exact(initial.width.max(1)).enumerate() {
        if let Some((name, value, rule)) = template.impossible_start(row, false) {
            return refuse!("member {member}: the start value {name} = {value} must be {rule}");
        }
    }
    Ok(())
}

/// Checks a plan and returns the index of its input.
fn check_plan(template: &Assembly, plan: &Plan, members: usize) -> Result<usize, Error> {
    let input = template.variables.input(&plan.input)?;
    let increasing = plan.times.windows(2).all(|pair| pair[0] < pair[1]);
    if plan.times.first() != Some(&0.0) || !increasing || plan.values.width != plan.times.len() {
        return refuse!(
            "the times of {} must increase from 0, and there must be one value for each",
            plan.input
        );
    }
    plan.values.check(&plan.input, members)?;
    let bounds = template.variables.inputs[input].bounds;
    if let Some(value) =
        plan.values.values.iter().find(|value| !value.is_finite() || !bounds.contain(**value))
    {
        return refuse!("{} = {value} is out of bounds: it must be {bounds}", plan.input);
    }
    Ok(input)
}
