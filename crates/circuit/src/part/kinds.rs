//! The kinds of part, and the loops of a circuit over its parts.

use super::names::{Called, PartLayout, PartNames, place, side_by_side};
use super::*;
use crate::ground::{Between, Channel, Common, Given, Input, Net, Own, OwnMut, Part, Place, State};
use math::{Lane, Over, Real};

/// An input of a circuit: the kind and index of its part, and the index of the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputId {
    pub(crate) kind: PartKind,
    pub(crate) index: usize,
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
        InputId { kind: self.kind, index: self.index, input }
    }
}

/// An event of a circuit: the kind and index of its part, and the index of the event.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventId {
    kind: PartKind,
    index: usize,
    event: usize,
}

/// A part that a circuit keeps with those of its kind.
pub(crate) trait StoredPart<P>: Part<P> + Sized
where
    P: Real,
{
    const KIND: PartKind;

    fn kept(parts: &mut Parts<P>) -> &mut Vec<(Place, Self)>;
}

/// Lists the kinds of part: their storage, and the loops over every part of a circuit. The kinds of an ordinary drive
/// are `usual`. The loops over the others are separate functions, so that a circuit without them does not use registers
/// for them.
macro_rules! parts {
    (usual: $($usual:ident: $usual_part:ident),*; others: $($other:ident: $other_part:ident),* $(,)?) => {
        parts!(@storage $($usual: $usual_part,)* $($other: $other_part),*);

        impl<P: Real> Parts<P> {
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
            const fn is_for<P: Real>(self) -> bool {
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
            present: Vec<PartKind>,
        }

        impl<P> Default for Parts<P> {
            fn default() -> Self {
                Parts { $($field: Vec::new(),)* present: Vec::new() }
            }
        }

        $(impl<P: Real> StoredPart<P> for $part<P> {
            const KIND: PartKind = PartKind::$part;

            fn kept(parts: &mut Parts<P>) -> &mut Vec<(Place, Self)> {
                &mut parts.$field
            }
        })*

        impl<P> Parts<P> {
            /// Returns whether it has parts of other than the usual kinds.
            pub fn has_others(&self) -> bool {
                !self.present.is_empty()
            }
        }

        impl<P: Real> Parts<P> {
            /// Returns every flow path: the kind and index of its part, the index of the path, and its ends.
            pub fn paths(&self) -> impl Iterator<Item = (PartKind, usize, usize, Between)> {
                let mut all = Vec::new();
                $(for (index, (_, part)) in self.$field.iter().enumerate() {
                    let each = Part::<P>::paths(part).iter().enumerate();
                    all.extend(each.map(|(path, ends)| (PartKind::$part, index, path, *ends)));
                })*
                all.into_iter()
            }

            /// Returns the number of states of the parts of each owner. Parts without an owner come first.
            pub fn count_states(&self, owners: usize) -> Vec<usize> {
                let mut counts = vec![0; owners + 1];
                $(for (place, part) in &self.$field {
                    counts[place.owner] += Part::<P>::states(part).len();
                })*
                counts
            }

            pub fn place_of(&self, part: PartId) -> Place {
                match part.kind {
                    $(PartKind::$part => self.$field[part.index].0,)*
                }
            }

            /// Returns the mass flow along a path, kg/s.
            pub fn flow<S: Over<P>>(&self, (kind, index, path): (PartKind, usize, usize), net: &Net<S>) -> S {
                match kind {
                    $(PartKind::$part if PartKind::$part.is_for::<P>() => self.$field[index].1.flow(path, net).0,)*
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
        }

        impl<P: Real> Parts<P> {
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
                    let owner = named.next(stringify!($part));
                    all.extend(Part::<P>::inputs(part).iter().enumerate().map(|(input, what)| {
                        let id = InputId { kind: PartKind::$part, index, input };
                        (id, format!("{owner}: {}", what.name), what)
                    }));
                })*
                all
            }

            /// Returns name, unit and bounds of an input.
            pub fn what_input(&self, id: InputId) -> &'static Input {
                match id.kind {
                    $(PartKind::$part => &Part::<P>::inputs(&self.$field[id.index].1)[id.input],)*
                }
            }

            pub fn input(&self, id: InputId) -> P {
                match id.kind {
                    $(PartKind::$part => self.$field[id.index].1.input(id.input),)*
                }
            }

            pub fn input_mut(&mut self, id: InputId) -> &mut P {
                match id.kind {
                    $(PartKind::$part => self.$field[id.index].1.input_mut(id.input),)*
                }
            }
        }

        impl<P: Real> Parts<P> {
            pub fn begin(&self, given: &Given<P>, y: &mut [P], net: &Net<P>, common: &Common<P>) {
                $(for (at, part) in &self.$field {
                    part.begin(given, OwnMut::of(y, *at), net, common);
                })*
            }

            pub fn n_obstacles(&self) -> usize {
                0 $(+ self.$field.iter().map(|(_, part)| Part::<P>::n_obstacles(part)).sum::<usize>())*
            }

            pub fn obstacles(&self, y: &[P], net: &mut Net<P>, common: &Common<P>, mut out: &mut [P]) {
                if !self.present.is_empty() {
                    self.place_others(y, net, common);
                }
                $(for (at, part) in &self.$field {
                    let (own, others) = out.split_at_mut(Part::<P>::n_obstacles(part));
                    part.obstacles(Own::of(y, *at), net, own);
                    out = others;
                })*
            }
        }

        impl<R: Lane> Parts<R> {
            /// Returns every event.
            pub fn events(&self) -> Vec<EventId> {
                let mut all = Vec::new();
                $(for (index, (_, part)) in self.$field.iter().enumerate() {
                    let each = 0..Part::<R>::n_events(part);
                    all.extend(each.map(|event| EventId { kind: PartKind::$part, index, event }));
                })*
                all
            }

            pub fn event(&self, id: EventId, y: &[R], net: &Net<R>) -> R {
                match id.kind {
                    $(PartKind::$part => {
                        let (at, part) = &self.$field[id.index];
                        part.event(id.event, Own::of(y, *at), net)
                    })*
                }
            }

            pub fn mode_mut(&mut self, id: EventId) -> &mut R {
                match id.kind {
                    $(PartKind::$part => self.$field[id.index].1.mode_mut(id.event),)*
                }
            }

            pub fn event_tolerance(&self, id: EventId) -> f64 {
                match id.kind {
                    $(PartKind::$part => Part::<R>::event_tolerance(&self.$field[id.index].1, id.event),)*
                }
            }

            pub fn switch(&mut self, id: EventId, lane: usize, y: &mut [R], net: &Net<R>, at: (&Common<R>, usize)) {
                let (common, n_states) = at;
                let (y, accounts) = y.split_at_mut(n_states);
                match id.kind {
                    $(PartKind::$part if PartKind::$part.is_for::<R>() => {
                        let (at, part) = &mut self.$field[id.index];
                        let own = if accounts.is_empty() { 0..0 } else { at.first_account..at.first_account + at.accounts };
                        part.switch(id.event, lane, OwnMut::of(y, *at), net, common, &mut accounts[own]);
                    })*
                    _ => PartKind::is_missing(),
                }
            }

            pub fn find_mode(&mut self, id: EventId, y: &mut [R], net: &Net<R>) {
                match id.kind {
                    $(PartKind::$part => {
                        let (at, part) = &mut self.$field[id.index];
                        part.find_mode(id.event, OwnMut::of(y, *at), net);
                    })*
                }
            }

            pub fn settle(&self, id: EventId, y: &mut [R]) {
                match id.kind {
                    $(PartKind::$part => {
                        let (at, part) = &self.$field[id.index];
                        part.settle(id.event, OwnMut::of(y, *at));
                    })*
                }
            }

            /// Returns one circuit of lanes from one for each lane.
            pub fn gather(each: &[&Parts<f64>]) -> Self {
                Parts {
                    $($field: if PartKind::$part.is_for::<R>() {
                        side_by_side(&math::field(each, |parts| &parts.$field))
                    } else {
                        Vec::new()
                    },)*
                    present: each[0].present.clone(),
                }
            }
        }

        impl<P: Real> Parts<P> {
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
