//! A piston between two chambers on the edges of a valve: runs and evaluations that need its states by name.

use super::session::Session;
use crate::assembly::recorder::{States, sample_times};
use crate::assembly::variables::{Assembly, Target};
use crate::circuit::{Circuit, Look};
use crate::component::Starting;
use crate::ground::{AxisId, Error, GasId, Given};
use ode::{Method, Statistics, System};
use std::f64::consts::PI;

/// Input that is the command of the valve.
pub(super) const COMMAND: usize = 0;
/// Inputs that are the openings of its edges.
pub(super) const EDGES: std::ops::RangeInclusive<usize> = 1..=4;

/// A circuit with a piston between two chambers on the edges of a valve. Its first inputs are the command and the
/// openings of the edges. Its start values begin with those of the piston and the chambers.
#[derive(Clone, Copy, Debug)]
pub struct Driven<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) axis: AxisId,
    pub(super) chambers: [GasId; 2],
    pub(super) stroke: f64,
}

impl<'a> Driven<'a> {
    pub(super) fn of(assembly: &'a Assembly, stroke: f64) -> Result<Self, Error> {
        let starts = &assembly.variables.starts[..];
        let [(Starting::Axis(axis), _), (Starting::Gas(a), _), (Starting::Gas(b), _), ..] = *starts else {
            return refuse();
        };
        let inputs = assembly.variables.inputs.get(..=*EDGES.end()).unwrap_or_default();
        let is_edge = |target: &Target| matches!(target, Target::Input(_));
        match inputs.split_first() {
            Some((command, edges))
                if matches!(command.target, Target::Edges(_))
                    && edges.iter().all(|own| is_edge(&own.target)) =>
            {
                Ok(Driven { assembly, axis, chambers: [a, b], stroke })
            }
            _ => refuse(),
        }
    }

    /// The stroke of the piston, m.
    pub fn stroke(&self) -> f64 {
        self.stroke
    }

    pub(super) fn circuit(&self) -> &'a Circuit<f64> {
        &self.assembly.circuit
    }

    /// Returns the state at position and velocity, pressures and temperatures, and sets the modes that belong to it.
    pub(super) fn begin(
        &self,
        circuit: &mut Circuit<f64>,
        [x, v]: [f64; 2],
        pressure: [f64; 2],
        temperature: [f64; 2],
    ) -> Vec<f64> {
        let [a, b] = self.chambers;
        circuit.begin(&Given {
            gas: &[(a, pressure[0], temperature[0]), (b, pressure[1], temperature[1])],
            axes: &[(self.axis, x, v)],
            ages: &[],
            inner: &[],
            signals: &[],
        })
    }

    /// The integrated states of a session: one row of x, v, m_a, U_a, m_b, U_b and inner states for each
    /// sample.
    pub fn states(
        mut session: Session,
        (duration, rate): (f64, f64),
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Vec<f64>, Error> {
        let mut states = States::new(sample_times(duration, rate), session.state().len());
        session.advance(duration, &mut states, &mut Look::new(interrupted))?;
        Ok(states.finish(&session))
    }

    /// (p_a, T_a, p_b, T_b) at each of the states, one after the other.
    pub fn gas(&self, states: impl Iterator<Item = Vec<f64>>) -> Vec<f64> {
        let mut net = self.circuit().work::<f64>();
        let mut gas = Vec::new();
        for y in states {
            self.circuit().observe(&y, &mut net);
            gas.extend(self.chambers.iter().flat_map(|&id| [net[id].p, net[id].t]));
        }
        gas
    }

    /// A sampled servo loop: every 1/rate seconds the command is computed from position and velocity
    /// and held. Returns the states at the samples, with rows as in [`Driven::states`], the commands, and the work
    /// counts.
    pub fn servo(
        servo: &Servo,
        mut session: Session,
        sampling: (f64, f64),
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<(Vec<f64>, Vec<f64>, Statistics), Error> {
        let times = sample_times(sampling.0, sampling.1);
        let mut states = States::new(times.clone(), session.state().len());
        let mut commands = Vec::with_capacity(times.len());
        let mut look = Look::new(interrupted);
        let mut samples = Samples::default();
        for pair in times.windows(2) {
            let u = servo.command(pair[0], session.state()[0], session.state()[1]);
            commands.push(u);
            session.put(COMMAND, u);
            session.use_method(samples.method());
            let before = session.statistics().factorisations;
            session.advance(pair[1], &mut states, &mut look)?;
            samples.took(session.statistics().factorisations - before);
        }
        commands.extend(commands.last().copied());
        let work = session.statistics();
        Ok((states.finish(&session), commands, work))
    }
}

fn refuse<T>() -> Result<T, Error> {
    Err(Error::Specification("this needs one piston between two chambers on a 5/3 valve".into()))
}

/// Integration method of a servo loop: a low-order method if a sample is hardly longer than a step. A low-order step
/// needs less work, and the sample limits the length of a step anyway.
#[derive(Default)]
struct Samples {
    /// Remaining samples for the high-order method.
    left: u32,
}

impl Samples {
    /// Largest number of attempts per sample for which low order is efficient: one high-order attempt costs as much as
    /// two.
    const FEW: u64 = 2;
    /// Samples after which low order is tried again.
    const PAUSE: u32 = 16;

    fn method(&self) -> Method {
        if self.left == 0 { Method::Rodas3 } else { Method::Rodas5P }
    }

    /// Registers the number of attempts for a sample.
    fn took(&mut self, attempts: u64) {
        self.left =
            if self.left == 0 && attempts > Self::FEW { Self::PAUSE } else { self.left.saturating_sub(1) };
    }
}

/// The commands of a plan that come after `from` and before `end`, each with its time.
pub(super) fn later(
    times: &[f64],
    commands: &[f64],
    from: f64,
    end: f64,
) -> impl Iterator<Item = (f64, f64)> {
    let each = times.iter().copied().zip(commands.iter().copied());
    each.filter(move |(time, _)| (from < *time) & (*time < end))
}

/// Proportional-derivative position control of a sine, u clipped to [-1, 1].
#[derive(Clone, Copy, Debug)]
pub struct Servo {
    /// Proportional gain, 1/m.
    pub kp: f64,
    /// Derivative gain, s/m.
    pub kd: f64,
    /// Middle of the reference, m.
    pub middle: f64,
    /// Amplitude of the reference, m.
    pub amplitude: f64,
    /// Frequency of the reference, Hz.
    pub frequency: f64,
}

impl Servo {
    fn command(&self, t: f64, x: f64, v: f64) -> f64 {
        let omega = 2.0 * PI * self.frequency;
        let reference = self.middle + self.amplitude * math::elementary::sin(omega * t);
        let rate = self.amplitude * omega * math::elementary::cos(omega * t);
        (self.kp * (reference - x) + self.kd * (rate - v)).clamp(-1.0, 1.0)
    }
}
