//! A parameter is listed once: name, unit, bounds, default, meaning. The struct, its conversion to lanes, the checks,
//! and the tables of schema and documentation follow from this list.

use serde::ser::{SerializeStruct, Serializer};
use serde::{Deserialize, Serialize};

/// The values that a parameter may take.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "Sides")]
pub struct Bounds {
    /// Lower bound; minus infinity: unbounded.
    pub lower: f64,
    /// Upper bound; infinity: unbounded.
    pub upper: f64,
    /// The lower bound itself is refused.
    pub open: bool,
    /// The upper bound itself is refused.
    pub open_above: bool,
}

/// Bounds as a description states them: at most one for each side.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Sides {
    above: Option<f64>,
    at_least: Option<f64>,
    below: Option<f64>,
    at_most: Option<f64>,
}

impl From<Sides> for Bounds {
    fn from(sides: Sides) -> Self {
        Bounds {
            lower: sides.above.or(sides.at_least).unwrap_or(f64::NEG_INFINITY),
            upper: sides.below.or(sides.at_most).unwrap_or(f64::INFINITY),
            open: sides.at_least.is_none(),
            open_above: sides.at_most.is_none(),
        }
    }
}

impl Serialize for Bounds {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut out = to.serialize_struct("Bounds", 5)?;
        out.serialize_field("rule", &self.to_string())?;
        out.serialize_field("lower", &self.lower)?;
        out.serialize_field("upper", &self.upper)?;
        out.serialize_field("open", &self.open)?;
        out.serialize_field("open_above", &self.open_above)?;
        out.end()
    }
}

impl Default for Bounds {
    fn default() -> Self {
        any()
    }
}

/// Largest size of a finite number of a description, SI. Squares and products of such numbers stay finite.
pub const LARGEST: f64 = 1e30;

/// Returns whether a number is finite but too large for a description.
pub fn is_huge(x: f64) -> bool {
    x.is_finite() && x.abs() > LARGEST
}

impl Bounds {
    /// Returns whether a value is within the bounds.
    pub fn contain(&self, x: f64) -> bool {
        let above = if self.open { x > self.lower } else { x >= self.lower };
        above && !is_huge(x) && if self.open_above { x < self.upper } else { x <= self.upper }
    }

    /// Returns the rule that a value breaks, as text.
    pub fn rule(&self, x: f64) -> String {
        if is_huge(x) { format!("at most {LARGEST:e} in size") } else { self.to_string() }
    }
}

impl std::fmt::Display for Bounds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let lower = if self.open { "greater than" } else { "not less than" };
        let upper = if self.open_above { "less than" } else { "not more than" };
        match (self.lower.is_finite(), self.upper.is_finite()) {
            (true, true) if self.open && self.open_above => {
                write!(f, "between {} and {}", self.lower, self.upper)
            }
            (true, true) => write!(f, "{lower} {} and {upper} {}", self.lower, self.upper),
            (true, false) => write!(f, "{lower} {}", self.lower),
            (false, true) => write!(f, "{upper} {}", self.upper),
            (false, false) => write!(f, "finite"),
        }
    }
}

/// Writes a number in SI, to six digits, in the unit of descriptions: `0.032, "m"` as `32 mm`.
pub fn in_usual_unit(value: f64, unit: &str) -> String {
    let (factor, usual) = match unit {
        "m" => (1e3, "mm"),
        "m/s" => (1e3, "mm/s"),
        "Pa" => (1e-5, "bar"),
        "Pa abs" => (1e-5, "bar abs"),
        "m3/(s Pa)" => (1e8, "dm3/(s bar)"),
        "-" | "1" => (1.0, ""),
        other => (1.0, other),
    };
    let rounded: f64 = format!("{:.5e}", factor * value).parse().unwrap_or(value);
    format!("{rounded} {usual}").trim_end().into()
}

/// Greater than `lower`.
pub const fn above(lower: f64) -> Bounds {
    Bounds { lower, upper: f64::INFINITY, open: true, open_above: true }
}

/// Finite or infinite, not less than `lower`.
pub const fn at_least(lower: f64) -> Bounds {
    Bounds { lower, upper: f64::INFINITY, open: false, open_above: false }
}

/// Strictly between `lower` and `upper`.
pub const fn between(lower: f64, upper: f64) -> Bounds {
    Bounds { lower, upper, open: true, open_above: true }
}

/// From `lower` to `upper`, both included.
pub const fn within(lower: f64, upper: f64) -> Bounds {
    Bounds { lower, upper, open: false, open_above: false }
}

/// Any finite number.
pub const fn any() -> Bounds {
    Bounds { lower: f64::NEG_INFINITY, upper: f64::INFINITY, open: true, open_above: true }
}

/// One parameter of a law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Its name in a description.
    pub key: &'static str,
    /// Unit in SI; `-` or `1` for a pure number.
    pub unit: &'static str,
    /// The values that it may take.
    #[serde(flatten)]
    pub bounds: Bounds,
    /// Default value, if there is one.
    pub default: Option<f64>,
    /// Meaning, in words.
    pub meaning: &'static str,
}

/// Declares the parameters of a law or part: a struct generic over the scalar, `PARAMETERS`, and `gather`. The latter
/// makes one struct of lanes from a struct for each lane.
/// Fields after `with` are choices. They select code, are the same in every lane, and are not numbers.
#[macro_export]
macro_rules! parameters {
    ($(#[$attribute:meta])* pub struct $name:ident {
        $($(#[doc = $meaning:literal])+ $field:ident: $unit:literal, $bounds:expr $(, default $default:expr)?;)*
    } $(with { $($(#[$choice_attribute:meta])* $choice:ident: $choice_type:ty),* $(,)? })?) => {
        $(#[$attribute])*
        #[derive(Clone, Debug)]
        pub struct $name<P> {
            $($(#[doc = $meaning])+ pub $field: P,)*
            $($($(#[$choice_attribute])* pub $choice: $choice_type,)*)?
        }

        impl<P: Copy> $name<P> {
            /// Name, unit, bounds, default and meaning of each parameter.
            pub const PARAMETERS: &'static [$crate::Parameter] = &[
                $($crate::Parameter {
                    key: stringify!($field),
                    unit: $unit,
                    bounds: $bounds,
                    default: $crate::parameters!(@default $($default)?),
                    meaning: concat!($($meaning),+).trim_ascii(),
                },)*
            ];

            /// Creates it from values in the order of `PARAMETERS`, then the choices.
            #[allow(dead_code)] // parts that are written out field by field do without
            pub fn from_values(values: &[P] $($(, $choice: $choice_type)*)?) -> Self {
                let mut values = values.iter().copied();
                $name {
                    $($field: values.next().expect(concat!("a value for ", stringify!($field))),)*
                    $($($choice,)*)?
                }
            }
        }

        impl $name<f64> {
            /// Returns the same choices with other numbers, in the order of `PARAMETERS`.
            #[allow(dead_code)]
            pub fn lifted<P: math::Real>(&self, values: &[P]) -> $name<P> {
                $name::from_values(values $($(, self.$choice.clone())*)?)
            }
        }

        impl<R: math::Real> $name<R> {
            /// Returns two of them side by side, with the choices of the first.
            #[allow(dead_code)]
            pub fn beside(&self, other: &Self) -> $name<math::Both<R>> {
                $name {
                    $($field: math::Both([self.$field, other.$field]),)*
                    $($($choice: self.$choice.clone(),)*)?
                }
            }
        }

        math::gather!($name { $($field),* } $(same { $($choice),* })?);
    };
    (@default) => { None };
    (@default $default:expr) => { Some($default) };
}
