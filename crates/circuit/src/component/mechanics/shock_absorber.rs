use crate::component::mechanics::bumper::{SIDE, meets};
use crate::component::prelude::*;
use crate::part::ShockAbsorber as Oil;

/// A hydraulic shock absorber that a mass hits.
pub struct ShockAbsorberComponent;

impl Component for ShockAbsorberComponent {
    const KIND: Kind = Kind {
        key: "shock-absorber",
        title: "Hydraulic shock absorber",
        text: "A shock absorber at position x_0 that the mass runs into: F = F_0 + k s + c(s) v^2 while it is pushed in, \
               F_0 + k s while it extends. c changes linearly from its value at the start of the stroke to that \
               at its end. Its body lies behind the stroke.",
        ports: &[axis("1", false)],
        parameters: table! {
            position: "m", physics::any(), "Position x_0 of first contact";
            stroke: "m", physics::above(0.0), "Stroke S";
            damping: "kg/m", physics::at_least(0.0), "Damping c at the start of the stroke";
            end_damping: "kg/m", physics::at_least(0.0), follows "the damping at the start of the stroke",
                "Damping c at the end of the stroke";
            preload: "N", physics::at_least(0.0), default 10.0, assumed "usual for a small absorber",
                "Force F_0 of its extended spring";
            stiffness: "N/m", physics::at_least(0.0), default 500.0, assumed "usual for a small absorber",
                "Stiffness k of its spring";
            body_stiffness: "N/m", physics::above(0.0), default 1e7, assumed "usual for a body of steel",
                "Stiffness of its body";
            contact_depth: "m", physics::above(0.0), default 1e-4, assumed "a modelling parameter",
                "Depth over which the force rises at first contact";
        },
        choices: &[SIDE],
        outputs: &[("force_n", "N", "force, positive where it pushes towards -x")],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(axis) = at.axis(0) else { return };
        let damping = own.number("damping");
        let meets = meets(own, axis, build);
        let part = build.circuit.add(Oil {
            stroke: own.number("stroke"),
            damping,
            end_damping: own.given("end_damping").unwrap_or(damping),
            preload: own.number("preload"),
            stiffness: own.number("stiffness"),
            body_stiffness: own.number("body_stiffness"),
            contact_depth: own.number("contact_depth"),
            meets,
        });
        build.column(own, 0, Quantity::Force(part));
    }
}
