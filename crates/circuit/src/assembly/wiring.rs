//! Turns components and their joints into equations.

use super::joints::{Joints, Wiring, one_of};
use crate::assembly::variables::{Assembly, Settable, Target, Variables};
use crate::circuit::Circuit;
use crate::component::{
    Acts, Build, FrictionTable, Instance, Node, Piston, Quantity, Starting, Terminals, compose,
};
use crate::ground::{Error, refuse};
use crate::part::InputId;
use math::{Deps, Lane, Over};
use ode::Structure;
use physics::{Gas, in_usual_unit};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Refuses a circuit with too many states. The message names the components with most of the states.
fn check_size(counts: &[(&str, usize)]) -> Result<(), Error> {
    let states: usize = counts.iter().map(|(_, count)| count).sum();
    if states <= Structure::MOST_STATES {
        return Ok(());
    }
    let mut by_name = BTreeMap::new();
    for (name, count) in counts {
        *by_name.entry(*name).or_insert(0) += count;
    }
    let mut most: Vec<_> = by_name.into_iter().collect();
    most.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let most = one_of(
        most.iter().filter(|own| own.1 * 10 > states).map(|(name, count)| format!("{name} ({count})")),
    );
    refuse!(
        "the circuit has {states} states, most of them in {most}: it must have at most {}. Give long tubes fewer cells or a smaller bandwidth",
        Structure::MOST_STATES
    )
}

/// Refuses contacts outside the stroke of their piston.
fn check_met<P: Lane>(build: &Build<P>) -> Result<(), Error> {
    for (name, position, axis) in &build.met {
        // Returns the piston on the axis, or on a coupled axis.
        let near = build.coupled.iter().filter(|(axes, _)| axes.contains(axis));
        let near = near.flat_map(|(axes, play)| axes.map(|other| (other, play.get(0))));
        for (of, play) in near.chain([(*axis, 0.0)]) {
            let Some(piston) = build.pistons.iter().find(|piston| piston.axis == of) else { continue };
            let (x, stroke) = (position.get(0), piston.stroke.get(0));
            if x < -0.5 * play || x > stroke + 0.5 * play {
                let [x, stroke] = [x, stroke].map(|position| in_usual_unit(position, "m"));
                return refuse!(
                    "{name}.position = {x} is outside the stroke of {}, 0 to {stroke}: nothing runs into it there",
                    piston.name
                );
            }
        }
    }
    Ok(())
}

/// Joins components, from numbers with or without derivatives. If an existing circuit has the same parts, its analysis
/// and names are reused.
pub(super) fn wire<P: Lane>(
    gas: &Gas<P>,
    ambient: [P; 2],
    (each, joints): (&[Instance<P>], &Joints),
    ledger: bool,
    like: Option<&Circuit<f64>>,
) -> Result<Build<P>, Error>
where
    Deps: Over<P>,
{
    if let Some(other) = like {
        let build = join(gas, ambient, (each, joints), true)?;
        if let Some(circuit) = build.circuit.build_like(other) {
            return Ok(Build { circuit, ..build }.with_passages());
        }
    }
    if !P::GENERAL {
        return refuse("these numbers belong to a circuit of another structure");
    }
    let build = join(gas, ambient, (each, joints), false)?;
    check_size(&build.circuit.count_states())?;
    let circuit = build.circuit.build(ledger);
    Ok(Build { circuit, ..build }.with_passages())
}

fn join<P: Lane>(
    gas: &Gas<P>,
    ambient: [P; 2],
    (each, joints): (&[Instance<P>], &Joints),
    is_like: bool,
) -> Result<Build<P>, Error>
where
    Deps: Over<P>,
{
    let build = Build::new(gas, ambient, is_like);
    let nodes = each.iter().map(|own| vec![Node::Shut; own.table.ports.len()]).collect();
    let chains = joints.chains(each);
    let has_heat_law = each.iter().any(Instance::has_heat_law);
    let mut wiring = Wiring { each, build, nodes, around: None, chains, has_heat_law };
    for joint in &joints.each {
        let is_merged = |port| wiring.chains.iter().any(|chain| chain.is_inside(port));
        if !joint.ports.first().copied().is_some_and(is_merged) {
            wiring.join(joint)?;
        }
    }
    let Wiring { mut build, nodes, chains, .. } = wiring;
    // The ends of a cylinder depend on the components joined to it, and a platform on its couplings.
    let mut order: Vec<usize> = (0..each.len()).collect();
    let guides = |i: usize| each[i].table.key.starts_with("platform/");
    order.sort_by_key(|&i| (each[i].table.friction != FrictionTable::No, guides(i)));
    for i in order {
        match chains.iter().find(|chain| chain.has(i)) {
            None => compose(&each[i], &Terminals(&nodes[i]), &mut build),
            Some(chain) if chain.first() == i => {
                let ends = chain.ends().map(|(own, port)| nodes[own][port]);
                chain.compose(each, ends, &mut build)?;
            }
            Some(_) => {}
        }
        build.circuit.shape_by(i);
        if !is_like {
            build.circuit.own(&each[i].name);
        }
    }
    build.size_walls();
    check_met(&build)?;
    Ok(build)
}

impl<P: Lane> Build<P> {
    /// Opens the restrictions that are always open.
    fn with_passages(mut self) -> Self {
        for id in &self.open {
            self.circuit.set_input(*id, 0, P::one());
        }
        self
    }

    /// Returns the circuit under the names of a circuit of the same parts, if their analysis was reused.
    pub(super) fn named_like(self, other: &Assembly) -> Assembly<P> {
        if !self.is_like {
            let own = self.named().0;
            return match &other.variables.names {
                Some(names) => own.called(names),
                None => own,
            };
        }
        let each = self.inputs.iter().filter_map(|(_, _, acts)| match acts {
            Acts::Timed(timing, _) => Some(*timing),
            _ => None,
        });
        let timings = each.collect();
        Assembly { circuit: Arc::new(self.circuit), variables: other.variables.clone(), timings }
    }

    /// Returns the circuit under the names of its components.
    pub(super) fn named(self) -> (Assembly<P>, Vec<Piston<P>>) {
        let Build { circuit, pistons, inputs, mut columns, mut starts, .. } = self;
        let mut timings = Vec::new();
        let settable = |(name, meaning, acts): (String, &'static str, Acts)| {
            let of = |id: InputId| Settable::of(&circuit, id, &name, meaning);
            match acts {
                Acts::On(id) => of(id),
                Acts::Command(edges) => {
                    let (bounds, target) = (physics::within(-1.0, 1.0), Target::Edges(edges));
                    Settable { name, unit: "1", bounds, meaning: "valve command", target }
                }
                Acts::Force(axis) => of(circuit.external_force(axis)),
                Acts::Pressure(node) => of(circuit.boundary(node)[0]),
                Acts::Temperature(node) => of(circuit.boundary(node)[1]),
                Acts::Timed(timing, bounds) => {
                    timings.push(timing);
                    let target = Target::Timed(timings.len() - 1);
                    Settable { name, unit: "1", bounds, meaning, target }
                }
            }
        };
        let inputs = inputs.into_iter().map(settable).collect();
        // Adds a column for quantities that no component reports: joints between two components.
        for (starting, names) in &starts {
            if let Starting::Gas(node) = *starting
                && !columns.iter().any(|(name, _)| *name == names[0])
            {
                let quantities = [Quantity::Pressure(node), Quantity::Temperature(node)];
                columns.extend(names.iter().cloned().zip(quantities));
            }
        }
        starts.retain(|(_, names)| !names.is_empty());
        let mut variables = Variables { inputs, starts, ..Variables::default() };
        variables.read(columns);
        let (circuit, variables) = (Arc::new(circuit), Arc::new(variables));
        (Assembly { circuit, variables, timings: timings.into() }, pistons)
    }
}
