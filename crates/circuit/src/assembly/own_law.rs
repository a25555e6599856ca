//! A custom friction law, from its description.

use crate::ground::{Error, refuse};
use crate::specification;
use physics::friction::COMPOSITION_STATES;
use physics::friction::formula::{OwnLaw, Refusal, Text};

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
pub fn own_law(text: &Text) -> Result<&'static OwnLaw, Refusal> {
    for (i, state) in text.states.iter().enumerate() {
        let twice = text.states[..i].iter().any(|other| other.name == state.name);
        if twice || COLUMNS.iter().chain(&COMPOSITION_STATES).any(|name| *name == state.name) {
            let what = format!("a trajectory already has a column \"{}\"", state.name);
            let remedy = "Give the state another name = \"...\".";
            return Err(Refusal::of(format!("states.{}.name", state.key), what, remedy));
        }
    }
    OwnLaw::of(text)
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
        Some((table, _)) => refuse!(
            "friction.{table} acts on levels, but law \"{}\" has none: name the parameter that is its Coulomb force \
             in the law's [levels], coulomb = \"...\"",
            own.meta.key
        ),
        None => Ok(()),
    }
}
