//! Pressures against a twin of the gas: sensors, valve and supply.

use super::event::{EventKind, Log};
use super::rules::Believed;
use crate::model::{ConstantGas, Model};
use crate::thresholds::*;
use crate::types::{Moment, State};

/// State of the check of a chamber's pressure.
#[derive(Clone, Copy, Debug, Default)]
struct Chamber {
    pressure: f64,
    temperature: f64,
    last: f64,
    /// Samples since the reading changed.
    rests: u32,
    /// Uncertainty of the model, Pa.
    unsure: f64,
    /// For how long the reading has been off, s.
    off_for: f64,
    /// Count of successive readings that are not a number or jump.
    bad: u32,
    is_lost: bool,
    /// Whether the last opening of the valve connected the chamber with the supply.
    fills: bool,
    /// The least filling rates that a supply would have caused at the last samples, Pa/s, and the missing pressure, Pa.
    least: [f64; SUPPLY_LATE],
    lacks: f64,
}

/// Quantities of a chamber that the model expects for a sample. Rates in Pa/s.
#[derive(Clone, Copy, Debug)]
struct Expected {
    /// State of the twin.
    pressure: f64,
    temperature: f64,
    /// Pressure by the observer, Pa.
    foreseen: f64,
    /// Rates of the twin by flow, and of a completely open valve.
    flow: f64,
    full: f64,
    /// Rates of the observed gas with the openings of the valve, on a fallen supply, and with the valve shut.
    open: f64,
    weak: f64,
    shut: f64,
    /// Openings to the supply and to the exhaust.
    edges: [f64; 2],
}

/// Findings about a chamber's reading.
#[derive(Clone, Copy, Debug)]
struct ChamberFindings {
    /// Changes by flow, Pa: measured, by the model, and by the model on a fallen supply. `None`: the reading is not
    /// credible, or rests.
    changes: Option<[f64; 3]>,
    /// The supply fails to fill the chamber.
    starves: bool,
}

impl Chamber {
    /// The reading has rested for long.
    fn rests_for(&self, period: f64) -> bool {
        f64::from(self.rests) * period >= PRESSURE_OFF_FOR
    }

    /// Compares a reading p with the twin p_t, and lets the twin follow it. A reading is bad if it is not a
    /// number, or jumps by more than [`PRESSURE_OFF`] and a completely open valve explain. It is off if
    ///
    ///   |p - p_t| > PRESSURE_OFF + u,   u' = max(0.4 |q|, min(|q|, 0.025 q_full)) - u/tau
    ///
    /// with the uncertainty u of the twin, its rate by flow q, and tau = [`PRESSURE_FOLLOWS`].
    fn read(&mut self, reading: f64, by: &Expected, period: f64) -> ChamberFindings {
        let share = period / (period + PRESSURE_FOLLOWS);
        let unsure = (PRESSURE_FLOW * by.flow).max(by.flow.min(PRESSURE_HARDLY_OPEN * by.full));
        self.unsure += unsure * period - share * self.unsure;
        let measured = reading - self.last - by.shut * period;
        self.rests = if reading == self.last { self.rests + 1 } else { 0 };
        let before = std::mem::replace(&mut self.last, reading);
        // A jump is faster than any valve fills a chamber.
        let most = PRESSURE_OFF + (by.full + by.shut.abs()) * period;
        let jumps = (reading - by.foreseen).abs() > most;
        self.bad = if reading.is_finite() && !jumps { 0 } else { self.bad + 1 };
        let off = reading - by.pressure;
        // A reading that rests while the model moves is off, however uncertain the flow is.
        let unsure = if self.rests_for(period) { 0.0 } else { self.unsure };
        let is_off = off.abs() > PRESSURE_OFF + unsure;
        self.off_for = if is_off { self.off_for + period } else { 0.0 };
        if is_off && self.rests_for(period) {
            self.off_for = self.off_for.max(PRESSURE_OFF_FOR);
        }
        let is_good = self.bad == 0 && !self.is_lost;
        self.pressure = by.pressure + if is_good { share * off } else { 0.0 };
        self.temperature = by.temperature;
        let [supplied, vented] = by.edges;
        self.fills = if supplied == vented { self.fills } else { supplied > vented };
        // A resting reading does not show the flow.
        let tells = is_good && before.is_finite() && f64::from(self.rests) * period < 0.25 * PRESSURE_OFF_FOR;
        let (flow, weak) = ((by.open - by.shut) * period, by.weak - by.shut);
        let starves = self.starves(supplied - vented, weak, tells.then_some(measured), period);
        ChamberFindings { changes: tells.then_some([measured, flow, weak * period]), starves }
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

/// Returns what the model expects of both chambers a period later. The twin has the observer's motion and separate
/// pressures.
fn expected(chambers: &[Chamber; 2], believed: &Believed, period: f64) -> [Expected; 2] {
    let Believed { model, last: state, foreseen, edges } = *believed;
    let mut twin = State {
        pressures: chambers.map(|own| own.pressure),
        temperatures: chambers.map(|own| own.temperature),
        ..*state
    };
    let place = [twin.position, twin.velocity];
    let at = |gas: &State, supply: &ConstantGas, openings| {
        model.chambers_on(supply, place, gas.gas(), openings).pressure_rates
    };
    let (described, closed) = (&model.supply, [[0.0; 2]; 2]);
    let (modelled, still) = (at(&twin, described, edges), at(&twin, described, closed));
    // A fallen supply is detected from the actual state of the gas, not from its state on the described supply.
    let fallen = ConstantGas { pressure: described.pressure - SUPPLY_FALLEN, ..*described };
    let (open, weak, shut) =
        (at(state, described, edges), at(state, &fallen, edges), at(state, described, closed));
    twin.advance(model, edges, period, None);
    [0, 1].map(|i| Expected {
        pressure: twin.pressures[i],
        temperature: twin.temperatures[i],
        foreseen: foreseen.pressures[i],
        flow: (modelled[i] - still[i]).abs(),
        full: model.most_rate(i, twin.position),
        open: open[i],
        weak: weak[i],
        shut: shut[i],
        edges: edges[i],
    })
}

impl Gas {
    /// Whether a sensor or the valve does not react.
    pub fn is_lost(&self) -> bool {
        self.valve_told || self.lacks_sensor()
    }

    /// Replaces readings that are not credible by the prediction of the model.
    pub fn checked(
        &mut self,
        moment: Moment,
        readings: &mut [f64; 2],
        believed: &Believed,
        log: &mut Log,
    ) -> GasFindings {
        let Moment { time, period } = moment;
        let Believed { model, last: state, foreseen, .. } = *believed;
        let mut chambers = self.chambers.unwrap_or_else(|| {
            [0, 1].map(|i| Chamber {
                pressure: state.pressures[i],
                temperature: state.temperatures[i],
                last: f64::NAN,
                ..Chamber::default()
            })
        });
        let expected = expected(&chambers, believed, period);
        let (mut found, mut starved) = (GasFindings::default(), None);
        for (i, own) in chambers.iter_mut().enumerate() {
            let shown = own.read(readings[i], &expected[i], period);
            if let Some(changes) = shown.changes {
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
            if shown.starves {
                starved = Some(readings[i]);
            }
            if own.bad >= PRESSURE_LOST && !own.is_lost {
                own.is_lost = true;
                found.sensor = true;
                log.tell(time, EventKind::PressureLost, i as f64);
            }
        }
        // Nothing is learned from a resting reading. A chamber whose sensor is lost continues from the twin.
        found.modelled = chambers.iter().any(|own| own.rests_for(period));
        let mut replaced = foreseen.pressures;
        self.blame(moment, &mut chambers, &mut replaced, &mut found, log);
        self.chambers = Some(chambers);
        self.watch_supply(model, moment, starved, &mut found, log);
        for ((own, reading), replaced) in chambers.iter().zip(readings).zip(&replaced) {
            if own.bad > 0 || own.is_lost {
                *reading = *replaced;
                found.modelled = true;
            }
        }
        found
    }

    /// Finds the cause if readings have been off for [`PRESSURE_OFF_FOR`]. If both chambers are off, it is the valve.
    /// If one is off alone, it is its sensor. A chamber that lacks air on a low supply is not at fault.
    fn blame(
        &mut self,
        at: Moment,
        chambers: &mut [Chamber; 2],
        replaced: &mut [f64; 2],
        found: &mut GasFindings,
        log: &mut Log,
    ) {
        let Moment { time, period } = at;
        let stuck = chambers.map(|own| own.rests_for(period));
        let off = chambers.map(|own| own.off_for >= PRESSURE_OFF_FOR && !own.is_lost);
        let both = off[0] && off[1] && stuck[0] == stuck[1];
        // On a low supply, both chambers leave the twin, which is on the described supply.
        if both && !self.valve_told && !self.supply_told {
            self.valve_told = true;
            found.valve = true;
            let away = |i: usize| (chambers[i].last - chambers[i].pressure).abs();
            log.tell(time, EventKind::Valve, away(0).max(away(1)));
        }
        for i in 0..2 {
            // If the other chamber begins to leave the model too, the fault is the valve's.
            let [own, other] = [&chambers[i], &chambers[1 - i]];
            let is_starved = self.supply_told && own.last < own.pressure;
            let alone = (stuck[i] && !stuck[1 - i])
                || (other.off_for == 0.0 && own.off_for >= 2.0 * PRESSURE_OFF_FOR && !is_starved);
            if off[i] && !both && alone && !self.valve_told && self.low_for == 0.0 {
                chambers[i].is_lost = true;
                found.sensor = true;
                log.tell(time, EventKind::PressureLost, i as f64);
                replaced[i] = chambers[i].pressure;
            }
        }
    }

    /// Watches the supply. Both chambers share the valve, so the other chamber gives its conductance. The fall of the
    /// supply in units of [`SUPPLY_FALLEN`] is
    ///
    ///   (q_fill,model - q_fill q_vent,model/q_vent)/(q_fill,model - q_fill,fallen)
    ///
    /// with the changes q of the pressures by flow. A chamber that the supply does not fill is `starved`, Pa.
    fn watch_supply(
        &mut self,
        model: &Model,
        at: Moment,
        starved: Option<f64>,
        found: &mut GasFindings,
        log: &mut Log,
    ) {
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
