//! A user's formula for a component: its output and variables.

use super::{
    Compiled, ParameterText, Reader, check_names, dimension, leak, leaked, not_finite, of_whole, range,
};
use crate::parameter::{Bounds, Parameter};
use ::formula::{Graph, Program};
use math::{Dual, Gather, Lane, Over, Real};
use serde::ser::{SerializeStruct, Serializer};
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// A name that a formula can use.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Given {
    /// Its name in formulas.
    pub name: &'static str,
    /// Its unit in SI; `1` for a pure number.
    pub unit: &'static str,
    /// The range of its values.
    #[serde(skip)]
    pub bounds: Bounds,
    /// Meaning, as text.
    pub meaning: &'static str,
}

/// Output and variables of one kind of formula.
#[derive(Debug)]
pub struct Role {
    /// Name and unit of the output.
    pub output: (&'static str, &'static str),
    /// Variables of an evaluation.
    pub variables: &'static [Given],
    /// Numbers of the circuit.
    pub constants: &'static [Given],
}

impl Given {
    /// A quantity with the values that it may take.
    pub const fn new(name: &'static str, unit: &'static str, bounds: Bounds, meaning: &'static str) -> Self {
        Given { name, unit, bounds, meaning }
    }
}

impl Serialize for Role {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut out = to.serialize_struct("Role", 3)?;
        out.serialize_field("output", self.output.0)?;
        out.serialize_field("unit", self.output.1)?;
        out.serialize_field("names", &[self.variables, self.constants].concat())?;
        out.end()
    }
}

/// A formula as written by its author.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    /// Its name in messages and tables.
    pub name: String,
    /// Its name for people.
    #[serde(default)]
    pub title: String,
    /// Key in references.bib; empty: none.
    #[serde(default)]
    pub source: String,
    /// Its parameters, in their order.
    pub parameters: Vec<ParameterText>,
    /// Names and formulas, in their order.
    #[serde(default)]
    pub lets: Vec<(String, String)>,
    /// The formula itself.
    pub output: String,
}

/// A checked formula: the part common to all sets of its parameters. It stays until the process ends.
#[derive(Debug)]
pub struct OwnFormula {
    /// Its name in messages and tables.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// Key in references.bib; empty: none.
    pub source: &'static str,
    /// Parameters, in the order of their values.
    pub parameters: &'static [Parameter],
    /// Warnings to the author.
    pub warnings: Vec<String>,
    /// Output and variables.
    pub role: &'static Role,
    /// Whether the formula uses each variable of its role.
    pub uses: Vec<bool>,
    graph: Graph,
    program: Program,
}

impl OwnFormula {
    /// Compiles the formula that `text` describes.
    pub fn of(role: &'static Role, text: &Text) -> Compiled<OwnFormula> {
        let given = role.variables.iter().chain(role.constants).map(|given| given.name);
        check_names(&text.name, (&text.parameters, &text.lets), given, Vec::new())?;
        let mut reader = Reader::new(&text.parameters, &text.lets)?;
        for constant in role.constants {
            let id = reader.graph.parameter(dimension(constant.unit), range(&constant.bounds));
            reader.scope.insert(constant.name.into(), id);
        }
        let mut variables = Vec::new();
        for variable in role.variables {
            let id = reader.graph.input(dimension(variable.unit), range(&variable.bounds));
            reader.scope.insert(variable.name.into(), id);
            variables.push(id);
        }
        reader.read_lets()?;
        let (key, unit) = role.output;
        let output = reader.formula(key, &text.output, unit)?;
        let reached = reader.graph.reached(&[output]);
        let uses: Vec<bool> = variables.iter().map(|id| reached.contains(id)).collect();
        if uses.iter().all(|used| !used) {
            let names: Vec<&str> = role.variables.iter().map(|given| given.name).collect();
            let what = format!("{key} is constant: it uses none of {}", names.join(", "));
            return Err(of_whole(key, &text.output, what));
        }
        Ok(OwnFormula {
            name: leak(&text.name),
            title: leak(&text.title),
            source: leak(&text.source),
            parameters: leaked(&text.parameters),
            warnings: reader.unused(&[output], key),
            role,
            uses,
            program: reader.program(&[output], key)?,
            graph: reader.graph,
        })
    }

    /// Returns whether it uses a variable.
    pub fn uses(&self, variable: &str) -> bool {
        self.role.variables.iter().zip(&self.uses).any(|(own, used)| own.name == variable && *used)
    }
}

/// A formula with values of its parameters and of the constants of its role.
///
/// Terms of these only are computed in advance, in their scalar type. The rest runs as a program over the scalar type
/// of the variables.
#[derive(Clone, Debug)]
pub struct Formula<P> {
    /// The part common to all sets of its parameters.
    pub own: &'static OwnFormula,
    values: Vec<P>,
    constants: Vec<P>,
}

impl<P: Real> Formula<P> {
    /// Creates it with its parameters in their order, then the constants of its role.
    pub fn new(own: &'static OwnFormula, values: Vec<P>) -> Self {
        Formula { own, constants: own.program.own(&own.graph.constants(&values)), values }
    }

    /// Returns its value for given variables.
    #[inline]
    pub fn value<S: Over<P>>(&self, variable: impl Fn(usize) -> S) -> S {
        let mut out = [S::zero()];
        self.own.program.run(&self.constants, S::from, variable, &mut out);
        out[0]
    }
}

impl Formula<f64> {
    /// Returns the variables with their values, as text.
    pub fn place(&self, values: &[f64]) -> String {
        let mut words = String::new();
        let used = self.own.role.variables.iter().zip(values).zip(&self.own.uses).filter(|(_, used)| **used);
        for ((variable, value), _) in used {
            let comma = if words.is_empty() { "" } else { ", " };
            let unit = if variable.unit == "1" { "" } else { variable.unit };
            let _ = write!(words, "{comma}{} = {value} {unit}", variable.name);
        }
        words.trim_end().into()
    }

    /// Returns the value and its derivatives by the variables, if all are finite.
    pub fn slopes<const N: usize>(&self, values: &[f64; N]) -> Result<(f64, [f64; N]), String> {
        let found = self.value(|k| Dual::<f64, N>::variable(values[k], k));
        let Some(what) = not_finite(&found, |k| self.own.role.variables[k].name) else {
            return Ok((found.re, found.eps));
        };
        let (key, name) = (self.own.role.output.0, self.own.name);
        Err(format!("formula \"{name}\": {key} is not finite at {}: {what}", self.place(values)))
    }
}

impl<R: Lane> Gather<R> for Formula<f64> {
    type Lanes = Formula<R>;

    fn gather(each: &[&Self]) -> Formula<R> {
        let own = each[0].own;
        assert!(each.iter().all(|other| std::ptr::eq(other.own, own)), "lanes must share one formula");
        let value = |k: usize| R::from_lanes(|lane| each[lane].values[k]);
        Formula::new(own, (0..each[0].values.len()).map(value).collect())
    }
}
