//! Parts and nodes as one system of equations.

mod advance;
mod build;
mod drawn;
mod fused;
mod impacts;
mod ledger;
mod masses;
mod observe;
mod scarce;
mod system;

pub(crate) use advance::settled;
pub use advance::{Look, advance, budget, failure_of};
pub(crate) use drawn::Drawn;
pub(crate) use fused::glance::{Glance, place};
pub use impacts::Impact;
pub(crate) use impacts::Impacts;
pub use ledger::{Balance, balance};
pub(crate) use ledger::{Entry, closed};

pub use crate::part::Path;

use crate::ground::{Channel, Common, GasId, Input};
use crate::part::{Called, EventId, InputId, PartId, PartKind, Parts, Restriction};
use fused::{Fused, Whole};
use math::{Gather, Lane};
use ode::Structure;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

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

/// Returns a number that was never used before.
fn next_filling() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}

impl<R: Lane> Circuit<R> {
    /// Returns one circuit of lanes. Lane `i` is `each[i]`. All must have the same parts.
    pub fn gather(each: &[&Circuit<f64>]) -> Self {
        assert_eq!(each.len(), R::L, "one circuit for each lane");
        Circuit {
            topology: each[0].topology.clone(),
            parts: Parts::gather(&math::field(each, |circuit| &circuit.parts)),
            common: Common::gather(&math::field(each, |circuit| &circuit.common)),
            scale: Gather::gather(&math::field(each, |circuit| &circuit.scale)),
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
        if id.part.kind == PartKind::Restriction {
            if self.set_opening(id.part.index, lane, value) {
                self.connect();
            }
            return;
        }
        self.parts.input_mut(id).take(lane, &value);
        if id.part.kind == PartKind::Reservoir {
            self.filled = next_filling();
            self.connect();
        }
    }

    /// Opens edges of one valve. They have the same kind.
    #[inline(always)]
    pub(crate) fn set_openings(&mut self, edges: &[InputId; 4], lane: usize, values: [R; 4]) {
        let is_usual = edges[0].part.kind == PartKind::Restriction;
        let mut others_open = false;
        for (edge, value) in edges.iter().zip(values) {
            if is_usual {
                others_open |= self.set_opening(edge.part.index, lane, value);
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
        if let (true, Some(fused)) = (is_open, &mut self.fused) {
            fused.open(index, self.parts.restrictions[index].1.gain());
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

    /// Visits the modes of all events. `each` may change them.
    pub fn change_modes(&mut self, mut each: impl FnMut(&mut R)) {
        for &id in &self.topology.events {
            each(self.parts.mode_mut(id));
        }
    }

    /// Returns the inputs for pressure, Pa absolute, and temperature, K, of a reservoir.
    pub fn boundary(&self, reservoir: GasId) -> [InputId; 2] {
        let index = self.parts.reservoirs.iter().position(|(_, part)| part.node == reservoir.0);
        let index = index.expect("a reservoir of this circuit");
        [0, 1].map(|input| PartId { kind: PartKind::Reservoir, index }.input(input))
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

    /// Returns the number of states of each component's parts. The circuit need not be built yet.
    pub(crate) fn count_states(&self) -> Vec<(&str, usize)> {
        let names = std::iter::once("").chain(self.called.owners.iter().map(String::as_str));
        names.zip(self.parts.count_states(self.called.owners.len())).collect()
    }

    /// Returns the number of states without the balances.
    pub fn n_states(&self) -> usize {
        self.topology.n_states
    }

    /// Returns the balances of the circuit.
    pub fn channels(&self) -> &[Channel] {
        &self.topology.channels
    }

    /// Checks whether the circuit can be evaluated without nodes.
    fn fuse(mut self) -> Self {
        self.fused = Fused::of(&self.parts, &self.common).map(Box::new);
        self.connect();
        self
    }

    /// Copies the open restrictions and the reservoirs.
    fn connect(&mut self) {
        if let Some(fused) = &mut self.fused {
            fused.connect(&self.open, &self.parts);
        }
    }

    /// The evaluation without nodes.
    #[inline(always)]
    fn whole<'c>(&'c self, fused: &'c Fused<R>) -> Whole<'c, R> {
        Whole { fused, cylinder: &self.parts.cylinders[0].1, common: &self.common }
    }
}
