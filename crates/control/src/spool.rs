//! Model of the valve's spool: present and future position under the commands given so far.

use crate::model::{Model, Valve};
use crate::number::Number;
use crate::thresholds::SPOOL_ROUNDING;
use crate::types::{Arrangement, Edges, MOST_VALVES};
use std::collections::VecDeque;

/// A second-order spool after a dead time. It is advanced exactly for piecewise constant commands.
#[derive(Clone, Debug)]
pub struct Spool<S = f64> {
    /// Position and speed.
    pub state: [S; 2],
    /// Commands under way: the times at which they act, s, and their values; the first one acts now.
    acts: VecDeque<(f64, S)>,
    angular_frequency: f64,
    damping_ratio: f64,
    beside: Beside<S>,
}

/// Values and the times from which they act, s. The first one acts now.
type Line<S> = VecDeque<(f64, S)>;

/// State of separate valves at each chamber, which one 5/3 valve cannot represent.
#[derive(Clone, Debug)]
enum Beside<S> {
    Nothing,
    /// Common part of both commands: valve a is at the sum of both spools, valve b at the difference.
    Both(Box<Spool<S>>),
    /// For valves without a spool: openings of the edges that fill a, vent a, fill b and vent b.
    Edges(Box<[Line<S>; MOST_VALVES]>),
}

fn line<S: Number>() -> Line<S> {
    VecDeque::from([(f64::NEG_INFINITY, S::zero())])
}

/// Returns the mean value between two times, and drops earlier entries.
fn mean<S: Number>(line: &mut Line<S>, from: f64, to: f64) -> S {
    let mut sum = S::zero();
    for place in 0..line.len() {
        let begin = line[place].0.max(from);
        let end = line.get(place + 1).map_or(to, |next| next.0.min(to));
        if end > begin {
            sum += line[place].1.times((end - begin) / (to - from));
        }
    }
    while line.len() > 1 && line[1].0 <= to {
        line.pop_front();
    }
    sum
}

/// Adds a value that acts from a time on. Entries that would act later are dropped.
fn act<S: Number>(line: &mut Line<S>, acts: f64, value: S) {
    while line.len() > 1 && line.back().is_some_and(|last| last.0 >= acts) {
        line.pop_back();
    }
    line.push_back((acts, value));
}

impl<S: Number> Spool<S> {
    /// Adds a command that acts from a time on, s.
    pub fn command(&mut self, acts: f64, value: S) {
        match &mut self.beside {
            Beside::Nothing => {}
            Beside::Both(both) => both.command(acts, S::zero()),
            Beside::Edges(edges) => {
                for (edge, way) in edges.iter_mut().zip([1.0, -1.0, -1.0, 1.0]) {
                    act(edge, acts, value.times(way).max(S::zero()));
                }
                return;
            }
        }
        self.acts.push_back((acts, value));
    }

    /// Adds commands of the valves of chambers a and b.
    pub(crate) fn command_both(&mut self, acts: f64, [a, b]: [S; 2]) {
        self.acts.push_back((acts, (a - b).times(0.5)));
        if let Beside::Both(both) = &mut self.beside {
            both.command(acts, (a + b).times(0.5));
        }
    }

    /// Opens an edge, filling or venting of a or b, by a fraction from a time on, s.
    pub(crate) fn switch(&mut self, edge: usize, acts: f64, share: S) {
        if let Beside::Edges(edges) = &mut self.beside {
            act(&mut edges[edge], acts, share);
        }
    }

    /// Advances from one time to another, s. Returns the openings of the edges at half time, or their mean if they
    /// switch.
    pub fn edges(&mut self, model: &Model<S>, from: f64, to: f64) -> Edges<S> {
        if let Beside::Edges(edges) = &mut self.beside {
            let [fills_a, vents_a, fills_b, vents_b] = [0, 1, 2, 3].map(|i| mean(&mut edges[i], from, to));
            self.state = [(fills_a - vents_a - fills_b + vents_b).times(0.5), S::zero()];
            return [[fills_a, vents_a], [fills_b, vents_b]];
        }
        let half = self.middle(from, to);
        let Beside::Both(both) = &mut self.beside else { return model.openings(half.limited()) };
        let sum = both.middle(from, to);
        [sum + half, sum - half].map(|own| model.openings(own.limited())[0])
    }

    /// Advances from one time to another, s; old commands are dropped.
    pub fn advance(&mut self, from: f64, to: f64) {
        let mut t = from;
        // A spool without a lag is where its command is. A command that acts only at the end of this piece does not
        // belong to it, however times are rounded.
        let least = if self.angular_frequency.is_infinite() { SPOOL_ROUNDING * (to - from) } else { 0.0 };
        for place in 0..self.acts.len() {
            let until = self.acts.get(place + 1).map_or(to, |next| next.0.min(to));
            if until > t + least {
                self.state = self.step(self.state, self.acts[place].1, until - t);
                t = until;
            }
        }
        while self.acts.len() > 1 && self.acts[1].0 <= to {
            self.acts.pop_front();
        }
    }

    /// Advances likewise, and returns the position halfway.
    fn middle(&mut self, from: f64, to: f64) -> S {
        let middle = 0.5 * (from + to);
        self.advance(from, middle);
        let [position, _] = self.state;
        self.advance(middle, to);
        position
    }

    /// Returns the present position.
    pub fn position(&self) -> S {
        self.state[0].limited()
    }

    /// Advances by the exact solution for a constant command.
    fn step(&self, [x, v]: [S; 2], command: S, h: f64) -> [S; 2] {
        let [by_x, by_v, rate_x, rate_v] = self.transition(h);
        let e = x - command;
        [command + e.times(by_x) + v.times(by_v), e.times(rate_x) + v.times(rate_v)]
    }

    /// Returns the transition of a distance from the command and of a speed over `h` s: rows of the distance, then of
    /// the speed.
    pub fn transition(&self, h: f64) -> [f64; 4] {
        let (w, d) = (self.angular_frequency, self.damping_ratio);
        if w.is_infinite() {
            return [0.0; 4];
        }
        let decay = (-d * w * h).exp();
        let root = (1.0 - d * d).abs().sqrt() * w;
        // Sine and cosine below a damping ratio of one, hyperbolic functions above it, h and 1 at one.
        let (s, c) = if d < 1.0 {
            ((root * h).sin() / root, (root * h).cos())
        } else if d > 1.0 {
            ((root * h).sinh() / root, (root * h).cosh())
        } else {
            (h, 1.0)
        };
        [decay * (c + d * w * s), decay * s, -decay * w * w * s, decay * (c - d * w * s)]
    }

    /// Visits each number of the spool.
    pub(crate) fn numbers(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.state.iter_mut().for_each(&mut *see);
        self.acts.iter_mut().for_each(|(_, value)| see(value));
        match &mut self.beside {
            Beside::Nothing => {}
            Beside::Both(both) => both.numbers(see),
            Beside::Edges(edges) => edges.iter_mut().flatten().for_each(|(_, value)| see(value)),
        }
    }
}

impl Spool {
    /// Returns a spool at rest in the centre.
    pub fn new(valve: &Valve) -> Self {
        let beside = match valve.arrangement {
            Arrangement::One => Beside::Nothing,
            Arrangement::Pair => {
                let one = Valve { arrangement: Arrangement::One, ..valve.clone() };
                Beside::Both(Box::new(Spool::new(&one)))
            }
            _ => Beside::Edges(Box::new(std::array::from_fn(|_| line()))),
        };
        Spool {
            state: [0.0; 2],
            acts: line(),
            angular_frequency: valve.angular_frequency,
            damping_ratio: valve.damping_ratio,
            beside,
        }
    }

    /// Returns the spool of one 5/3 valve in other numbers, at rest in the centre under zero commands.
    pub(crate) fn at_rest<S: Number>(&self) -> Spool<S> {
        Spool {
            state: [S::zero(); 2],
            acts: self.acts.iter().map(|&(acts, _)| (acts, S::zero())).collect(),
            angular_frequency: self.angular_frequency,
            damping_ratio: self.damping_ratio,
            beside: Beside::Nothing,
        }
    }

    /// Returns position and speed as fractions of opening, beyond an overlap.
    pub fn share(&self, overlap: f64) -> [f64; 2] {
        let [x, v] = self.state;
        let whole = 1.0 / (1.0 - overlap);
        [x.signum() * ((x.abs() - overlap) * whole).max(0.0), v * whole]
    }
}
