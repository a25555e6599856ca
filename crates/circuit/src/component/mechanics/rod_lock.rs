use crate::component::prelude::*;
use crate::component::valves::switching::{Drives, armature};
use crate::part::Lock;

/// Jaws that clamp a rod or a slide.
pub struct RodLock;

impl Component for RodLock {
    const KIND: Kind = Kind {
        key: "rod-lock",
        title: "Rod lock",
        text: "Jaws that clamp the joined rod while the command is 1: an elastic grip of stiffness k that carries \
               up to the holding force F_h and slips above, in addition to friction of the mass. The jaws start as \
               commanded at the start; a later command acts after its times.",
        ports: &[axis("1", false)],
        parameters: table! {
            holding_force: "N", physics::above(0.0), "Holding force F_h";
            time_on: "s", physics::above(0.0), default 0.06, assumed "usual for a small rod lock",
                "Time from the command on to the middle of the closing travel of the jaws";
            time_off: "s", physics::above(0.0), default 0.04, assumed "usual for a small rod lock",
                "Time from the command off to the middle of their opening travel";
            travel_share: "1", physics::between(0.0, 1.0), default 0.2, assumed "usual for a small rod lock",
                "Fraction of these times in which the jaws travel; the force is proportional to the travel";
            stiffness: "N/m", physics::above(0.0), default 1e7, assumed "usual for jaws on a rod", "Stiffness k of the grip";
            damping: "N s/m", physics::above(0.0), follows "stiffness and moving mass, for half of the critical damping (assumed)",
                "Damping of the grip";
        },
        discrete: &["time_on", "time_off", "travel_share"],
        inputs: &[("command", "1", "1: shut, 0: open")],
        outputs: &[
            ("command", "1", "command"),
            ("position", "1", "closing of the jaws, 0 to 1"),
            ("force_n", "N", "force of the grip, positive if it pushes towards -x"),
        ],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(axis) = at.axis(0) else { return };
        let shut = armature(own, Drives { has_pulses: false, least: 0.0, stands: true }, build);
        let (holding_force, stiffness) = (own.number("holding_force"), own.number("stiffness"));
        let (mass, _) = build.masses[axis.0];
        let damping = own.given("damping").unwrap_or_else(|| (stiffness * mass).sqrt());
        let part = Lock {
            holding_force,
            stiffness,
            damping_time: damping / stiffness,
            axis: axis.0,
            shut,
            deflection: build.circuit.signal(),
            scale: holding_force.get(0) / stiffness.get(0),
        };
        let part = build.circuit.add(part);
        build.column(own, 2, Quantity::Force(part));
    }
}
