//! The equations of a drive along a measured record: forces and pressure rates at measured instead of integrated
//! states.

use crate::assembly::driven::{Driven, EDGES};
use crate::circuit::Circuit;
use crate::ground::{Error, Given, Net, Sensitive};
use ode::System;
use physics::in_usual_unit;

/// Names of the columns of [`Driven::along`].
pub const ALONG: [&str; 9] = [
    "temperature_a_k",
    "temperature_b_k",
    "force_n",
    "friction_n",
    "end_stop_force_n",
    "pressure_rate_a_pa_s",
    "pressure_rate_b_pa_s",
    "mass_flow_a_kg_s",
    "mass_flow_b_kg_s",
];

/// A measured record of a drive with `n` samples.
#[derive(Clone, Copy, Debug)]
pub struct Record<'a> {
    /// Time, s, increasing.
    pub times: &'a [f64],
    /// Position, m.
    pub position: &'a [f64],
    /// Velocity, m/s.
    pub velocity: &'a [f64],
    /// Pressure, Pa absolute, in chambers a and b.
    pub pressure: [&'a [f64]; 2],
    /// Open fraction of the full conductance of each edge of the valve: supply to a, a to exhaust, supply to b, b to
    /// exhaust. The value is constant from each sample to the next.
    pub openings: &'a [[f64; 4]],
    /// Temperatures in the chambers at the first sample, K.
    pub temperature: [f64; 2],
}

/// Relative step of the difference that gives d(dT/dt)/dT.
const STEP: f64 = 1e-4;

impl Driven<'_> {
    /// Returns the columns [`ALONG`] at each sample, row by row.
    ///
    /// * `force`: all forces in +x except friction, N.
    /// * `friction`: friction of steady sliding at the measured velocity, N, positive if it opposes v > 0.
    /// * `dp/dt`: pressure rate of the energy balance at the measured state, Pa/s.
    ///
    /// Temperatures are not measured. They follow the energy balance from the first sample on, at measured position,
    /// velocity and pressure, by the linearly implicit Euler method:
    ///
    ///   `T' = T + h f / (1 - h df/dT),   f = dT/dt`
    ///
    /// This method is stable even if a small chamber is flushed within less than a sample. The start temperatures are
    /// forgotten with the time constant of heat transfer and flushing.
    ///
    /// A sample that is impossible for this drive, such as a piston behind a cover, is an error.
    pub fn along(&self, record: &Record<'_>) -> Result<Vec<f64>, Error> {
        let mut circuit = Circuit::clone(&self.assembly.circuit);
        let (mut plain, mut net) = (circuit.work::<f64>(), circuit.work::<Sensitive>());
        let mut t = record.temperature;
        let mut rows = Vec::with_capacity(ALONG.len() * record.times.len());
        for i in 0..record.times.len() {
            let rates = self.temperature_rates(record, i, t, &mut circuit, (&mut plain, &mut net))?;
            let gas = self.chambers.map(|id| net[id]);
            let axis = net[self.axis];
            let steady = self.assembly.circuit.steady_friction(self.axis, &axis).re;
            rows.extend([t[0], t[1], axis.force.re, steady, -axis.end_stop.re]);
            rows.extend(gas.iter().map(|node| node.p.eps[0]));
            rows.extend(gas.iter().map(|node| node.m_dot.re));
            if let Some(next) = record.times.get(i + 1) {
                let h = next - record.times[i];
                let warmer = t.map(|t| t * (1.0 + STEP));
                let warmer =
                    self.temperature_rates(record, i, warmer, &mut circuit, (&mut plain, &mut net))?;
                for side in 0..2 {
                    let slope = (warmer[side] - rates[side]) / (t[side] * STEP);
                    t[side] += h * rates[side] / (1.0 - h * slope.min(0.0));
                }
            }
        }
        Ok(rows)
    }

    /// Returns dT/dt in both chambers at sample `i` with temperatures `t`. Leaves the nodes, with their rates along the
    /// flow, in `net`.
    fn temperature_rates(
        &self,
        record: &Record<'_>,
        i: usize,
        t: [f64; 2],
        circuit: &mut Circuit<f64>,
        (plain, net): (&mut Net<f64>, &mut Net<Sensitive>),
    ) -> Result<[f64; 2], Error> {
        let gas = [0, 1].map(|side| (self.chambers[side], record.pressure[side][i], t[side]));
        let axes = [(self.axis, record.position[i], record.velocity[i])];
        let y = circuit.begin(&Given { gas: &gas, axes: &axes, ages: &[], inner: &[], signals: &[] });
        let holds = circuit.inside(&y, plain) > 0.0;
        if !holds {
            return Err(Error::Stopped(format!(
                "the record cannot be of this drive: at t = {} s the piston is at {} of {}, the chambers are at {} and \
                 {}, {:.1} and {:.1} K. Rule: the piston between the covers, pressures and temperatures \
                 above zero. Check the zero of the position, gauge and absolute pressure, stroke and dead volumes",
                record.times[i],
                in_usual_unit(record.position[i], "m"),
                in_usual_unit(self.stroke, "m"),
                in_usual_unit(record.pressure[0][i], "Pa abs"),
                in_usual_unit(record.pressure[1][i], "Pa abs"),
                t[0],
                t[1]
            )));
        }
        for (edge, opening) in EDGES.zip(record.openings[i]) {
            self.assembly.set(circuit, edge, 0, opening);
        }
        let mut rates = y.clone();
        circuit.rhs(0.0, &y, &mut rates, plain);
        let mut moving: Vec<Sensitive> = y.iter().map(|&value| value.into()).collect();
        for (moving, rate) in moving.iter_mut().zip(&rates) {
            moving.eps[0] = *rate;
        }
        let mut rates = moving.clone();
        circuit.rhs(0.0.into(), &moving, &mut rates, net);
        Ok(self.chambers.map(|id| net[id].t.eps[0]))
    }
}
