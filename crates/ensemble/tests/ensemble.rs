//! What a member gives follows from the description and its own numbers, and from nothing else.

#[path = "../../circuit/tests/all/support/drive.rs"]
#[allow(dead_code)] // the tests of circuits use more
mod drive;

use circuit::{Network, specification};
use drive::Drive;
use ensemble::{Column, Ensemble, EnsembleRequest, MemberStatus, Outcome, Plan, Reduction, Statistic};
use ode::Options;
use std::sync::Arc;

const DRIVE: &str = include_str!("../../circuit/examples/case_a.json");
const VARY: [&str; 6] = [
    "cylinder.bore",
    "cylinder.moving_mass",
    "supply.pressure",
    "valve.conductance",
    "cylinder.friction.parameters.coulomb",
    "ambient.temperature_k",
];
const START: [f64; 6] = [0.05, 0.0, 3e5, 293.15, 3e5, 293.15];

/// The circuit of the drive.
fn circuit() -> String {
    drive::expand(&serde_json::from_str(DRIVE).expect("valid")).to_string()
}

/// The drive with members that differ in some numbers, under the names of drives.
fn ensemble(names: &[String]) -> Result<Ensemble, circuit::Error> {
    Ensemble::called(&circuit(), names, drive::names())
}

fn names() -> Vec<String> {
    VARY.map(String::from).to_vec()
}

/// Rows of numbers, spread by a low-discrepancy sequence.
fn rows(members: usize) -> Vec<f64> {
    let range = [(0.016, 0.04), (1.0, 4.0), (4e5, 9e5), (1e-8, 4e-8), (10.0, 40.0), (283.0, 313.0)];
    let mut values = Vec::new();
    for member in 0..members {
        for (j, (low, high)) in range.into_iter().enumerate() {
            let share = (0.5 + (member + 1) as f64 * 0.618_033_988_75_f64.powi(j as i32 + 1)).fract();
            values.push(low + share * (high - low));
        }
    }
    values
}

fn asked(values: &[f64], outputs: Vec<Reduction>, threads: usize) -> EnsembleRequest<'_> {
    EnsembleRequest {
        members: values.len() / VARY.len(),
        values,
        plans: vec![Plan {
            input: "command".into(),
            times: vec![0.0, 1.0],
            values: Column::new(vec![0.6, -0.6], 2),
        }],
        duration: Column::new(vec![2.0], 1),
        initial: Column::new(START.to_vec(), 6),
        contact_age: 0.0,
        outputs,
        rtol: 1e-4,
        budget: None,
        threads,
        kernel: None,
    }
}

fn output(ensemble: &Ensemble, column: &str, what: Statistic) -> Reduction {
    let columns = ensemble.members.template.columns();
    Reduction { column: columns.iter().position(|own| own == column).expect("a column"), what }
}

fn all(ensemble: &Ensemble) -> Vec<Reduction> {
    let when = |value| Statistic::When { value, above: true };
    [
        ("position_m", Statistic::Final),
        ("pressure_a_pa", Statistic::Final),
        ("pressure_b_pa", Statistic::Max),
        ("velocity_m_s", Statistic::Min),
        ("position_m", when(0.45)),
        ("mass_flow_a_kg_s", Statistic::Integral),
        ("pressure_a_pa", Statistic::Mean),
        ("position_m", Statistic::Samples { rate: 100.0 }),
        ("mass_flow_a_kg_s", Statistic::Samples { rate: 100.0 }),
    ]
    .map(|(column, what)| output(ensemble, column, what))
    .into()
}

fn run(ensemble: &Ensemble, asked: &EnsembleRequest) -> Outcome {
    ensemble.run(asked, &mut |_| false).expect("runs")
}

fn bits(outcome: &Outcome) -> Vec<u64> {
    outcome.columns.iter().flatten().map(|value| value.to_bits()).collect()
}

/// The drive of a member, described and assembled by itself.
fn alone(row: &[f64]) -> Drive {
    let mut spec: drive::Spec = serde_json::from_str(DRIVE).expect("valid");
    spec.cylinder.bore_m = row[0];
    spec.cylinder.moving_mass_kg = row[1];
    spec.supply.pressure_pa = row[2];
    let drive::Valve::Proportional53(valve) = &mut spec.valve;
    valve.conductance_m3_s_pa = row[3];
    spec.friction.parameters.insert("coulomb".into(), row[4]);
    spec.ambient.temperature_k = row[5];
    Drive::assemble(&spec, false).expect("assembles")
}

#[test]
fn a_member_is_the_drive_that_it_describes() {
    let ensemble = ensemble(&names()).expect("members");
    let values = rows(12);
    let outcome = run(&ensemble, &asked(&values, all(&ensemble), 1));
    assert!(outcome.status.iter().all(|status| *status == MemberStatus::Done as u8), "{:?}", outcome.reasons);
    for (member, row) in values.chunks_exact(VARY.len()).enumerate() {
        let initial = drive::Initial {
            position_m: START[0],
            velocity_m_s: 0.0,
            pressure_a_pa: 3e5,
            pressure_b_pa: 3e5,
            temperature_a_k: 293.15,
            temperature_b_k: 293.15,
            contact_age_s: 0.0,
        };
        let options = Options { rtol: 1e-4, ..Options::default() };
        let sampled = |rate| {
            let plan = (&[0.0, 1.0][..], &[0.6, -0.6][..]);
            alone(row)
                .simulate(plan.0, plan.1, (2.0, rate), &initial, options, &mut |_| false)
                .expect("runs")
                .columns
        };
        let (coarse, fine) = (sampled(100.0), sampled(1e5));
        let of = |output: usize| outcome.columns[output][member];
        // The flow is that of the command of its time, too, which changes on the way.
        for (column, samples) in [(1, 7), (11, 8)] {
            assert_eq!(coarse[column], outcome.columns[samples][member * 201..][..201]);
        }
        assert_eq!((of(0), of(1)), (coarse[1][200], coarse[4][200]));
        let close =
            |what: &str, a: f64, b: f64, within: f64| assert!((a - b).abs() < within, "{what}: {a} {b}");
        close("max", of(2), fine[6].iter().copied().fold(0.0, f64::max), 50.0);
        // It ends at an impact, before which the drive gains up to 4 mm/s between two samples.
        close("min", of(3), fine[2].iter().copied().fold(0.0, f64::min), 4e-3);
        let passed = fine[1].iter().position(|x| *x > 0.45);
        match passed {
            Some(k) => close("when", of(4), k as f64 * 1e-5, 1.1e-5),
            None => assert!(of(4).is_nan()),
        }
        let trapezia =
            |column: &[f64]| column.windows(2).map(|pair| 0.5e-5 * (pair[0] + pair[1])).sum::<f64>();
        close("integral", of(5), trapezia(&fine[11]), 2e-7);
        close("mean", of(6), 0.5 * trapezia(&fine[4]), 1.0);
    }
}

#[test]
fn nothing_depends_on_threads_or_neighbours() {
    let ensemble = ensemble(&names()).expect("members");
    let values = rows(600);
    let together = run(&ensemble, &asked(&values, all(&ensemble), 2));
    assert_eq!(bits(&together), bits(&run(&ensemble, &asked(&values, all(&ensemble), 1))));
    for members in [0..1, 17..40, 250..260, 599..600] {
        let part = &values[members.start * VARY.len()..members.end * VARY.len()];
        let part = run(&ensemble, &asked(part, all(&ensemble), 1));
        for (own, all) in part.columns.iter().zip(&together.columns) {
            let width = all.len() / 600;
            assert_eq!(format!("{own:?}"), format!("{:?}", &all[members.start * width..members.end * width]));
        }
    }
}

#[test]
fn a_member_that_fails_costs_the_others_nothing() {
    let ensemble = ensemble(&names()).expect("members");
    let values = rows(8);
    let whole = run(&ensemble, &asked(&values, all(&ensemble), 1));
    // The breakaway force of the drive is 45 N: a member with more Coulomb friction is none.
    let mut refused = values.clone();
    refused[3 * VARY.len() + 4] = 50.0;
    // A start behind the cover of the cylinder.
    let mut starts: Vec<f64> = START.repeat(8);
    starts[5 * 6] = -0.3;
    let others = EnsembleRequest { initial: Column::new(starts, 6), ..asked(&refused, all(&ensemble), 2) };
    let others = run(&ensemble, &others);
    assert_eq!(others.status, [0, 0, 0, 2, 0, 1, 0, 0]);
    let reasons: Vec<usize> = others.reasons.iter().map(|(member, _)| *member).collect();
    assert_eq!(reasons, [3, 5]);
    assert!(others.reasons[0].1.contains("breakaway") && others.reasons[1].1.contains("t = 0.0"));
    for (own, all) in others.columns.iter().zip(&whole.columns) {
        let width = all.len() / 8;
        for member in 0..8 {
            let (own, all) = (&own[member * width..][..width], &all[member * width..][..width]);
            if others.status[member] == 0 {
                assert_eq!(format!("{own:?}"), format!("{all:?}"));
            } else {
                assert!(own.iter().all(|value| value.is_nan()));
            }
        }
    }
}

#[test]
fn members_are_analysed_once() {
    let spec: specification::Circuit = serde_json::from_str(&circuit()).expect("valid");
    let mut names = names();
    names.push("valve.subsonic_index".into());
    let network = Network::assemble(&spec, false).expect("assembles");
    let members = network.members(&circuit(), &names).expect("members");
    let mut members = members.general().expect("members");
    let template = members.template.clone();
    for (row, index) in rows(50).chunks_exact(VARY.len()).zip([0.5, 0.4].into_iter().cycle()) {
        let own = members.member(&[row, &[index]].concat()).expect("a member");
        assert!(own.circuit.shares_analysis(&template.circuit));
    }
}

#[test]
fn what_is_wrong_is_told_once_and_names_its_place() {
    let refusal = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        ensemble(&names).expect_err("no").to_string()
    };
    assert!(refusal(&["cylinder.bor"]).contains("bore"));
    assert!(refusal(&["cylinder.bore", "cylinder.bore"]).contains("twice"));
    let ensemble = ensemble(&names()).expect("members");
    let mut values = rows(3);
    values[VARY.len()] = -0.02;
    let refusal =
        ensemble.run(&asked(&values, all(&ensemble), 1), &mut |_| false).expect_err("no").to_string();
    assert!(refusal.contains("member 1: cylinder.bore = -0.02 m"), "{refusal}");
    let short = asked(&values[..7], all(&ensemble), 1);
    let refusal = ensemble.run(&short, &mut |_| false).expect_err("no").to_string();
    assert!(refusal.contains("a row of 6"), "{refusal}");
}

#[test]
fn a_circuit_has_members_too() {
    let json = r#"{
        "gas": {"heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05},
        "ambient": {"pressure_pa": 101300.0, "temperature_k": 293.15},
        "components": [
            {"name": "supply", "kind": "reservoir", "numbers": {"pressure": 7e5, "temperature": 293.15}},
            {"name": "line", "kind": "fitting", "numbers": {"conductance": 1e-9, "critical_pressure_ratio": 0.3}},
            {"name": "tank", "kind": "tank", "numbers": {"volume": 1e-3, "heat_transfer": 0.0}}
        ],
        "joints": [["supply.1", "line.1"], ["line.2", "tank.1"]]
    }"#;
    let names = vec!["line.conductance".to_string(), "tank.volume".to_string()];
    let ensemble = match Ensemble::called(json, &names, Arc::default()) {
        Ok(ensemble) => ensemble,
        Err(error) => panic!("{error}"),
    };
    let (values, column) = (vec![1e-9, 1e-3, 2e-9, 1e-3, 2e-9, 2e-3], "tank.pressure_pa");
    let asked = EnsembleRequest {
        members: 3,
        plans: Vec::new(),
        duration: Column::new(vec![5.0], 1),
        initial: Column::new(vec![101_300.0, 293.15], 2),
        outputs: vec![output(&ensemble, column, Statistic::When { value: 3e5, above: true })],
        ..asked(&values, Vec::new(), 2)
    };
    let times = run(&ensemble, &asked).columns.remove(0);
    let spec: specification::Circuit = serde_json::from_str(json).expect("valid");
    let network = Network::assemble(&spec, false).expect("assembles");
    assert_eq!(network.assembly.given_names(), ensemble.members.template.given_names());
    // Twice the conductance takes half the time, twice the volume twice.
    assert!(
        (times[1] / times[0] - 0.5).abs() < 1e-4 && (times[2] / times[0] - 1.0).abs() < 1e-4,
        "{times:?}"
    );
}
