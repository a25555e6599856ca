//! A description whose numbers carry derivatives.

use crate::run::Error;
use math::Lane;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// A table of a description, and its derivatives in some directions as tables of the same shape: in each of
/// them the number that is free is one, all others are zero.
#[derive(Clone, Debug)]
pub(crate) struct Lifted<'a, T> {
    pub value: &'a T,
    /// One for each direction of differentiation.
    tangents: Vec<&'a T>,
    /// The direction that the first derivative of a number is.
    first: usize,
}

impl<'a, T> Lifted<'a, T> {
    /// The numbers as they are.
    pub fn plain(value: &'a T) -> Self {
        Lifted { value, tangents: Vec::new(), first: 0 }
    }

    /// Numbers with the derivatives in as many directions as they hold, from the direction `first` on.
    pub fn new(value: &'a T, tangents: &'a [T], first: usize) -> Self {
        Lifted { value, tangents: tangents.iter().collect(), first }
    }

    /// A table of this table.
    pub fn table<U>(&self, f: impl Fn(&'a T) -> &'a U) -> Lifted<'a, U> {
        Lifted {
            value: f(self.value),
            tangents: self.tangents.iter().map(|tangent| f(tangent)).collect(),
            first: self.first,
        }
    }

    /// A table that may be absent.
    pub fn optional<U>(&self, f: impl Fn(&'a T) -> Option<&'a U>) -> Option<Lifted<'a, U>> {
        f(self.value)?;
        Some(self.table(|table| f(table).expect("tangents have the shape of the value")))
    }

    /// The table and its derivatives.
    pub fn tables(&self) -> impl Iterator<Item = &'a T> {
        std::iter::once(self.value).chain(self.tangents.iter().copied())
    }

    /// One number of the table.
    pub fn number<P: Lane>(&self, f: impl Fn(&T) -> f64) -> P {
        self.number_or(0.0, |table| Some(f(table)))
    }

    /// One number, with the value that it has where it is absent.
    pub fn number_or<P: Lane>(&self, default: f64, f: impl Fn(&T) -> Option<f64>) -> P {
        P::from_parts(|part| match part {
            0 => f(self.value).unwrap_or(default),
            _ => self.tangents.get(self.first + part - 1).and_then(|tangent| f(tangent)).unwrap_or(0.0),
        })
    }

    /// Several numbers.
    pub fn numbers<P: Lane, const N: usize>(&self, f: impl Fn(&T) -> [f64; N]) -> [P; N] {
        std::array::from_fn(|i| self.number(|table| f(table)[i]))
    }

    /// Whether any direction, of this pass or another, changes this number.
    pub fn is_free(&self, f: impl Fn(&T) -> f64) -> bool {
        self.tangents.iter().any(|tangent| f(tangent) != 0.0)
    }
}

/// A table, and what it becomes when one of its numbers is one and all others are zero, for each of `names`:
/// paths of the core's JSON below `root`, such as "friction.parameters.coulomb".
pub(crate) fn tangents<T: DeserializeOwned>(
    json: &str,
    root: &str,
    names: &[String],
) -> Result<(T, Vec<T>), Error> {
    let unfit = |error| Error::Specification(format!("the description does not fit the core: {error}"));
    let mut table: Value = serde_json::from_str(json).map_err(unfit)?;
    let paths: Vec<String> = names.iter().map(|name| below(root, name)).collect::<Result<_, _>>()?;
    for path in &paths {
        add_absent(&mut table, path);
    }
    let mut zero = table.clone();
    clear(&mut zero);
    let one = |(path, name): (&String, &String)| {
        if path.starts_with("gas.") {
            // A component is measured with air: another gas is another law of flow.
            return Err(Error::Specification(format!("the gas cannot be free, but \"{name}\" is asked for")));
        }
        let mut tangent = zero.clone();
        // A parameter that is not given has its default, and is a number all the same.
        let free = path
            .rsplit_once('.')
            .is_some_and(|(parent, _)| parent.ends_with("parameters") || parent.ends_with("pressure"));
        match place(&mut tangent, path, free) {
            Some(number) if number.is_number() || (free && number.is_null()) => *number = 1.0.into(),
            _ => return Err(unknown(&table, root, name)),
        }
        serde_json::from_value(tangent).map_err(unfit)
    };
    let each = paths.iter().zip(names).map(one).collect::<Result<_, _>>()?;
    Ok((serde_json::from_value(table.clone()).map_err(unfit)?, each))
}

/// What a description leaves out where it is zero, and may be free all the same.
fn add_absent(table: &mut Value, path: &str) {
    let (what, with) = match path.rsplit_once('.') {
        // Seal lips that no pressure acts on.
        Some((lips, _)) if lips == "pressure" || lips.ends_with("friction.pressure") => {
            (lips, serde_json::json!({}))
        }
        _ if ["cylinder.leakage_m3_s_pa", "volume.leakage_m3_s_pa"].contains(&path) => (path, 0.0.into()),
        _ => return,
    };
    if let Some(value) = place(table, what, true)
        && value.is_null()
    {
        *value = with;
    }
}

/// The path of `name` in the table called `root`.
fn below(root: &str, name: &str) -> Result<String, Error> {
    if root.is_empty() {
        return Ok(name.into());
    }
    let path = name.strip_prefix(root).and_then(|rest| rest.strip_prefix('.'));
    path.map(str::to_string).ok_or_else(|| Error::Specification(format!("\"{name}\" lies outside {root}")))
}

/// What lies at a path; with `add`, its last key is added where it is missing.
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

/// Sets every number to zero.
fn clear(value: &mut Value) {
    match value {
        Value::Number(_) => *value = 0.0.into(),
        Value::Array(list) => list.iter_mut().for_each(clear),
        Value::Object(map) => map.values_mut().for_each(clear),
        _ => {}
    }
}

/// The paths of all numbers of a table.
fn numbers(value: &Value, path: &str, out: &mut Vec<String>) {
    let key = |key: &str| if path.is_empty() { key.to_string() } else { format!("{path}.{key}") };
    match value {
        Value::Number(_) => out.push(path.into()),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, value)| numbers(value, &key(&i.to_string()), out));
        }
        // The bounds of a law of one's own are no numbers of the drive.
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
    Error::Specification(format!("\"{name}\" is no number of this description; it has {}", names.join(", ")))
}
