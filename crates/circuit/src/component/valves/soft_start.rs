use crate::component::prelude::*;
use crate::part::Latch;

/// A valve that first fills a system slowly.
pub struct SoftStart;

impl Component for SoftStart {
    const KIND: Kind = Kind {
        key: "soft-start",
        title: "Soft-start valve",
        text: "A needle of conductance C_n from port 1 to port 2 until the gauge pressure at port 2 exceeds a share of that \
               at port 1, then an open seat of conductance C; it stays open until the pressure at port 1 falls below the \
               reset pressure, and opens again from 1.2 times that on.",
        parameters: table! {
            needle_conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C_n of the needle at its setting, for air";
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the open valve, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a valve of this kind",
                "Critical pressure ratio b";
            opening_share: "1", physics::between(0.0, 1.0), default 0.5, assumed "usual for a valve of this kind",
                "Fraction of the inlet's gauge pressure above which it opens";
            reset_pressure: "Pa abs", physics::above(0.0), default 2.5e5, assumed "usual for a valve of this kind",
                "Pressure at the inlet below which it shuts";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        open: true,
        ..Kind::PATH
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        let [needle, open] = ["needle_conductance", "conductance"].map(|key| own.number(key));
        if needle > open {
            let [needle, open] = [needle, open].map(|conductance| in_usual_unit(conductance, "m3/(s Pa)"));
            return refuse!(
                "{}.needle_conductance = {needle} is above {}.conductance = {open}: the open valve lets more through \
                 than its needle",
                own.name,
                own.name
            );
        }
        Ok(())
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.path("conductance", build);
        let conductance = law.conductance;
        let latch = Latch {
            needle_share: own.number("needle_conductance") / conductance,
            opening_share: own.number("opening_share"),
            reset_pressure: own.number("reset_pressure"),
            ambient_pressure: build.ambient[0],
            mode: P::zero(),
            law,
            path: build.circuit.between(from, to),
        };
        let path = build.path_part(latch, conductance);
        build.column(own, 0, Quantity::along(path));
    }
}
