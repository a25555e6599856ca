//! Description of a drive for a tool: the file `resources/drive.json` of an FMU, and the argument of
//! `pneudrive_create`.

use control::Reference;
use serde::Deserialize;
use serde_json::Value;
use servo::{Encoder, specification};
use std::collections::BTreeMap;

/// A circuit, its start, and its variables. The index of a variable is its value reference.
#[derive(Debug, Deserialize)]
pub struct FmuPlan {
    /// Instantiation token (GUID) of the FMU.
    pub token: String,
    /// Circuit in the core's form.
    #[serde(default)]
    pub circuit: Value,
    /// Controller, instead of a circuit.
    #[serde(default)]
    pub law: Option<LawPlan>,
    /// Start by the core's names.
    #[serde(default)]
    pub start: BTreeMap<String, f64>,
    /// Relative tolerance of the solver.
    pub rtol: f64,
    /// Name of the start position of the piston whose motion the tool prescribes, if any.
    #[serde(default)]
    pub actuator: Option<String>,
    pub variables: Vec<Variable>,
}

/// A controller with its references.
#[derive(Debug, Deserialize)]
pub struct LawPlan {
    pub controller: specification::Controller,
    pub motion: Reference,
    /// Its position sensor.
    pub position: Encoder,
}

/// A variable of the FMU.
#[derive(Debug, Deserialize)]
pub struct Variable {
    pub name: String,
    #[serde(flatten)]
    pub role: VariableRole,
    /// Start value of a settable variable.
    #[serde(default)]
    pub start: f64,
}

/// Role of a variable.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "role", rename_all = "lowercase")]
pub enum VariableRole {
    /// Time, s.
    Time,
    /// An input of the session. A discrete input has a history and changes only at events.
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
    /// Equal start values, by the core's names.
    Start {
        of: Vec<String>,
    },
    /// Rest time of all contacts before the start, s.
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
    /// Force of an actuator on the moved body, N.
    Force,
}

impl VariableRole {
    /// Whether it keeps the value that was set before the run.
    pub fn is_fixed(&self) -> bool {
        matches!(self, VariableRole::Parameter { .. } | VariableRole::Start { .. } | VariableRole::Age)
    }

    /// Whether it may be set during the run.
    pub fn is_input(&self) -> bool {
        matches!(self, VariableRole::Input { .. } | VariableRole::Position | VariableRole::Velocity)
    }
}
