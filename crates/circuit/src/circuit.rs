//! Parts and nodes as one system of equations.

use crate::ledger::Channel;
use crate::net::Net;
use crate::part::cylinder::{CHAMBERS, INNER};
use crate::part::*;
use math::{Deps, Lane, Over, Real};
use ode::{Structure, System};
use physics::friction::AnyLaw;
use physics::{IdealGas, STANDARD_GRAVITY};
use std::sync::Arc;

/// A gas node of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GasId(pub(crate) usize);
/// An axis of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisId(pub(crate) usize);
/// A restriction of a circuit, to set its opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RestrictionId(pub(crate) usize);
/// A carriage of a circuit, to set its jerk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CarriageId(pub(crate) usize);

/// Geometry of one side of a piston and of the chamber before it.
#[derive(Clone, Copy, Debug)]
pub struct PistonSide {
    /// Area on which the gas presses, m2.
    pub area: f64,
    /// Wetted perimeter of barrel and rod, m.
    pub perimeter: f64,
    /// Wetted end faces, m2.
    pub end_wall: f64,
}

impl PistonSide {
    pub fn new(area: f64, perimeter: f64, end_wall: f64) -> Self {
        PistonSide { area, perimeter, end_wall }
    }
}

/// What does not change while a circuit runs; shared by all its copies.
#[derive(Debug)]
struct Topology {
    names: Vec<String>,
    n_states: usize,
    channels: Vec<Channel>,
    structure: Arc<Structure>,
    /// Masses whose friction law has modes, one event each.
    sticking: Vec<Mover>,
}

/// Where a mass with friction is kept.
#[derive(Clone, Copy, Debug)]
enum Mover {
    Axis(usize),
    Cylinder(usize),
}

/// A system of equations made of parts. `P` is `f64`, or lanes: one drive in each.
#[derive(Clone, Debug)]
pub struct Circuit<P> {
    topology: Arc<Topology>,
    parts: Parts<P>,
    common: Common<P>,
    /// Absolute error scale of each state and account: a part's own numbers, so a lane's own.
    scale: Vec<P>,
    /// Restrictions that are open in some lane.
    open: Vec<usize>,
    gas_nodes: usize,
    axis_nodes: usize,
}

impl Circuit<f64> {
    /// An empty circuit; the ambient pressure Pa acts on the outside of every piston.
    pub fn new(gas: &IdealGas<f64>, ambient_pressure: f64, ambient_temperature: f64) -> Self {
        Circuit {
            topology: Arc::new(Topology {
                names: Vec::new(),
                n_states: 0,
                channels: Vec::new(),
                structure: Arc::new(Structure::of(&[], &[], false)),
                sticking: Vec::new(),
            }),
            parts: Parts::default(),
            common: Common { gas: *gas, ambient_pressure, ambient_temperature },
            scale: Vec::new(),
            open: Vec::new(),
            gas_nodes: 0,
            axis_nodes: 0,
        }
    }

    fn next_gas(&mut self) -> usize {
        self.gas_nodes += 1;
        self.gas_nodes - 1
    }

    fn next_axis(&mut self) -> usize {
        self.axis_nodes += 1;
        self.axis_nodes - 1
    }

    /// Gas at constant pressure Pa and temperature K.
    pub fn reservoir(&mut self, pressure: f64, temperature: f64) -> GasId {
        let node = self.next_gas();
        self.parts.reservoirs.push((Place::default(), Reservoir { pressure, temperature, node }));
        GasId(node)
    }

    /// A volume that obeys `law`: a tank, or the dead volume of a chamber that faces enlarge.
    pub fn volume(
        &mut self,
        law: ChamberLaw,
        dead_volume: f64,
        dead_wall: f64,
        heat_transfer: f64,
        wall_temperature: f64,
    ) -> GasId {
        let node = self.next_gas();
        let mut part =
            Volume { dead_volume, dead_wall, heat_transfer, wall_temperature, node, law, scales: [1.0; 2] };
        part.set_scales(self.common.gas.heat_capacity_ratio, self.common.gas.gas_constant);
        self.parts.volumes.push((Place::default(), part));
        GasId(node)
    }

    fn is_reservoir(&self, id: GasId) -> bool {
        self.parts.reservoirs.iter().any(|(_, part)| part.node == id.0)
    }

    /// A restriction between two gas nodes, closed at first.
    pub fn restriction(&mut self, law: physics::flow::Iso6358<f64>, from: GasId, to: GasId) -> RestrictionId {
        let part = Restriction {
            law,
            opening: 0.0,
            from: from.0,
            to: to.0,
            from_boundary: self.is_reservoir(from),
            to_boundary: self.is_reservoir(to),
        };
        self.parts.restrictions.push((Place::default(), part));
        RestrictionId(self.parts.restrictions.len() - 1)
    }

    /// A mass on a line inclined by `incline` rad (positive: x points up), with a constant force in +x.
    pub fn axis(
        &mut self,
        mass: f64,
        incline: f64,
        external_force: f64,
        friction: Option<AnyLaw<f64>>,
        seal_lips: Option<physics::friction::SealLips<f64>>,
    ) -> AxisId {
        let node = self.next_axis();
        let weight = mass * STANDARD_GRAVITY * math::elementary::sin(incline);
        let part = Axis {
            mass,
            inverse_mass: 1.0 / mass,
            weight,
            external_force,
            friction,
            seal_lips,
            mode: 0.0,
            node,
        };
        self.parts.axes.push((Place::default(), part));
        AxisId(node)
    }

    /// A servo axis driven by its jerk.
    pub fn carriage(&mut self) -> (AxisId, CarriageId) {
        let node = self.next_axis();
        self.parts.carriages.push((Place::default(), Carriage { jerk: 0.0, node }));
        (AxisId(node), CarriageId(self.parts.carriages.len() - 1))
    }

    /// One side of a piston: `grows` where the chamber grows with x, else it ends at `stroke` m.
    pub fn face(&mut self, gas: GasId, axis: AxisId, grows: bool, stroke: f64, side: PistonSide) {
        let offset = if grows { 0.0 } else { stroke };
        let PistonSide { area, perimeter, end_wall } = side;
        let part = Face {
            area,
            perimeter,
            end_wall,
            offset,
            gas: gas.0,
            axis: axis.0,
            grows,
            held: self.is_reservoir(gas),
        };
        self.parts.faces.push((Place::default(), part));
    }

    pub fn end_stops(&mut self, axis: AxisId, law: physics::mechanics::EndStop<f64>, stroke: f64) {
        self.parts.end_stops.push((Place::default(), EndStops { law, stroke, axis: axis.0 }));
    }

    pub fn spring(&mut self, axis: AxisId, stiffness: f64, rest_position: f64) {
        self.parts.springs.push((Place::default(), Spring { stiffness, rest_position, axis: axis.0 }));
    }

    /// Spring and damper between two axes; returns its index among the links.
    pub fn link(&mut self, from: AxisId, to: AxisId, stiffness: f64, damping: f64) -> usize {
        let driven = self.parts.carriages.iter().any(|(_, part)| part.node == from.0);
        let part = Link { stiffness, damping, from: from.0, to: to.0, driven };
        self.parts.links.push((Place::default(), part));
        self.parts.links.len() - 1
    }

    /// Finishes the circuit; with `ledger`, its mass, energy and entropy accounts are integrated along
    /// without touching a step or a bit of the states.
    pub fn build(mut self, ledger: bool) -> Self {
        self.join_cylinders();
        let (states, channels) = self.parts.lay_out();
        let n_states = states.len();
        let (names, mut scale): (Vec<_>, Vec<_>) =
            states.into_iter().map(|(name, state)| (format!("{name} [{}]", state.unit), state.scale)).unzip();
        let channels = if ledger { channels } else { Vec::new() };
        scale.extend(channels.iter().map(|_| f64::INFINITY));
        let sticking = self.movers().filter(|&mover| self.mover(mover).1.sticks()).collect();
        let topology = |structure| Topology { names, n_states, channels, structure, sticking };
        // The pattern is that of everything open: it holds for every input and mode.
        self.open = (0..self.parts.restrictions.len()).collect();
        self.topology = Arc::new(topology(Arc::new(Structure::of(&[], &[], false))));
        self.scale = scale;
        let n = self.scale.len();
        let y: Vec<Deps> = (0..n).map(Deps::of).collect();
        let mut dy = vec![Deps::c(0.0); n];
        let mut net = self.work::<Deps>();
        self.rhs(Deps::c(0.0), &y, &mut dy, &mut net);
        let structure = Arc::new(Structure::of(&dy, &self.scale, false));
        Arc::get_mut(&mut self.topology).expect("not shared yet").structure = structure;
        self.open.clear();
        self
    }

    /// Joins each axis that stands between two chambers of its own, with end stops, into one part: the
    /// same equations, evaluated together.
    fn join_cylinders(&mut self) {
        let parts = &mut self.parts;
        for (_, axis) in std::mem::take(&mut parts.axes) {
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
            let (Some((face_a, volume_a)), Some((face_b, volume_b)), Some(stops)) =
                (chamber(true), chamber(false), stops)
            else {
                parts.axes.push((Place::default(), axis));
                continue;
            };
            let cylinder = Cylinder {
                axis,
                volumes: [parts.volumes[volume_a].1.clone(), parts.volumes[volume_b].1.clone()],
                faces: [parts.faces[face_a].1.clone(), parts.faces[face_b].1.clone()],
                stops: parts.end_stops.remove(stops).1,
            };
            let (a, b) = (cylinder.volumes[0].node, cylinder.volumes[1].node);
            parts.volumes.retain(|(_, volume)| volume.node != a && volume.node != b);
            parts.faces.retain(|(_, face)| face.gas != a && face.gas != b);
            parts.cylinders.push((Place::default(), cylinder));
        }
    }

    /// The state with every volume at (p Pa, T K) and every axis at (x m, v m/s); inner states zero.
    /// Sets the modes of friction to match.
    pub fn initial(&mut self, gas: &[(GasId, f64, f64)], axes: &[(AxisId, f64, f64)]) -> Vec<f64> {
        let mut y = vec![0.0; self.scale.len()];
        for &(id, x, v) in axes {
            let movers =
                self.movers().map(|mover| self.mover(mover)).map(|(place, axis, _)| (place, axis.node));
            let carriages = self.parts.carriages.iter().map(|(place, part)| (*place, part.node));
            let found = movers.chain(carriages).find(|(_, node)| *node == id.0);
            let place = found.expect("an axis of this circuit").0;
            (y[place.first], y[place.first + 1]) = (x, v);
        }
        let mut net = self.work::<f64>();
        self.parts.place(&y, &mut net, &self.common);
        self.parts.shape(&mut net);
        for &(id, p, t) in gas {
            let tanks = self.parts.volumes.iter().map(|(place, volume)| (place.first, volume));
            let chambers = self.parts.cylinders.iter().flat_map(|(place, cylinder)| {
                CHAMBERS.iter().zip(&cylinder.volumes).map(|(offset, volume)| (place.first + offset, volume))
            });
            let (first, part) =
                tanks.chain(chambers).find(|(_, part)| part.node == id.0).expect("a volume of this circuit");
            let values = match part.law {
                ChamberLaw::EnergyBalance => {
                    physics::chamber::EnergyBalance::initial(&self.common.gas, p, t, net.gas[id.0].volume)
                }
                ChamberLaw::AsPrinted => [p, t],
            };
            y[first..first + 2].copy_from_slice(&values);
        }
        self.evaluate(&y, &mut net);
        for &mover in &self.topology.clone().sticking {
            let (place, axis) = self.mover_mut(mover);
            let v = y[place.first + 1];
            axis.mode = if v == 0.0 { 0.0 } else { v.signum() };
            if v == 0.0 && axis.event(&net) < 0.0 {
                axis.switch(0, &mut y[place.first + 1], &net);
            }
        }
        y
    }
}

impl<R: Lane> Circuit<R> {
    /// One circuit of lanes: lane `i` is `each[i]`; all must have the same parts.
    pub fn gather(each: &[&Circuit<f64>]) -> Self {
        assert_eq!(each.len(), R::L, "one circuit for each lane");
        let number = |f: &dyn Fn(&Common<f64>) -> f64| R::from_lanes(|lane| f(&each[lane].common));
        Circuit {
            topology: each[0].topology.clone(),
            parts: Parts::gather(&each.iter().map(|circuit| &circuit.parts).collect::<Vec<_>>()),
            common: Common {
                gas: IdealGas::gather(&each.iter().map(|circuit| &circuit.common.gas).collect::<Vec<_>>()),
                ambient_pressure: number(&|c| c.ambient_pressure),
                ambient_temperature: number(&|c| c.ambient_temperature),
            },
            scale: (0..each[0].scale.len()).map(|i| R::from_lanes(|lane| each[lane].scale[i])).collect(),
            open: {
                let mut open: Vec<usize> = each.iter().flat_map(|circuit| circuit.open.clone()).collect();
                open.sort_unstable();
                open.dedup();
                open
            },
            gas_nodes: each[0].gas_nodes,
            axis_nodes: each[0].axis_nodes,
        }
    }

    /// Opens a restriction in one lane: 0 closed, 1 full.
    pub fn set_opening(&mut self, id: RestrictionId, lane: usize, opening: f64) {
        let restriction = &mut self.parts.restrictions[id.0].1;
        restriction.opening.put(lane, opening);
        let is_open = (0..R::L).any(|lane| restriction.opening.get(lane) != 0.0);
        // Kept in order: sums of flows do not depend on when an edge opened.
        match (self.open.binary_search(&id.0), is_open) {
            (Err(at), true) => self.open.insert(at, id.0),
            (Ok(at), false) => drop(self.open.remove(at)),
            _ => {}
        }
    }

    /// Sets the jerk of a carriage in one lane, m/s3.
    pub fn set_jerk(&mut self, id: CarriageId, lane: usize, jerk: f64) {
        self.parts.carriages[id.0].1.jerk.put(lane, jerk);
    }

    /// The name and unit of each state.
    pub fn state_names(&self) -> &[String] {
        &self.topology.names
    }

    /// The volume, m3, of a gas node that has none left at state `y`.
    pub fn vanished(&self, y: &[R]) -> Option<f64> {
        let mut net = self.work::<R>();
        self.evaluate(y, &mut net);
        let volumes = net.gas.iter().flat_map(|node| (0..R::L).map(|lane| node.volume.get(lane)));
        volumes.filter(|volume| *volume < 0.0).min_by(f64::total_cmp)
    }

    /// How many states there are beside the accounts.
    pub fn n_states(&self) -> usize {
        self.topology.n_states
    }

    pub fn channels(&self) -> &[Channel] {
        &self.topology.channels
    }

    /// The nodes at state `y`, with flows, forces and accelerations.
    pub fn observe(&self, y: &[R], net: &mut Net<R>) {
        let mut rates = std::mem::take(&mut net.rates);
        rates.resize(self.topology.n_states, R::zero());
        self.evaluate(y, net);
        self.parts.rate(y, &mut rates, net, &self.common);
        net.rates = rates;
    }

    /// Force of a link at the nodes, N in +x on its second axis.
    pub fn link_force(&self, link: usize, net: &Net<R>) -> R {
        self.parts.links[link].1.force(net)
    }

    /// Mode of an axis' friction: -1, 0, +1.
    pub fn mode(&self, axis: AxisId) -> R {
        self.mover(self.find(axis)).1.mode
    }

    /// The inner states of an axis' friction within `y`.
    pub fn inner_states<'y>(&self, axis: AxisId, y: &'y [R]) -> &'y [R] {
        let (place, _, inner) = self.mover(self.find(axis));
        &y[place.first + inner..place.first + place.count]
    }

    /// (mass, energy, entropy of the gas) stored at state `y`.
    pub fn stored(&self, y: &[R]) -> [R; 3] {
        let mut net = self.work::<R>();
        self.observe(y, &mut net);
        self.parts.stored(y, &net, &self.common)
    }

    /// What is stored at state `y` (accounts included), and every account.
    pub fn books(&self, y: &[R]) -> ([R; 3], Vec<R>) {
        let mut net = self.work::<R>();
        self.observe(y, &mut net);
        let mut accounts = vec![R::zero(); self.channels().len()];
        self.parts.standing(&net, &self.common, &mut accounts);
        for (account, integral) in accounts.iter_mut().zip(&y[self.n_states()..]) {
            *account += *integral;
        }
        (self.parts.stored(y, &net, &self.common), accounts)
    }
}

impl<P: Real> Circuit<P> {
    fn movers(&self) -> impl Iterator<Item = Mover> + use<P> {
        let axes = (0..self.parts.axes.len()).map(Mover::Axis);
        axes.chain((0..self.parts.cylinders.len()).map(Mover::Cylinder))
    }

    /// The place of a mass (x and v come first), the mass, and the offset of its inner states.
    fn mover(&self, mover: Mover) -> (Place, &Axis<P>, usize) {
        match mover {
            Mover::Axis(i) => (self.parts.axes[i].0, &self.parts.axes[i].1, 2),
            Mover::Cylinder(i) => (self.parts.cylinders[i].0, &self.parts.cylinders[i].1.axis, INNER),
        }
    }

    fn mover_mut(&mut self, mover: Mover) -> (Place, &mut Axis<P>) {
        match mover {
            Mover::Axis(i) => (self.parts.axes[i].0, &mut self.parts.axes[i].1),
            Mover::Cylinder(i) => (self.parts.cylinders[i].0, &mut self.parts.cylinders[i].1.axis),
        }
    }

    fn find(&self, axis: AxisId) -> Mover {
        self.movers().find(|&mover| self.mover(mover).1.node == axis.0).expect("an axis of this circuit")
    }

    #[inline(always)]
    fn evaluate<S: Over<P>>(&self, y: &[S], net: &mut Net<S>) {
        self.parts.place(y, net, &self.common);
        self.parts.shape(net);
        self.parts.potential(y, net, &self.common);
        for &i in &self.open {
            self.parts.restrictions[i].1.pass(net);
        }
        self.parts.exchange(net, &self.common);
    }
}

impl<R: Lane> System<R> for Circuit<R> {
    type Work<S: Over<R>> = Net<S>;

    fn work<S: Over<R>>(&self) -> Net<S> {
        let mut net = Net::new(self.gas_nodes, self.axis_nodes, S::from(self.common.gas.cp));
        for (_, reservoir) in &self.parts.reservoirs {
            reservoir.fill(&mut net);
        }
        net
    }

    #[inline(never)]
    fn rhs<S: Over<R>>(&self, _t: S, y: &[S], dy: &mut [S], net: &mut Net<S>) {
        self.evaluate(y, net);
        self.parts.rate(y, dy, net, &self.common);
        if !self.topology.channels.is_empty() {
            let accounts = &mut dy[self.topology.n_states..];
            self.parts.account(y, net, &self.common, accounts);
        }
    }

    fn structure(&self) -> &Arc<Structure> {
        &self.topology.structure
    }

    fn scale(&self) -> &[R] {
        &self.scale
    }

    fn n_events(&self) -> usize {
        self.topology.sticking.len()
    }

    fn events(&self, _t: R, y: &[R], out: &mut [R], net: &mut Net<R>) {
        self.evaluate(y, net);
        for (out, &i) in out.iter_mut().zip(&self.topology.sticking) {
            *out = self.mover(i).1.event(net);
        }
    }

    /// Newton in stick, m/s in slip: 1e-9 of either is far below what any step resolves.
    fn event_tolerance(&self, _event: usize) -> f64 {
        1e-9
    }

    fn n_obstacles(&self) -> usize {
        2 * self.parts.cylinders.len()
    }

    fn obstacles(&self, y: &[R], out: &mut [R]) {
        for ((place, cylinder), out) in self.parts.cylinders.iter().zip(out.chunks_exact_mut(2)) {
            let x = y[place.first];
            out.copy_from_slice(&[x, cylinder.stops.stroke - x]);
        }
    }

    fn switch(&mut self, lane: usize, event: usize, y: &mut [R], net: &mut Net<R>) {
        self.evaluate(y, net);
        let (place, axis) = self.mover_mut(self.topology.sticking[event]);
        axis.switch(lane, &mut y[place.first + 1], net);
    }
}
