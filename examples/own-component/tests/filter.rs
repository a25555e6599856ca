//! The filter in a circuit, against its closed form.

use circuit::ode::Options;
use circuit::{Network, register, specification};
use own_component::Filter;
use serde_json::json;

const CONDUCTANCE: f64 = 1e-8;
const HALF: f64 = 2e-3;

/// From 7 bar through a filter into a large tank at 1 bar: choked as long as the run takes.
fn filling() -> Network {
    register::<Filter>().expect("a key of its own");
    let numbers = json!({ "conductance": CONDUCTANCE, "half_mass": HALF });
    let spec: specification::Circuit = serde_json::from_value(json!({
        "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05 },
        "ambient": { "pressure_pa": 1e5, "temperature_k": 293.15 },
        "components": [
            { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5 } },
            { "name": "filter", "kind": "own/filter", "numbers": numbers },
            { "name": "tank", "kind": "tank", "numbers": { "volume": 1.0 } },
        ],
        "joints": [["supply.1", "filter.1"], ["filter.2", "tank.1"]],
    }))
    .expect("a circuit");
    Network::assemble(&spec, true).expect("assembles")
}

fn start() -> std::collections::BTreeMap<String, f64> {
    [("tank.pressure_pa", 1e5), ("tank.temperature_k", 293.15)].map(|(name, x)| (name.into(), x)).into()
}

/// m' = G/(1 + m/m_half) has m + m^2/(2 m_half) = G t.
#[test]
fn what_passes_follows_the_closed_form_and_the_ledger_closes() {
    let options = Options { rtol: 1e-9, ..Options::default() };
    let network = filling();
    let run = network.simulate(&[], (2.0, 10.0), &start(), options, &mut |_| false).expect("runs");
    let place = network.assembly().columns().iter().position(|name| name == "filter.passed_mass_kg");
    let passed = *run.columns[place.expect("a column")].last().expect("samples");
    let choked = CONDUCTANCE * 7e5 * 1.185;
    assert!((passed + passed * passed / (2.0 * HALF) - choked * 2.0).abs() < 1e-9 * choked, "{passed} kg");
    assert!(passed > HALF, "half of it is clogged");
    let ledger = run.balance.expect("a ledger");
    assert!(ledger.mass_error.abs() < 1e-12 && ledger.energy_error.abs() < 1e-6, "{ledger:?}");
}

/// The part works for dual numbers, and for numbers with derivatives: d(m')/dm = -m'/(m_half + m).
#[test]
fn it_is_linearised_and_saved() {
    let mut session = filling().session(&start(), Options::default()).expect("starts");
    let advance = |session: &mut circuit::Session, until: f64| {
        let outcome =
            session.advance(until, &mut circuit::ode::NoOutput, &mut circuit::Look::new(&mut |_| false));
        outcome.expect("advances");
    };
    advance(&mut session, 0.5);
    let saved = session.save().expect("bytes");
    let mut other = filling().session(&start(), Options::default()).expect("starts");
    other.restore(&saved).expect("restores");
    for each in [&mut session, &mut other] {
        advance(each, 1.0);
    }
    assert_eq!(session.save().expect("bytes"), other.save().expect("bytes"));
    let linear = session.linearise(&[]).expect("a linear part");
    let n = linear.state.len();
    let names = session.circuit().state_names();
    let at = names.iter().position(|(name, _)| name == "filter.passed_mass_kg").expect("a state");
    let expected = -linear.rates[at] / (HALF + linear.state[at]);
    assert!((linear.a[at * n + at] / expected - 1.0).abs() < 1e-9, "{names:?}");
}

#[test]
fn a_key_is_taken_once() {
    struct Another;
    impl circuit::own::Component for Another {
        const KIND: circuit::own::ComponentKind =
            circuit::own::ComponentKind { key: "tank", ..circuit::own::ComponentKind::PLAIN };

        fn compose<P: circuit::math::Lane>(
            _own: &circuit::own::Instance<P>,
            _at: &circuit::own::Terminals,
            _build: &mut circuit::own::Build<P>,
        ) {
        }
    }
    let refused = register::<Another>().expect_err("a tank is there").to_string();
    assert!(refused.contains("component \"tank\" exists already"), "{refused}");
    register::<Filter>().expect("once");
    register::<Filter>().expect("and again");
    assert_eq!(circuit::kinds().iter().filter(|kind| kind.key == "own/filter").count(), 1);
}
