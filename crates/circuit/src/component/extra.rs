//! Additions to the parameters of some kinds of component: a formula, or points.

use super::Kind;
use super::formula::{Written, written};
use crate::run::Error;
use crate::specification;
use math::Real;
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

/// Addition of one component.
#[derive(Clone, Debug)]
pub(crate) enum Given<P> {
    Nothing,
    /// A formula with the table of the resulting component.
    Formula(&'static Written),
    Points(Vec<Vec<P>>),
}

impl Given<f64> {
    /// Checked additions of a component of a kind.
    pub fn of(base: &'static Kind, spec: &specification::Component) -> Result<Self, Error> {
        let refuse = |what: String| Err(Error::Specification(format!("{}{what}", spec.name)));
        match (base.extra, &spec.formula, &spec.points) {
            (Extra::Nothing, None, None) => Ok(Given::Nothing),
            (Extra::Formula(role), Some(formula), None) => match written(base, role, formula) {
                Ok(written) => Ok(Given::Formula(written)),
                Err(refusal) => refuse(format!(".formula.{refusal}")),
            },
            (Extra::Points(own), None, Some(points)) => match examined(own.columns, points) {
                Ok(()) => Ok(Given::Points(points.clone())),
                Err(what) => refuse(format!(".{}{what}", own.key)),
            },
            (Extra::Points(own), None, None) if own.optional => Ok(Given::Nothing),
            (Extra::Formula(_), None, _) => refuse(".formula is missing".into()),
            (Extra::Points(own), _, None) => refuse(format!(".{} is missing", own.key)),
            (_, Some(_), None) => refuse(format!(": a {} has no formula", base.key)),
            (_, _, Some(_)) => refuse(format!(": a {} has no points", base.key)),
        }
    }

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

/// Returns the error in points, if any.
fn examined(columns: &[Parameter], points: &[Vec<f64>]) -> Result<(), String> {
    let most = Extra::MOST_POINTS;
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
