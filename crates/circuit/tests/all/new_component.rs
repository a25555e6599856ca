//! A component is a table and its equations: what is defined here alone can be ordered, set, read and differentiated by.

use crate::support::{AMBIENT, ROOM};
use circuit::own::{
    Acts, Build, Component, ComponentKind, Instance, LINEAR_ABOVE, SUBSONIC_INDEX, Terminals, gas,
};
use circuit::{Network, Path, Quantity, Shooting, kinds, register};
use math::Lane;
use ode::Options;
use serde_json::json;

/// A tap: a flow path by ISO 6358 that its opening shuts.
struct Tap;

impl Component for Tap {
    const KIND: ComponentKind = ComponentKind {
        key: "toy/tap",
        title: "Tap",
        ports: &[gas("in"), gas("out")],
        parameters: circuit::table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance of the open tap";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.4, "Critical pressure ratio";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        inputs: &[("opening", "1", "share that is open")],
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow through the tap")],
        ..ComponentKind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let edge = build.passage(own.path("conductance", build), from, to);
        build.input(own, 0, Acts::On(edge));
        build.column(own, 0, Quantity::Flow([Some(Path::of(edge)), None]));
    }
}

/// Choked flow of air at the reference temperature: m_dot = y C p rho0, so that its derivative by C is m_dot/C.
#[test]
fn a_table_and_its_equations_are_all_that_a_component_takes() {
    register::<Tap>().expect("a key of its own");
    assert!(kinds().iter().any(|kind| kind.key == "toy/tap" && kind.parameters.len() == 4));
    let (conductance, opening) = (1e-8, 0.5);
    let circuit = json!({
        "gas": { "heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": 287.05 },
        "ambient": { "pressure_pa": AMBIENT, "temperature_k": ROOM },
        "components": [
            { "name": "supply", "kind": "reservoir", "numbers": { "pressure": 7e5, "temperature": 293.15 } },
            { "name": "tap", "kind": "toy/tap", "numbers": { "conductance": conductance } },
            { "name": "tank", "kind": "tank", "numbers": { "volume": 1.0 } },
        ],
        "joints": [["supply.1", "tap.in"], ["tap.out", "tank.1"]],
    });
    let network =
        Network::assemble(&serde_json::from_value(circuit.clone()).expect("fits"), true).expect("assembles");
    let input = network.assembly().variables.inputs.iter().find(|input| input.name == "tap.opening");
    assert_eq!(input.expect("an input").unit, "1");

    let start =
        [("tank.pressure_pa", AMBIENT), ("tank.temperature_k", ROOM)].map(|(name, x)| (name.into(), x));
    let plan = [("tap.opening".into(), vec![0.0], vec![opening])];
    let run = network
        .simulate(&plan, (1.0, 10.0), &start.into(), Options::default(), &mut |_| false)
        .expect("runs");
    let column =
        network.assembly().columns().iter().position(|name| name == "tap.mass_flow_kg_s").expect("a column");
    let expected = opening * conductance * 7e5 * 1.185;
    assert!(
        run.columns[column].iter().all(|flow| (flow / expected - 1.0).abs() < 1e-12),
        "{:?}",
        run.columns[column]
    );

    let asked = Shooting {
        times: vec![0.0],
        commands: vec![opening],
        others: Vec::new(),
        sample_times: vec![0.0, 1.0],
        starts: vec![0],
        initial: vec![AMBIENT, ROOM],
        parameters: vec!["tap.conductance".into()],
        with_initial: false.into(),
        outputs: vec!["tap.mass_flow_kg_s".into()],
        options: Options::default(),
        threads: 1,
    };
    let shot =
        network.shoot(&circuit.to_string(), Some("tap.opening"), &asked, &mut |_| false).expect("runs");
    assert!((shot.sensitivities[1] * conductance / expected - 1.0).abs() < 1e-12, "{:?}", shot.sensitivities);
}
