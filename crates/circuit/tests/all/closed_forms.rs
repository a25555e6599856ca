//! Where thermodynamics and mechanics have an answer in closed form, the circuit gives it: choked
//! filling and emptying, the temperature of a filled tank, polytropes, the air spring, free fall.

use crate::support::*;
use circuit::{ChamberLaw, Circuit, GasId};
use ode::Stepper;
use physics::heat::Heat;

const SUPPLY: f64 = 7e5;
/// Warmer than the tank, so that an exchange of the two temperatures would be seen.
const SUPPLY_T: f64 = 350.0;
const C: f64 = 2e-8;
const TANK: f64 = 1e-3;
/// W/K: so much that the gas keeps the temperature of the wall to 1e-7.
const PERFECT_WALL: f64 = 1e9;
const PRECISE: f64 = 1e-10;

/// A tank on a reservoir through an orifice, from (p, T); `wall` W/K at room temperature.
fn tank(reservoir: (f64, f64), from: (f64, f64), wall: f64) -> (Circuit<f64>, GasId, Vec<f64>) {
    let mut circuit = empty();
    let outside = circuit.reservoir(reservoir.0, reservoir.1);
    let tank = circuit.vessel(ChamberLaw::EnergyBalance, [TANK, 1.0], Heat::Newton(wall), ROOM);
    let orifice = circuit.restriction(orifice(C), outside, tank);
    let mut circuit = circuit.build(false);
    circuit.set_input(orifice, 0, 1.0);
    let y = circuit.initial(&[(tank, from.0, from.1)], &[]);
    (circuit, tank, y)
}

/// C p rho0 sqrt(T0/T): ISO 6358, choked.
fn choked(p: f64, t: f64) -> f64 {
    C * p * 1.185 * (293.15 / t).sqrt()
}

#[test]
fn choked_filling_raises_the_pressure_evenly() {
    // Choked up to 0.3 of 7 bar: from 0.5 bar to 2 bar.
    for (wall, heats_as) in [(0.0, K * SUPPLY_T), (PERFECT_WALL, ROOM)] {
        let (circuit, tank, y) = tank((SUPPLY, SUPPLY_T), (5e4, ROOM), wall);
        let rise = R * heats_as * choked(SUPPLY, SUPPLY_T) / TANK;
        let end = 1.5e5 / rise;
        let p = now(&run(&circuit, &y, end, PRECISE))[tank].p;
        assert_close("pressure", p, 2e5, 1e-6);
    }
}

#[test]
fn an_evacuated_tank_fills_to_k_times_the_temperature_outside() {
    let (circuit, tank, y) = tank((SUPPLY, SUPPLY_T), (0.05, ROOM), 0.0);
    let net = now(&run(&circuit, &y, 5.0, PRECISE));
    assert_close("pressure", net[tank].p, SUPPLY, 1e-6);
    assert_close("temperature", net[tank].t, K * SUPPLY_T, 1e-6);
}

#[test]
fn adiabatic_discharge_follows_the_isentrope_in_time() {
    let (circuit, tank, y) = tank((1.0, ROOM), (SUPPLY, ROOM), 0.0);
    // m/m0 = [1 + (k - 1)/2 t/tau]^(-2/(k - 1)), tau = m0/m_dot0, as long as it is choked.
    let tau = SUPPLY * TANK / (R * ROOM) / choked(SUPPLY, ROOM);
    for share in [0.1, 1.0, 4.0] {
        let net = now(&run(&circuit, &y, share * tau, PRECISE));
        let mass = (1.0 + 0.5 * (K - 1.0) * share).powf(-2.0 / (K - 1.0));
        assert_close("pressure", net[tank].p, SUPPLY * mass.powf(K), 1e-6);
        let isentrope = ROOM * (net[tank].p / SUPPLY).powf((K - 1.0) / K);
        assert_close("temperature", net[tank].t, isentrope, 1e-6);
    }
}

#[test]
fn isothermal_discharge_is_exponential() {
    let (circuit, tank, y) = tank((1.0, ROOM), (SUPPLY, ROOM), PERFECT_WALL);
    let tau = SUPPLY * TANK / (R * ROOM) / choked(SUPPLY, ROOM);
    for share in [0.1, 1.0, 4.0] {
        let net = now(&run(&circuit, &y, share * tau, PRECISE));
        assert_close("pressure", net[tank].p, SUPPLY * (-share).exp(), 1e-6);
        assert_close("temperature", net[tank].t, ROOM, 1e-6);
    }
}

#[test]
fn two_tanks_share_their_energy() {
    let mut circuit = empty();
    let one = circuit.vessel(ChamberLaw::EnergyBalance, [TANK, 0.0], Heat::Newton(0.0), ROOM);
    let two = circuit.vessel(ChamberLaw::EnergyBalance, [3.0 * TANK, 0.0], Heat::Newton(0.0), ROOM);
    let pipe = circuit.restriction(orifice(C), one, two);
    let mut circuit = circuit.build(false);
    circuit.set_input(pipe, 0, 1.0);
    let y = circuit.initial(&[(one, 8e5, 300.0), (two, 2e5, 280.0)], &[]);
    let net = now(&run(&circuit, &y, 20.0, PRECISE));
    // No heat, no work: U1 + U2 stays, so p = (8 * 1 + 2 * 3)/4 bar; what stays in 1 has expanded.
    assert_close("pressure 1", net[one].p, 3.5e5, 1e-6);
    assert_close("pressure 2", net[two].p, 3.5e5, 1e-6);
    assert_close("temperature 1", net[one].t, 300.0 * (3.5_f64 / 8.0).powf((K - 1.0) / K), 1e-6);
}

/// A closed chamber compressed by a carriage from 100 mm to 40 mm.
fn compress(law: ChamberLaw, wall: f64) -> f64 {
    let mut circuit = empty();
    let chamber = circuit.vessel(law, [1e-5, 1.0], Heat::Newton(wall), ROOM);
    let (carriage, _) = circuit.servo(circuit::Carriage::rigid());
    circuit.face(chamber, carriage, true, 0.0, circuit::PistonSide::new(5e-4, 0.0, 0.0));
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[(chamber, 3e5, ROOM)], &[(carriage, 0.1, -0.2)]);
    let net = now(&run(&circuit, &y, 0.3, PRECISE));
    assert_close("position", net[carriage].x, 0.04, 1e-9);
    assert_close("gas law", net[chamber].t, ROOM * net[chamber].p / 3e5 * 0.5, 1e-8);
    net[chamber].p
}

#[test]
fn closed_chambers_are_polytropes() {
    // Volume 60 cm3 to 30 cm3.
    assert_close("adiabatic", compress(ChamberLaw::EnergyBalance, 0.0), 3e5 * 2.0_f64.powf(1.4), 1e-6);
    assert_close("isothermal", compress(ChamberLaw::EnergyBalance, PERFECT_WALL), 6e5, 1e-6);
    assert_close("as printed", compress(ChamberLaw::AsPrinted, 0.0), 3e5 * 2.0_f64.powf(1.2), 1e-6);
}

/// Frequency, Hz, of 5 kg between two closed chambers, from the zeros of its velocity.
fn air_spring(law: ChamberLaw, wall: f64, areas: (f64, f64), x0: f64, stroke: f64) -> f64 {
    let mut circuit = empty();
    let (a, b) = (
        circuit.vessel(law, [5e-6, 1.0], Heat::Newton(wall), ROOM),
        circuit.vessel(law, [8e-6, 1.0], Heat::Newton(wall), ROOM),
    );
    let p_a = 5e5;
    let p_b = AMBIENT + (p_a - AMBIENT) * areas.0 / areas.1;
    let mass = circuit.axis(5.0, 0.0, 0.0, None);
    circuit.face(a, mass, true, stroke, circuit::PistonSide::new(areas.0, 0.0, 0.0));
    circuit.face(b, mass, false, stroke, circuit::PistonSide::new(areas.1, 0.0, 0.0));
    let mut circuit = circuit.build(false);
    // In equilibrium, but already moving: 0.1 mm/s make an amplitude of 2 um.
    let y = circuit.initial(&[(a, p_a, ROOM), (b, p_b, ROOM)], &[(mass, x0, 1e-4)]);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-11));
    let mut trace = Trace::every(1e-3, 2.0);
    advance(&mut stepper, 2.0, &mut trace);
    trace.finish(&stepper);
    let speed = |i: usize| nodes(stepper.system(), &trace.states[i])[mass].v;
    let mut zeros = Vec::new();
    for i in 1..trace.states.len() {
        let (before, after) = (speed(i - 1), speed(i));
        if (before < 0.0) != (after < 0.0) {
            zeros.push(trace.times[i] - 1e-3 * after / (after - before));
        }
    }
    0.5 * (zeros.len() - 1) as f64 / (zeros[zeros.len() - 1] - zeros[0])
}

#[test]
fn a_piston_between_closed_chambers_is_an_air_spring() {
    let (areas, x0, stroke) = ((8e-4, 7e-4), 0.12, 0.2);
    let p_b = AMBIENT + (5e5 - AMBIENT) * areas.0 / areas.1;
    let (v_a, v_b) = (5e-6 + areas.0 * x0, 8e-6 + areas.1 * (stroke - x0));
    let frequency = |n: f64| {
        let stiffness = n * (5e5 * areas.0 * areas.0 / v_a + p_b * areas.1 * areas.1 / v_b);
        (stiffness / 5.0).sqrt() / std::f64::consts::TAU
    };
    let measured = |law, wall| air_spring(law, wall, areas, x0, stroke);
    assert_close("adiabatic", measured(ChamberLaw::EnergyBalance, 0.0), frequency(1.4), 1e-5);
    assert_close("isothermal", measured(ChamberLaw::EnergyBalance, PERFECT_WALL), frequency(1.0), 1e-5);
    assert_close("as printed", measured(ChamberLaw::AsPrinted, 0.0), frequency(1.2), 1e-5);
}

#[test]
fn weight_pulls_down_the_incline() {
    for (incline, share) in [(0.5 * std::f64::consts::PI, 1.0), (std::f64::consts::PI / 6.0, 0.5)] {
        let mut circuit = empty();
        let mass = circuit.axis(3.0, incline, 0.0, None);
        let mut circuit = circuit.build(false);
        let y = circuit.initial(&[], &[(mass, 1.0, 2.0)]);
        let net = now(&run(&circuit, &y, 1.5, PRECISE));
        // x points up: 1 + 2 t - g sin(incline) t^2/2.
        assert!((net[mass].x - (1.0 + 3.0 - 0.5 * G * share * 2.25)).abs() < 1e-9);
    }
}

#[test]
fn the_ambient_pushes_on_the_rod() {
    // Equal absolute pressures on unequal areas push with p (A_a - A_b), less the ambient on the rod.
    let mut circuit = empty();
    let chamber = |circuit: &mut Circuit<f64>| {
        circuit.vessel(ChamberLaw::EnergyBalance, [1e-5, 0.0], Heat::Newton(0.0), ROOM)
    };
    let (a, b) = (chamber(&mut circuit), chamber(&mut circuit));
    let mass = circuit.axis(2.0, 0.0, 5.0, None);
    circuit.face(a, mass, true, 0.1, circuit::PistonSide::new(8e-4, 0.0, 0.0));
    circuit.face(b, mass, false, 0.1, circuit::PistonSide::new(6e-4, 0.0, 0.0));
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[(a, 4e5, ROOM), (b, 3e5, ROOM)], &[(mass, 0.05, 0.0)]);
    let net = nodes(&circuit, &y);
    let by_hand = 4e5 * 8e-4 - 3e5 * 6e-4 - AMBIENT * 2e-4 + 5.0;
    assert_close("acceleration", net[mass].a, by_hand / 2.0, 1e-13);
}
