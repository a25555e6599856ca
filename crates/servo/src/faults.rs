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
    elsewhere: Reference,
}

impl Faults {
    /// Returns the faults of an instrumentation.
    pub fn new(setup: &Setup) -> Self {
        let (each, switches) = (setup.faults.clone(), setup.switches_m);
        Faults { kept: vec![None; each.len()], each, stuck: None, switches, elsewhere: standing(f64::NAN) }
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

    /// Returns the reference that the law receives.
    pub fn reference<'a>(&'a mut self, t: f64, reference: &'a Reference) -> &'a Reference {
        let lost = self.at(t).find(|own| own.kind == FaultKind::Reference).map(|own| own.value);
        match lost {
            Some(value) => {
                self.elsewhere = standing(value.unwrap_or(f64::NAN));
                &self.elsewhere
            }
            None => reference,
        }
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

    /// Interval in which the supply pressure falls.
    pub fn falls(&self) -> bool {
        self.each.iter().any(|own| own.kind == FaultKind::SupplyFallen)
    }

    /// Times, s, and pressures, Pa, of a supply of this pressure.
    pub fn supply(&self, pressure: f64) -> impl Iterator<Item = (f64, f64)> {
        let falls = self.each.iter().filter(|own| own.kind == FaultKind::SupplyFallen);
        falls.flat_map(move |own| {
            let back = own.end_s.map(|end| (end, pressure));
            [Some((own.begin_s, own.value.unwrap_or(pressure))), back].into_iter().flatten()
        })
    }
}

fn standing(at: f64) -> Reference {
    Reference::Moves { start: at, moves: vec![] }
}
