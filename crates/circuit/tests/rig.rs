//! A friction rig with real chambers and a real servo axis: the force of the air at constant speed is
//! that of quasi-steady flow through ports, lines and regulators; mass, energy and entropy close, in
//! released holds and with the supply shut too; a run cut in two is the run in one piece; the carriage
//! follows as a position loop of second order does; a leak empties as a leak does.

mod support;

use circuit::specification::{self as spec, AirSupply, Chamber, Chambers, Manifold, Orifice};
use circuit::{End, Motion, Rig, Run, Start};
use std::f64::consts::{PI, TAU};
use support::*;

const BORE: f64 = 0.025;
const AREA: f64 = 0.25 * PI * BORE * BORE;
const STROKE: f64 = 0.3;

fn orifice_of(c: f64) -> Orifice {
    Orifice { conductance_m3_s_pa: c, critical_pressure_ratio: 0.3 }
}

fn manifold() -> Manifold {
    Manifold { volume_m3: 30e-6, wall_m2: 0.02 }
}

fn open(c: f64) -> AirSupply {
    AirSupply::Open { ports: [orifice_of(c); 2] }
}

fn common(regulator: f64, line: f64) -> AirSupply {
    AirSupply::Common { regulator: orifice_of(regulator), manifold: manifold(), lines: [orifice_of(line); 2] }
}

fn separate(regulator: f64, line: f64) -> AirSupply {
    AirSupply::Separate {
        regulator: orifice_of(regulator),
        manifold: manifold(),
        lines: [orifice_of(line); 2],
    }
}

fn chambers(supply: AirSupply) -> Chambers {
    let one = Chamber { dead_volume_m3: 5e-6, perimeter_m: PI * BORE, leakage_m3_s_pa: 0.0 };
    Chambers { supply, a: one, b: one, heat_transfer_w_m2_k: 50.0, piston_leakage_m3_s_pa: 0.0 }
}

fn rig(supply: Option<AirSupply>) -> spec::Rig {
    let friction = [("coulomb", 9.0), ("breakaway", 12.0), ("stribeck_velocity", 0.005), ("viscous", 5.0)];
    spec::Rig {
        friction: spec::Friction::of(
            "stribeck",
            friction.iter().map(|(name, value)| ((*name).into(), *value)).collect(),
        ),
        area_a_m2: AREA,
        area_b_m2: AREA,
        moving_mass_kg: 0.8,
        ambient_pressure_pa: AMBIENT,
        pressure_a_pa: AMBIENT + 1e5,
        pressure_b_pa: AMBIENT + 1e5,
        stroke_m: STROKE,
        incline_rad: 0.0,
        sensor_stiffness_n_m: 2e6,
        sensor_damping_n_s_m: 2000.0,
        temperature_k: Some(ROOM),
        chambers: supply.map(chambers),
        servo: None,
        ripple: None,
        release_time_s: None,
        initial_age_s: 0.0,
    }
}

fn lugre(spec: &mut spec::Rig) {
    spec.friction.law = "lugre".into();
    for (name, value) in
        [("bristle_stiffness", 1e6), ("bristle_damping", 300.0), ("damping_fade_velocity", 0.1)]
    {
        spec.friction.parameters.insert(name.into(), value);
    }
}

/// A move by `way` m at `speed` m/s with ramps of `ramp` s and square jerks; durations and jerks.
fn travel(way: f64, speed: f64, ramp: f64) -> (Vec<f64>, Vec<f64>) {
    let jerk = way.signum() * speed / (0.25 * ramp * ramp);
    let (half, cruise) = (0.5 * ramp, way.abs() / speed - ramp);
    (vec![half, half, cruise, half, half], vec![jerk, -jerk, 0.0, -jerk, jerk])
}

#[derive(Clone, Copy, Default)]
struct How {
    released: bool,
    shut: bool,
}

fn run(rig: &Rig, plan: &(Vec<f64>, Vec<f64>), how: How, from: Start, rtol: f64) -> (Run, End) {
    let motion = Motion { durations: &plan.0, jerks: &plan.1, released: how.released, shut: how.shut };
    let duration: f64 = plan.0.iter().sum();
    let times: Vec<f64> = (0..=2000).map(|k| duration * f64::from(k) / 2000.0).collect();
    rig.run(&motion, &times, from, options(rtol), &mut |_| false).expect("runs")
}

fn column<'r>(rig: &Rig, run: &'r Run, name: &str) -> &'r [f64] {
    &run.columns[rig.columns().iter().position(|column| column == name).expect(name)]
}

/// Pressure on one side of a path of conductance `c` with `other` on its other side, when it passes
/// what q m3/s are at that pressure, out or in: the ideal gas law and ISO 6358 with its linear part,
/// isothermal, solved by bisection.
fn behind(c: f64, q: f64, other: f64, leaving: bool) -> f64 {
    let subsonic = |r: f64| (1.0 - ((r - 0.3) / 0.7).powi(2)).sqrt();
    let flow = |up: f64, down: f64| {
        let r = down / up;
        let share = if r > 0.999 { 1e3 * (1.0 - r) * subsonic(0.999) } else { subsonic(r.max(0.3)) };
        c * up * 1.185 * (293.15 / ROOM).sqrt() * share
    };
    let (mut low, mut high) = if leaving { (other, 10.0 * other) } else { (0.5 * other, other) };
    for _ in 0..200 {
        let p = 0.5 * (low + high);
        let needed = p * q / (R * ROOM);
        let enough = if leaving { flow(p, other) > needed } else { flow(other, p) > needed };
        if leaving == enough { high = p } else { low = p }
    }
    0.5 * (low + high)
}

#[test]
fn air_at_constant_speed_pushes_back_as_quasi_steady_flow_says() {
    let set = AMBIENT + 1e5;
    for speed in [0.05, 0.2, 0.45] {
        let q = AREA * speed;
        // Two paths in series between regulator and chamber: each takes its own drop.
        let through_two = |leaving: bool| {
            let hose = behind(1.5e-8, q, set, leaving);
            behind(1e-8, q, hose, leaving)
        };
        let cases = [
            ("open", open(0.7e-8), behind(0.7e-8, q, AMBIENT, true) - behind(0.7e-8, q, AMBIENT, false)),
            // What one chamber gives, the other takes: the regulator has next to nothing to do.
            ("common", common(1.5e-8, 1e-8), behind(1e-8, q, set, true) - behind(1e-8, q, set, false)),
            ("separate", separate(1.5e-8, 1e-8), through_two(true) - through_two(false)),
        ];
        for (name, supply, difference) in cases {
            let rig = Rig::assemble(&rig(Some(supply)), false).expect(name);
            for way in [0.29, -0.29] {
                let plan = travel(way, speed, 0.03);
                let start = if way > 0.0 { 0.005 } else { 0.295 };
                let (run, _) = run(&rig, &plan, How::default(), Start::Rest(start), 1e-8);
                let at = |name: &str| column(&rig, &run, name)[1000];
                let air = AREA * (at("pressure_a_pa") - at("pressure_b_pa"));
                let expected = -way.signum() * AREA * difference;
                println!("{name} {speed} m/s: {air:.3} N, quasi-steady {expected:.3} N");
                assert!((air / expected - 1.0).abs() < 0.03, "{name} {speed}: {air} {expected}");
                let rest =
                    at("sensor_force_n") + air - at("friction_force_n") - 0.8 * at("acceleration_m_s2");
                assert!(rest.abs() < 1e-9, "{name}: force balance leaves {rest} N");
            }
        }
    }
}

#[test]
fn books_close_while_it_moves_waits_gives_way_and_is_shut_off() {
    let mut cases = vec![("held", rig(None))];
    for (name, supply) in
        [("open", open(0.7e-8)), ("common", common(1.5e-8, 1e-8)), ("separate", separate(1.5e-8, 1e-8))]
    {
        let mut spec = rig(Some(supply));
        spec.servo = Some(spec::ServoAxis { bandwidth_hz: 50.0, damping_ratio: 0.7 });
        spec.ripple = Some(spec::Ripple { velocity: 0.01, pitch_m: 0.005 });
        spec.incline_rad = 0.1;
        lugre(&mut spec);
        if let Some(chambers) = &mut spec.chambers {
            chambers.piston_leakage_m3_s_pa = 1e-12;
            chambers.a.leakage_m3_s_pa = 1e-12;
        }
        if name == "separate" {
            spec.pressure_b_pa = AMBIENT + 0.5e5;
        }
        cases.push((name, spec));
    }
    for (name, spec) in cases {
        let rig = Rig::assemble(&spec, true).expect(name);
        let wait = (vec![0.7], vec![0.0]);
        // Down first: a released axis on an incline or under unequal pressure gives way for good.
        let plans = [
            ("out", travel(0.2, 0.3, 0.05), How::default()),
            ("held", wait.clone(), How::default()),
            ("released", wait.clone(), How { released: true, shut: false }),
            ("shut", travel(-0.1, 0.2, 0.05), How { released: false, shut: true }),
        ];
        let mut state: Option<Vec<f64>> = None;
        let mut all = Vec::new();
        for (what, plan, how) in plans {
            let from = state.as_deref().map_or(Start::Rest(0.02), Start::State);
            let (run, end) = run(&rig, &plan, how, from, 1e-9);
            let balance = run.balance.expect("a ledger");
            println!(
                "{name} {what}: mass {:.1e}, energy {:.1e}, entropy {:.1e}, least production {:.1e}, {:.2e} J",
                balance.mass_error,
                balance.energy_error,
                balance.entropy_error,
                balance.least_production,
                balance.turnover
            );
            assert!(balance.mass_error.abs() < 1e-12, "{name} {what}: mass {:e}", balance.mass_error);
            // Where next to nothing is turned over the rounding of what is stored shows.
            let energy = balance.energy_error * balance.turnover;
            assert!(balance.entropy_error.abs() < 1e-8, "{name} {what}: {:e}", balance.entropy_error);
            assert!(energy.abs() < 1e-6 * balance.turnover + 1e-10, "{name} {what}: energy {energy:e} J");
            // As exact as the integral of a rate with a kink, where a motion turns round.
            let least = -1e-9 * balance.turnover / ROOM - 1e-15;
            assert!(balance.least_production > least, "{name} {what}: {:e}", balance.least_production);
            all.extend(run.columns.concat());
            all.extend(&end.state);
            state = Some(end.state);
        }
        pinned(&format!("rig/{name}"), all);
    }
}

#[test]
fn cut_in_two_it_is_the_same_run() {
    let mut spec = rig(Some(separate(1.5e-8, 1e-8)));
    spec.servo = Some(spec::ServoAxis { bandwidth_hz: 50.0, damping_ratio: 0.7 });
    lugre(&mut spec);
    let rig = Rig::assemble(&spec, false).expect("assembles");
    let (durations, jerks) = travel(0.2, 0.1, 0.05);
    let cut = |range: std::ops::Range<usize>| (durations[range.clone()].to_vec(), jerks[range].to_vec());
    let whole = run(&rig, &cut(0..5), How::default(), Start::Rest(0.02), 1e-9).1;
    let half = run(&rig, &cut(0..3), How::default(), Start::Rest(0.02), 1e-9).1;
    let again = run(&rig, &cut(0..3), How::default(), Start::Rest(0.02), 1e-9).1;
    assert_eq!(bits(&half.state), bits(&again.state), "the same run gives the same bits");
    let rest = run(&rig, &cut(3..5), How::default(), Start::State(&half.state), 1e-9).1;
    for (i, (one, two)) in whole.state.iter().zip(&rest.state).enumerate() {
        assert!((one - two).abs() < 1e-7 * (one.abs() + 1e-3), "state {i}: {one} {two}");
    }
    assert!((rest.commanded - 0.22).abs() < 1e-12);
}

#[test]
fn released_it_shows_no_force_and_goes_on_from_where_it_stands() {
    for follows in [false, true] {
        let mut spec = rig(None);
        lugre(&mut spec);
        if follows {
            spec.servo = Some(spec::ServoAxis { bandwidth_hz: 50.0, damping_ratio: 0.7 });
        }
        let rig = Rig::assemble(&spec, false).expect("assembles");
        let wait = (vec![2.0], vec![0.0]);
        let moved = run(&rig, &travel(0.1, 0.05, 0.05), How::default(), Start::Rest(0.02), 1e-9).1;
        let (kept, _) = run(&rig, &wait, How::default(), Start::State(&moved.state), 1e-9);
        let (freed, end) =
            run(&rig, &wait, How { released: true, shut: false }, Start::State(&moved.state), 1e-9);
        let last = |run: &Run, name: &str| *column(&rig, run, name).last().expect("samples");
        // Held, the bristles keep most of the force of sliding; released, nothing is left of it.
        assert!(last(&kept, "sensor_force_n") > 5.0);
        assert!(last(&freed, "sensor_force_n").abs() < 1e-6);
        assert!(last(&freed, "bristle_deflection_m").abs() < 1e-10);
        let stands = last(&freed, "position_m");
        assert!((end.commanded - stands).abs() < 1e-9, "the command is where the piston stands");
        // It sprang back by what sensor and bristles had been bent: some 10 N over 1 N/um.
        let back = last(&kept, "carriage_position_m") - end.commanded;
        assert!((1e-6..1e-4).contains(&back), "{back} m");
        let on = run(&rig, &wait, How::default(), Start::State(&end.state), 1e-9);
        assert!(column(&rig, &on.0, "sensor_force_n").iter().all(|force| force.abs() < 1e-3));
    }
}

#[test]
fn the_carriage_follows_as_a_loop_of_second_order() {
    // Under constant acceleration the lag is a/w^2, at constant speed it is zero; the velocity ripples.
    let mut spec = rig(None);
    spec.servo = Some(spec::ServoAxis { bandwidth_hz: 20.0, damping_ratio: 0.8 });
    let rig_20 = Rig::assemble(&spec, false).expect("assembles");
    let (a, w) = (0.5, TAU * 20.0);
    // Up to 0.5 m/s2 within 1 ms, then constant acceleration for 0.3 s, then constant speed for 0.3 s.
    let plan = (vec![1e-3, 0.3, 1e-3, 0.3], vec![500.0, 0.0, -500.0, 0.0]);
    let (run_20, _) = run(&rig_20, &plan, How::default(), Start::Rest(0.02), 1e-9);
    let (t, x) = (column(&rig_20, &run_20, "time_s"), column(&rig_20, &run_20, "carriage_position_m"));
    let commanded = |t: f64| {
        let ramp = 1e-3_f64;
        let (v1, x1) = (0.5 * a * ramp, a * ramp * ramp / 6.0);
        let s = (t - ramp).clamp(0.0, 0.3);
        let (v2, x2) = (v1 + a * 0.3, x1 + v1 * 0.3 + 0.5 * a * 0.09);
        if t < 0.301 {
            0.02 + x1 + v1 * s + 0.5 * a * s * s
        } else {
            let r = t - 0.301;
            let d = r.min(ramp);
            let (v3, x3) = (
                v2 + a * d - 0.5 * a * d * d / ramp,
                v2 * d + 0.5 * a * d * d - a * d * d * d / (6.0 * ramp),
            );
            0.02 + x2 + x3 + v3 * (r - d)
        }
    };
    let lag = |i: usize| commanded(t[i]) - x[i];
    assert!((lag(990) / (a / (w * w)) - 1.0).abs() < 1e-6, "{} {}", lag(990), a / (w * w));
    assert!(lag(1999).abs() < 1e-12, "{}", lag(1999));

    spec.servo = None;
    spec.ripple = Some(spec::Ripple { velocity: 0.02, pitch_m: 0.005 });
    let rippling = Rig::assemble(&spec, false).expect("assembles");
    let (run_r, _) = run(&rippling, &travel(0.1, 0.05, 0.02), How::default(), Start::Rest(0.02), 1e-9);
    let v = &column(&rippling, &run_r, "carriage_velocity_m_s")[200..1800];
    let (low, high) = v.iter().fold((f64::MAX, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    assert!((high / 0.05 - 1.02).abs() < 1e-4 && (low / 0.05 - 0.98).abs() < 1e-4, "{low} {high}");
}

#[test]
fn shut_off_it_keeps_its_air_but_for_the_leak() {
    let mut spec = rig(Some(common(1.5e-8, 1e-8)));
    let wait = (vec![20.0], vec![0.0]);
    let shut = How { released: false, shut: true };
    let tight = Rig::assemble(&spec, true).expect("assembles");
    let (kept, _) = run(&tight, &wait, shut, Start::Rest(0.1), 1e-9);
    let p = column(&tight, &kept, "pressure_a_pa");
    assert!(p.iter().all(|p| (p / (AMBIENT + 1e5) - 1.0).abs() < 1e-12));
    // All chambers fall together through the leak: dp/dt = -R T m_dot/V, isothermal, subsonic or not.
    let c = 2e-11;
    spec.chambers.as_mut().expect("chambers").b.leakage_m3_s_pa = c;
    let leaking = Rig::assemble(&spec, true).expect("assembles");
    let (fallen, _) = run(&leaking, &wait, shut, Start::Rest(0.1), 1e-9);
    let volume = AREA * STROKE + 10e-6 + manifold().volume_m3;
    let mut p = AMBIENT + 1e5;
    let steps = 20_000;
    for _ in 0..steps {
        let s = ((AMBIENT / p - 0.2) / 0.8).max(0.0);
        let m_dot = c * p * 1.185 * (1.0 - s * s).sqrt();
        p -= R * ROOM * m_dot / volume * 20.0 / f64::from(steps);
    }
    for chamber in ["pressure_a_pa", "pressure_b_pa"] {
        let end = *column(&leaking, &fallen, chamber).last().expect("samples");
        let fall = AMBIENT + 1e5 - end;
        assert!((fall / (AMBIENT + 1e5 - p) - 1.0).abs() < 0.02, "{chamber}: {fall} {}", AMBIENT + 1e5 - p);
        assert!(fall > 1e3, "a leak that shows: {fall} Pa");
    }
}
