//! A circuit with names of its inputs, outputs and start.

use super::names::{EDGES, Names};
use crate::circuit::Circuit;
use crate::component::{Quantity, Starting, Timing};
use crate::ground::{Error, Given, Input, Net, refuse};
use crate::part::{InputId, Platform};
use math::{Lane, Real};
use physics::Bounds;
use std::sync::Arc;

/// Target of a named input.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// An input of a part.
    Input(InputId),
    /// The edges of a proportional 5/3 valve: supply to a, a to exhaust, supply to b, b to exhaust.
    Edges([InputId; 4]),
    /// Delayed effects of a command: index of the timing.
    Timed(usize),
}

/// A named input.
#[derive(Clone, Debug)]
pub struct Settable {
    /// Name for users.
    pub name: String,
    /// Its unit in SI; `1` for a pure number.
    pub unit: &'static str,
    /// Allowed values, in the unit.
    pub bounds: Bounds,
    /// Its meaning as text.
    pub meaning: &'static str,
    /// Its target.
    pub target: Target,
}

impl Settable {
    /// An input of a part, with its unit and bounds.
    pub fn of<P: Lane>(circuit: &Circuit<P>, id: InputId, name: &str, meaning: &'static str) -> Self {
        let Input { unit, bounds, .. } = *circuit.what_input(id);
        Settable { name: name.into(), unit, bounds, meaning, target: Target::Input(id) }
    }
}

/// The names of a circuit.
#[derive(Clone, Debug, Default)]
pub struct Variables {
    /// Inputs that can be set.
    pub inputs: Vec<Settable>,
    /// Names of the columns of a run.
    pub columns: Vec<String>,
    /// Content of each column.
    pub quantities: Vec<Quantity>,
    /// Groups, each with the names of its numbers.
    pub starts: Vec<(Starting, Vec<String>)>,
    /// Table of names, unless the names are those of the components.
    pub(crate) names: Option<Arc<Names>>,
}

/// Returns the index of a name among those of a kind, `what`.
fn named<'n>(
    what: &str,
    mut names: impl Iterator<Item = &'n str> + Clone,
    name: &str,
) -> Result<usize, Error> {
    let known = names.clone();
    match names.position(|own| own == name) {
        Some(place) => Ok(place),
        None => refuse!("there is no {what} \"{name}\"; there are {}", known.collect::<Vec<_>>().join(", ")),
    }
}

impl Variables {
    /// Returns the index of an input.
    pub fn input(&self, name: &str) -> Result<usize, Error> {
        named("input", self.inputs.iter().map(|input| &*input.name), name)
    }

    /// Returns the index of a column.
    pub fn column(&self, name: &str) -> Result<usize, Error> {
        named("column", self.columns.iter().map(|column| &**column), name)
    }

    /// Adds a column for each of the names.
    pub fn read(&mut self, columns: impl IntoIterator<Item = (impl Into<String>, Quantity)>) {
        for (name, quantity) in columns {
            self.columns.push(name.into());
            self.quantities.push(quantity);
        }
    }
}

/// A circuit and its names.
#[derive(Clone, Debug)]
pub struct Assembly<P = f64> {
    /// The equations.
    pub circuit: Arc<Circuit<P>>,
    /// Inputs, outputs and start.
    pub variables: Arc<Variables>,
    /// Delayed effects of commands.
    pub timings: Arc<[Timing]>,
}

/// Returns the opening of each edge of a proportional 5/3 valve for a command (supply to a, a to exhaust, supply to b,
/// b to exhaust). For u > 0, supply to a and b to exhaust are open by the fraction u. u < 0 is the mirror image.
pub fn valve_openings<R: Real>(u: R) -> [R; 4] {
    let (extend, retract) = (u.max(R::zero()), (-u).max(R::zero()));
    [extend, retract, retract, extend]
}

/// Returns the command that opens the edges in this way, or NaN if no command does.
pub(super) fn command<R: Lane>(circuit: &Circuit<R>, edges: [InputId; 4]) -> R {
    let [a, b, c, d] = edges.map(|edge| circuit.input(edge));
    let is_one = (0..R::L).all(|lane| {
        let [a, b, c, d] = [a, b, c, d].map(|opening| opening.get(lane));
        a == d && b == c && (a == 0.0 || b == 0.0)
    });
    if is_one { a - b } else { R::c(f64::NAN) }
}

impl<P: Lane> Assembly<P> {
    /// Names of the columns.
    pub fn columns(&self) -> &[String] {
        &self.variables.columns
    }

    /// The highest pressure of a reservoir, Pa absolute.
    pub fn highest_pressure(&self) -> f64 {
        let all = self.variables.inputs.iter().filter_map(|input| match input.target {
            Target::Input(id) if input.unit == "Pa" => Some(self.circuit.input(id).get(0)),
            _ => None,
        });
        all.fold(0.0, f64::max)
    }

    /// Returns each platform with its name and the names of its legs: the components that move them, or the ports of
    /// couplings.
    pub fn platforms(&self) -> impl Iterator<Item = (&str, &Platform<P>, Vec<&str>)> {
        let Variables { columns, quantities, starts, .. } = &*self.variables;
        fn owner(name: &str) -> &str {
            name.rsplit_once('.').map_or("", |(owner, _)| owner)
        }
        let leg = |node: &usize| {
            let own = starts.iter().find(|(own, _)| matches!(own, Starting::Axis(axis) if axis.0 == *node));
            own.map_or("", |(_, names)| owner(&names[0]))
        };
        columns.iter().zip(quantities).filter_map(move |(column, quantity)| {
            let Quantity::Pose(part, 0) = *quantity else { return None };
            let platform = self.circuit.platform(part);
            Some((owner(column), platform, platform.nodes.iter().map(leg).collect()))
        })
    }

    /// Returns the names of the start values.
    pub fn start_names(&self) -> Vec<String> {
        self.variables.starts.iter().flat_map(|(_, names)| names.clone()).collect()
    }

    /// Sets an input of one lane. Delayed effects of the command have already ended.
    pub fn set<R: Lane>(&self, circuit: &mut Circuit<R>, input: usize, lane: usize, value: R) {
        match &self.variables.inputs[input].target {
            Target::Input(id) => circuit.set_input(*id, lane, value),
            Target::Edges(edges) => circuit.set_openings(edges, lane, valve_openings(value)),
            Target::Timed(timing) => self.timings[*timing].settled(circuit, lane, value),
        }
    }

    /// Returns the value of an input.
    pub fn get<R: Lane>(&self, circuit: &Circuit<R>, input: usize) -> R {
        match self.variables.inputs[input].target {
            Target::Input(id) => circuit.input(id),
            Target::Edges(edges) => command(circuit, edges),
            Target::Timed(timing) => circuit.input(self.timings[timing].commanded()),
        }
    }

    /// Returns the equations under values of inputs, and their state from the start values.
    pub fn begin(&self, start: &[P], inputs: &[(usize, P)]) -> (Circuit<P>, Vec<P>) {
        let mut circuit = Circuit::clone(&self.circuit);
        for &(input, value) in inputs {
            self.set(&mut circuit, input, 0, value);
        }
        let y = self.start(&mut circuit, start, None);
        (circuit, y)
    }

    /// Returns the state of equations at start values. With an age of the contacts, s, the values have no inner states,
    /// and contacts begin at rest.
    pub(super) fn start(&self, circuit: &mut Circuit<P>, start: &[P], age: Option<P>) -> Vec<P> {
        let (mut gas, mut axes, mut ages) = (Vec::new(), Vec::new(), Vec::new());
        let (mut inner, mut signals, mut rest) = (Vec::new(), Vec::new(), start);
        for (starting, names) in &self.variables.starts {
            let is_absent = age.is_some() && matches!(starting, Starting::Inner(_));
            let (own, others) = rest.split_at(if is_absent { 0 } else { names.len() });
            match *starting {
                Starting::Gas(id) => gas.push((id, own[0], own[1])),
                Starting::Axis(id) => {
                    axes.push((id, own[0], own[1]));
                    ages.extend(age.map(|age| (id, age)));
                }
                Starting::Inner(id) if !is_absent => inner.push((id, own)),
                Starting::Inner(_) => {}
                Starting::Kept(signal) => signals.push((signal, own[0])),
            }
            rest = others;
        }
        circuit.begin(&Given { gas: &gas, axes: &axes, ages: &ages, inner: &inner, signals: &signals })
    }

    /// Returns the start values at state `y`.
    pub fn outside(&self, circuit: &Circuit<P>, y: &[P], net: &mut Net<P>) -> Vec<P> {
        circuit.observe(y, net);
        let each = self.variables.starts.iter().flat_map(|(starting, _)| match *starting {
            Starting::Gas(id) => vec![net[id].p, net[id].t],
            Starting::Axis(id) => vec![net[id].x, net[id].v],
            Starting::Inner(id) => circuit.inner_states(id, y).to_vec(),
            Starting::Kept(signal) => vec![net.signal[signal]],
        });
        each.collect()
    }

    /// Writes one row of the columns.
    pub fn row<R: Lane>(&self, circuit: &Circuit<R>, t: R, y: &[R], net: &mut Net<R>, row: &mut [R]) {
        values_of(&self.variables.quantities, circuit, t, y, net, row);
    }
}

/// Writes the values of quantities at time `t`, s, and state `y`.
pub(super) fn values_of<R: Lane>(
    quantities: &[Quantity],
    circuit: &Circuit<R>,
    t: R,
    y: &[R],
    net: &mut Net<R>,
    row: &mut [R],
) {
    circuit.observe(y, net);
    for (value, quantity) in row.iter_mut().zip(quantities) {
        *value = match *quantity {
            Quantity::Time => t,
            Quantity::Position(id) => net[id].x,
            Quantity::Velocity(id) => net[id].v,
            Quantity::Acceleration(id) => net[id].a,
            Quantity::Friction(id) => net[id].friction,
            Quantity::EndStop(id) => -net[id].end_stop,
            Quantity::Pressure(id) => net[id].p,
            Quantity::Temperature(id) => net[id].t,
            Quantity::MassFlow(id) => net[id].m_dot,
            Quantity::Signal(place) => net.signal[place],
            Quantity::Input(id) => circuit.input(id),
            Quantity::Flow(paths) => {
                paths.into_iter().flatten().fold(R::zero(), |sum, path| sum + circuit.flow(path, net))
            }
            Quantity::OutOf(id) => circuit.flow_out_of(id, net),
            Quantity::Force(part) => circuit.force_of(part, net),
            Quantity::Pose(part, output) => circuit.pose(part, output, y, net),
            Quantity::Command(edges) => command(circuit, edges),
            Quantity::Inner(id, place) => circuit.inner_states(id, y)[place],
        };
    }
}

impl<P: Lane> Assembly<P> {
    /// Returns the same circuit under short names.
    pub(super) fn called(mut self, names: &Arc<Names>) -> Self {
        if let Some(circuit) = Arc::get_mut(&mut self.circuit) {
            circuit.call_states(|name| names.short(name));
        }
        let Variables { inputs, columns, quantities, starts, .. } = &*self.variables;
        let edges = inputs.iter().filter_map(|input| match input.target {
            Target::Edges(edges) => Some((input.name.strip_suffix("command")?, edges)),
            _ => None,
        });
        let edges = edges.flat_map(|(of, edges)| {
            let each = EDGES.iter().zip(edges);
            each.map(move |((name, meaning), id)| (format!("{of}{name}"), id, *meaning))
        });
        let edges = edges.filter(|(name, ..)| names.place(name).is_some());
        let edges = edges.map(|(name, id, meaning)| Settable::of(&self.circuit, id, &name, meaning));
        let mut inputs: Vec<Settable> = inputs.iter().cloned().chain(edges).collect();
        inputs.sort_by_key(|input| names.rank(&input.name));
        inputs.iter_mut().for_each(|input| input.name = names.short(&input.name));
        let mut shown: Vec<_> = columns.iter().zip(quantities).collect();
        shown.retain(|(name, _)| !names.only || names.rank(name) <= names.table.len());
        shown.sort_by_key(|(name, _)| names.rank(name));
        let mut starts = starts.clone();
        starts.sort_by_key(|(_, own)| own.iter().map(|name| names.rank(name)).min());
        for name in starts.iter_mut().flat_map(|(_, own)| own) {
            *name = names.short(name);
        }
        let mut variables = Variables { inputs, starts, names: Some(names.clone()), ..Variables::default() };
        variables.read(shown.into_iter().map(|(name, quantity)| (names.short(name), *quantity)));
        Assembly { variables: Arc::new(variables), ..self }
    }
}
