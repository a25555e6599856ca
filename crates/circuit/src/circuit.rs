//! Parts and nodes as one system of equations.

mod build;
mod fused;

use crate::impacts::{Impacts, Mover};
use crate::ledger::Channel;
use crate::net::{AxisNode, Net};
use crate::part::mechanics::cylinder::{CHAMBERS, INNER};
use crate::part::*;
pub(crate) use fused::glance;
use fused::{Fused, Linearised, Rates};
use math::{Lane, Over, Real, Work};
use ode::{Accepted, Dense, Structure, System};
use physics::Gas;
use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A gas node of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GasId(pub(crate) usize);
/// An axis of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisId(pub(crate) usize);
/// A carriage of a circuit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CarriageId(pub(crate) usize);

/// A flow path of a circuit, and the direction in which its flow is positive.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    kind: PartKind,
    index: usize,
    /// A single path, also if its part has several.
    path: usize,
    backward: bool,
}

impl Path {
    /// The path of a restriction.
    pub fn of(opening: InputId) -> Self {
        Path { kind: opening.kind, index: opening.index, path: 0, backward: false }
    }

    /// One of the paths of a part.
    pub fn along(part: PartId, path: usize) -> Self {
        Path { kind: part.kind, index: part.index, path, backward: false }
    }

    /// Returns the same path with the flow positive in the other direction.
    #[must_use]
    pub fn backward(self) -> Self {
        Path { backward: !self.backward, ..self }
    }
}

impl GasId {
    pub(crate) fn index(self) -> usize {
        self.0
    }
}

impl AxisId {
    pub(crate) fn index(self) -> usize {
        self.0
    }
}

impl CarriageId {
    /// Jerk, m/s3.
    pub fn jerk(self) -> InputId {
        InputId { kind: PartKind::Carriage, index: self.0, input: 0 }
    }

    /// Compliance flag of a motor: 1 lets it deflect under the force, 0 keeps it at its command.
    pub fn giving_way(self) -> InputId {
        InputId { input: 1, ..self.jerk() }
    }
}

/// Shortage of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lacking {
    Room,
    Gas,
}

impl Lacking {
    /// Fraction at which a volume has none left.
    pub fn least(self) -> f64 {
        match self {
            Lacking::Room => gas::volume::LEAST_ROOM,
            Lacking::Gas => gas::volume::LEAST_GAS,
        }
    }
}

/// A volume with little room or gas left. The amount is relative to its dead volume, or to the gas in the dead volume
/// at standard conditions.
#[derive(Clone, Debug)]
pub struct Scarce {
    /// Name of the volume: "left.a", or "chamber a" of a drive.
    pub volume: String,
    pub what: Lacking,
    pub share: f64,
}

/// Geometry of one side of a piston and of its chamber.
#[derive(Clone, Copy, Debug)]
pub struct PistonSide<P = f64> {
    /// Area on which the gas presses, m2.
    pub area: P,
    /// Wetted perimeter of barrel and rod, m.
    pub perimeter: P,
    /// Wetted end faces, m2.
    pub end_wall: P,
}

impl<P> PistonSide<P> {
    /// Creates a face with an area, m2, a perimeter, m, and end faces, m2.
    pub fn new(area: P, perimeter: P, end_wall: P) -> Self {
        PistonSide { area, perimeter, end_wall }
    }
}

impl<P: Real> PistonSide<P> {
    /// Creates the face of a bore, m, with a rod of this diameter, m (0: no rod). Heat passes through the barrel, both
    /// end faces and the rod. The dead volume has no additional surface.
    pub fn of_bore(bore: P, rod: P) -> Self {
        let area = P::c(0.25 * PI) * (bore * bore - rod * rod);
        PistonSide { area, perimeter: P::c(PI) * (bore + rod), end_wall: P::c(2.0) * area }
    }
}

/// The constant part of a circuit, shared by all its copies.
#[derive(Debug)]
struct Topology {
    /// The name and unit of each state.
    names: Vec<(String, &'static str)>,
    n_states: usize,
    channels: Vec<Channel>,
    structure: Arc<Structure>,
    events: Vec<EventId>,
}

/// A system of equations made of parts. `P` is `f64`, or lanes with one drive each, or a dual number with derivatives.
#[derive(Clone, Debug)]
pub struct Circuit<P> {
    topology: Arc<Topology>,
    parts: Parts<P>,
    common: Common<P>,
    /// Absolute error scale of each state and balance. It depends on the numbers of the parts, so each lane has its own
    /// scale.
    scale: Vec<P>,
    /// Restrictions that are open in at least one lane.
    open: Vec<usize>,
    gas_nodes: usize,
    axis_nodes: usize,
    signals: usize,
    /// Names of parts and nodes, until the circuit is built.
    called: Called,
    /// Hash of the parts and their connections. It is the same for circuits that differ only in numbers.
    shape: u64,
    /// Unique number of the present values of its reservoirs.
    filled: u64,
    /// Evaluation without nodes, if the whole circuit allows it.
    fused: Option<Box<Fused<P>>>,
}

/// The nodes of a circuit at `y`.
struct Observe<'c, R: Lane> {
    circuit: &'c Circuit<R>,
    y: &'c [R],
    net: &'c mut Net<R>,
}

impl<R: Lane> Work for Observe<'_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        self.circuit.look_at(self.y, self.net);
    }
}

/// A mass: the kind and index of its part, the index of its state, the mass, and the offset of its inner states.
type Mass<'c, P> = (PartKind, usize, Place, &'c Axis<P>, usize);

/// Returns a number that was never used before.
fn next_filling() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}

impl<R: Lane> Circuit<R> {
    /// Returns one circuit of lanes. Lane `i` is `each[i]`. All must have the same parts.
    pub fn gather(each: &[&Circuit<f64>]) -> Self {
        assert_eq!(each.len(), R::L, "one circuit for each lane");
        let number = |f: &dyn Fn(&Common<f64>) -> f64| R::from_lanes(|lane| f(&each[lane].common));
        Circuit {
            topology: each[0].topology.clone(),
            parts: Parts::gather(&math::field(each, |circuit| &circuit.parts)),
            common: Common {
                gas: Gas::gather(&math::field(each, |circuit| &circuit.common.gas)),
                ambient_pressure: number(&|c| c.ambient_pressure),
                ambient_temperature: number(&|c| c.ambient_temperature),
            },
            scale: (0..each[0].scale.len()).map(|i| R::from_lanes(|lane| each[lane].scale[i])).collect(),
            open: {
                let restrictions = 0..each[0].parts.restrictions.len();
                restrictions.filter(|i| each.iter().any(|circuit| circuit.open.contains(i))).collect()
            },
            gas_nodes: each[0].gas_nodes,
            axis_nodes: each[0].axis_nodes,
            signals: each[0].signals,
            called: Called::default(),
            shape: each[0].shape,
            filled: next_filling(),
            fused: None,
        }
        .fuse()
    }

    /// Returns every input: its name with that of its part, its unit and its bounds.
    pub fn inputs(&self) -> Vec<(InputId, String, &'static Input)> {
        self.parts.inputs()
    }

    /// Sets an input in one lane, including derivatives.
    pub fn set_input(&mut self, id: InputId, lane: usize, value: R) {
        if id.kind == PartKind::Restriction {
            if self.set_opening(id.index, lane, value) {
                self.connect();
            }
            return;
        }
        self.parts.input_mut(id).take(lane, &value);
        if id.kind == PartKind::Reservoir {
            self.filled = next_filling();
            self.connect();
        }
    }

    /// Opens edges of one valve. They have the same kind.
    #[inline(always)]
    pub(crate) fn set_openings(&mut self, edges: &[InputId; 4], lane: usize, values: [R; 4]) {
        let is_usual = edges[0].kind == PartKind::Restriction;
        let mut others_open = false;
        for (edge, value) in edges.iter().zip(values) {
            if is_usual {
                others_open |= self.set_opening(edge.index, lane, value);
            } else {
                self.set_input(*edge, lane, value);
            }
        }
        if others_open {
            self.connect();
        }
    }

    /// Opens a restriction. Returns whether the set of open restrictions has changed, so that the evaluation without
    /// nodes needs an update.
    #[inline(always)]
    fn set_opening(&mut self, index: usize, lane: usize, value: R) -> bool {
        let Restriction { opening, closed, .. } = &mut self.parts.restrictions[index].1;
        opening.take(lane, &value);
        let is_open = (0..R::L).any(|lane| opening.get(lane) != 0.0)
            || (1..=R::DIRECTIONS).any(|direction| opening.part(direction) != 0.0);
        if *closed == is_open {
            *closed = !is_open;
            // The order is fixed, so that sums of flows do not depend on the time at which an edge opened.
            match self.open.binary_search(&index) {
                Err(at) => self.open.insert(at, index),
                Ok(at) => drop(self.open.remove(at)),
            }
            return true;
        }
        if is_open {
            self.widen(index);
        }
        false
    }

    /// The value of an input.
    pub fn input(&self, id: InputId) -> R {
        self.parts.input(id)
    }

    /// Returns its unit and bounds.
    pub fn what_input(&self, id: InputId) -> &'static Input {
        self.parts.what_input(id)
    }

    /// Returns whether `meet` has added contacts far behind the end of a stroke, in any lane.
    pub fn has_met(&self) -> bool {
        let usual = self.parts.cylinders.iter().any(|(_, cylinder)| cylinder.met);
        usual || self.parts.other_cylinders.iter().any(|(_, cylinder)| cylinder.met)
    }

    fn end_stops_mut(&mut self) -> impl Iterator<Item = &mut EndStops<R>> {
        let usual = self.parts.cylinders.iter_mut().map(|(_, cylinder)| &mut cylinder.stops);
        let others = self.parts.other_cylinders.iter_mut().map(|(_, cylinder)| &mut cylinder.stops);
        usual.chain(others).chain(self.parts.end_stops.iter_mut().map(|(_, stops)| stops))
    }

    /// Designs derived end stops for the highest pressure of a start, Pa absolute.
    pub(crate) fn lay_out_stops(&mut self, start: R) {
        self.end_stops_mut().for_each(|stops| stops.lay_out(start));
    }

    /// Returns the pressure for which they are designed, if any, Pa absolute.
    pub(crate) fn stops_laid_out_for(&self) -> Option<R> {
        let usual = self.parts.cylinders.iter().map(|(_, cylinder)| &cylinder.stops);
        let others = self.parts.other_cylinders.iter().map(|(_, cylinder)| &cylinder.stops);
        let mut each = usual.chain(others).chain(self.parts.end_stops.iter().map(|(_, stops)| stops));
        each.find_map(|stops| stops.follows.as_ref()).map(|follows| follows.start)
    }

    /// Visits the modes of all events. `each` may change them.
    pub fn change_modes(&mut self, mut each: impl FnMut(&mut R)) {
        for &id in &self.topology.events {
            each(self.parts.mode_mut(id));
        }
    }

    /// Copies its modes to a circuit of the same parts without derivatives.
    pub(crate) fn share_modes(&mut self, other: &mut Circuit<R::Plain>) {
        let mut modes = Vec::new();
        self.change_modes(|mode| modes.push(mode.plain()));
        let mut modes = modes.into_iter();
        other.change_modes(|mode| modes.next().into_iter().for_each(|own| *mode = own));
    }

    /// Returns the input for the external force on an axis, N in +x.
    pub fn external_force(&self, axis: AxisId) -> InputId {
        if let Some((index, input, ..)) = self.leg(axis) {
            return InputId { kind: PartKind::Platform, index, input };
        }
        let (kind, index, ..) = self.mass(axis);
        InputId { kind, index, input: 0 }
    }

    /// Returns the inputs for pressure, Pa absolute, and temperature, K, of a reservoir.
    pub fn boundary(&self, reservoir: GasId) -> [InputId; 2] {
        let index = self.parts.reservoirs.iter().position(|(_, part)| part.node == reservoir.0);
        let index = index.expect("a reservoir of this circuit");
        [0, 1].map(|input| InputId { kind: PartKind::Reservoir, index, input })
    }

    /// Returns whether it is evaluated without nodes in memory.
    pub fn is_fused(&self) -> bool {
        self.fused.is_some()
    }

    /// Returns whether it is evaluated without nodes and keeps no balances. In this case any scalar type works.
    pub(crate) fn serves_all(&self) -> bool {
        self.fused.is_some() && self.topology.channels.is_empty()
    }

    /// Returns whether two circuits share one analysis of their equations.
    pub fn shares_analysis<Q>(&self, other: &Circuit<Q>) -> bool {
        Arc::ptr_eq(&self.topology, &other.topology)
    }

    /// The name and unit of each state.
    pub fn state_names(&self) -> &[(String, &'static str)] {
        &self.topology.names
    }

    /// Returns the volume that has relatively the least room or gas left at state `y` of one lane.
    pub fn scarcest(&self, y: &[R], lane: usize) -> Option<Scarce> {
        let mut net = self.work::<R>();
        self.evaluate(y, &mut net);
        let each = self.volumes().flat_map(|(first, volume, name)| {
            let named = self.topology.names[first].0.rsplit_once('.').map_or(name, |(of, _)| of);
            let scarce = move |what, share| Scarce { volume: named.into(), what, share };
            let share = |value: R, of: R| value.get(lane) / of.get(lane);
            let room = net.gas[volume.node].volume;
            [
                scarce(Lacking::Room, share(room, volume.dead_volume)),
                scarce(Lacking::Gas, share(y[first], self.scale[first])),
                scarce(Lacking::Gas, share(y[first + 1], self.scale[first + 1])),
            ]
        });
        // Visits the volumes with their distance from the least room or gas.
        let near = |scarce: &Scarce| scarce.share / scarce.what.least();
        each.min_by(|a, b| near(a).total_cmp(&near(b)))
    }

    /// Returns the leg of a platform at the end of its reach in a lane, and the pose, in words.
    pub(crate) fn stretched(&self, y: &[R], lane: usize) -> Option<String> {
        self.parts.platforms.iter().find_map(|(place, platform)| {
            let leg = platform.stretched(&y[place.first..place.first + place.count], lane)?;
            let states = place.first..place.first + platform.nodes.len();
            let each = states.map(|i| format!("{} = {:.6}", self.topology.names[i].0, y[i].get(lane)));
            Some(format!(
                "leg {} is at the end of its reach at {}",
                leg + 1,
                each.collect::<Vec<_>>().join(", ")
            ))
        })
    }

    /// Returns the number of states of each component's parts. The circuit need not be built yet.
    pub(crate) fn count_states(&self) -> Vec<(&str, usize)> {
        let names = std::iter::once("").chain(self.called.owners.iter().map(String::as_str));
        names.zip(self.parts.count_states(self.called.owners.len())).collect()
    }

    /// Returns the first state of a part within `y`.
    pub(crate) fn part_state(&self, part: PartId, y: &[R]) -> R {
        y[self.parts.place_of(part).first]
    }

    /// Returns the number of states without the balances.
    pub fn n_states(&self) -> usize {
        self.topology.n_states
    }

    /// Returns the balances of the circuit.
    pub fn channels(&self) -> &[Channel] {
        &self.topology.channels
    }

    /// Returns the nodes at state `y`, with flows, forces and accelerations.
    pub fn observe(&self, y: &[R], net: &mut Net<R>) {
        R::within(Observe { circuit: self, y, net });
    }

    #[inline(always)]
    fn look_at(&self, y: &[R], net: &mut Net<R>) {
        self.renew(net);
        let mut rates = std::mem::take(&mut net.rates);
        rates.resize(self.topology.n_states, R::zero());
        self.evaluate(y, net);
        self.parts.rate(y, &mut rates, net, &self.common);
        net.rates = rates;
    }

    /// Returns the mass flow through a path at the nodes, kg/s.
    pub fn flow(&self, path: Path, net: &Net<R>) -> R {
        let flow = self.parts.flow((path.kind, path.index, path.path), net);
        if path.backward { -flow } else { flow }
    }

    /// Returns every path over the boundary, positive inward: paths that end in a reservoir, and compressors.
    pub(crate) fn inlets(&self) -> impl Iterator<Item = Path> {
        let paths = self.parts.paths().filter_map(|(kind, index, path, ends)| match ends.boundary {
            [true, false] => Some(Path { kind, index, path, backward: false }),
            [false, true] => Some(Path { kind, index, path, backward: true }),
            _ => None,
        });
        let compressors = self.parts.compressors.iter().enumerate();
        let compressors = compressors.filter(|(_, (_, own))| !own.boundary).map(|(index, _)| Path {
            kind: PartKind::Compressor,
            index,
            path: 0,
            backward: false,
        });
        paths.chain(compressors)
    }

    /// Returns the mass flow out of a node through all paths, kg/s, for a reservoir.
    pub fn flow_out_of(&self, node: GasId, net: &Net<R>) -> R {
        self.parts.paths().fold(R::zero(), |sum, (kind, index, path, ends)| {
            match (ends.from == node, ends.to == node) {
                (true, false) => sum + self.parts.flow((kind, index, path), net),
                (false, true) => sum - self.parts.flow((kind, index, path), net),
                _ => sum,
            }
        })
    }

    /// Returns the force of a part at the nodes, N. For a link it is the force in +x on its second axis.
    pub fn force_of(&self, part: PartId, net: &Net<R>) -> R {
        self.parts.force(part, net)
    }

    /// Returns a platform of the circuit.
    pub(crate) fn platform(&self, part: PartId) -> &Platform<R> {
        &self.parts.platforms[part.index].1
    }

    /// Returns the motion of a platform, by the index of its output, at state `y` and the nodes.
    pub(crate) fn pose(&self, part: PartId, output: usize, y: &[R], net: &Net<R>) -> R {
        let (place, platform) = &self.parts.platforms[part.index];
        let own = place.first..place.first + place.count;
        platform.motion(&y[own.clone()], &net.rates[own], output)
    }

    /// Returns the mode of an axis' friction: -1, 0, +1. The friction of a leg has no mode.
    pub fn mode(&self, axis: AxisId) -> R {
        self.leg(axis).map_or_else(|| self.mass(axis).3.mode, |_| R::zero())
    }

    /// Returns the inner states of an axis' friction within `y`.
    pub fn inner_states<'y>(&self, axis: AxisId, y: &'y [R]) -> &'y [R] {
        if let Some((_, leg, first, platform)) = self.leg(axis) {
            return &y[first..][platform.inner_range(leg)];
        }
        let (.., place, _, inner) = self.mass(axis);
        &y[place.first + inner..place.first + place.count]
    }

    /// Returns (mass, energy, entropy of the gas) stored at state `y`.
    pub fn stored(&self, y: &[R]) -> [R; 3] {
        let mut net = self.work::<R>();
        self.observe(y, &mut net);
        self.parts.stored(y, &net, &self.common)
    }

    /// Returns the energy of each store at state `y`, J: kinetic and potential energy and bristles of masses, volumes,
    /// and springs.
    pub fn stores(&self, y: &[R]) -> Vec<R> {
        let mut net = self.work::<R>();
        self.observe(y, &mut net);
        self.parts.stores(y, &net, &self.common)
    }

    /// Returns the stored quantities at state `y` (balances included), and every balance.
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

impl Circuit<f64> {
    /// Trackers of the impacts of each cylinder.
    pub(crate) fn impacts(&self) -> Vec<Impacts> {
        let usual = self.parts.cylinders.iter().map(|(place, part)| (place, &part.stops, &part.axis));
        let others = self.parts.other_cylinders.iter().map(|(place, part)| (place, &part.stops, &part.axis));
        let alone = self.parts.end_stops.iter().filter_map(|(_, stops)| {
            let (place, axis) = self.parts.axes.iter().find(|(_, axis)| axis.node == stops.axis)?;
            Some((place, stops, axis))
        });
        let each = usual.chain(others).chain(alone).map(|(place, stops, axis)| {
            let mut stops = stops.clone();
            stops.meet(0);
            Impacts::new(stops, Mover::Mass(axis.clone(), place.first))
        });
        let legs = self.parts.end_stops.iter().filter_map(|(_, stops)| {
            let (_, leg, first, platform) = self.leg(AxisId(stops.axis))?;
            Some(Impacts::new(stops.clone(), Mover::Leg(platform.clone(), first, leg)))
        });
        each.chain(legs).collect()
    }
}

impl<P: Real> Circuit<P> {
    /// Returns every mass: the kind and index of its part, its first state (x and v), the mass, and the offset of the
    /// inner states of its friction.
    fn masses(&self) -> impl Iterator<Item = Mass<'_, P>> {
        let axes = self.parts.axes.iter().enumerate();
        let usual = self.parts.cylinders.iter().enumerate();
        let others = self.parts.other_cylinders.iter().enumerate();
        let axes = axes.map(|(i, (place, axis))| (PartKind::Axis, i, *place, axis, 2));
        let usual = usual.map(|(i, (place, part))| (PartKind::Cylinder, i, *place, &part.axis, INNER));
        let others = others.map(|(i, (place, part))| (PartKind::OtherCylinder, i, *place, &part.axis, INNER));
        axes.chain(usual).chain(others)
    }

    /// Returns the leg of a platform that is this axis: index of the platform, of the leg, and of its first state.
    fn leg(&self, id: AxisId) -> Option<(usize, usize, usize, &Platform<P>)> {
        self.parts.platforms.iter().enumerate().find_map(|(index, (place, platform))| {
            let leg = platform.nodes.iter().position(|node| *node == id.0)?;
            Some((index, leg, place.first, platform))
        })
    }

    fn mass(&self, id: AxisId) -> Mass<'_, P> {
        self.masses().find(|(_, _, _, axis, _)| axis.node == id.0).expect("an axis of this circuit")
    }

    /// Returns the state index of an axis' position. Its velocity follows. `None` if the motion of the axis is
    /// commanded.
    pub fn position_state(&self, axis: AxisId) -> Option<usize> {
        let mut masses = self.masses();
        masses.find(|(.., own, _)| own.node == axis.0).map(|(_, _, place, ..)| place.first)
    }

    /// Returns the friction of steady sliding of an axis at the position, speed and pressures of a node, N.
    pub fn steady_friction<S: Over<P>>(&self, axis: AxisId, node: &AxisNode<S>) -> S {
        if let Some((_, leg, _, platform)) = self.leg(axis) {
            return platform.contacts[leg]
                .as_ref()
                .map_or(S::zero(), |own| own.steady(&mechanics::axis::at(node)));
        }
        self.mass(axis).3.steady_friction(node)
    }

    /// Returns every volume with the index of its two states, and its name for users.
    fn volumes(&self) -> impl Iterator<Item = (usize, &Volume<P>, &'static str)> {
        let tanks = self.parts.volumes.iter().map(|(place, volume)| (place.first, volume, "a volume"));
        let usual = self.parts.cylinders.iter().map(|(place, cylinder)| (place, &cylinder.volumes));
        let others = self.parts.other_cylinders.iter().map(|(place, cylinder)| (place, &cylinder.volumes));
        let chambers = usual.chain(others).flat_map(|(place, volumes)| {
            let sides = CHAMBERS.iter().zip(volumes).zip(["chamber a", "chamber b"]);
            sides.map(|((offset, volume), name)| (place.first + offset, volume, name))
        });
        tanks.chain(chambers)
    }

    /// This function is rarely needed, and therefore compiled separately from the code of each step.
    #[inline(never)]
    fn fill_reservoirs<S: Over<P>>(&self, net: &mut Net<S>) {
        for (_, reservoir) in &self.parts.reservoirs {
            reservoir.fill(net, &self.common);
        }
        net.filled = self.filled;
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

impl<R: Lane> Circuit<R> {
    /// Returns 1 if the chambers of every cylinder have room and gas at all states within `spread`. See
    /// [`cylinder::Cylinder::holds`].
    #[inline(always)]
    fn cylinders_hold(&self, y: &[R], spread: impl Fn(Place) -> [R::Plain; INNER]) -> R::Plain {
        let mut holds = R::Plain::one();
        macro_rules! ask {
            ($kind:ident) => {
                for (place, cylinder) in &self.parts.$kind {
                    let scale = Own::of(&self.scale, *place);
                    holds = cylinder.holds(Own::of(y, *place), &spread(*place), scale, holds);
                }
            };
        }
        ask!(cylinders);
        ask!(other_cylinders);
        holds
    }
}

impl<R: Lane> Circuit<R> {
    /// The result if the volumes are valid too.
    #[inline(never)]
    fn volumes_hold(&self, y: &[R], net: &mut Net<R>, so_far: R::Plain) -> R::Plain {
        let mut inside = so_far;
        self.parts.place(y, net, &self.common);
        self.parts.shape(net);
        for (place, volume) in &self.parts.volumes {
            let room = net.gas[volume.node].volume.plain();
            let (states, scales): ([R; 2], _) =
                (Own::of(y, *place).first(), Own::of(&self.scale, *place).first());
            let least = R::Plain::c(gas::volume::LEAST_ROOM);
            inside = volume.holds(room, states.map(|state| state.plain()), scales, least, inside);
        }
        inside
    }
}

impl<R: Lane> System<R> for Circuit<R> {
    type Work<S: Over<R>> = Net<S>;

    fn work<S: Over<R>>(&self) -> Net<S> {
        let mut net = Net::new(self.gas_nodes, self.axis_nodes, self.signals, S::from(self.common.gas.cp));
        if self.common.gas.virial.is_some() {
            net.enthalpy = vec![S::zero(); self.gas_nodes];
        }
        if !self.parts.platforms.is_empty() {
            net.known = vec![Vec::new(); 2 * self.axis_nodes];
        }
        self.renew(&mut net);
        net
    }

    #[inline(always)]
    fn renew<S: Over<R>>(&self, net: &mut Net<S>) {
        if net.filled != self.filled {
            self.fill_reservoirs(net);
        }
        net.known.iter_mut().for_each(Vec::clear);
    }

    #[inline(never)]
    fn rhs<S: Over<R>>(&self, _t: S, y: &[S], dy: &mut [S], net: &mut Net<S>) {
        self.evaluate(y, net);
        self.parts.rate(y, dy, net, &self.common);
        if R::GENERAL && !self.topology.channels.is_empty() {
            let (dy, accounts) = dy.split_at_mut(self.topology.n_states);
            self.parts.account(y, dy, net, &self.common, accounts);
        }
    }

    #[inline(never)]
    fn add_rates(&self, t: R, y: &[R], known: &[R], out: &mut [R], net: &mut Net<R>) {
        match &self.fused {
            Some(fused) if self.topology.channels.is_empty() => {
                R::within(Rates { circuit: self, fused, y, known, out });
            }
            _ if !R::GENERAL => unreachable!("derivatives by such numbers need a circuit without nodes"),
            _ => {
                self.rhs(t, y, out, net);
                for (out, known) in out.iter_mut().zip(known) {
                    *out += *known;
                }
            }
        }
    }

    #[inline(never)]
    fn linearise(&self, y: &[R], f: &mut [R], jacobian: &mut Dense<R>) -> bool {
        if let Some(fused) = &self.fused {
            R::within(Linearised { circuit: self, fused, y, f, jacobian });
        }
        self.fused.is_some()
    }

    fn swings(&self) -> Vec<(usize, R)> {
        let usual = self.parts.cylinders.iter().map(|(place, part)| (place, part.swing_speed(&self.common)));
        let others = self.parts.other_cylinders.iter();
        let others = others.map(|(place, part)| (place, part.swing_speed(&self.common)));
        usual.chain(others).map(|(place, speed)| (place.first + 1, speed)).collect()
    }

    fn completes(&self) -> bool {
        let damped = || {
            let legs = || self.parts.platforms.iter().any(|(_, platform)| platform.is_damped());
            self.masses().any(|(.., axis, _)| axis.is_damped()) || legs()
        };
        !self.topology.channels.is_empty() && damped()
    }

    fn complete(&self, step: &mut Accepted<'_, R>, out: &mut [R]) {
        for (.., place, axis, inner) in self.masses() {
            let account = self.topology.n_states + place.first_account;
            axis.damped_in(place.first, inner, step, &self.common, &mut out[account..account + 3]);
        }
        for (place, platform) in &self.parts.platforms {
            let account = self.topology.n_states + place.first_account;
            let own = &mut out[account..account + place.accounts];
            platform.damped_in(place.first, step, &self.common, own);
        }
    }

    fn structure(&self) -> &Arc<Structure> {
        &self.topology.structure
    }

    fn scale(&self) -> &[R] {
        &self.scale
    }

    fn n_events(&self) -> usize {
        self.topology.events.len()
    }

    fn events(&self, _t: R, y: &[R], out: &mut [R], net: &mut Net<R>) {
        self.evaluate(y, net);
        for (out, &id) in out.iter_mut().zip(&self.topology.events) {
            *out = self.parts.event(id, y, net);
        }
    }

    fn event_tolerance(&self, event: usize) -> f64 {
        self.parts.event_tolerance(self.topology.events[event])
    }

    fn n_obstacles(&self) -> usize {
        self.parts.n_obstacles()
    }

    fn obstacles(&self, y: &[R], out: &mut [R], net: &mut Net<R>) {
        self.parts.obstacles(y, net, &self.common, out);
    }

    #[inline(always)]
    fn inside(&self, y: &[R], net: &mut Net<R>) -> R::Plain {
        let mut inside = self.cylinders_hold(y, |_| [R::Plain::zero(); INNER]);
        if R::GENERAL {
            for (place, platform) in &self.parts.platforms {
                inside = inside.min(platform.reaches(&y[place.first..place.first + place.count]));
            }
        }
        if self.parts.volumes.is_empty() { inside } else { self.volumes_hold(y, net, inside) }
    }

    #[inline(always)]
    fn surely_inside(&self, y: &[R], spread: &[R::Plain]) -> R::Plain {
        if !self.parts.volumes.is_empty() || !self.parts.platforms.is_empty() {
            return -R::Plain::one();
        }
        self.cylinders_hold(y, |place| std::array::from_fn(|i| spread[place.first + i]))
    }

    fn meet(&mut self, lane: usize) -> bool {
        let usual = self.parts.cylinders.iter_mut().map(|(_, cylinder)| cylinder.meet(lane));
        let others = self.parts.other_cylinders.iter_mut().map(|(_, cylinder)| cylinder.meet(lane));
        usual.chain(others).fold(false, |met, own| met | own) // each is asked
    }

    fn settle(&self, y: &mut [R]) {
        for &id in &self.topology.events {
            self.parts.settle(id, y);
        }
    }

    fn switch(&mut self, lane: usize, event: usize, y: &mut [R], net: &mut Net<R>) {
        self.evaluate(y, net);
        let id = self.topology.events[event];
        let (common, n_states) = (self.common, self.n_states());
        let before: Vec<f64> = y[..n_states].iter().map(|state| state.get(lane)).collect();
        self.parts.switch(id, lane, y, net, (&common, n_states));
        // A mass that is brought to rest loses the forces that depend on its velocity, such as the damping of an end
        // stop. It stays at rest only if the remaining forces allow it.
        if y[..n_states].iter().zip(&before).any(|(state, before)| state.get(lane) != *before) {
            self.evaluate(y, net);
            if self.parts.event(id, y, net).get(lane) < -self.parts.event_tolerance(id) {
                self.parts.switch(id, lane, y, net, (&common, n_states));
            }
        }
    }
}
