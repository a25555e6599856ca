//! The equations of a drive along a measured record: forces and pressure rates at measured instead of integrated
//! states.

use crate::assembly::driven::{COMMAND, Driven, EDGES, later};
use crate::assembly::recorder::{Recorder, sample_times};
use crate::assembly::session::Session;
use crate::circuit::{Circuit, Look};
use crate::ground::{DIRECTIONS, Error, Net};
use math::Dual;
use ode::{NoOutput, Options, System};

/// Only one direction is used, for the flow. The equations are compiled for this number of directions in any case.
type AlongFlow = Dual<f64, DIRECTIONS>;

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
        let mut circuit = self.circuit().clone();
        let (mut plain, mut net) = (circuit.work::<f64>(), circuit.work::<AlongFlow>());
        let mut t = record.temperature;
        let mut rows = Vec::with_capacity(ALONG.len() * record.times.len());
        for i in 0..record.times.len() {
            let rates = self.temperature_rates(record, i, t, &mut circuit, (&mut plain, &mut net))?;
            let gas = self.chambers.map(|id| net[id]);
            let axis = net[self.axis];
            let steady = self.circuit().steady_friction(self.axis, &axis).re;
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
        (plain, net): (&mut Net<f64>, &mut Net<AlongFlow>),
    ) -> Result<[f64; 2], Error> {
        let pressure = [record.pressure[0][i], record.pressure[1][i]];
        let y = self.begin(circuit, [record.position[i], record.velocity[i]], pressure, t);
        let holds = circuit.inside(&y, plain) > 0.0;
        if !holds {
            return Err(Error::Stopped(format!(
                "the record cannot be of this drive: at t = {} s the piston is at {:.6} m of {:.6} m, the chambers are at {:.4e} \
                 and {:.4e} Pa absolute, {:.1} and {:.1} K. Rule: the piston between the covers, pressures and temperatures \
                 above zero. Check the zero of the position, gauge and absolute pressure, stroke and dead volumes",
                record.times[i],
                record.position[i],
                self.stroke,
                record.pressure[0][i],
                record.pressure[1][i],
                t[0],
                t[1]
            )));
        }
        for (edge, opening) in EDGES.zip(record.openings[i]) {
            self.assembly.set(circuit, edge, 0, opening);
        }
        let mut rates = y.clone();
        circuit.rhs(0.0, &y, &mut rates, plain);
        let mut moving: Vec<AlongFlow> = y.iter().map(|&value| value.into()).collect();
        for (moving, rate) in moving.iter_mut().zip(&rates) {
            moving.eps[0] = *rate;
        }
        let mut rates = moving.clone();
        circuit.rhs(0.0.into(), &moving, &mut rates, net);
        Ok(self.chambers.map(|id| net[id].t.eps[0]))
    }
}

/// A measured state to which a run is reset.
#[derive(Clone, Copy, Debug)]
pub struct Restart {
    /// Time, s.
    pub t: f64,
    /// Position, m.
    pub position: f64,
    /// Velocity, m/s.
    pub velocity: f64,
    /// Pressure, Pa absolute, in chambers a and b.
    pub pressure: [f64; 2],
}

/// Number and duration, s, of runs that settle unmeasured start values, mainly bristles. They start at the first state
/// with the valve shut. Afterwards friction balances the force of the pressures.
const SETTLING: (usize, f64) = (200, 5e-3);

impl Driven<'_> {
    /// Simulates a command with resets to measured states at given times, the first at 0. A reset sets position,
    /// velocity and pressures. Temperatures and the inner states of friction continue. A single state gives a free run.
    ///
    /// Returns the columns of the assembly, and the messages of failed parts. A failed part is NaN until the next
    /// restart.
    pub fn restarted(
        &self,
        (times, commands): (&[f64], &[f64]),
        sampling: (f64, f64),
        restarts: &[Restart],
        temperature: [f64; 2],
        options: Options,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<(Vec<Vec<f64>>, Vec<String>), Error> {
        let samples = sample_times(sampling.0, sampling.1);
        let mut look = Look::new(interrupted);
        let mut gas = temperature;
        let mut inner = Vec::new();
        for _ in 0..SETTLING.0 {
            let mut session = self.put_back(&restarts[0], gas, &inner, 0.0, options);
            if session.advance(restarts[0].t + SETTLING.1, &mut NoOutput, &mut look).is_err() {
                break;
            }
            inner = session.circuit().inner_states(self.axis, session.state()).to_vec();
        }
        let mut columns = vec![vec![f64::NAN; samples.len()]; self.assembly.columns().len()];
        let mut failures = Vec::new();
        for (j, restart) in restarts.iter().enumerate() {
            let end = restarts.get(j + 1).map_or(sampling.0, |next| next.t);
            let from = samples.partition_point(|&t| t < restart.t);
            let is_last = j + 1 == restarts.len();
            let until = samples.partition_point(|&t| t < end || (is_last && t <= end));
            let k = times.partition_point(|&t| t <= restart.t).max(1) - 1;
            let mut session = self.put_back(restart, gas, &inner, commands[k], options);
            session.plan(COMMAND, later(times, commands, restart.t.max(times[k]), end));
            let mut recorder = Recorder::new(self.assembly, samples[from..until].to_vec());
            match session.advance(end, &mut recorder, &mut look) {
                Ok(()) => {}
                Err(Error::Stopped(message)) => failures.push(message),
                Err(other) => return Err(other),
            }
            for (column, own) in columns.iter_mut().zip(recorder.columns(&session)) {
                column[from..from + own.len()].copy_from_slice(&own);
            }
            let state = session.state().to_vec();
            inner = session.circuit().inner_states(self.axis, &state).to_vec();
            let end = self.gas(std::iter::once(state));
            gas = [end[1], end[3]];
        }
        Ok((columns, failures))
    }

    /// Returns a session at a measured state. Temperatures and inner states are kept.
    fn put_back(
        &self,
        restart: &Restart,
        temperature: [f64; 2],
        inner: &[f64],
        u: f64,
        options: Options,
    ) -> Session {
        let mut circuit = self.circuit().clone();
        self.assembly.set(&mut circuit, COMMAND, 0, u);
        let motion = [restart.position, restart.velocity];
        let mut y = self.begin(&mut circuit, motion, restart.pressure, temperature);
        let first = circuit.n_states() - circuit.inner_states(self.axis, &y).len();
        y[first..first + inner.len()].copy_from_slice(inner);
        Session::new(self.assembly, restart.t, (circuit, y), options)
    }
}
