use crate::component::prelude::*;
use crate::part::Coupling as Play;
use physics::mechanics::EndStop;

/// A coupling of two masses, with or without play.
pub struct CouplingComponent;

impl Component for CouplingComponent {
    const KIND: Kind = Kind {
        key: "coupling",
        title: "Coupling",
        text: "A spring and a damper between two masses, with play g. Beyond the play, on either side, F = k d + c d' \
               min(d/d_c, 1), d = |x_1 - x_2| - g/2; it never pulls back into the play. Without play F = k (x_1 - x_2) + c (v_1 - v_2).",
        ports: &[axis("1", false), axis("2", false)],
        parameters: table! {
            stiffness: "N/m", physics::above(0.0), "Stiffness k";
            damping: "N s/m", physics::at_least(0.0), default 0.0, "Damping c";
            play: "m", physics::at_least(0.0), default 0.0, "Play g between both sides";
            damping_depth: "m", physics::above(0.0), default 1e-4, assumed "a modelling parameter", only "play",
                "Depth d_c at which the damper acts fully, if there is play";
        },
        outputs: &[("force_n", "N", "force in +x on the mass at port 2")],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.axis(0), at.axis(1)) else { return };
        let [stiffness, damping, play] = ["stiffness", "damping", "play"].map(|key| own.number(key));
        build.coupled.push(([from, to], play));
        let part = if play.get(0) > 0.0 || own.is_free("play") {
            let law = EndStop { stiffness, damping, damping_depth: own.number("damping_depth") };
            build.circuit.add(Play { play, law, from: from.0, to: to.0 })
        } else {
            build.circuit.link(from, to, stiffness, damping)
        };
        build.column(own, 0, Quantity::Force(part));
    }
}
