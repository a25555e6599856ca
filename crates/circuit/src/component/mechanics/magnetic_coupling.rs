use crate::component::prelude::*;
use crate::part::Magnet;

/// Magnets through the wall of a barrel.
pub struct MagneticCoupling;

impl Component for MagneticCoupling {
    const KIND: Kind = Kind {
        key: "magnetic-coupling",
        title: "Magnetic coupling",
        text: "Magnets that couple two masses, the piston of a rodless cylinder and the slide outside: F = F_h sin(pi D/L_p) + c D', \
               D = x_1 - x_2. They decouple when |D| reaches L_p/2, and couple again when |D| falls below L_p/4; \
               the difference of their energies at L_p/2 and L_p/4 becomes heat. They start coupled. The sine is assumed.",
        ports: &[axis("1", false), axis("2", false)],
        parameters: table! {
            holding_force: "N", physics::above(0.0), "Holding force F_h: the greatest force of the magnets";
            pole_pitch: "m", physics::above(0.0), default 0.01, assumed "usual for magnets for a bore of 20 to 32 mm",
                "Pole pitch L_p: at a shift of half of it the magnets transmit the holding force";
            damping: "N s/m", physics::at_least(0.0), default 0.0, "Damping c while they are coupled";
        },
        outputs: &[
            ("force_n", "N", "force in +x on the mass at port 2"),
            ("decoupled", "1", "1 while the magnets are decoupled, else 0"),
        ],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.axis(0), at.axis(1)) else { return };
        let signal = build.circuit.signal();
        let part = build.circuit.add(Magnet {
            holding_force: own.number("holding_force"),
            pole_pitch: own.number("pole_pitch"),
            damping: own.number("damping"),
            mode: P::zero(),
            from: from.0,
            to: to.0,
            signal,
        });
        build.columns(own, 0, [Quantity::Force(part), Quantity::Signal(signal)]);
    }
}
