use crate::component::prelude::*;
use crate::part::Cup;

/// A quick exhaust valve.
pub struct QuickExhaust;

impl Component for QuickExhaust {
    const KIND: Kind = Kind {
        key: "quick-exhaust",
        title: "Quick exhaust valve",
        text: "Gas flows from port 1 to port 2 through a check valve; if the pressure at port 2 exceeds that at port 1, its cup opens port 2 to \
               port 3 by the share s = smoothstep((p2 - p1)/dp) of the conductance C_23. No flow from 1 to 3.",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("2"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C from port 1 to port 2, for air";
            exhaust_conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C_23 from port 2 to port 3, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a valve of this kind",
                "Critical pressure ratio b of both paths";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            cracking_pressure: "Pa", physics::at_least(0.0), default 1e4, assumed "a usual lip seal",
                "Cracking pressure from port 1 to port 2, a difference";
            switching_pressure: "Pa", physics::above(0.0), default 1e4, assumed "a usual lip seal",
                "Difference dp at which port 3 is fully open";
        },
        outputs: &[
            ("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2"),
            ("exhaust_flow_kg_s", "kg/s", "mass flow from port 2 to port 3"),
        ],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(one), Some(two), Some(out)) = (at.gas(0), at.gas(1), at.gas(2)) else { return };
        let inlet = own.path("conductance", build);
        let inlet = build.check_valve(inlet, own.number("cracking_pressure"), one, two);
        let law = own.path("exhaust_conductance", build);
        let (conductance, path) = (law.conductance, build.circuit.between(two, out));
        let cup = Cup { law, switching_pressure: own.number("switching_pressure"), pilot: one, path };
        let outlet = build.path_part(cup, conductance);
        build.columns(own, 0, [inlet, outlet].map(Quantity::along));
    }
}
