//! The gas that a run draws from outside, read off the accepted steps.

use crate::circuit::{Circuit, Path};
use crate::net::Net;
use math::Lane;
use ode::{Accepted, Output, System};

/// Points of a step, as shares of it, at which flows are looked at: those of Gauss' rule, whose weights are a half each.
const POINTS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// Masses that have passed the paths over the boundary of a circuit.
#[derive(Clone)]
pub(crate) struct Drawn<R: Lane> {
    /// Each path, its positive direction inward, and the mass, kg.
    paths: Vec<(Path, R)>,
    net: Net<R>,
}

impl<R: Lane> Drawn<R> {
    /// Nothing yet.
    pub fn of(circuit: &Circuit<R>) -> Self {
        Drawn { paths: circuit.inlets().map(|path| (path, R::zero())).collect(), net: circuit.work() }
    }
}

impl Drawn<f64> {
    /// What came in, kg: each path by what it gave on balance.
    pub fn mass(&self) -> f64 {
        self.paths.iter().map(|(_, mass)| mass.max(0.0)).sum()
    }
}

impl Output<f64, Circuit<f64>> for Option<Box<Drawn<f64>>> {
    fn due(&self, _lane: usize) -> f64 {
        f64::INFINITY
    }

    fn sample(&mut self, _lane: usize, _t: f64, _y: &[f64], _circuit: &Circuit<f64>) {}

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
