//! A part of a circuit: its states, inputs, phases, balances and events.

use super::path::{self, Between};
use super::{AxisId, Common, GasId, Kind, Net};
use math::{Lane, Over, Real};
use physics::Bounds;

/// The owner of a state, which gives its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    Part,
    /// A node of gas.
    Gas(usize),
    /// An axis.
    Axis(usize),
}

/// A state of a part.
#[derive(Clone, Copy, Debug)]
pub struct State {
    /// Name of a state. It ends with the unit, like the name of a column.
    pub name: &'static str,
    /// Its unit in SI: `-` or `1` for a pure number.
    pub unit: &'static str,
    /// Absolute error scale, in the unit.
    pub scale: f64,
    /// Its owner.
    pub of: Of,
}

impl State {
    /// Returns a state that belongs to the part itself.
    pub fn own(name: &'static str, unit: &'static str, scale: f64) -> Self {
        State { name, unit, scale, of: Of::Part }
    }

    /// Returns the same for a state with a separate name.
    pub(crate) fn of(self, of: Of) -> Self {
        State { of, ..self }
    }
}

/// An input of a part: a number that may change at any time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Name that users see.
    pub name: &'static str,
    /// Its unit in SI; `1` for a pure number.
    pub unit: &'static str,
    /// Allowed values, in the unit.
    pub bounds: Bounds,
}

/// Start of a run by node. The default is zero.
#[derive(Clone, Copy, Debug)]
pub struct Given<'a, R> {
    /// Pressure, Pa absolute, and temperature, K.
    pub gas: &'a [(GasId, R, R)],
    /// Position, m, and velocity, m/s.
    pub axes: &'a [(AxisId, R, R)],
    /// Time for which a contact has rested, s, for friction with an age.
    pub ages: &'a [(AxisId, R)],
    /// All inner states of friction.
    pub inner: &'a [(AxisId, &'a [R])],
    /// Start of a signal: the position of an armature.
    pub signals: &'a [(usize, R)],
}

impl<R: Copy> Given<'_, R> {
    pub(crate) fn gas(&self, node: usize) -> Option<[R; 2]> {
        self.gas.iter().find(|(id, ..)| id.0 == node).map(|&(_, p, t)| [p, t])
    }

    pub(crate) fn signal(&self, place: usize) -> Option<R> {
        self.signals.iter().find(|(own, _)| *own == place).map(|&(_, value)| value)
    }

    pub(crate) fn axis(&self, node: usize) -> Option<[R; 2]> {
        self.axes.iter().find(|(id, ..)| id.0 == node).map(|&(_, x, v)| [x, v])
    }
}

/// Indices of a part's states and balances.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    pub first: usize,
    pub count: usize,
    pub first_account: usize,
    pub accounts: usize,
    /// Owner of the part: an index from one on among the owners of a circuit, or zero without an owner.
    pub owner: usize,
}

/// A part's states within those of the circuit.
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

    /// Returns the first `N` states of the part.
    #[inline(always)]
    pub fn first<const N: usize>(&self) -> [S; N] {
        let own = &self.y[self.place.first..self.place.first + N];
        std::array::from_fn(|i| own[i])
    }

    /// Returns the part's states from the `n`-th on.
    #[inline(always)]
    pub fn after(&self, n: usize) -> &'y [S] {
        &self.y[self.place.first + n..self.place.first + self.place.count]
    }
}

/// A part's states or their rates, for writing.
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

    /// Returns the states from the `n`-th on.
    #[inline(always)]
    pub fn after(&mut self, n: usize) -> &mut [S] {
        &mut self.y[self.place.first + n..self.place.first + self.place.count]
    }

    /// Returns the first `n` elements, and the remaining ones.
    #[inline(always)]
    pub fn split(self, n: usize) -> (&'y mut [S], &'y mut [S]) {
        self.y[self.place.first..self.place.first + self.place.count].split_at_mut(n)
    }
}

/// An event of a part in one lane, with the values that the change of its mode uses.
pub struct Switching<'s, P> {
    pub event: usize,
    pub lane: usize,
    pub y: OwnMut<'s, P>,
    pub net: &'s Net<P>,
    pub common: &'s Common<P>,
    /// Balances of the part; empty if the circuit keeps none.
    pub accounts: &'s mut [P],
}

/// A part of a circuit. The right-hand side runs through all parts five times: positions, the volumes that they leave,
/// pressures, exchange of gas and forces, rates. An omitted phase costs nothing.
pub trait Part<P: Lane> {
    /// Returns names and scales of the part's states.
    fn states(&self) -> Vec<State> {
        Vec::new()
    }
    /// Returns the part's inputs.
    fn inputs(&self) -> &'static [Input] {
        &[]
    }
    /// Returns the value of an input.
    fn input(&self, input: usize) -> P {
        unreachable!("there is no input {input}")
    }
    /// Returns a mutable reference to an input.
    fn input_mut(&mut self, input: usize) -> &mut P {
        unreachable!("there is no input {input}")
    }

    /// First phase: quantities that follow from states without a pressure, such as positions, velocities and signals.
    #[inline(always)]
    fn place<S: Over<P>>(&self, _y: Own<S>, _net: &mut Net<S>, _common: &Common<P>) {}
    /// Second phase: volumes that the pistons leave free.
    #[inline(always)]
    fn shape<S: Over<P>>(&self, _net: &mut Net<S>) {}
    /// Third phase: pressures and temperatures.
    #[inline(always)]
    fn potential<S: Over<P>>(&self, _y: Own<S>, _net: &mut Net<S>, _common: &Common<P>) {}
    /// Its flow paths. The circuit exchanges their flows and keeps their balances.
    #[inline(always)]
    fn paths(&self) -> &[Between] {
        &[]
    }
    /// Returns the mass flow along a path, kg/s, and whether it goes backward.
    #[inline(always)]
    fn flow<S: Over<P>>(&self, path: usize, _net: &Net<S>) -> (S, S::Mask) {
        unreachable!("there is no flow path {path}")
    }

    /// Returns the force that a part reports, N, if it has one.
    fn force<S: Over<P>>(&self, _net: &Net<S>) -> S {
        unreachable!("a part without a force of its own")
    }

    /// Fourth phase: gas and forces that pass between nodes. The default covers its flow paths.
    #[inline(always)]
    fn exchange<S: Over<P>>(&self, net: &mut Net<S>, _common: &Common<P>) {
        for (path, ends) in self.paths().iter().enumerate() {
            path::post(net, *ends, self.flow(path, net));
        }
    }
    /// Fifth phase: the rates of its states.
    #[inline(always)]
    fn rate<S: Over<P>>(&self, _y: Own<S>, _dy: OwnMut<S>, _net: &mut Net<S>, _common: &Common<P>) {}

    /// (mass kg, energy J, entropy of the gas J/K) stored in the part.
    fn stored<S: Over<P>>(&self, _y: Own<S>, _net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        [S::zero(); 3]
    }
    /// Energy of each of its stores, J.
    fn stores<S: Over<P>>(&self, y: Own<S>, net: &Net<S>, common: &Common<P>) -> Vec<S> {
        vec![self.stored(y, net, common)[1]]
    }
    /// The part's balances.
    fn channels(&self) -> Vec<(&'static str, Kind)> {
        self.paths().iter().flat_map(|_| path::CHANNELS).collect()
    }
    /// Whether its balances are constant in the present state.
    fn rests(&self) -> bool {
        false
    }
    /// Computes the rates of the balances. `dy` are the rates of the states.
    fn account<S: Over<P>>(&self, _y: Own<S>, _dy: Own<S>, net: &Net<S>, common: &Common<P>, out: &mut [S]) {
        let own = out.chunks_exact_mut(path::CHANNELS.len());
        for ((path, ends), own) in self.paths().iter().enumerate().zip(own) {
            path::throttling(net, *ends, self.flow(path, net), common, own);
        }
    }
    /// Sets the part's states to the given start of its nodes. It is called with unknown volumes in `net`, then with
    /// those that follow from the positions.
    fn begin(&self, _given: &Given<P>, _y: OwnMut<P>, _net: &Net<P>, _common: &Common<P>) {}

    /// Number of surfaces at which its equations change.
    fn n_obstacles(&self) -> usize {
        0
    }
    /// Functions that are positive before each surface and negative after it.
    fn obstacles(&self, _y: Own<P>, _net: &Net<P>, _out: &mut [P]) {}

    /// Events of the part, each by the depth below zero at which it may be located, in its unit. Each has its own mode,
    /// with a number in each lane.
    fn events(&self) -> &'static [f64] {
        &[]
    }
    /// The event function: positive while the present mode holds.
    fn event(&self, event: usize, _y: Own<P>, _net: &Net<P>) -> P {
        unreachable!("there is no event {event}")
    }
    /// Changes the mode of one lane, and the states as the mode requires. The default changes the mode from zero to one
    /// and back. The energy of this change goes into the part's balances, if the circuit keeps any.
    fn switch(&mut self, at: Switching<P>) {
        let mode = self.mode_mut(at.event);
        mode.put(at.lane, 1.0 - mode.get(at.lane));
    }
    /// Returns the mode of an event.
    fn mode_mut(&mut self, event: usize) -> &mut P {
        unreachable!("there is no event {event}")
    }
    /// Sets the mode that belongs to the states, and the states that this mode prescribes.
    fn find_mode(&mut self, _event: usize, _y: OwnMut<P>, _net: &Net<P>) {}
    /// Moves a sample onto the side of the mode, if the error of a step has moved it away.
    fn settle(&self, _event: usize, _y: OwnMut<P>) {}

    /// Adds the parts of balances that are functions of the state, in addition to the integrals. `out` is zero at
    /// entry.
    fn standing<S: Over<P>>(&self, _net: &Net<S>, _common: &Common<P>, _out: &mut [S]) {}
}

/// Tolerance of an event at a pressure, Pa: much less than any step resolves.
pub(crate) const PRESSURE_TOLERANCE: f64 = 1e-3;

/// Limits a fraction to zero and one.
#[inline(always)]
pub(crate) fn clip<S: Real>(share: S) -> S {
    share.max(S::zero()).min(S::one())
}
