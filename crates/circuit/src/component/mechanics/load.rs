use crate::component::prelude::*;

/// A mass that a cylinder moves, with a force on it.
pub struct Load;

impl Component for Load {
    const KIND: Kind = Kind {
        key: "load",
        title: "Load",
        text: "A mass M on the rod of a cylinder, and a constant force F in +x.",
        ports: &[axis("1", false)],
        parameters: table! {
            mass: "kg", physics::at_least(0.0), default 0.0, "Mass M";
            force: "N", physics::any(), default 0.0, "External force F in +x";
        },
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
        Brings::Mass { mass: own.number("mass"), incline: None, force: own.number("force"), friction: None }
    }

    fn compose<P: Lane>(_own: &Instance<P>, _at: &Terminals, _build: &mut Build<P>) {}
}

/// A spring between a mass and the frame.
pub struct LoadSpring;

impl Component for LoadSpring {
    const KIND: Kind = Kind {
        key: "spring",
        title: "Spring",
        text: "F = -k (x - x0) on the mass at its port.",
        ports: &[axis("1", false)],
        parameters: table! {
            stiffness: "N/m", physics::above(0.0), "Stiffness k";
            rest_position: "m", physics::any(), "Position x0 without force";
        },
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        if let Some(axis) = at.axis(0) {
            build.spring(axis, own.number("stiffness"), own.number("rest_position"));
        }
    }
}
