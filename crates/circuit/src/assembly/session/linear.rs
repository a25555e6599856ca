//! The derivatives of a running circuit by its states and inputs.

use super::{Session, refuse};
use crate::assembly::variables::{Settable, Target};
use crate::circuit::Circuit;
use crate::component::Quantity;
use crate::ground::{DIRECTIONS, Error, Sensitive};
use math::Real;
use ode::System;

/// x' = A x + B u, y = C x + D u about the present state: rows one after the other.
#[derive(Clone, Debug)]
pub struct Linear {
    /// A: derivatives of the rates by the states.
    pub a: Vec<f64>,
    /// B: derivatives of the rates by the inputs.
    pub b: Vec<f64>,
    /// C: derivatives of the outputs by the states.
    pub c: Vec<f64>,
    /// D: derivatives of the outputs by the inputs.
    pub d: Vec<f64>,
    /// Columns of the outputs.
    pub columns: Vec<usize>,
    /// State at the point of linearisation.
    pub state: Vec<f64>,
    /// Rates at this point.
    pub rates: Vec<f64>,
    /// Outputs at this point.
    pub outputs: Vec<f64>,
}

impl Session {
    /// Refuses inputs without derivatives. Returns the commands of valves among the others: direction, input and value.
    fn smooth(&self, inputs: &[usize]) -> Result<Vec<(usize, usize, f64)>, Error> {
        let commands: Vec<(usize, usize, f64)> = (inputs.iter().enumerate())
            .filter(|(_, input)| matches!(self.inputs()[**input].target, Target::Edges(_)))
            .map(|(direction, &input)| (direction, input, self.input(input)))
            .collect();
        for (_, input, u) in &commands {
            let name = &self.inputs()[*input].name;
            if *u == 0.0 {
                return refuse!(
                    "{name} = 0: the valve is shut, and its flow has one slope towards extending and another towards retracting. \
                     Set a small command in one direction, or linearise by the openings of the edges"
                );
            }
            if u.is_nan() {
                return refuse!(
                    "the edges of the valve are set directly: there is no {name} to differentiate by. Linearise by their openings"
                );
            }
        }
        for &input in inputs {
            let Settable { name, target, .. } = &self.inputs()[input];
            if matches!(target, Target::Timed(timing) if self.assembly.timings[*timing].smooth().is_none()) {
                return refuse!(
                    "{name} switches: the circuit has no derivative by it. Linearise by the other inputs"
                );
            }
        }
        Ok(commands)
    }

    /// Returns the exact derivatives of rates and outputs by the states and by some inputs. Outputs are all columns
    /// except time and command.
    pub fn linearise(&self, inputs: &[usize]) -> Result<Linear, Error> {
        self.alive()?;
        let commands = self.smooth(inputs)?;
        let (circuit, n) = (self.stepper.system(), self.stepper.system().n_states());
        let mut y0 = self.stepper.state().to_vec();
        circuit.settle(&mut y0);
        let quantities = &self.assembly.variables.quantities;
        let columns: Vec<usize> = (0..quantities.len())
            .filter(|&i| !matches!(quantities[i], Quantity::Time | Quantity::Command(_) | Quantity::Input(_)))
            .collect();
        let directions = n + inputs.len();
        let lifted = Circuit::<Sensitive>::gather(&[circuit]);
        let (mut dy, mut row) = (vec![Sensitive::zero(); y0.len()], vec![Sensitive::zero(); self.row.len()]);
        let mut slopes = vec![vec![0.0; directions]; n + columns.len()];
        for first in (0..directions).step_by(DIRECTIONS) {
            let seeded = |value: f64, direction: usize| Sensitive {
                re: value,
                eps: std::array::from_fn(|k| f64::from(u8::from(first + k == direction))),
            };
            let mut circuit = lifted.clone();
            for &(k, input, u) in &commands {
                self.assembly.set(&mut circuit, input, 0, seeded(u, n + k));
            }
            for (k, &input) in inputs.iter().enumerate() {
                let id = match self.inputs()[input].target {
                    Target::Input(id) => Some(id),
                    Target::Timed(timing) => self.assembly.timings[timing].smooth(),
                    Target::Edges(_) => None,
                };
                if let Some(id) = id {
                    // An edge moves with the command and independently.
                    let value = circuit.input(id) + seeded(0.0, n + k);
                    circuit.set_input(id, 0, value);
                }
            }
            let y: Vec<Sensitive> = y0.iter().enumerate().map(|(i, &value)| seeded(value, i)).collect();
            let mut net = circuit.work::<Sensitive>();
            circuit.rhs(Sensitive::zero(), &y, &mut dy, &mut net);
            self.assembly.row(&circuit, Sensitive::c(self.time()), &y, &mut net, &mut row);
            let numbers = dy[..n].iter().chain(columns.iter().map(|&column| &row[column]));
            for (slopes, number) in slopes.iter_mut().zip(numbers) {
                let pass = first..directions.min(first + DIRECTIONS);
                slopes[pass.clone()].copy_from_slice(&number.eps[..pass.len()]);
            }
        }
        let part = |rows: std::ops::Range<usize>, of: std::ops::Range<usize>| {
            slopes[rows].iter().flat_map(|row| row[of.clone()].to_vec()).collect::<Vec<_>>()
        };
        let all = n + columns.len();
        Ok(Linear {
            a: part(0..n, 0..n),
            b: part(0..n, n..directions),
            c: part(n..all, 0..n),
            d: part(n..all, n..directions),
            state: y0[..n].to_vec(),
            rates: dy[..n].iter().map(|rate| rate.re).collect(),
            outputs: columns.iter().map(|&column| row[column].re).collect(),
            columns,
        })
    }
}
