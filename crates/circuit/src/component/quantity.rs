//! Quantities in the columns of a run, and its start values.

use crate::circuit::Path;
use crate::ground::{AxisId, GasId};
use crate::part::{InputId, PartId};

/// Content of a column.
#[derive(Clone, Copy, Debug)]
pub enum Quantity {
    /// Time, s.
    Time,
    /// Position, m.
    Position(AxisId),
    /// Velocity, m/s.
    Velocity(AxisId),
    /// Acceleration, m/s2.
    Acceleration(AxisId),
    /// Friction, positive if it opposes v > 0.
    Friction(AxisId),
    /// Force, positive if it pushes towards -x.
    EndStop(AxisId),
    /// Pressure, Pa absolute.
    Pressure(GasId),
    /// Temperature, K.
    Temperature(GasId),
    /// Net mass flow into the node.
    MassFlow(GasId),
    /// Signal between parts, by index.
    Signal(usize),
    /// Value of an input.
    Input(InputId),
    /// Mass flow through the sum of one or two paths.
    Flow([Option<Path>; 2]),
    /// Mass flow through all paths out of a reservoir.
    OutOf(GasId),
    /// State of a part that has one.
    Force(PartId),
    /// Motion of a platform, by index.
    Pose(PartId, usize),
    /// Command of a valve. Command of a valve; NaN while its edges are set directly.
    Command([InputId; 4]),
    /// One inner state of an axis' friction.
    Inner(AxisId, usize),
}

impl Quantity {
    /// Mass flow through one path.
    pub fn along(path: Path) -> Self {
        Quantity::Flow([Some(path), None])
    }
}

/// Start values that belong together.
#[derive(Clone, Copy, Debug)]
pub enum Starting {
    /// Pressure, Pa absolute, and temperature, K.
    Gas(GasId),
    /// Position, m, and velocity, m/s.
    Axis(AxisId),
    /// All inner states of an axis' friction.
    Inner(AxisId),
    /// Index of the signal of a bistable valve's position, 0 or 1.
    Kept(usize),
}
