//! The sampled loop: samples, law and command, each at its time.

use crate::belief::Axis;
use crate::faults::Faults;
use crate::sensors::Sensors;
use crate::{refuse, specification};
use circuit::{Error, Look, Session};
use control::{Answer, AnyLaw, Controller, Coupled, Inputs, Reference, Rules, Sample, Valves};
use std::time::Instant;

/// Names of the columns of a run; SI units.
pub const COLUMNS: [&str; 12] = [
    "time_s",
    "position_m",
    "velocity_m_s",
    "pressure_a_pa",
    "pressure_b_pa",
    "reference_m",
    "command",
    "estimated_velocity_m_s",
    "disturbance_n",
    "holds",
    "step_time_s",
    "least_step_time_s",
];

/// Latest time of a command as a fraction of the period.
const LATEST: f64 = 0.999;

/// The sampled loop of one axis of a session: its sensors, converters, commands and faults.
pub struct Servo {
    sensors: Sensors,
    faults: Faults,
    axis: Axis,
    /// Indices of the columns position, velocity and both pressures.
    columns: [usize; 4],
    /// Inputs of the valves, and the commands of each sample if there are several valves.
    commands: Vec<usize>,
    commanded: Vec<f64>,
}

/// A sample whose command has not been given yet.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Its number.
    pub tick: u64,
    /// Sample of the sensors.
    pub sample: Sample,
    /// True position, m, velocity, m/s, and pressures, Pa.
    pub truth: [f64; 4],
    /// Answer of the law.
    pub answer: Answer,
    /// Computing time of the law, s.
    pub took: f64,
    /// Shortest time of the repeats of a step, s.
    pub least: f64,
}

/// An axis with its controller and reference.
pub struct Led<'a> {
    /// Its loop.
    pub servo: &'a mut Servo,
    /// Its controller.
    pub controller: &'a mut Controller,
    /// Its reference.
    pub reference: &'a Reference,
}

/// Rows of a run.
pub type Rows = Vec<[f64; COLUMNS.len()]>;

/// Runs several axes of one session for a time, s. All commands of a sample come after all its readings. Returns the
/// [`COLUMNS`] of each axis, and these columns of the session at each sample. A fault that stops an axis ends the run
/// with an error.
pub fn run_together(
    session: &mut Session,
    axes: &mut [Led<'_>],
    columns: &[usize],
    duration: f64,
    look: &mut Look<'_>,
) -> Result<(Vec<Rows>, Vec<Vec<f64>>), Error> {
    let mut ticks = 0;
    for own in &*axes {
        ticks = own.servo.check(own.controller, own.reference, duration)?;
        if own.controller.period != axes[0].controller.period {
            return refuse!("period: all controllers of one run have the same period");
        }
    }
    let (mut rows, mut others) = (vec![Rows::new(); axes.len()], vec![]);
    let (mut turns, mut feedback) = (Vec::with_capacity(axes.len()), vec![[0.0; 2]; axes.len()]);
    for tick in 0..=ticks {
        let deviations: Vec<_> =
            axes.iter().map(|own| own.controller.deviations(own.reference).unwrap_or_default()).collect();
        for own in &mut *axes {
            let others = own.reference.others(tick as f64 * own.controller.period);
            let sum = |part: usize, of: &[[f64; 2]]| {
                [0, 1].map(|k| others.iter().zip(of).map(|(own, of)| own[part] * of[k]).sum())
            };
            let coupled = Coupled { loads: sum(0, &deviations), feedback: sum(1, &feedback) };
            own.controller.coupled = (!others.is_empty()).then_some(coupled);
        }
        turns.clear();
        for Led { servo, controller, reference } in &mut *axes {
            turns.push(servo.observe(session, tick, controller, reference, look)?);
        }
        feedback = turns.iter().map(|own: &Turn| own.answer.feedback).collect();
        others.push(columns.iter().map(|&column| session.read(column)).collect());
        for ((own, turn), rows) in axes.iter_mut().zip(&turns).zip(&mut rows) {
            rows.push(own.servo.give(session, own.controller, turn, turn.answer.command)?);
        }
    }
    Ok((rows, others))
}

impl Servo {
    /// The loop of an axis of a session that has these components.
    pub fn new(session: &mut Session, axis: &Axis, setup: &specification::Setup) -> Result<Self, Error> {
        let foreign =
            |error: Error| Error::Specification(format!("the controller is for another drive: {error}"));
        let input =
            |session: &Session, name: String| session.assembly.variables.input(&name).map_err(foreign);
        let column = |name: &str| {
            session.assembly.variables.column(&format!("{}.{name}", axis.cylinder)).map_err(foreign)
        };
        let [x, v, a, b] = ["position_m", "velocity_m_s", "a.pressure_pa", "b.pressure_pa"].map(column);
        let columns = [x?, v?, a?, b?];
        let faults = Faults::new(setup);
        let forces: Vec<_> = setup.forces.iter().map(|&[t, force]| (t, Some(force))).collect();
        for (name, rows) in [
            (format!("{}.load_force_n", axis.cylinder), forces),
            (format!("{}.pressure_pa", axis.supply), faults.supply().collect()),
        ] {
            if !rows.is_empty() {
                let scheduled = input(session, name)?;
                let usual = session.input(scheduled);
                let (times, values): (Vec<f64>, Vec<f64>) =
                    rows.into_iter().map(|(t, value)| (t, value.unwrap_or(usual))).unzip();
                session.schedule(scheduled, &times, &values)?;
            }
        }
        let commands = axis.valves.iter().map(|valve| input(session, format!("{valve}.command")));
        let commands = commands.collect::<Result<_, _>>()?;
        let sensors = Sensors::new(setup.clone());
        Ok(Servo { sensors, faults, axis: axis.clone(), columns, commands, commanded: vec![] })
    }

    /// Checks the requests of a run for a time, s, and returns the number of its last sample.
    pub fn check(&self, controller: &Controller, reference: &Reference, duration: f64) -> Result<u64, Error> {
        let period = controller.period;
        let computing = self.sensors.setup.computing_time_s;
        if !(0.0..period).contains(&computing) {
            return refuse!("the computing time, {computing} s, must be shorter than the period, {period} s");
        }
        let stroke = controller.model.stroke;
        let free = Rules::default();
        let rules = controller.supervisor.as_ref().map_or(&free, |own| &own.rules);
        let ticks = (duration / period).round() as u64;
        let refused = (0..=ticks)
            .map(|tick| tick as f64 * period)
            .find_map(|t| rules.refuses(&reference.at(t), stroke).map(|why| (t, why)));
        if let Some((t, why)) = refused {
            return refuse!("at t = {t} s {why}");
        }
        Ok(ticks)
    }

    /// Advances to a sample, by its number, and calls the law; [`Servo::give`] comes next.
    pub fn observe(
        &mut self,
        session: &mut Session,
        tick: u64,
        controller: &mut Controller,
        reference: &Reference,
        look: &mut Look<'_>,
    ) -> Result<Turn, Error> {
        let period = controller.period;
        session.go_on(tick as f64 * period, look)?;
        // A command comes after the samples of a valve at this instant.
        session.settle_schedule();
        let truth = self.columns.map(|column| session.read(column));
        let (position, pressures) = self.sensors.sample(tick, period, truth);
        let sample = Sample { time: session.time(), position, pressures };
        let t = sample.time;
        if let Some(supervisor) = &mut controller.supervisor {
            supervisor.inputs =
                Inputs { jitter: self.sensors.setup.jitter_s[0], ..self.faults.inputs(t, truth[0]) };
        }
        let seen = self.faults.spoil(&sample);
        let lost = self.faults.reference(t);
        let arrives = lost.as_ref().unwrap_or(reference);
        // A custom law may have a memory that is not copied.
        let repeats = self.sensors.setup.step_repeats;
        let is_repeated = repeats > 1 && !matches!(controller.law, AnyLaw::Own(_));
        let before = is_repeated.then(|| controller.clone());
        let begin = Instant::now();
        let mut answer = controller.decide(&seen, arrives);
        let took = begin.elapsed().as_secs_f64();
        let least = before.map_or(took, |before| {
            let again = |_| {
                let mut own = before.clone();
                let begin = Instant::now();
                std::hint::black_box(own.decide(&seen, arrives));
                begin.elapsed().as_secs_f64()
            };
            (1..repeats).map(again).fold(took, f64::min)
        });
        if lost.is_some() {
            // Another reference arrived: the answer gets the intended state.
            answer.wanted = reference.at(t);
        }
        Ok(Turn { tick, sample, truth, answer, took, least })
    }

    /// Names of the valves and their commands at each sample, one after the other, where they are not those of one proportional
    /// 5/3 valve.
    pub fn commanded(&self) -> (&[String], &[f64]) {
        (&self.axis.valves, &self.commanded)
    }

    /// Gives a command, which may be another one than the law's: the [`COLUMNS`] of this sample.
    pub fn give(
        &mut self,
        session: &mut Session,
        controller: &mut Controller,
        turn: &Turn,
        mut command: f64,
    ) -> Result<[f64; COLUMNS.len()], Error> {
        let t = turn.sample.time;
        if !command.is_finite() {
            return Err(Error::Stopped(format!("the controller gives no command at t = {t} s: {command}")));
        }
        let mut given = controller.give(t, command);
        let specification::Setup { command_bits, computing_time_s, .. } = self.sensors.setup;
        if command_bits > 0 {
            let half = ((1_u64 << command_bits) - 1) as f64 / 2.0;
            let convert = |own: f64| ((own + 1.0) * half).round_ties_even() / half - 1.0;
            // Switching valves have no converter.
            let has_converter = controller.model.valve.arrangement.is_proportional();
            (command, given) = (convert(command), if has_converter { given.map(convert) } else { given });
        }
        let acts = self.faults.command(t, given);
        if !matches!(controller.valves, Valves::One) {
            self.commanded.extend(acts.values());
        }
        let computing = computing_time_s + self.sensors.late(3, turn.tick).abs();
        let computing = computing.min(LATEST * controller.period);
        for (&input, &own) in self.commands.iter().zip(acts.values()) {
            if computing > 0.0 {
                session.schedule(input, &[t + computing], &[own])?;
            } else {
                session.set(input, own)?;
            }
        }
        let Answer { wanted, velocity, disturbance, holds, .. } = turn.answer;
        let ([x, v, a, b], holds) = (turn.truth, f64::from(u8::from(holds)));
        Ok([t, x, v, a, b, wanted.position, command, velocity, disturbance, holds, turn.took, turn.least])
    }
}
