//! A circuit of components as a user describes it: components by name, and the joints of their ports.

use super::end_stop::{Taken, impact_warning, stop_warning, through_warning};
use super::friction::contact;
use super::friction_law;
use super::session::Session;
use super::variables::{Assembly, Quantity, Settable, Starting, Target, Variables};
use crate::circuit::{AxisId, Circuit, GasId};
use crate::component::{
    Acts, Brings, Build, Chain, Given as Extra, Instance, Node, Piston, PortId, PortKind, Row, Terminals,
    Vessel, bring, check, compose, joint_volume, kinds,
};
use crate::impacts::Impact;
use crate::lifted::Lifted;
use crate::part::{ChamberLaw, Given, InputId};
use crate::run::{Error, Look, Recorder, Run, sample_times, with_unit};
use crate::specification::{self, Junctions};
use math::{Deps, Lane, Over};
use ode::Options;
use physics::mechanics::EndStop;
use physics::{Gas, IdealGas, Virial};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a joint calls the air around.
const AMBIENT: &str = "ambient";

/// Ports that are one point, and whether the air around is joined to them.
#[derive(Clone, Debug, Default)]
pub(super) struct Joint {
    pub ports: Vec<PortId>,
    pub ambient: bool,
}

/// The joints of a circuit, and what becomes of those of two restrictions.
#[derive(Clone, Debug)]
pub(super) struct Joints {
    pub each: Vec<Joint>,
    pub junctions: Junctions,
}

impl From<Vec<Joint>> for Joints {
    fn from(each: Vec<Joint>) -> Self {
        Joints { each, junctions: Junctions::Volume }
    }
}

impl Joints {
    /// Restrictions that are merged.
    fn chains<P: Lane>(&self, each: &[Instance<P>]) -> Vec<Chain> {
        if self.junctions == Junctions::Volume {
            return Vec::new();
        }
        Chain::find(each, self.each.iter().filter(|joint| !joint.ambient).map(|joint| &joint.ports[..]))
    }
}

/// A circuit of components.
#[derive(Clone, Debug)]
pub struct Network {
    assembly: Assembly,
    pistons: Vec<Piston<f64>>,
    warnings: Vec<String>,
    citations: Vec<&'static str>,
    joint_volumes: Vec<(String, f64)>,
    joints: Joints,
    each: Vec<Instance<f64>>,
    is_air: bool,
}

fn refuse<T>(message: impl Into<String>) -> Result<T, Error> {
    Err(Error::Specification(message.into()))
}

fn one_of<T: Into<String>>(names: impl Iterator<Item = T>) -> String {
    names.map(Into::into).collect::<Vec<String>>().join(", ")
}

/// A component with its numbers, checked.
fn instance(spec: &specification::Component) -> Result<Instance<f64>, Error> {
    let name = &spec.name;
    let kinds = kinds();
    let Some(kind) = kinds.iter().position(|kind| kind.key == spec.kind) else {
        let kinds = one_of(kinds.iter().map(|kind| kind.key));
        return refuse(format!("{name}: there is no kind \"{}\" of component; there are {kinds}", spec.kind));
    };
    let extra = Extra::of(kinds[kind], spec)?;
    let table = extra.kind(kinds[kind]);
    let known = |key: &String| table.parameters.iter().any(|parameter| parameter.key == key);
    if let Some(key) = spec.numbers.keys().find(|key| !known(key)) {
        let keys = one_of(table.parameters.iter().map(|parameter| parameter.key));
        return refuse(format!("{name}: a {} has no parameter \"{key}\"; it has {keys}", table.key));
    }
    // A table of its own, such as a cushion, is there where any of its numbers is.
    let left_out = |within: &str| {
        let own = |row: &&Row| row.within == within && spec.numbers.contains_key(row.key);
        !within.is_empty() && !table.parameters.iter().any(|row| own(&row))
    };
    let choice = |choice: &crate::component::Choice| match spec.choices.get(choice.name) {
        None => Ok(0),
        Some(option) => match choice.options.iter().position(|own| own == option) {
            Some(place) => Ok(place),
            None => refuse(format!(
                "{name}.{} = \"{option}\": choose of {}",
                choice.name,
                one_of(choice.options.iter().copied())
            )),
        },
    };
    let choices = table.choices.iter().map(choice).collect::<Result<Vec<_>, _>>()?;
    let spared = |unless: &str| match unless.split_once(" = ") {
        Some((of, option)) => {
            let mut each = table.choices.iter().zip(&choices);
            each.any(|(choice, place)| choice.name == of && choice.options[*place] == option)
        }
        None => {
            let is_given = spec.points.is_some() && table.extra.key() == Some(unless);
            is_given || spec.numbers.contains_key(unless)
        }
    };
    let number = |parameter: &Row| {
        if left_out(parameter.within) {
            return Ok(None);
        }
        let value = spec.numbers.get(parameter.key).copied().or(parameter.default);
        match value {
            Some(value) if !value.is_finite() || !parameter.bounds.contain(value) => refuse(format!(
                "{name}.{} = {} is out of bounds: it must be {}",
                parameter.key,
                with_unit(value, parameter.unit),
                parameter.bounds
            )),
            None if parameter.follows.is_empty() && !spared(parameter.unless) => {
                refuse(format!("{name}.{} is missing", parameter.key))
            }
            value => Ok(value),
        }
    };
    let numbers = table.parameters.iter().map(number).collect::<Result<_, _>>()?;
    if let Some(key) = spec.choices.keys().find(|key| !table.choices.iter().any(|own| own.name == *key)) {
        return refuse(format!("{name}: a {} has no choice \"{key}\"", table.key));
    }
    let friction = match &spec.friction {
        Some(_) if !table.friction => return refuse(format!("{name}: a {} takes no friction", table.key)),
        Some(friction) => Some(contact(&Lifted::plain(friction))?),
        None => None,
    };
    let free = vec![false; table.parameters.len()];
    let name = name.clone();
    let instance = Instance { name, kind, extra, numbers, free, choices, friction };
    check(&instance)?;
    Ok(instance)
}

/// The joints with their ports found; those of ports that nothing is joined to come last.
fn joints(spec: &specification::Circuit, each: &[Instance<f64>]) -> Result<Joints, Error> {
    let find = |name: &str| -> Result<PortId, Error> {
        let component = (0..each.len())
            .find(|&i| name.strip_prefix(&each[i].name).is_some_and(|rest| rest.starts_with('.')));
        let Some(component) = component else {
            return refuse(format!("joint of \"{name}\": there is no such component"));
        };
        let port = &name[each[component].name.len() + 1..];
        let ports = each[component].kind().ports;
        match ports.iter().position(|own| own.name == port) {
            Some(port) => Ok((component, port)),
            None => refuse(format!(
                "joint of \"{name}\": a {} has no port \"{port}\"; it has {}",
                each[component].kind().key,
                one_of(ports.iter().map(|own| own.name))
            )),
        }
    };
    let mut joined = Vec::new();
    let mut joints = Vec::new();
    for names in &spec.joints {
        let mut joint = Joint::default();
        for name in names {
            if name == AMBIENT {
                joint.ambient = true;
                continue;
            }
            let port = find(name)?;
            if joined.contains(&port) {
                return refuse(format!("port {name} stands in two joints, or twice in one"));
            }
            joined.push(port);
            joint.ports.push(port);
        }
        let kind = |&(component, port): &PortId| each[component].kind().ports[port].kind;
        let is_axis = |port: &PortId| kind(port) == PortKind::Axis;
        let axes = joint.ports.iter().filter(|port| is_axis(port)).count();
        if axes > 0 && (joint.ambient || axes < joint.ports.len()) {
            return refuse(format!("the joint of {} joins gas to an axis", names.join(", ")));
        }
        // A joint is called by the first of its ports that gas passes.
        joint.ports.sort_by_key(|port| kind(port) == PortKind::Pilot);
        joints.push(joint);
    }
    for (component, own) in each.iter().enumerate() {
        for (place, port) in own.kind().ports.iter().enumerate() {
            if joined.contains(&(component, place)) {
                continue;
            }
            if !port.exhaust && !port.optional {
                return refuse(format!("port {}.{} leads nowhere", own.name, port.name));
            }
            // A rod that nothing is joined to moves all the same.
            joints.push(Joint { ports: vec![(component, place)], ambient: port.exhaust });
        }
    }
    Ok(Joints { each: joints, junctions: spec.junctions })
}

/// The equations of components and joints, from numbers with or without derivatives.
struct Wiring<'a, P> {
    each: &'a [Instance<P>],
    build: Build<P>,
    /// The node at each port of each component.
    nodes: Vec<Vec<Node>>,
    around: Option<GasId>,
    joint_volumes: Vec<(String, P)>,
    chains: Vec<Chain>,
}

impl<P: Lane> Wiring<'_, P>
where
    Deps: Over<P>,
{
    fn name(&self, (component, port): PortId) -> String {
        if self.build.is_like {
            return String::new();
        }
        let own = &self.each[component];
        format!("{}.{}", own.name, own.kind().ports[port].name)
    }

    fn own(&mut self, name: &str) {
        if !self.build.is_like {
            self.build.circuit.own(name);
        }
    }

    fn ambient(&mut self) -> GasId {
        let [pressure, temperature] = self.build.ambient;
        *self.around.get_or_insert_with(|| self.build.circuit.reservoir(pressure, temperature))
    }

    /// The node of a joint.
    fn join(&mut self, joint: &Joint) -> Result<(), Error> {
        let kind = |&(component, port): &PortId| self.each[component].kind().ports[port].kind;
        let node = match joint.ports.first().map(kind) {
            None => return Ok(()),
            Some(PortKind::Pilot) if !joint.ambient => {
                let names: Vec<String> = joint.ports.iter().map(|&port| self.name(port)).collect();
                return refuse(format!("no gas reaches the pilot port {}", names.join(", ")));
            }
            Some(PortKind::Gas | PortKind::Pilot) => Node::Gas(self.gas(joint)?),
            Some(PortKind::Axis) => Node::Axis(self.axis(joint)?),
        };
        for &(component, port) in &joint.ports {
            self.nodes[component][port] = node;
        }
        Ok(())
    }

    fn gas(&mut self, joint: &Joint) -> Result<GasId, Error> {
        let (mut held, mut volume, mut own_name, mut ports) = (Vec::new(), None, None, 0.0);
        let mut room = None::<P>;
        if joint.ambient {
            held.push((AMBIENT.to_string(), None));
        }
        for &(component, port) in &joint.ports {
            let name = self.name((component, port));
            ports += self.each[component].kind().ports[port].volume;
            match bring(&self.each[component], port, self.build.ambient[1]) {
                Brings::Reservoir { pressure, temperature } => {
                    held.push((name, Some([pressure, temperature])))
                }
                Brings::Volume(vessel) => {
                    let owner = &self.each[component];
                    let is_alone = owner.kind().ports.len() == 1;
                    if let Some(other) = own_name.replace(if is_alone { owner.name.clone() } else { name }) {
                        return refuse(format!(
                            "{other} and {} are one joint and have a volume each: put a fitting between them",
                            own_name.unwrap_or_default()
                        ));
                    }
                    volume = Some(vessel);
                }
                Brings::Room { volume } => room = Some(room.map_or(volume, |room| room + volume)),
                _ => {}
            }
            let chain = self.chains.iter().find(|chain| chain.ends().contains(&(component, port)));
            if let Some(more) = chain.and_then(|chain| chain.room(self.each, self.build.ambient[1])) {
                room = Some(room.map_or(more, |room| room + more));
            }
        }
        match (&held[..], volume) {
            ([(one, _), (other, _), ..], _) => {
                refuse(format!("{one} and {other} hold the same joint: put a fitting between them"))
            }
            ([(one, _)], Some(_)) => refuse(format!(
                "{one} holds the pressure in {}: put a fitting between them",
                own_name.unwrap_or_default()
            )),
            ([(_, None)], None) => Ok(self.ambient()),
            (&[(_, Some([pressure, temperature]))], None) => {
                self.build.supply(pressure, temperature);
                Ok(self.build.circuit.reservoir(pressure, temperature))
            }
            ([], volume) => {
                let mut vessel = volume.unwrap_or_else(|| Vessel {
                    law: ChamberLaw::EnergyBalance,
                    dead_volume: P::c(joint_volume(ports)),
                    wall: P::zero(),
                    heat_transfer: P::zero(),
                    wall_temperature: self.build.ambient[1],
                });
                if let Some(room) = room {
                    vessel.dead_volume += room;
                }
                let dead_volume = vessel.dead_volume;
                let node = self.build.volume(vessel);
                let name = own_name.unwrap_or_else(|| {
                    let name = self.name(joint.ports[0]);
                    self.joint_volumes.push((name.clone(), dead_volume));
                    name
                });
                self.build.gas_starts(node, &name);
                self.own(&name);
                Ok(node)
            }
        }
    }

    fn axis(&mut self, joint: &Joint) -> Result<AxisId, Error> {
        let (mut sum, mut force, mut incline, mut friction) = (None::<P>, P::zero(), None, None);
        // What moves it, by its own line or as commanded; and what else has a mass.
        let (mut name, mut load, mut driven, mut has_more) = (String::new(), String::new(), false, false);
        for &(component, port) in &joint.ports {
            let one = &self.each[component].name;
            let mut moves = false;
            match bring(&self.each[component], port, self.build.ambient[1]) {
                Brings::Mass { mass, incline: own, force: pushes, friction: rubs } => {
                    sum = Some(sum.map_or(mass, |sum| sum + mass));
                    force += pushes;
                    load.clone_from(one);
                    if own.is_some() {
                        (incline, friction, moves) = (own, rubs, true);
                    }
                }
                Brings::Motion => (driven, moves) = (true, true),
                Brings::Along => (has_more, load) = (true, one.clone()),
                _ => {}
            }
            if moves && !name.is_empty() {
                return refuse(format!(
                    "{name} and {one} move each on a line of its own: put a coupling between them"
                ));
            }
            if moves {
                name.clone_from(one);
            }
        }
        if driven && (sum.is_some() || has_more) {
            return refuse(format!(
                "{name} moves as commanded and cannot have the mass of {load}: put a force-sensor between them"
            ));
        }
        let contact = friction.iter().filter(|_| !self.build.is_like);
        let inner: Vec<String> = contact
            .flat_map(physics::friction::Contact::states)
            .map(|state| format!("{name}.{}", state.name))
            .collect();
        let axis = match (sum, incline) {
            _ if driven => self.build.circuit.driven(),
            (Some(mass), Some(incline)) => self.build.circuit.axis(mass, incline, force, friction),
            _ => {
                let names: Vec<String> = joint.ports.iter().map(|&port| self.name(port)).collect();
                return refuse(format!("no cylinder or slide moves the joint of {}", names.join(", ")));
            }
        };
        self.build.masses.push((sum.unwrap_or(P::zero()), force));
        if self.build.is_like {
            return Ok(axis);
        }
        self.own(&name);
        self.build.circuit.call_axis(axis, format!("{name}."));
        let names = ["position_m", "velocity_m_s"].map(|quantity| format!("{name}.{quantity}"));
        self.build.starts.push((Starting::Axis(axis), names.to_vec()));
        self.build.starts.push((Starting::Inner(axis), inner));
        Ok(axis)
    }
}

/// Refuses more states than there can be, with the components that bring most of them.
fn check_size(counts: &[(&str, usize)]) -> Result<(), Error> {
    let states: usize = counts.iter().map(|(_, count)| count).sum();
    if states <= Deps::CAPACITY {
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
    refuse(format!(
        "the circuit has {states} states, most of them in {most}: it must have at most {}. Give long tubes fewer cells or a smaller bandwidth",
        Deps::CAPACITY
    ))
}

/// Components that are joined, as equations.
pub(super) struct Wired<P> {
    pub circuit: Circuit<P>,
    /// The node at each port of each component.
    pub nodes: Vec<Vec<Node>>,
    pub pistons: Vec<Piston<P>>,
    /// Name, meaning, and what it acts on.
    pub inputs: Vec<(String, &'static str, Acts)>,
    /// It was built as another of the same parts, which has the names.
    pub is_like: bool,
    columns: Vec<(String, Quantity)>,
    pub starts: Vec<(Starting, Vec<String>)>,
    /// Joints of gas whose volume is no component's: the first port, and what its ports bring, m3.
    joint_volumes: Vec<(String, P)>,
}

/// Refuses what a piston never runs into.
fn check_met<P: Lane>(build: &Build<P>) -> Result<(), Error> {
    for (name, position, axis) in &build.met {
        // The piston on the axis, or on one that is coupled to it.
        let near = build.coupled.iter().filter(|(axes, _)| axes.contains(axis));
        let near = near.flat_map(|(axes, play)| axes.map(|other| (other, play.get(0))));
        for (of, play) in near.chain([(*axis, 0.0)]) {
            let Some(piston) = build.pistons.iter().find(|piston| piston.axis == of) else { continue };
            let (x, stroke) = (position.get(0), piston.stroke.get(0));
            if x < -0.5 * play || x > stroke + 0.5 * play {
                return refuse(format!(
                    "{name}.position = {x} m is outside the stroke of {}, 0 to {stroke} m: nothing runs into it there",
                    piston.name
                ));
            }
        }
    }
    Ok(())
}

/// Where the numbers of virial coefficients come from.
pub(super) const VIRIAL_SOURCE: &str = "libretexts-virial";

/// The gas of a description.
pub(super) fn gas<P: Lane>(lifted: &Lifted<specification::Gas>) -> Gas<P> {
    let ideal = IdealGas::new(
        lifted.number(|gas| gas.heat_capacity_ratio),
        lifted.number(|gas| gas.gas_constant_j_kg_k),
    );
    let virial = lifted.optional(|gas| gas.virial.as_ref()).map(|virial| Virial {
        a: virial.number(|own| own.a_m3_kg),
        b: virial.number(|own| own.b_m3_kg),
        c: virial.number(|own| own.c_k),
    });
    Gas::from(&ideal).with(virial)
}

/// Share of the pressure from which on what a third virial coefficient would add is told (assumed).
const MUCH_OFF: f64 = 0.1;

/// What to say of a gas whose second virial coefficient alone does not do.
pub(super) fn virial_warning(gas: &Gas<f64>, pressure: f64, temperature: f64) -> Option<String> {
    let off = gas.virial?.off(gas, pressure, temperature);
    (off.abs() > MUCH_OFF).then(|| {
        format!(
            "at {:.3} bar abs and {temperature:.1} K the gas is {:.0} % off the ideal one: above {:.0} % the third virial \
             coefficient counts, which is left out",
            pressure / 1e5,
            100.0 * off.abs(),
            100.0 * MUCH_OFF
        )
    })
}

/// Joins components, from numbers with or without derivatives. Where they make the parts of a circuit that there is,
/// nothing is analysed or named again.
pub(super) fn wire<P: Lane>(
    gas: &Gas<P>,
    is_air: bool,
    ambient: [P; 2],
    (each, joints): (&[Instance<P>], &Joints),
    ledger: bool,
    like: Option<&Circuit<f64>>,
) -> Result<Wired<P>, Error>
where
    Deps: Over<P>,
{
    if let Some(other) = like {
        let Joined { build, nodes, .. } = join(gas, is_air, ambient, (each, joints), true)?;
        let Build { circuit, open, pistons, inputs, .. } = build;
        if let Some(mut circuit) = circuit.build_like(other) {
            open.into_iter().for_each(|id| circuit.set_input(id, 0, P::one()));
            let (columns, starts, joint_volumes) = Default::default();
            return Ok(Wired {
                circuit,
                nodes,
                pistons,
                inputs,
                is_like: true,
                columns,
                starts,
                joint_volumes,
            });
        }
    }
    let Joined { build, nodes, joint_volumes } = join(gas, is_air, ambient, (each, joints), false)?;
    check_size(&build.circuit.count_states())?;
    let Build { circuit, open, pistons, inputs, columns, starts, .. } = build;
    let mut circuit = circuit.build(ledger);
    for id in open {
        circuit.set_input(id, 0, P::one());
    }
    Ok(Wired { circuit, nodes, pistons, inputs, is_like: false, columns, starts, joint_volumes })
}

/// Components with their joints, not yet a system of equations.
struct Joined<P> {
    build: Build<P>,
    nodes: Vec<Vec<Node>>,
    joint_volumes: Vec<(String, P)>,
}

fn join<P: Lane>(
    gas: &Gas<P>,
    is_air: bool,
    ambient: [P; 2],
    (each, joints): (&[Instance<P>], &Joints),
    is_like: bool,
) -> Result<Joined<P>, Error>
where
    Deps: Over<P>,
{
    let build = Build {
        circuit: Circuit::new(gas, ambient[0], ambient[1]),
        gas: *gas,
        is_air,
        ambient,
        highest: None,
        hottest: ambient[1],
        masses: Vec::new(),
        springs: Vec::new(),
        pistons: Vec::new(),
        met: Vec::new(),
        coupled: Vec::new(),
        open: Vec::new(),
        paths: Vec::new(),
        is_like,
        inputs: Vec::new(),
        columns: vec![("time_s".into(), Quantity::Time)],
        starts: Vec::new(),
    };
    let nodes = each.iter().map(|own| vec![Node::Shut; own.kind().ports.len()]).collect();
    let chains = joints.chains(each);
    let mut wiring = Wiring { each, build, nodes, around: None, joint_volumes: Vec::new(), chains };
    for joint in &joints.each {
        let is_merged = |port| wiring.chains.iter().any(|chain| chain.is_inside(port));
        if !joint.ports.first().copied().is_some_and(is_merged) {
            wiring.join(joint)?;
        }
    }
    let Wiring { mut build, nodes, joint_volumes, chains, .. } = wiring;
    // The ends of a cylinder follow from what is joined to it.
    let mut order: Vec<usize> = (0..each.len()).collect();
    order.sort_by_key(|&i| each[i].kind().friction);
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
    check_met(&build)?;
    Ok(Joined { build, nodes, joint_volumes })
}

impl<P: Lane> Wired<P> {
    /// The circuit under the names that one of the same parts has, if it was built like that.
    pub(super) fn named_like(self, other: &Assembly) -> Assembly<P> {
        if !self.is_like {
            return self.named().0;
        }
        let each = self.inputs.iter().filter_map(|(_, _, acts)| match acts {
            Acts::Timed(timing, _) => Some(*timing),
            _ => None,
        });
        let timings = each.collect();
        Assembly { circuit: Arc::new(self.circuit), variables: other.variables.clone(), timings }
    }

    /// The circuit under the names of its components.
    fn named(self) -> (Assembly<P>, Vec<Piston<P>>) {
        let Wired { circuit, pistons, inputs, mut columns, mut starts, .. } = self;
        let mut timings = Vec::new();
        let settable = |(name, meaning, acts): (String, &'static str, Acts)| {
            let of = |id: InputId| Settable::of(&circuit, id, &name, meaning);
            match acts {
                Acts::On(id) => of(id),
                Acts::Command(edges) => Settable { name, ..Settable::command(edges) },
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
        // What nobody has as a column of its own: joints between two components.
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
        (Assembly { timings: timings.into(), ..Assembly::new(circuit, variables) }, pistons)
    }
}

impl Network {
    /// Assembles the circuit; with `ledger`, its accounts are integrated along.
    pub fn assemble(spec: &specification::Circuit, ledger: bool) -> Result<Self, Error> {
        let each = spec.components.iter().map(instance).collect::<Result<Vec<_>, _>>()?;
        for (i, own) in each.iter().enumerate() {
            if own.name == AMBIENT || each[..i].iter().any(|other| other.name == own.name) {
                return refuse(format!("the name {} is taken", own.name));
            }
        }
        let joints = joints(spec, &each)?;
        let gas = gas(&Lifted::plain(&spec.gas));
        let ambient = [spec.ambient.pressure_pa, spec.ambient.temperature_k];
        if let Some(own) = each.iter().find(|own| own.chosen("chamber_law") == Some("as-printed")) {
            if ledger {
                return refuse(format!("{}: chamber law \"as-printed\" has no ledger", own.name));
            }
            if gas.virial.is_some() {
                return refuse(format!("{}: chamber law \"as-printed\" takes an ideal gas", own.name));
            }
        }
        let mut wired = wire(&gas, gas.is_air(), ambient, (&each, &joints), ledger, None)?;
        let joint_volumes = std::mem::take(&mut wired.joint_volumes);
        let (assembly, pistons) = wired.named();
        let gauge = assembly.highest_pressure() - ambient[0];
        let mut citations = Vec::new();
        let mut warnings = Vec::from_iter(virial_warning(&gas, assembly.highest_pressure(), ambient[1]));
        for (own, spec) in each.iter().zip(&spec.components) {
            citations.extend(own.kind().sources);
            let Some(friction) = &spec.friction else { continue };
            let law = friction_law(friction)?;
            citations.extend(law.sources());
            let number = |key: &str| spec.numbers.get(key).copied().unwrap_or_default();
            let mut own_warnings = law.warnings(gauge, number("stroke"));
            let piston = pistons.iter().find(|piston| piston.name == own.name);
            own_warnings.extend(piston.and_then(|piston| {
                stop_warning(
                    piston.ends.stop.stiffness,
                    piston.dead_volumes,
                    piston.areas,
                    gauge,
                    ["end_stop_stiffness", "dead_volume_"],
                )
            }));
            warnings.extend(own_warnings.into_iter().map(|text| format!("{}: {text}", own.name)));
        }
        citations.extend(gas.virial.map(|_| VIRIAL_SOURCE));
        citations.extend(["steinebach2023", "hairer1996"]);
        let mut seen = Vec::new();
        citations.retain(|key| {
            !seen.contains(key) && {
                seen.push(*key);
                true
            }
        });
        Ok(Network {
            assembly,
            pistons,
            warnings,
            citations,
            joint_volumes,
            joints,
            each,
            is_air: gas.is_air(),
        })
    }

    pub fn assembly(&self) -> &Assembly {
        &self.assembly
    }

    pub(super) fn each(&self) -> &[Instance<f64>] {
        &self.each
    }

    pub(super) fn joints(&self) -> &Joints {
        &self.joints
    }

    pub(super) fn is_air(&self) -> bool {
        self.is_air
    }

    /// What the user should know about this description.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Joints of gas whose volume is no component's: the first port of each, and what its ports bring, m3.
    pub fn joint_volumes(&self) -> &[(String, f64)] {
        &self.joint_volumes
    }

    /// Each cylinder's name, its end stops, as given or as they follow from the circuit and the highest pressure of a
    /// start, Pa absolute, and what the latter take up.
    pub fn end_stops(&self, start: f64) -> impl Iterator<Item = (&str, EndStop<f64>, Taken<f64>)> {
        self.pistons.iter().map(move |Piston { name, ends, areas: [a, b], stroke, .. }| {
            let (stop, taken) = ends.from(start, a.max(*b), *stroke);
            (&**name, stop, taken)
        })
    }

    /// Keys in references.bib of the laws and methods that this circuit uses.
    pub fn citations(&self) -> &[&'static str] {
        &self.citations
    }

    /// What to say of the impacts of a run.
    pub fn impact_warnings(&self, impacts: &[Impact]) -> Vec<String> {
        let each = self.pistons.iter().flat_map(|Piston { axis, name, ends, areas, .. }| {
            let own: Vec<Impact> = impacts.iter().filter(|impact| impact.axis == *axis).copied().collect();
            let through = through_warning(ends.enough, "end_stop_stiffness", &own);
            let all = through.into_iter().chain(impact_warning(areas[0].max(areas[1]), &own));
            all.map(move |text| format!("{name}: {text}")).collect::<Vec<_>>()
        });
        each.collect()
    }

    /// The name of the cylinder on an axis.
    pub fn cylinder(&self, axis: AxisId) -> Option<&str> {
        self.pistons.iter().find(|piston| piston.axis == axis).map(|piston| piston.name.as_str())
    }

    /// Names of the numbers of a start: all but the inner states of friction, which begin at rest.
    pub fn start_names(&self) -> Vec<&str> {
        self.assembly.given_names()
    }

    /// A session at a start, given by the names of [`Network::start_names`].
    pub fn session(&self, start: &BTreeMap<String, f64>, options: Options) -> Result<Session, Error> {
        self.assembly.session(start, options)
    }

    /// Runs from a start under plans: an input, times and the values from each of them on.
    pub fn simulate(
        &self,
        plans: &[(String, Vec<f64>, Vec<f64>)],
        (duration, rate): (f64, f64),
        start: &BTreeMap<String, f64>,
        options: Options,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Run, Error> {
        let inputs = &self.assembly.variables.inputs;
        let place = |name: &String| match inputs.iter().position(|input| input.name == *name) {
            Some(input) => Ok(input),
            None => {
                let names = one_of(inputs.iter().map(|input| input.name.as_str()));
                refuse(format!("there is no input \"{name}\"; there are {names}"))
            }
        };
        let places = plans.iter().map(|(name, ..)| place(name)).collect::<Result<Vec<_>, _>>()?;
        let first: Vec<(usize, f64)> = (places.iter().zip(plans))
            .filter_map(|(&input, (_, times, values))| {
                Some((input, *values.get(times.partition_point(|time| *time <= 0.0).checked_sub(1)?)?))
            })
            .collect();
        let mut session = self.assembly.session_under(&first, start, options)?;
        for (input, (_, times, values)) in places.into_iter().zip(plans) {
            // As in a drive's run, what comes at the end or later is not waited for.
            let due = times.partition_point(|time| *time < duration);
            session.schedule(input, &times[..due], values.get(..due).unwrap_or(values))?;
        }
        session.settle_schedule();
        let mut recorder = Recorder::new(&self.assembly, sample_times(duration, rate));
        session.advance(duration, &mut recorder, &mut Look::new(interrupted))?;
        Ok(recorder.finish(&session))
    }
}

impl Assembly {
    /// Names of the numbers of a start: all but the inner states of friction, which begin at rest.
    fn given_names(&self) -> Vec<&str> {
        let starts = self.variables.starts.iter();
        let given = starts.filter(|(starting, _)| !matches!(starting, Starting::Inner(_)));
        given.flat_map(|(_, names)| names.iter().map(String::as_str)).collect()
    }

    /// A session at a start, given by name.
    pub fn session(&self, start: &BTreeMap<String, f64>, options: Options) -> Result<Session, Error> {
        self.session_under(&[], start, options)
    }

    /// The same, where spools and locks stand at these commands: an input and its value.
    fn session_under(
        &self,
        first: &[(usize, f64)],
        start: &BTreeMap<String, f64>,
        options: Options,
    ) -> Result<Session, Error> {
        let names = self.given_names();
        if let Some(name) = start.keys().find(|name| !names.contains(&name.as_str())) {
            return refuse(format!("there is no start \"{name}\"; there are {}", names.join(", ")));
        }
        let number = |name: &String, above_zero: bool| match start.get(name) {
            None => refuse(format!("the start {name} is missing")),
            Some(value) if !value.is_finite() || (above_zero && *value <= 0.0) => {
                let rule = if above_zero { "above zero" } else { "finite" };
                refuse(format!("the start {name} = {value} must be {rule}"))
            }
            Some(value) => Ok(*value),
        };
        let (mut gas, mut axes, mut ages, mut signals) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (starting, names) in &self.variables.starts {
            match *starting {
                Starting::Gas(id) => gas.push((id, number(&names[0], true)?, number(&names[1], true)?)),
                Starting::Axis(id) => {
                    axes.push((id, number(&names[0], false)?, number(&names[1], false)?));
                    ages.push((id, 0.0));
                }
                Starting::Kept(signal) => match number(&names[0], false)? {
                    position @ (0.0 | 1.0) => signals.push((signal, position)),
                    position => {
                        return refuse(format!(
                            "the start {} = {position} must be 0 or 1: the valve keeps an end position",
                            names[0]
                        ));
                    }
                },
                Starting::Inner(_) | Starting::Alike(_) => {}
            }
        }
        let mut circuit = Circuit::clone(&self.circuit);
        let (inputs, timings) = (&self.variables.inputs, &self.timings);
        for &(input, value) in first {
            if matches!(inputs[input].target, Target::Timed(timing) if timings[timing].stands_at_first()) {
                self.set(&mut circuit, input, 0, value);
            }
        }
        let y = circuit.begin(&Given { gas: &gas, axes: &axes, ages: &ages, inner: &[], signals: &signals });
        Ok(Session::new(self, 0.0, (circuit, y), options))
    }

    /// A session that goes on from the state of another one of this make, at time 0.
    pub fn session_from(&self, state: &[f64], options: Options) -> Result<Session, Error> {
        let (mut circuit, mut y) = (Circuit::clone(&self.circuit), state.to_vec());
        let n = circuit.n_states();
        if y.len() != n {
            return refuse(format!(
                "the state has {} values, of a circuit of another make: this one has {n}",
                y.len()
            ));
        }
        y.resize(n + circuit.channels().len(), 0.0);
        circuit.find_modes(&mut y);
        Ok(Session::new(self, 0.0, (circuit, y), options))
    }
}
