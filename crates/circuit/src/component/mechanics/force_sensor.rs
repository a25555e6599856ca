use crate::component::prelude::*;

/// A joint of two masses that measures the force between them.
pub struct ForceSensor;

impl Component for ForceSensor {
    const KIND: Kind = Kind {
        key: "force-sensor",
        title: "Force sensor",
        text: "A spring and a damper between two masses, without play: F = k (x_1 - x_2) + c (v_1 - v_2).",
        ports: &[axis("1", false), axis("2", false)],
        parameters: table! {
            stiffness: "N/m", physics::above(0.0), "Stiffness k between both sides";
            damping: "N s/m", physics::at_least(0.0), "Damping c between both sides";
        },
        outputs: &[("force_n", "N", "force in +x on the mass at port 2")],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.axis(0), at.axis(1)) else { return };
        let part = build.circuit.link(from, to, own.number("stiffness"), own.number("damping"));
        build.column(own, 0, Quantity::Force(part));
    }
}
