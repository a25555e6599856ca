//! Pressures against a twin of the gas: sensors, valve and supply.

use super::event::{EventKind, Log};
use crate::model::{Edges, Held, Model};
use crate::observer::State;

/// Distance from the twin at which a pressure is not credible, Pa, and for how long, s (assumed).
const OFF: f64 = 0.3e5;
const FOR: f64 = 0.02;
/// Time in which the twin follows the measured pressures, s, and the share of the flow into a chamber by which the model of
/// valve and supply may be wrong (assumed).
const FOLLOWS: f64 = 0.1;
const FLOW_SHARE: f64 = 0.4;
/// Readings in a row that are not credible until a sensor is lost (assumed).
const LOST: u32 = 3;
/// Fall of the supply that is told, Pa, for how long, s, and the change of a pressure by flow, Pa, from which on it is seen
/// (assumed).
const FALLEN: f64 = 1e5;
const FALLEN_FOR: f64 = 0.03;
const FLOWN: f64 = 0.5e5;
/// The change from which on a supply is doubted, Pa (assumed).
const DOUBTED: f64 = 0.2e5;

/// What a chamber tells.
#[derive(Clone, Copy, Debug, Default)]
struct Chamber {
    pressure: f64,
    temperature: f64,
    last: f64,
    /// Samples since the reading changed.
    rests: u32,
    /// What the model may be wrong by, Pa.
    unsure: f64,
    /// For how long the reading has been off, s.
    off_for: f64,
    /// Readings in a row that are no number or jump.
    bad: u32,
    is_lost: bool,
}

/// Pressures by the model beside the measured ones.
#[derive(Clone, Debug, Default)]
pub struct Gas {
    chambers: Option<[Chamber; 2]>,
    /// Changes by flow, Pa, of the filling chamber, then of the other one: as they were measured, by the model, and by the
    /// model on a supply that has fallen.
    flown: [[f64; 3]; 2],
    /// For how long the supply has been too low, s.
    low_for: f64,
    supply_told: bool,
    /// The last filling that was seen was that of a supply that has fallen.
    pub is_doubted: bool,
    valve_told: bool,
}

/// What the pressures say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// A sensor was lost with this sample.
    pub sensor: bool,
    /// The valve did not answer from this sample on.
    pub valve: bool,
    /// The supply was low from this sample on.
    pub supply: bool,
    /// A chamber runs by the model.
    pub modelled: bool,
}

impl Gas {
    /// Whether a sensor or the valve does not answer.
    pub fn is_lost(&self) -> bool {
        self.valve_told || self.chambers.is_some_and(|own| own.iter().any(|own| own.is_lost))
    }

    /// Readings that are not credible become what the model foresees; `state` is that of the observer before the sample, `seen` that
    /// which it foresees, `edges` how far edges were open between them.
    pub fn checked(
        &mut self,
        model: &Model,
        (time, readings): (f64, &mut [f64; 2]),
        (state, seen): (&State, &State),
        (edges, period): (Edges<f64>, f64),
        log: &mut Log,
    ) -> Found {
        let mut found = Found::default();
        let chambers = self.chambers.get_or_insert_with(|| {
            [0, 1].map(|i| Chamber {
                pressure: state.pressures[i],
                temperature: state.temperatures[i],
                last: f64::NAN,
                ..Chamber::default()
            })
        });
        // The twin goes the observer's way with pressures of its own.
        let mut twin = State {
            pressures: chambers.map(|own| own.pressure),
            temperatures: chambers.map(|own| own.temperature),
            ..*state
        };
        let contents = model.contents(twin.position, twin.pressures, twin.temperatures);
        let at = |openings| model.chambers([twin.position, twin.velocity], contents, openings).pressure_rates;
        let (open, shut) = (at(edges), at([[0.0; 2]; 2]));
        let fallen = Held { pressure: model.supply.pressure - FALLEN, ..model.supply };
        let weak = model.chambers_on(&fallen, [twin.position, twin.velocity], contents, edges).pressure_rates;
        twin.advance(model, edges, period, None);
        let share = period / (period + FOLLOWS);
        for i in 0..2 {
            let own = &mut chambers[i];
            let reading = readings[i];
            let by_flow = (open[i] - shut[i]) * period;
            own.unsure += FLOW_SHARE * by_flow.abs() - share * own.unsure;
            let measured = reading - own.last - shut[i] * period;
            own.rests = if reading == own.last { own.rests + 1 } else { 0 };
            let before = own.last;
            own.last = reading;
            // Faster than any valve fills a chamber.
            let most = OFF + (model.most_rate(i, twin.position) + shut[i].abs()) * period;
            let jumps = (reading - seen.pressures[i]).abs() > most;
            own.bad = if reading.is_finite() && !jumps { 0 } else { own.bad + 1 };
            let off = reading - twin.pressures[i];
            own.off_for = if off.abs() > OFF + own.unsure { own.off_for + period } else { 0.0 };
            let is_good = own.bad == 0 && !own.is_lost;
            own.pressure = twin.pressures[i] + if is_good { share * off } else { 0.0 };
            own.temperature = twin.temperatures[i];
            // A reading that rests says nothing of a flow.
            if is_good && before.is_finite() && f64::from(own.rests) * period < 0.25 * FOR {
                let is_first = [edges[0][0] > edges[0][1], edges[1][1] > edges[1][0]][i];
                let side = usize::from(is_first != (i == 0));
                let changes = [measured, by_flow, (weak[i] - shut[i]) * period];
                for (own, change) in self.flown[side].iter_mut().zip(changes) {
                    *own += change - share * *own;
                }
            }
            if own.bad >= LOST && !own.is_lost {
                own.is_lost = true;
                found.sensor = true;
                log.tell(time, EventKind::PressureLost, i as f64);
            }
        }
        let stuck = chambers.map(|own| f64::from(own.rests) * period >= FOR);
        let off = chambers.map(|own| own.off_for >= FOR && !own.is_lost);
        let both = off[0] && off[1] && stuck[0] == stuck[1];
        if both && !self.valve_told {
            self.valve_told = true;
            found.valve = true;
            let away = |i: usize| (chambers[i].last - chambers[i].pressure).abs();
            log.tell(time, EventKind::Valve, away(0).max(away(1)));
        }
        for i in 0..2 {
            // Another chamber that begins to leave the model, too, speaks of the valve.
            let [own, other] = [&chambers[i], &chambers[1 - i]];
            // What a supply that has fallen does not fill.
            let is_starved = self.supply_told && own.last < own.pressure;
            let alone = stuck[i] || (other.off_for == 0.0 && own.off_for >= 2.0 * FOR && !is_starved);
            if off[i] && !both && alone && !self.valve_told && self.low_for == 0.0 {
                chambers[i].is_lost = true;
                found.sensor = true;
                log.tell(time, EventKind::PressureLost, i as f64);
            }
        }
        found.supply = self.watch_supply(model, (time, period), log);
        if let Some(chambers) = &self.chambers {
            for ((own, reading), foreseen) in chambers.iter().zip(readings).zip(&seen.pressures) {
                if own.bad > 0 || own.is_lost {
                    *reading = *foreseen;
                    found.modelled = true;
                }
            }
        }
        found
    }

    /// Both chambers share the valve: what the filling one falls short of beside the other one is the supply's.
    fn watch_supply(&mut self, model: &Model, (time, period): (f64, f64), log: &mut Log) -> bool {
        let [[filled, fills, weakly], [vented, vents, _]] = self.flown;
        let seen = |flown: f64| fills > flown && vents < -flown && vented < 0.0;
        // The flow that the other chamber makes of the valve, and by how many falls the filling one lacks it.
        let falls = if seen(DOUBTED) { (fills - filled * vents / vented) / (fills - weakly) } else { 0.0 };
        if fills > DOUBTED {
            self.is_doubted = falls > 1.0 || filled < (1.0 - FLOW_SHARE) * weakly;
        }
        self.low_for = if falls > 1.0 && seen(FLOWN) { self.low_for + period } else { 0.0 };
        let told = self.low_for >= FALLEN_FOR && !self.supply_told;
        if told {
            self.supply_told = true;
            let [ambient, supply] = [model.ambient.pressure, model.supply.pressure];
            log.tell(time, EventKind::Supply, (supply - falls * FALLEN).max(ambient));
        }
        told
    }

    /// The supply has fallen.
    pub fn has_no_supply(&self) -> bool {
        self.supply_told
    }

    /// Nobody knows that the supply presses: it has fallen, or a pressure is not measured.
    pub fn may_lack_supply(&self) -> bool {
        let is_lost = self.chambers.is_some_and(|own| own.iter().any(|own| own.is_lost));
        self.supply_told || is_lost
    }
}
