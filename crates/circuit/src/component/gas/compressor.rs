use crate::component::prelude::*;

/// A compressor with a pressure switch.
pub struct CompressorComponent;

impl Component for CompressorComponent {
    const KIND: Kind = Kind {
        key: "compressor",
        title: "Compressor with a pressure switch",
        text: "A constant mass flow V_dot p_amb/(R T_amb) out of port 1 at temperature T_out. A pressure switch turns it off \
               when the pressure at its port reaches the stop pressure, and on when it falls to the start pressure. \
               Join a tank to it.",
        ports: &[gas("1")],
        parameters: table! {
            free_air_delivery: "m3/s", physics::above(0.0), "Delivered volume flow V_dot, at ambient pressure and temperature";
            start_pressure: "Pa abs", physics::above(0.0), "Pressure at which it turns on";
            stop_pressure: "Pa abs", physics::above(0.0), "Pressure at which it turns off";
            outlet_temperature: "K", physics::above(0.0), follows "the ambient temperature, behind an aftercooler",
                "Temperature T_out of the delivered gas";
        },
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow out of port 1")],
        ..Kind::PLAIN
    };

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        let [start, stop] = ["start_pressure", "stop_pressure"].map(|key| own.number(key));
        if start < stop {
            return Ok(());
        }
        let name = &own.name;
        let [start, stop] = [start, stop].map(|pressure| in_usual_unit(pressure, "Pa abs"));
        refuse!(
            "{name}.start_pressure = {start} must be below {name}.stop_pressure = {stop}: otherwise it would turn on and off without end"
        )
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(node) = at.gas(0) else { return };
        let [pressure, temperature] = build.ambient;
        let stop_pressure = own.number("stop_pressure");
        let outlet = own.given("outlet_temperature").unwrap_or(temperature);
        let part = build.circuit.add(crate::part::Compressor {
            mass_flow: own.number("free_air_delivery") * pressure / (build.gas.gas_constant * temperature),
            temperature: outlet,
            start_pressure: own.number("start_pressure"),
            stop_pressure,
            mode: P::zero(),
            node,
            boundary: build.circuit.is_reservoir(node),
        });
        build.supply(stop_pressure, outlet);
        build.column(own, 0, Quantity::along(Path::along(part, 0)));
    }
}
