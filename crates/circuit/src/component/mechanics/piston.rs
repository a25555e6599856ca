use crate::component::prelude::*;
use crate::part::PistonSide;
use std::f64::consts::FRAC_PI_2;

/// A piston without end stops. Its motion is limited by other components.
pub struct Bare;

impl Component for Bare {
    const KIND: Kind = Kind {
        key: "piston",
        title: "Piston without end stops",
        text: "A piston with friction between two chambers, dragged so that it never reaches an end. Join its ports \
               to a tank, as the dead volume of a chamber, or to a reservoir at constant pressure. x grows \
               from chamber a's end to chamber b's.",
        sources: &["bejan2016"],
        ports: &[Port { volume: 0.0, ..gas("a") }, Port { volume: 0.0, ..gas("b") }, axis("rod", true)],
        parameters: table! {
            area_a: "m2", physics::above(0.0), "Area on which the pressure in chamber a acts";
            area_b: "m2", physics::above(0.0), "Area on which the pressure in chamber b acts";
            perimeter_a: "m", physics::at_least(0.0), default 0.0, "Perimeter of barrel and rod in chamber a that exchanges heat";
            perimeter_b: "m", physics::at_least(0.0), default 0.0, "Perimeter of barrel and rod in chamber b that exchanges heat";
            stroke: "m", physics::above(0.0), "Stroke";
            moving_mass: "kg", physics::above(0.0), "Mass of piston, rod and carriage";
            incline: "rad", physics::within(-FRAC_PI_2, FRAC_PI_2), default 0.0, "Incline of the axis; positive: x points up";
        },
        friction: FrictionTable::Optional,
        inputs: &[("load_force_n", "N", "external force in +x")],
        outputs: &[
            ("position_m", "m", "position"),
            ("velocity_m_s", "m/s", "velocity"),
            ("acceleration_m_s2", "m/s2", "acceleration"),
            ("friction_force_n", "N", "friction force, positive if it opposes v > 0"),
            ("a.pressure_pa", "Pa", "absolute pressure in chamber a"),
            ("a.temperature_k", "K", "temperature in chamber a"),
            ("b.pressure_pa", "Pa", "absolute pressure in chamber b"),
            ("b.temperature_k", "K", "temperature in chamber b"),
        ],
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(own: &Instance<P>, port: usize, _ambient_temperature: P) -> Brings<P> {
        if port < 2 { Brings::Nothing } else { own.guided_mass("moving_mass") }
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(a), Some(b), Some(axis)) = (at.gas(0), at.gas(1), at.axis(2)) else { return };
        let stroke = own.number("stroke");
        for (gas, side, grows) in [(a, "a", true), (b, "b", false)] {
            let [area, perimeter] = ["area", "perimeter"].map(|key| own.number(&format!("{key}_{side}")));
            let side = PistonSide::new(area, perimeter, P::c(2.0) * area);
            build.circuit.face(gas, axis, grows, stroke, side);
        }
        build.input(own, 0, Acts::Force(axis));
        build.motion(own, axis);
        let gas = [a, b].map(|gas| [Quantity::Pressure(gas), Quantity::Temperature(gas)]);
        build.columns(own, 4, gas.concat());
        build.inner_states(own, axis);
    }
}
