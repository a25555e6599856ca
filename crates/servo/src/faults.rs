//! Faults of sensors, valve, supply, computer and user in a run.

use crate::specification::{Fault, FaultKind, SensorChannel, Setup};
use control::{Commands, Inputs, Reference, Sample};

/// The faults of a run, with their state.
#[derive(Clone, Debug)]
pub struct Faults {
    each: Vec<Fault>,
    /// Value of a channel when it stuck.
    kept: Vec<Option<f64>>,
    /// The commands at which the valves stuck.
    stuck: Option<Commands>,
    /// Positions of limit switches, m.
    switches: Option<[f64; 2]>,
}

impl Faults {
    /// Returns the faults of an instrumentation.
    pub fn new(setup: &Setup) -> Self {
        let (each, switches) = (setup.faults.clone(), setup.switches_m);
        Faults { kept: vec![None; each.len()], each, stuck: None, switches }
    }

    fn at(&self, t: f64) -> impl Iterator<Item = &Fault> {
        self.each.iter().filter(move |own| own.acts(t))
    }

    /// Returns the corrupted sample that the law receives.
    pub fn spoil(&mut self, sample: &Sample) -> Sample {
        let mut seen = *sample;
        for (fault, kept) in self.each.iter().zip(&mut self.kept) {
            if !fault.acts(sample.time) {
                *kept = None;
                continue;
            }
            if fault.kind == FaultKind::Clock {
                seen.time -= fault.value.unwrap_or(0.0);
            }
            let place = match (fault.channel, &mut seen.pressures) {
                (Some(SensorChannel::Position), _) => &mut seen.position,
                (Some(SensorChannel::PressureA), Some([a, _])) => a,
                (Some(SensorChannel::PressureB), Some([_, b])) => b,
                _ => continue,
            };
            let is_first = kept.is_none();
            let value = fault.value.unwrap_or(0.0);
            *place = match fault.kind {
                FaultKind::Stuck => *kept.get_or_insert(*place),
                FaultKind::Nan => f64::NAN,
                FaultKind::Saturated => value,
                FaultKind::Offset => *place + value,
                FaultKind::Jump if is_first => {
                    *kept = Some(value);
                    *place + value
                }
                _ => *place,
            };
        }
        seen
    }

    /// Returns the inputs of the supervisor with the drive at x.
    pub fn inputs(&self, t: f64, x: f64) -> Inputs {
        let has = |kind| self.at(t).any(|own| own.kind == kind);
        Inputs {
            enabled: !has(FaultKind::EnableLost),
            emergency_stop: has(FaultKind::EmergencyStop),
            switches: self.switches.map_or([false; 2], |[low, high]| [x <= low, x >= high]),
            late: has(FaultKind::Late),
            ..Inputs::default()
        }
    }

    /// Returns the reference that the law receives in place of the intended one.
    pub fn reference(&self, t: f64) -> Option<Reference> {
        let lost = self.at(t).find(|own| own.kind == FaultKind::Reference)?;
        Some(Reference::Moves { start: lost.value.unwrap_or(f64::NAN), moves: vec![] })
    }

    /// Returns the commands on which the valves act.
    pub fn command(&mut self, t: f64, command: Commands) -> Commands {
        let kind = self.at(t).map(|own| own.kind).find(|kind| kind.is_of_valve());
        match kind {
            Some(FaultKind::ValveDead) => command.map(|_| 0.0),
            Some(_) => *self.stuck.get_or_insert(command),
            None => {
                self.stuck = None;
                command
            }
        }
    }

    /// Times, s, and pressures of the supply, Pa; `None`: its usual pressure.
    pub fn supply(&self) -> impl Iterator<Item = (f64, Option<f64>)> {
        let falls = self.each.iter().filter(|own| own.kind == FaultKind::SupplyFallen);
        falls.flat_map(|own| [(own.begin_s, own.value)].into_iter().chain(own.end_s.map(|end| (end, None))))
    }
}
