//! Volumes, restrictions, pistons and springs joined into one system of equations.
//!
//! A [`Circuit`] consists of parts and the nodes that join them. Gas nodes carry pressure, temperature, mass and
//! enthalpy flow. Axes carry position, velocity and force. [`Drive`] and [`Tank`] are assemblies of public parts only.

#![warn(missing_docs)]

/// Crates for authors of component crates.
pub use {math, ode, physics, specification};

mod assembly;
mod circuit;
mod component;
mod drawn;
mod impacts;
mod jobs;
mod ledger;
mod lifted;
mod mechanism;
mod net;
pub mod own;
mod part;
mod run;

pub use assembly::{
    ALONG, Assembly, ByStart, DIRECTIONS, Drive, Driven, Foresight, InputPlan, Linear, Mechanics, Members,
    Names, Network, Prescribed, Quantity, Record, Restart, Servo, Session, Settable, Shooting, Shot,
    Starting, Tank, Target, Variables, close, friction_law, own_law, steady_sensitivity, valve_openings,
};
pub use circuit::{AxisId, CarriageId, Circuit, GasId, Path, PistonSide};
pub use component::{
    Choice, Extra, Holds, KINDS, Kind as ComponentKind, Points, Port, PortKind, Stroke, Symbol, formula_kind,
    kinds, register,
};
pub use impacts::Impact;
pub use jobs::run_jobs;
pub use ledger::{Balance, Channel, Kind, balance};
pub use mechanism::{Evaluated, Platform};
pub use net::{AxisNode, GasNode, Net};
pub use part::{
    Axis, Carriage, ChamberLaw, Cylinder, EndStops, Face, Given, Input, InputId, Link, Part, PartId,
    Reservoir, Restriction, Spring, Volume,
};
pub use run::{Error, Look, Run, advance, budget, failure_of, sample_times};
