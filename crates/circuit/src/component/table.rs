//! Tables of parameters.

use physics::Parameter;
use std::ops::Deref;

/// A parameter of a component.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Row {
    /// Key, unit, bounds, default and meaning.
    #[serde(flatten)]
    pub parameter: Parameter,
    /// Reason for an assumed default. Empty without a default, or if a source of the component has the default.
    pub assumed: &'static str,
    /// Rule by which its default follows from other numbers. Empty without such a rule.
    pub follows: &'static str,
    /// Condition under which the parameter is not required: the key of another number, or a choice, "throttles = both".
    pub unless: &'static str,
    /// Optional table that contains it. Empty if it is not in a table.
    pub within: &'static str,
    /// Condition for its effect: a number above zero, a choice, "relieving = yes", or a number that is not given, "no
    /// heat_transfer". Empty without a condition.
    pub only: &'static str,
    /// Key of the parameter in older files.
    pub was: &'static str,
}

impl Row {
    /// Returns a parameter without further rules.
    pub const fn of(parameter: Parameter) -> Row {
        Row { parameter, assumed: "", follows: "", unless: "", within: "", only: "", was: "" }
    }
}

impl Deref for Row {
    type Target = Parameter;

    fn deref(&self) -> &Parameter {
        &self.parameter
    }
}

/// Declares the parameters of a component as rows of a table. Rows that several kinds share are named: `NAME;` for one
/// row, `..NAMES;` for several. The brackets behind a row's name hold a composed key, in place of the name.
#[macro_export]
macro_rules! table {
    ($($(..$rows:ident)? $($key:ident $([$composed:expr])? $(: $unit:literal, $bounds:expr $(, default $default:expr)?
        $(, assumed $assumed:literal)? $(, follows $follows:literal)? $(, within $within:expr)? $(, unless $unless:literal)?
        $(, only $only:literal)? $(, was $was:literal)?,
        $meaning:literal)?)?;)*) => {{
        const PARTS: &[&[$crate::component::Row]] = &[$(
            $(&$rows)?
            $(&[$crate::table!(
                @row $key [$($composed)?] $($unit, $bounds, [$($default)?], [$($assumed)?], [$($follows)?], [$($within)?], [$($unless)?],
                [$($only)?], [$($was)?], $meaning)?
            )])?
        ),*];
        const ROWS: [$crate::component::Row; $crate::component::count(PARTS)] = $crate::component::join(PARTS);
        &ROWS
    }};
    (@row $shared:ident []) => { $shared };
    (@row $key:ident [$($composed:expr)?] $unit:literal, $bounds:expr, [$($default:expr)?], [$($assumed:literal)?],
        [$($follows:literal)?], [$($within:expr)?], [$($unless:literal)?], [$($only:literal)?], [$($was:literal)?],
        $meaning:literal) => {
        $crate::component::Row {
            parameter: ::physics::Parameter {
                key: $crate::table!(@key $key $($composed)?),
                unit: $unit,
                bounds: $bounds,
                default: $crate::table!(@or None $(Some($default))?),
                meaning: $meaning,
            },
            assumed: $crate::table!(@or "" $($assumed)?),
            follows: $crate::table!(@or "" $($follows)?),
            unless: $crate::table!(@or "" $($unless)?),
            within: $crate::table!(@or "" $($within)?),
            only: $crate::table!(@or "" $($only)?),
            was: $crate::table!(@or "" $($was)?),
        }
    };
    (@key $key:ident) => { stringify!($key) };
    (@key $key:ident $composed:expr) => { $composed };
    (@or $other:tt) => { $other };
    (@or $other:tt $own:expr) => { $own };
}

/// Returns their total number.
#[doc(hidden)]
pub const fn count<T>(parts: &[&[T]]) -> usize {
    let (mut sum, mut i) = (0, 0);
    while i < parts.len() {
        sum += parts[i].len();
        i += 1;
    }
    sum
}

/// Joins arrays of rows, one after the other.
#[doc(hidden)]
pub const fn join<T: Copy, const N: usize>(parts: &[&[T]]) -> [T; N] {
    let mut all = [parts[0][0]; N];
    let (mut done, mut i) = (0, 0);
    while i < parts.len() {
        let mut row = 0;
        while row < parts[i].len() {
            all[done] = parts[i][row];
            (done, row) = (done + 1, row + 1);
        }
        i += 1;
    }
    all
}

/// A row shared by flow paths by ISO 6358.
pub const SUBSONIC_INDEX: Row = table! {
    subsonic_index: "1", physics::above(0.0), default 0.5, "Subsonic index m";
}[0];
/// A row shared by flow paths by ISO 6358.
pub const LINEAR_ABOVE: Row = table! {
    linear_above: "1", physics::between(0.0, 1.0), default physics::flow::LINEAR_ABOVE, assumed "a modelling parameter",
        "Pressure ratio above which the flow is linear; for a check valve, as a fraction of the closing ratio";
}[0];
