//! Left and right are alike: with the chambers exchanged and the axis turned round, the motion is the
//! negative, bit for bit; a drive described from its other end moves as before.

use crate::support::drive::{self, Drive};
use crate::support::*;
use circuit::{AxisId, ChamberLaw, Circuit, InputId};
use ode::Stepper;
use physics::friction::AnyLaw;
use physics::heat::Heat;

/// A piston in the middle of its cylinder, x from the middle; `side` = -1 is the mirror image.
fn piston(friction: &AnyLaw<f64>, side: f64) -> (Circuit<f64>, AxisId, [InputId; 4], Vec<f64>) {
    let mut circuit = empty();
    let supply = circuit.reservoir(7e5, 310.0);
    let exhaust = circuit.reservoir(AMBIENT, ROOM);
    let axis = circuit.axis(2.0, side * 0.3, side * 7.0, Some(friction.clone().into()));
    circuit.spring(axis, 300.0, side * 0.01);
    // The first chamber has the larger area and lies to the left of the original, right of the image.
    let mut chamber = |area: f64, left: bool| {
        let gas =
            circuit.vessel(ChamberLaw::EnergyBalance, [1e-5 + 0.15 * area, 0.01], Heat::Newton(30.0), 280.0);
        circuit.face(gas, axis, left == (side > 0.0), 0.0, circuit::PistonSide::new(area, 0.07, 2.0 * area));
        gas
    };
    let (one, two) = (chamber(6e-4, true), chamber(5e-4, false));
    let mut edge = |from, to| circuit.restriction(orifice(1e-8), from, to);
    let edges = [edge(supply, one), edge(one, exhaust), edge(supply, two), edge(two, exhaust)];
    let mut circuit = circuit.build(false);
    let y = circuit.initial(&[(one, 3e5, 300.0), (two, 2e5, ROOM)], &[(axis, side * 0.02, side * 0.1)]);
    (circuit, axis, edges, y)
}

/// Positions, velocities, accelerations, friction at 1 kHz, and pressures of the first chamber.
fn motion(friction: &AnyLaw<f64>, side: f64) -> (Vec<[f64; 4]>, Vec<u64>) {
    let (circuit, axis, edges, y) = piston(friction, side);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-7));
    let mut trace = Trace::every(1e-3, 1.2);
    for (i, u) in [0.04, -0.03, 0.0, 0.02].into_iter().enumerate() {
        let (extend, retract) = (f64::max(u, 0.0), f64::max(-u, 0.0));
        for (edge, opening) in edges.iter().zip([extend, retract, retract, extend]) {
            stepper.system_mut().set_input(*edge, 0, opening);
        }
        advance(&mut stepper, 0.3 * (i + 1) as f64, &mut trace);
    }
    trace.finish(&stepper);
    let row = |y: &Vec<f64>| {
        let net = nodes(stepper.system(), y);
        ([net[axis].x, net[axis].v, net[axis].a, net[axis].friction], net.gas[2].p.to_bits())
    };
    trace.states.iter().map(row).unzip()
}

#[test]
fn the_mirror_image_moves_the_other_way_bit_for_bit() {
    let values = [
        ("coulomb", 20.0),
        ("breakaway", 30.0),
        ("stribeck_velocity", 0.02),
        ("viscous", 40.0),
        ("bristle_stiffness", 1e5),
        ("bristle_damping", 300.0),
    ];
    let laws =
        [law("coulomb", &[values[0], values[3]]), law("stribeck", &values[..4]), law("lugre", &values)];
    for friction in laws {
        let (original, p) = motion(&friction, 1.0);
        let (image, p_image) = motion(&friction, -1.0);
        assert_eq!(p, p_image);
        for (one, two) in original.iter().zip(&image) {
            assert!((0..4).all(|i| one[i] == -two[i]), "{one:?} {two:?}");
        }
        let travel = original.iter().map(|row| row[0].abs()).fold(0.0, f64::max);
        assert!(travel > 0.03, "it moves: {travel}");
    }
}

/// The same drive described from its other end.
fn turned(spec: &drive::Spec) -> drive::Spec {
    let mut spec = spec.clone();
    let cylinder = &mut spec.cylinder;
    std::mem::swap(&mut cylinder.dead_volume_a_m3, &mut cylinder.dead_volume_b_m3);
    cylinder.incline_rad = -cylinder.incline_rad;
    spec.load.force_n = -spec.load.force_n;
    if let Some(spring) = &mut spec.load.spring {
        spring.rest_position_m = cylinder.stroke_m - spring.rest_position_m;
    }
    if let Some(lips) = &mut spec.friction.pressure {
        *lips = std::mem::take(lips)
            .into_iter()
            .map(|(key, value)| {
                let (level, chamber) = key.split_at(key.len() - 1);
                (format!("{level}{}", if chamber == "a" { "b" } else { "a" }), value)
            })
            .collect();
    }
    spec
}

#[test]
fn a_drive_described_from_its_other_end_moves_the_same() {
    let mut spec = reference();
    spec.cylinder.kind = drive::CylinderKind::ThroughRod;
    spec.cylinder.rod_diameter_m = 0.01;
    spec.cylinder.dead_volume_b_m3 = 2.5e-5;
    spec.cylinder.incline_rad = 0.4;
    spec.load.force_n = 8.0;
    spec.load.spring = Some(drive::LoadSpring { stiffness_n_m: 200.0, rest_position_m: 0.1 });
    spec.friction.pressure = Some(
        [("coulomb_a", 1e-5), ("coulomb_b", 0.0), ("breakaway_a", 2e-5), ("breakaway_b", 1e-5)]
            .map(|(key, value)| (key.into(), value))
            .into(),
    );
    let run = |spec: &drive::Spec, x0: f64, sign: f64| {
        let drive = Drive::assemble(spec, false).expect("assembles");
        let commands = [0.6, -0.6, 0.1].map(|u| sign * u);
        let never = &mut |_| false;
        let mut initial = at_rest(x0, 3e5);
        (initial.pressure_a_pa, initial.pressure_b_pa) = if sign > 0.0 { (3e5, 2e5) } else { (2e5, 3e5) };
        let times = [0.0, 0.8, 1.4];
        drive
            .simulate(&times, &commands, (2.0, 500.0), &initial, options(1e-10), never)
            .expect("runs")
            .columns
    };
    let (one, two) = (run(&spec, 0.05, 1.0), run(&turned(&spec), 0.45, -1.0));
    // Columns: 1 position, 2 velocity, 4 and 5 pressure and temperature in a, 6 and 7 in b.
    for i in 0..one[0].len() {
        assert!((one[1][i] + two[1][i] - 0.5).abs() < 1e-8, "position at {} s", one[0][i]);
        assert!((one[2][i] + two[2][i]).abs() < 1e-5, "velocity at {} s", one[0][i]);
        assert!((one[4][i] / two[6][i] - 1.0).abs() < 1e-6, "pressure at {} s", one[0][i]);
        assert!((one[7][i] / two[5][i] - 1.0).abs() < 1e-6, "temperature at {} s", one[0][i]);
    }
    let top = one[1].iter().fold(0.0, |top: f64, x| top.max(*x));
    assert!(top > 0.5 - 1e-5, "it reached the stop: {top}");
}
