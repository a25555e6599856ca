//! Items for a separate crate that adds a component. They are the table ([`ComponentKind`], [`table!`](crate::table)), the
//! builder ([`Build`]), and parts with their equations ([`own_part!`](crate::own_part), [`Part`]).
//! `examples/own-component` is such a crate.

pub use crate::component::{
    Acts, Brings, Build, Choice, Component, Holds, Instance, Kind as ComponentKind, LINEAR_ABOVE, Node, Port,
    PortKind, Row, SUBSONIC_INDEX, Stroke, Symbol, Terminals, Vessel, WallHeat, axis, chamber, exhaust, gas,
    kinds, pilot, register,
};
#[doc(hidden)]
pub use crate::component::{count, join};
pub use crate::ground::{Between, Common, Given, Input, Own, OwnMut, Part, State};
pub use crate::part::{Family, InputId, Member, PartId};
pub use crate::{AxisId, GasId, Net, Path, Quantity};
