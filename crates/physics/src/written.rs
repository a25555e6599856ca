//! User formulas over names with units, read in one place for friction laws and for components.

mod own;

use crate::parameter::{Bounds, Parameter};
use ::formula::{Dimension, Graph, Id, Place, Program, Range, Scope, parse};
use math::Dual;
use serde::Deserialize;
use std::collections::HashMap;
use std::fmt;

pub use ::formula::Problem;
pub use own::{Formula, Given, OwnFormula, Role, Text};

const MOST_PARAMETERS: usize = 48;
const MOST_LETS: usize = 64;
const MOST_NAME: usize = 80;

/// Names with a meaning in every formula.
const TAKEN: [&str; 18] = [
    "pi", "and", "or", "not", "abs", "sign", "sqrt", "exp", "ln", "tanh", "sin", "cos", "min", "max", "pow",
    "fma", "if", "select",
];

/// A parameter as written by its author, quantities in SI.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterText {
    /// Its name in formulas.
    pub key: String,
    /// Its unit in SI.
    pub unit: String,
    /// The values that it may take, in the unit.
    #[serde(default)]
    pub bounds: Bounds,
    /// Value where a description gives none, if there is one.
    pub default: Option<f64>,
    /// Meaning, as text.
    #[serde(default)]
    pub meaning: String,
}

/// Reason for the rejection of formulas.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// Place: `force`, `let.g`, `states.z.rate`, `parameters.vs.unit`.
    pub key: String,
    /// The formula at this place, if it is a formula.
    pub formula: String,
    /// The error, its place in the formula, and the remedy.
    pub problem: Problem,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.key, self.problem)?;
        if let Some((line, column, text, caret)) = self.problem.shown(&self.formula) {
            let line = if self.formula.contains('\n') { format!("line {line}, ") } else { String::new() };
            write!(f, " ({line}column {column})\n    {text}\n    {caret}")?;
        }
        if !self.problem.remedy.is_empty() {
            write!(f, "\n    {}", self.problem.remedy)?;
        }
        Ok(())
    }
}

impl Refusal {
    /// Returns a problem at a place that is not a formula.
    pub fn of(key: impl Into<String>, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Refusal { key: key.into(), formula: String::new(), problem: Problem::of_all(what, remedy) }
    }
}

pub(crate) type Compiled<T> = Result<T, Refusal>;

pub(crate) fn refuse<T>(
    key: impl Into<String>,
    what: impl Into<String>,
    remedy: impl Into<String>,
) -> Compiled<T> {
    Err(Refusal::of(key, what, remedy))
}

/// Returns the dimension of a unit in our tables.
pub(crate) fn dimension(unit: &str) -> Dimension {
    Dimension::of_unit(unit).expect("a unit")
}

/// Returns the dimension of a unit that an author writes.
pub(crate) fn unit(key: &str, unit: &str) -> Compiled<Dimension> {
    Dimension::of_unit(unit).or_else(|what| {
        let remedy = "Formulas are in SI: m, kg, s, K, N, Pa, J, W, Hz, rad, their powers, products and quotients, \
                      - for a pure number; a drive file may give the value in any other unit (\"20 mm/s\").";
        refuse(key, format!("unit \"{unit}\": {what}"), remedy)
    })
}

pub(crate) fn range(bounds: &Bounds) -> Range {
    Range::new(bounds.lower, bounds.upper, [!bounds.open, !bounds.open_above])
}

/// Checks that every name is valid, free and unique, and that counts are within limits. `given` are the variables,
/// `states` the names of states and their rates.
pub(crate) fn check_names<'a>(
    name: &str,
    (parameters, lets): (&[ParameterText], &[(String, String)]),
    given: impl Iterator<Item = &'a str>,
    states: Vec<String>,
) -> Compiled<()> {
    let counts = [("parameters", parameters.len(), MOST_PARAMETERS), ("let", lets.len(), MOST_LETS)];
    check_counts(&counts)?;
    if !(1..=MOST_NAME).contains(&name.trim().chars().count()) {
        return refuse("name", "the name of the law is empty or very long", "Give it a short name.");
    }
    let given: Vec<&str> = given.collect();
    let keys = parameters.iter().map(|p| ("parameters", p.key.clone()));
    let keys = keys.chain(states.into_iter().map(|key| ("states", key)));
    let keys = keys.chain(lets.iter().map(|(key, _)| ("let", key.clone())));
    let mut seen: HashMap<String, &str> = HashMap::new();
    for (table, key) in keys {
        let full = format!("{table}.{key}");
        let letter = key.starts_with(|c: char| c.is_ascii_alphabetic());
        if !letter || !key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            let what = format!("\"{key}\" cannot be used in formulas");
            return refuse(full, what, "Names are letters, digits and _, beginning with a letter.");
        }
        if TAKEN.contains(&key.as_str()) || given.contains(&key.as_str()) {
            return refuse(full, format!("the name \"{key}\" is reserved"), "Choose another one.");
        }
        if let Some(other) = seen.insert(key.clone(), table) {
            let what = format!("the name \"{key}\" is given twice, also in {other}");
            return refuse(full, what, "Each name stands for one value.");
        }
    }
    Ok(())
}

/// Returns the first exceeded limit, if any: name, count, limit.
pub(crate) fn check_counts(counts: &[(&str, usize, usize)]) -> Compiled<()> {
    match counts.iter().find(|(_, count, most)| count > most) {
        Some((what, count, most)) => {
            refuse(*what, format!("{what} has {count} entries, more than the limit {most}"), "")
        }
        None => Ok(()),
    }
}

/// Compiler of formulas to programs.
pub(crate) struct Reader<'a> {
    pub graph: Graph,
    pub scope: Scope,
    /// The parameters, in their order.
    pub parameters: Vec<Id>,
    /// Names that only later formulas may use: rates of states.
    pub later: Vec<String>,
    texts: &'a [ParameterText],
    lets: &'a [(String, String)],
}

impl<'a> Reader<'a> {
    pub fn new(texts: &'a [ParameterText], lets: &'a [(String, String)]) -> Compiled<Self> {
        let (graph, scope) = (Graph::default(), Scope::new());
        let mut reader = Reader { graph, scope, parameters: Vec::new(), later: Vec::new(), texts, lets };
        for parameter in texts {
            let dimension = unit(&format!("parameters.{}.unit", parameter.key), &parameter.unit)?;
            let id = reader.graph.parameter(dimension, range(&parameter.bounds));
            reader.scope.insert(parameter.key.clone(), id);
            reader.parameters.push(id);
        }
        let pi = parse("3.141592653589793").and_then(|pi| reader.graph.lower(&pi, &reader.scope));
        reader.scope.insert("pi".into(), pi.expect("a number"));
        Ok(reader)
    }

    /// Reads the formulas of `let`.
    pub fn read_lets(&mut self) -> Compiled<()> {
        for (i, (name, formula)) in self.lets.iter().enumerate() {
            let id = self.value(&format!("let.{name}"), formula, Some(i))?;
            self.scope.insert(name.clone(), id);
        }
        Ok(())
    }

    /// Reads a formula with one of our units.
    pub fn formula(&mut self, key: &str, formula: &str, unit: &str) -> Compiled<Id> {
        self.formula_of(key, formula, dimension(unit), unit)
    }

    /// Reads a formula with a given dimension, and its name.
    pub fn formula_of(&mut self, key: &str, formula: &str, dimension: Dimension, unit: &str) -> Compiled<Id> {
        let id = self.value(key, formula, None)?;
        match self.graph.dimension(id) {
            Some(found) if found != dimension => {
                let what = format!("the formula gives {found}; {unit} is needed");
                Err(of_whole(key, formula, what))
            }
            _ => Ok(id),
        }
    }

    /// Returns the value of a formula. In the `i`-th let, later ones are not defined yet.
    fn value(&mut self, key: &str, formula: &str, i: Option<usize>) -> Compiled<Id> {
        let refuse = |problem| Refusal { key: key.into(), formula: formula.into(), problem };
        let expression = parse(formula).map_err(refuse)?;
        self.graph.lower(&expression, &self.scope).map_err(|mut problem| {
            let place = problem.place.unwrap_or(Place { start: 0, end: 0 });
            let name: String = formula.chars().skip(place.start).take(place.end - place.start).collect();
            let later =
                |(k, (other, _)): (usize, &(String, String))| *other == name && i.is_some_and(|i| k >= i);
            let unknown = !self.scope.contains_key(&name);
            if unknown && self.lets.iter().enumerate().any(later) {
                let itself = i.is_some_and(|i| self.lets[i].0 == name);
                problem.what = if itself {
                    format!("'{name}' depends on itself")
                } else {
                    format!("'{name}' comes later in [let]")
                };
                problem.remedy =
                    "Formulas in [let] are computed in their order, each from those above it.".into();
            }
            if unknown && self.later.contains(&name) {
                problem.what = format!("'{name}' is not defined yet here");
                problem.remedy = "Only force and slip can use rates.".into();
            }
            refuse(problem)
        })
    }

    /// Returns warnings about names that `by` does not use.
    pub fn unused(&self, used: &[Id], by: &str) -> Vec<String> {
        let reached = self.graph.reached(used);
        let idle = |id: &Id| !reached.contains(id);
        let parameters = self.texts.iter().zip(&self.parameters).filter(|(_, id)| idle(id));
        let parameters = parameters.map(|(p, _)| format!("parameter '{}' is not used by {by}", p.key));
        let lets = self.lets.iter().filter(|(name, _)| idle(&self.scope[name]));
        let lets = lets.map(|(name, _)| format!("'{name}' of [let] is not used by {by}"));
        parameters.chain(lets).collect()
    }

    pub fn program(&self, outputs: &[Id], key: &str) -> Compiled<Program> {
        Program::new(&self.graph, outputs).map_err(|problem| Refusal {
            key: key.into(),
            formula: String::new(),
            problem,
        })
    }
}

/// Returns the part of a value with derivatives that is not finite, in words. `name` gives the variable of a derivative.
pub(crate) fn not_finite<const N: usize>(
    value: &Dual<f64, N>,
    name: impl Fn(usize) -> &'static str,
) -> Option<String> {
    if !value.re.is_finite() {
        return Some(format!("it is {}", value.re));
    }
    let k = value.eps.iter().position(|slope| !slope.is_finite())?;
    Some(format!("its derivative by {} is {}", name(k), value.eps[k]))
}

/// Rejects a formula as a whole.
pub(crate) fn of_whole(key: &str, formula: &str, what: String) -> Refusal {
    let place = Some(Place { start: 0, end: formula.chars().count() });
    let problem = Problem { what, place, remedy: String::new() };
    Refusal { key: key.into(), formula: formula.into(), problem }
}

/// Returns parameters in the form of the core's laws.
pub(crate) fn leaked(texts: &[ParameterText]) -> &'static [Parameter] {
    let parameters = texts.iter().map(|p| Parameter {
        key: leak(&p.key),
        unit: leak(&p.unit),
        bounds: p.bounds,
        default: p.default,
        meaning: leak(&p.meaning),
    });
    Vec::leak(parameters.collect())
}

pub(crate) fn leak(text: &str) -> &'static str {
    Box::leak(text.to_string().into_boxed_str())
}

/// Compiled formulas of a process by their text. They stay until the process ends.
pub struct Known<T: 'static>(std::sync::Mutex<Option<HashMap<String, &'static T>>>);

/// Largest number of texts that a process keeps.
const MOST_KNOWN: usize = 10_000;

impl<T> Known<T> {
    /// Creates an empty store.
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Known(std::sync::Mutex::new(None))
    }

    /// Returns the result compiled from a text, now or before.
    pub fn get(
        &self,
        text: String,
        compile: impl FnOnce() -> Result<T, Refusal>,
    ) -> Result<&'static T, Refusal> {
        let mut known = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let known = known.get_or_insert_default();
        if let Some(own) = known.get(&text) {
            return Ok(own);
        }
        if known.len() >= MOST_KNOWN {
            let what = format!("{MOST_KNOWN} different laws were used in one process");
            return refuse("law", what, "Vary parameters, not formulas, or start a new process.");
        }
        let own: &'static T = Box::leak(Box::new(compile()?));
        known.insert(text, own);
        Ok(own)
    }
}
