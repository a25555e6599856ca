//! Rows of a trajectory of the usual drive, from its fast outputs.

use crate::assembly::variables::command;
use crate::circuit::{Circuit, Glance, place};
use crate::component::Quantity;
use crate::part::InputId;
use crate::part::mechanics::cylinder::INNER;

/// Further values in rows, after the fast outputs.
const TIME: usize = size_of::<Glance>() / size_of::<f64>();
const COMMAND: usize = TIME + 1;
const INNER_STATE: usize = COMMAND + 1;
const VALUES: usize = 16;

/// Columns of a trajectory as values of the fast outputs.
#[derive(Clone)]
pub(crate) struct Glances {
    columns: Vec<usize>,
    edges: Option<[InputId; 4]>,
}

impl Glances {
    /// Returns the columns if the circuit has fast outputs and its columns need no other values.
    pub fn of(circuit: &Circuit<f64>, quantities: &[Quantity]) -> Option<Self> {
        let (axis, gas) = circuit.glanced()?;
        let mut edges = None;
        let columns = quantities.iter().map(|quantity| {
            let side = |id| gas.iter().position(|own| *own == id);
            match *quantity {
                Quantity::Time => Some(TIME),
                Quantity::Position(id) if id == axis => Some(place::POSITION),
                Quantity::Velocity(id) if id == axis => Some(place::VELOCITY),
                Quantity::Acceleration(id) if id == axis => Some(place::ACCELERATION),
                Quantity::Friction(id) if id == axis => Some(place::FRICTION),
                Quantity::EndStop(id) if id == axis => Some(place::END_STOP),
                Quantity::Pressure(id) => side(id).map(|side| place::PRESSURE[side]),
                Quantity::Temperature(id) => side(id).map(|side| place::TEMPERATURE[side]),
                Quantity::MassFlow(id) => side(id).map(|side| place::MASS_FLOW[side]),
                Quantity::Command(own) if edges.is_none() => {
                    edges = Some(own);
                    Some(COMMAND)
                }
                Quantity::Inner(id, 0) if id == axis => Some(INNER_STATE),
                _ => None,
            }
        });
        let columns = columns.collect::<Option<_>>()?;
        Some(Glances { columns, edges })
    }

    /// Writes one row of the columns, with the same bits as [`super::Assembly::row`].
    #[inline(always)]
    pub fn row(&self, circuit: &Circuit<f64>, t: f64, y: &[f64], row: &mut [f64]) {
        let mut values = [0.0; VALUES];
        values[..TIME].copy_from_slice(&circuit.glance(y));
        values[TIME] = t;
        values[COMMAND] = self.edges.map_or(0.0, |edges| command(circuit, edges));
        values[INNER_STATE] = y.get(INNER).copied().unwrap_or(0.0);
        for (value, column) in row.iter_mut().zip(&self.columns) {
            *value = values[column % VALUES];
        }
    }
}
