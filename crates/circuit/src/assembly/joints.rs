//! The nodes of joints, from what the joined components bring.

use crate::component::{
    Brings, Build, Chain, Instance, Leg, Node, PortId, PortKind, Starting, Vessel, WallHeat, joint_volume,
};
use crate::ground::{AxisId, Error, GasId, refuse};
use crate::part::ChamberLaw;
use crate::specification::Junctions;
use math::{Deps, Lane, Over};
use physics::friction::Contact;

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
    pub fn chains<P: Lane>(&self, each: &[Instance<P>]) -> Vec<Chain> {
        if self.junctions == Junctions::Volume {
            return Vec::new();
        }
        Chain::find(each, self.each.iter().filter(|joint| !joint.ambient).map(|joint| &joint.ports[..]))
    }
}

pub(super) fn one_of<T: Into<String>>(names: impl Iterator<Item = T>) -> String {
    names.map(Into::into).collect::<Vec<String>>().join(", ")
}

/// Components and joints while they become equations, with numbers with or without derivatives.
pub(super) struct Wiring<'a, P> {
    pub each: &'a [Instance<P>],
    pub build: Build<P>,
    /// The node at each port of each component.
    pub nodes: Vec<Vec<Node>>,
    pub around: Option<GasId>,
    pub chains: Vec<Chain>,
    /// Whether joints exchange heat by law: some component does.
    pub has_heat_law: bool,
}

/// Contributions of the components to a joint of gas.
struct GasContributions<P> {
    /// Names of what holds the pressure, with pressure, Pa, and temperature, K, except for the ambient air.
    held: Vec<(String, Option<[P; 2]>)>,
    volume: Option<Vessel<P>>,
    /// Name of the volume.
    own_name: Option<String>,
    /// Volume of the ports, m3.
    ports: f64,
    /// Volume inside restrictions, m3.
    room: Option<P>,
    /// Bore of the narrowest tube, m.
    bore: Option<P>,
}

/// Contributions of the components to a joint of masses.
struct Body<'a, P> {
    /// Mass, kg, if any component has one, and external force in +x, N.
    mass: Option<P>,
    force: P,
    incline: Option<P>,
    friction: Option<Contact<P>>,
    /// Component whose axis it is, if any.
    name: &'a str,
    /// Whether its motion is commanded.
    driven: bool,
    /// The last component with a mass only, and whether one is coupled by a ratio.
    load: &'a str,
    has_more: bool,
    /// Port of a platform, and mass of that platform, kg.
    guide: Option<(PortId, P)>,
}

impl<'a, P: Lane> Wiring<'a, P>
where
    Deps: Over<P>,
{
    fn name(&self, (component, port): PortId) -> String {
        if self.build.is_like {
            return String::new();
        }
        let own = &self.each[component];
        format!("{}.{}", own.name, own.table.ports[port].name)
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
    pub fn join(&mut self, joint: &Joint) -> Result<(), Error> {
        let kind = |&(component, port): &PortId| self.each[component].table.ports[port].kind;
        let node = match joint.ports.first().map(kind) {
            None => return Ok(()),
            Some(PortKind::Pilot) if !joint.ambient => {
                let names: Vec<String> = joint.ports.iter().map(|&port| self.name(port)).collect();
                return refuse!("no gas reaches the pilot port {}", names.join(", "));
            }
            Some(PortKind::Gas | PortKind::Pilot) => Node::Gas(self.gas(joint)?),
            Some(PortKind::Axis) => Node::Axis(self.axis(joint)?),
        };
        for &(component, port) in &joint.ports {
            self.nodes[component][port] = node;
        }
        Ok(())
    }

    /// Returns what the components bring to a joint of gas.
    fn brought(&self, joint: &Joint) -> Result<GasContributions<P>, Error> {
        let (mut held, mut volume, mut own_name, mut ports) = (Vec::new(), None, None, 0.0);
        let (mut room, mut bore) = (None::<P>, None::<P>);
        if joint.ambient {
            held.push((if self.build.is_like { String::new() } else { AMBIENT.into() }, None));
        }
        for &(component, port) in &joint.ports {
            let name = self.name((component, port));
            ports += self.each[component].table.ports[port].volume;
            match self.each[component].brings(port, self.build.ambient[1]) {
                Brings::Reservoir { pressure, temperature } => {
                    held.push((name, Some([pressure, temperature])))
                }
                Brings::Volume(vessel) => {
                    let owner = &self.each[component];
                    let is_alone = owner.table.ports.len() == 1;
                    let is_named = is_alone && !self.build.is_like;
                    if let Some(other) = own_name.replace(if is_named { owner.name.clone() } else { name }) {
                        return refuse!(
                            "{other} and {} share a joint and both have a volume: put a fitting between them",
                            own_name.unwrap_or_default()
                        );
                    }
                    volume = Some(vessel);
                }
                Brings::Room { volume } => room = Some(room.map_or(volume, |room| room + volume)),
                _ => {}
            }
            if self.each[component].table.key.starts_with("tube") {
                let own = self.each[component].number("diameter");
                bore = Some(bore.map_or(own, |bore| bore.min(own)));
            }
            let chain = self.chains.iter().find(|chain| chain.ends().contains(&(component, port)));
            if let Some(more) = chain.and_then(|chain| chain.room(self.each, self.build.ambient[1])) {
                room = Some(room.map_or(more, |room| room + more));
            }
        }
        Ok(GasContributions { held, volume, own_name, ports, room, bore })
    }

    fn gas(&mut self, joint: &Joint) -> Result<GasId, Error> {
        let GasContributions { held, volume, own_name, ports, room, bore } = self.brought(joint)?;
        match (&held[..], volume) {
            ([(one, _), (other, _), ..], _) => {
                refuse!("{one} and {other} hold the same joint: put a fitting between them")
            }
            ([(one, _)], Some(_)) => refuse!(
                "{one} holds the pressure in {}: put a fitting between them",
                own_name.unwrap_or_default()
            ),
            ([(_, None)], None) => Ok(self.ambient()),
            (&[(_, Some([pressure, temperature]))], None) => {
                self.build.supply(pressure, temperature);
                Ok(self.build.circuit.reservoir(pressure, temperature))
            }
            ([], volume) => {
                let own_volume = P::c(joint_volume(ports));
                let mut vessel = volume.unwrap_or_else(|| Vessel {
                    law: ChamberLaw::EnergyBalance,
                    dead_volume: own_volume,
                    wall: P::zero(),
                    heat: if self.has_heat_law {
                        WallHeat::Joint { volume: own_volume, diameter: bore }
                    } else {
                        WallHeat::Constant(P::zero())
                    },
                    wall_temperature: self.build.ambient[1],
                });
                if let WallHeat::Vessel { port, .. } = &mut vessel.heat {
                    *port = port.or(bore);
                }
                if let Some(room) = room {
                    vessel.dead_volume += room;
                }
                let dead_volume = vessel.dead_volume;
                let node = self.build.volume(vessel);
                let name = own_name.unwrap_or_else(|| {
                    let name = self.name(joint.ports[0]);
                    self.build.joint_volumes.push((name.clone(), dead_volume));
                    name
                });
                self.build.gas_starts(node, &name);
                self.own(&name);
                Ok(node)
            }
        }
    }

    /// Returns what the components bring to a joint of masses.
    fn body(&self, joint: &Joint) -> Result<Body<'a, P>, Error> {
        let mut body = Body {
            mass: None::<P>,
            force: P::zero(),
            incline: None,
            friction: None,
            name: "",
            driven: false,
            load: "",
            has_more: false,
            guide: None,
        };
        for &(component, port) in &joint.ports {
            let one = &self.each[component].name;
            let mut moves = false;
            match self.each[component].brings(port, self.build.ambient[1]) {
                Brings::Mass { mass: own, incline, force, friction } => {
                    body.mass = Some(body.mass.map_or(own, |sum| sum + own));
                    body.force += force;
                    body.load = one;
                    if incline.is_some() {
                        (body.incline, body.friction, moves) = (incline, friction, true);
                    }
                }
                Brings::Motion => (body.driven, moves) = (true, true),
                Brings::Guide { mass } => {
                    if let Some((other, _)) = body.guide.replace(((component, port), mass)) {
                        return refuse!(
                            "{} and {} share a joint: a mass moves only one leg of a platform",
                            self.name(other),
                            self.name((component, port))
                        );
                    }
                }
                Brings::Along => (body.has_more, body.load) = (true, one),
                _ => {}
            }
            if moves && !body.name.is_empty() {
                return refuse!(
                    "{} and {one} each have their own axis: put a coupling between them if they move together. \
                     The body of a cylinder is fixed, so a cylinder that rides on another one (a stack whose strokes \
                     add) cannot be expressed",
                    body.name
                );
            }
            if moves {
                body.name = one;
            }
        }
        Ok(body)
    }

    fn axis(&mut self, joint: &Joint) -> Result<AxisId, Error> {
        let each = self.each;
        let Body { mass: sum, force, incline, friction, name, driven, load, has_more, guide } =
            self.body(joint)?;
        if driven && (sum.is_some() || has_more) {
            return refuse!(
                "{name} moves as commanded and cannot have the mass of {load}: put a force-sensor between them"
            );
        }
        if let Some(((component, port), _)) = guide {
            let leg = format!("leg {} of {}", each[component].table.ports[port].name, each[component].name);
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
                return refuse!("no cylinder or slide moves the joint of {}", names.join(", "));
            }
        };
        let platform = guide.map_or(P::zero(), |(_, mass)| mass);
        self.build.masses.push((sum.unwrap_or(P::zero()) + platform, force));
        if !self.build.is_like {
            self.axis_starts(axis, name, guide.map(|(port, _)| port), inner);
        }
        Ok(axis)
    }

    /// Makes an axis start at a position and a velocity, with these inner states of its friction.
    fn axis_starts(&mut self, axis: AxisId, name: &str, guide: Option<PortId>, inner: Vec<String>) {
        // A leg that only a coupling moves has the name of its port.
        let port = guide.map_or(String::new(), |port| self.name(port));
        let name = if name.is_empty() { &port } else { name };
        self.own(name);
        self.build.circuit.call_axis(axis, format!("{name}."));
        let names = ["position_m", "velocity_m_s"].map(|quantity| format!("{name}.{quantity}"));
        self.build.starts.push((Starting::Axis(axis), names.to_vec()));
        self.build.starts.push((Starting::Inner(axis), inner));
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
        return refuse!("{leg}: {name} cannot move it: join a cylinder or a slide");
    }
    if let Some(angle) = incline.map(|angle| angle.get(0)).filter(|angle| *angle != 0.0) {
        return refuse!(
            "{name}.incline = {angle} rad: {leg} has the direction that the platform gives it. Leave out incline"
        );
    }
    if friction.is_some_and(|contact| contact.law.meta().sticks) {
        return refuse!(
            "{name}.friction: this law sticks by a mode of one mass, and {leg} moves with the others. Choose a law \
             without such a mode, such as lugre or elasto-plastic, or put a coupling with the stiffness of the joint \
             between rod and platform"
        );
    }
    Ok(())
}
