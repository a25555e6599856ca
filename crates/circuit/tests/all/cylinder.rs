//! A cylinder whose parts are evaluated together is the same cylinder as its parts joined one by one:
//! same motion, same pressures, same accounts.

use crate::support::*;
use circuit::{AxisId, ChamberLaw, Circuit, GasId, InputId, balance};
use ode::{Stepper, System};
use physics::friction::{Composition, Contact, Dwell, Growth, SealLips};
use physics::heat::Heat;

type Edges = [InputId; 4];

/// With `split`, each face is two half faces, which no part evaluates together. Laws of bristles other than
/// LuGre come with an age of the contact.
fn cylinder(split: bool, key: &str) -> (Circuit<f64>, AxisId, [GasId; 2], Edges, Vec<f64>) {
    let mut circuit = empty();
    let supply = circuit.reservoir(7e5, 300.0);
    let exhaust = circuit.reservoir(AMBIENT, ROOM);
    let values = [
        ("coulomb", 20.0),
        ("breakaway", 30.0),
        ("stribeck_velocity", 0.02),
        ("viscous", 40.0),
        ("bristle_stiffness", 1e5),
        ("bristle_damping", 300.0),
    ];
    let friction = law(key, if key == "stribeck" { &values[..4] } else { &values });
    let dwell =
        (key == "elasto-plastic").then(|| Dwell::new(Growth::Hyperbolic, &[5.0, 0.1, 1.0, 5e-5, 0.0, 0.0]));
    let lips = SealLips { coulomb_a: 1e-5, coulomb_b: 2e-5, breakaway_a: 1e-5, breakaway_b: 3e-5 };
    let friction = Contact::new(friction, Some(lips), Composition { dwell, ..Composition::NONE });
    let axis = circuit.axis(2.0, 0.3, -6.0, Some(friction));
    let mut chamber = |area: f64, grows: bool| {
        let gas = circuit.vessel(ChamberLaw::EnergyBalance, [1e-5, 1e-3], Heat::Newton(50.0), 285.0);
        let parts = if split { 2 } else { 1 };
        for _ in 0..parts {
            let share = 1.0 / f64::from(parts);
            circuit.face(
                gas,
                axis,
                grows,
                0.3,
                circuit::PistonSide::new(share * area, share * 0.08, share * 2.0 * area),
            );
        }
        gas
    };
    let chambers = [chamber(5e-4, true), chamber(4e-4, false)];
    circuit.end_stops(axis, stop(), 0.3);
    circuit.spring(axis, 200.0, 0.1);
    let mut edge = |from, to| circuit.restriction(orifice(1e-8), from, to);
    let [a, b] = chambers;
    let edges = [edge(supply, a), edge(a, exhaust), edge(supply, b), edge(b, exhaust)];
    let mut circuit = circuit.build(true);
    let y = circuit.initial(&[(a, 3e5, 290.0), (b, 4e5, 310.0)], &[(axis, 0.05, 0.0)]);
    (circuit, axis, chambers, edges, y)
}

/// Rows of (x, v, friction, end stop, p_a, T_a, p_b, T_b) and the accounts by kind.
fn run(split: bool, key: &str) -> (Vec<[f64; 8]>, [f64; 3]) {
    let (circuit, axis, [a, b], edges, y) = cylinder(split, key);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-10));
    let mut trace = Trace::every(2e-3, 1.6);
    for (i, u) in [0.8, -0.8, 0.05, 0.0].into_iter().enumerate() {
        let (extend, retract) = (f64::max(u, 0.0), f64::max(-u, 0.0));
        for (edge, opening) in edges.iter().zip([extend, retract, retract, extend]) {
            stepper.system_mut().set_input(*edge, 0, opening);
        }
        advance(&mut stepper, 0.4 * (i + 1) as f64, &mut trace);
    }
    trace.finish(&stepper);
    let row = |y: &Vec<f64>| {
        let net = nodes(stepper.system(), y);
        let (m, a, b) = (net[axis], net[a], net[b]);
        [m.x, m.v, m.friction, m.end_stop, a.p, a.t, b.p, b.t]
    };
    let balance = balance(stepper.system(), &trace.states);
    assert!(balance.energy_error.abs() < 1e-6 && balance.mass_error.abs() < 1e-12);
    let total = |name: &str| {
        let own = balance.accounts.iter().filter(|(account, ..)| account.ends_with(name));
        own.map(|(.., total)| total).sum()
    };
    let accounts = [total("friction heat"), total("ambient work"), total("wall heat")];
    (trace.states.iter().map(row).collect(), accounts)
}

#[test]
fn the_stops_of_an_axis_are_obstacles_also_where_it_is_no_cylinder() {
    for split in [false, true] {
        let (circuit, axis, _, _, y) = cylinder(split, "lugre");
        let mut ahead = vec![f64::NAN; circuit.n_obstacles()];
        circuit.obstacles(&y, &mut ahead, &mut circuit.work::<f64>());
        let x = nodes(&circuit, &y)[axis].x;
        assert_eq!(ahead, [x, 0.3 - x], "split: {split}");
    }
}

/// So that what swings between mass, gas and stop counts in the ledger, whatever evaluates them.
#[test]
fn energy_is_stored_in_the_same_places() {
    let stores = |split: bool| {
        let (circuit, .., mut y) = cylinder(split, "lugre");
        let at = |what: &str| circuit.state_names().iter().position(|(name, _)| name.contains(what));
        y[at("position").expect("a mass")] = 0.301;
        y[at("velocity").expect("a mass")] = 2.0;
        let mut stores = circuit.books(&y).stores;
        stores.retain(|energy| *energy != 0.0);
        stores.sort_by(f64::total_cmp);
        stores
    };
    let (together, apart) = (stores(false), stores(true));
    assert_eq!((together.len(), apart.len()), (6, 6), "speed, height, both gases, stop and spring");
    for (one, two) in together.iter().zip(&apart) {
        assert!((one - two).abs() <= 1e-12 * one.abs(), "{together:?} {apart:?}");
    }
}

#[test]
fn together_or_one_by_one() {
    for key in ["lugre", "stribeck", "elasto-plastic"] {
        let ((together, accounts), (apart, own)) = (run(false, key), run(true, key));
        let scale = [0.3, 1.0, 50.0, 500.0, 5e5, 300.0, 5e5, 300.0];
        for (k, (one, two)) in together.iter().zip(&apart).enumerate() {
            for i in 0..8 {
                let apart = (one[i] - two[i]).abs() / scale[i];
                // Rebound at a stop and stiction amplify rounding; friction jumps at a stop of motion.
                let bound = if i == 2 || i == 3 { 1e-3 } else { 1e-6 };
                assert!(apart < bound, "{key}, sample {k}, column {i}: {one:?} {two:?}");
            }
        }
        for (one, two) in accounts.iter().zip(&own) {
            assert!((one - two).abs() < 1e-6 * one.abs(), "{accounts:?} {own:?}");
        }
        assert!(together.iter().any(|row| row[3] < -10.0), "it reached the far stop");
    }
}
