//! Pressures against a twin of the gas: sensors, valve and supply.

use super::Believed;
use super::event::{EventKind, Log};
use crate::model::{Held, Model};
use crate::thresholds::{
    PRESSURE_BEYOND, PRESSURE_BORNE, PRESSURE_FLOW, PRESSURE_FOLLOWS, PRESSURE_HARDLY_OPEN, PRESSURE_LOST,
    PRESSURE_OFF, PRESSURE_OFF_FOR, SUPPLY_AT_ONCE, SUPPLY_DOUBTED, SUPPLY_FALLEN, SUPPLY_FALLEN_FOR,
    SUPPLY_FLOWN, SUPPLY_FORGOTTEN, SUPPLY_HARDLY_OPEN, SUPPLY_LACKS, SUPPLY_LATE, SUPPLY_LESS,
    SUPPLY_REVERSED, SUPPLY_SAGS, SUPPLY_VENTS,
};
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

impl Chamber {
    /// The reading has rested for long.
    fn rests_for(&self, period: f64) -> bool {
        f64::from(self.rests) * period >= PRESSURE_OFF_FOR
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
    /// Whether the last observed filling was that of a supply that has fallen.
    pub is_doubted: bool,
    /// Duration for which the chamber at the supply has lost more than the other one, s, and the sign of the first
    /// command. The supply pressure is then below that of the chamber, and the valve acts in reverse.
    reversed_for: f64,
    way: f64,
    valve_told: bool,
}

/// Findings from the pressures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// A sensor was lost with this sample.
    pub sensor: bool,
    /// The valve did not react from this sample on.
    pub valve: bool,
    /// The supply was low from this sample on.
    pub supply: bool,
    /// The supply was too low to fill a chamber.
    pub starved: bool,
    /// Direction of commands that have a reversed effect from this sample on, because the supply has fallen.
    pub reversed: Option<f64>,
    /// The pressure of a chamber comes from the model, or its reading is constant, so nothing is learned from it.
    pub modelled: bool,
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
    ) -> Found {
        let Moment { time, period } = moment;
        let Believed { model, last: state, foreseen: seen, edges } = *believed;
        let mut found = Found::default();
        let chambers = self.chambers.get_or_insert_with(|| {
            [0, 1].map(|i| Chamber {
                pressure: state.pressures[i],
                temperature: state.temperatures[i],
                last: f64::NAN,
                ..Chamber::default()
            })
        });
        // The twin has the observer's motion and separate pressures.
        let mut twin = State {
            pressures: chambers.map(|own| own.pressure),
            temperatures: chambers.map(|own| own.temperature),
            ..*state
        };
        let place = [twin.position, twin.velocity];
        let at = |gas: &State, supply: &Held, openings| {
            model.chambers_on(supply, place, gas.gas(), openings).pressure_rates
        };
        let (described, shut) = (&model.supply, [[0.0; 2]; 2]);
        let (modelled, still) = (at(&twin, described, edges), at(&twin, described, shut));
        // A fallen supply is detected from the actual state of the gas, not from its state on the described supply.
        let fallen = Held { pressure: described.pressure - SUPPLY_FALLEN, ..*described };
        let (open, weak) = (at(state, described, edges), at(state, &fallen, edges));
        let shut = at(state, described, shut);
        twin.advance(model, edges, period, None);
        let mut starved = None;
        let share = period / (period + PRESSURE_FOLLOWS);
        for i in 0..2 {
            let own = &mut chambers[i];
            let reading = readings[i];
            let by_flow = (open[i] - shut[i]) * period;
            let (flow, full) = ((modelled[i] - still[i]).abs(), model.most_rate(i, twin.position));
            own.unsure += (PRESSURE_FLOW * flow).max(flow.min(PRESSURE_HARDLY_OPEN * full)) * period
                - share * own.unsure;
            let measured = reading - own.last - shut[i] * period;
            own.rests = if reading == own.last { own.rests + 1 } else { 0 };
            let before = own.last;
            own.last = reading;
            // A jump is faster than any valve fills a chamber.
            let most = PRESSURE_OFF + (model.most_rate(i, twin.position) + shut[i].abs()) * period;
            let jumps = (reading - seen.pressures[i]).abs() > most;
            own.bad = if reading.is_finite() && !jumps { 0 } else { own.bad + 1 };
            let off = reading - twin.pressures[i];
            // A reading that rests while the model moves is off, however uncertain the flow is.
            let unsure = if own.rests_for(period) { 0.0 } else { own.unsure };
            let is_off = off.abs() > PRESSURE_OFF + unsure;
            own.off_for = if is_off { own.off_for + period } else { 0.0 };
            if is_off && own.rests_for(period) {
                own.off_for = own.off_for.max(PRESSURE_OFF_FOR);
            }
            let is_good = own.bad == 0 && !own.is_lost;
            own.pressure = twin.pressures[i] + if is_good { share * off } else { 0.0 };
            own.temperature = twin.temperatures[i];
            let [supplied, vented] = edges[i];
            own.fills = if supplied == vented { own.fills } else { supplied > vented };
            // A resting reading does not show the flow.
            let tells =
                is_good && before.is_finite() && f64::from(own.rests) * period < 0.25 * PRESSURE_OFF_FOR;
            if tells {
                // A late change, after the valve has shut, belongs to the flow before.
                let side = usize::from(!own.fills);
                let changes = [measured, by_flow, (weak[i] - shut[i]) * period];
                let lately = period / (period + SUPPLY_FALLEN_FOR);
                for (own, change) in self.flown[side].iter_mut().zip(changes) {
                    *own += change - share * *own;
                }
                for (own, change) in self.lately[side].iter_mut().zip(changes) {
                    *own += change - lately * *own;
                }
            }
            if own.starves(supplied - vented, weak[i] - shut[i], tells.then_some(measured), period) {
                starved = Some(reading);
            }
            if own.bad >= PRESSURE_LOST && !own.is_lost {
                own.is_lost = true;
                found.sensor = true;
                log.tell(time, EventKind::PressureLost, i as f64);
            }
        }
        let stuck = chambers.map(|own| own.rests_for(period));
        // Nothing is learned from a resting reading. A chamber whose sensor is lost continues from the twin.
        found.modelled = stuck[0] || stuck[1];
        let mut foreseen = seen.pressures;
        let off = chambers.map(|own| own.off_for >= PRESSURE_OFF_FOR && !own.is_lost);
        let both = off[0] && off[1] && stuck[0] == stuck[1];
        if both && !self.valve_told {
            self.valve_told = true;
            found.valve = true;
            let away = |i: usize| (chambers[i].last - chambers[i].pressure).abs();
            log.tell(time, EventKind::Valve, away(0).max(away(1)));
        }
        for i in 0..2 {
            // If the other chamber begins to leave the model too, the fault is the valve's.
            let [own, other] = [&chambers[i], &chambers[1 - i]];
            // The chamber lacks air because the supply has fallen.
            let is_starved = (self.supply_told || self.is_doubted) && own.last < own.pressure;
            let alone = (stuck[i] && !stuck[1 - i])
                || (other.off_for == 0.0 && own.off_for >= 2.0 * PRESSURE_OFF_FOR && !is_starved);
            if off[i] && !both && alone && !self.valve_told && self.low_for == 0.0 {
                chambers[i].is_lost = true;
                found.sensor = true;
                log.tell(time, EventKind::PressureLost, i as f64);
                foreseen[i] = chambers[i].pressure;
            }
        }
        let way = if edges[0][0] > edges[0][1] { 1.0 } else { -1.0 };
        (found.supply, found.reversed) = self.watch_supply(model, way, moment, log);
        if let (Some(pressure), None, false) = (starved, self.below, self.valve_told) {
            let [_, [vented, vents, _]] = self.lately;
            if vents < -0.5 * SUPPLY_DOUBTED && vented > SUPPLY_VENTS * vents {
                self.valve_told = true;
                found.valve = true;
                log.tell(time, EventKind::Valve, vented - vents);
            } else {
                if !self.supply_told {
                    log.tell(time, EventKind::Supply, pressure);
                }
                (self.supply_told, self.below) = (true, Some(pressure));
                (found.supply, found.starved) = (true, true);
            }
        }
        if let Some(chambers) = &self.chambers {
            let lost = chambers.map(|own| own.is_lost);
            if lost[0] != lost[1] {
                // The unmodelled force beyond the uncertainty of friction is assigned to the pressure that runs by
                // the model.
                let i = usize::from(lost[1]);
                let [level, _] = model.friction_levels([state.position, 0.0], state.pressures);
                let d = state.disturbance;
                let beyond = d - d.clamp(-PRESSURE_BEYOND * level, PRESSURE_BEYOND * level);
                foreseen[i] +=
                    period / (period + PRESSURE_BORNE) * model.sides[i].sign * beyond / model.sides[i].area;
            }
            for ((own, reading), foreseen) in chambers.iter().zip(readings).zip(&foreseen) {
                if own.bad > 0 || own.is_lost {
                    *reading = *foreseen;
                    found.modelled = true;
                }
            }
        }
        found
    }

    /// Both chambers share the valve, so a deficit of the filling chamber relative to the other chamber is caused by
    /// the supply. Returns whether a fallen supply is detected from this sample on. It also returns the direction of
    /// commands if the valve acts in reverse.
    fn watch_supply(&mut self, model: &Model, way: f64, at: Moment, log: &mut Log) -> (bool, Option<f64>) {
        let Moment { time, period } = at;
        let [[filled, fills, weakly], [vented, vents, _]] = self.flown;
        let seen = |flown: f64| fills > flown && vents < -flown && vented < 0.0;
        // The flow of the other chamber gives the valve's conductance. `falls` is the deficit of the filling chamber
        // in units of a supply fall.
        let mut falls =
            if seen(SUPPLY_DOUBTED) { (fills - filled * vents / vented) / (fills - weakly) } else { 0.0 };
        if fills > SUPPLY_DOUBTED {
            self.is_doubted = falls > 1.0 || filled < (1.0 - PRESSURE_FLOW) * weakly;
        }
        // An old flow does not show whether the valve fills now, while it is open only a little.
        let [[now_filled, now_fills, _], [now_vented, now_vents, _]] = self.lately;
        let flows = now_fills > 0.5 * SUPPLY_DOUBTED && now_vents < -0.5 * SUPPLY_DOUBTED;
        let is_low = falls > 1.0 && seen(SUPPLY_FLOWN) && flows;
        self.low_for = if is_low { self.low_for + period } else { 0.0 };
        let was_reversed = self.reversed_for >= SUPPLY_REVERSED;
        let least = if self.supply_told { 0.0 } else { SUPPLY_DOUBTED };
        let lacks = now_fills > least && now_fills - now_filled > SUPPLY_DOUBTED;
        let loses = lacks && now_filled < now_vented && now_vented < 0.0;
        if self.reversed_for == 0.0 {
            self.way = way;
        }
        self.reversed_for = if loses { self.reversed_for + period } else { 0.0 };
        let is_reversed = self.reversed_for >= SUPPLY_REVERSED;
        if is_reversed && !seen(SUPPLY_DOUBTED) {
            falls = (fills - filled) / (fills - weakly);
        }
        let told = (self.low_for >= SUPPLY_FALLEN_FOR || is_reversed) && !self.supply_told;
        if told {
            self.supply_told = true;
            let [ambient, supply] = [model.ambient.pressure, model.supply.pressure];
            log.tell(time, EventKind::Supply, (supply - falls * SUPPLY_FALLEN).max(ambient));
        }
        (told, (is_reversed && !was_reversed).then_some(self.way))
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
    pub fn lacks_sensor(&self) -> bool {
        self.chambers.is_some_and(|own| own.iter().any(|own| own.is_lost))
    }

    /// It is not certain that the supply pressure acts: it has fallen, or a pressure is not measured.
    pub fn may_lack_supply(&self) -> bool {
        self.supply_told || self.lacks_sensor()
    }
}
