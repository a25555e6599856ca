//! A custom friction law, from its description.

use crate::ground::{Error, bounds, parameter_text};
use crate::specification;
use physics::friction::COMPOSITION_STATES;
use physics::friction::formula::{OwnLaw, Problem, Refusal, StateText, Text};

/// Columns of the trajectory of a drive, before the inner states of friction.
pub(super) const COLUMNS: [&str; 13] = [
    "time_s",
    "position_m",
    "velocity_m_s",
    "acceleration_m_s2",
    "pressure_a_pa",
    "temperature_a_k",
    "pressure_b_pa",
    "temperature_b_k",
    "friction_force_n",
    "end_stop_force_n",
    "command",
    "mass_flow_a_kg_s",
    "mass_flow_b_kg_s",
];

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
