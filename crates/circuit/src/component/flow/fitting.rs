use crate::component::prelude::*;

/// A restriction that is open unless its input is set.
pub struct Fitting;

impl Component for Fitting {
    const KIND: Kind = Kind {
        key: "fitting",
        title: "Fitting, orifice",
        text: "A flow path by ISO 6358: m_dot = y C p1 rho0 sqrt(T0/T1) phi(p2/p1), in both directions; y is its opening, \
               1 unless set.",
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        open: true,
        inputs: &[("opening", "1", "fraction of the full opening")],
        ..Kind::PATH
    };

    fn series<P: Lane>(own: &Instance<P>) -> Option<[P; 2]> {
        own.in_series(own.number("conductance"))
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.path("conductance", build);
        let edge = build.passage(law, from, to);
        build.input(own, 0, Acts::On(edge));
        build.column(own, 0, Quantity::along(Path::of(edge)));
    }
}
