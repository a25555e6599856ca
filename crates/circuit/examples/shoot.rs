//! A servo-like run with derivatives in a loop, for a profiler. `cargo run --release --example shoot` alternates a
//! plain run, one direction and eight directions. `-- 1` runs one direction only.

#[path = "../tests/all/support/drive.rs"]
#[allow(dead_code)] // the tests use more
mod drive;

use circuit::Shooting;
use drive::{Drive, plan};

fn main() {
    let json = include_str!("case_a.json");
    let spec: drive::Spec = serde_json::from_str(json).expect("valid");
    let drive = Drive::assemble(&spec, false).expect("assembles");
    let times: Vec<f64> = (0..=10_000).map(|k| f64::from(k) / 1000.0).collect();
    let run = |parameters: &[&str], with_initial: bool| {
        let asked = Shooting {
            plans: plan(
                "command",
                times.clone(),
                times.iter().map(|t| 0.08 * (9.0 * t).sin() + 0.03 * (31.0 * t).cos()).collect(),
            ),
            sample_times: times.clone(),
            starts: vec![0],
            initial: vec![0.25, 0.0, 3.2e5, 295.0, 2.8e5, 290.0, 1e-6],
            parameters: parameters.iter().map(ToString::to_string).collect(),
            by_start: (!with_initial).then(Vec::new),
            outputs: ["position_m", "pressure_a_pa", "pressure_b_pa"].map(String::from).to_vec(),
            options: ode::Options { rtol: 1e-4, ..Default::default() },
            threads: 1,
        };
        let start = std::time::Instant::now();
        std::hint::black_box(drive.shoot(json, &asked, &mut |_| false).expect("runs"));
        start.elapsed().as_secs_f64() * 1e3
    };
    let only: Option<usize> = std::env::args().nth(1).map(|s| s.parse().expect("0, 1 or 8"));
    let mut best = [(0, f64::INFINITY), (1, f64::INFINITY), (8, f64::INFINITY)];
    for _ in 0..20 {
        for (directions, best) in best.iter_mut().filter(|own| only.is_none_or(|only| only == own.0)) {
            let parameters = &["friction.parameters.coulomb"][..(*directions).min(1)];
            *best = best.min(run(parameters, *directions == 8));
        }
    }
    println!("ms at best, by the number of derivatives: {best:.2?}");
}
