//! Members of case A that differ in eleven numbers, timed:
//! `cargo run --release -p pneudrive-ensemble --example members -- 10000 1e-4 1 eight`.

#[path = "../../circuit/tests/all/support/drive.rs"]
#[allow(dead_code)] // the tests of circuits use more
mod drive;

use ensemble::{Column, Ensemble, EnsembleRequest, Kernel, Plan, Reduction, Statistic};

/// Numbers in which members differ, with their ranges.
const VARY: [(&str, f64, f64); 12] = [
    ("cylinder.moving_mass", 1.0, 4.0),
    ("valve.conductance", 1.4e-8, 2.6e-8),
    ("valve.critical_pressure_ratio", 0.2, 0.45),
    ("supply.pressure", 5e5, 8e5),
    ("cylinder.heat_transfer", 10.0, 60.0),
    ("cylinder.friction.parameters.viscous", 20.0, 80.0),
    ("cylinder.friction.parameters.coulomb", 20.0, 40.0),
    ("cylinder.friction.parameters.breakaway", 48.0, 60.0),
    ("cylinder.friction.parameters.stribeck_velocity", 0.01, 0.03),
    ("cylinder.dead_volume_a", 0.5e-5, 2e-5),
    ("cylinder.dead_volume_b", 0.5e-5, 2e-5),
    ("cylinder.friction.parameters.bristle_stiffness", 0.7e5, 1.5e5),
];

fn main() {
    let argument = |place: usize, default: &str| std::env::args().nth(place).unwrap_or(default.into());
    let members: usize = argument(1, "10000").parse().expect("a number of members");
    let rtol: f64 = argument(2, "1e-4").parse().expect("a tolerance");
    let threads: usize = argument(3, "1").parse().expect("a number of threads");
    let names: Vec<String> = VARY.iter().map(|(name, ..)| name.to_string()).collect();
    let form = serde_json::from_str(include_str!("../../circuit/examples/case_a.json")).expect("valid");
    let json = drive::expand(&form).to_string();
    let ensemble = Ensemble::called(&json, &names, drive::names()).expect("a drive");
    let mut seed = 1_u64;
    let mut share = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let row = |_| VARY.map(|(_, low, high)| low + share() * (high - low));
    let values: Vec<f64> = (0..members).flat_map(row).collect();
    let mut outputs: Vec<Reduction> =
        (1..8).map(|column| Reduction { column, what: Statistic::Final }).collect();
    outputs.push(Reduction { column: 1, what: Statistic::When { value: 0.45, above: true } });
    let asked = EnsembleRequest {
        members,
        values: &values,
        plans: vec![Plan {
            input: "command".into(),
            times: vec![0.0, 1.0],
            values: Column::new(vec![0.6, -0.6], 2),
        }],
        duration: Column::new(vec![2.0], 1),
        initial: Column::new(vec![0.05, 0.0, 3e5, 293.15, 3e5, 293.15], 6),
        contact_age: 0.0,
        outputs,
        rtol,
        budget: None,
        threads,
        kernel: match &*argument(4, "best") {
            "scalar" => Some(Kernel::Scalar),
            "base" => Some(Kernel::Base),
            "eight" => Some(Kernel::Eight),
            _ => None,
        },
    };
    for _ in 0..3 {
        let start = std::time::Instant::now();
        let outcome = ensemble.run(&asked, &mut |_| false).expect("runs");
        let time = start.elapsed().as_secs_f64();
        let numbers = outcome.columns.iter().flatten();
        let hash = numbers.fold(0_u64, |hash, value| hash.rotate_left(5) ^ value.to_bits());
        println!(
            "{:.1} us a member, {:.1} attempts each, {} not done, {hash:x}",
            time * 1e6 / members as f64,
            outcome.attempts as f64 / members as f64,
            outcome.reasons.len()
        );
    }
}
