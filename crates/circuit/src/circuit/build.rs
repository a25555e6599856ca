//! Building of a circuit from its parts: parts, connections, and the start state.

use super::{Circuit, Topology, next_filling};
use crate::ground::{AxisId, Between, Common, GasId, Given, Place};
use crate::part::*;
use math::{Deps, Lane, Over, Real};
use ode::{Structure, System};
use physics::Gas;
use physics::constants::STANDARD_GRAVITY;
use physics::friction::Contact;
use physics::heat::Heat;
use physics::mechanics::Inertia;
use std::sync::{Arc, LazyLock};

impl Topology {
    /// Structure of an empty circuit, shared by all circuits until they are built.
    fn of_none() -> Arc<Self> {
        static NONE: LazyLock<Arc<Topology>> = LazyLock::new(|| {
            let structure = Arc::new(Structure::of(|_, _| (), &[], false));
            let (names, channels, events) = Default::default();
            Arc::new(Topology { names, n_states: 0, channels, structure, events })
        });
        NONE.clone()
    }
}

impl<R: Lane> Circuit<R> {
    /// Creates an empty circuit. The ambient pressure, Pa, acts on the outside of every piston.
    pub fn new(gas: impl Into<Gas<R>>, ambient_pressure: R, ambient_temperature: R) -> Self {
        Circuit {
            topology: Topology::of_none(),
            parts: Parts::default(),
            common: Common { gas: gas.into(), ambient_pressure, ambient_temperature },
            scale: Vec::new(),
            open: Vec::new(),
            gas_nodes: 0,
            axis_nodes: 0,
            signals: 0,
            called: Called::default(),
            shape: 0,
            filled: next_filling(),
            fused: None,
        }
    }

    /// Adds a number to the hash of the structure: FNV-1a of words.
    pub(crate) fn shape_by(&mut self, number: usize) {
        self.shape = (self.shape ^ number as u64).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
    }

    /// Parts added since the last call belong to this component.
    pub(crate) fn own(&mut self, name: &str) {
        self.called.owners.push(name.into());
        self.parts.own(self.called.owners.len());
    }

    /// Sets the prefix of the state names of a gas node.
    pub(crate) fn call_gas(&mut self, node: GasId, name: String) {
        self.called.gas.insert(node.0, name);
    }

    /// Sets the prefix of the state names of an axis.
    pub(crate) fn call_axis(&mut self, axis: AxisId, name: String) {
        self.called.axes.insert(axis.0, name);
    }

    /// Renames each state by `name`. The circuit must be built and must not have copies yet.
    pub(crate) fn call_states(&mut self, name: impl Fn(&str) -> String) {
        let topology = Arc::get_mut(&mut self.topology).expect("not shared yet");
        topology.names.iter_mut().for_each(|(own, _)| *own = name(own));
    }

    fn next_gas(&mut self) -> usize {
        self.gas_nodes += 1;
        self.gas_nodes - 1
    }

    fn next_axis(&mut self) -> usize {
        self.axis_nodes += 1;
        self.axis_nodes - 1
    }

    /// Adds gas at constant pressure, Pa, and temperature, K.
    pub fn reservoir(&mut self, pressure: R, temperature: R) -> GasId {
        let node = self.next_gas();
        self.parts.reservoirs.push((Place::default(), Reservoir { pressure, temperature, node }));
        self.filled = next_filling();
        GasId(node)
    }

    /// Adds a volume with the balance `law`: a tank, or the dead volume of a chamber, which piston faces enlarge. Its dead
    /// volume, m3, has a wall, m2, at a temperature, K.
    pub fn vessel(
        &mut self,
        law: ChamberLaw,
        [dead_volume, dead_wall]: [R; 2],
        heat: Heat<R>,
        wall_temperature: R,
    ) -> GasId {
        let node = self.next_gas();
        self.shape_by(usize::from(heat.least_flow().is_some()));
        let mut part = Volume {
            dead_volume,
            dead_wall,
            heat,
            wall_temperature,
            node,
            starts_as: node,
            law,
            stored_wall: false,
            scales: [1.0; 2],
        };
        part.set_scales(self.common.gas.heat_capacity_ratio.get(0), self.common.gas.gas_constant.get(0));
        self.parts.volumes.push((Place::default(), part));
        GasId(node)
    }

    /// Makes a volume start with the pressure and temperature of another one.
    pub(crate) fn starts_as(&mut self, volume: GasId, other: GasId) {
        self.volume_mut(volume).starts_as = other.0;
    }

    /// Returns a volume that was added.
    pub(crate) fn volume_mut(&mut self, id: GasId) -> &mut Volume<R> {
        let volume = self.parts.volumes.iter_mut().find(|(_, part)| part.node == id.0);
        &mut volume.expect("a volume").1
    }

    pub(crate) fn is_reservoir(&self, id: GasId) -> bool {
        self.parts.reservoirs.iter().any(|(_, part)| part.node == id.0)
    }

    /// Adds a flow path from one gas node to another.
    pub fn between(&self, from: GasId, to: GasId) -> Between {
        Between { from, to, boundary: [self.is_reservoir(from), self.is_reservoir(to)] }
    }

    /// Adds a signal between parts, and returns its index.
    pub(crate) fn signal(&mut self) -> usize {
        self.signals += 1;
        self.signals - 1
    }

    /// Adds a part whose nodes exist.
    pub(crate) fn add<T: StoredPart<R>>(&mut self, part: T) -> PartId {
        self.shape_by(T::KIND as usize);
        for path in part.paths() {
            self.shape_by(path.from.0);
            self.shape_by(path.to.0);
        }
        let kept = T::kept(&mut self.parts);
        kept.push((Place::default(), part));
        PartId { kind: T::KIND, index: kept.len() - 1 }
    }

    /// Adds a restriction between two gas nodes, initially closed. Its opening is 0 for closed and 1 for full.
    pub fn restriction(&mut self, law: physics::flow::Iso6358<R>, from: GasId, to: GasId) -> InputId {
        let path = self.between(from, to);
        let (opening, closed) = (R::zero(), false);
        if self.common.gas.virial.is_some() {
            return self.add(OtherRestriction { law, opening, closed, path }).input(0);
        }
        self.add(Restriction::<R> { law, opening, closed, path }).input(0)
    }

    /// Adds an axis that a carriage moves.
    pub(crate) fn driven(&mut self) -> AxisId {
        AxisId(self.next_axis())
    }

    /// Adds a mass on a line inclined by `incline` rad (positive: x points up), with a constant force in +x.
    pub fn axis(&mut self, mass: R, incline: R, external_force: R, friction: Option<Contact<R>>) -> AxisId {
        let node = self.next_axis();
        let weight = mass * R::c(STANDARD_GRAVITY) * incline.sin();
        let friction = friction.map(|contact| contact.surrounded(self.common.ambient_temperature));
        let inertia = friction.as_ref().map_or(R::zero(), |own| own.law.inertia());
        let inverse_mass = R::one() / (mass + inertia);
        let largest_scales = friction.as_ref().map_or(Vec::new(), mechanics::axis::largest_scales);
        let part = Axis {
            mass,
            inertia,
            inverse_mass,
            weight,
            external_force,
            friction,
            moves: Vec::new(),
            mode: R::zero(),
            largest_scales,
            node,
        };
        self.parts.axes.push((Place::default(), part));
        AxisId(node)
    }

    /// Adds a mass that moves with an axis by a ratio that depends on its position.
    pub(crate) fn moves(&mut self, axis: AxisId, law: Inertia<R>) {
        let of = self.parts.axes.iter_mut().find(|(_, part)| part.node == axis.0);
        of.expect("an axis").1.moves.push(law);
    }

    /// Adds one side of a piston. If `grows`, the chamber grows with x. Otherwise its volume ends at `stroke` m.
    pub fn face(&mut self, gas: GasId, axis: AxisId, grows: bool, stroke: R, side: PistonSide<R>) {
        let offset = if grows { R::zero() } else { stroke };
        let PistonSide { area, perimeter, end_wall } = side;
        let part = Face {
            area,
            perimeter,
            end_wall,
            sign: if grows { R::one() } else { -R::one() },
            offset,
            gas: gas.0,
            axis: axis.0,
            grows,
            held: self.is_reservoir(gas),
        };
        self.parts.faces.push((Place::default(), part));
    }

    /// Adds end stops of an axis, one at x = 0 and one at x = `stroke`, m.
    pub fn end_stops(&mut self, axis: AxisId, law: physics::mechanics::EndStop<R>, stroke: R) {
        let part = EndStops { law, covers: None, stroke, axis: axis.0, follows: None };
        self.parts.end_stops.push((Place::default(), part));
    }

    /// Adds a spring between an axis and the ground: stiffness, N/m, and the position without force, m.
    pub fn spring(&mut self, axis: AxisId, stiffness: R, rest_position: R) {
        self.parts.springs.push((Place::default(), Spring { stiffness, rest_position, axis: axis.0 }));
    }

    /// Adds a spring and a damper between two axes.
    pub fn link(&mut self, from: AxisId, to: AxisId, stiffness: R, damping: R) -> PartId {
        self.add(Link { stiffness, damping, from: from.0, to: to.0 })
    }

    /// Joins each axis with its two chambers and end stops into one part, if it has them. The equations stay the same
    /// but are evaluated together. A cylinder with a cushion stays unchanged, with the covers in its equations, because
    /// part of its outflow enters the volumes behind the covers.
    fn join_cylinders(&mut self) {
        let parts = &mut self.parts;
        for (place, axis) in std::mem::take(&mut parts.axes) {
            let own: Vec<usize> =
                (0..parts.faces.len()).filter(|&i| parts.faces[i].1.axis == axis.node).collect();
            let stops = parts.end_stops.iter().position(|(_, stops)| stops.axis == axis.node);
            let chamber = |grows: bool| {
                let mut faces = own.iter().filter(|&&i| parts.faces[i].1.grows == grows);
                let face = *faces.next()?;
                let gas = parts.faces[face].1.gas;
                let alone = parts.faces.iter().filter(|(_, face)| face.gas == gas).count() == 1;
                let volume = parts.volumes.iter().position(|(_, volume)| volume.node == gas)?;
                (faces.next().is_none() && alone).then_some((face, volume))
            };
            let cushioned = parts.cushions.iter().any(|(_, cushion)| cushion.axis == axis.node);
            let (Some((face_a, volume_a)), Some((face_b, volume_b)), Some(stops), false) =
                (chamber(true), chamber(false), stops, cushioned)
            else {
                if let Some(stops) = stops {
                    (0..R::L).for_each(|lane| parts.end_stops[stops].1.meet(lane));
                }
                parts.axes.push((place, axis));
                continue;
            };
            let volumes = [parts.volumes[volume_a].1.clone(), parts.volumes[volume_b].1.clone()];
            let faces = [parts.faces[face_a].1.clone(), parts.faces[face_b].1.clone()];
            let stops = parts.end_stops.remove(stops).1;
            let (a, b) = (volumes[0].node, volumes[1].node);
            parts.volumes.retain(|(_, volume)| volume.node != a && volume.node != b);
            parts.faces.retain(|(_, face)| face.gas != a && face.gas != b);
            if axis.is_usual() && self.common.gas.virial.is_none() {
                parts.cylinders.push((place, Cylinder::new(axis, volumes, faces, stops)));
            } else {
                parts.other_cylinders.push((place, OtherCylinder::new(axis, volumes, faces, stops)));
            }
        }
        for (_, platform) in &parts.platforms {
            let own = parts.end_stops.iter_mut().filter(|(_, stops)| platform.nodes.contains(&stops.axis));
            own.for_each(|(_, stops)| (0..R::L).for_each(|lane| stops.meet(lane)));
        }
    }
}

impl<R: Lane> Circuit<R> {
    /// Finishes the circuit by reusing the analysis of a circuit with the same parts; `None` if the parts differ.
    pub(crate) fn build_like(mut self, other: &Circuit<f64>) -> Option<Self> {
        if self.shape != other.shape {
            return None;
        }
        self.join_cylinders();
        let scale = self.parts.lay_out_like(&other.parts)?;
        self.scale = scale.into_iter().map(R::c).collect();
        self.scale.resize(other.scale.len(), R::c(f64::INFINITY));
        self.topology = other.topology.clone();
        self.called = Called::default();
        self.parts.restrictions.iter_mut().for_each(|(_, restriction)| restriction.closed = true);
        Some(self.fuse())
    }
}

impl<R: Lane> Circuit<R>
where
    Deps: Over<R>,
{
    /// Finishes the circuit. With `ledger`, its balances of mass, energy and entropy are integrated too. They change
    /// neither a step nor a bit of the states.
    pub fn build(mut self, ledger: bool) -> Self {
        self.join_cylinders();
        let (states, channels) = self.parts.lay_out(&std::mem::take(&mut self.called));
        let n_states = states.len();
        let (names, mut scale): (Vec<_>, Vec<_>) =
            states.into_iter().map(|(name, state)| ((name, state.unit), state.scale.min(f64::MAX))).unzip();
        let channels = if ledger { channels } else { Vec::new() };
        scale.extend(channels.iter().map(|_| f64::INFINITY));
        let events = self.parts.events();
        let topology = |structure| Topology { names, n_states, channels, structure, events };
        // The pattern assumes that everything is open, so that it holds for every input and mode.
        self.open = (0..self.parts.restrictions.len()).collect();
        self.topology = Arc::new(topology(Arc::new(Structure::of(|_, _| (), &[], false))));
        self.scale = scale.iter().map(|&scale| R::c(scale)).collect();
        let mut net = self.work::<Deps>();
        let rates = |y: &[Deps], dy: &mut [Deps]| self.rhs(Deps::c(0.0), y, dy, &mut net);
        let structure = Arc::new(Structure::of(rates, &scale, false));
        Arc::get_mut(&mut self.topology).expect("not shared yet").structure = structure;
        self.open.clear();
        self.parts.restrictions.iter_mut().for_each(|(_, restriction)| restriction.closed = true);
        self.fuse()
    }
}

impl Circuit<f64> {
    /// A servo axis. The inputs of its part are its jerk, m/s3, and whether it yields.
    pub fn servo(&mut self, carriage: Carriage<f64>) -> (AxisId, PartId) {
        let axis = self.driven();
        (axis, self.add(Carriage { node: axis.0, ..carriage }))
    }
}

impl<R: Lane> Circuit<R> {
    /// Returns the state with every volume at (p Pa, T K) and every axis at (x m, v m/s), with zero inner states. Sets
    /// the modes of friction that belong to these values.
    pub fn initial(&mut self, gas: &[(GasId, R, R)], axes: &[(AxisId, R, R)]) -> Vec<R> {
        self.begin(&Given { gas, axes, ages: &[], inner: &[], signals: &[] })
    }

    /// Starts from a given state: sets the modes that belong to it, and designs the derived end stops.
    pub fn begin(&mut self, given: &Given<R>) -> Vec<R> {
        if let Some(start) =
            given.gas.iter().map(|(_, pressure, _)| *pressure).reduce(|one, other| one.max(other))
        {
            self.lay_out_stops(start);
        }
        let mut y = vec![R::zero(); self.scale.len()];
        let mut net = self.work::<R>();
        self.parts.begin(given, &mut y, &net, &self.common);
        self.parts.place(&y, &mut net, &self.common);
        self.parts.shape(&mut net);
        self.parts.begin(given, &mut y, &net, &self.common);
        self.find_modes(&mut y);
        y
    }

    /// Sets the modes that belong to state `y`, and the values of the state that these modes prescribe.
    pub fn find_modes(&mut self, y: &mut [R]) {
        if self.topology.events.is_empty() {
            return;
        }
        let mut net = self.work::<R>();
        self.evaluate(y, &mut net);
        for &id in &self.topology.events {
            self.parts.find_mode(id, y, &net);
        }
    }
}
