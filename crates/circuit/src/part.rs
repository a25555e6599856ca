//! Parts of a circuit. A new part is a file here and a line in `parts!`.

pub(crate) mod axis;
mod carriage;
pub(crate) mod check_valve;
mod cup;
pub(crate) mod cylinder;
mod end_stops;
mod face;
mod link;
mod path;
mod regulator;
mod reservoir;
mod restriction;
mod spring;
pub(crate) mod volume;

use crate::circuit::{AxisId, GasId};
use crate::ledger::{Channel, Kind};
use crate::net::Net;
use math::{Lane, Over, Real};
use physics::{Bounds, IdealGas};
use std::collections::BTreeMap;

pub use axis::Axis;
pub use carriage::Carriage;
pub use check_valve::CheckValve;
pub use cup::Cup;
pub use cylinder::{Cylinder, OtherCylinder};
pub use end_stops::{Covers, EndStops};
pub use face::Face;
pub use link::Link;
pub use path::Between;
pub use regulator::Regulator;
pub use reservoir::Reservoir;
pub use restriction::Restriction;
pub use spring::Spring;
pub use volume::{ChamberLaw, Volume};

/// A state of a part.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub name: &'static str,
    pub unit: &'static str,
    /// Absolute error scale, in the unit.
    pub scale: f64,
}

/// An input of a part: a number that may change at any time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    pub name: &'static str,
    pub unit: &'static str,
    pub bounds: Bounds,
}

/// An input of a circuit: the kind of part, which of them, and which of its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputId {
    pub(crate) kind: PartKind,
    pub(crate) index: usize,
    pub(crate) input: usize,
}

/// A part of a circuit: its kind, and which of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartId {
    pub(crate) kind: PartKind,
    pub(crate) index: usize,
}

impl PartId {
    pub(crate) fn input(self, input: usize) -> InputId {
        InputId { kind: self.kind, index: self.index, input }
    }
}

/// An event of a circuit: the kind of part, which of them, and which of its events.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EventId {
    kind: PartKind,
    index: usize,
    event: usize,
}

/// What a run starts from, by node; what is given for no node stays zero.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a, R> {
    /// Pressure, Pa absolute, and temperature, K.
    pub gas: &'a [(GasId, R, R)],
    /// Position, m, and velocity, m/s.
    pub axes: &'a [(AxisId, R, R)],
    /// For how long a contact has stood, s. Friction without memory does not mind.
    pub ages: &'a [(AxisId, R)],
    /// All inner states of friction.
    pub inner: &'a [(AxisId, &'a [R])],
}

impl<R: Copy> Given<'_, R> {
    pub(crate) fn gas(&self, node: usize) -> Option<[R; 2]> {
        self.gas.iter().find(|(id, ..)| id.0 == node).map(|&(_, p, t)| [p, t])
    }

    pub(crate) fn axis(&self, node: usize) -> Option<[R; 2]> {
        self.axes.iter().find(|(id, ..)| id.0 == node).map(|&(_, x, v)| [x, v])
    }
}

/// What every part shares with the circuit.
#[derive(Clone, Copy, Debug)]
pub struct Common<P> {
    pub gas: IdealGas<P>,
    pub ambient_pressure: P,
    pub ambient_temperature: P,
}

/// A part's own states within those of the circuit.
#[derive(Clone, Copy)]
pub struct Own<'y, S> {
    y: &'y [S],
    place: Place,
}

impl<'y, S: Copy> Own<'y, S> {
    #[inline(always)]
    pub(crate) fn of(y: &'y [S], place: Place) -> Self {
        Own { y, place }
    }

    /// The first `N` own states.
    #[inline(always)]
    pub fn first<const N: usize>(&self) -> [S; N] {
        let own = &self.y[self.place.first..self.place.first + N];
        std::array::from_fn(|i| own[i])
    }

    /// The own states from the `n`-th on.
    #[inline(always)]
    pub fn after(&self, n: usize) -> &'y [S] {
        &self.y[self.place.first + n..self.place.first + self.place.count]
    }
}

/// A part's own states or their rates, to be written.
pub struct OwnMut<'y, S> {
    y: &'y mut [S],
    place: Place,
}

impl<'y, S: Copy> OwnMut<'y, S> {
    #[inline(always)]
    pub(crate) fn of(y: &'y mut [S], place: Place) -> Self {
        OwnMut { y, place }
    }

    /// Sets the first `N` of them.
    #[inline(always)]
    pub fn set<const N: usize>(&mut self, values: [S; N]) {
        self.y[self.place.first..self.place.first + N].copy_from_slice(&values);
    }

    /// Those from the `n`-th on.
    #[inline(always)]
    pub fn after(&mut self, n: usize) -> &mut [S] {
        &mut self.y[self.place.first + n..self.place.first + self.place.count]
    }

    /// The first `n`, and the others.
    #[inline(always)]
    pub fn split(self, n: usize) -> (&'y mut [S], &'y mut [S]) {
        self.y[self.place.first..self.place.first + self.place.count].split_at_mut(n)
    }
}

/// A part of a circuit. The right-hand side runs through all parts five times: positions, the volumes
/// that they leave, pressures, exchange of gas and forces, rates. A phase that a part leaves out costs
/// nothing.
pub trait Part<P: Real> {
    /// Names and scales of the part's states.
    fn states(&self) -> Vec<State> {
        Vec::new()
    }
    /// The part's inputs.
    fn inputs(&self) -> &'static [Input] {
        &[]
    }
    /// The value of one of them.
    fn input(&self, input: usize) -> P {
        unreachable!("there is no input {input}")
    }
    /// The place of one of them.
    fn input_mut(&mut self, input: usize) -> &mut P {
        unreachable!("there is no input {input}")
    }

    #[inline(always)]
    fn place<S: Over<P>>(&self, _y: Own<S>, _net: &mut Net<S>, _common: &Common<P>) {}
    #[inline(always)]
    fn shape<S: Over<P>>(&self, _net: &mut Net<S>) {}
    #[inline(always)]
    fn potential<S: Over<P>>(&self, _y: Own<S>, _net: &mut Net<S>, _common: &Common<P>) {}
    /// Its flow paths. What passes them is exchanged and booked for the part.
    #[inline(always)]
    fn paths(&self) -> &[Between] {
        &[]
    }
    /// Mass flow along one of them, kg/s, and where it goes backward.
    #[inline(always)]
    fn flow<S: Over<P>>(&self, path: usize, _net: &Net<S>) -> (S, S::Mask) {
        unreachable!("there is no flow path {path}")
    }

    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        for (path, ends) in self.paths().iter().enumerate() {
            path::post(net, *ends, self.flow(path, net));
        }
    }
    #[inline(always)]
    fn rate<S: Over<P>>(&self, _y: Own<S>, _dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {}

    /// (mass kg, energy J, entropy of the gas J/K) stored in the part.
    fn stored<S: Over<P>>(&self, _y: Own<S>, _net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        [S::zero(); 3]
    }
    /// The part's accounts.
    fn channels(&self) -> Vec<(&'static str, Kind)> {
        self.paths().iter().flat_map(|_| path::CHANNELS).collect()
    }
    /// Whether its accounts stand still as it is now.
    fn rests(&self) -> bool {
        false
    }
    /// Rates of the accounts, where `dy` are those of the states.
    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let own = out.chunks_exact_mut(path::CHANNELS.len());
        for ((path, ends), own) in self.paths().iter().enumerate().zip(own) {
            path::throttling(net, *ends, self.flow(path, net), common, own);
        }
    }
    /// Sets the part's states to what its nodes are given. Called with the volumes of `net` unknown, then with those
    /// that the positions leave.
    fn begin(&self, _given: &Given<P>, _y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {}

    /// How many surfaces it has behind which its equations are of another kind.
    fn n_obstacles(&self) -> usize {
        0
    }
    /// Functions that are positive before each and negative behind it.
    fn obstacles(&self, _y: Own<P>, _net: &Net<P>, _out: &mut [P]) {}

    /// How many events the part has, each with a mode of its own: a number in each lane.
    fn n_events(&self) -> usize {
        0
    }
    /// The event function: positive while the present mode holds.
    fn event(&self, event: usize, _y: Own<P>, _net: &Net<P>) -> P {
        unreachable!("there is no event {event}")
    }
    /// How far below zero it may lie where the event is taken, in its unit.
    fn event_tolerance(&self, _event: usize) -> f64 {
        0.0
    }
    /// Changes the mode of one lane, and what the mode demands of the states; what that takes goes into the part's
    /// accounts, if the circuit keeps any.
    fn switch(
        &mut self,
        _event: usize,
        _lane: usize,
        _y: OwnMut<P>,
        _net: &Net<P>,
        _common: &Common<P>,
        _accounts: &mut [P],
    ) where
        P: Lane,
    {
    }
    /// The mode of an event.
    fn mode_mut(&mut self, event: usize) -> &mut P {
        unreachable!("there is no event {event}")
    }
    /// Sets the mode to match the states, and what it demands of them.
    fn find_mode(&mut self, _event: usize, _y: OwnMut<P>, _net: &Net<P>)
    where
        P: Lane,
    {
    }
    /// Puts a sample onto the side of the mode, from which the error of a step may have moved it.
    fn settle(&self, _event: usize, _y: OwnMut<P>)
    where
        P: Lane,
    {
    }

    /// What the accounts hold beside their integrals, as a function of the state; `out` comes as zeros.
    fn standing<S: Over<P>>(&self, _net: &Net<S>, _common: &Common<P>, _out: &mut [S]) {}
}

/// A part that a circuit keeps with those of its kind.
pub(crate) trait Kept<P>: Part<P> + Sized
where
    P: Real,
{
    const KIND: PartKind;

    fn kept(parts: &mut Parts<P>) -> &mut Vec<(Place, Self)>;
}

/// Where a part's states and accounts lie.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    pub first: usize,
    pub count: usize,
    pub first_account: usize,
    pub accounts: usize,
}

/// Names of parts for people: a cylinder is a cylinder, whatever its friction.
#[derive(Default)]
struct Names(BTreeMap<&'static str, usize>);

impl Names {
    /// The next part of this kind: "Cylinder 0", "Cylinder 1", ...
    fn next(&mut self, kind: &'static str) -> String {
        let kind = kind.trim_start_matches("Other");
        let count = self.0.entry(kind).or_default();
        *count += 1;
        format!("{kind} {}", *count - 1)
    }
}

/// Lists the kinds of part: their storage, and the loops that run through every part of a circuit.
/// The kinds of an ordinary drive are `usual`; the loops over the others lie in functions of their own,
/// so that a circuit without them does not pay for them with registers.
macro_rules! parts {
    (usual: $($usual:ident: $usual_part:ident),*; others: $($other:ident: $other_part:ident),* $(,)?) => {
        parts!(@storage $($usual: $usual_part,)* $($other: $other_part),*);

        impl<P: Real> Parts<P> {
            parts!(@phase place, place_others, [$($usual),*], [$($other: $other_part),*],
                (y: &[S], net: &mut Net<S>, common: &Common<P>), (y, net, common),
                |at, part| part.place(Own { y, place: *at }, net, common));
            parts!(@phase shape, shape_others, [$($usual),*], [$($other: $other_part),*],
                (net: &mut Net<S>), (net),
                |_at, part| part.shape(net));
            parts!(@phase potential, potential_others, [$($usual),*], [$($other: $other_part),*],
                (y: &[S], net: &mut Net<S>, common: &Common<P>), (y, net, common),
                |at, part| part.potential(Own { y, place: *at }, net, common));
            parts!(@phase exchange, exchange_others, [$($usual),*], [$($other: $other_part),*],
                (net: &mut Net<S>, common: &Common<P>), (net, common),
                |_at, part| part.exchange(net, common));
            parts!(@phase rate, rate_others, [$($usual),*], [$($other: $other_part),*],
                (y: &[S], dy: &mut [S], net: &mut Net<S>, common: &Common<P>), (y, dy, net, common),
                |at, part| part.rate(Own { y, place: *at }, OwnMut { y: &mut *dy, place: *at }, net, common));
        }
    };
    (@phase $name:ident, $others:ident, [$($usual:ident),*], [$($other:ident: $other_part:ident),*],
        ($($argument:ident: $type:ty),*), $values:tt, |$at:ident, $part:ident| $call:expr) => {
        #[inline(always)]
        pub fn $name<S: Over<P>>(&self, $($argument: $type),*) {
            $(for ($at, $part) in &self.$usual {
                $call;
            })*
            if !self.present.is_empty() {
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

        /// The parts of a circuit by kind, each with the place of its states.
        #[derive(Clone, Debug)]
        pub(crate) struct Parts<P> {
            $(pub $field: Vec<(Place, $part<P>)>,)*
            /// The kinds beside the usual ones that there are parts of.
            present: Vec<PartKind>,
        }

        impl<P> Default for Parts<P> {
            fn default() -> Self {
                Parts { $($field: Vec::new(),)* present: Vec::new() }
            }
        }

        $(impl<P: Real> Kept<P> for $part<P> {
            const KIND: PartKind = PartKind::$part;

            fn kept(parts: &mut Parts<P>) -> &mut Vec<(Place, Self)> {
                &mut parts.$field
            }
        })*

        impl<P: Real> Parts<P> {
            /// Every flow path: the kind of its part, which of them, which path of that, and its ends.
            pub fn paths(&self) -> impl Iterator<Item = (PartKind, usize, usize, Between)> {
                let mut all = Vec::new();
                $(for (index, (_, part)) in self.$field.iter().enumerate() {
                    let each = Part::<P>::paths(part).iter().enumerate();
                    all.extend(each.map(|(path, ends)| (PartKind::$part, index, path, *ends)));
                })*
                all.into_iter()
            }

            /// Mass flow along one of them, kg/s.
            pub fn flow<S: Over<P>>(&self, (kind, index, path): (PartKind, usize, usize), net: &Net<S>) -> S {
                match kind {
                    $(PartKind::$part => self.$field[index].1.flow(path, net).0,)*
                }
            }

            /// Gives every part its place; the states' names and scales in that order, then the accounts.
            pub fn lay_out(&mut self) -> (Vec<(String, State)>, Vec<Channel>) {
                let usual = [PartKind::Cylinder, PartKind::Reservoir, PartKind::Restriction];
                let all = [$((PartKind::$part, self.$field.len())),*];
                let others = all.into_iter().filter(|(kind, count)| *count > 0 && !usual.contains(kind));
                self.present = others.map(|(kind, _)| kind).collect();
                let (mut states, mut channels) = (Vec::new(), Vec::new());
                let (mut named, mut counted) = (Names::default(), Names::default());
                $(for (place, part) in &mut self.$field {
                    let (own, part) = (part.states(), named.next(stringify!($part)));
                    *place = Place { first: states.len(), count: own.len(), ..*place };
                    states.extend(own.into_iter().map(|s| (format!("{part}: {}", s.name), s)));
                })*
                $(for (place, part) in &mut self.$field {
                    let (own, part) = (part.channels(), counted.next(stringify!($part)));
                    place.first_account = channels.len();
                    place.accounts = own.len();
                    channels.extend(own.into_iter().map(|(name, kind)| {
                        Channel { name: format!("{part}: {name}"), kind }
                    }));
                })*
                (states, channels)
            }
        }

        impl<P: Real> Parts<P> {
            /// Every input, with the name of its part: "Cylinder 0: external force".
            pub fn inputs(&self) -> Vec<(InputId, String, &'static Input)> {
                let (mut all, mut named) = (Vec::new(), Names::default());
                $(for (index, (_, part)) in self.$field.iter().enumerate() {
                    let owner = named.next(stringify!($part));
                    all.extend(Part::<P>::inputs(part).iter().enumerate().map(|(input, what)| {
                        let id = InputId { kind: PartKind::$part, index, input };
                        (id, format!("{owner}: {}", what.name), what)
                    }));
                })*
                all
            }

            /// What an input is.
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
                    part.obstacles(Own { y, place: *at }, net, own);
                    out = others;
                })*
            }
        }

        impl<R: Lane> Parts<R> {
            /// Every event.
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
                        part.event(id.event, Own { y, place: *at }, net)
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
                    $(PartKind::$part => {
                        let (at, part) = &mut self.$field[id.index];
                        let own = if accounts.is_empty() { 0..0 } else { at.first_account..at.first_account + at.accounts };
                        part.switch(id.event, lane, OwnMut::of(y, *at), net, common, &mut accounts[own]);
                    })*
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

            /// One circuit of lanes from one for each lane.
            pub fn gather(each: &[&Parts<f64>]) -> Self {
                Parts { $($field: (0..each[0].$field.len()).map(|i| {
                    let own: Vec<&$part<f64>> = each.iter().map(|parts| &parts.$field[i].1).collect();
                    (each[0].$field[i].0, $part::gather(&own))
                }).collect(),)* present: each[0].present.clone() }
            }
        }

        impl<P: Real> Parts<P> {
            pub fn stored<S: Over<P>>(&self, y: &[S], net: &Net<S>, common: &Common<P>) -> [S; 3] {
                let mut sum = [S::zero(); 3];
                $(for (at, part) in &self.$field {
                    let own = part.stored(Own { y, place: *at }, net, common);
                    for (sum, own) in sum.iter_mut().zip(own) {
                        *sum += own;
                    }
                })*
                sum
            }
            /// The energy that each part stores, J.
            pub fn stores<S: Over<P>>(&self, y: &[S], net: &Net<S>, common: &Common<P>) -> Vec<S> {
                let mut stores = Vec::new();
                $(stores.extend(self.$field.iter().map(|(at, part)| {
                    part.stored(Own { y, place: *at }, net, common)[1]
                }));)*
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
                        let [y, dy] = [y, dy].map(|y| Own { y, place: *at });
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
        other_cylinders: OtherCylinder,
        axes: Axis,
        carriages: Carriage,
        volumes: Volume,
        faces: Face,
        end_stops: EndStops,
        springs: Spring,
        links: Link,
        check_valves: CheckValve,
        cups: Cup,
        regulators: Regulator,
}
