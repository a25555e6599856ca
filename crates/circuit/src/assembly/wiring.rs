//! Turns components and their joints into equations.

use crate::assembly::variables::{Assembly, Settable, Target, Variables};
use crate::circuit::Circuit;
use crate::component::{
    Acts, Brings, Build, Chain, Instance, Leg, Node, Piston, PortId, PortKind, Quantity, Starting, Terminals,
    Vessel, bring, compose, joint_volume,
};
use crate::ground::{AxisId, Error, GasId};
use crate::part::{ChamberLaw, InputId};
use crate::specification::Junctions;
use math::{Deps, Lane, Over};
use ode::Structure;
use physics::Gas;
use physics::friction::Contact;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Name of the ambient air in a joint.
pub(super) const AMBIENT: &str = "ambient";

/// Ports that share one joint, and whether this joint is open to the ambient air.
#[derive(Clone, Debug, Default)]
pub(super) struct Joint {
    pub ports: Vec<PortId>,
    pub ambient: bool,
}

/// The joints of a circuit, and the treatment of joints of two restrictions.
#[derive(Clone, Debug)]
pub(super) struct Joints {
    pub each: Vec<Joint>,
    pub junctions: Junctions,
}

impl Joints {
    /// Merged restrictions.
    fn chains<P: Lane>(&self, each: &[Instance<P>]) -> Vec<Chain> {
        if self.junctions == Junctions::Volume {
            return Vec::new();
        }
        Chain::find(each, self.each.iter().filter(|joint| !joint.ambient).map(|joint| &joint.ports[..]))
    }
}

pub(super) fn refuse<T>(message: impl Into<String>) -> Result<T, Error> {
    Err(Error::Specification(message.into()))
}

pub(super) fn one_of<T: Into<String>>(names: impl Iterator<Item = T>) -> String {
    names.map(Into::into).collect::<Vec<String>>().join(", ")
}

/// Components and joints while they become equations, with numbers with or without derivatives.
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

    /// Returns the node of a joint.
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
            held.push((if self.build.is_like { String::new() } else { AMBIENT.into() }, None));
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
                    let is_named = is_alone && !self.build.is_like;
                    if let Some(other) = own_name.replace(if is_named { owner.name.clone() } else { name }) {
                        return refuse(format!(
                            "{other} and {} share a joint and both have a volume: put a fitting between them",
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
        // Components that prescribe the motion of a joint, and other components with a mass.
        let (mut name, mut load, mut driven, mut has_more) = ("", "", false, false);
        let mut guide = None;
        let each = self.each;
        for &(component, port) in &joint.ports {
            let one = &each[component].name;
            let mut moves = false;
            match bring(&self.each[component], port, self.build.ambient[1]) {
                Brings::Mass { mass, incline: own, force: pushes, friction: rubs } => {
                    sum = Some(sum.map_or(mass, |sum| sum + mass));
                    force += pushes;
                    load = one;
                    if own.is_some() {
                        (incline, friction, moves) = (own, rubs, true);
                    }
                }
                Brings::Motion => (driven, moves) = (true, true),
                Brings::Guide { mass } => {
                    if let Some((other, _)) = guide.replace(((component, port), mass)) {
                        return refuse(format!(
                            "{} and {} share a joint: a mass moves only one leg of a platform",
                            self.name(other),
                            self.name((component, port))
                        ));
                    }
                }
                Brings::Along => (has_more, load) = (true, one),
                _ => {}
            }
            if moves && !name.is_empty() {
                return refuse(format!(
                    "{name} and {one} each have their own axis: put a coupling between them if they move together. \
                     The body of a cylinder is fixed, so a cylinder that rides on another one (a stack whose strokes \
                     add) cannot be expressed"
                ));
            }
            if moves {
                name = one;
            }
        }
        if driven && (sum.is_some() || has_more) {
            return refuse(format!(
                "{name} moves as commanded and cannot have the mass of {load}: put a force-sensor between them"
            ));
        }
        if let Some(((component, port), _)) = guide {
            let leg = format!("leg {} of {}", each[component].kind().ports[port].name, each[component].name);
            check_leg(&leg, (name, driven, has_more), incline, friction.as_ref())?;
        }
        let contact = friction.iter().filter(|_| !self.build.is_like);
        let inner: Vec<String> = contact
            .flat_map(physics::friction::Contact::states)
            .map(|state| format!("{name}.{}", state.name))
            .collect();
        let axis = match (sum, incline) {
            _ if driven => self.build.circuit.driven(),
            _ if guide.is_some() => {
                let (axis, mass) = (self.build.circuit.driven(), sum.unwrap_or(P::zero()));
                self.build.legs.push(Leg { axis, mass, force, friction });
                axis
            }
            (Some(mass), Some(incline)) => self.build.circuit.axis(mass, incline, force, friction),
            _ => {
                let names: Vec<String> = joint.ports.iter().map(|&port| self.name(port)).collect();
                return refuse(format!("no cylinder or slide moves the joint of {}", names.join(", ")));
            }
        };
        let platform = guide.map_or(P::zero(), |(_, mass)| mass);
        self.build.masses.push((sum.unwrap_or(P::zero()) + platform, force));
        if self.build.is_like {
            return Ok(axis);
        }
        // A leg that only a coupling moves has the name of its port.
        let port = guide.map_or(String::new(), |(port, _)| self.name(port));
        let name = if name.is_empty() { &port } else { name };
        self.own(name);
        self.build.circuit.call_axis(axis, format!("{name}."));
        let names = ["position_m", "velocity_m_s"].map(|quantity| format!("{name}.{quantity}"));
        self.build.starts.push((Starting::Axis(axis), names.to_vec()));
        self.build.starts.push((Starting::Inner(axis), inner));
        Ok(axis)
    }
}

/// Refuses components that cannot move a leg of a platform: name, whether it moves as commanded, and whether a mass is
/// coupled to it by a ratio.
fn check_leg<P: Lane>(
    leg: &str,
    (name, driven, has_more): (&str, bool, bool),
    incline: Option<P>,
    friction: Option<&Contact<P>>,
) -> Result<(), Error> {
    if driven || has_more {
        return refuse(format!("{leg}: {name} cannot move it: join a cylinder or a slide"));
    }
    if let Some(angle) = incline.map(|angle| angle.get(0)).filter(|angle| *angle != 0.0) {
        return refuse(format!(
            "{name}.incline = {angle} rad: {leg} has the direction that the platform gives it. Leave out incline"
        ));
    }
    if friction.is_some_and(|contact| contact.law.meta().sticks) {
        return refuse(format!(
            "{name}.friction: this law sticks by a mode of one mass, and {leg} moves with the others. Choose a law \
             without such a mode, such as lugre or elasto-plastic, or put a coupling with the stiffness of the joint \
             between rod and platform"
        ));
    }
    Ok(())
}

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
    refuse(format!(
        "the circuit has {states} states, most of them in {most}: it must have at most {}. Give long tubes fewer cells or a smaller bandwidth",
        Structure::MOST_STATES
    ))
}

/// Joined components as equations.
pub(super) struct Wired<P> {
    pub circuit: Circuit<P>,
    pub pistons: Vec<Piston<P>>,
    /// Name, meaning, and target.
    pub inputs: Vec<(String, &'static str, Acts)>,
    /// Whether the circuit reused the analysis of another circuit of the same parts, which has the names.
    pub is_like: bool,
    columns: Vec<(String, Quantity)>,
    pub starts: Vec<(Starting, Vec<String>)>,
    /// Gas joints whose volume belongs to no component: the first port, and the volume of its ports, m3.
    pub joint_volumes: Vec<(String, P)>,
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
                return refuse(format!(
                    "{name}.position = {x} m is outside the stroke of {}, 0 to {stroke} m: nothing runs into it there",
                    piston.name
                ));
            }
        }
    }
    Ok(())
}

/// Joins components, from numbers with or without derivatives. If an existing circuit has the same parts, its analysis
/// and names are reused.
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
        let Joined { build, .. } = join(gas, is_air, ambient, (each, joints), true)?;
        let Build { circuit, open, pistons, inputs, .. } = build;
        if let Some(mut circuit) = circuit.build_like(other) {
            open.into_iter().for_each(|id| circuit.set_input(id, 0, P::one()));
            let (columns, starts, joint_volumes) = Default::default();
            return Ok(Wired { circuit, pistons, inputs, is_like: true, columns, starts, joint_volumes });
        }
    }
    if !P::GENERAL {
        return Err(Error::Specification("these numbers belong to a circuit of another structure".into()));
    }
    let Joined { build, joint_volumes } = join(gas, is_air, ambient, (each, joints), false)?;
    check_size(&build.circuit.count_states())?;
    let Build { circuit, open, pistons, inputs, columns, starts, .. } = build;
    let mut circuit = circuit.build(ledger);
    for id in open {
        circuit.set_input(id, 0, P::one());
    }
    Ok(Wired { circuit, pistons, inputs, is_like: false, columns, starts, joint_volumes })
}

/// Components with their joints, before they become a system of equations.
struct Joined<P> {
    build: Build<P>,
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
        legs: Vec::new(),
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
    // The ends of a cylinder depend on the components joined to it, and a platform on its couplings.
    let mut order: Vec<usize> = (0..each.len()).collect();
    let guides = |i: usize| each[i].kind().key.starts_with("platform/");
    order.sort_by_key(|&i| (each[i].kind().friction, guides(i)));
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
    Ok(Joined { build, joint_volumes })
}

impl<P: Lane> Wired<P> {
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
        (Assembly { timings: timings.into(), ..Assembly::new(circuit, variables) }, pistons)
    }
}
