#![allow(clippy::needless_range_loop)] // rows and columns of matrices

use super::base::{Features, Law, Tick};
use crate::gains::law;
use crate::model::Model;
use crate::number::Number;
use crate::reference::Wanted;
use crate::thresholds::*;
use crate::types::{Plant, State};
use math::{Dual, Over};
use physics::above;

/// Number of moves in the plan.
const MOVES: usize = 8;
/// Duration of each move, ms. The last moves are simulated in steps of 2 ms.
const BLOCKS: [usize; MOVES] = [1, 1, 2, 2, 4, 6, 8, 16];
const STEPS: [usize; MOVES] = [1, 1, 1, 1, 1, 1, 2, 2];

/// Number of steps in the horizon.
const HORIZON: usize = {
    let (mut sum, mut block) = (0, 0);
    while block < MOVES {
        sum += BLOCKS[block] / STEPS[block];
        block += 1;
    }
    sum
};

/// A number with its derivatives with respect to all moves.
type ByMoves = Dual<f64, MOVES>;
/// A number for each move.
type Row = [f64; MOVES];

/// Returns the steps of the horizon: the index of the move, and the duration of the step, s.
fn steps() -> impl Iterator<Item = (usize, f64)> {
    (0..MOVES).flat_map(|block| {
        std::iter::repeat_n((block, 1e-3 * STEPS[block] as f64), BLOCKS[block] / STEPS[block])
    })
}

type Transitions = [[[f64; 4]; 2]; 2];

/// A sample, and the parts of its horizon that do not depend on the plan. These are the transitions of the spool, and the wanted state
/// and the growth of the load in each step.
struct Horizon<'t> {
    tick: &'t Tick<'t>,
    transitions: Transitions,
    wanted: [Wanted; HORIZON],
    growth: [f64; HORIZON],
}

impl<'t> Horizon<'t> {
    fn of(tick: &'t Tick<'t>) -> Self {
        let transitions = [1e-3, 2e-3].map(|h| [0.5 * h, h].map(|h| tick.spool.transition(h)));
        let (mut wanted, mut growth, mut t) = ([Wanted::default(); HORIZON], [0.0; HORIZON], 0.0);
        let mut middle = tick.acts;
        for ((wanted, growth), (_, h)) in wanted.iter_mut().zip(&mut growth).zip(steps()) {
            t += h;
            *wanted = tick.preview.at(tick.acts + t);
            let before = std::mem::replace(&mut middle, tick.acts + t - 0.5 * h);
            [*growth, _] = tick.preview.load_growth(before, middle);
        }
        Horizon { tick, transitions, wanted, growth }
    }
}

law! {
    /// Nonlinear predictive control: the moves w of the next 40 ms that minimise
    ///
    ///   sum h (e^2 + (e'/lambda)^2 + 0.1 (e''/lambda^2)^2) + r^2 sum (w_i - w_(i-1))^2.
    ///
    /// The moves stay within -1 .. 1. Units are mm for e, ms for h, and % for w. Each sample simulates the horizon once,
    /// from the state when the present command acts. All numbers carry derivatives with respect to all moves. One
    /// Gauss-Newton step follows, or a quarter of it if the full step would increase the cost. A drive behind a valve
    /// that is slower than described swings, and the valve travels more: above [`NMPC_TRAVEL`], r grows in proportion to
    /// this travel.
    pub struct Nmpc {
        bandwidth: "rad/s", above(0.0), "lambda", rule "0.22/lag, with a lag of at least 3 ms", factor "gain";
        move_penalty: "1", above(0.0), "r", rule "0.05, 0.1 where valves switch, assumed", factor "damping";
    } memory<S> {
        plan: [S; MOVES],
        last: S,
        // Travel of the valve, 1/s, over [`NMPC_TRAVEL_FOR`].
        travel: S,
    }
}

/// Minimises x' H x/2 + g' x within bounds. Values at a bound are fixed there, and the remaining system is solved. This
/// repeats until no fixed value would leave its bound.
fn within(h: &[Row; MOVES], g: &Row, low: &Row, high: &Row) -> Option<Row> {
    let mut fixed = [None; MOVES];
    let mut x = [0.0; MOVES];
    for _ in 0..NMPC_ROUNDS {
        x = solve(h, g, &fixed)?;
        let beyond = (0..MOVES).find_map(|i| {
            let bound = x[i].clamp(low[i], high[i]);
            (bound != x[i] && fixed[i].is_none()).then_some((i, bound))
        });
        if let Some((i, bound)) = beyond {
            fixed[i] = Some(bound);
            continue;
        }
        // A value at a bound is released if the slope of the cost points into the interior.
        let slope = |i: usize| g[i] + (0..MOVES).map(|j| h[i][j] * x[j]).sum::<f64>();
        let free = (0..MOVES).find(|&i| {
            fixed[i].is_some_and(|bound| {
                let inward = if bound == low[i] { 1.0 } else { -1.0 };
                slope(i) * inward < -1e-9 * g[i].abs().max(1e-9)
            })
        });
        match free {
            Some(i) => fixed[i] = None,
            None => return Some(x),
        }
    }
    Some(std::array::from_fn(|i| x[i].clamp(low[i], high[i])))
}

/// Returns the minimum with some numbers fixed, by a Cholesky factorisation.
fn solve(h: &[Row; MOVES], g: &Row, fixed: &[Option<f64>; MOVES]) -> Option<Row> {
    let (mut a, mut b) = (*h, g.map(|g| -g));
    for i in 0..MOVES {
        if let Some(value) = fixed[i] {
            for j in 0..MOVES {
                if fixed[j].is_none() {
                    b[j] -= h[j][i] * value;
                }
                (a[i][j], a[j][i]) = (0.0, 0.0);
            }
            (a[i][i], b[i]) = (1.0, value);
        }
    }
    for i in 0..MOVES {
        for j in 0..=i {
            let sum = a[i][j] - (0..j).map(|k| a[i][k] * a[j][k]).sum::<f64>();
            if i == j {
                if sum.is_nan() || sum <= 0.0 {
                    return None;
                }
                a[i][i] = sum.sqrt();
            } else {
                a[i][j] = sum / a[j][j];
            }
        }
    }
    for i in 0..MOVES {
        b[i] = (b[i] - (0..i).map(|k| a[i][k] * b[k]).sum::<f64>()) / a[i][i];
    }
    for i in (0..MOVES).rev() {
        b[i] = (b[i] - (i + 1..MOVES).map(|k| a[k][i] * b[k]).sum::<f64>()) / a[i][i];
    }
    b.iter().all(|own| own.is_finite()).then_some(b)
}

impl Nmpc {
    /// Shifts the plan of the last sample by one sample. Each block gets the mean of the plan over its time.
    fn shift(&mut self, period: f64) {
        let old = self.plan;
        let mut begins = [0.0; MOVES + 1];
        for (i, block) in BLOCKS.iter().enumerate() {
            begins[i + 1] = begins[i] + 1e-3 * *block as f64;
        }
        for i in 0..MOVES {
            let (from, to) = (begins[i] + period, begins[i + 1] + period);
            let within = |j: usize| {
                let end = if j + 1 == MOVES { to } else { begins[j + 1] };
                (end.min(to) - begins[j].max(from)).max(0.0)
            };
            self.plan[i] = (0..MOVES).map(|j| old[j] * within(j)).sum::<f64>() / (to - from);
        }
    }

    /// Simulates the horizon under a plan and passes on each residual.
    fn follow<S: Over<f64>>(&self, horizon: &Horizon, plan: &[S; MOVES], mut row: impl FnMut(S)) {
        let foreseen = foreseen(horizon, plan);
        let l = self.bandwidth;
        let penalty = 100.0 * self.move_penalty * (self.travel / NMPC_TRAVEL).max(1.0);
        let mut before = (MOVES, S::c(self.last));
        for ((wanted, [x, v, a]), (block, h)) in horizon.wanted.iter().zip(foreseen).zip(steps()) {
            if before.0 != block {
                let w = plan[block];
                row((w - before.1).times(penalty));
                before = (block, w);
            }
            let weight = (h * 1e3 * if block + 1 == MOVES { NMPC_LAST } else { 1.0 }).sqrt() * 1e3;
            row((x - S::c(wanted.position)).times(weight));
            row((v - S::c(wanted.velocity)).times(weight / l));
            row((a - S::c(wanted.acceleration)).times(weight * NMPC_ACCELERATION.sqrt() / (l * l)));
        }
    }
}

/// Returns position, m, velocity, m/s, and acceleration, m/s2, after each of the [`steps`], by the model under a plan.
fn foreseen<S: Over<f64>>(horizon: &Horizon, plan: &[S; MOVES]) -> [[S; 3]; HORIZON] {
    let mut foreseen = [[S::zero(); 3]; HORIZON];
    let (tick, model) = (horizon.tick, horizon.tick.model);
    let mut state: State<S> = tick.state.map(S::c);
    let [mut spool, mut speed] = tick.spool.share(model.valve.overlap).map(S::c);
    for (step, (block, h)) in steps().enumerate() {
        let w = plan[block];
        let [half, whole] = horizon.transitions[STEPS[block] - 1];
        let go = |by: [f64; 4]| {
            let e = spool - w;
            [w + e.times(by[0]) + speed.times(by[1]), e.times(by[2]) + speed.times(by[3])]
        };
        let [middle, _] = go(half);
        [spool, speed] = go(whole);
        let open = model.opened_by(middle.max(S::c(-1.0)).min(S::one()));
        // Contacts that may break away or reverse are followed in shorter pieces.
        let pieces = if state.velocity.abs().lt(S::c(NMPC_SLOW)) { STEPS[block] } else { 1 };
        if horizon.growth[step] != 0.0 {
            state.disturbance += S::c(horizon.growth[step]);
        }
        let began = model.advance_in(pieces as u32, &mut state, open, h, None);
        if step > 0 {
            foreseen[step - 1][2] = began;
        }
        foreseen[step] = [state.position, state.velocity, S::zero()];
    }
    foreseen[HORIZON - 1][2] = model.acceleration(&state);
    foreseen
}

impl Nmpc {
    pub(super) fn tuned(model: &Model, plant: &Plant) -> Self {
        let move_penalty = if model.valve.arrangement.is_proportional() { 0.05 } else { 0.1 };
        Nmpc::new(plant.bandwidth(), move_penalty)
    }
}

impl Law for Nmpc {
    const FEATURES: Features = Features { predicts: true, wander: NMPC_WANDER, push: 0.6 };

    fn step(&mut self, tick: &Tick) -> f64 {
        self.shift(tick.period);
        let (mut h_matrix, mut gradient) = ([[0.0; MOVES]; MOVES], [0.0; MOVES]);
        let mut cost = 0.0;
        let seeded: [ByMoves; MOVES] = std::array::from_fn(|i| ByMoves::variable(self.plan[i], i));
        let horizon = Horizon::of(tick);
        self.follow(&horizon, &seeded, |residual| {
            cost += residual.re * residual.re;
            for i in 0..MOVES {
                gradient[i] += residual.eps[i] * residual.re;
                for j in 0..MOVES {
                    h_matrix[i][j] += residual.eps[i] * residual.eps[j];
                }
            }
        });
        let (low, high) = (self.plan.map(|w| -1.0 - w), self.plan.map(|w| 1.0 - w));
        // A prediction that diverges gives no step: the plan stays.
        let step = within(&h_matrix, &gradient, &low, &high);
        if let Some(step) = step.filter(|step| step.iter().all(|own| own.is_finite())) {
            // Derivatives in stick do not describe the motion after breakaway. Whole steps would reverse the plan at
            // each sample.
            let whole: [f64; MOVES] = std::array::from_fn(|i| self.plan[i] + step[i]);
            let mut foreseen = 0.0;
            self.follow(&horizon, &whole, |residual| foreseen += residual * residual);
            let share = if foreseen > cost { NMPC_SHORTER } else { 1.0 };
            for (own, step) in self.plan.iter_mut().zip(step) {
                *own = (*own + share * step).clamp(-1.0, 1.0);
            }
        }
        self.plan[0]
    }

    fn given(&mut self, asked: f64, tick: &Tick) {
        let rate = (asked.limited() - self.last).abs() / tick.period;
        self.travel += tick.period / NMPC_TRAVEL_FOR * (rate - self.travel);
        self.last = asked.limited();
    }
}
