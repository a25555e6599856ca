//! A description whose numbers carry derivatives.

use crate::ground::{Error, refuse};
use math::{Dual, Lane};
use serde_json::Value;
use specification::FromJson;

/// Directions of one pass of derivatives by the numbers of a description.
pub const DIRECTIONS: usize = 8;
/// Numbers of such a pass.
pub(crate) type Sensitive = Dual<f64, DIRECTIONS>;

/// A description and its free numbers. A table of the same shape holds the index of each number. To set a derivative,
/// indices are compared, and the description is read only once.
#[derive(Clone, Debug)]
pub(crate) struct Seeds<T> {
    pub value: T,
    index: T,
    /// Index of the number of each direction.
    free: Vec<f64>,
}

/// A table of a description whose numbers carry derivatives in some directions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lifted<'a, T> {
    pub value: &'a T,
    index: Option<&'a T>,
    free: &'a [f64],
    /// Direction of the first derivative of a number.
    first: usize,
}

impl<'a, T> Lifted<'a, T> {
    /// Returns the numbers without derivatives.
    pub fn plain(value: &'a T) -> Self {
        Lifted { value, index: None, free: &[], first: 0 }
    }

    /// Returns numbers with derivatives in consecutive directions, starting with `first`.
    pub fn new(seeds: &'a Seeds<T>, first: usize) -> Self {
        Lifted { value: &seeds.value, index: Some(&seeds.index), free: &seeds.free, first }
    }

    /// Returns a table inside this table.
    pub fn table<U>(&self, f: impl Fn(&'a T) -> &'a U) -> Lifted<'a, U> {
        Lifted { value: f(self.value), index: self.index.map(f), free: self.free, first: self.first }
    }

    /// Returns a table that may be absent.
    pub fn optional<U>(&self, f: impl Fn(&'a T) -> Option<&'a U>) -> Option<Lifted<'a, U>> {
        f(self.value)?;
        Some(self.table(|table| f(table).expect("indices have the shape of the value")))
    }

    /// Returns the table, and the table of the same shape with the indices of the free numbers.
    pub fn tables(&self) -> impl Iterator<Item = &'a T> {
        std::iter::once(self.value).chain(self.index)
    }

    /// Returns one number of the table. `f` selects it and leaves it unchanged.
    pub fn number<P: Lane>(&self, f: impl Fn(&T) -> f64) -> P {
        self.number_or(0.0, |table| Some(f(table)))
    }

    /// Returns one number, with its default if it is absent.
    pub fn number_or<P: Lane>(&self, default: f64, f: impl Fn(&T) -> Option<f64>) -> P {
        let index = self.index.and_then(&f);
        P::from_parts(|part| match part {
            0 => f(self.value).unwrap_or(default),
            _ => {
                f64::from(u8::from(index.is_some() && self.free.get(self.first + part - 1) == index.as_ref()))
            }
        })
    }

    /// Returns whether any direction, of this pass or another, changes this number.
    pub fn is_free(&self, f: impl Fn(&T) -> f64) -> bool {
        self.index.is_some_and(|index| self.free.contains(&f(index)))
    }
}

/// Returns a table whose numbers `names` are free. The names are paths of the core's JSON below `root`, such as
/// "friction.parameters.coulomb".
pub(crate) fn seeds<T: FromJson>(json: &str, root: &str, names: &[String]) -> Result<Seeds<T>, Error> {
    let mut table: Value = serde_json::from_str(json).map_err(unfit)?;
    let paths: Vec<String> = names.iter().map(|name| below(root, name)).collect::<Result<_, _>>()?;
    for path in &paths {
        add_absent(&mut table, path);
    }
    let mut index = table.clone();
    for (path, name) in paths.iter().zip(names) {
        if path.starts_with("gas.") {
            // A component is measured with air. Another gas needs another flow law.
            return refuse!("\"{name}\" is a number of the gas and cannot be free");
        }
        // A parameter that is not given has its default, and is still a number.
        let may_be_absent = path
            .rsplit_once('.')
            .is_some_and(|(parent, _)| parent.ends_with("parameters") || parent.ends_with("pressure"));
        match place(&mut index, path, may_be_absent) {
            Some(number) if number.is_number() || (may_be_absent && number.is_null()) => {
                *number = 0.0.into();
            }
            _ => return Err(unknown(&table, root, name)),
        }
    }
    number(&mut index, &mut 0.0);
    let free = paths.iter().map(|path| place(&mut index, path, false).and_then(|number| number.as_f64()));
    let free = free.map(|index| index.expect("numbered")).collect();
    let read = |table: Value| T::from_json(&table.to_string()).map_err(unfit);
    Ok(Seeds { value: read(table)?, index: read(index)?, free })
}

/// Says that JSON is not a description.
pub(crate) fn unfit(error: serde_json::Error) -> Error {
    Error::Specification(format!("the core cannot read the description: {error}"))
}

/// Numbers that a description omits if zero, but that may be free.
fn add_absent(table: &mut Value, path: &str) {
    let (what, with) = match path.rsplit_once('.') {
        // Seal lips without an effect of pressure.
        Some((lips, _)) if lips == "pressure" || lips.ends_with("friction.pressure") => {
            (lips, serde_json::json!({}))
        }
        _ => return,
    };
    if let Some(value) = place(table, what, true)
        && value.is_null()
    {
        *value = with;
    }
}

/// Returns the path of `name` in the table `root`.
fn below(root: &str, name: &str) -> Result<String, Error> {
    if root.is_empty() {
        return Ok(name.into());
    }
    let path = name.strip_prefix(root).and_then(|rest| rest.strip_prefix('.'));
    path.map(str::to_string).ok_or_else(|| Error::Specification(format!("\"{name}\" lies outside {root}")))
}

/// Returns the value at a path. With `add`, a missing last key is added.
fn place<'v>(table: &'v mut Value, path: &str, add: bool) -> Option<&'v mut Value> {
    let mut at = table;
    let mut keys = path.split('.').peekable();
    while let Some(key) = keys.next() {
        at = match at {
            Value::Object(map) => {
                if add && keys.peek().is_none() && !map.contains_key(key) {
                    map.insert(key.into(), Value::Null);
                }
                map.get_mut(key)?
            }
            Value::Array(list) => list.get_mut(key.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    Some(at)
}

/// Gives every number the next index, starting at one.
fn number(value: &mut Value, last: &mut f64) {
    match value {
        Value::Number(_) => {
            *last += 1.0;
            *value = (*last).into();
        }
        Value::Array(list) => list.iter_mut().for_each(|value| number(value, last)),
        Value::Object(map) => map.values_mut().for_each(|value| number(value, last)),
        _ => {}
    }
}

/// Adds the paths of all numbers of a table to `out`.
fn numbers(value: &Value, path: &str, out: &mut Vec<String>) {
    let key = |key: &str| if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
    match value {
        Value::Number(_) => out.push(path.into()),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, value)| numbers(value, &key(&i.to_string()), out));
        }
        // The bounds of a custom law are not numbers of the drive.
        Value::Object(map) => {
            let own = map.iter().filter(|(name, _)| *name != "formula");
            own.for_each(|(name, value)| numbers(value, &key(name), out));
        }
        _ => {}
    }
}

fn unknown(table: &Value, root: &str, name: &str) -> Error {
    let mut names = Vec::new();
    numbers(table, root, &mut names);
    Error::Specification(format!(
        "\"{name}\" is not a number of this description; it has {}",
        names.join(", ")
    ))
}
