//! LuGre linearised, and what that says of the whole circuit: the oscillation of a mass in stick, and the stiffness of
//! the drive below which it cannot slide steadily. The derivatives are those of the right-hand side that is integrated.
//! Source: [canudas1995] for the law; the linearisations are worked out in the comments.

use crate::support::*;
use circuit::{AxisId, Circuit};
use math::Dual;
use ode::{Stepper, System};

const FC: f64 = 30.0;
const FS: f64 = 40.0;
const VS: f64 = 0.012;
const SIGMA_0: f64 = 4e5;
const SIGMA_1: f64 = 100.0;
const FV: f64 = 60.0;
const MASS: f64 = 1.0;

/// A mass with LuGre friction, pulled through a spring by a carriage of constant speed.
fn pulled(stiffness: f64) -> (Circuit<f64>, AxisId, AxisId) {
    let mut circuit = empty();
    let values = [
        ("coulomb", FC),
        ("breakaway", FS),
        ("stribeck_velocity", VS),
        ("viscous", FV),
        ("bristle_stiffness", SIGMA_0),
        ("bristle_damping", SIGMA_1),
    ];
    let mass = circuit.axis(MASS, 0.0, 0.0, Some(law("lugre", &values).into()));
    let (node, _) = circuit.servo(circuit::Carriage::rigid());
    circuit.link(node, mass, stiffness, 0.0);
    (circuit.build(false), mass, node)
}

/// Where x, v and z of the mass lie among the states.
fn own(circuit: &Circuit<f64>) -> [usize; 3] {
    let names = circuit.state_names();
    let z =
        names.iter().position(|(name, _)| name.contains("bristle_deflection_m")).expect("it has bristles");
    [z - 2, z - 1, z]
}

/// The Jacobian of the rates of x, v, z by themselves, at state `y`.
fn jacobian(circuit: &Circuit<f64>, y: &[f64], own: [usize; 3]) -> [[f64; 3]; 3] {
    let mut at: Vec<Dual<f64, { circuit::DIRECTIONS }>> = y.iter().map(|y| Dual::from(*y)).collect();
    for (direction, i) in own.into_iter().enumerate() {
        at[i].eps[direction] = 1.0;
    }
    let mut rates = at.clone();
    circuit.rhs(Dual::from(0.0), &at, &mut rates, &mut circuit.work());
    own.map(|i| std::array::from_fn(|direction| rates[i].eps[direction]))
}

/// s^3 + a s^2 + b s + c, the characteristic polynomial of a matrix.
fn characteristic(m: &[[f64; 3]; 3]) -> [f64; 3] {
    let minor = |i: usize, j: usize| m[i][i] * m[j][j] - m[i][j] * m[j][i];
    let cofactor = |j: usize, k: usize| m[1][j] * m[2][k] - m[1][k] * m[2][j];
    let determinant = m[0][0] * cofactor(1, 2) - m[0][1] * cofactor(0, 2) + m[0][2] * cofactor(0, 1);
    [-(m[0][0] + m[1][1] + m[2][2]), minor(0, 1) + minor(0, 2) + minor(1, 2), -determinant]
}

#[test]
fn a_stuck_mass_rings_at_the_frequency_of_its_bristles() {
    // At rest dz/dt = v: m s^2 + (sigma1 + Fv) s + sigma0 = 0, and a mode s = 0 of the place. So the frequency is
    // sqrt(sigma0/m) and the damping (sigma1 + Fv)/(2 sqrt(sigma0 m)).
    let (mut circuit, mass, node) = pulled(0.0);
    let y = circuit.initial(&[], &[(mass, 0.0, 0.0), (node, 0.0, 0.0)]);
    let [x, v, z] = own(&circuit);
    let [a, b, c] = characteristic(&jacobian(&circuit, &y, [x, v, z]));
    assert_eq!(c, 0.0);
    let (frequency, damping) = (b.sqrt(), a / (2.0 * b.sqrt()));
    assert_close("frequency", frequency, (SIGMA_0 / MASS).sqrt(), 1e-14);
    assert_close("damping", damping, (SIGMA_1 + FV) / (2.0 * (SIGMA_0 * MASS).sqrt()), 1e-14);
    // And so it rings when it is tapped, as long as the deflection is small against Fs/sigma0 = 0.1 mm.
    let mut tapped = y.clone();
    tapped[v] = 1e-6;
    let mut trace = Trace::every(1e-4, 0.02);
    let mut stepper = Stepper::new(circuit, 0.0, &tapped, options(1e-10));
    advance(&mut stepper, 0.02, &mut trace);
    trace.finish(&stepper);
    let rings = frequency * (1.0 - damping * damping).sqrt();
    for (t, y) in trace.times.iter().zip(&trace.states) {
        let by_hand = 1e-6 / rings * (-damping * frequency * t).exp() * (rings * t).sin();
        assert!((y[z] - by_hand).abs() < 1e-4 * 1e-6 / rings, "{t} s: {} {by_hand}", y[z]);
    }
}

/// Steady sliding at v0 on a spring K: g, g', and the relaxation time tau = g/(sigma0 v0) of the bristles.
fn sliding(v0: f64) -> (f64, f64, f64) {
    let weight = (-(v0 / VS).powi(2)).exp();
    let (g, slope) = (FC + (FS - FC) * weight, -2.0 * v0 / (VS * VS) * (FS - FC) * weight);
    (g, slope, g / (SIGMA_0 * v0))
}

/// The least stiffness at which a mass slides steadily at v0.
///
/// With z = g/sigma0 + dz: tau d(dz)/dt = -dz + g' dv/sigma0, so the force answers a change of velocity by
/// Fv + g' (1 + s sigma1/sigma0)/(1 + s tau). With m s + K/s that gives
///     m tau s^3 + (m + E) s^2 + (Fv + g' + K tau) s + K = 0,    E = Fv tau + g' sigma1/sigma0,
/// stable where (m + E)(Fv + g' + K tau) > m tau K, that is K > -(Fv + g')(m + E)/(tau E), for E > 0.
fn critical_stiffness(v0: f64) -> f64 {
    let (_, slope, tau) = sliding(v0);
    let e = FV * tau + slope * SIGMA_1 / SIGMA_0;
    -(FV + slope) * (MASS + e) / (tau * e)
}

/// Steady sliding on a spring: the circuit, its state, and where x, v, z of the mass are.
fn steadily(stiffness: f64, v0: f64) -> (Circuit<f64>, AxisId, Vec<f64>, [usize; 3]) {
    let (mut circuit, mass, node) = pulled(stiffness);
    let (g, ..) = sliding(v0);
    let stretch = (g + FV * v0) / stiffness;
    let mut y = circuit.initial(&[], &[(mass, 0.0, v0), (node, stretch, v0)]);
    let own = own(&circuit);
    y[own[2]] = g / SIGMA_0;
    (circuit, mass, y, own)
}

#[test]
fn steady_sliding_is_stable_above_the_critical_stiffness_only() {
    let v0 = 5e-3;
    let critical = critical_stiffness(v0);
    println!("critical stiffness {critical} N/m");
    // The derivatives of the right-hand side have the same boundary: at it a b = c.
    let (circuit, _, y, own) = steadily(critical, v0);
    let [a, b, c] = characteristic(&jacobian(&circuit, &y, own));
    assert_close("a b = c at the boundary", a * b, c, 1e-9);
    // And the whole motion: a small disturbance dies away above it, and grows to stick-slip below.
    let swing = |factor: f64| {
        let (circuit, mass, mut y, [_, v, _]) = steadily(factor * critical, v0);
        y[v] *= 1.01;
        let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-8));
        let mut trace = Trace::every(1e-3, 3.0);
        advance(&mut stepper, 3.0, &mut trace);
        trace.finish(&stepper);
        let speeds: Vec<f64> = trace.states.iter().map(|y| nodes(stepper.system(), y)[mass].v / v0).collect();
        let range =
            |part: &[f64]| part.iter().fold([f64::MAX, f64::MIN], |r, v| [r[0].min(*v), r[1].max(*v)]);
        (range(&speeds[..200]), range(&speeds[speeds.len() - 500..]))
    };
    let (first, last) = swing(1.1);
    assert!(last[1] - last[0] < 0.05 * (first[1] - first[0]), "above: {first:?}, then {last:?}");
    let (first, last) = swing(0.9);
    assert!(last[1] - last[0] > 10.0 * (first[1] - first[0]), "below: {first:?}, then {last:?}");
    let (_, last) = swing(0.2);
    assert!(last[0] < 0.02 && last[1] > 1.9, "stick-slip: {last:?}");
}

#[test]
fn where_the_curve_rises_any_spring_slides_steadily() {
    // Far above vs: Fv + g' > 0, so there is no critical stiffness.
    let (circuit, _, y, own) = steadily(10.0, 0.1);
    let [a, b, c] = characteristic(&jacobian(&circuit, &y, own));
    assert!(a > 0.0 && c > 0.0 && a * b > c);
}
