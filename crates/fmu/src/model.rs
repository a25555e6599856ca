//! A drive as a tool runs it: values before the run, one session during it.

mod saved;
mod start;

use crate::law::RunningLaw;
use crate::plan::{FmuPlan, VariableRole};
use crate::refusal::{CallRefusal, SAME_INSTANT, refuse};
use circuit::{AxisId, Look, Session};
use std::sync::Arc;

/// Relative tolerances that the solver accepts.
const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-13..=1e-1;
/// Fraction of the nominal values of states that the tool receives (assumed; measured in
/// `docs/guide/fmu.md`). A tool's tolerance refers to state and nominal value together. Nominal values as
/// large as the states would hide small changes.
const SHARE_OF_SIZES: f64 = 0.02;
/// Change of a state, in solver scales, from which on later changes are counted from a new origin (assumed;
/// likewise).
const MOST_CHANGE: f64 = 10.0;
/// Halvings on the way back to a valid state of the circuit.
const HALVINGS: i32 = 50;
/// A session and the variables in it.
#[derive(Clone)]
struct Running {
    session: Session,
    /// Index of each variable among the quantities of its role, such as the columns.
    places: Arc<[usize]>,
    /// Axis of an actuator, and the index of its position among the states. Its velocity follows.
    motion: Option<(AxisId, usize)>,
    /// State at the start or the last event. A tool integrates the changes since then. The tolerance of the tool then
    /// refers to these changes, not to a position that may be far from 0.
    origin: Vec<f64>,
    /// Last state with finite rates.
    good: Vec<f64>,
}

impl Running {
    /// Rates of the present state. A trial of the tool may be outside the physical range, such as a chamber
    /// without volume. In that case these are the rates of the last valid state on the way. Most tools do not accept a
    /// refusal, and all reject a step whose rates do not agree.
    fn rates(&mut self) -> Vec<f64> {
        let rates = self.session.rates();
        let (t, y) = (self.session.time(), self.session.state().to_vec());
        if is_finite(&rates) || self.good.is_empty() {
            self.good = y;
            return rates;
        }
        let inside = (1..=HALVINGS).find_map(|k| {
            let share = 0.5_f64.powi(k);
            let way: Vec<f64> =
                self.good.iter().zip(&y).map(|(from, to)| from + share * (to - from)).collect();
            self.session.place(t, &way);
            Some(self.session.rates()).filter(|rates| is_finite(rates))
        });
        self.session.place(t, &y);
        inside.unwrap_or(rates)
    }
}

fn is_finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// Result of a change of modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    pub states_changed: bool,
    /// Next instant at which modes must change, s.
    pub next: Option<f64>,
}

/// A drive as a tool runs it.
#[derive(Clone)]
pub struct FmuModel {
    plan: Arc<FmuPlan>,
    /// Values of all settable variables.
    values: Vec<f64>,
    t0: f64,
    rtol: f64,
    /// Whether the tool integrates (model exchange).
    pub outside: bool,
    begun: bool,
    running: Option<Running>,
    /// Controller, instead of a session.
    law: Option<RunningLaw>,
}

impl FmuModel {
    pub fn new(plan: Arc<FmuPlan>, outside: bool) -> Self {
        let values = plan.variables.iter().map(|own| own.start).collect();
        FmuModel { values, t0: 0.0, rtol: plan.rtol, plan, outside, begun: false, running: None, law: None }
    }

    /// Resets the model to its original state.
    pub fn reset(&mut self) {
        *self = FmuModel::new(self.plan.clone(), self.outside);
    }

    /// Sets the start time and the optional tolerance.
    pub fn set_up(&mut self, t0: f64, stop: Option<f64>, rtol: Option<f64>) -> Result<(), CallRefusal> {
        if !t0.is_finite() {
            return refuse(format!("start time = {t0} s is not a time"));
        }
        if let Some(stop) = stop
            && (stop.is_nan() || stop < t0)
        {
            return refuse(format!("stop time = {stop} s: it must not be before the start time, {t0} s"));
        }
        if let Some(rtol) = rtol {
            if !TOLERANCES.contains(&rtol) {
                let (low, high) = (TOLERANCES.start(), TOLERANCES.end());
                return refuse(format!(
                    "tolerance = {rtol} is out of bounds: it must be between {low:e} and {high:e}"
                ));
            }
            self.rtol = rtol;
        }
        self.t0 = t0;
        (self.running, self.law) = (None, None);
        Ok(())
    }

    /// Makes the values set before the run final.
    pub fn begin(&mut self) -> Result<(), CallRefusal> {
        match &self.plan.law {
            Some(law) => self.law = Some(RunningLaw::new(law, &self.plan.variables, self.t0)?),
            None => {
                self.running()?;
            }
        }
        self.begun = true;
        Ok(())
    }

    fn variable(&self, reference: u32) -> Result<usize, CallRefusal> {
        let place = reference as usize;
        if place < self.values.len() {
            return Ok(place);
        }
        refuse(format!(
            "there is no variable with value reference {reference}; there are {}",
            self.values.len()
        ))
    }

    /// Returns the value reference of a variable by its name.
    pub fn named(&self, name: &str) -> Result<u32, CallRefusal> {
        match self.plan.variables.iter().position(|own| own.name == name) {
            Some(place) => Ok(place as u32),
            None => refuse(format!("there is no variable \"{name}\"")),
        }
    }

    /// Returns whether the variable changes only at events.
    pub fn is_discrete(&self, reference: u32) -> bool {
        let own = self.plan.variables.get(reference as usize);
        matches!(own.map(|own| &own.role), Some(VariableRole::Input { discrete: true, .. }))
    }

    /// Sets a variable.
    pub fn set(&mut self, reference: u32, value: f64) -> Result<(), CallRefusal> {
        let (at, plan) = (self.variable(reference)?, self.plan.clone());
        let own = &plan.variables[at];
        if !value.is_finite() {
            return refuse(format!("{} = {value} is not a number", own.name));
        }
        if !(own.role.is_input() || own.role.is_fixed()) {
            return refuse(format!("{} cannot be set: it follows from the others", own.name));
        }
        if !self.begun || plan.law.is_some() {
            self.values[at] = value;
            self.running = None;
            return Ok(());
        }
        if own.role.is_fixed() {
            return refuse(format!("{} is fixed: it can be set before the run only", own.name));
        }
        if self.values[at].to_bits() != value.to_bits() {
            if let VariableRole::Input { .. } = own.role {
                let Running { session, places, .. } = self.running()?;
                session.set(places[at], value)?;
            }
            self.values[at] = value;
            self.follow()?;
        }
        Ok(())
    }

    /// Reads a variable at the present instant.
    pub fn get(&mut self, reference: u32) -> Result<f64, CallRefusal> {
        let at = self.variable(reference)?;
        let (plan, kept) = (self.plan.clone(), self.values[at]);
        let role = &plan.variables[at].role;
        if role.is_fixed() || role.is_input() {
            return Ok(kept);
        }
        if let Some(law) = &plan.law {
            let running = match &self.law {
                Some(running) => running,
                None => &RunningLaw::new(law, &plan.variables, self.t0)?,
            };
            return Ok(match role {
                VariableRole::Output { of } => running.output(of).unwrap_or(kept),
                _ => running.time,
            });
        }
        let Running { session, places, motion, origin, .. } = self.running()?;
        let place = places[at];
        Ok(match role {
            VariableRole::Time => session.time(),
            VariableRole::Output { .. } => session.read(place),
            VariableRole::State { .. } => session.state()[place],
            VariableRole::Change { .. } => session.state()[place] - origin[place],
            VariableRole::Rate { .. } => session.rates()[place],
            VariableRole::Event { .. } => session.events().get(place).copied().unwrap_or(1.0),
            VariableRole::Force => motion.map_or(0.0, |(axis, _)| session.force_on(axis)),
            _ => kept,
        })
    }

    /// Returns the present time, s.
    pub fn time(&self) -> f64 {
        let law = self.law.as_ref().map(|own| own.time);
        law.unwrap_or_else(|| self.running.as_ref().map_or(self.t0, |running| running.session.time()))
    }

    fn running(&mut self) -> Result<&mut Running, CallRefusal> {
        if self.plan.law.is_some() {
            return refuse("a controller has no continuous states, no events and no derivatives");
        }
        if self.running.is_none() {
            self.running = Some(self.start()?);
            self.follow()?;
        }
        Ok(self.running.as_mut().expect("just made"))
    }

    /// Sets the piston of an actuator to the given position. End stops act at every position.
    fn follow(&mut self) -> Result<(), CallRefusal> {
        if !self.outside {
            return Ok(());
        }
        let motion = [VariableRole::Position, VariableRole::Velocity].map(|role| {
            let place = self.plan.variables.iter().position(|own| own.role == role);
            place.map_or(0.0, |place| self.values[place])
        });
        let Running { session, motion: axis, .. } = self.running()?;
        let mut y = session.state().to_vec();
        if let Some((_, first)) = axis {
            y[*first..*first + 2].copy_from_slice(&motion);
        }
        session.place(session.time(), &y);
        Ok(())
    }

    /// Returns the indices of the tool's continuous states among those of the session.
    fn continuous(&mut self) -> Result<Vec<usize>, CallRefusal> {
        let Running { session, motion, .. } = self.running()?;
        let own = motion.map(|(_, first)| [first, first + 1]).unwrap_or([usize::MAX; 2]);
        Ok((0..session.state().len()).filter(|state| !own.contains(state)).collect())
    }

    /// Returns the number of continuous states that the tool integrates.
    pub fn n_states(&mut self) -> Result<usize, CallRefusal> {
        Ok(self.continuous()?.len())
    }

    /// Sets the time, s.
    pub fn set_time(&mut self, t: f64) -> Result<(), CallRefusal> {
        if !t.is_finite() {
            return refuse(format!("t = {t} s is not a time"));
        }
        let session = &mut self.running()?.session;
        let y = session.state().to_vec();
        session.place(t, &y);
        Ok(())
    }

    /// Sets the states, given as changes since the last event.
    pub fn set_states(&mut self, x: &[f64]) -> Result<(), CallRefusal> {
        let places = self.continuous()?;
        check_length("states", x.len(), places.len())?;
        if x.iter().any(|value| !value.is_finite()) {
            return Err(CallRefusal { message: "a state is not a number".into(), discard: true });
        }
        let Running { session, origin, .. } = self.running()?;
        let mut y = session.state().to_vec();
        for (place, change) in places.into_iter().zip(x) {
            y[place] = origin[place] + change;
        }
        session.place(session.time(), &y);
        Ok(())
    }

    /// Returns the continuous states as changes since the last event, or their rates, or their nominal
    /// values.
    pub fn states(&mut self, what: StateQuantity) -> Result<Vec<f64>, CallRefusal> {
        let places = self.continuous()?;
        let running = self.running()?;
        let all = match what {
            StateQuantity::Values => {
                running.session.state().iter().zip(&running.origin).map(|(y, origin)| y - origin).collect()
            }
            StateQuantity::Rates => running.rates(),
            StateQuantity::Sizes => {
                running.session.scale().iter().map(|size| SHARE_OF_SIZES * size).collect()
            }
        };
        let session = &running.session;
        finite_at(session, places.iter().map(|place| (*place, all[*place])))
            .map(|()| places.iter().map(|place| all[*place]).collect())
    }

    /// Returns whether the end of the tool's step needs an event. Modes may have to change, or the changes
    /// may have grown so large that they need a new origin to keep the tolerance small.
    pub fn is_due_behind_step(&mut self) -> Result<bool, CallRefusal> {
        let Running { session, origin, .. } = self.running()?;
        let rates = session.rates();
        finite_at(session, rates.into_iter().enumerate())?;
        let mut changes =
            session.state().iter().zip(&*origin).map(|(y, origin)| y - origin).zip(session.scale());
        let has_grown = changes.any(|(change, size)| change.abs() > MOST_CHANGE * size);
        Ok(has_grown || session.is_due_now() || session.events().iter().any(|value| *value <= 0.0))
    }

    /// Returns the event functions.
    pub fn events(&mut self) -> Result<Vec<f64>, CallRefusal> {
        Ok(self.running()?.session.events())
    }

    /// Applies pending commands and changes invalid modes. Changes of the states are counted from here.
    pub fn update(&mut self) -> Result<Update, CallRefusal> {
        let Running { session, origin, .. } = self.running()?;
        let before = session.state().to_vec();
        session.settle_schedule();
        session.change_modes()?;
        let states_changed = before != *origin || session.state() != before;
        origin.copy_from_slice(session.state());
        Ok(Update { states_changed, next: session.next_due() })
    }

    /// Continues from a time by a step, s.
    pub fn step(&mut self, from: f64, by: f64) -> Result<(), CallRefusal> {
        let now = self.time();
        if !(from.is_finite() && (from - now).abs() <= SAME_INSTANT * now.abs().max(1.0)) {
            return refuse(format!("the step begins at {from} s, but the present time is {now} s"));
        }
        if !(by.is_finite() && by >= 0.0) {
            return refuse(format!("the step of {by} s must be finite and not below zero"));
        }
        if let Some(law) = &mut self.law {
            return law.go_on((from + by).max(now), &self.values);
        }
        let session = &mut self.running()?.session;
        session.go_on((from + by).max(now), &mut Look::new(&mut |_| false))?;
        Ok(())
    }

    /// Returns derivatives of the unknowns in the direction `seed` of the knowns. With `adjoint`, the
    /// derivatives are those of the knowns in the direction `seed` of the unknowns.
    pub fn directional(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        adjoint: bool,
    ) -> Result<Vec<f64>, CallRefusal> {
        check_length("seeds", seed.len(), if adjoint { unknowns.len() } else { knowns.len() })?;
        let all: Vec<usize> =
            unknowns.iter().chain(knowns).map(|own| self.variable(*own)).collect::<Result<_, _>>()?;
        let (unknowns, knowns) = all.split_at(unknowns.len());
        let plan = self.plan.clone();
        let Running { session, places, .. } = self.running()?;
        let state_of = |at: usize| match &plan.variables[at].role {
            VariableRole::Output { of } | VariableRole::State { of } | VariableRole::Change { of } => {
                session.circuit().state_names().iter().position(|(name, _)| name == of)
            }
            _ => None,
        };
        let is_input = |at: usize| matches!(plan.variables[at].role, VariableRole::Input { .. });
        let name = |at: usize| &plan.variables[at].name;
        let inputs: Vec<usize> = knowns.iter().filter(|at| is_input(**at)).map(|&at| places[at]).collect();
        let linear = session.linearise(&inputs)?;
        let (n, m) = (linear.state.len(), inputs.len());
        let mut out = vec![0.0; if adjoint { knowns.len() } else { unknowns.len() }];
        for (i, &unknown) in unknowns.iter().enumerate() {
            let row = places[unknown];
            let (by_states, by_inputs) = match &plan.variables[unknown].role {
                VariableRole::Rate { .. } => (&linear.a[row * n..][..n], &linear.b[row * m..][..m]),
                VariableRole::Output { .. } => match linear.columns.iter().position(|own| *own == row) {
                    Some(row) => (&linear.c[row * n..][..n], &linear.d[row * m..][..m]),
                    None => return refuse(format!("{} has no derivative", name(unknown))),
                },
                _ => {
                    return refuse(format!(
                        "{} is not an unknown: derivatives and outputs are",
                        name(unknown)
                    ));
                }
            };
            let mut inputs = by_inputs.iter();
            for (k, &known) in knowns.iter().enumerate() {
                let slope = match state_of(known) {
                    _ if is_input(known) => inputs.next().copied(),
                    state => state.map(|state| by_states[state]),
                };
                let Some(slope) = slope else {
                    return refuse(format!("{} is not a known: states and inputs are", name(known)));
                };
                let (to, from) = if adjoint { (k, i) } else { (i, k) };
                out[to] += slope * seed[from];
            }
        }
        Ok(out)
    }
}

/// Refuses rates that are not finite. The places are those of their states.
fn finite_at(session: &Session, mut rates: impl Iterator<Item = (usize, f64)>) -> Result<(), CallRefusal> {
    match rates.find(|(_, rate)| !rate.is_finite()) {
        None => Ok(()),
        Some((place, _)) => Err(CallRefusal {
            message: format!(
                "the rate of {} is not finite at t = {} s. Try a shorter step, or a larger dead volume",
                session.circuit().state_names()[place].0,
                session.time()
            ),
            discard: true,
        }),
    }
}

/// Requested quantity of the continuous states.
#[derive(Clone, Copy, Debug)]
pub enum StateQuantity {
    Values,
    Rates,
    Sizes,
}

/// Refuses arrays of another length.
pub fn check_length(what: &str, given: usize, own: usize) -> Result<(), CallRefusal> {
    if given == own { Ok(()) } else { refuse(format!("{given} {what} are given; there are {own}")) }
}
