//! A component of a circuit, and what it brings to its joints.

use super::kind::Kind;
use crate::ground::{AxisId, GasId};
use crate::part::ChamberLaw;
use math::{Lane, Real};
use physics::friction::Contact;
use physics::written::OwnFormula;

/// A formula, and the table of the resulting components.
#[derive(Debug)]
pub struct Written {
    pub kind: Kind,
    pub own: OwnFormula,
}

/// Addition of one component.
#[derive(Clone, Debug)]
pub(crate) enum Given<P> {
    Nothing,
    /// A formula with the table of the resulting component.
    Formula(&'static Written),
    Points(Vec<Vec<P>>),
}

impl Given<f64> {
    /// Returns the same with points as numbers of another type.
    pub fn lift<P: Real>(&self) -> Given<P> {
        match self {
            Given::Nothing => Given::Nothing,
            Given::Formula(written) => Given::Formula(written),
            Given::Points(rows) => {
                let row = |row: &Vec<f64>| row.iter().map(|value| P::c(*value)).collect();
                Given::Points(rows.iter().map(row).collect())
            }
        }
    }
}

impl<P> Given<P> {
    /// Returns the table of a component of a kind.
    pub fn kind(&self, base: &'static Kind) -> &'static Kind {
        if let Given::Formula(written) = self { &written.kind } else { base }
    }
}

/// One component of a circuit, its numbers in the order of its kind's parameters.
#[derive(Clone, Debug)]
pub struct Instance<P> {
    /// Its name in the circuit.
    pub name: String,
    /// Index of the kind in [`KINDS`](super::KINDS).
    pub kind: usize,
    /// Table of the kind, or the one that a formula makes of it.
    pub table: &'static Kind,
    pub(crate) extra: Given<P>,
    /// `None` for a parameter that is left out and has no default.
    pub numbers: Vec<Option<P>>,
    /// Numbers by which any pass of directions differentiates.
    pub free: Vec<bool>,
    /// Selected option of each choice.
    pub choices: Vec<usize>,
    /// Its friction, if given.
    pub friction: Option<Contact<P>>,
}

impl<P> Instance<P> {
    /// Returns the option of a choice, if the component has this choice.
    pub(crate) fn chosen(&self, choice: &str) -> Option<&'static str> {
        let mut each = self.table.choices.iter().zip(&self.choices);
        each.find(|(own, _)| own.name == choice).map(|(own, option)| own.options[*option])
    }
}

impl<P: Lane> Instance<P> {
    fn place(&self, key: &str) -> usize {
        let place = self.table.parameters.iter().position(|parameter| parameter.key == key);
        place.expect("a parameter of this kind")
    }

    /// Returns an optional number.
    pub fn given(&self, key: &str) -> Option<P> {
        self.numbers[self.place(key)]
    }

    /// Returns its points: rows in the order of its kind's columns, or `None` if its kind has no points.
    pub fn points(&self) -> &[Vec<P>] {
        if let Given::Points(rows) = &self.extra { rows } else { &[] }
    }

    /// Returns whether a number is differentiated.
    pub fn is_free(&self, key: &str) -> bool {
        self.free[self.place(key)]
    }

    /// Returns whether a number is differentiated, if the component has this number.
    pub(super) fn varies(&self, key: &str) -> bool {
        self.table.parameters.iter().any(|row| row.key == key) && self.is_free(key)
    }

    /// Returns a number that must exist, because it was checked before.
    pub fn number(&self, key: &str) -> P {
        self.given(key).expect("a number that was checked")
    }

    /// Returns whether its heat transfer follows from the laws of `physics::heat`, because no coefficient is stated.
    pub(crate) fn has_heat_law(&self) -> bool {
        let mut each = self.table.parameters.iter().zip(&self.numbers);
        each.any(|(row, number)| row.key == "heat_transfer" && number.is_none())
    }

    /// Returns a mass on a line with an incline, with friction.
    pub(super) fn guided_mass(&self, mass: &str) -> Brings<P> {
        let (mass, incline) = (self.number(mass), Some(self.number("incline")));
        Brings::Mass { mass, incline, force: P::zero(), friction: self.friction.clone() }
    }

    /// Returns the contribution of a path with a sonic conductance to others in series. Such paths are merged by a rule
    /// for the subsonic index 0.5.
    pub fn in_series(&self, conductance: P) -> Option<[P; 2]> {
        let is_usual = self.number("subsonic_index").get(0) == 0.5;
        is_usual.then(|| [conductance, self.number("critical_pressure_ratio")])
    }
}

/// Contribution of a component to the joint at one of its ports.
#[allow(missing_docs)] // of fields: each variant names its own, in their order
#[derive(Clone, Debug)]
pub enum Brings<P> {
    /// The volume of the port alone.
    Nothing,
    /// Gas of constant pressure, Pa absolute, and temperature, K.
    Reservoir { pressure: P, temperature: P },
    /// A volume.
    Volume(Vessel<P>),
    /// A volume, m3, that is added to that of the joint.
    Room { volume: P },
    /// A moving mass, kg, on an incline, rad, with an external force in +x, N, and with friction.
    Mass { mass: P, incline: Option<P>, force: P, friction: Option<Contact<P>> },
    /// A prescribed motion that no force changes.
    Motion,
    /// A leg of a mechanism, whose platform has this mass, kg.
    Guide { mass: P },
    /// A mass coupled to another by a ratio that depends on the position.
    Along,
}

/// Heat transfer between the gas of a volume and its wall.
#[derive(Clone, Copy, Debug)]
pub enum WallHeat<P> {
    /// A constant coefficient, W/(m2 K).
    Constant(P),
    /// The law of a chamber or a tank.
    Vessel {
        /// Factor of the law.
        scale: P,
        /// Diameter of the vessel, m.
        bore: P,
        /// Area of its piston, m2; `None`: a tank.
        area: Option<P>,
        /// Diameter of its port, m; `None`: that of the tube, or by the conductance there.
        port: Option<P>,
    },
    /// The law of a tube.
    Tube {
        /// Factor of the law.
        scale: P,
        /// Inner diameter, m.
        diameter: P,
    },
    /// The law of a tube for a joint.
    Joint {
        /// Volume that has a wall, m3.
        volume: P,
        /// Diameter of the narrowest tube at the joint, m; `None`: by the conductance there.
        diameter: Option<P>,
    },
}

/// A volume, m3, with a wall: m2, K.
#[derive(Clone, Debug)]
pub struct Vessel<P> {
    /// Mass and energy balance of the gas.
    pub law: ChamberLaw,
    /// Volume outside the stroke of a piston, m3.
    pub dead_volume: P,
    /// Wetted wall of that volume, m2.
    pub wall: P,
    /// Heat transfer to the wall.
    pub heat: WallHeat<P>,
    /// Temperature of the wall, K.
    pub wall_temperature: P,
}

/// The node at a port.
#[derive(Clone, Copy, Debug)]
pub enum Node {
    /// A gas node.
    Gas(GasId),
    /// A moving mass.
    Axis(AxisId),
    /// An unconnected port.
    Shut,
}

/// The nodes at the ports of a component.
pub struct Terminals<'a>(pub &'a [Node]);

impl Terminals<'_> {
    /// Returns the gas at a port.
    pub fn gas(&self, port: usize) -> Option<GasId> {
        if let Node::Gas(id) = self.0[port] { Some(id) } else { None }
    }

    /// Returns the mass at a port.
    pub fn axis(&self, port: usize) -> Option<AxisId> {
        if let Node::Axis(id) = self.0[port] { Some(id) } else { None }
    }
}
