//! A step is the step of the method, whatever the pattern: sparse elimination in a fixed order,
//! coloured columns and derivatives by duals give what a dense elimination with pivots and the
//! derivative by hand give. And a quadrature is a passenger: it changes no bit of the states.

mod support;

use math::Real;
use ode::{RODAS5P, Stepper};
use support::*;

/// y_i' = sum_j a_ij sin(y_j) + b_i sin(w t), with a random pattern and a stiff diagonal.
#[derive(Clone)]
struct RandomNetwork {
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
}

const W: f64 = 3.0;

impl RandomNetwork {
    fn new(n: usize, density: f64, seed: u64) -> Self {
        let mut u = Uniform(seed);
        let mut cell = |i: usize, j: usize| {
            let (used, size) = (0.5 + 0.5 * u.next(), u.next());
            match (i == j, used < density) {
                (true, _) => -10.0_f64.powf(2.0 + 2.0 * size),
                (false, true) => 10.0 * size,
                (false, false) => 0.0,
            }
        };
        let a = (0..n).map(|i| (0..n).map(|j| cell(i, j)).collect()).collect();
        let b = (0..n).map(|_| u.next()).collect();
        RandomNetwork { a, b }
    }
}

impl Equations for RandomNetwork {
    const TIME: bool = true;
    fn n(&self) -> usize {
        self.b.len()
    }
    fn f<S: Real + From<f64>>(&self, t: S, y: &[S], dy: &mut [S]) {
        for (i, row) in self.a.iter().enumerate() {
            dy[i] = S::from(self.b[i]) * (S::from(W) * t).sin();
            for j in (0..y.len()).filter(|&j| row[j] != 0.0) {
                dy[i] += S::from(row[j]) * y[j].sin();
            }
        }
    }
}

/// Solves A x = b with row pivoting.
fn dense_solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&p, &q| a[p][k].abs().total_cmp(&a[q][k].abs())).expect("not empty");
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            let (done, rest) = a.split_at_mut(i);
            for (below, right) in rest[0].iter_mut().zip(&done[k]).skip(k) {
                *below -= factor * right;
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

/// One Rosenbrock step as the book writes it, with the Jacobian by hand.
fn dense_step(network: &RandomNetwork, t: f64, y0: &[f64], h: f64) -> Vec<f64> {
    let n = y0.len();
    let m = &RODAS5P;
    let mut w: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| -network.a[i][j] * y0[j].cos()).collect()).collect();
    for (i, row) in w.iter_mut().enumerate() {
        row[i] += 1.0 / (h * m.gamma);
    }
    let f_t: Vec<f64> = network.b.iter().map(|b| b * W * (W * t).cos()).collect();
    let mut u: Vec<Vec<f64>> = Vec::new();
    let mut stage = y0.to_vec();
    for i in 0..8 {
        stage = y0.to_vec();
        for (j, u) in u.iter().enumerate() {
            for k in 0..n {
                stage[k] += m.a[i][j] * u[k];
            }
        }
        let mut right = vec![0.0; n];
        network.f(t + m.alpha[i] * h, &stage, &mut right);
        for k in 0..n {
            right[k] += h * m.gamma_t[i] * f_t[k];
            right[k] += (0..i).map(|j| m.c[i][j] / h * u[j][k]).sum::<f64>();
        }
        u.push(dense_solve(w.clone(), right));
    }
    stage.iter().zip(&u[7]).map(|(y, u)| y + u).collect()
}

#[test]
fn sparse_elimination_gives_the_step_of_a_dense_one() {
    let shapes = [(1, 1.0), (3, 0.5), (5, 1.0), (8, 0.1), (13, 0.3), (40, 0.05)];
    for (case, (n, density)) in shapes.into_iter().cycle().take(60).enumerate() {
        let network = RandomNetwork::new(n, density, 77 + case as u64);
        let mut u = Uniform(case as u64);
        let y0: Vec<f64> = (0..n).map(|_| u.next()).collect();
        let (t, h) = (0.4, 0.01);
        let ours = run(network.clone(), (t, t + h), &y0, fixed_step(h));
        assert_eq!(ours.statistics(0).steps, 1);
        let dense = dense_step(&network, t, &y0, h);
        for (a, b) in ours.state().iter().zip(&dense) {
            assert!((a - b).abs() < 1e-11, "case {case}, n {n}: {a} {b}");
        }
    }
}

/// The network with integrals of its states riding along.
#[derive(Clone)]
struct Accounted {
    network: RandomNetwork,
    quadratures: bool,
}

impl Equations for Accounted {
    const TIME: bool = true;
    fn n(&self) -> usize {
        self.network.n() + 2 * usize::from(self.quadratures)
    }
    fn scale(&self) -> Vec<f64> {
        let mut scale = vec![1e-3; self.network.n()];
        scale.resize(self.n(), f64::INFINITY);
        scale
    }
    fn f<S: Real + From<f64>>(&self, t: S, y: &[S], dy: &mut [S]) {
        let n = self.network.n();
        self.network.f(t, &y[..n], &mut dy[..n]);
        if self.quadratures {
            dy[n] = dy[0];
            dy[n + 1] = t * y[0] * y[1];
        }
    }
}

#[test]
fn quadratures_change_no_bit_of_the_states() {
    for n in [2, 5, 8, 9] {
        let network = RandomNetwork::new(n, 0.4, n as u64);
        let with = |quadratures: bool| {
            let equations = Accounted { network: network.clone(), quadratures };
            let mut y0 = vec![0.5; n];
            y0.resize(equations.n(), 0.0);
            run(equations, (0.0, 2.0), &y0, tolerance(1e-7))
        };
        let (bare, accounted) = (with(false), with(true));
        assert!(bare.statistics(0).steps > 20);
        assert_eq!(bare.statistics(0), accounted.statistics(0));
        assert_eq!(bits(bare.state()), bits(&accounted.state()[..n]));
        // The integral of y0' is what y0 gained: linear accounts close to rounding.
        let gained = accounted.state()[0] - 0.5;
        assert!((accounted.state()[n] - gained).abs() < 1e-14);
    }
}

#[derive(Clone)]
struct UsesItsQuadrature;

impl Equations for UsesItsQuadrature {
    fn n(&self) -> usize {
        2
    }
    fn scale(&self) -> Vec<f64> {
        vec![1.0, f64::INFINITY]
    }
    fn f<S: Real + From<f64>>(&self, _t: S, y: &[S], dy: &mut [S]) {
        (dy[0], dy[1]) = (y[1], y[0]);
    }
}

#[test]
#[should_panic(expected = "state 1 is a quadrature")]
fn a_state_that_depends_on_a_quadrature_is_refused() {
    let _ = Stepper::new(Problem::new(UsesItsQuadrature), 0.0, &[1.0, 0.0], tolerance(1e-6));
}
