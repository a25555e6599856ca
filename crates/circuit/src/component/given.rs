//! The formula or the points of a component, from its description.

use super::formula::written;
use super::instance::Given;
use super::kind::{Kind, Points};
use crate::ground::{Error, refuse};
use crate::specification;
use physics::Parameter;

impl Given<f64> {
    /// Checked additions of a component of a kind.
    pub fn of(base: &'static Kind, spec: &specification::Component) -> Result<Self, Error> {
        let refuse = |what: String| refuse(format!("{}{what}", spec.name));
        match (base.formula, base.points, &spec.formula, &spec.points) {
            (None, None, None, None) => Ok(Given::Nothing),
            (Some(role), _, Some(formula), None) => match written(base, role, formula) {
                Ok(written) => Ok(Given::Formula(written)),
                Err(refusal) => refuse(format!(".formula.{refusal}")),
            },
            (_, Some(own), None, Some(points)) => match examined(&own, points) {
                Ok(()) => Ok(Given::Points(points.clone())),
                Err(what) => refuse(format!(".{}{what}", own.key)),
            },
            (_, Some(own), None, None) if own.optional => Ok(Given::Nothing),
            (Some(_), _, None, _) => refuse(".formula is missing".into()),
            (_, Some(own), _, None) => refuse(format!(".{} is missing", own.key)),
            (_, _, Some(_), None) => refuse(format!(": a {} has no formula", base.key)),
            (_, _, _, Some(_)) => refuse(format!(": a {} has no points", base.key)),
        }
    }
}

/// Returns the error in points, if any.
fn examined(&Points { columns, most, .. }: &Points, points: &[Vec<f64>]) -> Result<(), String> {
    if !(2..=most).contains(&points.len()) {
        return Err(format!(" has {} points: 2 to {most}", points.len()));
    }
    for row in points {
        if row.len() != columns.len() {
            return Err(format!(": a point has {} numbers, not {}", columns.len(), row.len()));
        }
        let mut each = row.iter().zip(columns);
        if let Some((value, own)) =
            each.find(|(value, own)| !value.is_finite() || !own.bounds.contain(**value))
        {
            let Parameter { key, unit, bounds, .. } = own;
            let rule = bounds.rule(*value);
            return Err(format!(": {key} = {value} {unit} is out of bounds: it must be {rule}"));
        }
    }
    if let Some(pair) = points.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
        let (Parameter { key, unit, .. }, [before, after]) = (columns[0], [pair[0][0], pair[1][0]]);
        return Err(format!(
            ": {key} = {after} {unit} comes after {before} {unit}: values must rise from point to point"
        ));
    }
    Ok(())
}
