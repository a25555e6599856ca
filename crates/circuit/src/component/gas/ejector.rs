use crate::component::prelude::*;

/// A vacuum ejector.
pub struct EjectorComponent;

impl Component for EjectorComponent {
    const KIND: Kind = Kind {
        key: "ejector",
        title: "Vacuum ejector",
        text: "A nozzle of conductance C from port 1 to port 3 whose jet sucks from port 2 through the conductance C_s towards \
               the pressure p_low = p3 + y (p_min - p3), y = clip((p1 - p3)/dp_work): without suction flow port 2 reaches \
               p_min. If the jet cannot hold this pressure, gas flows back from port 3.",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("2"), exhaust("3")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the nozzle, for air";
            suction_conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C_s of the suction, for air";
            lowest_pressure: "Pa abs", physics::above(0.0), default 1.5e4, assumed "usual for a single-stage ejector",
                "Pressure p_min that it reaches without suction flow";
            working_difference: "Pa", physics::above(0.0), default 4e5, assumed "usual for a single-stage ejector",
                "Pressure difference dp_work from supply to exhaust at which it reaches p_min";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.5, assumed "usual for a nozzle",
                "Critical pressure ratio b of both paths";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        outputs: &[
            ("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 3"),
            ("suction_flow_kg_s", "kg/s", "mass flow from port 2 to port 3"),
        ],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(supply), Some(vacuum), Some(out)) = (at.gas(0), at.gas(1), at.gas(2)) else { return };
        let part = crate::part::Ejector {
            lowest_pressure: own.number("lowest_pressure"),
            working_difference: own.number("working_difference"),
            nozzle: own.path("conductance", build),
            suction: own.path("suction_conductance", build),
            paths: [build.circuit.between(supply, out), build.circuit.between(vacuum, out)],
        };
        let conductances = [part.nozzle.conductance, part.suction.conductance];
        let part = build.flow_part(part, &conductances);
        build.columns(own, 0, [0, 1].map(|path| Quantity::along(Path::along(part, path))));
    }
}
