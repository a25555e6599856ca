//! Starts of a circuit by name, and sessions from them.

use super::session::Session;
use crate::assembly::variables::{Assembly, Target};
use crate::circuit::Circuit;
use crate::component::Starting;
use crate::ground::{Error, refuse};
use crate::part::mechanism::Unreached;
use ode::Options;
use physics::{in_usual_unit, is_huge};
use std::collections::BTreeMap;

/// Age of the contacts of a start, s.
const AGE: &str = "contact_age_s";

impl Assembly {
    /// Returns the names of the start values: all except the inner states of friction, which begin at rest.
    pub fn given_names(&self) -> Vec<&str> {
        let starts = self.variables.starts.iter();
        let given = starts.filter(|(starting, _)| !matches!(starting, Starting::Inner(_)));
        given.flat_map(|(_, names)| names.iter().map(String::as_str)).collect()
    }

    /// Returns a session at a start, given by name.
    pub fn session(&self, start: &BTreeMap<String, f64>, options: Options) -> Result<Session, Error> {
        self.session_under(&[], start, options)
    }

    /// Returns the same, with locks at the positions for these commands: an input and its value.
    pub(super) fn session_under(
        &self,
        first: &[(usize, f64)],
        start: &BTreeMap<String, f64>,
        options: Options,
    ) -> Result<Session, Error> {
        let age = start.get(AGE).copied().unwrap_or_default();
        let numbers = self.numbers(start)?;
        self.check_poses(&numbers)?;
        Ok(Session::new(self, 0.0, self.stand(first, &numbers, age), options))
    }

    /// Refuses positions of legs that are impossible for their platform.
    fn check_poses(&self, start: &[f64]) -> Result<(), Error> {
        let (mut rest, mut axes) = (start, Vec::new());
        for (starting, names) in &self.variables.starts {
            let count = match starting {
                Starting::Gas(_) | Starting::Axis(_) => 2,
                Starting::Kept(_) => 1,
                Starting::Inner(_) => 0,
            };
            if let Starting::Axis(axis) = starting {
                axes.push((axis.0, &names[0], [rest[0], rest[1]]));
            }
            rest = &rest[count..];
        }
        for (name, platform, _) in self.platforms() {
            let of = |node: &usize| axes.iter().find(|(axis, ..)| axis == node).expect("the start of a leg");
            let legs: Vec<_> = platform.nodes.iter().map(of).collect();
            let starts: Vec<[f64; 2]> = legs.iter().map(|(.., start)| *start).collect();
            platform.check_start(&starts).map_err(|fault| {
                let x = |leg: usize| format!("the start {} = {}", legs[leg].1, in_usual_unit(starts[leg][0], "m"));
                Error::Specification(match fault {
                    Unreached::Leg(leg, nearest) => format!(
                        "{}: no pose of {name} has these positions of its legs. In the nearest pose it is {}",
                        x(leg),
                        in_usual_unit(nearest, "m")
                    ),
                    Unreached::Pose(tilt) => format!(
                        "{}: the pose of {name} with these positions is singular, or tilts by {tilt:.0} deg. Start nearer to a level pose",
                        x(0)
                    ),
                })
            })?;
        }
        Ok(())
    }

    /// Returns start values, given by name, in the order of [`Assembly::given_names`].
    pub(super) fn numbers(&self, start: &BTreeMap<String, f64>) -> Result<Vec<f64>, Error> {
        let names = self.given_names();
        if let Some(name) = start.keys().find(|name| *name != AGE && !names.contains(&name.as_str())) {
            return refuse!("there is no start value \"{name}\"; there are {}", names.join(", "));
        }
        let number = |name: &str| match start.get(name) {
            None => refuse!("the start value {name} is missing"),
            Some(value) => Ok(*value),
        };
        let numbers = names.into_iter().map(number).collect::<Result<Vec<_>, _>>()?;
        match self.impossible_start(&numbers, false) {
            Some((name, value, rule)) => refuse!("the start value {name} = {value} must be {rule}"),
            None => Ok(numbers),
        }
    }

    /// Returns the first impossible start value: its name, the value, and the rule. Along a run the values have inner
    /// states of friction, and armatures may be on their way.
    pub fn impossible_start(&self, start: &[f64], along_run: bool) -> Option<(&str, f64, &'static str)> {
        let starts = self.variables.starts.iter();
        let starts = starts.filter(|(of, _)| along_run || !matches!(of, Starting::Inner(_)));
        let names = starts.flat_map(|(of, names)| names.iter().map(move |name| (of, name)));
        names.zip(start).find_map(|((of, name), &value)| {
            let rule = match of {
                _ if is_huge(value) && !along_run => "a magnitude of at most 1e30",
                Starting::Gas(_) if !(value > 0.0 && value.is_finite()) => "above zero",
                Starting::Kept(_) if !(along_run || value == 0.0 || value == 1.0) => {
                    "0 or 1, because the valve rests in an end position"
                }
                _ if !value.is_finite() => "finite",
                _ => return None,
            };
            Some((&name[..], value, rule))
        })
    }

    /// Returns the equations and their state at a start. The numbers have the order of [`Assembly::given_names`].
    /// Contacts have this age, s. Locks are at the positions for the commands `first`: an input and its value. Valves
    /// begin at rest.
    pub fn stand(&self, first: &[(usize, f64)], start: &[f64], age: f64) -> (Circuit<f64>, Vec<f64>) {
        self.stand_in(Circuit::clone(&self.circuit), first, start, age)
    }

    /// Returns the same for another circuit with the same structure.
    pub fn stand_in(
        &self,
        mut circuit: Circuit<f64>,
        first: &[(usize, f64)],
        start: &[f64],
        age: f64,
    ) -> (Circuit<f64>, Vec<f64>) {
        let (inputs, timings) = (&self.variables.inputs, &self.timings);
        for &(input, value) in first {
            if matches!(inputs[input].target, Target::Timed(timing) if timings[timing].stands_at_first()) {
                self.set(&mut circuit, input, 0, value);
            }
        }
        let y = self.start(&mut circuit, start, Some(age));
        (circuit, y)
    }

    /// Returns a session at time 0 that continues from the state of another session with the same structure.
    pub fn session_from(&self, state: &[f64], options: Options) -> Result<Session, Error> {
        let (mut circuit, mut y) = (Circuit::clone(&self.circuit), state.to_vec());
        let n = circuit.n_states();
        if y.len() != n {
            return refuse!(
                "the state has {} values and belongs to another circuit: this one has {n}",
                y.len()
            );
        }
        y.resize(n + circuit.channels().len(), 0.0);
        circuit.find_modes(&mut y);
        Ok(Session::new(self, 0.0, (circuit, y), options))
    }
}
