//! A custom friction law, from its description.

use super::drive::COLUMNS;
use crate::run::Error;
use crate::specification;
use physics::Bounds;
use physics::friction::COMPOSITION_STATES;
use physics::friction::formula::{OwnLaw, ParameterText, Problem, Refusal, StateText, Text};

/// Returns the law of a user's formulas.
pub fn own_law(formula: &specification::Formula) -> Result<&'static OwnLaw, Refusal> {
    for (i, state) in formula.states.iter().enumerate() {
        let twice = formula.states[..i].iter().any(|other| other.name == state.name);
        if twice || COLUMNS.iter().chain(&COMPOSITION_STATES).any(|name| *name == state.name) {
            let what = format!("a trajectory already has a column \"{}\"", state.name);
            let problem = Problem::of_all(what, "Give the state another name = \"...\".");
            return Err(Refusal {
                key: format!("states.{}.name", state.key),
                formula: String::new(),
                problem,
            });
        }
    }
    let states = formula.states.iter().map(|state| StateText {
        key: state.key.clone(),
        name: state.name.clone(),
        unit: state.unit.clone(),
        scale: state.scale,
        bounds: bounds(&state.bounds),
        rate: state.rate.clone(),
    });
    let levels = &formula.levels;
    OwnLaw::of(&Text {
        name: formula.name.clone(),
        title: formula.title.clone(),
        source: formula.source.clone(),
        parameters: formula.parameters.iter().map(parameter_text).collect(),
        levels: [levels.coulomb.clone(), levels.breakaway.clone(), levels.viscous.clone()],
        states: states.collect(),
        lets: formula.lets.clone(),
        force: formula.force.clone(),
        energy: formula.energy.clone(),
        slip: formula.slip.clone(),
        steady: formula.steady.clone(),
        odd: formula.odd,
    })
}

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
fn bounds(own: &specification::Bounds) -> Bounds {
    Bounds {
        lower: own.above.or(own.at_least).unwrap_or(f64::NEG_INFINITY),
        upper: own.below.or(own.at_most).unwrap_or(f64::INFINITY),
        open: own.at_least.is_none(),
        open_above: own.at_most.is_none(),
    }
}

/// Modifiers of force levels need a law that has levels.
pub(super) fn check_levels(spec: &specification::Friction, own: &OwnLaw) -> Result<(), Error> {
    let tables = [
        ("pressure", spec.pressure.is_some()),
        ("dwell", spec.dwell.is_some()),
        ("position", spec.position.is_some()),
        ("direction", spec.direction.is_some()),
        ("side_load", spec.side_load.is_some()),
    ];
    match tables.iter().find(|(_, given)| *given && !own.has_levels()) {
        Some((table, _)) => Err(Error::Specification(format!(
            "friction.{table} acts on levels, but law \"{}\" has none: name the parameter that is its Coulomb force \
             in the law's [levels], coulomb = \"...\"",
            own.meta.key
        ))),
        None => Ok(()),
    }
}
