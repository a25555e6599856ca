use crate::component::prelude::*;
use crate::part::Poppet;

/// A check valve that a pilot pressure opens.
pub struct PilotedCheckValve;

impl Component for PilotedCheckValve {
    const KIND: Kind = Kind {
        key: "check-valve/piloted",
        title: "Piloted check valve",
        text: "A check valve from port 1 to port 2 that passes reverse flow while pressure at the pilot port 12 opens it: its \
               poppet opens by the share clip((p1 - p2 + a (p12 - p_amb) - p_c)/dp_full) of C, a being the area of the pilot \
               piston over that of the seat; the pilot only pushes. No gas passes the pilot port.",
        ports: &[gas("1"), gas("2"), pilot("12")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a valve of this kind",
                "Critical pressure ratio b";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            pilot_ratio: "1", physics::above(0.0), default 3.0, assumed "usual for a valve of this kind",
                "Area a of the pilot piston over that of the seat";
            cracking_pressure: "Pa", physics::at_least(0.0), default 1e4, assumed "a usual spring",
                "Cracking pressure p_c, a difference";
            full_opening_rise: "Pa", physics::above(0.0), default 1e4, assumed "a usual spring",
                "Rise dp_full above p_c at which it is fully open, a difference";
        },
        ..Kind::PATH
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to), Some(pilot)) = (at.gas(0), at.gas(1), at.gas(2)) else { return };
        let law = own.path("conductance", build);
        let conductance = law.conductance;
        let poppet = Poppet {
            pilot_ratio: own.number("pilot_ratio"),
            cracking_pressure: own.number("cracking_pressure"),
            full_opening_rise: own.number("full_opening_rise"),
            ambient_pressure: build.ambient[0],
            law,
            pilot,
            path: build.circuit.between(from, to),
        };
        let path = build.path_part(poppet, conductance);
        build.column(own, 0, Quantity::along(path));
    }
}
