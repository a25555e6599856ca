//! Components as sold by makers: cylinders, valves, tubes and others. Each has a table (ports, parameters, inputs,
//! outputs) and parts. A new component needs a file here and a word in `components!`.

mod build;
mod flow;
mod formula;
mod gas;
mod given;
mod instance;
mod kind;
mod kinds;
pub(crate) mod mechanics;
mod prelude;
mod quantity;
mod series;
mod table;
mod timing;
mod valves;
mod walls;

use crate::table;

pub use build::{Acts, Build, Component, Leg, Piston};
pub(crate) use instance::Given;
pub use instance::{Brings, Instance, Node, Terminals, Vessel, WallHeat};
pub(crate) use kind::joint_volume;
pub use kind::{Choice, FrictionTable, Holds, Kind, Points, PortKind, axis, gas};
pub use kinds::{KINDS, formula_kind};
pub(crate) use kinds::{check, compose, series};
pub use quantity::{Quantity, Starting};
pub(crate) use series::{Chain, PortId};
pub use table::{Row, count, join};
pub use timing::Timing;
pub(crate) use timing::average;
pub(crate) use walls::tube_wall;
