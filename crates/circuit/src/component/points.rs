//! Points of some kinds of component, in addition to their parameters.

use physics::Parameter;

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

impl Points {
    /// Points that a component requires.
    pub const fn of(columns: &'static [Parameter]) -> Option<Self> {
        Some(Points { key: "points", columns, optional: false, most: 50 })
    }
}
