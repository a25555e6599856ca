//! A circuit that no source file names: a compressor fills a tank through a filter, and the tank
//! feeds two different drives, all from public parts. Nothing is lost: mass, energy and entropy
//! close over everything that moves, flows and rubs.

use crate::support::*;
use circuit::{AxisId, ChamberLaw, Circuit, GasId, InputId, balance};
use ode::Stepper;
use physics::friction::{Composition, Contact, SealLips};
use physics::heat::Heat;

struct Drive {
    axis: AxisId,
    chambers: [GasId; 2],
    edges: [InputId; 4],
}

struct Plant {
    circuit: Circuit<f64>,
    tank: GasId,
    filter: InputId,
    drives: [Drive; 2],
}

/// A cylinder of the given areas on a valve of four edges.
fn drive(
    circuit: &mut Circuit<f64>,
    (tank, exhaust): (GasId, GasId),
    areas: (f64, f64),
    (mass, incline): (f64, f64),
    friction: Contact<f64>,
) -> Drive {
    let stroke = 0.3;
    let axis = circuit.axis(mass, incline, 4.0, Some(friction));
    let mut chamber = |area: f64, grows: bool| {
        let gas = circuit.vessel(ChamberLaw::EnergyBalance, [8e-6, 1e-4], Heat::Newton(40.0), 285.0);
        circuit.face(gas, axis, grows, stroke, circuit::PistonSide::new(area, 0.08, 2.0 * area));
        gas
    };
    let chambers = [chamber(areas.0, true), chamber(areas.1, false)];
    circuit.end_stops(axis, stop(), stroke);
    let mut edge = |from, to| circuit.restriction(orifice(1e-8), from, to);
    let [a, b] = chambers;
    let edges = [edge(tank, a), edge(a, exhaust), edge(tank, b), edge(b, exhaust)];
    Drive { axis, chambers, edges }
}

fn plant(ledger: bool) -> (Plant, Vec<f64>) {
    let mut circuit = empty();
    let compressor = circuit.reservoir(9e5, 330.0);
    let exhaust = circuit.reservoir(AMBIENT, ROOM);
    let tank = circuit.vessel(ChamberLaw::EnergyBalance, [5e-4, 0.05], Heat::Newton(15.0), ROOM);
    let filter = circuit.restriction(orifice(0.4e-8), compressor, tank);
    let lugre = law(
        "lugre",
        &[
            ("coulomb", 10.0),
            ("breakaway", 14.0),
            ("stribeck_velocity", 0.01),
            ("viscous", 100.0),
            ("bristle_stiffness", 8e4),
            ("bristle_damping", 120.0),
        ],
    );
    // Passive at every pressure up to 7 bar in both chambers: 120 (42 - 24)/24 = 90 < 100 N s/m.
    let lips = SealLips { coulomb_a: 1e-5, coulomb_b: 1e-5, breakaway_a: 2e-5, breakaway_b: 2e-5 };
    let lugre = Contact::new(lugre, Some(lips), Composition::NONE);
    let ends = (tank, exhaust);
    let drives = [
        drive(&mut circuit, ends, (5e-4, 4.2e-4), (2.0, 0.5), stribeck().into()),
        drive(&mut circuit, ends, (8e-4, 8e-4), (6.0, -0.2), lugre),
    ];
    let mut circuit = circuit.build(ledger);
    let mut gas = vec![(tank, 6e5, ROOM)];
    gas.extend(drives.iter().flat_map(|drive| drive.chambers.map(|chamber| (chamber, 2e5, ROOM))));
    let y = circuit.initial(&gas, &[(drives[0].axis, 0.1, 0.0), (drives[1].axis, 0.2, 0.0)]);
    (Plant { circuit, tank, filter, drives }, y)
}

fn command(circuit: &mut Circuit<f64>, drive: &Drive, u: f64) {
    let (extend, retract) = (u.max(0.0), (-u).max(0.0));
    for (edge, opening) in drive.edges.iter().zip([extend, retract, retract, extend]) {
        circuit.set_input(*edge, 0, opening);
    }
}

/// Two seconds with a new pair of commands every 0.4 s.
fn work(plan: &[(f64, f64)], ledger: bool) -> (Plant, Stepper<f64, Circuit<f64>>, Trace) {
    let (plant, y) = plant(ledger);
    let mut stepper = Stepper::new(plant.circuit.clone(), 0.0, &y, options(1e-9));
    let mut trace = Trace::every(1e-3, 0.4 * plan.len() as f64);
    for (i, &(one, two)) in plan.iter().enumerate() {
        let circuit = stepper.system_mut();
        circuit.set_input(plant.filter, 0, 1.0);
        command(circuit, &plant.drives[0], one);
        command(circuit, &plant.drives[1], two);
        advance(&mut stepper, 0.4 * (i + 1) as f64, &mut trace);
    }
    trace.finish(&stepper);
    (plant, stepper, trace)
}

const PLAN: [(f64, f64); 5] = [(1.0, -1.0), (0.3, 1.0), (-1.0, 0.05), (-0.2, -0.6), (0.5, 0.5)];

#[test]
fn mass_energy_and_entropy_close() {
    let (plant, stepper, trace) = work(&PLAN, true);
    pinned("two-drives-one-tank", trace.states.concat());
    let balance = balance(stepper.system(), &trace.states);
    assert!(balance.turnover > 100.0, "J turned over: {}", balance.turnover);
    assert!(balance.mass_error.abs() < 1e-12, "mass {:e}", balance.mass_error);
    assert!(balance.energy_error.abs() < 1e-6, "energy {:e}", balance.energy_error);
    assert!(balance.entropy_error.abs() < 1e-6, "entropy {:e}", balance.entropy_error);
    assert!(balance.least_production > -1e-10, "second law {:e}", balance.least_production);
    // Both drives went from stop to stop.
    for drive in &plant.drives {
        let x = trace.states.iter().map(|y| nodes(stepper.system(), y)[drive.axis].x);
        let (low, high) = x.fold((1.0_f64, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
        assert!(low < 1e-3 && high > 0.299, "{low} {high}");
    }
}

#[test]
fn the_ledger_is_a_passenger() {
    let (_, with, _) = work(&PLAN, true);
    let (_, without, _) = work(&PLAN, false);
    let n = without.state().len();
    assert_eq!(bits(&with.state()[..n]), bits(without.state()));
    assert_eq!(with.statistics(0).steps, without.statistics(0).steps);
}

#[test]
fn the_drives_feel_each_other_through_the_tank() {
    let least = |plan: &[(f64, f64)]| {
        let (plant, stepper, trace) = work(plan, false);
        let p = trace.states.iter().map(|y| nodes(stepper.system(), y)[plant.tank].p);
        let end = now(&stepper)[plant.drives[0].axis].x;
        (p.fold(f64::INFINITY, f64::min), end)
    };
    let (quiet, _) = least(&[(0.0, 0.0)]);
    let (alone, _) = least(&[(1.0, 0.0)]);
    let (both, _) = least(&[(1.0, 1.0)]);
    assert!(quiet >= 6e5 && alone < 5.8e5 && both < alone - 2e4, "{quiet} {alone} {both}");
}
