use crate::component::prelude::*;
use crate::part::Motor as Part;

/// A motor that moves a mass at a prescribed velocity.
pub struct MotorComponent;

impl Component for MotorComponent {
    const KIND: Kind = Kind {
        key: "motor",
        title: "Motor with a prescribed velocity",
        text: "Moves a mass at the velocity u with any force, through a spring and a damper: d' = u - v, \
               F = k d + c (u - v); in steady motion v = u. The mean force over a time is the growth of the impulse, \
               I' = F, over it; the work done on the mass is W' = F v.",
        ports: &[axis("1", false)],
        parameters: table! {
            velocity: "m/s", physics::any(), default 0.0, "Velocity u in +x until the input sets another value";
            stiffness: "N/m", physics::above(0.0), default 1e6, assumed "usual for a servo axis with a ball screw", "Stiffness k";
            damping: "N s/m", physics::at_least(0.0), default 2e3, assumed "usual for a servo axis with 1 kg", "Damping c";
        },
        inputs: &[("velocity_m_s", "m/s", "prescribed velocity in +x")],
        outputs: &[
            ("force_n", "N", "force on the mass in +x"),
            ("impulse_n_s", "N s", "integral of the force over time, since the start"),
            ("work_j", "J", "work done on the mass, since the start"),
        ],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(axis) = at.axis(0) else { return };
        let [velocity, stiffness, damping] = ["velocity", "stiffness", "damping"].map(|key| own.number(key));
        let signals = [(); 3].map(|()| build.circuit.signal());
        let scale = USUAL_FORCE / stiffness.get(0);
        let part = build.circuit.add(Part { velocity, stiffness, damping, scale, axis: axis.0, signals });
        build.input(own, 0, Acts::On(part.input(0)));
        let [_, impulse, work] = signals.map(Quantity::Signal);
        build.columns(own, 0, [Quantity::Force(part), impulse, work]);
    }
}

/// Force whose stretch is the error scale, N.
const USUAL_FORCE: f64 = 100.0;
