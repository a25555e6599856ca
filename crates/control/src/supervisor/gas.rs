//! Pressures against the model of the gas: sensors, valve and supply.

use super::event::{EventKind, Log};
use super::rules::Believed;
use crate::model::ConstantGas;
use crate::thresholds::*;

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
    fn read(&mut self, reading: f64, i: usize, by: &Believed, rates: [f64; 3]) -> Option<[f64; 3]> {
        let Believed { own, last, foreseen, edges, .. } = *by;
        let period = own.period;
        let [open, weak, shut] = rates;
        let measured = reading - self.last - shut * period;
        let is_same = reading == self.last;
        (self.rests, self.moved) = if is_same { (self.rests + 1, self.moved) } else { (0, 0.0) };
        self.moved += open * period - self.moved * period / (period + PRESSURE_FOLLOWS);
        let before = std::mem::replace(&mut self.last, reading);
        // A jump is faster than any valve fills a chamber.
        let most = PRESSURE_OFF + (own.model.most_rate(i, last.position) + shut.abs()) * period;
        let jumps = (reading - foreseen.pressures[i]).abs() > most;
        self.bad = if reading.is_finite() && !jumps { 0 } else { self.bad + 1 };
        let is_good = self.bad == 0 && !self.is_lost;
        let [supplied, vented] = edges[i];
        self.fills = if supplied == vented { self.fills } else { supplied > vented };
        // A resting reading does not show the flow.
        let tells = is_good && before.is_finite() && f64::from(self.rests) * period < 0.25 * PRESSURE_OFF_FOR;
        tells.then_some([measured, (open - shut) * period, (weak - shut) * period])
    }
}

/// Pressures by the model, to compare with the measured ones.
#[derive(Clone, Debug, Default)]
pub struct Gas {
    chambers: Option<[Chamber; 2]>,
    /// Pressure changes by flow, Pa, of the filling chamber, then of the other one. Each has three values: measured,
    /// by the model, and by the model on a fallen supply.
    flown: [[f64; 3]; 2],
    /// For how long the flows have differed from those of the model, s.
    differs_for: f64,
    /// The supply has fallen.
    pub supply_told: bool,
    valve_told: bool,
    /// The supply did not fill a chamber.
    pub starved: bool,
}

/// Findings from the pressures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GasFindings {
    /// A sensor was lost with this sample.
    pub sensor: bool,
    /// The valve did not react from this sample on.
    pub valve: bool,
    /// The supply was low, or too low to fill a chamber, from this sample on.
    pub supply: bool,
    /// The pressure of a chamber comes from the model, or its reading is constant, so nothing is learned from it.
    pub modelled: bool,
}

/// Returns the rates of both pressures by the model, Pa/s: with the openings of the valve, with these openings on a
/// fallen supply, and with the valve shut.
fn rates(believed: &Believed) -> [[f64; 2]; 3] {
    let Believed { own, last, edges, .. } = *believed;
    let supply = &own.model.supply;
    let fallen = ConstantGas { pressure: supply.pressure - SUPPLY_FALLEN, ..*supply };
    [(supply, edges), (&fallen, edges), (supply, [[0.0; 2]; 2])].map(|(supply, edges)| {
        own.model.chambers_on(supply, [last.position, last.velocity], last.gas(), edges).pressure_rates
    })
}

impl Gas {
    /// Whether a sensor or the valve does not react.
    pub fn is_lost(&self) -> bool {
        self.valve_told || self.lacks_sensor()
    }

    /// Replaces readings that are not credible by the prediction of the model.
    pub fn checked(&mut self, readings: &mut [f64; 2], believed: &Believed, log: &mut Log) -> GasFindings {
        let (time, period, foreseen) = (believed.time, believed.own.period, believed.foreseen);
        let mut chambers = self.chambers.unwrap_or([Chamber { last: f64::NAN, ..Chamber::default() }; 2]);
        let rates = rates(believed);
        let mut found = GasFindings::default();
        for (i, own) in chambers.iter_mut().enumerate() {
            if let Some(changes) = own.read(readings[i], i, believed, rates.map(|rate| rate[i])) {
                // A late change, after the valve has shut, belongs to the flow before.
                let side = usize::from(!own.fills);
                for (own, change) in self.flown[side].iter_mut().zip(changes) {
                    *own += change - period / (period + FLOW_FORGOTTEN) * *own;
                }
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
        let stuck = chambers.map(|own| own.is_stuck(period) && !own.is_lost && !self.valve_told);
        if stuck == [true; 2] {
            // Both readings rest while the model moves.
            (self.valve_told, found.valve) = (true, true);
            log.tell(time, EventKind::Valve, chambers[0].moved.abs().max(chambers[1].moved.abs()));
        } else if let Some(i) = stuck.iter().position(|is_stuck| *is_stuck) {
            let own = &mut chambers[i];
            (own.is_lost, found.sensor) = (true, true);
            log.tell(time, EventKind::PressureLost, i as f64);
            replaced[i] = own.last + own.moved;
        }
        self.chambers = Some(chambers);
        self.watch_flows(believed, &chambers, &mut found, log);
        for ((own, reading), replaced) in chambers.iter().zip(readings).zip(&replaced) {
            if own.bad > 0 || own.is_lost {
                *reading = *replaced;
                found.modelled = true;
            }
        }
        found
    }

    /// Watches valve and supply by the changes q of the pressures by flow. The valve does not react if neither chamber
    /// has half of its flow. Both chambers share the valve, so the other chamber gives its conductance. The fall of the
    /// supply in units of [`SUPPLY_FALLEN`] is
    ///
    ///   (q_fill,model - q_fill q_vent,model/q_vent)/(q_fill,model - q_fill,fallen)
    ///
    /// with the sums q over the last [`FLOW_FORGOTTEN`].
    ///
    /// A chamber is starved if it gets less air than even a fallen supply would give.
    fn watch_flows(
        &mut self,
        by: &Believed,
        chambers: &[Chamber; 2],
        found: &mut GasFindings,
        log: &mut Log,
    ) {
        let (time, period, model) = (by.time, by.own.period, &by.own.model);
        let [[filled, fills, weakly], [vented, vents, _]] = self.flown;
        let is_seen = fills > FLOW_SEEN && vents < -FLOW_SEEN;
        let is_idle = is_seen && filled < FLOW_LEAST * fills && vented > FLOW_LEAST * vents;
        let falls = (fills - filled * vents / vented) / (fills - weakly);
        let is_low = is_seen && vented < 0.0 && falls > 1.0;
        self.differs_for = if is_idle || is_low { self.differs_for + period } else { 0.0 };
        let differs = self.differs_for >= FLOW_DIFFERS_FOR;
        if is_idle && differs && !self.valve_told {
            (self.valve_told, found.valve) = (true, true);
            log.tell(time, EventKind::Valve, vented - vents);
        }
        let [into, back] = STARVED_FLOW.map(|fraction| fraction * weakly);
        let starved = filled < into.min(back) - STARVED_DEFICIT && !is_idle && !self.valve_told;
        found.supply = starved && !self.starved || is_low && !is_idle && differs && !self.supply_told;
        if found.supply && !self.supply_told {
            let explains = (model.supply.pressure - falls * SUPPLY_FALLEN).max(model.ambient.pressure);
            let filling = chambers.iter().find(|own| starved && own.fills);
            log.tell(time, EventKind::Supply, filling.map_or(explains, |own| own.last));
        }
        self.starved |= starved;
        self.supply_told |= found.supply;
    }

    /// A pressure is not measured any more.
    pub fn lacks_sensor(&self) -> bool {
        self.chambers.is_some_and(|own| own.iter().any(|own| own.is_lost))
    }
}
