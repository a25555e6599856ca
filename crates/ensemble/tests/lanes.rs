//! Members side by side in registers give the bits that each gives alone: of several laws, sticking included, through
//! refills, commands and starts of their own.

#[path = "../../circuit/tests/all/support/drive.rs"]
#[allow(dead_code)] // the tests of circuits use more
mod drive;

use ensemble::{Column, Ensemble, EnsembleRequest, Kernel, Outcome, Plan, Reduction, Statistic};

const MEMBERS: usize = 70;
const DURATION: f64 = 1.0;

/// A number in [0, 1) from two others.
fn share(one: usize, other: usize) -> f64 {
    let mixed = (one as u64 * 2_654_435_761 + other as u64 * 40_503 + 17).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

fn spread(one: usize, other: usize, low: f64, high: f64) -> f64 {
    low + share(one, other) * (high - low)
}

/// The circuit of the reference drive with a load and another friction law.
fn drive(law: &str, parameters: &[(&str, f64)]) -> String {
    let json = include_str!("../../circuit/examples/case_a.json");
    let mut table: serde_json::Value = serde_json::from_str(json).expect("valid");
    let own: serde_json::Map<_, _> =
        parameters.iter().map(|(key, value)| ((*key).into(), (*value).into())).collect();
    table["friction"] = serde_json::json!({ "law": law, "parameters": own });
    table["load"]["mass_kg"] = 1.0.into();
    drive::expand(&table).to_string()
}

fn run(ensemble: &Ensemble, kernel: Kernel, threads: usize) -> Outcome {
    let names = ["cylinder.bore", "supply.pressure", "load.mass"];
    assert_eq!(ensemble.members.names, names);
    let values = |m| [spread(m, 0, 0.016, 0.04), spread(m, 1, 3e5, 9e5), spread(m, 2, 0.0, 8.0)];
    let values: Vec<f64> = (0..MEMBERS).flat_map(values).collect();
    // Hard strokes into the stops, creeping, and a valve that is shut in between.
    let commands = |m: usize| {
        let size = if m.is_multiple_of(3) { 0.02 } else { 1.0 };
        [spread(m, 3, -size, size), 0.0, spread(m, 4, -size, size), spread(m, 5, -size, size)]
    };
    let commands: Vec<f64> = (0..MEMBERS).flat_map(commands).collect();
    let starts = |m| {
        [spread(m, 6, 0.02, 0.48), 0.0, spread(m, 7, 1.5e5, 6e5), 293.15, spread(m, 8, 1.5e5, 6e5), 293.15]
    };
    let starts: Vec<f64> = (0..MEMBERS).flat_map(starts).collect();
    let columns = ensemble.members.template.columns();
    let mut outputs: Vec<Reduction> =
        (1..columns.len()).map(|column| Reduction { column, what: Statistic::Final }).collect();
    outputs.push(Reduction { column: 1, what: Statistic::When { value: 0.4, above: true } });
    outputs.push(Reduction { column: 4, what: Statistic::Max });
    outputs.push(Reduction { column: 1, what: Statistic::Samples { rate: 50.0 } });
    let asked = EnsembleRequest {
        members: MEMBERS,
        values: &values,
        plans: vec![Plan {
            input: "command".into(),
            times: vec![0.0, 0.3, 0.5, 0.75],
            values: Column::new(commands, 4),
        }],
        duration: Column::new(vec![DURATION], 1),
        initial: Column::new(starts, 6),
        contact_age: 0.0,
        outputs,
        rtol: 1e-5,
        budget: None,
        threads,
        kernel: Some(kernel),
    };
    ensemble.run(&asked, &mut |_| false).expect("runs")
}

#[test]
fn lanes_have_the_bits_of_members_alone() {
    let stribeck = [("coulomb", 30.0), ("breakaway", 45.0), ("stribeck_velocity", 0.02), ("viscous", 40.0)];
    let bristles = [("bristle_stiffness", 1e5), ("bristle_damping", 300.0)];
    let lugre = [&stribeck[..], &bristles].concat();
    let dry = [("coulomb", 30.0), ("viscous", 40.0), ("bristle_stiffness", 1e5)];
    let karnopp = [&stribeck[..], &[("dead_zone", 1e-3)]].concat();
    for (law, parameters) in
        [("lugre", &lugre[..]), ("stribeck", &stribeck), ("karnopp", &karnopp), ("dahl", &dry)]
    {
        let names = ["cylinder.bore", "supply.pressure", "load.mass"].map(String::from);
        let ensemble = Ensemble::called(&drive(law, parameters), &names, drive::names()).expect(law);
        let alone = run(&ensemble, Kernel::Scalar, 1);
        for kernel in [Kernel::Base, Kernel::Eight] {
            if !kernel.is_there() {
                println!("not run on {kernel:?}: this processor does not have AVX-512");
                continue;
            }
            let together = run(&ensemble, kernel, 2);
            assert_eq!((&together.status, together.attempts), (&alone.status, alone.attempts), "{law}");
            assert_eq!(together.reasons, alone.reasons, "{law}");
            for (k, (one, other)) in together.columns.iter().zip(&alone.columns).enumerate() {
                let differs =
                    (0..one.len()).find(|&i| one[i].to_bits() != other[i].to_bits() && !other[i].is_nan());
                assert!(differs.is_none(), "{law}, {kernel:?}: output {k} of {differs:?}");
            }
        }
    }
}
