//! Parameters of formulas of users.

use crate::specification;
use physics::Bounds;
use physics::friction::formula::ParameterText;

/// A parameter in a custom law's description.
pub(crate) fn parameter_text(p: &specification::FormulaParameter) -> ParameterText {
    ParameterText {
        key: p.key.clone(),
        unit: p.unit.clone(),
        bounds: bounds(&p.bounds),
        default: p.default,
        meaning: p.meaning.clone(),
    }
}

/// Missing bounds are infinite and open.
pub(crate) fn bounds(own: &specification::Bounds) -> Bounds {
    Bounds {
        lower: own.above.or(own.at_least).unwrap_or(f64::NEG_INFINITY),
        upper: own.below.or(own.at_most).unwrap_or(f64::INFINITY),
        open: own.at_least.is_none(),
        open_above: own.at_most.is_none(),
    }
}
