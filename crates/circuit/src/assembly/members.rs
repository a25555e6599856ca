//! Circuits of one topology that differ in numbers. The topology is analysed once, and each member sets its numbers.

use super::friction::{contact, meta, with_values};
use super::gas::gas;
use super::joints::Joints;
use super::network::Network;
use super::numbers::{place, split};
use super::variables::Assembly;
use super::wiring::wire;
use crate::component::{Instance, check};
use crate::ground::{Error, Lifted, Seeds, check_bounds, refuse, seeds, unfit};
use crate::specification::{self, Friction, FromJson};
use physics::Gas;
use serde_json::Value;

/// A number in which members of one topology differ.
#[derive(Clone, Debug)]
enum MemberNumber {
    /// A number of a component, by index.
    Own(usize, usize),
    /// A parameter of its friction law.
    Friction(usize, String),
    /// Pressure, Pa absolute, or temperature, K, of the ambient air.
    Ambient(usize),
}

/// Circuits of one topology that differ in numbers. The topology is analysed once.
#[derive(Clone, Debug)]
pub struct Members {
    /// The circuit that all members share.
    pub template: Assembly,
    gas: Gas<f64>,
    ambient: [f64; 2],
    joints: Joints,
    each: Vec<Instance<f64>>,
    /// Names of the numbers in which members differ.
    pub names: Vec<String>,
    numbers: Vec<MemberNumber>,
    /// Described friction of each component.
    friction: Vec<Option<Seeds<Friction>>>,
    general: bool,
}

/// Friction at a path of a description, with the names of the parameters in which members differ.
fn friction_of(table: &Value, parameters: &[String]) -> Result<Seeds<Friction>, Error> {
    let names: Vec<String> = parameters.iter().map(|name| format!("parameters.{name}")).collect();
    seeds(&table.to_string(), "", &names)
}

impl Network {
    /// Creates members that differ in the numbers `names`, such as "left.bore". `json` is the description of this
    /// circuit.
    pub fn members(&self, json: &str, names: &[String]) -> Result<Members, Error> {
        check_names(names)?;
        let spec = specification::Circuit::from_json(json).map_err(unfit)?;
        let mut parameters = vec![Vec::new(); spec.components.len()];
        let number = |name: &String| {
            if let Some(own) =
                ["ambient.pressure_pa", "ambient.temperature_k"].iter().position(|own| own == name)
            {
                return Ok(MemberNumber::Ambient(own));
            }
            let (component, key) = split(&self.each, name)?;
            let Some(path) = key.strip_prefix("friction.") else {
                return Ok(MemberNumber::Own(component, place(&self.each[component], key)?));
            };
            let parameter = path.strip_prefix("parameters.").unwrap_or_default();
            match &spec.components[component].friction {
                Some(own) if own.parameters.contains_key(parameter) => {
                    parameters[component].push(parameter.to_string());
                    Ok(MemberNumber::Friction(component, parameter.into()))
                }
                _ => refuse!("{name} is not a parameter of the friction law in the description"),
            }
        };
        let numbers = names.iter().map(number).collect::<Result<_, Error>>()?;
        let table: Value = serde_json::from_str(json).map_err(unfit)?;
        let friction = parameters.iter().enumerate().map(|(i, names)| {
            let own = &table["components"][i]["friction"];
            (!own.is_null()).then(|| friction_of(own, names)).transpose()
        });
        Ok(Members {
            template: self.assembly.clone(),
            gas: gas(&Lifted::plain(&spec.gas)),
            ambient: [spec.ambient.pressure_pa, spec.ambient.temperature_k],
            joints: self.joints.clone(),
            each: self.each.to_vec(),
            numbers,
            names: names.to_vec(),
            friction: friction.collect::<Result<_, Error>>()?,
            general: false,
        })
    }
}

/// Refuses a repeated name.
fn check_names(names: &[String]) -> Result<(), Error> {
    match (1..names.len()).find(|&i| names[..i].contains(&names[i])) {
        Some(twice) => refuse!("\"{}\" is given twice: members have one value of it", names[twice]),
        None => Ok(()),
    }
}

impl Members {
    /// Makes the parts independent of the values that differ between members. No simpler form of a law is chosen for a
    /// value that members set. All members therefore have one topology.
    pub fn general(mut self) -> Result<Self, Error> {
        self.general = true;
        for number in &self.numbers {
            if let MemberNumber::Own(component, place) = *number {
                self.each[component].free[place] = true;
            }
        }
        for component in 0..self.each.len() {
            self.rub(component)?;
        }
        self.template = self.wired(None)?;
        Ok(self)
    }

    /// Updates the friction of a component with its parameters.
    fn rub(&mut self, component: usize) -> Result<(), Error> {
        if let Some(own) = &self.friction[component] {
            let lifted = if self.general { Lifted::new(own, 0) } else { Lifted::plain(&own.value) };
            self.each[component].friction = Some(contact(&lifted)?);
        }
        Ok(())
    }

    /// Does the same after the parts of its law are fixed for all members.
    fn rub_on(&mut self, component: usize) -> Result<(), Error> {
        let like = self.each[component].friction.as_ref().filter(|_| self.general);
        if let (Some(like), Some(own)) = (like, &self.friction[component])
            && let Some(contact) = with_values(like, &own.value)?
        {
            self.each[component].friction = Some(contact);
            return Ok(());
        }
        self.rub(component)
    }

    /// Refuses a value that is impossible for the number `names[place]`, whatever the other numbers are.
    pub fn check(&self, place: usize, value: f64) -> Result<(), Error> {
        let bounds = match &self.numbers[place] {
            MemberNumber::Own(component, place) => {
                let row = &self.each[*component].table.parameters[*place];
                Some((row.bounds, row.unit))
            }
            MemberNumber::Ambient(0) => Some((physics::above(0.0), "Pa")),
            MemberNumber::Ambient(_) => Some((physics::above(0.0), "K")),
            MemberNumber::Friction(component, key) => {
                let law = self.friction[*component].as_ref().map(|own| meta(&own.value)).transpose()?;
                let row = law.and_then(|(law, _)| law.parameters.iter().find(|row| row.key == key));
                row.map(|row| (row.bounds, row.unit))
            }
        };
        let Some((bounds, unit)) = bounds else { return Ok(()) };
        check_bounds(&self.names[place], value, unit, &bounds)
    }

    /// Returns the member with these numbers, in the order of the names.
    pub fn member(&mut self, values: &[f64]) -> Result<Assembly, Error> {
        if values.len() != self.numbers.len() {
            return refuse!("{} values for {} numbers", values.len(), self.numbers.len());
        }
        let mut rubs = Vec::new();
        for (at, &value) in values.iter().enumerate() {
            match &self.numbers[at] {
                MemberNumber::Own(component, place) => {
                    self.check(at, value)?;
                    self.each[*component].numbers[*place] = Some(value);
                }
                MemberNumber::Friction(component, key) => {
                    if let Some(own) = &mut self.friction[*component] {
                        match own.value.parameters.get_mut(key) {
                            Some(number) => *number = value,
                            None => drop(own.value.parameters.insert(key.clone(), value)),
                        }
                    }
                    if !rubs.contains(component) {
                        rubs.push(*component);
                    }
                }
                MemberNumber::Ambient(place) => {
                    self.check(at, value)?;
                    self.ambient[*place] = value;
                }
            }
        }
        for component in rubs {
            self.rub_on(component)?;
        }
        self.each.iter().try_for_each(check)?;
        self.wired(Some(&self.template))
    }

    fn wired(&self, like: Option<&Assembly>) -> Result<Assembly, Error> {
        let ledger = !self.template.circuit.channels().is_empty();
        let parts = (&self.each[..], &self.joints);
        let circuit = like.map(|like| &*like.circuit);
        let wired = wire(&self.gas, self.ambient, parts, ledger, circuit)?;
        Ok(wired.named_like(&self.template))
    }
}
