//! The table of a kind of component.

use super::table::Row;
use physics::Parameter;
use physics::written::{Given, Role};
use serde::{Serialize, Serializer};

/// Volume of a port of a fitting or a valve, m3 (assumed): a bore of 5 mm, 10 mm long.
const PORT_VOLUME: f64 = 2e-7;

/// Kind of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PortKind {
    /// A gas port.
    Gas,
    /// A mass that moves along one line.
    Axis,
    /// A pilot port: it senses the pressure of the gas at its joint without any flow.
    Pilot,
}

/// Effect of a port on the state of its joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Holds {
    /// Restriction or mass: the port takes the gas or the motion of the joint.
    #[serde(rename = "")]
    Nothing,
    /// A separate volume.
    Volume,
    /// A constant pressure.
    Pressure,
    /// A restriction that sets the pressure after it to the value of the component.
    Set,
    /// An axis with a commanded motion, independent of the connected components.
    Motion,
}

/// A port of a component.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Port {
    /// Its name within the component.
    pub name: &'static str,
    /// Kinds of port that may be joined to it.
    pub kind: PortKind,
    /// Open to the ambient air if not joined.
    pub exhaust: bool,
    /// Shut if not joined.
    pub optional: bool,
    /// Source of the state at the port.
    pub holds: Holds,
    /// Volume that it adds to a joint without a separate volume, m3 (assumed).
    #[serde(skip)]
    pub volume: f64,
}

/// Returns a gas port that adds the volume of a small fitting to its joint.
pub const fn gas(name: &'static str) -> Port {
    Port {
        name,
        kind: PortKind::Gas,
        exhaust: false,
        optional: false,
        holds: Holds::Nothing,
        volume: PORT_VOLUME,
    }
}

/// Returns the same port, open to the ambient air if nothing is joined to it.
pub const fn exhaust(name: &'static str) -> Port {
    Port { exhaust: true, ..gas(name) }
}

/// Returns a port that senses only pressure.
pub const fn pilot(name: &'static str) -> Port {
    Port { kind: PortKind::Pilot, volume: 0.0, ..gas(name) }
}

/// Returns a port of a volume, which includes the volume of the port.
pub const fn chamber(name: &'static str) -> Port {
    Port { holds: Holds::Volume, volume: 0.0, ..gas(name) }
}

/// Returns a port of a moving mass.
pub const fn axis(name: &'static str, optional: bool) -> Port {
    Port { name, kind: PortKind::Axis, exhaust: false, optional, holds: Holds::Nothing, volume: 0.0 }
}

/// A choice of a component: its options, the first being the default.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Choice {
    /// Its key in a description.
    pub name: &'static str,
    /// The options.
    pub options: &'static [&'static str],
    /// Meaning of the choice as text.
    pub meaning: &'static str,
}

/// A variable of a component: name, unit, meaning.
pub type Variable = (&'static str, &'static str, &'static str);

/// Writes variables as tables.
fn named<S: Serializer>(variables: &[Variable], to: S) -> Result<S::Ok, S::Error> {
    let given = |&(name, unit, meaning): &Variable| Given { name, unit, bounds: physics::any(), meaning };
    to.collect_seq(variables.iter().map(given))
}

/// Whether a component takes a friction table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FrictionTable {
    /// It has no friction.
    #[serde(rename = "")]
    No,
    /// It may have friction.
    Optional,
    /// It requires friction.
    Needed,
}

/// Points: numbers in columns, with increasing values in the first. Columns with a default may be left out of a point.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Points {
    /// Key in the table of a component.
    pub key: &'static str,
    /// Numbers of a point, in order.
    pub columns: &'static [Parameter],
    /// Whether the points are optional.
    pub optional: bool,
    /// Largest number of points, because each costs time at every evaluation.
    pub most: usize,
}

impl Points {
    /// Points that a component requires.
    pub const fn of(columns: &'static [Parameter]) -> Option<Self> {
        Some(Points { key: "points", columns, optional: false, most: 50 })
    }
}

/// The table of a kind of component.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Kind {
    /// Its key in a description.
    #[serde(rename = "kind")]
    pub key: &'static str,
    /// Title for users.
    pub title: &'static str,
    /// Its description and equation.
    #[serde(rename = "doc")]
    pub text: &'static str,
    /// Keys in references.bib.
    pub sources: &'static [&'static str],
    /// Its ports, in the order of the nodes in [`Terminals`].
    pub ports: &'static [Port],
    /// Its parameters.
    pub parameters: &'static [Row],
    /// Its choices, which are words and not numbers.
    pub choices: &'static [Choice],
    /// Quantity for which it takes a formula with separate parameters.
    pub formula: Option<&'static Role>,
    /// Its table of points.
    pub points: Option<Points>,
    /// Whether gas can always pass between its ports.
    pub open: bool,
    /// Whether it takes a friction table.
    pub friction: FrictionTable,
    /// Keys of numbers that only the schedule uses, or that are rounded. Derivatives by them do not exist.
    pub discrete: &'static [&'static str],
    /// Its inputs.
    #[serde(serialize_with = "named")]
    pub inputs: &'static [Variable],
    /// Its outputs.
    #[serde(serialize_with = "named")]
    pub outputs: &'static [Variable],
}

impl Kind {
    /// Table with the default values of most kinds.
    pub const PLAIN: Kind = Kind {
        key: "",
        title: "",
        text: "",
        sources: &[],
        ports: &[],
        parameters: &[],
        choices: &[],
        formula: None,
        points: None,
        open: false,
        friction: FrictionTable::No,
        discrete: &[],
        inputs: &[],
        outputs: &[],
    };

    /// Table of a flow path by ISO 6358 from port 1 to port 2.
    pub const PATH: Kind = Kind {
        sources: &["iso6358-2013"],
        ports: &[gas("1"), gas("2")],
        outputs: &[("mass_flow_kg_s", "kg/s", "mass flow from port 1 to port 2")],
        ..Kind::PLAIN
    };

    /// Returns whether a word of its table is reserved, so that a formula cannot use it as a parameter.
    pub(super) fn takes(&self, key: &str) -> bool {
        ["kind", "at", "use", "copies", "formula", "friction"].contains(&key)
            || self.choices.iter().map(|choice| choice.name).any(|name| name == key)
            || self.inputs.iter().any(|(name, ..)| *name == key)
    }
}

/// Least volume of a joint, m3 (assumed).
const LEAST_VOLUME: f64 = 1e-7;

/// Returns the least volume of a joint to which ports add `ports` m3.
pub(crate) fn joint_volume(ports: f64) -> f64 {
    ports.max(LEAST_VOLUME)
}
