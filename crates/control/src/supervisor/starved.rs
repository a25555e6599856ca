//! A supply that has fallen, as the motion tells it: pressures are not measured, or only one is.

use crate::model::{Edges, Model};
use crate::observer::State;

/// Supplies that are tried: what is left of the pressure above ambient (assumed).
const LEFT: [f64; 3] = [0.1, 0.25, 0.45];
/// Valves beside the supply that is, as described and that open less: share of an opening, and what it lacks further (assumed).
const OPENS: [[f64; 2]; 3] = [[1.0, 0.0], [0.75, 0.02], [0.9, 0.04]];
/// Change of the unknown force that may be anything, in Coulomb friction and as a share of what both chambers press (assumed).
const UNSURE: [f64; 2] = [1.5, 0.03];
/// In Coulomb friction: what a supply has to explain beyond the others to gain, and the most that counts at a time (assumed).
const LEAST_GAIN: f64 = 0.3;
const MOST_GAIN: f64 = 3.0;
/// Gains over time behind which it is believed, and losses behind which it begins anew, Coulomb friction times s, and the
/// time for which it is followed at most, s (assumed).
const BELIEVED: f64 = 0.04;
const GIVEN_UP: f64 = 0.015;
const FOLLOWED: f64 = 0.15;

/// The gas of a drive whose supply has fallen a moment ago, and of drives on the supply as described.
#[derive(Clone, Copy, Debug)]
struct Twin {
    gas: State,
    supplied: [State; OPENS.len()],
    /// Unknown force when it began, N, and the time since then, s.
    begun: f64,
    age: f64,
    /// What it explained beyond the others.
    gained: f64,
}

impl Twin {
    fn of(state: &State) -> Self {
        let supplied = [*state; OPENS.len()];
        Twin { gas: *state, supplied, begun: state.disturbance, age: 0.0, gained: 0.0 }
    }
}

/// Twins of the gas on lower supplies: where one of them explains why the unknown force has changed, and neither the supply as
/// described nor a valve that opens less does, the supply has fallen - or the valve does not do what it is told.
#[derive(Clone, Debug, Default)]
pub struct Starved {
    twins: Vec<(Model, Twin)>,
}

impl Starved {
    /// The state with the gas of the twin that is believed from this sample on, if one is, and its supply, Pa; from the states
    /// `before`, at the last sample, and `now`, and how far edges were open between them.
    pub fn watch(
        &mut self,
        model: &Model,
        (before, now): (&State, &State),
        (edges, period): (Edges<f64>, f64),
        coulomb: f64,
    ) -> Option<(State, f64)> {
        if self.twins.is_empty() {
            let ambient = model.ambient.pressure;
            let on = |left: f64| {
                let mut own = model.clone();
                own.supply.pressure = ambient + left * (model.supply.pressure - ambient);
                (own, Twin::of(now))
            };
            self.twins = LEFT.map(on).into();
        }
        let force = now.disturbance + model.gas_force(now.pressures);
        let pressed: f64 = now.pressures.iter().zip(&model.sides).map(|(p, side)| p * side.area).sum();
        let unsure = UNSURE[0] * coulomb + UNSURE[1] * pressed;
        for (lower, own) in &mut self.twins {
            // What is left unexplained where the gas goes so, Coulomb friction.
            let left = |d: f64| ((d - own.begun).abs() - unsure).max(0.0) / coulomb;
            let follow = |model: &Model, gas: &mut State, edges: Edges<f64>| {
                let begin = State { pressures: gas.pressures, temperatures: gas.temperatures, ..*before };
                [gas.pressures, gas.temperatures] = begin.flow(model, edges, period, before.velocity);
                force - model.gas_force(gas.pressures)
            };
            let mut others = left(now.disturbance);
            for (gas, [share, lacks]) in own.supplied.iter_mut().zip(OPENS) {
                let opens = |edge: f64| (share * edge - lacks).max(edge.min(model.valve.leakage));
                others = others.min(left(follow(model, gas, edges.map(|side| side.map(opens)))));
            }
            let missing = follow(lower, &mut own.gas, edges);
            own.gained += period * (others - left(missing) - LEAST_GAIN).min(MOST_GAIN);
            own.age += period;
            if own.gained <= -GIVEN_UP || own.age > FOLLOWED {
                *own = Twin::of(now);
            }
        }
        let (lower, best) = self.twins.iter().max_by(|(_, a), (_, b)| a.gained.total_cmp(&b.gained))?;
        let State { pressures, temperatures, .. } = best.gas;
        let disturbance = force - model.gas_force(pressures);
        let state = State { pressures, temperatures, disturbance, ..*now };
        (best.gained > BELIEVED).then_some((state, lower.supply.pressure))
    }
}
