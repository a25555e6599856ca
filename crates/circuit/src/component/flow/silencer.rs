use crate::component::prelude::*;

/// A silencer: a flow path into the ambient air.
pub struct Silencer;

impl Component for Silencer {
    const KIND: Kind = Kind {
        key: "silencer",
        title: "Silencer",
        text: "A flow path by ISO 6358 from port 1 into the ambient air; clogging reduces its conductance C.",
        sources: &["iso6358-2013"],
        ports: &[gas("1"), exhaust("2")],
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the clean silencer, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b";
            clogging: "1", physics::Bounds { open_above: true, ..physics::within(0.0, 1.0) }, default 0.0, "Fraction of C lost by dirt";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        open: true,
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow into the ambient air")],
        ..Kind::PLAIN
    };

    fn series<P: Lane>(own: &Instance<P>) -> Option<[P; 2]> {
        own.in_series(clogged(own))
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.path_of(clogged(own), build);
        let edge = build.passage(law, from, to);
        build.column(own, 0, Quantity::along(Path::of(edge)));
    }
}

/// Returns the conductance with dirt.
fn clogged<P: Lane>(own: &Instance<P>) -> P {
    own.number("conductance") * (P::one() - own.number("clogging"))
}
