//! Additions to the parameters of some kinds of component: a formula, or points.

use physics::Parameter;
use physics::written::Role;

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

/// Points: numbers in columns, with increasing values in the first. Columns with a default may be left out of a point.
#[derive(Clone, Copy, Debug)]
pub struct Points {
    /// Key in the table of a component.
    pub key: &'static str,
    /// Numbers of a point, in order.
    pub columns: &'static [Parameter],
    /// Whether the points are optional.
    pub optional: bool,
}

impl Extra {
    /// Points that a component requires.
    pub const fn points(columns: &'static [Parameter]) -> Self {
        Extra::Points(Points { key: "points", columns, optional: false })
    }

    /// Key of the points.
    pub fn key(&self) -> Option<&'static str> {
        if let Extra::Points(points) = self { Some(points.key) } else { None }
    }

    /// Largest number of points, because each costs time at every evaluation.
    pub const MOST_POINTS: usize = 50;
}
