//! Books of a drive close: what a run ends with is what it began with and what came over the
//! boundary, in mass, energy and entropy, and no element destroys entropy. A dozen drives that have
//! little in common, each slamming, creeping or resting at the tolerance of conformance runs; and the
//! ledger itself changes no bit of the motion.

use crate::support::drive::{self, CylinderKind, Drive};
use crate::support::*;
use circuit::specification as spec;
use circuit::{Circuit, Kind, balance};
use ode::Stepper;

/// A description, where it starts, and its command, a new one every 0.5 s.
struct Case {
    name: &'static str,
    drive: drive::Spec,
    initial: drive::Initial,
    commands: [f64; 4],
}

fn case(
    name: &'static str,
    commands: [f64; 4],
    change: impl Fn(&mut drive::Spec, &mut drive::Initial),
) -> Case {
    let (mut drive, mut initial) = (reference(), at_rest(0.1, 3e5));
    // Passive, where a case does not say otherwise: 160 > 300 (45 - 30)/30 N s/m.
    drive.friction.parameters.insert("viscous".into(), 160.0);
    change(&mut drive, &mut initial);
    Case { name, drive, initial, commands }
}

fn friction(drive: &mut drive::Spec, law: &str, parameters: &[(&str, f64)]) {
    drive.friction.law = law.into();
    drive.friction.parameters = parameters.iter().map(|(name, value)| ((*name).into(), *value)).collect();
}

const STRIBECK: [(&str, f64); 4] =
    [("coulomb", 20.0), ("breakaway", 33.0), ("stribeck_velocity", 0.01), ("viscous", 60.0)];

fn cases() -> [Case; 17] {
    let slam = [1.0, -1.0, 1.0, -1.0];
    [
        case("reference, not passive", [0.6, 0.6, -0.6, -0.6], |drive, _| {
            drive.friction.parameters.insert("viscous".into(), 40.0);
        }),
        case("exact sticking, creeping", [0.002, 0.002, -0.002, 0.0], |drive, _| {
            friction(drive, "stribeck", &STRIBECK);
        }),
        case("single rod, uphill, load, hot supply", slam, |drive, _| {
            friction(drive, "coulomb", &[("coulomb", 25.0), ("viscous", 30.0)]);
            drive.cylinder.kind = CylinderKind::SingleRod;
            drive.cylinder.bore_m = 0.032;
            drive.cylinder.rod_diameter_m = 0.012;
            drive.cylinder.incline_rad = 1.0;
            drive.load.mass_kg = 5.0;
            drive.supply.temperature_k = 400.0;
        }),
        case("through rod, long, large, faded damping, cold wall", [1.0, 1.0, -1.0, 0.3], |drive, _| {
            drive.cylinder.kind = CylinderKind::ThroughRod;
            drive.cylinder.bore_m = 0.063;
            drive.cylinder.rod_diameter_m = 0.02;
            drive.cylinder.stroke_m = 1.0;
            drive.cylinder.wall_temperature_k = 250.0;
            drive.valve = valve(8e-8, 0.25, 0.5, 0.999);
            drive.friction.parameters.insert("viscous".into(), 0.0);
            drive.friction.parameters.insert("damping_fade_velocity".into(), 0.5);
        }),
        case("small, fast, adiabatic", slam, |drive, initial| {
            drive.cylinder.bore_m = 0.012;
            drive.cylinder.stroke_m = 0.05;
            drive.cylinder.dead_volume_a_m3 = 1e-6;
            drive.cylinder.dead_volume_b_m3 = 2e-6;
            drive.cylinder.moving_mass_kg = 0.1;
            drive.cylinder.heat_transfer_w_m2_k = 0.0;
            friction(drive, "stribeck", &[("coulomb", 3.0), ("breakaway", 5.0), ("stribeck_velocity", 0.02)]);
            initial.position_m = 0.02;
        }),
        case("hanging, external force", [0.3, -0.3, 0.0, 0.05], |drive, _| {
            drive.cylinder.incline_rad = -0.5 * std::f64::consts::PI;
            drive.load.force_n = -40.0;
        }),
        case("spring and seal lips", [0.5, -0.5, 0.2, 0.0], |drive, _| {
            drive.load.spring = Some(drive::LoadSpring { stiffness_n_m: 800.0, rest_position_m: 0.3 });
            drive.friction.pressure = Some(
                [("coulomb_a", 2e-5), ("coulomb_b", 1e-5), ("breakaway_a", 2e-5), ("breakaway_b", 1e-5)]
                    .map(|(key, value)| (key.into(), value))
                    .into(),
            );
        }),
        case("wall that holds the temperature", slam, |drive, _| {
            drive.cylinder.heat_transfer_w_m2_k = 5000.0;
            drive.cylinder.wall_temperature_k = 330.0;
        }),
        case("helium", [0.2, -0.2, 0.4, -0.1], |drive, _| {
            drive.gas = spec::Gas { heat_capacity_ratio: 1.667, gas_constant_j_kg_k: 2077.1, virial: None };
            friction(drive, "stribeck", &STRIBECK);
        }),
        case("carbon dioxide, not ideal", slam, |drive, _| {
            // 137.6 - 87.7 exp(325.7 K/T) cm3/mol.
            let per_kg = 1e-6 * 188.92 / 8.314_462_618;
            let virial = spec::Virial { a_m3_kg: 137.6 * per_kg, b_m3_kg: 87.7 * per_kg, c_k: 325.7 };
            drive.gas =
                spec::Gas { heat_capacity_ratio: 1.289, gas_constant_j_kg_k: 188.92, virial: Some(virial) };
            drive.supply.pressure_pa = 1e6;
            drive.cylinder.leakage_m3_s_pa = 1e-11;
        }),
        case("other index of flow, wide linear part", slam, |drive, _| {
            drive.valve = valve(2e-8, 0.45, 0.6, 0.98);
        }),
        case("more pressure inside than outside", [0.5, -0.5, 0.5, -0.5], |drive, initial| {
            drive.supply.pressure_pa = 4e5;
            (initial.pressure_a_pa, initial.pressure_b_pa) = (8e5, 7.8e5);
            (initial.temperature_a_k, initial.temperature_b_k) = (350.0, 260.0);
        }),
        case("vacuum inside", [0.1, -0.1, 0.1, -0.1], |drive, initial| {
            friction(drive, "stribeck", &STRIBECK);
            (initial.pressure_a_pa, initial.pressure_b_pa) = (4e4, 5e4);
        }),
        case("moving at the start, then closed", [0.0, 0.0, 0.0, 0.0], |drive, initial| {
            friction(drive, "stribeck", &STRIBECK);
            (initial.position_m, initial.velocity_m_s) = (0.3, -2.0);
        }),
        case("bristles with memory of all kinds", [0.3, 0.0, -0.01, -0.8], |drive, initial| {
            drive.friction = everything("elasto-plastic");
            initial.contact_age_s = 40.0;
        }),
        case("lugre with memory of all kinds", [0.004, 0.0, 0.2, 0.0], |drive, _| {
            drive.friction = everything("lugre");
        }),
        case("exact sticking that ages", [0.002, 0.0, -0.003, -0.5], |drive, initial| {
            drive.friction = everything("stribeck");
            initial.contact_age_s = 10.0;
        }),
    ]
}

fn valve(conductance: f64, b: f64, m: f64, linear_above: f64) -> drive::Valve {
    drive::Valve::Proportional53(drive::ProportionalValve {
        conductance_m3_s_pa: conductance,
        critical_pressure_ratio: b,
        subsonic_index: m,
        linear_above,
    })
}

fn run(case: &Case, ledger: bool, rtol: f64) -> (Stepper<f64, Circuit<f64>>, Trace) {
    let drive = Drive::assemble(&case.drive, ledger).expect(case.name);
    let (circuit, y) = drive.start(&case.initial, case.commands[0]);
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(rtol));
    let mut trace = Trace::every(1e-3, 2.0);
    for (i, &u) in case.commands.iter().enumerate() {
        drive.set_command(stepper.system_mut(), 0, u);
        advance(&mut stepper, 0.5 * (i + 1) as f64, &mut trace);
    }
    trace.finish(&stepper);
    (stepper, trace)
}

#[test]
fn mass_energy_and_entropy_close_and_no_element_destroys_entropy() {
    for case in cases() {
        let (stepper, trace) = run(&case, true, 1e-9);
        let (circuit, name) = (stepper.system(), case.name);
        let balance = balance(circuit, &trace.states);
        println!(
            "{name}: mass {:.1e}, energy {:.1e}, entropy {:.1e}, least production {:.1e}, {:.0} J",
            balance.mass_error,
            balance.energy_error,
            balance.entropy_error,
            balance.least_production,
            balance.turnover
        );
        assert!(balance.turnover > 1.0, "{name}: {} J turned over", balance.turnover);
        assert!(balance.mass_error.abs() < 1e-12, "{name}: mass {:e}", balance.mass_error);
        assert!(balance.energy_error.abs() < 1e-6, "{name}: energy {:e}", balance.energy_error);
        assert!(balance.entropy_error.abs() < 1e-6, "{name}: entropy {:e}", balance.entropy_error);
        let passive = Drive::assemble(&case.drive, false).expect(name).warnings().is_empty();
        let production = |kind: Kind| matches!(kind, Kind::EntropyOfGas | Kind::EntropyOfSolid);
        let produced = balance.accounts.iter().filter(|(_, kind, _)| production(*kind));
        let all: f64 = produced.map(|(.., total)| total.abs()).sum();
        let books: Vec<Vec<f64>> = trace.states.iter().map(|y| circuit.books(y).accounts).collect();
        for (i, channel) in circuit.channels().iter().enumerate() {
            if !production(channel.kind) || !passive && channel.name.ends_with("friction") {
                continue;
            }
            let mut gains = books.windows(2).map(|pair| pair[1][i] - pair[0][i]);
            // As exact as the integral of a rate with a kink, where a flow turns round.
            assert!(gains.all(|gain| gain > -1e-10 * all), "{name}: {} destroys entropy", channel.name);
        }
    }
}

#[test]
fn the_ledger_is_a_passenger() {
    for case in cases() {
        let ((with, with_trace), (without, trace)) = (run(&case, true, 1e-6), run(&case, false, 1e-6));
        let n = without.state().len();
        let same = with_trace.states.iter().zip(&trace.states).all(|(a, b)| bits(&a[..n]) == bits(b));
        assert!(same, "{}", case.name);
        let count = |s: ode::Statistics| (s.steps, s.rejected, s.events);
        assert_eq!(count(with.statistics(0)), count(without.statistics(0)), "{}", case.name);
    }
}
