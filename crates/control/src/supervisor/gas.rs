//! Pressures against the model of the gas: sensors, valve and supply.

use super::event::{EventKind, Log};
use super::rules::Believed;
use crate::model::ConstantGas;
use crate::thresholds::*;
use crate::types::Moment;

/// State of the check of a chamber's pressure.
#[derive(Clone, Copy, Debug, Default)]
struct Chamber {
    last: f64,
    /// Samples since the reading changed, and the change of the pressure by the model since then, Pa.
    rests: u32,
    moved: f64,
    /// Count of successive readings that are not a number or jump.
    bad: u32,
    is_lost: bool,
    /// Whether the last opening of the valve connected the chamber with the supply.
    fills: bool,
    /// The least filling rates that a supply would have caused at the last samples, Pa/s, and the missing pressure, Pa.
    least: [f64; SUPPLY_LATE],
    lacks: f64,
}

impl Chamber {
    /// The reading has rested for long.
    fn rests_for(&self, period: f64) -> bool {
        f64::from(self.rests) * period >= PRESSURE_OFF_FOR
    }

    /// The reading has rested for long, while the model moved by more than [`PRESSURE_OFF`].
    fn is_stuck(&self, period: f64) -> bool {
        self.rests_for(period) && self.moved.abs() > PRESSURE_OFF
    }

    /// Compares a reading with the model, whose `rates` are those of [`rates`]. A reading is bad if it is not a number,
    /// or jumps by more than [`PRESSURE_OFF`] and a completely open valve explain. Returns the changes by flow, Pa:
    /// measured, by the model, and by the model on a fallen supply, or `None` if the reading is not credible or rests.
    /// The truth value tells whether the supply fails to fill the chamber.
    fn read(&mut self, reading: f64, i: usize, by: &Believed, rates: [f64; 3]) -> (Option<[f64; 3]>, bool) {
        let Believed { at: Moment { period, .. }, model, last, foreseen, edges } = *by;
        let [open, weak, shut] = rates;
        let measured = reading - self.last - shut * period;
        let is_same = reading == self.last;
        (self.rests, self.moved) = if is_same { (self.rests + 1, self.moved) } else { (0, 0.0) };
        self.moved += open * period - self.moved * period / (period + PRESSURE_FOLLOWS);
        let before = std::mem::replace(&mut self.last, reading);
        // A jump is faster than any valve fills a chamber.
        let most = PRESSURE_OFF + (model.most_rate(i, last.position) + shut.abs()) * period;
        let jumps = (reading - foreseen.pressures[i]).abs() > most;
        self.bad = if reading.is_finite() && !jumps { 0 } else { self.bad + 1 };
        let is_good = self.bad == 0 && !self.is_lost;
        let [supplied, vented] = edges[i];
        self.fills = if supplied == vented { self.fills } else { supplied > vented };
        // A resting reading does not show the flow.
        let tells = is_good && before.is_finite() && f64::from(self.rests) * period < 0.25 * PRESSURE_OFF_FOR;
        let starves = self.starves(supplied - vented, weak - shut, tells.then_some(measured), period);
        (tells.then_some([measured, (open - shut) * period, (weak - shut) * period]), starves)
    }

    /// Returns whether the supply fails to fill the chamber. `open` is how far the valve opens it to the supply.
    /// `rate` is the pressure rate that a fallen supply would give, Pa/s. `flowed` is the measured pressure change by
    /// flow, Pa, if its reading is credible.
    fn starves(&mut self, open: f64, rate: f64, flowed: Option<f64>, period: f64) -> bool {
        self.least.rotate_right(1);
        let [share, sure] = if rate > 0.0 {
            [1.0 - SUPPLY_LESS, (open - SUPPLY_HARDLY_OPEN).min(SUPPLY_SAGS)]
        } else {
            [1.0 + SUPPLY_LESS, open + SUPPLY_HARDLY_OPEN]
        };
        self.least[0] = if open > SUPPLY_HARDLY_OPEN { share * rate * sure / open } else { f64::NAN };
        let is_open = self.least.iter().all(|own| own.is_finite());
        self.lacks = match flowed {
            Some(flowed) if is_open => {
                let least = self.least.iter().copied().fold(f64::INFINITY, f64::min);
                (self.lacks + (least * period - flowed).min(SUPPLY_AT_ONCE * SUPPLY_LACKS)).max(0.0)
            }
            _ => self.lacks * (1.0 - period / SUPPLY_FORGOTTEN).max(0.0),
        };
        self.lacks > SUPPLY_LACKS
    }
}

/// Pressures by the model, to compare with the measured ones.
#[derive(Clone, Debug, Default)]
pub struct Gas {
    chambers: Option<[Chamber; 2]>,
    /// Pressure changes by flow, Pa, of the filling chamber, then of the other one. Each has three values: measured,
    /// by the model, and by the model on a fallen supply.
    flown: [[f64; 3]; 2],
    /// The same within a shorter time.
    lately: [[f64; 3]; 2],
    /// For how long the supply has been too low, s.
    low_for: f64,
    supply_told: bool,
    /// The supply did not fill a chamber at this pressure, Pa.
    below: Option<f64>,
    valve_told: bool,
}

/// Findings from the pressures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GasFindings {
    /// A sensor was lost with this sample.
    pub sensor: bool,
    /// The valve did not react from this sample on.
    pub valve: bool,
    /// The supply was low from this sample on.
    pub supply: bool,
    /// The supply was too low to fill a chamber.
    pub starved: bool,
    /// The pressure of a chamber comes from the model, or its reading is constant, so nothing is learned from it.
    pub modelled: bool,
}

/// Returns the rates of both pressures by the model, Pa/s: with the openings of the valve, with these openings on a
/// fallen supply, and with the valve shut.
fn rates(believed: &Believed) -> [[f64; 2]; 3] {
    let Believed { model, last, edges, .. } = *believed;
    let supply = &model.supply;
    let fallen = ConstantGas { pressure: supply.pressure - SUPPLY_FALLEN, ..*supply };
    [(supply, edges), (&fallen, edges), (supply, [[0.0; 2]; 2])].map(|(supply, edges)| {
        model.chambers_on(supply, [last.position, last.velocity], last.gas(), edges).pressure_rates
    })
}

impl Gas {
    /// Whether a sensor or the valve does not react.
    pub fn is_lost(&self) -> bool {
        self.valve_told || self.lacks_sensor()
    }

    /// Replaces readings that are not credible by the prediction of the model.
    pub fn checked(&mut self, readings: &mut [f64; 2], believed: &Believed, log: &mut Log) -> GasFindings {
        let Believed { at: Moment { time, period }, foreseen, .. } = *believed;
        let mut chambers = self.chambers.unwrap_or([Chamber { last: f64::NAN, ..Chamber::default() }; 2]);
        let rates = rates(believed);
        let (mut found, mut starved) = (GasFindings::default(), None);
        for (i, own) in chambers.iter_mut().enumerate() {
            let (changes, starves) = own.read(readings[i], i, believed, rates.map(|rate| rate[i]));
            if let Some(changes) = changes {
                // A late change, after the valve has shut, belongs to the flow before.
                let side = usize::from(!own.fills);
                for (flown, time) in
                    [(&mut self.flown, PRESSURE_FOLLOWS), (&mut self.lately, SUPPLY_FALLEN_FOR)]
                {
                    let share = period / (period + time);
                    for (own, change) in flown[side].iter_mut().zip(changes) {
                        *own += change - share * *own;
                    }
                }
            }
            if starves {
                starved = Some(readings[i]);
            }
            if own.bad >= PRESSURE_LOST && !own.is_lost {
                own.is_lost = true;
                found.sensor = true;
                log.tell(time, EventKind::PressureLost, i as f64);
            }
        }
        // Nothing is learned from a resting reading. A chamber whose sensor is lost continues by the model.
        found.modelled = chambers.iter().any(|own| own.rests_for(period));
        let mut replaced = foreseen.pressures;
        self.find_stuck(believed.at, &mut chambers, &mut replaced, &mut found, log);
        self.chambers = Some(chambers);
        self.watch_supply(believed, starved, &mut found, log);
        for ((own, reading), replaced) in chambers.iter().zip(readings).zip(&replaced) {
            if own.bad > 0 || own.is_lost {
                *reading = *replaced;
                found.modelled = true;
            }
        }
        found
    }

    /// Finds readings that rest while the model moves. If both rest, the valve does not react.
    fn find_stuck(
        &mut self,
        at: Moment,
        chambers: &mut [Chamber; 2],
        replaced: &mut [f64; 2],
        found: &mut GasFindings,
        log: &mut Log,
    ) {
        let stuck = chambers.map(|own| own.is_stuck(at.period) && !own.is_lost && !self.valve_told);
        if stuck == [true; 2] {
            (self.valve_told, found.valve) = (true, true);
            log.tell(at.time, EventKind::Valve, chambers[0].moved.abs().max(chambers[1].moved.abs()));
        } else if let Some(i) = stuck.iter().position(|is_stuck| *is_stuck) {
            let own = &mut chambers[i];
            (own.is_lost, found.sensor) = (true, true);
            log.tell(at.time, EventKind::PressureLost, i as f64);
            replaced[i] = own.last + own.moved;
        }
    }

    /// Watches the supply. Both chambers share the valve, so the other chamber gives its conductance. The fall of the
    /// supply in units of [`SUPPLY_FALLEN`] is
    ///
    ///   (q_fill,model - q_fill q_vent,model/q_vent)/(q_fill,model - q_fill,fallen)
    ///
    /// with the changes q of the pressures by flow. A chamber that the supply does not fill is `starved`, Pa.
    fn watch_supply(&mut self, by: &Believed, starved: Option<f64>, found: &mut GasFindings, log: &mut Log) {
        let Believed { at, model, .. } = *by;
        let [[filled, fills, weakly], [vented, vents, _]] = self.flown;
        let seen = |flown: f64| fills > flown && vents < -flown && vented < 0.0;
        let falls =
            if seen(SUPPLY_DOUBTED) { (fills - filled * vents / vented) / (fills - weakly) } else { 0.0 };
        self.low_for = if falls > 1.0 && seen(SUPPLY_FLOWN) { self.low_for + at.period } else { 0.0 };
        let low = self.low_for >= SUPPLY_FALLEN_FOR && !self.supply_told;
        if low {
            let [ambient, supply] = [model.ambient.pressure, model.supply.pressure];
            log.tell(at.time, EventKind::Supply, (supply - falls * SUPPLY_FALLEN).max(ambient));
        }
        self.supply_told |= low;
        found.supply = low;
        let (Some(pressure), None, false) = (starved, self.below, self.valve_told) else { return };
        let [_, [vented, vents, _]] = self.lately;
        if vents < -0.5 * SUPPLY_DOUBTED && vented > SUPPLY_VENTS * vents {
            // The other chamber does not vent: the valve is at fault.
            (self.valve_told, found.valve) = (true, true);
            log.tell(at.time, EventKind::Valve, vented - vents);
            return;
        }
        if !self.supply_told {
            log.tell(at.time, EventKind::Supply, pressure);
        }
        (self.supply_told, self.below) = (true, Some(pressure));
        (found.supply, found.starved) = (true, true);
    }

    /// The supply has fallen.
    pub fn has_no_supply(&self) -> bool {
        self.supply_told
    }

    /// The pressure of a chamber that the supply did not fill, Pa.
    pub fn supplied_below(&self) -> Option<f64> {
        self.below
    }

    /// A pressure is not measured any more.
    fn lacks_sensor(&self) -> bool {
        self.chambers.is_some_and(|own| own.iter().any(|own| own.is_lost))
    }

    /// It is not certain that the supply pressure acts: it has fallen, or a pressure is not measured.
    pub fn may_lack_supply(&self) -> bool {
        self.supply_told || self.lacks_sensor()
    }
}
