use crate::component::{
    Acts, Brings, Build, Component, Holds, Instance, Kind, Port, Quantity, Stroke, Symbol, Terminals, gas,
    table,
};
use crate::ground::Error;
use crate::part::Pulsation;
use math::Lane;
use std::f64::consts::PI;

/// Gas with an oscillating pressure.
pub struct Pulsating;

impl Component for Pulsating {
    const KIND: Kind = Kind {
        key: "reservoir/pulsating",
        title: "Reservoir, pulsating",
        text: "Gas of constant temperature whose pressure oscillates about its mean, p + A sin(2 pi f t), in unlimited amount: \
               a mains behind a piston compressor.",
        ports: &[Port { holds: Holds::Pressure, ..gas("1") }],
        parameters: table! {
            pressure: "Pa abs", physics::above(0.0), "Mean pressure p";
            amplitude: "Pa", physics::at_least(0.0), "Amplitude A, a difference";
            frequency: "Hz", physics::above(0.0), "Frequency f";
            temperature: "K", physics::above(0.0), follows "the ambient temperature", "Temperature";
        },
        inputs: &[("pressure_pa", "Pa", "mean absolute pressure")],
        outputs: &[
            ("pressure_pa", "Pa", "absolute pressure"),
            ("mass_flow_kg_s", "kg/s", "mass flow out of the reservoir"),
        ],
        symbol: SYMBOL,
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(own: &Instance<P>, _port: usize, ambient_temperature: P) -> Brings<P> {
        let temperature = own.given("temperature").unwrap_or(ambient_temperature);
        Brings::Reservoir { pressure: own.number("pressure"), temperature }
    }

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        let [pressure, amplitude] = ["pressure", "amplitude"].map(|key| own.number(key));
        if amplitude < pressure {
            return Ok(());
        }
        let name = &own.name;
        Err(Error::Specification(format!(
            "{name}.amplitude = {amplitude} Pa must be below {name}.pressure = {pressure} Pa: absolute pressures are positive"
        )))
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(node) = at.gas(0) else { return };
        let part = build.circuit.add(Pulsation {
            mean: own.number("pressure"),
            amplitude: own.number("amplitude"),
            angular_frequency: P::c(2.0 * PI) * own.number("frequency"),
            node,
        });
        build.input(own, 0, Acts::On(part.input(0)));
        build.column(own, 0, Quantity::Pressure(node));
        build.column(own, 1, Quantity::OutOf(node));
    }
}

const SYMBOL: Symbol = Symbol {
    strokes: &[
        Stroke::Triangle([[0.0, 1.6], [-1.0, 0.0], [1.0, 0.0]]),
        Stroke::Line(&[[0.0, 1.6], [0.0, 3.0]]),
        Stroke::Arc([1.6, 0.8], 0.4, [0.0, 180.0]),
        Stroke::Arc([2.4, 0.8], 0.4, [180.0, 360.0]),
    ],
    when: &[],
    ports: &[[0.0, 3.0]],
};
