//! The circuit under construction, to which components add their parts.

use super::instance::{Brings, Instance, Terminals, Vessel, WallHeat};
use super::kind::Kind;
use crate::circuit::{Circuit, Path};
use crate::component::mechanics::end_stop::Ends;
use crate::component::{Quantity, Starting, Timing};
use crate::ground::{AxisId, Error, GasId};
use crate::part::{CheckValve, InputId, PartId, StoredPart, Wall};
use math::{Deps, Lane, Over};
use physics::flow::{BORE_CONDUCTANCE, Iso6358};
use physics::friction::Contact;
use physics::heat::{Film, Geometry, Heat, Pipe};
use physics::{Bounds, Gas};
use std::f64::consts::PI;

/// Least diameter of a port, m (assumed): smaller than any port, for volumes that no path reaches.
const LEAST_PORT: f64 = 1e-4;

/// Target of an input, known once the circuit is built.
#[derive(Clone, Copy, Debug)]
pub enum Acts {
    /// An input of a part.
    On(InputId),
    /// The edges of a valve.
    Command([InputId; 4]),
    /// The external force on an axis.
    Force(AxisId),
    /// Delayed effects of a command, and its bounds.
    Timed(Timing, Bounds),
    /// The pressure of a reservoir.
    Pressure(GasId),
    /// The temperature of a reservoir.
    Temperature(GasId),
}

/// The piston of a cylinder.
#[derive(Clone, Debug)]
pub struct Piston<P> {
    /// Axis of the piston.
    pub axis: AxisId,
    /// Name of its cylinder.
    pub name: String,
    /// Stroke, m.
    pub stroke: P,
    pub(crate) ends: Ends<P>,
    /// Areas on the sides of chambers a and b, m2.
    pub areas: [P; 2],
    /// Volume that an end stop may use at each end, m3.
    pub dead_volumes: [P; 2],
}

/// A leg of a mechanism, with the components that are joined to this leg.
#[derive(Clone, Debug)]
pub struct Leg<P> {
    /// Its axis.
    pub axis: AxisId,
    /// Moving mass, kg.
    pub mass: P,
    /// External force in +x, N.
    pub force: P,
    /// Its friction.
    pub friction: Option<Contact<P>>,
}

/// A circuit that is being assembled from components.
pub struct Build<P> {
    /// The parts added so far.
    pub circuit: Circuit<P>,
    /// The gas of the circuit.
    pub gas: Gas<P>,
    /// Pressure, Pa, and temperature, K, of the ambient air.
    pub ambient: [P; 2],
    /// The highest pressure of a supply, Pa absolute.
    pub highest: Option<P>,
    /// The highest temperature of a supply or of the ambient air, K.
    pub hottest: P,
    /// Mass, kg, and external force, N, of each axis.
    pub masses: Vec<(P, P)>,
    /// Stiffness, N/m, and rest position, m, of springs on axes.
    pub springs: Vec<(AxisId, P, P)>,
    /// Pistons of all cylinders added so far.
    pub pistons: Vec<Piston<P>>,
    /// Contacts of masses: name, position, m, and axis.
    pub met: Vec<(String, P, AxisId)>,
    /// Axes that move together, apart from a play, m.
    pub coupled: Vec<([AxisId; 2], P)>,
    /// Legs of mechanisms.
    pub legs: Vec<Leg<P>>,
    /// Restrictions that are always open.
    pub open: Vec<InputId>,
    /// Sonic conductance of each restriction and its ends.
    pub paths: Vec<(P, GasId, GasId)>,
    /// Volumes whose heat transfer needs a diameter that follows from the paths at them.
    pub(crate) unsized_walls: Vec<(GasId, WallHeat<P>)>,
    /// Whether names are omitted, because a circuit of the same parts has them.
    pub is_like: bool,
    /// Name, meaning and target.
    pub inputs: Vec<(String, &'static str, Acts)>,
    /// Name and content.
    pub columns: Vec<(String, Quantity)>,
    /// Groups, each with the names of its numbers.
    pub starts: Vec<(Starting, Vec<String>)>,
    /// Gas joints whose volume belongs to no component: the first port of each, and the volume of its ports, m3.
    pub joint_volumes: Vec<(String, P)>,
}

impl<P: Lane> Build<P> {
    /// Nothing yet, with a gas and ambient air of a pressure, Pa, and a temperature, K.
    pub(crate) fn new(gas: &Gas<P>, ambient: [P; 2], is_like: bool) -> Self {
        Build {
            circuit: Circuit::new(gas, ambient[0], ambient[1]),
            gas: *gas,
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
            unsized_walls: Vec::new(),
            is_like,
            inputs: Vec::new(),
            columns: vec![("time_s".into(), Quantity::Time)],
            starts: Vec::new(),
            joint_volumes: Vec::new(),
        }
    }

    /// A volume.
    pub fn volume(&mut self, vessel: Vessel<P>) -> GasId {
        let Vessel { law, dead_volume, wall, heat: described, wall_temperature } = vessel;
        let (heat, is_unsized) = match described {
            WallHeat::Constant(coefficient) => (Heat::Newton(coefficient), false),
            WallHeat::Vessel { scale, bore, area, port } => {
                let area = area.unwrap_or(P::c(f64::INFINITY));
                let size = Geometry { bore, area, port: port.unwrap_or(bore) };
                (Heat::Film(Film::new(scale, &size, &self.gas)), port.is_none())
            }
            WallHeat::Tube { scale, diameter } => (Heat::Pipe(Pipe::new(scale, diameter, &self.gas)), false),
            WallHeat::Joint { .. } => (Heat::Pipe(Pipe::new(P::one(), P::one(), &self.gas)), true),
        };
        let node = self.circuit.vessel(law, [dead_volume, wall], heat, wall_temperature);
        if is_unsized {
            self.unsized_walls.push((node, described));
        }
        node
    }

    /// Sets the diameters that follow from the paths at a volume, when all paths are known.
    pub(crate) fn size_walls(&mut self) {
        for (node, described) in std::mem::take(&mut self.unsized_walls) {
            let bore =
                (self.widest(node) * P::c(4.0 / (PI * BORE_CONDUCTANCE))).max(P::c(LEAST_PORT * LEAST_PORT));
            let (gas, bore) = (self.gas, bore.sqrt());
            let volume = self.circuit.volume_mut(node);
            match (described, &mut volume.heat) {
                (WallHeat::Joint { volume: own, diameter }, heat) => {
                    let diameter = diameter.unwrap_or(bore);
                    volume.dead_wall = P::c(4.0) * own / diameter;
                    *heat = Heat::Pipe(Pipe::new(P::one(), diameter, &gas));
                }
                (_, Heat::Film(film)) => film.set_port(bore, &gas),
                _ => {}
            }
        }
    }

    /// Makes gas start at a pressure and a temperature.
    pub(crate) fn gas_starts(&mut self, node: GasId, name: impl std::fmt::Display) {
        if self.is_like {
            return;
        }
        self.circuit.call_gas(node, format!("{name}."));
        let names = ["pressure_pa", "temperature_k"].map(|quantity| format!("{name}.{quantity}"));
        self.starts.push((Starting::Gas(node), names.to_vec()));
    }

    /// Adds a restriction that is always open.
    pub fn passage(&mut self, law: Iso6358<P>, from: GasId, to: GasId) -> InputId {
        let edge = self.edge(law, from, to);
        self.open.push(edge);
        edge
    }

    /// Adds a restriction that is shut until its input opens it.
    pub fn edge(&mut self, law: Iso6358<P>, from: GasId, to: GasId) -> InputId {
        self.paths.push((law.conductance, from, to));
        self.circuit.restriction(law, from, to)
    }

    /// Adds a part with flow paths of the given conductances.
    pub(super) fn flow_part<T: StoredPart<P>>(&mut self, part: T, conductances: &[P]) -> PartId {
        let paths = part.paths().iter().zip(conductances);
        self.paths.extend(paths.map(|(path, conductance)| (*conductance, path.from, path.to)));
        self.circuit.add(part)
    }

    /// Adds a spring between a mass and the frame: stiffness, N/m, and the position without force, m.
    pub fn spring(&mut self, axis: AxisId, stiffness: P, rest_position: P) {
        self.circuit.spring(axis, stiffness, rest_position);
        self.springs.push((axis, stiffness, rest_position));
    }

    /// Adds a part with one flow path of this conductance.
    pub(super) fn path_part(&mut self, part: impl StoredPart<P>, conductance: P) -> Path {
        Path::along(self.flow_part(part, &[conductance]), 0)
    }

    /// Adds the heat-storing wall of volumes, and the column of its temperature.
    pub fn wall(&mut self, of: &Instance<P>, nodes: &[GasId]) {
        let signal = self.circuit.signal();
        for node in nodes {
            self.circuit.volume_mut(*node).stored_wall = true;
        }
        self.circuit.add(Wall {
            capacity: of.number("wall_capacity"),
            heat_transfer: of.given("heat_transfer"),
            outward: of.number("wall_outer_area") * of.number("wall_outer_heat_transfer"),
            start: of.given("wall_temperature").unwrap_or(self.ambient[1]),
            signal,
            nodes: nodes.iter().map(|node| node.0).collect(),
        });
        self.columns.push((format!("{}.wall_temperature_k", of.name), Quantity::Signal(signal)));
    }

    /// Adds a path that opens without a command.
    pub fn check_valve(&mut self, law: Iso6358<P>, cracking_pressure: P, from: GasId, to: GasId) -> Path {
        let (conductance, path) = (law.conductance, self.circuit.between(from, to));
        self.path_part(CheckValve { law, cracking_pressure, path }, conductance)
    }

    /// Adds the columns of a motion: position, velocity, acceleration and friction, the first four outputs.
    pub fn motion(&mut self, of: &Instance<P>, axis: AxisId) {
        let motion = [Quantity::Position, Quantity::Velocity, Quantity::Acceleration, Quantity::Friction];
        self.columns(of, 0, motion.map(|quantity| quantity(axis)));
    }

    /// Adds the columns of the inner states of friction.
    pub fn inner_states(&mut self, of: &Instance<P>, axis: AxisId) {
        if self.is_like {
            return;
        }
        let inner = of.friction.iter().flat_map(|contact| contact.states());
        for (i, state) in inner.enumerate() {
            self.columns.push((format!("{}.{}", of.name, state.name), Quantity::Inner(axis, i)));
        }
    }

    /// Records a supply, with its highest pressure, Pa absolute, and temperature, K.
    pub(crate) fn supply(&mut self, pressure: P, temperature: P) {
        self.highest = Some(self.highest.map_or(pressure, |highest| highest.max(pressure)));
        self.hottest = temperature.max(self.hottest);
    }

    /// Returns the largest sonic conductance through which gas leaves a node.
    pub fn widest(&self, node: GasId) -> P {
        let each = self.paths.iter().filter(|(_, from, to)| *from == node || *to == node);
        each.fold(P::zero(), |widest, (conductance, ..)| widest.max(*conductance))
    }

    /// Adds the input at this index of the kind's table.
    pub fn input(&mut self, of: &Instance<P>, input: usize, acts: Acts) {
        let (name, _, meaning) = of.table.inputs[input];
        let name = if self.is_like { String::new() } else { format!("{}.{name}", of.name) };
        self.inputs.push((name, meaning, acts));
    }

    /// Adds the output at this index of the kind's table.
    pub fn column(&mut self, of: &Instance<P>, output: usize, quantity: Quantity) {
        if self.is_like {
            return;
        }
        let (name, ..) = of.table.outputs[output];
        self.columns.push((format!("{}.{name}", of.name), quantity));
    }

    /// Adds the outputs from this index of the kind's table on.
    pub fn columns(
        &mut self,
        of: &Instance<P>,
        first: usize,
        quantities: impl IntoIterator<Item = Quantity>,
    ) {
        for (output, quantity) in (first..).zip(quantities) {
            self.column(of, output, quantity);
        }
    }

    /// Returns the law of a flow path with the subsonic index 0.5, from its sonic conductance, m3/(s Pa), and its
    /// critical pressure ratio.
    pub fn usual_path(&self, [conductance, ratio]: [P; 2], linear_above: P) -> Iso6358<P> {
        Iso6358::for_gas(conductance, ratio, P::c(0.5), linear_above, true, &self.gas, self.gas.is_air())
    }
}

impl<P: Lane> Instance<P> {
    /// Returns the law of a flow path of this component with the named sonic conductance.
    pub fn path(&self, conductance: &str, build: &Build<P>) -> Iso6358<P> {
        self.path_of(self.number(conductance), build)
    }

    /// Returns the same for a sonic conductance, m3/(s Pa).
    pub fn path_of(&self, conductance: P, build: &Build<P>) -> Iso6358<P> {
        self.law(conductance, self.number("critical_pressure_ratio"), build)
    }

    /// Returns the law of a path to the exhaust. The default is the law of the supply path.
    pub(super) fn exhaust_path(&self, build: &Build<P>) -> Iso6358<P> {
        let conductance = self.given("exhaust_conductance").unwrap_or_else(|| self.number("conductance"));
        let ratio = self.given("exhaust_critical_pressure_ratio");
        self.law(conductance, ratio.unwrap_or_else(|| self.number("critical_pressure_ratio")), build)
    }

    fn law(&self, conductance: P, ratio: P, build: &Build<P>) -> Iso6358<P> {
        let index = self.number("subsonic_index");
        Iso6358::for_gas(
            conductance,
            ratio,
            index,
            self.number("linear_above"),
            index.get(0) == 0.5 && !self.is_free("subsonic_index"),
            &build.gas,
            build.gas.is_air(),
        )
    }
}

/// A kind of component.
pub trait Component: 'static {
    /// Its table.
    const KIND: Kind;

    /// Returns its contribution to the joint at a port.
    fn bring<P: Lane>(_own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
        Brings::Nothing
    }

    /// Returns sonic conductance, m3/(s Pa), and critical pressure ratio of a path between its first two ports. The
    /// path is always open and can be merged with others in series. Its outputs are flows along it.
    fn series<P: Lane>(_own: &Instance<P>) -> Option<[P; 2]> {
        None
    }

    /// Checks relations between its numbers.
    fn check(_own: &Instance<f64>) -> Result<(), Error> {
        Ok(())
    }

    /// Adds its parts.
    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>)
    where
        Deps: Over<P>;
}
