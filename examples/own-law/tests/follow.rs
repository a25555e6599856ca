//! The law on a drive.

use circuit::{Error, Look, Network};
use control::{AnyLaw, Move, Own, Reference};
use ode::Options;
use own_law::Follow;
use servo::specification::{Controller, Setup};
use servo::{Encoder, Led, Servo, controller, run_together};
use std::collections::BTreeMap;

const AXIS: &str = include_str!("../../../crates/servo/tests/data/reference_axis.json");
const BEGIN: f64 = 0.22;
const END: f64 = 0.26;

/// Largest and last error along a move under a law, m.
fn errors(law: impl control::OwnLaw + 'static) -> Result<[f64; 2], Error> {
    let belief: circuit::specification::Circuit = serde_json::from_str(AXIS).expect("a circuit");
    let network = Network::assemble(&belief, false)?;
    let value = |name: &str| match name {
        _ if name.ends_with("pressure_pa") => 4e5,
        _ if name.ends_with("temperature_k") => 293.15,
        _ if name.ends_with("position_m") => BEGIN,
        _ => 0.0,
    };
    let start: BTreeMap<_, _> =
        network.assembly.given_names().iter().map(|name| (name.to_string(), value(name))).collect();
    let mut session = network.assembly.session(&start, Options { rtol: 1e-5, ..Options::default() })?;
    let position = Encoder { resolution: 5e-6, noise: 1e-6 };
    let setup = Setup {
        position,
        pressures: None,
        command_bits: 12,
        computing_time_s: 0.0,
        forces: vec![],
        seed: 1,
        member: 0,
        step_repeats: 1,
        jitter_s: [0.0; 4],
        switches_m: None,
        faults: vec![],
    };
    let spec = Controller {
        law: Own::KEY.into(),
        period_s: 1e-3,
        gains: BTreeMap::new(),
        factors: [1.0; 3],
        valves: BTreeMap::new(),
        hold: None,
        adaptation: false,
        supervision: Default::default(),
        standby: None,
        belief,
    };
    let (mut controller, axis) = controller(&spec, setup.position.deviation())?;
    controller.law = AnyLaw::Own(Own::new(law));
    let reference =
        Reference::Moves { start: BEGIN, moves: vec![Move { begin: 0.1, duration: 0.3, to: END }] };
    let mut never = |_| false;
    let mut servo = Servo::new(&mut session, &axis, &setup)?;
    let mut axes = [Led { servo: &mut servo, controller: &mut controller, reference: &reference }];
    let (rows, _) = run_together(&mut session, &mut axes, &[], 0.6, &mut Look::new(&mut never))?;
    let rows = &rows[0];
    let error = |row: &[f64]| (row[5] - row[1]).abs();
    let last = rows.last().map_or(f64::NAN, |row| error(row));
    Ok([rows.iter().map(|row| error(row)).fold(0.0, f64::max), last])
}

#[test]
fn it_leads_a_drive_along_a_move() {
    let [most, last] = errors(Follow { speed: 3.7, lag: 4e-3, gains: [10.0, 0.2] }).expect("it runs");
    assert!(most < 15e-3 && last < 5e-3, "errors {most} m, {last} m");
}

/// A controller that returns NaN ends the run with a message, and the loop receives this by its return value.
#[test]
fn a_law_without_a_command_ends_the_run_in_words() {
    let failed = errors(|seen: &control::Seen, _: &Reference| if seen.time > 0.2 { f64::NAN } else { 0.0 });
    assert!(failed.expect_err("no command").to_string().contains("gives no command at t = 0.201"));
}
