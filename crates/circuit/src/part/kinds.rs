//! The kinds of part, and the loops of a circuit over its parts.

use super::names::{Called, PartLayout, PartNames, place, side_by_side};
use super::*;
use crate::ground::{
    Between, Channel, Common, Given, Input, Net, Own, OwnMut, Part, Place, State, Switching,
};
use math::{Lane, Over};

/// An input of a circuit: its part, and the index of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputId {
    pub(crate) part: PartId,
    pub(crate) input: usize,
}

/// A part of a circuit: its kind and index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartId {
    pub(crate) kind: PartKind,
    pub(crate) index: usize,
}

impl PartId {
    /// One of its inputs.
    pub fn input(self, input: usize) -> InputId {
        InputId { part: self, input }
    }
}

/// A flow path of a circuit, and the direction in which its flow is positive.
#[derive(Clone, Copy, Debug)]
pub struct Path {
    pub(crate) part: PartId,
    /// A single path, also if its part has several.
    path: usize,
    pub(crate) is_backward: bool,
}

impl Path {
    /// The path of a restriction.
    pub fn of(opening: InputId) -> Self {
        Path::along(opening.part, 0)
    }

    /// One of the paths of a part.
    pub fn along(part: PartId, path: usize) -> Self {
        Path { part, path, is_backward: false }
    }

    /// Returns the same path with the flow positive in the other direction.
    #[must_use]
    pub fn backward(self) -> Self {
        Path { is_backward: !self.is_backward, ..self }
    }
}

/// An event of a circuit: its part, and the index of the event.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventId {
    part: PartId,
    event: usize,
}

/// A part that a circuit keeps with those of its kind.
pub(crate) trait StoredPart<P: Lane>: Part<P> + Sized {
    const KIND: PartKind;

    fn kept(parts: &mut Parts<P>) -> &mut Vec<(Place, Self)>;
}

/// Lists the kinds of part: their storage, and the loops over every part of a circuit. The kinds of an ordinary drive
/// are `usual`. The loops over the others are separate functions, so that a circuit without them does not use registers
/// for them.
macro_rules! parts {
    (usual: $($usual:ident: $usual_part:ident),*; others: $($other:ident: $other_part:ident),* $(,)?) => {
        parts!(@storage $($usual: $usual_part,)* $($other: $other_part),*);

        impl<P: Lane> Parts<P> {
            parts!(@phase place, place_others, [$($usual),*], [$($other: $other_part),*],
                (y: &[S], net: &mut Net<S>, common: &Common<P>), (y, net, common),
                |at, part| part.place(Own::of(y, *at), net, common));
            parts!(@phase shape, shape_others, [$($usual),*], [$($other: $other_part),*],
                (net: &mut Net<S>), (net),
                |_at, part| part.shape(net));
            parts!(@phase potential, potential_others, [$($usual),*], [$($other: $other_part),*],
                (y: &[S], net: &mut Net<S>, common: &Common<P>), (y, net, common),
                |at, part| part.potential(Own::of(y, *at), net, common));
            parts!(@phase exchange, exchange_others, [$($usual),*], [$($other: $other_part),*],
                (net: &mut Net<S>, common: &Common<P>), (net, common),
                |_at, part| part.exchange(net, common));
            parts!(@phase rate, rate_others, [$($usual),*], [$($other: $other_part),*],
                (y: &[S], dy: &mut [S], net: &mut Net<S>, common: &Common<P>), (y, dy, net, common),
                |at, part| part.rate(Own::of(y, *at), OwnMut::of(&mut *dy, *at), net, common));
        }
    };
    (@phase $name:ident, $others:ident, [$($usual:ident),*], [$($other:ident: $other_part:ident),*],
        ($($argument:ident: $type:ty),*), $values:tt, |$at:ident, $part:ident| $call:expr) => {
        #[inline(always)]
        pub fn $name<S: Over<P>>(&self, $($argument: $type),*) {
            $(for ($at, $part) in &self.$usual {
                $call;
            })*
            if P::GENERAL && !self.present.is_empty() {
                self.$others $values;
            }
        }
        #[inline(never)]
        fn $others<S: Over<P>>(&self, $($argument: $type),*) {
            for kind in &self.present {
                match kind {
                    $(PartKind::$other_part => {
                        for ($at, $part) in &self.$other {
                            $call;
                        }
                    })*
                    _ => {}
                }
            }
        }
    };
    (@storage $($field:ident: $part:ident),* $(,)?) => {
        /// The kinds of part.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum PartKind {
            $($part,)*
        }

        impl PartKind {
            /// Whether an ordinary drive has such a part.
            const fn is_usual(self) -> bool {
                matches!(self, PartKind::Cylinder | PartKind::Reservoir | PartKind::Restriction)
            }

            /// Whether circuits of this scalar type may contain such a part. Nothing is compiled for impossible kinds.
            const fn is_for<P: Lane>(self) -> bool {
                P::GENERAL || self.is_usual()
            }

            fn is_missing() -> ! {
                unreachable!("derivatives by such numbers need a circuit without nodes")
            }
        }

        /// The parts of a circuit by kind, each with the indices of its states.
        #[derive(Clone, Debug)]
        pub(crate) struct Parts<P> {
            $(pub $field: Vec<(Place, $part<P>)>,)*
            /// The other kinds that have parts.
            pub present: Vec<PartKind>,
        }

        impl<P> Default for Parts<P> {
            fn default() -> Self {
                Parts { $($field: Vec::new(),)* present: Vec::new() }
            }
        }

        $(impl<P: Lane> StoredPart<P> for $part<P> {
            const KIND: PartKind = PartKind::$part;

            fn kept(parts: &mut Parts<P>) -> &mut Vec<(Place, Self)> {
                &mut parts.$field
            }
        })*

        impl<P> Parts<P> {
        }

        /// Evaluates an expression with the indices and the part of an id, bound by a pattern.
        macro_rules! part_of {
            ($parts:expr, $id:expr, $pattern:pat => $value:expr) => {
                match $id.kind {
                    $(PartKind::$part => {
                        let $pattern = $parts.$field[$id.index];
                        $value
                    })*
                }
            };
        }

        impl<P: Lane> Parts<P> {
            /// Returns every flow path with its ends.
            pub fn paths(&self) -> impl Iterator<Item = (Path, Between)> {
                let mut all = Vec::new();
                $(for (index, (_, part)) in self.$field.iter().enumerate() {
                    let id = PartId { kind: PartKind::$part, index };
                    let each = part.paths().iter().enumerate();
                    all.extend(each.map(|(path, ends)| (Path::along(id, path), *ends)));
                })*
                all.into_iter()
            }

            /// Returns the number of states of the parts of each owner. Parts without an owner come first.
            pub fn count_states(&self, owners: usize) -> Vec<usize> {
                let mut counts = vec![0; owners + 1];
                $(for (place, part) in &self.$field {
                    counts[place.owner] += part.states().len();
                })*
                counts
            }

            /// Returns the mass flow along a path in the direction of its part, kg/s.
            pub fn flow<S: Over<P>>(&self, Path { part, path, .. }: Path, net: &Net<S>) -> S {
                match part.kind {
                    $(PartKind::$part if PartKind::$part.is_for::<P>() => self.$field[part.index].1.flow(path, net).0,)*
                    _ => PartKind::is_missing(),
                }
            }

            /// Returns the force of a part, N.
            pub fn force<S: Over<P>>(&self, part: PartId, net: &Net<S>) -> S {
                match part.kind {
                    $(PartKind::$part if PartKind::$part.is_for::<P>() => self.$field[part.index].1.force(net),)*
                    _ => PartKind::is_missing(),
                }
            }

            /// Assigns an owner to every part without one.
            pub fn own(&mut self, owner: usize) {
                $(for (place, _) in self.$field.iter_mut().filter(|(place, _)| place.owner == 0) {
                    place.owner = owner;
                })*
            }

            /// Gives every part its indices: the states' names and scales in that order, then the balances.
            pub fn lay_out(&mut self, called: &Called) -> (Vec<(String, State)>, Vec<Channel>) {
                let all = [$((PartKind::$part, self.$field.len())),*];
                let others = all.into_iter().filter(|(kind, count)| *count > 0 && !kind.is_usual());
                self.present = others.map(|(kind, _)| kind).collect();
                let mut parts = Vec::new();
                $(for (place, part) in &mut self.$field {
                    let (states, channels) = (part.states(), part.channels());
                    parts.push(PartLayout { kind: stringify!($part), place, states, channels });
                })*
                place(parts, called)
            }

            /// Gives every part the indices from a circuit of the same parts, and the states' scales in that order.
            /// `None` if there are other parts.
            pub fn lay_out_like(&mut self, other: &Parts<f64>) -> Option<Vec<f64>> {
                let mut scales = Vec::new();
                self.present.clone_from(&other.present);
                $(if self.$field.len() != other.$field.len() {
                    return None;
                }
                for ((place, part), (own, _)) in self.$field.iter_mut().zip(&other.$field) {
                    let states = part.states();
                    if states.len() != own.count {
                        return None;
                    }
                    *place = *own;
                    scales.extend(states.into_iter().map(|state| state.scale));
                })*
                Some(scales)
            }

            /// Returns every input, with the name of its part: "Cylinder 0: external force".
            pub fn inputs(&self) -> Vec<(InputId, String, &'static Input)> {
                let (mut all, mut named) = (Vec::new(), PartNames::default());
                $(for (index, (_, part)) in self.$field.iter().enumerate() {
                    let (id, owner) = (PartId { kind: PartKind::$part, index }, named.next(stringify!($part)));
                    let each = part.inputs().iter().enumerate();
                    all.extend(each.map(|(i, input)| (id.input(i), format!("{owner}: {}", input.name), input)));
                })*
                all
            }

            pub fn begin(&self, given: &Given<P>, y: &mut [P], net: &Net<P>, common: &Common<P>) {
                $(for (at, part) in &self.$field {
                    part.begin(given, OwnMut::of(y, *at), net, common);
                })*
            }

            pub fn n_obstacles(&self) -> usize {
                0 $(+ self.$field.iter().map(|(_, part)| part.n_obstacles()).sum::<usize>())*
            }

            pub fn obstacles(&self, y: &[P], net: &mut Net<P>, common: &Common<P>, mut out: &mut [P]) {
                if !self.present.is_empty() {
                    self.place_others(y, net, common);
                }
                $(for (at, part) in &self.$field {
                    let (own, others) = out.split_at_mut(part.n_obstacles());
                    part.obstacles(Own::of(y, *at), net, own);
                    out = others;
                })*
            }

            /// Returns every event.
            pub fn events(&self) -> Vec<EventId> {
                let mut all = Vec::new();
                $(for (index, (_, part)) in self.$field.iter().enumerate() {
                    let part_id = PartId { kind: PartKind::$part, index };
                    all.extend((0..part.events().len()).map(|event| EventId { part: part_id, event }));
                })*
                all
            }

            pub fn switch(&mut self, id: EventId, lane: usize, y: &mut [P], net: &Net<P>, at: (&Common<P>, usize)) {
                let (common, n_states) = at;
                let (y, accounts) = y.split_at_mut(n_states);
                match id.part.kind {
                    $(PartKind::$part if PartKind::$part.is_for::<P>() => {
                        let (at, part) = &mut self.$field[id.part.index];
                        let own = if accounts.is_empty() { 0..0 } else { at.first_account..at.first_account + at.accounts };
                        let (y, accounts) = (OwnMut::of(y, *at), &mut accounts[own]);
                        part.switch(Switching { event: id.event, lane, y, net, common, accounts });
                    })*
                    _ => PartKind::is_missing(),
                }
            }

            /// Returns one circuit of lanes from one for each lane.
            pub fn gather(each: &[&Parts<f64>]) -> Self {
                Parts {
                    $($field: if PartKind::$part.is_for::<P>() {
                        side_by_side(&math::field(each, |parts| &parts.$field))
                    } else {
                        Vec::new()
                    },)*
                    present: each[0].present.clone(),
                }
            }

            pub fn stored<S: Over<P>>(&self, y: &[S], net: &Net<S>, common: &Common<P>) -> [S; 3] {
                let mut sum = [S::zero(); 3];
                $(for (at, part) in &self.$field {
                    let own = part.stored(Own::of(y, *at), net, common);
                    for (sum, own) in sum.iter_mut().zip(own) {
                        *sum += own;
                    }
                })*
                sum
            }
            /// Returns the energy of each store, J.
            pub fn stores<S: Over<P>>(&self, y: &[S], net: &Net<S>, common: &Common<P>) -> Vec<S> {
                let mut stores = Vec::new();
                $(for (at, part) in &self.$field {
                    stores.extend(part.stores(Own::of(y, *at), net, common));
                })*
                stores
            }
            pub fn account<S: Over<P>>(
                &self,
                y: &[S],
                dy: &[S],
                net: &Net<S>,
                common: &Common<P>,
                out: &mut [S],
            ) {
                $(for (at, part) in &self.$field {
                    let own = &mut out[at.first_account..at.first_account + at.accounts];
                    if part.rests() {
                        own.fill(S::zero());
                    } else {
                        let [y, dy] = [y, dy].map(|y| Own::of(y, *at));
                        part.account(y, dy, net, common, own);
                    }
                })*
            }
            pub fn standing<S: Over<P>>(&self, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
                $(for (at, part) in &self.$field {
                    let own = at.first_account..at.first_account + at.accounts;
                    part.standing(net, common, &mut out[own]);
                })*
            }
        }
    };
}

parts! {
    usual:
        cylinders: Cylinder,
        reservoirs: Reservoir,
        restrictions: Restriction;
    others:
        // First, because sums start with the usual parts.
        other_restrictions: OtherRestriction,
        other_cylinders: OtherCylinder,
        axes: Axis,
        platforms: Platform,
        carriages: Carriage,
        // Before the volumes, which receive the gas that it removes.
        columns: Column,
        volumes: Volume,
        faces: Face,
        end_stops: EndStops,
        springs: Spring,
        links: Link,
        check_valves: CheckValve,
        cups: Cup,
        regulators: Regulator,
        gaps: Gap,
        latches: Latch,
        second_orders: SecondOrder,
        poppets: Poppet,
        compressors: Compressor,
        ejectors: Ejector,
        held: Held,
        spools: Spool,
        armatures: Armature,
        // After the spools, whose positions it reads.
        spool_leaks: SpoolLeak,
        edges: Edge,
        table_edges: TableEdge,
        cushions: Cushion,
        bumpers: Bumper,
        shock_absorbers: ShockAbsorber,
        couplings: Coupling,
        magnets: Magnet,
        locks: Lock,
        table_forces: TableForce,
        walls: Wall,
        motors: Motor,
        series: Series,
        formula_paths: FormulaPath,
        formula_forces: FormulaForce,
}

impl<P: Lane> Parts<P> {
    pub fn place_of(&self, id: PartId) -> Place {
        part_of!(self, id, (at, _) => at)
    }

    /// Returns name, unit and bounds of an input.
    pub fn what_input(&self, id: InputId) -> &'static Input {
        part_of!(self, id.part, (_, ref part) => &part.inputs()[id.input])
    }

    pub fn input(&self, id: InputId) -> P {
        part_of!(self, id.part, (_, ref part) => part.input(id.input))
    }

    pub fn input_mut(&mut self, id: InputId) -> &mut P {
        part_of!(self, id.part, (_, ref mut part) => part.input_mut(id.input))
    }

    pub fn event(&self, id: EventId, y: &[P], net: &Net<P>) -> P {
        part_of!(self, id.part, (at, ref part) => part.event(id.event, Own::of(y, at), net))
    }

    pub fn mode_mut(&mut self, id: EventId) -> &mut P {
        part_of!(self, id.part, (_, ref mut part) => part.mode_mut(id.event))
    }

    pub fn event_tolerance(&self, id: EventId) -> f64 {
        part_of!(self, id.part, (_, ref part) => part.events()[id.event])
    }

    pub fn find_mode(&mut self, id: EventId, y: &mut [P], net: &Net<P>) {
        part_of!(self, id.part, (at, ref mut part) => part.find_mode(id.event, OwnMut::of(y, at), net));
    }

    pub fn settle(&self, id: EventId, y: &mut [P]) {
        part_of!(self, id.part, (at, ref part) => part.settle(id.event, OwnMut::of(y, at)));
    }
}
