//! A friction rig with real chambers and a real servo axis: the force of the air at constant speed is
//! that of quasi-steady flow through ports, lines and regulators; mass, energy and entropy close, in
//! released holds and with the supply shut too; a leak empties as a leak does. What the carriage does is held
//! in network.rs, what a motion leaves for the next in Python.

use crate::support::*;
use circuit::{Look, Network, Run};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::f64::consts::PI;

const BORE: f64 = 0.025;
const AREA: f64 = 0.25 * PI * BORE * BORE;
const STROKE: f64 = 0.3;
const HOSE: f64 = 30e-6;
const SET: f64 = AMBIENT + 1e5;

/// Where the air comes from: sonic conductances of regulators and lines.
#[derive(Clone, Copy)]
enum Air {
    Held,
    Open(f64),
    Common(f64, f64),
    Separate(f64, f64),
}

/// A rig as a circuit; what its gas starts at, and the openings that shutting off the supply closes.
struct Rig {
    network: Network,
    filled: BTreeMap<String, f64>,
    supply: Vec<String>,
}

/// A rig before it is made a circuit.
struct Spec {
    air: Air,
    pressures: [f64; 2],
    friction: Value,
    incline: f64,
    /// Numbers of the carriage beside its release.
    carriage: Value,
    /// Leaks past the piston, and from chambers a and b to the outside.
    leaks: [f64; 3],
}

fn rig(air: Air) -> Spec {
    let parameters = json!({ "coulomb": 9.0, "breakaway": 12.0, "stribeck_velocity": 0.005, "viscous": 5.0 });
    Spec {
        air,
        pressures: [SET; 2],
        friction: json!({ "law": "stribeck", "parameters": parameters }),
        incline: 0.0,
        carriage: json!({ "release_stiffness": 2e6 }),
        leaks: [0.0; 3],
    }
}

impl Spec {
    /// The components, each with the joints at its ports.
    fn assemble(&self, ledger: bool) -> Rig {
        let mut wiring = Wiring::default();
        let lip = PI * BORE;
        wiring.add("carriage", "carriage", self.carriage.clone(), &[("1", "servo")]);
        let sensor = json!({ "stiffness": 2e6, "damping": 2000.0 });
        wiring.add("force-sensor", "sensor", sensor, &[("1", "servo"), ("2", "rod")]);
        let piston = json!({ "area_a": AREA, "area_b": AREA, "perimeter_a": lip, "perimeter_b": lip,
                             "stroke": STROKE, "moving_mass": 0.8, "incline": self.incline });
        wiring.add("piston", "piston", piston, &[("a", "a"), ("b", "b"), ("rod", "rod")]);
        wiring.components[2]["friction"] = self.friction.clone();
        if let Air::Common(c, _) = self.air {
            wiring.regulator("hose", c, self.pressures[0]);
        }
        let rest = if let Air::Open(_) = self.air { [AMBIENT; 2] } else { self.pressures };
        for ((side, set), rest) in [("a", self.pressures[0]), ("b", self.pressures[1])].into_iter().zip(rest)
        {
            let hose = format!("hose_{side}");
            let line = format!("line_{side}");
            if let Air::Held = self.air {
                wiring.add("reservoir", side, json!({ "pressure": set }), &[("1", side)]);
                continue;
            }
            wiring.tank(side, (5e-6, 0.0), rest);
            match self.air {
                Air::Open(c) => wiring.supply(&line, c, ["ambient", side]),
                Air::Common(_, c) => wiring.path(&line, [c, 0.3], ["hose", side]),
                Air::Separate(regulator, c) => {
                    wiring.regulator(&hose, regulator, set);
                    wiring.path(&line, [c, 0.3], [&hose, side]);
                }
                Air::Held => {}
            }
        }
        for (i, ends) in [["a", "b"], ["a", "ambient"], ["b", "ambient"]].into_iter().enumerate() {
            if self.leaks[i] > 0.0 {
                wiring.path(&format!("leak_{i}"), [self.leaks[i], 0.2], ends);
            }
        }
        wiring.joints.entry("ambient".into()).or_default().push("ambient".into());
        let joints: Vec<_> = wiring.joints.into_values().collect();
        let spec = json!({
            "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": R },
            "ambient": { "pressure_pa": AMBIENT, "temperature_k": ROOM },
            "components": wiring.components, "joints": joints });
        let spec = serde_json::from_value(spec).expect("a circuit");
        let network = Network::assemble(&spec, ledger).expect("assembles");
        Rig { network, filled: wiring.filled, supply: wiring.supply }
    }
}

/// Components, and the ports at each joint.
#[derive(Default)]
struct Wiring {
    components: Vec<Value>,
    joints: BTreeMap<String, Vec<String>>,
    filled: BTreeMap<String, f64>,
    supply: Vec<String>,
}

impl Wiring {
    fn add(&mut self, kind: &str, name: &str, numbers: Value, ports: &[(&str, &str)]) {
        self.components.push(json!({ "name": name, "kind": kind, "numbers": numbers }));
        for (port, joint) in ports {
            let joint = self.joints.entry((*joint).into()).or_default();
            joint.push(format!("{name}.{port}"));
        }
    }

    fn tank(&mut self, name: &str, (volume, wall): (f64, f64), rest: f64) {
        let numbers = json!({ "volume": volume, "wall_area": wall, "heat_transfer": 50.0 });
        self.add("tank", name, numbers, &[("1", name)]);
        self.filled.insert(format!("{name}.pressure_pa"), rest);
        self.filled.insert(format!("{name}.temperature_k"), ROOM);
    }

    fn path(&mut self, name: &str, [c, b]: [f64; 2], [from, to]: [&str; 2]) {
        let numbers = json!({ "conductance": c, "critical_pressure_ratio": b });
        self.add("fitting", name, numbers, &[("1", from), ("2", to)]);
    }

    fn regulator(&mut self, hose: &str, c: f64, set: f64) {
        let source = format!("source_{hose}");
        self.add("reservoir", &source, json!({ "pressure": set }), &[("1", &source)]);
        self.tank(hose, (HOSE, 0.02), set);
        self.supply(&format!("regulator_{hose}"), c, [&source, hose]);
    }

    fn supply(&mut self, name: &str, c: f64, ends: [&str; 2]) {
        self.path(name, [c, 0.3], ends);
        self.supply.push(format!("{name}.opening"));
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

/// Runs a motion from rest at a position, or from the state at the end of another; returns the state at its end too, where
/// the command is at rest exactly and, after giving way, where the carriage stands.
fn run(
    rig: &Rig,
    (durations, jerks): &(Vec<f64>, Vec<f64>),
    how: How,
    from: Result<f64, &[f64]>,
    rtol: f64,
) -> (Run, Vec<f64>) {
    let assembly = &rig.network.assembly;
    let at_rest = |position| {
        let mut start = rig.filled.clone();
        for own in ["carriage", "piston"] {
            start.insert(format!("{own}.position_m"), position);
            start.insert(format!("{own}.velocity_m_s"), 0.0);
        }
        assembly.session(&start, options(rtol))
    };
    let session = from.map_or_else(|state| assembly.session_from(state, options(rtol)), at_rest);
    let mut session = session.expect("starts");
    let inputs = &assembly.variables.inputs;
    let input = |name: &str| inputs.iter().position(|input| input.name == name).expect("an input");
    for name in rig.supply.iter().filter(|_| how.shut) {
        session.set(input(name), 0.0).expect("shuts");
    }
    session.set(input("carriage.giving_way"), f64::from(how.released)).expect("gives way");
    let mut duration = 0.0;
    for (jerk, own) in jerks.iter().zip(durations) {
        session.schedule(input("carriage.jerk_m_s3"), &[duration], &[*jerk]).expect("a jerk");
        duration += own;
    }
    let all: Vec<usize> = (0..assembly.columns().len()).collect();
    let times = (0..=2000).map(|k| duration * f64::from(k) / 2000.0).collect();
    let run = session.record(duration, times, &all, &mut Look::new(&mut |_| false)).expect("runs");
    let names = session.circuit().state_names();
    let mut state = session.state()[..names.len()].to_vec();
    let place = |begin| names.iter().position(|(name, _)| name.starts_with(begin)).expect("a carriage");
    let (first, x) = (place("carriage."), place("carriage.position_m"));
    if how.released {
        (state[first], state[x + 1]) = (state[x], 0.0);
    }
    if how.released || state[first + 1].abs() < 1e-9 {
        state[first + 1..first + 3].fill(0.0);
    }
    (run, state)
}

fn column<'r>(rig: &Rig, run: &'r Run, name: &str) -> &'r [f64] {
    &run.columns[rig.network.assembly.columns().iter().position(|column| column == name).expect(name)]
}

/// What is pinned of a run: motion, forces, the gas of both chambers and what feeds it, the inner states of friction.
fn shown(rig: &Rig, air: Air, run: &Run) -> Vec<f64> {
    let names = "time_s carriage.position_m carriage.velocity_m_s piston.position_m piston.velocity_m_s \
                 piston.acceleration_m_s2 sensor.force_n piston.friction_force_n piston.a.pressure_pa \
                 piston.a.temperature_k piston.b.pressure_pa piston.b.temperature_k";
    let fed = match air {
        Air::Open(_) => [""; 2],
        Air::Held => ["piston.a.pressure_pa", "piston.b.pressure_pa"],
        Air::Common(..) => ["hose.pressure_pa"; 2],
        Air::Separate(..) => ["hose_a.pressure_pa", "hose_b.pressure_pa"],
    };
    let names = names.split(' ').chain(fed);
    let inner = |name: &&String| *name == "piston.bristle_deflection_m";
    let inner = rig.network.assembly.columns().iter().filter(inner).map(String::as_str);
    let around = vec![AMBIENT; run.columns[0].len()];
    let column = |name: &str| if name.is_empty() { &around } else { column(rig, run, name) };
    names.chain(inner).flat_map(column).copied().collect()
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
    for speed in [0.05, 0.2, 0.45] {
        let q = AREA * speed;
        // Two paths in series between regulator and chamber: each takes its own drop.
        let through_two = |leaving: bool| {
            let hose = behind(1.5e-8, q, SET, leaving);
            behind(1e-8, q, hose, leaving)
        };
        let cases = [
            ("open", Air::Open(0.7e-8), behind(0.7e-8, q, AMBIENT, true) - behind(0.7e-8, q, AMBIENT, false)),
            // What one chamber gives, the other takes: the regulator has next to nothing to do.
            ("common", Air::Common(1.5e-8, 1e-8), behind(1e-8, q, SET, true) - behind(1e-8, q, SET, false)),
            ("separate", Air::Separate(1.5e-8, 1e-8), through_two(true) - through_two(false)),
        ];
        for (name, air, difference) in cases {
            let rig = rig(air).assemble(false);
            for way in [0.29, -0.29] {
                let plan = travel(way, speed, 0.03);
                let start = if way > 0.0 { 0.005 } else { 0.295 };
                let (run, _) = run(&rig, &plan, How::default(), Ok(start), 1e-8);
                let at = |name: &str| column(&rig, &run, name)[1000];
                let push = AREA * (at("piston.a.pressure_pa") - at("piston.b.pressure_pa"));
                let expected = -way.signum() * AREA * difference;
                println!("{name} {speed} m/s: {push:.3} N, quasi-steady {expected:.3} N");
                assert!((push / expected - 1.0).abs() < 0.03, "{name} {speed}: {push} {expected}");
                let rest = at("sensor.force_n") + push
                    - at("piston.friction_force_n")
                    - 0.8 * at("piston.acceleration_m_s2");
                assert!(rest.abs() < 1e-9, "{name}: force balance leaves {rest} N");
            }
        }
    }
}

#[test]
fn books_close_while_it_moves_waits_gives_way_and_is_shut_off() {
    let mut cases = vec![("held", rig(Air::Held))];
    for (name, air) in [
        ("open", Air::Open(0.7e-8)),
        ("common", Air::Common(1.5e-8, 1e-8)),
        ("separate", Air::Separate(1.5e-8, 1e-8)),
    ] {
        let mut spec = rig(air);
        spec.incline = 0.1;
        spec.carriage = json!({ "release_stiffness": 2e6, "servo_bandwidth": 50.0, "servo_damping_ratio": 0.7,
                                "ripple_velocity": 0.01, "ripple_pitch": 0.005 });
        spec.friction["law"] = json!("lugre");
        for (name, value) in
            [("bristle_stiffness", 1e6), ("bristle_damping", 300.0), ("damping_fade_velocity", 0.1)]
        {
            spec.friction["parameters"][name] = json!(value);
        }
        spec.leaks = [1e-12, 1e-12, 0.0];
        if name == "separate" {
            spec.pressures[1] = AMBIENT + 0.5e5;
        }
        cases.push((name, spec));
    }
    for (name, spec) in cases {
        let rig = spec.assemble(true);
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
            let from = state.as_deref().map_or(Ok(0.02), Err);
            let (run, end) = run(&rig, &plan, how, from, 1e-9);
            let balance = run.balance.as_ref().expect("a ledger");
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
            all.extend(shown(&rig, spec.air, &run));
            all.extend(&end);
            state = Some(end);
        }
        pinned(&format!("rig/{name}"), all);
    }
}

#[test]
fn shut_off_it_keeps_its_air_but_for_the_leak() {
    let mut spec = rig(Air::Common(1.5e-8, 1e-8));
    let wait = (vec![20.0], vec![0.0]);
    let shut = How { released: false, shut: true };
    let tight = spec.assemble(true);
    let (kept, _) = run(&tight, &wait, shut, Ok(0.1), 1e-9);
    let p = column(&tight, &kept, "piston.a.pressure_pa");
    assert!(p.iter().all(|p| (p / (AMBIENT + 1e5) - 1.0).abs() < 1e-12));
    // All chambers fall together through the leak: dp/dt = -R T m_dot/V, isothermal, subsonic or not.
    let c = 2e-11;
    spec.leaks[2] = c;
    let leaking = spec.assemble(true);
    let (fallen, _) = run(&leaking, &wait, shut, Ok(0.1), 1e-9);
    let volume = AREA * STROKE + 10e-6 + HOSE;
    let mut p = AMBIENT + 1e5;
    let steps = 20_000;
    for _ in 0..steps {
        let s = ((AMBIENT / p - 0.2) / 0.8).max(0.0);
        let m_dot = c * p * 1.185 * (1.0 - s * s).sqrt();
        p -= R * ROOM * m_dot / volume * 20.0 / f64::from(steps);
    }
    for chamber in ["piston.a.pressure_pa", "piston.b.pressure_pa"] {
        let end = *column(&leaking, &fallen, chamber).last().expect("samples");
        let fall = AMBIENT + 1e5 - end;
        assert!((fall / (AMBIENT + 1e5 - p) - 1.0).abs() < 0.02, "{chamber}: {fall} {}", AMBIENT + 1e5 - p);
        assert!(fall > 1e3, "a leak that shows: {fall} Pa");
    }
}
