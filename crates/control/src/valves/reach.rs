//! Forces that the valves of a drive can reach.

use crate::model::Model;
use crate::thresholds::STIFFNESS_MEAN;
use crate::types::State;

/// Rates of the forces of both chambers, N/s: filled, shut and vented.
pub(super) struct Reach {
    pub filled: [f64; 2],
    shut: [f64; 2],
    pub vented: [f64; 2],
    /// Stiffness, N/m, that which both chambers would have at the bounds of their mean pressure, and its rate for each rate
    /// of a chamber's force, 1/m.
    stiffness: f64,
    within: [f64; 2],
    by_force: [f64; 2],
    /// Its rate by the motion alone, N/(m s).
    by_motion: f64,
}

impl Reach {
    /// Returns the rates at a state of the drive.
    pub fn of(model: &Model, state: &State) -> Self {
        let State { position: x, velocity: v, pressures, .. } = *state;
        let gas = state.gas();
        let rates = |each: [f64; 2]| {
            let rates = model.chambers([x, v], gas, [each; 2]).pressure_rates;
            [0, 1].map(|i| rates[i] * model.sides[i].area)
        };
        let k = model.gas.heat_capacity_ratio;
        // k A/V of each chamber: stiffness per newton of its force.
        let by_force = [0, 1].map(|i| k * model.sides[i].area / model.sides[i].volume(x));
        let of_pressure = |i: usize| by_force[i] * model.sides[i].area;
        let [low, high] = [model.ambient.pressure, model.supply.pressure];
        let at = |share: f64| (low + share * (high - low)) * (of_pressure(0) + of_pressure(1));
        let grows = |i: usize| {
            let side = &model.sides[i];
            -of_pressure(i) * pressures[i] * side.sign * side.area * v / side.volume(x)
        };
        Reach {
            filled: rates([1.0, 0.0]),
            shut: rates([0.0, 0.0]),
            vented: rates([0.0, 1.0]),
            stiffness: of_pressure(0) * pressures[0] + of_pressure(1) * pressures[1],
            within: STIFFNESS_MEAN.map(at),
            by_force,
            by_motion: grows(0) + grows(1),
        }
    }

    /// Rate of the force of a chamber at a fraction of opening, -1 .. 1.
    pub fn rate(&self, i: usize, share: f64) -> f64 {
        let full = if share > 0.0 { self.filled[i] } else { self.vented[i] };
        self.shut[i] + share.abs() * (full - self.shut[i])
    }

    /// Returns the fraction of opening at which the force of a chamber has a rate, or the nearest possible one.
    pub fn opening(&self, i: usize, rate: f64) -> f64 {
        let (way, full) = if rate > self.shut[i] { (1.0, self.filled[i]) } else { (-1.0, self.vented[i]) };
        let most = full - self.shut[i];
        if way * most > f64::MIN_POSITIVE { way * ((rate - self.shut[i]) / most).min(1.0) } else { 0.0 }
    }

    /// Returns rates of the forces of both chambers for a fraction of opening of one 5/3 valve. Their difference is
    /// that of the 5/3 valve. Their mean brings the stiffness to a value, N/m, at a rate, 1/s.
    pub fn wanted(&self, share: f64, stiffness: Option<[f64; 2]>) -> [f64; 2] {
        let base = [self.rate(0, share), self.rate(1, -share)];
        let Some([stiffness, rate]) = stiffness else { return base };
        let [low, high] = self.within;
        let now = self.by_force[0] * base[0] + self.by_force[1] * base[1] + self.by_motion;
        let both = (rate * (stiffness.clamp(low, high) - self.stiffness) - now)
            / (self.by_force[0] + self.by_force[1]);
        let least = (self.vented[0] - base[0]).max(self.vented[1] - base[1]).min(0.0);
        let most = (self.filled[0] - base[0]).min(self.filled[1] - base[1]).max(0.0);
        base.map(|own| own + both.clamp(least, most))
    }
}
