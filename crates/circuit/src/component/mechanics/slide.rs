use crate::component::mechanics::cylinder::OUTPUTS;
use crate::component::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// A mass on a separate line.
pub struct Slide;

impl Component for Slide {
    const KIND: Kind = Kind {
        key: "slide",
        title: "Slide",
        text: "A mass with its own axis, with optional friction, moved by a coupling or by an impact.",
        ports: &[axis("1", false)],
        parameters: table! {
            mass: "kg", physics::above(0.0), "Mass";
            incline: "rad", physics::within(-FRAC_PI_2, FRAC_PI_2), default 0.0, "Incline of the axis; positive: x points up";
        },
        friction: FrictionTable::Optional,
        inputs: &[("load_force_n", "N", "external force in +x")],
        outputs: OUTPUTS.split_at(4).0,
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
        own.guided_mass("mass")
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(axis) = at.axis(0) else { return };
        build.input(own, 0, Acts::Force(axis));
        build.motion(own, axis);
        build.inner_states(own, axis);
    }
}
