use crate::component::prelude::*;

/// A spring-loaded check valve.
pub struct CheckValveComponent;

impl Component for CheckValveComponent {
    const KIND: Kind = Kind {
        key: "check-valve",
        title: "Check valve",
        text: "A flow path that opens by itself from port 1 to port 2: m_dot = C p1 rho0 sqrt(T0/T1) phi(r; r_c) with \
               r = p2/p1 and r_c = 1 - p_c/p1 in place of 1; nothing flows where p1 - p2 < p_c.",
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            cracking_pressure: "Pa", physics::at_least(0.0), default 1e4, assumed "a usual spring",
                "Cracking pressure p_c, a difference";
        },
        ..Kind::PATH
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.path("conductance", build);
        let path = build.check_valve(law, own.number("cracking_pressure"), from, to);
        build.column(own, 0, Quantity::along(path));
    }
}
