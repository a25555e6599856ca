use super::{
    Acts, Build, Component, Instance, Kind, LINEAR_ABOVE, SUBSONIC_INDEX, Terminals, exhaust, gas, table,
};
use crate::assembly::Quantity;
use crate::circuit::Path;
use math::Lane;

/// A 5/3 proportional valve without dynamics.
pub struct Proportional53;

impl Component for Proportional53 {
    const KIND: Kind = Kind {
        key: "valve/proportional-5/3",
        title: "5/3 proportional valve, closed centre",
        text: "Four edges with the share |u| of the conductance: u > 0 opens 1 to 4 and 2 to 3, u < 0 opens 1 to 2 and 4 to 5. \
               The spool follows the command at once.",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("4"), gas("2"), exhaust("5"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of each edge at full opening, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        inputs: &[("command", "1", "valve command")],
        outputs: &[
            ("command", "1", "valve command"),
            ("mass_flow_4_kg_s", "kg/s", "mass flow out of port 4"),
            ("mass_flow_2_kg_s", "kg/s", "mass flow out of port 2"),
        ],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let law = own.path("conductance", build);
        let each = [0, 1, 2, 3, 4].map(|port| at.gas(port));
        let [Some(supply), Some(a), Some(b), Some(out_a), Some(out_b)] = each else { return };
        let ends = [(supply, a), (a, out_a), (supply, b), (b, out_b)];
        let edges = ends.map(|(from, to)| build.edge(law.clone(), from, to));
        let [to_a, from_a, to_b, from_b] = edges.map(|edge| Some(Path::of(edge)));
        build.input(own, 0, Acts::Command(edges));
        build.column(own, 0, Quantity::Command(edges));
        build.column(own, 1, Quantity::Flow([to_a, from_a.map(Path::backward)]));
        build.column(own, 2, Quantity::Flow([to_b, from_b.map(Path::backward)]));
    }
}
