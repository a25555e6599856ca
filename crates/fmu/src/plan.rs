//! What a tool sees of a drive: the file `resources/drive.json` of an FMU, which is also what `pneudrive_create` takes.

use crate::law::LawPlan;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// A circuit, its start, and its variables: the place of a variable is its value reference.
#[derive(Debug, Deserialize)]
pub struct Plan {
    /// The instantiation token, or GUID, of the FMU that this belongs to.
    pub token: String,
    /// The circuit in the core's form.
    #[serde(default)]
    pub circuit: Value,
    /// A controller, in place of a circuit.
    #[serde(default)]
    pub law: Option<LawPlan>,
    /// The start by the core's names.
    #[serde(default)]
    pub start: BTreeMap<String, f64>,
    /// Relative tolerance of the solver.
    pub rtol: f64,
    /// The name of the start position of the piston whose motion is given from outside, if it is.
    #[serde(default)]
    pub actuator: Option<String>,
    pub variables: Vec<Variable>,
}

/// A variable that a tool sees.
#[derive(Debug, Deserialize)]
pub struct Variable {
    pub name: String,
    #[serde(flatten)]
    pub role: Role,
    /// Its value at the start, of what can be set.
    #[serde(default)]
    pub start: f64,
}

/// What a variable is.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "role", rename_all = "lowercase")]
pub enum Role {
    /// s.
    Time,
    /// An input of the session; a discrete one has a history, so that it changes at events only.
    Input {
        of: String,
        discrete: bool,
    },
    /// Position, m, and velocity, m/s, of the piston of an actuator.
    Position,
    Velocity,
    /// A number of the circuit, by its JSON pointer.
    Parameter {
        of: String,
    },
    /// Numbers of the start that are equal, by the core's names.
    Start {
        of: Vec<String>,
    },
    /// Time for which all contacts have stood at the start, s.
    Age,
    /// A column of a trajectory.
    Output {
        of: String,
    },
    /// A state, its change since the start or the last event, and its rate.
    State {
        of: String,
    },
    Change {
        of: String,
    },
    Rate {
        of: String,
    },
    /// An event function.
    Event {
        of: usize,
    },
    /// The force of an actuator on what it moves, N.
    Force,
}

impl Role {
    /// Whether it keeps the value that it was given before the run.
    pub fn is_fixed(&self) -> bool {
        matches!(self, Role::Parameter { .. } | Role::Start { .. } | Role::Age)
    }

    /// Whether it may be set during the run.
    pub fn is_input(&self) -> bool {
        matches!(self, Role::Input { .. } | Role::Position | Role::Velocity)
    }
}
