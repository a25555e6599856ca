//! A piston between two chambers on the edges of a valve: runs and evaluations that need its states by name.

use crate::assembly::variables::{Assembly, Settable, Target};
use crate::component::Starting;
use crate::ground::{AxisId, Error, GasId, refuse};
use ode::System;

/// Inputs that are the openings of its edges.
pub(super) const EDGES: std::ops::RangeInclusive<usize> = 1..=4;

/// A circuit with a piston between two chambers on the edges of a valve. Its first inputs are the command and the
/// openings of the edges. Its start values begin with those of the piston and the chambers.
#[derive(Clone, Copy, Debug)]
pub struct Driven<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) axis: AxisId,
    pub(super) chambers: [GasId; 2],
    pub(super) stroke: f64,
}

impl<'a> Driven<'a> {
    pub(super) fn of(assembly: &'a Assembly, stroke: f64) -> Result<Self, Error> {
        let inputs = assembly.variables.inputs.get(..=*EDGES.end()).unwrap_or_default();
        match (&assembly.variables.starts[..], inputs) {
            (
                &[(Starting::Axis(axis), _), (Starting::Gas(a), _), (Starting::Gas(b), _), ..],
                [Settable { target: Target::Edges(_), .. }, edges @ ..],
            ) if edges.iter().all(|edge| matches!(edge.target, Target::Input(_))) => {
                Ok(Driven { assembly, axis, chambers: [a, b], stroke })
            }
            _ => refuse("this needs one piston between two chambers on a 5/3 valve"),
        }
    }

    /// (p_a, T_a, p_b, T_b) at each of the states, one after the other.
    pub fn gas(&self, states: impl Iterator<Item = Vec<f64>>) -> Vec<f64> {
        let mut net = self.assembly.circuit.work::<f64>();
        let mut gas = Vec::new();
        for y in states {
            self.assembly.circuit.observe(&y, &mut net);
            gas.extend(self.chambers.iter().flat_map(|&id| [net[id].p, net[id].t]));
        }
        gas
    }
}
