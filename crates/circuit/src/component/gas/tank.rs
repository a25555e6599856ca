use crate::component::{
    Brings, Build, Component, Instance, Kind, Quantity, Stroke, Symbol, Terminals, Vessel, WALL, chamber,
    table,
};
use crate::part::ChamberLaw;
use math::Lane;

/// A rigid volume with a wall.
pub struct Tank;

impl Component for Tank {
    const KIND: Kind = Kind {
        key: "tank",
        title: "Tank",
        text: "A rigid volume V of uniform gas: its balance of mass and energy, with heat alpha A (T_w - T) from the wall.",
        sources: &["bejan2016"],
        ports: &[chamber("1")],
        parameters: table! {
            volume: "m3", physics::above(0.0), "Volume V";
            wall_area: "m2", physics::at_least(0.0), default 0.0, "Area A of the wall that exchanges heat; 0: adiabatic";
            heat_transfer: "W/(m2 K)", physics::at_least(0.0), default 0.0, "Heat-transfer coefficient alpha of the wall";
            wall_temperature: "K", physics::above(0.0), follows "the ambient temperature", only "wall_area",
                "Temperature T_w of the wall; its start if the wall stores heat";
            ..WALL;
        },
        outputs: &[
            ("pressure_pa", "Pa", "absolute pressure"),
            ("temperature_k", "K", "temperature"),
            ("mass_flow_kg_s", "kg/s", "net mass flow into the tank"),
        ],
        symbol: SYMBOL,
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(own: &Instance<P>, _port: usize, ambient_temperature: P) -> Brings<P> {
        Brings::Volume(Vessel {
            law: ChamberLaw::EnergyBalance,
            dead_volume: own.number("volume"),
            wall: own.number("wall_area"),
            // A wall that stores heat gives the heat itself.
            heat_transfer: if own.given("wall_capacity").is_some() {
                P::zero()
            } else {
                own.number("heat_transfer")
            },
            wall_temperature: own.given("wall_temperature").unwrap_or(ambient_temperature),
        })
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        if let Some(node) = at.gas(0) {
            build.column(own, 0, Quantity::Pressure(node));
            build.column(own, 1, Quantity::Temperature(node));
            build.column(own, 2, Quantity::MassFlow(node));
            if own.given("wall_capacity").is_some() {
                build.wall(own, &[node]);
            }
        }
    }
}

const SYMBOL: Symbol = Symbol {
    strokes: &[
        Stroke::Line(&[[-2.0, 3.0], [2.0, 3.0]]),
        Stroke::Line(&[[-2.0, 1.0], [2.0, 1.0]]),
        Stroke::Arc([-2.0, 2.0], 1.0, [90.0, 270.0]),
        Stroke::Arc([2.0, 2.0], 1.0, [-90.0, 90.0]),
        Stroke::Line(&[[0.0, 0.0], [0.0, 1.0]]),
    ],
    when: &[],
    ports: &[[0.0, 0.0]],
};
