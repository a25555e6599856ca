use crate::component::prelude::*;
use crate::ground::GasId;
use crate::part::Series;
use math::{Deps, Over};
use physics::flow::NOZZLE_RATIO;
use std::f64::consts::PI;

/// A tube without waves: a flow path, and half of its volume at each end.
pub struct Tube;

impl Component for Tube {
    const KIND: Kind = Kind {
        key: "tube",
        title: "Tube, steady",
        text: "A flow path by ISO 6358 with C = 0.029 d^2/sqrt(L/d^1.25 + 510) and b = 474 C/d^2 (d and L in m, C in m3/(s Pa); \
               an empirical formula, assumed), and half of the volume pi d^2 L/4 at each end. Its wall brings the gas to T_w + (T - T_w) exp(-A h/(m cp)), h by \
               Nu = 3.66 for laminar flow and Gnielinski's for turbulent flow. It has no waves: for tubes \
               much shorter than a quarter of the wave length. Smooth-pipe theory at 7 bar gives C some 10 to 15 % higher.",
        sources: &["iso6358-2013", "gnielinski1976"],
        ports: &[Port { volume: 0.0, ..gas("1") }, Port { volume: 0.0, ..gas("2") }],
        parameters: table! {
            length: "m", physics::above(0.0), "Length L";
            diameter: "m", physics::above(0.0), "Inner diameter d";
            conductance: "m3/(s Pa)", physics::above(0.0), follows "length and diameter, by an empirical formula (assumed)",
                "Measured sonic conductance C";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), follows "conductance and diameter, by an empirical formula (assumed)",
                "Measured critical pressure ratio b";
            LINEAR_ABOVE;
            ..TUBE_WALL;
        },
        open: true,
        ..Kind::PATH
    };

    fn bring<P: Lane>(own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
        let (length, diameter) = (own.number("length"), own.number("diameter"));
        Brings::Room { volume: P::c(0.125 * PI) * diameter * diameter * length }
    }

    fn series<P: Lane>(own: &Instance<P>) -> Option<[P; 2]> {
        Some(steady(own))
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>)
    where
        Deps: Over<P>,
    {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let path = steady_path(own, from, to, build);
        build.column(own, 0, Quantity::along(path));
    }
}

/// Adds the flow path of a steady tube, with its wall.
pub(in crate::component) fn steady_path<P: Lane>(
    own: &Instance<P>,
    from: GasId,
    to: GasId,
    build: &mut Build<P>,
) -> Path
where
    Deps: Over<P>,
{
    let forward = build.usual_path(steady(own), own.number("linear_above"));
    let Some(wall) = tube_wall(own, build.ambient[1], &build.gas) else {
        return Path::of(build.passage(forward, from, to));
    };
    let (conductance, path) = (forward.conductance, build.circuit.between(from, to));
    let part = Series { forward, backward: None, walls: vec![wall], path };
    build.path_part(part, conductance)
}

/// Returns sonic conductance and critical pressure ratio of the whole tube.
pub(in crate::component) fn steady<P: Lane>(own: &Instance<P>) -> [P; 2] {
    let (length, diameter) = (own.number("length"), own.number("diameter"));
    let square = diameter * diameter;
    let conductance = own
        .given("conductance")
        .unwrap_or_else(|| P::c(0.029) * square / (length / diameter.pow(P::c(1.25)) + P::c(510.0)).sqrt());
    let ratio = own
        .given("critical_pressure_ratio")
        .unwrap_or_else(|| (P::c(474.0) * conductance / square).min(P::c(NOZZLE_RATIO)));
    [conductance, ratio]
}
