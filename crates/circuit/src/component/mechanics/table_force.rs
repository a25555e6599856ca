use crate::component::prelude::*;
use crate::part::{Along, TableForce};
use physics::Parameter;
use physics::curve::Curve;

const SHAPE: Choice = Choice {
    name: "shape",
    options: &["straight", "smooth"],
    meaning: "Straight lines between the points, or a smooth curve without overshoot",
};

pub(in crate::component) const POSITION: Parameter = column("position", "m", "Position x");
const FORCE: Parameter = column("force", "N", "Force in +x");
const VELOCITY: Parameter = column("velocity", "m/s", "Velocity v");
const TIME: Parameter = column("time", "s", "Time t since the start");

const fn column(key: &'static str, unit: &'static str, meaning: &'static str) -> Parameter {
    Parameter { key, unit, bounds: physics::any(), default: None, meaning }
}

const KIND: Kind = Kind {
    sources: &["fritsch1984"],
    ports: &[axis("1", false)],
    choices: &[SHAPE],
    outputs: &[("force_n", "N", "force in +x")],
    ..Kind::PLAIN
};

/// Returns the curve through the points of a component.
pub(in crate::component) fn curve<P: Lane>(own: &Instance<P>, is_smooth: bool) -> Curve<P> {
    let points: Vec<[P; 2]> = own.points().iter().map(|point| [point[0], point[1]]).collect();
    if is_smooth { Curve::smooth(&points) } else { Curve::straight(&points) }
}

macro_rules! force {
    ($name:ident, $key:literal, $title:literal, $text:literal, $along:expr, $over:expr) => {
        #[doc = $title]
        pub struct $name;

        impl Component for $name {
            const KIND: Kind =
                Kind { key: $key, title: $title, text: $text, points: Points::of(&[$over, FORCE]), ..KIND };

            fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
                let Some(axis) = at.axis(0) else { return };
                let curve = curve(own, own.choices[0] == 1);
                // Largest force, for the design of end stops.
                let largest = own.points().iter().fold(P::zero(), |most, point| most.max(point[1].abs()));
                let load = &mut build.masses[axis.0].1;
                *load = load.abs() + largest;
                let time = build.circuit.signal();
                let part = TableForce { mode: P::zero(), curve, along: $along, axis: axis.0, time };
                let part = build.circuit.add(part);
                build.column(own, 0, Quantity::Force(part));
            }
        }
    };
}

force! {
    OverPosition, "force/position", "Force over the position",
    "A force in +x on the joined mass, F(x), given at points of its position; beyond them it keeps the \
     last value. It stores the energy -int F dx.",
    Along::Position, POSITION
}
force! {
    OverVelocity, "force/velocity", "Force over the velocity",
    "A force in +x on the joined mass, F(v), given at points of its velocity; beyond them it keeps the \
     last value. Its work is external.",
    Along::Velocity, VELOCITY
}
force! {
    OverTime, "force/time", "Force over the time",
    "A force in +x on the joined mass, F(t), given at times since the start; before and after them it keeps \
     the nearest value. Its work is external. The integration ends on each point.",
    Along::Time, TIME
}
