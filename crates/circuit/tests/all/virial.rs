//! Circuits with a gas that is not ideal: what is adiabatic, what a throttle cools, that books close, and that without a
//! coefficient nothing changes.

use crate::support::circuits::run as run_columns;
use crate::support::drive::Drive;
use crate::support::*;
use circuit::{ChamberLaw, Circuit, Network, specification as spec};
use math::Dual;
use ode::{Stepper, System};
use physics::heat::Heat;
use physics::{Gas, IdealGas, Virial};
use serde_json::{Value, json};

const MOLAR: f64 = 8.314_462_618;
const CARBON_DIOXIDE: (f64, f64) = (1.289, 188.92);

/// 137.6 - 87.7 exp(325.7 K/T) cm3/mol.
fn carbon_dioxide() -> Virial<f64> {
    let per_kg = 1e-6 * CARBON_DIOXIDE.1 / MOLAR;
    Virial { a: 137.6 * per_kg, b: 87.7 * per_kg, c: 325.7 }
}

/// p and u of it, written down again.
fn p_u(rho: f64, t: f64) -> [f64; 2] {
    let (k, r) = CARBON_DIOXIDE;
    let Virial { a, b, c } = carbon_dioxide();
    let (second, slope) = (a - b * (c / t).exp(), b * c / (t * t) * (c / t).exp());
    [rho * r * t * (1.0 + second * rho), r / (k - 1.0) * t - r * t * t * slope * rho]
}

#[test]
fn a_closed_chamber_follows_the_adiabate() {
    let ideal = IdealGas::new(CARBON_DIOXIDE.0, CARBON_DIOXIDE.1);
    let gas = Gas { virial: Some(carbon_dioxide()), ..Gas::from(&ideal) };
    let mut circuit = Circuit::new(gas, AMBIENT, ROOM);
    let chamber = circuit.vessel(ChamberLaw::EnergyBalance, [1e-5, 0.0], Heat::Newton(0.0), ROOM);
    let (carriage, _) = circuit.servo(circuit::Carriage::rigid());
    circuit.face(chamber, carriage, true, 0.0, circuit::PistonSide::new(5e-4, 0.0, 0.0));
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[(chamber, 5e5, ROOM)], &[(carriage, 0.1, -0.2)]);
    let net = now(&run(&circuit, &y, 0.3, 1e-10));
    // du = p/rho^2 drho from 60 cm3 to 30 cm3, by steps of Runge and Kutta with difference quotients.
    let mass =
        y[circuit.state_names().iter().position(|(name, _)| name.ends_with("mass_kg")).expect("a mass")];
    let (first, last, steps) = (mass / 6e-5, mass / 3e-5, 2000);
    let rate = |rho: f64, t: f64| {
        let [h_rho, h_t] = [1e-5 * rho, 1e-5 * t];
        let by_rho = (p_u(rho + h_rho, t)[1] - p_u(rho - h_rho, t)[1]) / (2.0 * h_rho);
        let by_t = (p_u(rho, t + h_t)[1] - p_u(rho, t - h_t)[1]) / (2.0 * h_t);
        (p_u(rho, t)[0] / (rho * rho) - by_rho) / by_t
    };
    let h = (last - first) / f64::from(steps);
    let t = (0..steps).fold(ROOM, |t, i| {
        let rho = first + f64::from(i) * h;
        let k1 = rate(rho, t);
        let k2 = rate(rho + 0.5 * h, t + 0.5 * h * k1);
        let k3 = rate(rho + 0.5 * h, t + 0.5 * h * k2);
        let k4 = rate(rho + h, t + h * k3);
        t + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    });
    assert_close("temperature", net[chamber].t, t, 1e-6);
    assert_close("pressure", net[chamber].p, p_u(last, t)[0], 1e-6);
    // The ideal gas would come out colder and at a higher pressure.
    let ideal = [ROOM, 5e5 * 2.0].map(|x| x * 2.0_f64.powf(CARBON_DIOXIDE.0 - 1.0));
    assert!(net[chamber].t > ideal[0] + 1.0 && net[chamber].p < 0.999 * ideal[1], "{ideal:?}");
}

fn network(gas: &Value, components: &Value, joints: &Value) -> Network {
    let spec = json!({
        "gas": gas,
        "ambient": { "pressure_pa": AMBIENT, "temperature_k": ROOM },
        "components": components,
        "joints": joints,
    });
    Network::assemble(&serde_json::from_value(spec).expect("a circuit"), true).expect("assembles")
}

fn virial_gas((k, r): (f64, f64), virial: &Virial<f64>) -> Value {
    let Virial { a, b, c } = virial;
    json!({ "heat_capacity_ratio": k, "gas_constant_j_kg_k": r,
            "virial": { "a_m3_kg": a, "b_m3_kg": b, "c_k": c } })
}

fn one(name: &str, kind: &str, numbers: Value) -> Value {
    json!({ "name": name, "kind": kind, "numbers": numbers })
}

fn fitting(name: &str, conductance: f64) -> Value {
    one(name, "fitting", json!({ "conductance": conductance, "critical_pressure_ratio": 0.3 }))
}

#[test]
fn a_throttle_cools_and_the_books_close() {
    let supply = one("supply", "reservoir", json!({ "pressure": 1e6, "temperature": ROOM }));
    let tank = one("tank", "tank", json!({ "volume": 1e-5, "heat_transfer": 0.0 }));
    let components = json!([supply, fitting("in", 1e-9), tank, fitting("out", 2e-9)]);
    let joints = json!([["supply.1", "in.1"], ["in.2", "tank.1", "out.1"], ["out.2", "ambient"]]);
    let network = network(&virial_gas(CARBON_DIOXIDE, &carbon_dioxide()), &components, &joints);
    let start = [("tank.pressure_pa", 3e5), ("tank.temperature_k", ROOM)];
    let (columns, ledger) = run_columns(&network, &[], (10.0, 10.0), &start);
    let last = |name: &str| *columns[name].last().expect("a sample");
    let (p, t) = (last("tank.pressure_pa"), last("tank.temperature_k"));
    // At rest the enthalpy in the tank is that of the supply.
    let h = |p: f64, t: f64| {
        let rho = (0..100).fold(p / (CARBON_DIOXIDE.1 * t), |rho, _| rho * p / p_u(rho, t)[0]);
        p_u(rho, t)[1] + p / rho
    };
    assert_close("enthalpy", h(p, t), h(1e6, ROOM), 1e-8);
    assert!(p < 7e5 && t < ROOM - 3.0, "{p} {t}");
    let [mass, energy, entropy] = ledger;
    assert!(mass.abs() < 1e-12 && energy.abs() < 1e-6 && entropy.abs() < 1e-6, "{ledger:?}");
}

#[test]
fn books_close_with_lines_walls_and_a_compressor() {
    let line = one("line", "tube/distributed", json!({ "length": 1.0, "diameter": 4e-3, "cells": 3.0 }));
    let tank = one("tank", "tank", json!({ "volume": 1e-3, "wall_area": 0.06, "heat_transfer": 20.0 }));
    let numbers = json!({ "free_air_delivery": 2e-3, "start_pressure": 7e5, "stop_pressure": 8e5,
                          "outlet_temperature": 340.0 });
    let end = one("end", "tank", json!({ "volume": 2e-4 }));
    let components = json!([one("comp", "compressor", numbers), tank, line, end, fitting("out", 2e-9)]);
    let joints = json!([["comp.1", "tank.1", "line.1"], ["line.2", "end.1", "out.1"], ["out.2", "ambient"]]);
    let network = network(&virial_gas(CARBON_DIOXIDE, &carbon_dioxide()), &components, &joints);
    let mut start: Vec<(&str, f64)> = vec![("tank.pressure_pa", 6e5), ("end.pressure_pa", 2e5)];
    let names = network.assembly.given_names();
    for name in &names {
        if !start.iter().any(|(own, _)| own == name) {
            start.push((name, if name.ends_with("_pa") { 2e5 } else { 280.0 }));
        }
    }
    let (columns, ledger) = run_columns(&network, &[], (0.3, 100.0), &start);
    assert!(columns["line.mass_flow_kg_s"].iter().any(|flow| *flow > 1e-4));
    let [mass, energy, entropy] = ledger;
    assert!(mass.abs() < 1e-12 && energy.abs() < 1e-6 && entropy.abs() < 1e-6, "{ledger:?}");
}

/// Rates with their derivatives in all states.
fn rates(circuit: &Circuit<f64>, y: &[f64]) -> Vec<f64> {
    let n = y.len();
    let along =
        |(i, &re): (usize, &f64)| Dual::<f64, 8> { re, eps: std::array::from_fn(|k| f64::from(k == i)) };
    let y: Vec<_> = y.iter().enumerate().map(along).collect();
    let mut dy = vec![Dual::from(0.0); n];
    circuit.rhs(Dual::from(0.0), &y, &mut dy, &mut circuit.work());
    dy.iter().flat_map(|own| own.eps[..n].iter().copied().chain([own.re])).collect()
}

/// Not whole runs: that the temperature depends on the volume makes another pattern, and so another order of elimination.
#[test]
fn without_a_coefficient_equations_have_the_bits_of_the_ideal_gas() {
    let none = spec::Virial { a_m3_kg: 0.0, b_m3_kg: 0.0, c_k: 100.0 };
    let [ideal, zero] = [None, Some(none)].map(|virial| {
        let mut drive = reference();
        drive.gas.virial = virial;
        Drive::assemble(&drive, false).expect("assembles")
    });
    let start = |drive: &Drive, u| drive.start(&at_rest(0.1, 3e5), u);
    let mut trace = Trace::every(0.05, 0.5);
    let ((circuit, y), (own, own_y)) = (start(&ideal, 0.6), start(&zero, 0.6));
    assert_eq!(bits(&y), bits(&own_y));
    let mut stepper = Stepper::new(circuit.clone(), 0.0, &y, options(1e-6));
    advance(&mut stepper, 0.5, &mut trace);
    trace.finish(&stepper);
    assert!(trace.states.len() == 11);
    for y in &trace.states {
        assert_eq!(bits(&rates(&circuit, y)), bits(&rates(&own, y)));
    }
}

/// The flow law asks for pressure and temperature only. It may not see the state that an ideal gas would have.
#[test]
fn the_flow_out_of_a_chamber_follows_from_its_real_pressure_and_temperature() {
    let tank = |name: &str| one(name, "tank", json!({ "volume": 1e-3 }));
    let components = json!([tank("full"), fitting("between", 1e-9), tank("half"), fitting("out", 2e-9)]);
    let joints = json!([["full.1", "between.1"], ["between.2", "half.1", "out.1"], ["out.2", "ambient"]]);
    let (k, r) = CARBON_DIOXIDE;
    let ideal = json!({ "heat_capacity_ratio": k, "gas_constant_j_kg_k": r });
    let start = [
        ("full.pressure_pa", 1e6),
        ("full.temperature_k", 260.0),
        ("half.pressure_pa", 9e5),
        ("half.temperature_k", 300.0),
    ];
    let flows = [ideal, virial_gas(CARBON_DIOXIDE, &carbon_dioxide())].map(|gas| {
        let (columns, _) = run_columns(&network(&gas, &components, &joints), &[], (1e-3, 1e3), &start);
        ["between", "out"].map(|name| columns[&format!("{name}.mass_flow_kg_s")][0])
    });
    for (ideal, real) in flows[0].iter().zip(flows[1]) {
        assert_close("flow", real, *ideal, 1e-5);
    }
}
