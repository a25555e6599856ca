use crate::component::prelude::*;
use crate::part::ChamberLaw;

/// A rigid volume with a wall.
pub struct Tank;

impl Component for Tank {
    const KIND: Kind = Kind {
        key: "tank",
        title: "Tank",
        text: "A rigid volume V of uniform gas: its balance of mass and energy, with heat alpha A (T_w - T) from the wall. \
               Without a stated coefficient, alpha follows from conduction, natural convection, change of density and jets.",
        sources: &["bejan2016", "woodfield2007", "geankoplis1993"],
        ports: &[chamber("1")],
        parameters: table! {
            volume: "m3", physics::above(0.0), "Volume V";
            wall_area: "m2", physics::at_least(0.0), follows "5.8 V^(2/3), a cylinder of 1 to 3 diameters; 0 with a stated heat_transfer",
                "Area A of the wall that exchanges heat; 0: adiabatic";
            heat_transfer: "W/(m2 K)", physics::at_least(0.0), follows "the law of heat transfer in a vessel",
                "Heat-transfer coefficient alpha of the wall, if it is constant";
            HEAT_SCALE;
            port_diameter: "m", physics::above(0.0), follows "the tube at the port, or the conductance there", only "no heat_transfer",
                "Diameter of the port, for the jet in the law of heat transfer";
            wall_temperature: "K", physics::above(0.0), follows "the ambient temperature",
                "Temperature T_w of the wall; its start if the wall stores heat";
            ..WALL;
        },
        outputs: &[
            ("pressure_pa", "Pa", "absolute pressure"),
            ("temperature_k", "K", "temperature"),
            ("mass_flow_kg_s", "kg/s", "net mass flow into the tank"),
        ],
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(own: &Instance<P>, _port: usize, ambient_temperature: P) -> Brings<P> {
        let (volume, third) = (own.number("volume"), P::c(1.0 / 3.0));
        let (area, heat) = match own.given("heat_transfer") {
            // A wall that stores heat gives the heat itself.
            Some(_) if own.given("wall_capacity").is_some() => (P::zero(), WallHeat::Constant(P::zero())),
            Some(coefficient) => (P::zero(), WallHeat::Constant(coefficient)),
            None => {
                let (scale, port) = (own.number("heat_transfer_scale"), own.given("port_diameter"));
                let heat = WallHeat::Vessel { scale, bore: P::c(1.9) * volume.pow(third), area: None, port };
                (P::c(5.8) * volume.pow(P::c(2.0) * third), heat)
            }
        };
        Brings::Volume(Vessel {
            law: ChamberLaw::EnergyBalance,
            dead_volume: volume,
            wall: own.given("wall_area").unwrap_or(area),
            heat,
            wall_temperature: own.given("wall_temperature").unwrap_or(ambient_temperature),
        })
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        if let Some(node) = at.gas(0) {
            let gas = [Quantity::Pressure, Quantity::Temperature, Quantity::MassFlow];
            build.columns(own, 0, gas.map(|quantity| quantity(node)));
            if own.given("wall_capacity").is_some() {
                build.wall(own, &[node]);
            }
        }
    }
}
