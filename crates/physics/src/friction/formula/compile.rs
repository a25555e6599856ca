//! From text to an [`OwnLaw`]: names, units, formulas, programs.

use super::text::{Refusal, Text};
use super::{LEVELS, MOST_STATES, OwnLaw, VARIABLES};
use crate::friction::{Claims, InnerState, LAWS, Meta, Sense};
use crate::parameter::{Bounds, Parameter};
use ::formula::{Dimension, Graph, Id, Problem, Program, Range, Scope, parse};
use std::collections::HashMap;
use std::sync::Mutex;

const MOST_PARAMETERS: usize = 48;
const MOST_LETS: usize = 64;
const MOST_NAME: usize = 80;
/// Laws that a process keeps: each stays until its end.
const MOST_LAWS: usize = 10_000;
/// Gauge pressure is not below vacuum, Pa: with room for places below the sea.
const LOWEST_GAUGE: f64 = -1.2e5;

/// Names that are taken beside those of [`VARIABLES`].
const TAKEN: [&str; 18] = [
    "pi", "and", "or", "not", "abs", "sign", "sqrt", "exp", "ln", "tanh", "sin", "cos", "min", "max", "pow",
    "fma", "if", "select",
];

static KNOWN: Mutex<Option<HashMap<String, &'static OwnLaw>>> = Mutex::new(None);

type Compiled<T> = Result<T, Refusal>;

fn refuse<T>(key: impl Into<String>, what: impl Into<String>, remedy: impl Into<String>) -> Compiled<T> {
    Err(Refusal { key: key.into(), formula: String::new(), problem: Problem::of_all(what, remedy) })
}

impl OwnLaw {
    /// The law that `text` describes, compiled where it is not known yet.
    pub fn of(text: &Text) -> Compiled<&'static OwnLaw> {
        let key = format!("{text:?}");
        let mut known = KNOWN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let known = known.get_or_insert_default();
        if let Some(law) = known.get(&key) {
            return Ok(law);
        }
        if known.len() >= MOST_LAWS {
            let what = format!("{MOST_LAWS} different laws were used in one process");
            return refuse("law", what, "Vary parameters, not formulas, or begin a new process.");
        }
        let law: &'static OwnLaw = Box::leak(Box::new(compile(text)?));
        known.insert(key, law);
        Ok(law)
    }
}

/// A law on its way.
struct Work<'a> {
    text: &'a Text,
    graph: Graph,
    scope: Scope,
    parameters: Vec<Id>,
    states: Vec<Id>,
    /// What is used by formulas, to tell of what is not.
    used: Vec<Id>,
}

fn compile(text: &Text) -> Compiled<OwnLaw> {
    names(text)?;
    let mut work = Work {
        text,
        graph: Graph::default(),
        scope: Scope::new(),
        parameters: Vec::new(),
        states: Vec::new(),
        used: Vec::new(),
    };
    let levels = levels(text)?;
    work.variables(&levels)?;
    let parameters_alone = work.scope.clone();
    work.lets()?;
    let mut motion = vec![];
    for state in &text.states {
        let key = format!("states.{}.rate", state.key);
        let unit = unit(&format!("states.{}.unit", state.key), &state.unit)?.over(second());
        let rate = work.formula(&key, &state.rate, unit)?;
        motion.push(rate);
    }
    for (state, rate) in text.states.iter().zip(&motion) {
        work.scope.insert(format!("{}_rate", state.key), *rate);
    }
    let force = work.formula("force", &text.force, newton())?;
    motion.insert(0, force);
    let energy = text.energy.as_ref().map(|own| work.energy(own)).transpose()?;
    let steady = text.steady.as_ref().map(|own| work.steady(own)).transpose()?;
    work.used.extend(&motion);
    let slip = work.slip(parameters_alone)?;
    let warnings = work.warnings();
    let program = |outputs: &[Id], key: &str| {
        Program::new(&work.graph, outputs).map_err(|problem| Refusal {
            key: key.into(),
            formula: String::new(),
            problem,
        })
    };
    let mut law = OwnLaw {
        meta: meta(text),
        warnings,
        motion: program(&motion, "force")?,
        energy: energy.map(|id| program(&[id], "energy")).transpose()?,
        slip: program(&[slip], "slip")?,
        steady: steady.map(|id| program(&[id], "steady")).transpose()?,
        graph: work.graph,
        levels,
        keys: text.states.iter().map(|state| leak(&state.key)).collect(),
        kept: text.states.iter().map(|state| state.bounds).collect(),
        good: Mutex::new(Vec::new()),
    };
    law.meta.bristles = law.is_bristles();
    Ok(law)
}

fn newton() -> Dimension {
    Dimension::of_unit("N").expect("a unit")
}

fn second() -> Dimension {
    Dimension::of_unit("s").expect("a unit")
}

fn unit(key: &str, unit: &str) -> Compiled<Dimension> {
    Dimension::of_unit(unit).or_else(|what| {
        let remedy = "Formulas are in SI: m, kg, s, K, N, Pa, J, W, Hz, rad, their powers, products and quotients, \
                      - for a pure number; a drive file may give the value in any other unit (\"20 mm/s\").";
        refuse(key, format!("unit \"{unit}\": {what}"), remedy)
    })
}

fn range(bounds: &Bounds) -> Range {
    Range::new(bounds.lower, bounds.upper, [!bounds.open, !bounds.open_above])
}

/// Every name is one, is free, and is given once; counts are within limits.
fn names(text: &Text) -> Compiled<()> {
    for (what, count, most) in [
        ("parameters", text.parameters.len(), MOST_PARAMETERS),
        ("states", text.states.len(), MOST_STATES),
        ("let", text.lets.len(), MOST_LETS),
    ] {
        if count > most {
            return refuse(what, format!("the law has {count} of them; at most {most} are taken"), "");
        }
    }
    if !(1..=MOST_NAME).contains(&text.name.trim().chars().count()) {
        return refuse("name", "the law has no name, or a very long one", "Give it a short name.");
    }
    if LAWS.iter().any(|meta| meta.key == text.name) {
        let what = format!("\"{}\" is a law that pneudrive has", text.name);
        return refuse("name", what, "Give your law a name of its own.");
    }
    let of_states = text.states.iter().flat_map(|state| [state.key.clone(), format!("{}_rate", state.key)]);
    let keys = text.parameters.iter().map(|p| ("parameters", p.key.clone()));
    let keys = keys.chain(of_states.map(|key| ("states", key)));
    let keys = keys.chain(text.lets.iter().map(|(key, _)| ("let", key.clone())));
    let mut seen: HashMap<String, &str> = HashMap::new();
    for (table, key) in keys {
        let full = format!("{table}.{key}");
        let letter = key.starts_with(|c: char| c.is_ascii_alphabetic());
        if !letter || !key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            let what = format!("\"{key}\" cannot be used in formulas");
            return refuse(full, what, "Names are letters, digits and _, beginning with a letter.");
        }
        if TAKEN.contains(&key.as_str()) || VARIABLES.iter().any(|(name, _)| *name == key) {
            return refuse(full, format!("the name \"{key}\" has a meaning already"), "Choose another one.");
        }
        if let Some(other) = seen.insert(key.clone(), table) {
            let what = format!("the name \"{key}\" is given twice, also in {other}");
            return refuse(full, what, "Each name stands for one value.");
        }
    }
    Ok(())
}

/// Which parameter each level is: as the law says, or by name.
fn levels(text: &Text) -> Compiled<[Option<usize>; 3]> {
    let mut out = [None; 3];
    for (i, (level, level_unit)) in LEVELS.iter().enumerate() {
        let Some(name) = &text.levels[i] else { continue };
        let key = format!("levels.{level}");
        let Some(k) = text.parameters.iter().position(|p| p.key == *name) else {
            let known = text.parameters.iter().map(|p| p.key.as_str());
            return refuse(key, format!("'{name}' is no parameter"), ::formula::nearest(name, known));
        };
        let own = unit(&format!("parameters.{name}.unit"), &text.parameters[k].unit)?;
        let needed = Dimension::of_unit(level_unit).expect("a unit");
        if own != needed {
            return refuse(key, format!("'{name}' has the unit {own}; a {level} level needs {needed}"), "");
        }
        out[i] = Some(k);
    }
    Ok(out)
}

/// What a level can become under pressure, age and so on: its sign stays, its size does not.
fn level_range(bounds: &Bounds) -> Range {
    if bounds.lower > 0.0 || (bounds.lower == 0.0 && bounds.open) {
        Range::new(0.0, f64::INFINITY, [false; 2])
    } else if bounds.lower == 0.0 {
        Range::new(0.0, f64::INFINITY, [true, false])
    } else {
        Range::ALL
    }
}

impl Work<'_> {
    /// Parameters, variables, levels and states get their nodes and names.
    fn variables(&mut self, levels: &[Option<usize>; 3]) -> Compiled<()> {
        let text = self.text;
        let mut dimensions = Vec::new();
        for parameter in &text.parameters {
            let dimension = unit(&format!("parameters.{}.unit", parameter.key), &parameter.unit)?;
            let id = self.graph.parameter(dimension, range(&parameter.bounds));
            self.scope.insert(parameter.key.clone(), id);
            self.parameters.push(id);
            dimensions.push(dimension);
        }
        for (name, its_unit) in VARIABLES {
            let dimension = Dimension::of_unit(its_unit).expect("a unit");
            let gauge = its_unit == "Pa";
            let values =
                if gauge { Range::new(LOWEST_GAUGE, f64::INFINITY, [true, false]) } else { Range::ALL };
            let id = self.graph.input(dimension, values);
            self.scope.insert(name.into(), id);
        }
        for (level, (_, its_unit)) in levels.iter().zip(LEVELS) {
            let values = level.map_or(Range::ALL, |k| level_range(&text.parameters[k].bounds));
            let id = self.graph.input(Dimension::of_unit(its_unit).expect("a unit"), values);
            if let Some(k) = level {
                self.scope.insert(text.parameters[*k].key.clone(), id);
                self.parameters[*k] = id;
            }
        }
        for state in &text.states {
            let key = format!("states.{}", state.key);
            let dimension = unit(&format!("{key}.unit"), &state.unit)?;
            if !state.bounds.contain(0.0) {
                let what = format!("the state starts at 0, which is not {}", state.bounds);
                return refuse(key, what, "Count the state from where it starts.");
            }
            if !(state.scale > 0.0 && state.scale.is_finite()) {
                return refuse(format!("{key}.scale"), format!("{} is no size of a state", state.scale), "");
            }
            let id = self.graph.input(dimension, range(&state.bounds));
            self.scope.insert(state.key.clone(), id);
            self.states.push(id);
        }
        let pi = parse("3.141592653589793").and_then(|pi| self.graph.lower(&pi, &self.scope));
        self.scope.insert("pi".into(), pi.expect("a number"));
        Ok(())
    }

    fn lets(&mut self) -> Compiled<()> {
        for (i, (name, formula)) in self.text.lets.iter().enumerate() {
            let id = self.value(&format!("let.{name}"), formula, Some(i))?;
            self.scope.insert(name.clone(), id);
        }
        Ok(())
    }

    /// A formula of a given dimension.
    fn formula(&mut self, key: &str, formula: &str, dimension: Dimension) -> Compiled<Id> {
        let id = self.value(key, formula, None)?;
        match self.graph.dimension(id) {
            Some(found) if found != dimension => {
                let what = format!("the formula gives {found}; {dimension} is needed");
                let end = formula.chars().count();
                let place = Some(::formula::Place { start: 0, end });
                let problem = Problem { what, place, remedy: String::new() };
                Err(Refusal { key: key.into(), formula: formula.into(), problem })
            }
            _ => Ok(id),
        }
    }

    /// The value of a formula; in the `i`-th let, later ones are not there yet.
    fn value(&mut self, key: &str, formula: &str, i: Option<usize>) -> Compiled<Id> {
        let refuse = |problem| Refusal { key: key.into(), formula: formula.into(), problem };
        let expression = parse(formula).map_err(refuse)?;
        self.graph.lower(&expression, &self.scope).map_err(|mut problem| {
            let place = problem.place.unwrap_or(::formula::Place { start: 0, end: 0 });
            let name: String = formula.chars().skip(place.start).take(place.end - place.start).collect();
            let later =
                |(k, (other, _)): (usize, &(String, String))| *other == name && i.is_some_and(|i| k >= i);
            let unknown = !self.scope.contains_key(&name);
            if unknown && self.text.lets.iter().enumerate().any(later) {
                let itself = i.is_some_and(|i| self.text.lets[i].0 == name);
                problem.what = if itself {
                    format!("'{name}' is made of itself")
                } else {
                    format!("'{name}' comes later in [let]")
                };
                problem.remedy =
                    "Formulas in [let] are computed in their order, each from those above it.".into();
            }
            if unknown && self.text.states.iter().any(|state| name == format!("{}_rate", state.key)) {
                problem.what = format!("'{name}' is not known yet here");
                problem.remedy = "Rates are there for force and slip alone.".into();
            }
            refuse(problem)
        })
    }

    /// The energy depends on states and parameters that are no levels.
    fn energy(&mut self, formula: &str) -> Compiled<Id> {
        let id = self.formula("energy", formula, Dimension::of_unit("J").expect("a unit"))?;
        let allowed = |other: &Id| !self.graph.is_input(*other) || self.states.contains(other);
        self.only(id, "energy", formula, allowed, "states and on parameters that are no levels")
    }

    /// Steady sliding depends on no state.
    fn steady(&mut self, formula: &str) -> Compiled<Id> {
        let id = self.formula("steady", formula, newton())?;
        let allowed = |other: &Id| !self.states.contains(other);
        self.only(id, "steady", formula, allowed, "v, pressures and parameters, not on states")
    }

    fn only(
        &self,
        id: Id,
        key: &str,
        formula: &str,
        allowed: impl Fn(&Id) -> bool,
        on: &str,
    ) -> Compiled<Id> {
        if self.graph.reached(&[id]).iter().all(allowed) {
            return Ok(id);
        }
        let end = formula.chars().count();
        let place = Some(::formula::Place { start: 0, end });
        let problem = Problem { what: format!("{key} may depend on {on}"), place, remedy: String::new() };
        Err(Refusal { key: key.into(), formula: formula.into(), problem })
    }

    /// What slips for good: as the law says, or the velocity less the rate of the first state that is a length.
    fn slip(&mut self, parameters: Scope) -> Compiled<Id> {
        let mut own = String::from("v");
        let mut scope = parameters;
        for state in &self.text.states {
            scope.remove(&state.key);
        }
        scope.retain(|name, id| name == "v" || !self.graph.is_input(*id));
        for state in &self.text.states {
            let dimension = unit("states", &state.unit)?;
            let id = self.graph.input(dimension.over(second()), Range::ALL);
            scope.insert(format!("{}_rate", state.key), id);
            if own == "v" && dimension == Dimension::of_unit("m").expect("a unit") {
                own = format!("v - {}_rate", state.key);
            }
        }
        let own = self.text.slip.clone().unwrap_or(own);
        let all = std::mem::replace(&mut self.scope, scope);
        let id = self.formula("slip", &own, Dimension::of_unit("m/s").expect("a unit"));
        self.scope = all;
        id
    }

    fn warnings(&self) -> Vec<String> {
        let reached = self.graph.reached(&self.used);
        let idle = |id: &Id| !reached.contains(id);
        let parameters = self.text.parameters.iter().zip(&self.parameters).filter(|(_, id)| idle(id));
        let parameters =
            parameters.map(|(p, _)| format!("parameter '{}' is not used by force or rates", p.key));
        let lets = self.text.lets.iter().filter(|(name, _)| idle(&self.scope[name]));
        let lets = lets.map(|(name, _)| format!("'{name}' of [let] is not used by force or rates"));
        parameters.chain(lets).collect()
    }
}

fn leak(text: &str) -> &'static str {
    Box::leak(text.to_string().into_boxed_str())
}

fn meta(text: &Text) -> Meta {
    let parameters = text.parameters.iter().map(|p| Parameter {
        key: leak(&p.key),
        unit: leak(&p.unit),
        bounds: p.bounds,
        default: p.default,
        meaning: leak(&p.meaning),
    });
    let states = text.states.iter().map(|state| InnerState {
        name: leak(&state.name),
        unit: leak(&state.unit),
        scale: state.scale,
    });
    Meta {
        key: leak(&text.name),
        title: leak(&text.title),
        source: leak(&text.source),
        parameters: Vec::leak(parameters.collect()),
        states: Vec::leak(states.collect()),
        sticks: false,
        sense: Sense::Velocity,
        bristles: false,
        elements: false,
        evolves: false,
        stops: true,
        claims: Claims { odd: text.odd, ..Claims::USUAL },
    }
}
