//! A controller as a tool runs it: samples in, and a command out at each multiple of the period.

use crate::plan::{LawPlan, Variable, VariableRole};
use crate::refusal::{CallRefusal, SAME_INSTANT, refuse};
use control::{Answer, Controller, Inputs, Reference, Sample};

/// Inputs by the names of their variables.
const INPUTS: [&str; 5] = ["position", "pressure_a", "pressure_b", "enabled", "emergency_stop"];

/// A running controller.
#[derive(Clone)]
pub struct RunningLaw {
    controller: Controller,
    reference: Reference,
    /// Indices of the [`INPUTS`] among the variables. Without pressure sensors, these indices are absent.
    inputs: [Option<usize>; INPUTS.len()],
    t0: f64,
    /// Time, s.
    pub time: f64,
    /// Index of the next sample.
    tick: u64,
    answer: Option<Answer>,
}

impl RunningLaw {
    /// Creates a controller from a plan, at a start time, s.
    pub fn new(plan: &LawPlan, variables: &[Variable], t0: f64) -> Result<Self, CallRefusal> {
        let (controller, _) = servo::controller(&plan.controller, plan.position.deviation())?;
        let place = |name| {
            variables.iter().position(|own| matches!(&own.role, VariableRole::Input { of, .. } if of == name))
        };
        let (reference, inputs) = (plan.motion.clone(), INPUTS.map(place));
        Ok(RunningLaw { controller, reference, inputs, t0, time: t0, tick: 0, answer: None })
    }

    /// Continues to a time, s. All samples before that time use the present inputs.
    pub fn go_on(&mut self, until: f64, values: &[f64]) -> Result<(), CallRefusal> {
        let [x, a, b, enabled, stop] = self.inputs.map(|place| place.map(|place| values[place]));
        let Some(position) = x else { return refuse("the description has no input \"position\"") };
        let period = self.controller.period;
        loop {
            let time = self.tick as f64 * period;
            if self.t0 + time >= until - SAME_INSTANT * until.abs().max(1.0) {
                break;
            }
            if let Some(supervisor) = &mut self.controller.supervisor {
                let enabled = enabled.is_none_or(|value| value > 0.5);
                let emergency_stop = stop.is_some_and(|value| value > 0.5);
                supervisor.inputs = Inputs { enabled, emergency_stop, ..Inputs::default() };
            }
            let sample = Sample { time, position, pressures: a.zip(b).map(|(a, b)| [a, b]) };
            let answer = self.controller.step(&sample, &self.reference);
            if !answer.command.is_finite() {
                return refuse(format!("the controller gives no finite command at t = {} s", self.t0 + time));
            }
            (self.answer, self.tick) = (Some(answer), self.tick + 1);
        }
        self.time = until;
        Ok(())
    }

    /// Returns an output of the last step. Before the first step, the valve is at rest.
    pub fn output(&self, name: &str) -> Option<f64> {
        let wanted = self.answer.map_or_else(|| self.reference.at(0.0), |own| own.wanted);
        let of = |number: fn(&Answer) -> f64| self.answer.as_ref().map_or(0.0, number);
        Some(match name {
            "command" => of(|own| own.command),
            "reference" => wanted.position,
            "reference_velocity" => wanted.velocity,
            "estimated_velocity" => of(|own| own.velocity),
            "disturbance" => of(|own| own.disturbance),
            "holds" => of(|own| f64::from(u8::from(own.holds))),
            "events" => self.controller.supervisor.as_ref().map_or(0, |own| own.log.events.len()) as f64,
            _ => return None,
        })
    }
}
