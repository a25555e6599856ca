//! The usual drive, which is evaluated without nodes, is the same drive: the bits of its rates are those of its parts
//! joined by nodes, and its Jacobian, taken by what enters chambers and axis, is that of the whole. So are the columns of
//! its trajectory.

use crate::support::drive::{self, Drive};
use crate::support::*;
use circuit::{ChamberLaw, Circuit, InputId, PistonSide};
use math::Dual;
use ode::System;
use physics::friction::{Composition, Contact, SealLips};
use physics::heat::{Film, Geometry, Heat};
use physics::{Gas, IdealGas};

/// A single-rod cylinder on a valve of four edges, of which one is drawn towards the reservoir for each chamber, with a
/// leak of one chamber and friction that grows with the pressure. It starts at the pressure of the exhaust.
fn drive(key: &str, has_law: bool) -> (Circuit<f64>, Vec<InputId>, Vec<f64>) {
    let mut circuit = empty();
    let (supply, exhaust) = (circuit.reservoir(7e5, 310.0), circuit.reservoir(AMBIENT, ROOM));
    let values = [
        ("coulomb", 20.0),
        ("breakaway", 30.0),
        ("stribeck_velocity", 0.02),
        ("viscous", 40.0),
        ("bristle_stiffness", 1e5),
        ("bristle_damping", 300.0),
    ];
    let friction = law(key, if key == "stribeck" { &values[..4] } else { &values });
    let lips = SealLips { coulomb_a: 1e-5, coulomb_b: 2e-5, breakaway_a: 1e-5, breakaway_b: 3e-5 };
    let friction = Contact::new(friction, Some(lips), Composition::NONE);
    let axis = circuit.axis(2.0, 0.3, -6.0, Some(friction));
    let [a, b] = [(5e-4, true), (4e-4, false)].map(|(area, grows)| {
        let size = Geometry { bore: 0.025, area, port: 5e-3 };
        let film = Heat::Film(Film::new(1.3, &size, &Gas::from(&IdealGas::air())));
        let heat = if has_law { film } else { Heat::Newton(50.0) };
        let gas = circuit.vessel(ChamberLaw::EnergyBalance, [1e-5, 1e-3], heat, 285.0);
        circuit.face(gas, axis, grows, 0.3, PistonSide::new(area, 0.08, 2.0 * area));
        gas
    });
    circuit.end_stops(axis, stop(), 0.3);
    let mut edge = |from, to, c| circuit.restriction(orifice(c), from, to);
    let edges = vec![
        edge(supply, a, 1e-8),
        edge(a, exhaust, 1.2e-8),
        edge(supply, b, 0.9e-8),
        edge(b, exhaust, 1.1e-8),
        edge(a, exhaust, 1e-10),
    ];
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[(a, AMBIENT, ROOM), (b, 4e5, 310.0)], &[(axis, 0.05, 0.0)]);
    (circuit, edges, y)
}

/// States on the way, moving in both directions, in both stops and with little gas.
fn states(y: &[f64]) -> Vec<Vec<f64>> {
    let each = [[0.0; 2], [0.1, 0.7], [-0.051, -1.5], [0.2503, 0.4], [0.2, -0.01]];
    let changed = each.map(|[x, v]| {
        let mut y = y.to_vec();
        (y[0], y[1]) = (y[0] + x, v);
        (y[2], y[5]) = (y[2] * (1.0 + x), y[5] * (1.0 - x));
        y[6..].iter_mut().for_each(|z| *z = 1e-4 * v);
        y
    });
    changed.to_vec()
}

#[test]
fn its_rates_are_those_of_nodes_to_the_bit_and_its_jacobian_is_the_whole() {
    for (key, has_law) in [("lugre", false), ("stribeck", false), ("lugre", true), ("stribeck", true)] {
        let (mut circuit, edges, y) = drive(key, has_law);
        let n = y.len();
        // Shut, towards either end, one chamber with two open edges, and both chambers on the supply.
        for open in
            [[0.0; 5], [0.6, 0.0, 0.0, 0.6, 0.0], [0.0, 0.3, 1.0, 0.0, 1.0], [0.2, 0.0, 0.5, 0.0, 1.0]]
        {
            edges.iter().zip(open).for_each(|(edge, opening)| circuit.set_input(*edge, 0, opening));
            for y in states(&y) {
                let known: Vec<f64> = (0..n).map(|i| 0.1 * i as f64).collect();
                let (mut nodes, mut fused) = (vec![0.0; n], vec![0.0; n]);
                let mut net = circuit.work::<f64>();
                circuit.rhs(0.0, &y, &mut nodes, &mut net);
                circuit.add_rates(0.0, &y, &known, &mut fused, &mut net);
                let sum: Vec<f64> = nodes.iter().zip(&known).map(|(f, known)| known + f).collect();
                assert_eq!(fused, sum, "{key}, {open:?}, {y:?}");

                let (mut f, mut jacobian) = ([0.0; 8], [[0.0; 8]; 8]);
                assert!(circuit.linearise(&y, &mut f, &mut jacobian), "{key} is evaluated without nodes");
                assert_eq!(f[..n], nodes, "{key}, {open:?}, {y:?}");
                let seeded: Vec<Dual<f64, 8>> =
                    y.iter().enumerate().map(|(i, y)| Dual::variable(*y, i)).collect();
                let mut whole = vec![Dual::from(0.0); n];
                circuit.rhs(Dual::from(0.0), &seeded, &mut whole, &mut circuit.work());
                for (i, (row, whole)) in jacobian.iter().zip(&whole).enumerate() {
                    // Rounding of what cancels: each entry against the largest of its column's states.
                    let size = whole.eps.iter().fold(0.0_f64, |size, entry| size.max(entry.abs()));
                    for (k, (one, other)) in row.iter().zip(&whole.eps).enumerate() {
                        let apart = (one - other).abs();
                        assert!(
                            apart <= 1e-12 * other.abs().max(1e-6 * size),
                            "{key}, d{i}/d{k}: {one} {other}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn its_trajectory_shows_what_the_nodes_have() {
    for spec in [reference(), reference_stribeck()] {
        let drive = Drive::assemble(&spec, false).expect("assembles");
        // Extended into the stop, retracted, and shut; more samples than are kept together.
        let (times, commands) = ([0.0, 0.4, 0.6], [1.0, -0.3, 0.0]);
        let (sampling, initial) = ((0.7, 500.0), at_rest(0.2, 3e5));
        let plan = (&times[..], &commands[..], sampling, &initial, options(1e-6));
        let mut never = |_: f64| false;
        let run = drive.simulate(plan.0, plan.1, plan.2, plan.3, plan.4, &mut never).expect("runs");
        let session = drive.planned((plan.0, plan.1), 0.7, plan.3, plan.4);
        let states = drive::states(session, plan.2).expect("runs");
        let command = drive.columns().iter().position(|name| name == "command").expect("a column");
        let (assembly, n) = (drive.assembly(), drive.n_states());
        let mut circuit = Circuit::clone(&assembly.circuit);
        let mut net = circuit.work::<f64>();
        for (k, y) in states.chunks(n).enumerate() {
            let shown: Vec<f64> = run.columns.iter().map(|column| column[k]).collect();
            if shown[2] == 0.0 {
                continue; // whether it sticks there only the run knows
            }
            circuit.change_modes(|mode| *mode = shown[2].signum());
            drive.set_command(&mut circuit, 0, shown[command]);
            let mut row = vec![0.0; shown.len()];
            assembly.row(&circuit, shown[0], y, &mut net, &mut row);
            assert_eq!(bits(&shown), bits(&row), "{}, {} s", spec.friction.law, shown[0]);
        }
        let end_stop = run.columns[9].iter().copied().fold(0.0, f64::max);
        assert!(end_stop > 0.0, "the piston meets its stop");
    }
}
