//! The session that the values before a run describe.

use super::{FmuModel, Running};
use crate::plan::{Variable, VariableRole};
use crate::refusal::{CallRefusal, refuse};
use circuit::specification::{self, FromJson};
use circuit::{Network, Session};
use ode::Options;
use std::sync::Arc;

impl FmuModel {
    /// Returns the description with the present parameter values, including the text form.
    fn description(&self) -> Result<(String, specification::Circuit), CallRefusal> {
        let mut table = self.plan.circuit.clone();
        for (own, value) in self.plan.variables.iter().zip(&self.values) {
            if let VariableRole::Parameter { of } = &own.role {
                let Some(place) = table.pointer_mut(of) else {
                    return refuse(format!("{}: the description has no number {of}", own.name));
                };
                *place = (*value).into();
            }
        }
        let json = table.to_string();
        let spec = specification::Circuit::from_json(&json);
        let spec = spec.or_else(|error| refuse(format!("the description cannot be read: {error}")))?;
        Ok((json, spec))
    }

    pub(super) fn start(&self) -> Result<Running, CallRefusal> {
        let (json, spec) = self.description()?;
        let network = Network::assemble(&spec, false)?;
        let (mut start, mut age) = (self.plan.start.clone(), 0.0);
        let mut inputs = Vec::new();
        for (own, &value) in self.plan.variables.iter().zip(&self.values) {
            match &own.role {
                VariableRole::Start { of } => start.extend(of.iter().map(|name| (name.clone(), value))),
                VariableRole::Age => age = value,
                VariableRole::Input { of, .. } => inputs.push((network.assembly.variables.input(of)?, value)),
                _ => {}
            }
        }
        let names = network.assembly.given_names();
        let mut other = names.iter().copied().filter(|name| !start.contains_key(*name));
        let mut gone = start.keys().map(String::as_str).filter(|name| !names.contains(name));
        if let Some(name) = other.next().or_else(|| gone.next()) {
            return refuse(format!(
                "with these values the circuit has other states, as {name}: cells are laid out where it is exported. \
                 Export the drive with them"
            ));
        }
        let options = Options { rtol: self.rtol, ..Options::default() };
        let session = network.session_at(self.t0, &inputs, &start, age, options)?.of_description(&json);
        let places = self.places(&session)?;
        let axis = self.plan.actuator.as_ref().map(|start| {
            let none = || refuse(format!("the circuit has no piston that starts at \"{start}\""));
            session.axis(start).map_or_else(none, Ok)
        });
        let motion = axis.transpose()?;
        let origin = session.state().to_vec();
        Ok(Running { session, places, motion, origin, good: Vec::new() })
    }

    fn places(&self, session: &Session) -> Result<Arc<[usize]>, CallRefusal> {
        let variables = &session.assembly.variables;
        let state = |of: &str| session.circuit().state_names().iter().position(|(name, _)| name == of);
        let each = self.plan.variables.iter().map(|own| {
            let place = match &own.role {
                VariableRole::Input { of, discrete } => {
                    variables.input(of).ok().filter(|input| *discrete || session.is_continuous(*input))
                }
                VariableRole::Output { of } => variables.column(of).ok(),
                VariableRole::State { of } | VariableRole::Change { of } | VariableRole::Rate { of } => {
                    state(of)
                }
                VariableRole::Event { of } => Some(*of),
                _ => Some(0),
            };
            let what = "with these values the circuit has no place for";
            let why =
                || refuse(format!("{what} {}, or it has a history. Export the drive with them", own.name));
            place.map_or_else(why, Ok)
        });
        let places: Arc<[usize]> = each.collect::<Result<_, _>>()?;
        let motion = if self.plan.actuator.is_some() { 2 } else { 0 };
        let is_rate = |own: &&Variable| matches!(own.role, VariableRole::Rate { .. });
        let told = self.plan.variables.iter().filter(is_rate).count();
        if told + motion != session.circuit().state_names().len() {
            return refuse(format!(
                "with these values the circuit has {} states, but the description has {told} rates. Export the drive with these values",
                session.circuit().state_names().len() - motion
            ));
        }
        Ok(places)
    }
}
