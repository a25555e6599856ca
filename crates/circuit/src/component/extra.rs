//! Additions to the parameters of some kinds of component: a formula, or points.

use physics::Parameter;
use physics::written::Role;
use serde::ser::{Serialize, SerializeStruct, Serializer};

/// Addition to the parameters of a kind.
#[derive(Clone, Copy, Debug)]
pub enum Extra {
    /// Parameters only.
    Nothing,
    /// A formula for this quantity, with separate parameters.
    Formula(&'static Role),
    /// A table of points.
    Points(Points),
}

impl Serialize for Extra {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut out = to.serialize_struct("Extra", 2)?;
        out.serialize_field("formula", &if let Extra::Formula(role) = self { Some(role) } else { None })?;
        out.serialize_field("points", &if let Extra::Points(points) = self { Some(points) } else { None })?;
        out.end()
    }
}

/// Points: numbers in columns, with increasing values in the first. Columns with a default may be left out of a point.
#[derive(Clone, Copy, Debug, serde::Serialize)]
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

impl Extra {
    /// Points that a component requires.
    pub const fn points(columns: &'static [Parameter]) -> Self {
        Self::points_in("points", columns, false)
    }

    /// Points with a key.
    pub const fn points_in(key: &'static str, columns: &'static [Parameter], optional: bool) -> Self {
        Extra::Points(Points { key, columns, optional, most: 50 })
    }

    /// Key of the points.
    pub fn key(&self) -> Option<&'static str> {
        if let Extra::Points(points) = self { Some(points.key) } else { None }
    }
}
