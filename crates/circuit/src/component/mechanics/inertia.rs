use crate::component::mechanics::table_force::{POSITION, curve};
use crate::component::prelude::*;
use physics::Parameter;
use physics::mechanics::{Inertia, SlottedLever, TwoLinks};

/// Defines a mass that depends on the position of an axis, with the law that follows from its numbers.
macro_rules! inertia {
    ($(#[$about:meta])* $name:ident { $($kind:tt)* } |$own:ident| $law:expr) => {
        $(#[$about])*
        pub struct $name;

        impl Component for $name {
            const KIND: Kind = Kind { ports: &[axis("1", false)], $($kind)* ..Kind::PLAIN };

            fn bring<P: Lane>(_own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
                Brings::Along
            }

            fn compose<P: Lane>($own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
                let (Some(axis), law) = (at.axis(0), $law) else { return };
                build.masses[axis.0].0 += law.usual();
                build.circuit.moves(axis, law);
            }
        }
    };
}

inertia! {
    /// A mass whose value depends on the position of an axis, from a table.
    InertiaTable {
        key: "inertia/table",
        title: "Position-dependent mass",
        text: "A mechanism coupled to a mass M by a ratio that depends on its position x, as a mass m(x) beside M: (M + m) x'' + m' x'^2/2 = F, \
               so energy is conserved. m is given at points; beyond them it is constant. Weight is not \
               included: add it as a force/position.",
        sources: &["fritsch1984"],
        points: Points::of(&[
            POSITION,
            Parameter {
                key: "mass",
                unit: "kg",
                bounds: physics::at_least(0.0),
                default: None,
                meaning: "Mass m there",
            },
        ]),
        choices: &[Choice {
            name: "shape",
            options: &["smooth", "straight"],
            meaning: "A smooth curve without overshoot between the points, or straight lines, at whose corners the force jumps",
        }],
    } |own| Inertia::Table(curve(own, own.choices[0] == 0))
}

inertia! {
    /// A lever with a slot.
    Lever {
        key: "inertia/lever",
        title: "Lever with a slot",
        text: "A lever that a pin on the mass turns, in a slot: tan(phi) = s/h, s = x - x_0. It moves as a mass \
               m = J h^2/(h^2 + s^2)^2 beside M: (M + m) x'' + m' x'^2/2 = F. Without weight.",
        parameters: table! {
            moment_of_inertia: "kg m2", physics::above(0.0), "Moment of inertia J about its pivot";
            distance: "m", physics::above(0.0), "Distance h of the pivot from the axis of the pin";
            centre: "m", physics::any(), "Position x_0 at which it is perpendicular to the axis";
        },
    } |own| {
        let [inertia, distance, centre] = ["moment_of_inertia", "distance", "centre"].map(|key| own.number(key));
        Inertia::Lever(SlottedLever { inertia, distance, centre })
    }
}

inertia! {
    /// A toggle of two links.
    Toggle {
        key: "inertia/toggle",
        title: "Toggle",
        text: "Two links of length l whose knee the mass moves: stretched at x_0, they draw a slide of mass W along by \
               2 (l - sqrt(l^2 - s^2)), s = x - x_0. It moves as a mass m = 4 W s^2/(l^2 - s^2) beside M: \
               (M + m) x'' + m' x'^2/2 = F. Without weight.",
        parameters: table! {
            mass: "kg", physics::above(0.0), "Mass W of the slide";
            link_length: "m", physics::above(0.0), "Length l of each link";
            centre: "m", physics::any(), "Position x_0 at which the links are stretched";
        },
    } |own| {
        let [mass, link, centre] = ["mass", "link_length", "centre"].map(|key| own.number(key));
        Inertia::Toggle(TwoLinks { mass, link, centre })
    }
}
