//! Whatever is an input of some part can be set while the circuit runs: the rates follow it at once, as if the
//! circuit had been built with that value, and their derivative by it is the slope of their values.

use crate::support::*;
use circuit::{ChamberLaw, Circuit, InputId, PistonSide};
use math::Dual;
use ode::{NoOutput, Stepper, System};
use physics::heat::Heat;

/// A cylinder on two edges, and a sled on a spring that a carriage drags: every kind of part with inputs.
fn plant() -> (Circuit<f64>, Vec<f64>) {
    let mut circuit = empty();
    let supply = circuit.reservoir(7e5, 300.0);
    let exhaust = circuit.reservoir(AMBIENT, ROOM);
    let piston = circuit.axis(2.0, 0.3, 0.0, Some(stribeck().into()));
    let mut chamber = |grows: bool| {
        let gas = circuit.vessel(ChamberLaw::EnergyBalance, [1e-5, 1e-3], Heat::Newton(50.0), 285.0);
        circuit.face(gas, piston, grows, 0.3, PistonSide::new(5e-4, 0.08, 1e-3));
        gas
    };
    let (a, b) = (chamber(true), chamber(false));
    circuit.end_stops(piston, stop(), 0.3);
    let edges =
        [circuit.restriction(orifice(1e-8), supply, a), circuit.restriction(orifice(1e-8), b, exhaust)];
    let sled = circuit.axis(1.0, 0.0, 0.0, None);
    circuit.spring(sled, 100.0, 0.0);
    let (node, carriage) = circuit.servo(circuit::Carriage::rigid().yielding(1e4, 0.02));
    circuit.link(node, sled, 1e4, 10.0);
    let mut circuit = circuit.build(false);
    let (gas, axes) =
        ([(a, 3e5, 290.0), (b, 4e5, 310.0)], [(piston, 0.1, 0.2), (sled, 0.01, 0.1), (node, 0.02, 0.3)]);
    let y = circuit.initial(&gas, &axes);
    for edge in edges {
        circuit.set_input(edge, 0, 0.4);
    }
    circuit.set_input(carriage.input(1), 0, 0.5);
    (circuit, y)
}

/// Where the inputs of the plant stand, in their order.
/// Of the directions that the core takes at once; here only the first is asked.
type Seeded = Dual<f64, { circuit::DIRECTIONS }>;

fn value(name: &str) -> f64 {
    match name {
        "Reservoir 0: pressure" => 7e5,
        "Reservoir 0: temperature" => 300.0,
        "Reservoir 1: pressure" => AMBIENT,
        "Reservoir 1: temperature" => ROOM,
        name if name.ends_with("opening") => 0.4,
        name if name.ends_with("giving way") => 0.5,
        _ => 0.0,
    }
}

fn rates(circuit: &Circuit<f64>, y: &[f64], id: InputId, value: f64) -> Vec<f64> {
    let mut circuit = circuit.clone();
    circuit.set_input(id, 0, value);
    let mut dy = vec![0.0; y.len()];
    circuit.rhs(0.0, y, &mut dy, &mut circuit.work::<f64>());
    dy
}

#[test]
fn rates_follow_every_input_with_its_derivative() {
    let (circuit, y) = plant();
    let lifted = Circuit::<Seeded>::gather(&[&circuit]);
    let inputs = circuit.inputs();
    let kinds = ["Cylinder 0", "Reservoir 0", "Restriction 0", "Axis 0", "Carriage 0"];
    assert!(kinds.iter().all(|kind| inputs.iter().any(|(_, name, _)| name.starts_with(kind))), "{inputs:?}");
    for (id, name, input) in inputs {
        let at = value(&name);
        assert!(input.bounds.contain(at), "{name}");
        let step = 1e-4 * at.abs().max(1.0);
        let (above, below) = (rates(&circuit, &y, id, at + step), rates(&circuit, &y, id, at - step));
        let mut seeded = lifted.clone();
        seeded.set_input(id, 0, Dual::variable(at, 0));
        let y: Vec<Seeded> = y.iter().map(|&value| value.into()).collect();
        let mut dy = y.clone();
        seeded.rhs(0.0.into(), &y, &mut dy, &mut seeded.work());
        let mut most = 0.0_f64;
        for ((above, below), exact) in above.iter().zip(&below).zip(&dy) {
            let slope = (above - below) / (2.0 * step);
            assert!((slope - exact.eps[0]).abs() <= 1e-6 * slope.abs() + 1e-9, "{name}: {slope} {exact:?}");
            most = most.max(slope.abs());
        }
        // Upstream of a shut side a downstream pressure has no effect on choked flow.
        assert!(most > 0.0 || name.starts_with("Reservoir 1"), "{name} moves nothing");
    }
}

#[test]
fn a_shut_edge_has_a_derivative_by_its_opening() {
    let (mut circuit, y) = plant();
    let (id, ..) =
        *circuit.inputs().iter().find(|(_, name, _)| name == "Restriction 0: opening").expect("an edge");
    circuit.set_input(id, 0, 0.0);
    let flow = rates(&circuit, &y, id, 1.0)[2];
    let mut seeded = Circuit::<Seeded>::gather(&[&circuit]);
    seeded.set_input(id, 0, Dual::variable(0.0, 0));
    let y: Vec<Seeded> = y.iter().map(|&value| value.into()).collect();
    let mut dy = y.clone();
    seeded.rhs(0.0.into(), &y, &mut dy, &mut seeded.work());
    assert!(flow > 0.0);
    assert_close("flow for each opening", dy[2].eps[0], flow, 1e-12);
}

#[test]
fn a_tank_follows_the_pressure_of_its_supply() {
    let mut circuit = empty();
    let supply = circuit.reservoir(5e5, ROOM);
    let tank = circuit.vessel(ChamberLaw::EnergyBalance, [1e-5, 1.0], Heat::Newton(100.0), ROOM);
    let line = circuit.restriction(orifice(1e-8), supply, tank);
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[(tank, 1e5, ROOM)], &[]);
    circuit.set_input(line, 0, 1.0);
    let [pressure, _] = circuit.boundary(supply);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-8));
    for (i, set) in [5e5, 3e5, 8e5].into_iter().enumerate() {
        stepper.system_mut().set_input(pressure, 0, set);
        advance(&mut stepper, 5.0 * (i + 1) as f64, &mut NoOutput);
        assert_close("pressure", now(&stepper)[tank].p, set, 1e-6);
    }
}
