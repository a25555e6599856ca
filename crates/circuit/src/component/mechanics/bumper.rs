use crate::component::prelude::*;
use crate::ground::AxisId;
use crate::part::{Bumper as Elastomer, Meets};
use math::Real;

/// An elastomer bumper that a mass hits.
pub struct BumperComponent;

/// Side of an axis on which a contact is placed.
pub(in crate::component) const SIDE: Choice = Choice {
    name: "side",
    options: &["b", "a"],
    meaning: "Side: b is hit by a motion in +x, like the end of chamber b; a by a motion in -x",
};

/// Returns the position of contact of a component with a position and a side.
pub(in crate::component) fn meets<P: Lane>(
    own: &Instance<P>,
    axis: AxisId,
    build: &mut Build<P>,
) -> Meets<P> {
    let position = own.number("position");
    build.met.push((own.name.clone(), position, axis));
    Meets { position, ahead: own.chosen(SIDE.name) == Some("b"), axis: axis.0 }
}

/// Newton steps. Each iteration at least halves the distance, and the final convergence is quadratic.
const STEPS: usize = 40;

/// Returns the product y of damping and impact speed for which a contact F = k d^n (1 + lambda d') has the coefficient
/// of restitution e. From m v dv = -F dd on both ways,
///
///   `y (1 + e) = ln((1 + y)/(1 - e y)),   or   y = g(y) = (1 - (1 + y) exp(-(1 + e) y))/e`
///
/// independent of k, n and m. To the right of the root, g is concave. Newton's method converges to the root from 1/e.
fn damped<P: Real>(e: P) -> P {
    let (one, a) = (P::one(), P::one() + e);
    (0..STEPS).fold(one / e, |y, _| {
        let decay = (-a * y).exp() / e;
        let over = one / e - (one + y) * decay - y;
        let slope = (a * (one + y) - one) * decay - one;
        y - over / slope
    })
}

impl Component for BumperComponent {
    const KIND: Kind = Kind {
        key: "bumper",
        title: "Elastomer bumper",
        text: "An elastomer at position x_0 that the mass runs into, by Hunt and Crossley: F = F_r (d/d_r)^n (1 + lambda d'), \
               never pulling. lambda follows from the restitution: speed of a free mass after impact over its speed before.",
        ports: &[axis("1", false)],
        parameters: table! {
            position: "m", physics::any(), "Position x_0 of first contact";
            rated_force: "N", physics::above(0.0), "Static force F_r at the depth d_r";
            rated_depth: "m", physics::above(0.0), "Depth d_r";
            exponent: "1", physics::at_least(1.0), default 1.5, assumed "usual for a round body", "Exponent n";
            restitution: "1", physics::between(0.0, 1.0), default 0.5, assumed "usual for a usual elastomer",
                "Speed after a free impact divided by the speed before it";
            impact_speed: "m/s", physics::above(0.0), default 0.5, assumed "a usual speed of impact",
                "Impact speed for which this ratio is given; a faster impact has a lower ratio";
        },
        choices: &[SIDE],
        outputs: &[("force_n", "N", "force, positive if it pushes towards -x")],
        ..Kind::PLAIN
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(axis) = at.axis(0) else { return };
        let meets = meets(own, axis, build);
        let part = build.circuit.add(Elastomer {
            rated_force: own.number("rated_force"),
            rated_depth: own.number("rated_depth"),
            exponent: own.number("exponent"),
            damping: damped(own.number("restitution")) / own.number("impact_speed"),
            meets,
        });
        build.column(own, 0, Quantity::Force(part));
    }
}
