use super::{Build, Component, Instance, Kind, Terminals, gas, table};
use crate::assembly::Quantity;
use crate::circuit::Path;
use math::Lane;
use physics::flow::LINEAR_ABOVE;

/// A restriction that is always open.
pub struct Fitting;

impl Component for Fitting {
    const KIND: Kind = Kind {
        key: "fitting",
        title: "Fitting, orifice",
        text: "A flow path by ISO 6358: m_dot = C p1 rho0 sqrt(T0/T1) phi(p2/p1), in both directions.",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("2")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            subsonic_index: "1", physics::above(0.0), default 0.5, "Subsonic index m";
            linear_above: "1", physics::between(0.0, 1.0), default LINEAR_ABOVE, "Pressure ratio above which the flow is linear";
        },
        assumed: &[("linear_above", "a modelling parameter")],
        open: true,
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2")],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.path("conductance", build);
        let edge = build.passage(law, from, to);
        build.column(own, 0, Quantity::Flow([Some(Path::of(edge)), None]));
    }
}
