//! Random runs with faults: plants, references, laws and faults at random, and how fast the drive hits its end stops.

#[path = "../axis/mod.rs"]
pub mod axis;

use axis::{Loop, PERIOD, axis as reference_axis, begin, setup};
use circuit::Look;
use circuit::specification::Circuit;
use control::reference::PEAKS;
use control::{Controller, EventKind, Move, Reference};
use servo::Noise;
use servo::specification::{Fault, FaultKind, SensorChannel, Setup};

/// Controllers of the runs, one of them twice.
const DRAWN: [&str; 7] = ["pid", "inversion", "fuzzy", "sliding-mode", "super-twisting", "inversion", "nmpc"];
const STROKE: f64 = 0.5;
const DURATION: f64 = 1.5;
/// Speed of a hit that counts, m/s.
pub const HARD: f64 = 0.05;

/// Numbers at random, one after the other.
struct Draw {
    noise: Noise,
    next: u64,
}

impl Draw {
    fn share(&mut self) -> f64 {
        self.next += 1;
        self.noise.uniform(self.next)[1]
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + self.share() * (high - low)
    }

    /// Evenly distributed in the logarithm.
    fn factor(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.share())
    }

    fn one_of<T: Copy>(&mut self, each: &[T]) -> T {
        each[(self.share() * each.len() as f64) as usize % each.len()]
    }
}

/// What happens in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// No hit, or a slow one.
    Safe,
    /// A hard hit that full braking at once, by who knows all, would not have prevented.
    Unavoidable,
    /// A hard hit behind the loss of the valve, or of all sensors.
    Excused,
    /// Any other hard hit.
    Hit,
    /// The run could not go on.
    Failed,
}

/// A run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Words of the fault.
    pub fault: String,
    /// Of the law.
    pub law: &'static str,
    /// What happened.
    pub class: Class,
    /// Fastest hit, m/s.
    pub speed: f64,
    /// Words and times of what the supervisor told.
    pub told: String,
    /// Events before the first fault that speak of one.
    pub early: usize,
}

struct Run {
    plant: Circuit,
    law: &'static str,
    reference: Reference,
    setup: Setup,
}

fn plant(draw: &mut Draw) -> Circuit {
    let mut plant = reference_axis();
    for own in &mut plant.components {
        for (key, [low, high]) in [
            ("conductance", [0.8, 1.2]),
            ("moving_mass", [1.0, 1.6]),
            ("dead_volume_a", [0.8, 1.2]),
            ("dead_volume_b", [0.8, 1.2]),
            ("pressure", [0.92, 1.03]),
            ("frequency", [0.75, 1.25]),
            ("delay", [0.7, 1.4]),
            ("overlap", [0.25, 2.0]),
            ("leakage", [0.0, 2.0]),
            ("hysteresis", [0.0, 2.0]),
        ] {
            let factor = draw.within(low, high);
            own.numbers.get_mut(key).into_iter().for_each(|number| *number *= factor);
        }
        if let Some(friction) = &mut own.friction {
            let level = draw.within(0.7, 1.3);
            for (key, factor) in [
                ("coulomb", level),
                ("breakaway", level),
                ("viscous", draw.within(0.5, 1.5)),
                ("stribeck_velocity", draw.factor(0.5, 2.0)),
                ("bristle_stiffness", draw.factor(0.5, 2.0)),
            ] {
                *friction.parameters.get_mut(key).expect("a parameter") *= factor;
            }
        }
    }
    plant
}

/// Moves to the ends and back, or a sine, up to 2 m/s and 40 m/s2.
fn reference(draw: &mut Draw) -> Reference {
    if draw.share() < 0.3 {
        let amplitude = draw.within(0.02, 0.22);
        let fastest = (draw.within(0.2, 2.0) / amplitude).min((40.0 / amplitude).sqrt());
        let room = STROKE - 2.0 * amplitude - 0.02;
        let centre = 0.01 + amplitude + draw.share() * room;
        return Reference::Sine { centre, amplitude, frequency: fastest / std::f64::consts::TAU };
    }
    let start = draw.within(0.03, 0.47);
    let (mut t, mut from, mut moves) = (draw.within(0.05, 0.2), start, vec![]);
    for _ in 0..3 {
        let to = draw.within(0.01, 0.49);
        let way = f64::abs(to - from);
        let duration = (PEAKS[0] * way / draw.within(0.3, 2.0)).max((PEAKS[1] * way / 40.0).sqrt()).max(0.05);
        moves.push(Move { begin: t, duration, to });
        t += duration + draw.within(0.0, 0.3);
        from = to;
    }
    Reference::Moves { start, moves }
}

fn fault(draw: &mut Draw) -> Fault {
    const KINDS: [FaultKind; 13] = [
        FaultKind::Stuck,
        FaultKind::Nan,
        FaultKind::Saturated,
        FaultKind::Offset,
        FaultKind::Jump,
        FaultKind::Clock,
        FaultKind::ValveStuck,
        FaultKind::ValveDead,
        FaultKind::SupplyFallen,
        FaultKind::Late,
        FaultKind::Reference,
        FaultKind::EnableLost,
        FaultKind::EmergencyStop,
    ];
    let kind = draw.one_of(&KINDS);
    let channel = match kind {
        FaultKind::Stuck | FaultKind::Nan | FaultKind::Saturated | FaultKind::Offset | FaultKind::Jump => {
            Some(draw.one_of(&[
                SensorChannel::Position,
                SensorChannel::Position,
                SensorChannel::PressureA,
                SensorChannel::PressureB,
            ]))
        }
        _ => None,
    };
    let is_position = channel == Some(SensorChannel::Position);
    let sign = draw.one_of(&[-1.0, 1.0]);
    let value = match kind {
        FaultKind::Saturated if is_position => Some(draw.within(0.0, STROKE)),
        FaultKind::Saturated => Some(draw.within(0.0, 1e6)),
        FaultKind::Offset | FaultKind::Jump if is_position => Some(sign * draw.factor(1e-4, 0.2)),
        FaultKind::Offset | FaultKind::Jump => Some(sign * draw.factor(1e4, 4e5)),
        FaultKind::Clock => Some(sign * draw.factor(1e-3, 1.0)),
        FaultKind::SupplyFallen => Some(draw.within(1.5e5, 6e5)),
        FaultKind::Reference if sign > 0.0 => Some(draw.within(-0.1, 0.6)),
        _ => None,
    };
    let begin_s = draw.within(0.1, 0.8 * DURATION);
    let lasts = draw.factor(2e-3, 2.0);
    let end_s = (draw.share() < 0.7).then_some(begin_s + lasts);
    Fault { kind, channel, begin_s, end_s, value }
}

fn run_of(seed: u64, member: u32) -> Run {
    let mut draw = Draw { noise: Noise { seed, member, channel: 1000 }, next: 0 };
    let plant = plant(&mut draw);
    let usual = setup(seed ^ u64::from(member) << 20);
    let pressures = usual.pressures.filter(|_| draw.share() < 0.8);
    let mut faults = vec![fault(&mut draw)];
    if draw.share() < 0.1 {
        faults.push(fault(&mut draw));
    }
    Run {
        plant,
        law: draw.one_of(&DRAWN),
        reference: reference(&mut draw),
        setup: Setup {
            pressures,
            computing_time_s: draw.one_of(&[0.0, 0.3e-3]),
            jitter_s: [10e-6; 4],
            switches_m: draw.one_of(&[None, Some([0.005, STROKE - 0.005])]),
            faults,
            ..usual
        },
    }
}

impl Run {
    fn loop_of(&self) -> (Loop, Controller) {
        begin(reference_axis(), &self.plant, (self.law, None), &self.setup, self.reference.at(0.0).position)
    }

    /// The fastest hit, m/s, and the controller behind the run; with full braking at once from a time on, if there is one.
    fn fastest_hit(
        &self,
        brakes_from: Option<f64>,
        supervised: bool,
    ) -> Result<(f64, Controller), circuit::Error> {
        let (mut under, mut controller) = self.loop_of();
        controller.supervisor = controller.supervisor.filter(|_| supervised);
        let mut never = |_| false;
        let look = &mut Look::new(&mut never);
        let (mut fastest, mut before, mut way) = (0.0_f64, 0.0, None);
        for tick in 0..=(DURATION / PERIOD) as u64 {
            let turn = under.observe(tick, &mut controller, &self.reference, look)?;
            let [x, v, ..] = turn.truth;
            let outward = if x <= 0.0 { -1.0 } else { 1.0 };
            if x <= 0.0 || x >= STROKE {
                fastest = fastest.max(outward * v).max(outward * before);
            }
            before = v;
            let mut command = turn.answer.command;
            if brakes_from.is_some_and(|from| turn.sample.time >= from) {
                let own = *way.get_or_insert(v.signum());
                if own * v <= 0.0 {
                    break;
                }
                command = -own;
            }
            under.give(&mut controller, &turn, command)?;
        }
        Ok((fastest, controller))
    }
}

/// A run of a seed.
pub fn outcome(seed: u64, member: u32) -> Outcome {
    judged(&run_of(seed, member))
}

/// The same run without its faults. All its events are early.
pub fn healthy(seed: u64, member: u32) -> Outcome {
    let mut run = run_of(seed, member);
    run.setup.faults.clear();
    judged(&run)
}

fn judged(run: &Run) -> Outcome {
    let faults = &run.setup.faults;
    let words = faults.iter().map(|own| match own.channel {
        Some(channel) => format!("{:?} {channel:?}", own.kind),
        None => format!("{:?}", own.kind),
    });
    let fault = words.collect::<Vec<_>>().join(" + ");
    let (speed, controller) = match run.fastest_hit(None, true) {
        Ok(found) => found,
        Err(error) => {
            return Outcome {
                fault,
                law: run.law,
                class: Class::Failed,
                speed: 0.0,
                told: error.to_string(),
                early: 0,
            };
        }
    };
    let log = &controller.supervisor.as_ref().expect("a supervisor").log;
    let first = faults.iter().map(|own| own.begin_s).fold(f64::INFINITY, f64::min);
    let early = (log.events.iter())
        .filter(|own| own.time < first && ![EventKind::EndStop, EventKind::LimitSwitch].contains(&own.kind))
        .count();
    let told = log.events.iter().map(|own| format!("{:.3} {} {:.3}", own.time, own.kind.key(), own.value));
    let told = told.collect::<Vec<_>>().join(", ");
    let loses = |own: &Fault| {
        let position = own.channel == Some(SensorChannel::Position) && own.kind != FaultKind::Jump;
        own.kind.is_of_valve() || position && run.setup.pressures.is_none()
    };
    let class = if speed <= HARD {
        Class::Safe
    } else if faults.iter().any(loses) {
        Class::Excused
    } else {
        let best = run.fastest_hit(first.is_finite().then_some(first), true).map_or(0.0, |found| found.0);
        if best > HARD && !faults.is_empty() { Class::Unavoidable } else { Class::Hit }
    };
    Outcome { fault, law: run.law, class, speed, told, early }
}

/// Whether the run without a supervisor ends in a hard hit, or cannot go on.
pub fn is_lost_alone(seed: u64, member: u32) -> bool {
    run_of(seed, member).fastest_hit(None, false).map_or(true, |found| found.0 > HARD)
}
