//! Names that the file of a component uses.

pub(super) use super::build::{Acts, Build, Component, Piston};
pub(super) use super::instance::{Brings, Instance, Terminals, Vessel, WallHeat};
pub(super) use super::kind::{
    Choice, FrictionTable, Holds, Kind, Points, Port, Variable, axis, chamber, exhaust, gas, pilot,
};
pub(super) use super::quantity::{Quantity, Starting};
pub(super) use super::table::{LINEAR_ABOVE, Row, SUBSONIC_INDEX};
pub(super) use super::timing::Timing;
pub(super) use super::walls::{HEAT_SCALE, TUBE_WALL, WALL, tube_heat, tube_wall};
pub(super) use crate::ground::{Error, refuse};
pub(super) use crate::part::Path;
pub(super) use crate::table;
pub(super) use math::Lane;
pub(super) use physics::in_usual_unit;
