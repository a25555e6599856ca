//! Walls of components: their parameters, and the heat transfer that follows from them.

use super::{Instance, Row, WallHeat, table};
use crate::part::TubeWall;
use math::Lane;
use physics::Gas;
use physics::heat::{Heat, Pipe};
use std::f64::consts::PI;

/// The factor of a law of heat transfer.
pub(super) const HEAT_SCALE: Row = table! {
    heat_transfer_scale: "1", physics::at_least(0.0), default 1.0, assumed "the law, uncertain by a factor of 2", only "no heat_transfer",
        "Factor of the law of heat transfer";
}[0];
/// Rows of the wall of a tube.
pub(super) const TUBE_WALL: [Row; 3] = *table! {
    heat_transfer: "W/(m2 K)", physics::at_least(0.0), follows "Nu = 3.66 for laminar flow and Gnielinski's for turbulent flow",
        "Heat-transfer coefficient to the wall, if it is constant";
    heat_transfer_scale: "1", physics::at_least(0.0), default 1.0, assumed "the law, uncertain by a factor of 1.4", only "no heat_transfer",
        "Factor of the law of heat transfer";
    wall_temperature: "K", physics::above(0.0), follows "the ambient temperature", "Temperature of the wall";
};

/// Returns the heat transfer of a tube with the rows [`TUBE_WALL`].
pub(super) fn tube_heat<P: Lane>(own: &Instance<P>) -> WallHeat<P> {
    let law =
        || WallHeat::Tube { scale: own.number("heat_transfer_scale"), diameter: own.number("diameter") };
    own.given("heat_transfer").map_or_else(law, WallHeat::Constant)
}

/// Returns the wall of a steady tube, if it exchanges heat.
pub(crate) fn tube_wall<P: Lane>(
    own: &Instance<P>,
    ambient_temperature: P,
    gas: &Gas<P>,
) -> Option<TubeWall<P>> {
    if !own.table.key.starts_with("tube") {
        return None;
    }
    let (length, diameter) = (own.number("length"), own.number("diameter"));
    let heat = match own.given("heat_transfer") {
        None => Heat::Pipe(Pipe::new(own.number("heat_transfer_scale"), diameter, gas)),
        Some(coefficient) if coefficient.get(0) == 0.0 && !own.is_free("heat_transfer") => return None,
        Some(coefficient) => Heat::Newton(coefficient),
    };
    let temperature = own.given("wall_temperature").unwrap_or(ambient_temperature);
    Some(TubeWall { heat, area: P::c(PI) * diameter * length, temperature })
}

/// Rows of a wall that stores heat.
pub(super) const WALL: &[Row] = table! {
    wall_capacity: "J/K", physics::above(0.0), within "wall", "Heat capacity of the wall, which stores heat at one temperature; absent: a wall at constant temperature";
    wall_outer_area: "m2", physics::at_least(0.0), within "wall", "Area of the wall on the side of the ambient air";
    wall_outer_heat_transfer: "W/(m2 K)", physics::at_least(0.0), default 10.0, assumed "usual for still air, with radiation",
        within "wall", "Heat-transfer coefficient from the ambient air to the wall";
};
