//! Gas that a run draws from outside, computed from the accepted steps.

use super::{Circuit, Path};
use crate::ground::Net;
use math::Lane;
use ode::{Accepted, Output, System};

/// Gauss points of a step, as fractions of its length, at which flows are evaluated. Their weights are one half each.
const POINTS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Masses that have passed the paths over the boundary of a circuit.
#[derive(Clone)]
pub(crate) struct Drawn<R: Lane> {
    /// Each path, positive inward, and its mass, kg.
    paths: Vec<(Path, R)>,
    net: Net<R>,
}

impl<R: Lane> Drawn<R> {
    /// Returns an empty record.
    pub fn of(circuit: &Circuit<R>) -> Self {
        Drawn { paths: circuit.inlets().map(|path| (path, R::zero())).collect(), net: circuit.work() }
    }
}

impl Drawn<f64> {
    /// Returns the mass that came in, kg: the net mass of each path.
    pub fn mass(&self) -> f64 {
        self.paths.iter().map(|(_, mass)| mass.max(0.0)).sum()
    }
}

impl Output<f64, Circuit<f64>> for Option<Box<Drawn<f64>>> {
    fn step(
        &mut self,
        _lane: usize,
        _t: f64,
        h: f64,
        states: &mut Accepted<'_, f64>,
        circuit: &Circuit<f64>,
    ) {
        let Some(Drawn { paths, net }) = self.as_deref_mut() else { return };
        for theta in POINTS {
            circuit.observe(states.at(theta), net);
            for (path, mass) in &mut *paths {
                *mass += 0.5 * h * circuit.flow(*path, net);
            }
        }
    }
}
