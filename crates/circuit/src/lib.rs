//! Volumes, restrictions, pistons and springs joined into one system of equations.
//!
//! A [`Circuit`] consists of parts and the nodes that join them. Gas nodes carry pressure, temperature, mass and
//! enthalpy flow. Axes carry position, velocity and force.
//!
//! The floors, from below: `ground`, `part`, `circuit`, `component`, `assembly`. Each uses only those below it.

#![warn(missing_docs)]

/// The crates below.
pub use {math, ode, physics, specification};

mod assembly;
mod circuit;
mod component;
mod ground;
mod part;

pub use assembly::{
    ALONG, Assembly, Driven, IMPACT_ENERGY_J_M2, InputPlan, Linear, Mechanics, Members, Names, Network,
    Prescribed, Record, Run, Sampling, Session, Settable, Shooting, Shot, Target, Variables, close,
    friction_law, own_law, sample_times, steady_sensitivity, valve_openings,
};
pub use circuit::{Balance, Circuit, Impact, Look, Path, advance, balance, budget, failure_of};
pub use component::{
    Brings, FrictionTable, Holds, Instance, KINDS, Kind as ComponentKind, Points, PortKind, Quantity, Row,
    Starting, formula_kind,
};
pub use ground::{AxisId, Channel, DIRECTIONS, Error, GasId, Given, Input, Kind, Net, run_jobs};
pub use part::mechanism::Evaluated;
pub use part::{Carriage, ChamberLaw, InputId, PartId, PistonSide, Platform};
