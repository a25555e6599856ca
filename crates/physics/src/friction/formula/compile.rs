//! Compilation of a text to an [`OwnLaw`]: names, units, formulas, programs.

use super::text::Text;
use super::{LEVELS, MOST_STATES, OwnLaw, VARIABLES};
use crate::friction::{Claims, InnerState, LAWS, Meta, Sense};
use crate::parameter::Bounds;
use crate::written::{
    Compiled, Known, Reader, check_counts, check_names, dimension, leak, leaked, of_whole, range, refuse,
    unit,
};
use ::formula::{Id, Range, Scope};
use std::sync::Mutex;

/// Least gauge pressure, Pa: below vacuum at sea level, to cover places below sea level.
const LOWEST_GAUGE: f64 = -1.2e5;

static KNOWN: Known<OwnLaw> = Known::new();

impl OwnLaw {
    /// Returns the law that `text` describes, compiled at first use.
    pub fn of(text: &Text) -> Compiled<&'static OwnLaw> {
        KNOWN.get(format!("{text:?}"), || compile(text))
    }
}

/// A law during compilation.
struct LawCompiler<'a> {
    text: &'a Text,
    reader: Reader<'a>,
    states: Vec<Id>,
    /// Names that the formulas use, for warnings about unused names.
    used: Vec<Id>,
}

fn compile(text: &Text) -> Compiled<OwnLaw> {
    names(text)?;
    let levels = levels(text)?;
    let reader = Reader::new(&text.parameters, &text.lets)?;
    let mut work = LawCompiler { text, reader, states: Vec::new(), used: Vec::new() };
    work.reader.later = text.states.iter().map(|state| format!("{}_rate", state.key)).collect();
    work.variables(&levels)?;
    let parameters_alone = work.reader.scope.clone();
    work.reader.read_lets()?;
    let mut motion = vec![];
    for state in &text.states {
        let key = format!("states.{}.rate", state.key);
        let unit = unit(&format!("states.{}.unit", state.key), &state.unit)?.over(dimension("s"));
        let rate = work.reader.formula_of(&key, &state.rate, unit, &unit.to_string())?;
        motion.push(rate);
    }
    for (state, rate) in text.states.iter().zip(&motion) {
        work.reader.scope.insert(format!("{}_rate", state.key), *rate);
    }
    let force = work.reader.formula("force", &text.force, "N")?;
    motion.insert(0, force);
    let energy = text.energy.as_ref().map(|own| work.energy(own)).transpose()?;
    let steady = text.steady.as_ref().map(|own| work.steady(own)).transpose()?;
    work.used.extend(&motion);
    let slip = work.slip(parameters_alone)?;
    let reader = work.reader;
    let mut law = OwnLaw {
        meta: meta(text),
        warnings: reader.unused(&work.used, "force or rates"),
        motion: reader.program(&motion, "force")?,
        energy: energy.map(|id| reader.program(&[id], "energy")).transpose()?,
        slip: reader.program(&[slip], "slip")?,
        steady: steady.map(|id| reader.program(&[id], "steady")).transpose()?,
        graph: reader.graph,
        levels,
        keys: text.states.iter().map(|state| leak(&state.key)).collect(),
        kept: text.states.iter().map(|state| state.bounds).collect(),
        good: Mutex::new(Vec::new()),
    };
    law.meta.bristles = law.is_bristles();
    Ok(law)
}

/// Checks that names are valid, free and unique, and that counts are within limits.
fn names(text: &Text) -> Compiled<()> {
    if LAWS.iter().any(|meta| meta.key == text.name) {
        let what = format!("\"{}\" is a law that pneudrive has", text.name);
        return refuse("name", what, "Give your law another name.");
    }
    check_counts(&[("states", text.states.len(), MOST_STATES)])?;
    let states = text.states.iter().flat_map(|state| [state.key.clone(), format!("{}_rate", state.key)]);
    let given = VARIABLES.iter().map(|(name, _)| *name);
    check_names(&text.name, (&text.parameters, &text.lets), given, states.collect())
}

/// Returns the parameter of each level: as the law specifies, or by name.
fn levels(text: &Text) -> Compiled<[Option<usize>; 3]> {
    let mut out = [None; 3];
    for (i, (level, level_unit)) in LEVELS.iter().enumerate() {
        let Some(name) = text.levels.get(*level) else { continue };
        let key = format!("levels.{level}");
        let Some(k) = text.parameters.iter().position(|p| p.key == *name) else {
            let known = text.parameters.iter().map(|p| p.key.as_str());
            return refuse(key, format!("'{name}' is not a parameter"), ::formula::nearest(name, known));
        };
        let own = unit(&format!("parameters.{name}.unit"), &text.parameters[k].unit)?;
        let needed = dimension(level_unit);
        if own != needed {
            return refuse(key, format!("'{name}' has the unit {own}; a {level} level needs {needed}"), "");
        }
        out[i] = Some(k);
    }
    Ok(out)
}

/// Returns the range of a level under pressure, age and other modifiers: its sign is fixed, its size is not.
fn level_range(bounds: &Bounds) -> Range {
    if bounds.lower > 0.0 || (bounds.lower == 0.0 && bounds.open) {
        Range::new(0.0, f64::INFINITY, [false; 2])
    } else if bounds.lower == 0.0 {
        Range::new(0.0, f64::INFINITY, [true, false])
    } else {
        Range::ALL
    }
}

impl LawCompiler<'_> {
    /// Gives nodes and names to parameters, variables, levels and states.
    fn variables(&mut self, levels: &[Option<usize>; 3]) -> Compiled<()> {
        let text = self.text;
        for (name, its_unit) in VARIABLES {
            let gauge = its_unit == "Pa";
            let values =
                if gauge { Range::new(LOWEST_GAUGE, f64::INFINITY, [true, false]) } else { Range::ALL };
            let id = self.reader.graph.input(dimension(its_unit), values);
            self.reader.scope.insert(name.into(), id);
        }
        for (level, (_, its_unit)) in levels.iter().zip(LEVELS) {
            let values = level.map_or(Range::ALL, |k| level_range(&text.parameters[k].bounds));
            let id = self.reader.graph.input(dimension(its_unit), values);
            if let Some(k) = level {
                self.reader.scope.insert(text.parameters[*k].key.clone(), id);
                self.reader.parameters[*k] = id;
            }
        }
        for state in &text.states {
            let key = format!("states.{}", state.key);
            let dimension = unit(&format!("{key}.unit"), &state.unit)?;
            if !state.bounds.contain(0.0) {
                let what = format!("the state starts at 0, which is not {}", state.bounds);
                return refuse(key, what, "Define the state relative to its start.");
            }
            if !(state.scale > 0.0 && state.scale.is_finite()) {
                return refuse(
                    format!("{key}.scale"),
                    format!("{} is not a valid scale of a state", state.scale),
                    "",
                );
            }
            let id = self.reader.graph.input(dimension, range(&state.bounds));
            self.reader.scope.insert(state.key.clone(), id);
            self.states.push(id);
        }
        Ok(())
    }

    /// The energy may depend on states and on parameters that are not levels.
    fn energy(&mut self, formula: &str) -> Compiled<Id> {
        let id = self.reader.formula("energy", formula, "J")?;
        let allowed = |other: &Id| !self.reader.graph.is_input(*other) || self.states.contains(other);
        self.only(id, "energy", formula, allowed, "states and on parameters that are not levels")
    }

    /// Steady sliding must not depend on states.
    fn steady(&mut self, formula: &str) -> Compiled<Id> {
        let id = self.reader.formula("steady", formula, "N")?;
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
        if self.reader.graph.reached(&[id]).iter().all(allowed) {
            return Ok(id);
        }
        Err(of_whole(key, formula, format!("{key} may depend on {on}")))
    }

    /// Returns the rate of irreversible slip: as the law specifies, or the velocity minus the rate of the first state
    /// that is a length.
    fn slip(&mut self, parameters: Scope) -> Compiled<Id> {
        let mut own = String::from("v");
        let mut scope = parameters;
        for state in &self.text.states {
            scope.remove(&state.key);
        }
        scope.retain(|name, id| name == "v" || !self.reader.graph.is_input(*id));
        for state in &self.text.states {
            let own_unit = unit("states", &state.unit)?;
            let id = self.reader.graph.input(own_unit.over(dimension("s")), Range::ALL);
            scope.insert(format!("{}_rate", state.key), id);
            if own == "v" && own_unit == dimension("m") {
                own = format!("v - {}_rate", state.key);
            }
        }
        let own = self.text.slip.clone().unwrap_or(own);
        let all = std::mem::replace(&mut self.reader.scope, scope);
        let id = self.reader.formula("slip", &own, "m/s");
        self.reader.scope = all;
        id
    }
}

fn meta(text: &Text) -> Meta {
    let states = text.states.iter().map(|state| InnerState {
        name: leak(&state.name),
        unit: leak(&state.unit),
        scale: state.scale,
    });
    Meta {
        key: leak(&text.name),
        title: leak(&text.title),
        source: leak(&text.source),
        parameters: leaked(&text.parameters),
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
