//! Tables of parameters.

use super::{Instance, WallHeat};
use crate::part::TubeWall;
use math::Lane;
use physics::heat::{Heat, Pipe};
use physics::{Gas, Parameter};
use std::f64::consts::PI;
use std::ops::Deref;

/// A parameter of a component.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Key, unit, bounds, default and meaning.
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

impl Deref for Row {
    type Target = Parameter;

    fn deref(&self) -> &Parameter {
        &self.parameter
    }
}

/// Declares the parameters of a component as rows of a table. Rows that several kinds share are named: `NAME;` for one
/// row,
/// `..NAMES;` for several.
#[macro_export]
macro_rules! table {
    ($($(..$rows:ident)? $($key:ident $(: $unit:literal, $bounds:expr $(, default $default:expr)?
        $(, assumed $assumed:literal)? $(, follows $follows:literal)? $(, within $within:literal)? $(, unless $unless:literal)?
        $(, only $only:literal)? $(, was $was:literal)?,
        $meaning:literal)?)?;)*) => {{
        const PARTS: &[&[$crate::own::Row]] = &[$(
            $(&$rows)?
            $(&[$crate::table!(
                @row $key $($unit, $bounds, [$($default)?], [$($assumed)?], [$($follows)?], [$($within)?], [$($unless)?],
                [$($only)?], [$($was)?], $meaning)?
            )])?
        ),*];
        const ROWS: [$crate::own::Row; $crate::own::count(PARTS)] = $crate::own::join(PARTS);
        &ROWS
    }};
    (@row $shared:ident) => { $shared };
    (@row $key:ident $unit:literal, $bounds:expr, [$($default:expr)?], [$($assumed:literal)?],
        [$($follows:literal)?], [$($within:literal)?], [$($unless:literal)?], [$($only:literal)?], [$($was:literal)?],
        $meaning:literal) => {
        $crate::own::Row {
            parameter: $crate::physics::Parameter {
                key: stringify!($key),
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

/// Rows shared by flow paths by ISO 6358.
pub const SUBSONIC_INDEX: Row = Row {
    parameter: Parameter {
        key: "subsonic_index",
        unit: "1",
        bounds: physics::above(0.0),
        default: Some(0.5),
        meaning: "Subsonic index m",
    },
    assumed: "",
    follows: "",
    unless: "",
    within: "",
    only: "",
    was: "",
};
/// A row shared by flow paths by ISO 6358.
pub const LINEAR_ABOVE: Row = table! {
    linear_above: "1", physics::between(0.0, 1.0), default physics::flow::LINEAR_ABOVE, assumed "a modelling parameter",
        "Pressure ratio above which the flow is linear; for a check valve, as a fraction of the closing ratio";
}[0];
/// The factor of a law of heat transfer.
pub(super) const HEAT_SCALE: Row = table! {
    heat_transfer_scale: "1", physics::at_least(0.0), default 1.0, assumed "the law, uncertain by a factor of 2", only "no heat_transfer",
        "Factor of the law of heat transfer";
}[0];
/// Rows of the wall of a tube.
pub(super) const TUBE_WALL: [Row; 3] = *table! {
    heat_transfer: "W/(m2 K)", physics::at_least(0.0), follows "Nu = 3.66 for laminar flow and Gnielinski's for turbulent flow",
        "Heat-transfer coefficient to the wall, if it is constant";
    heat_transfer_scale: "1", physics::at_least(0.0), default 1.0, assumed "the law, uncertain by a factor of 1.4", only "no heat_transfer",
        "Factor of the law of heat transfer";
    wall_temperature: "K", physics::above(0.0), follows "the ambient temperature", "Temperature of the wall";
};

/// Returns the heat transfer of a tube with the rows [`TUBE_WALL`].
pub(super) fn tube_heat<P: Lane>(own: &Instance<P>) -> WallHeat<P> {
    let law =
        || WallHeat::Tube { scale: own.number("heat_transfer_scale"), diameter: own.number("diameter") };
    own.given("heat_transfer").map_or_else(law, WallHeat::Constant)
}

/// Returns the wall of a steady tube, if it exchanges heat.
pub(crate) fn tube_wall<P: Lane>(
    own: &Instance<P>,
    ambient_temperature: P,
    gas: &Gas<P>,
) -> Option<TubeWall<P>> {
    if !own.kind().key.starts_with("tube") {
        return None;
    }
    let (length, diameter) = (own.number("length"), own.number("diameter"));
    let heat = match own.given("heat_transfer") {
        None => Heat::Pipe(Pipe::new(own.number("heat_transfer_scale"), diameter, gas)),
        Some(coefficient) if coefficient.get(0) == 0.0 && !own.is_free("heat_transfer") => return None,
        Some(coefficient) => Heat::Newton(coefficient),
    };
    let temperature = own.given("wall_temperature").unwrap_or(ambient_temperature);
    Some(TubeWall { heat, area: P::c(PI) * diameter * length, temperature })
}

/// Rows of a wall that stores heat.
pub(super) const WALL: &[Row] = table! {
    wall_capacity: "J/K", physics::above(0.0), within "wall", "Heat capacity of the wall, which stores heat at one temperature; absent: a wall at constant temperature";
    wall_outer_area: "m2", physics::at_least(0.0), within "wall", "Area of the wall on the side of the ambient air";
    wall_outer_heat_transfer: "W/(m2 K)", physics::at_least(0.0), default 10.0, assumed "usual for still air, with radiation",
        within "wall", "Heat-transfer coefficient from the ambient air to the wall";
};
