use crate::component::prelude::*;

/// Gas of constant pressure and temperature.
pub struct ReservoirComponent;

impl Component for ReservoirComponent {
    const KIND: Kind = Kind {
        key: "reservoir",
        title: "Reservoir",
        text: "An unlimited amount of gas at constant pressure and temperature: a mains, an open room.",
        ports: &[Port { holds: Holds::Pressure, ..gas("1") }],
        parameters: table! {
            pressure: "Pa abs", physics::above(0.0), "Pressure";
            temperature: "K", physics::above(0.0), follows "the ambient temperature", "Temperature";
        },
        inputs: &[("pressure_pa", "Pa", "absolute pressure"), ("temperature_k", "K", "temperature")],
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow out of the reservoir")],
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(own: &Instance<P>, _port: usize, ambient_temperature: P) -> Brings<P> {
        let temperature = own.given("temperature").unwrap_or(ambient_temperature);
        Brings::Reservoir { pressure: own.number("pressure"), temperature }
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(node) = at.gas(0) else { return };
        build.input(own, 0, Acts::Pressure(node));
        build.input(own, 1, Acts::Temperature(node));
        build.column(own, 0, Quantity::OutOf(node));
    }
}
