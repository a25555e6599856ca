//! A twin of the valve's spool: where it is and will be under the commands given so far.

use crate::model::Valve;
use crate::number::Number;
use std::collections::VecDeque;

/// A spool of second order behind a dead time, advanced exactly for commands that hold from tick to tick.
#[derive(Clone, Debug)]
pub struct Spool<S = f64> {
    /// Position and speed.
    state: [S; 2],
    /// Commands under way: the times at which they act, s, and their values; the first one acts now.
    acts: VecDeque<(f64, S)>,
    angular_frequency: f64,
    damping_ratio: f64,
}

impl<S: Number> Spool<S> {
    /// At rest in the centre.
    pub fn new(valve: &Valve) -> Self {
        Spool {
            state: [S::zero(); 2],
            acts: VecDeque::from([(f64::NEG_INFINITY, S::zero())]),
            angular_frequency: valve.angular_frequency,
            damping_ratio: valve.damping_ratio,
        }
    }

    /// Takes over a command that acts from a time on, s.
    pub fn command(&mut self, acts: f64, value: S) {
        self.acts.push_back((acts, value));
    }

    /// Goes on from a time to another, s; commands that are over are forgotten.
    pub fn advance(&mut self, from: f64, to: f64) {
        let mut t = from;
        for place in 0..self.acts.len() {
            let until = self.acts.get(place + 1).map_or(to, |next| next.0.min(to));
            if until > t {
                self.state = self.step(self.state, self.acts[place].1, until - t);
                t = until;
            }
        }
        while self.acts.len() > 1 && self.acts[1].0 <= to {
            self.acts.pop_front();
        }
    }

    /// Goes on likewise; where it was halfway.
    pub fn halfway(&mut self, from: f64, to: f64) -> S {
        let middle = 0.5 * (from + to);
        self.advance(from, middle);
        let position = self.position();
        self.advance(middle, to);
        position
    }

    /// Position and speed now.
    pub fn state(&self) -> [S; 2] {
        self.state
    }

    /// Where it is now.
    pub fn position(&self) -> S {
        self.state[0].limited()
    }

    /// The exact solution for a command that holds.
    fn step(&self, [x, v]: [S; 2], command: S, h: f64) -> [S; 2] {
        let [by_x, by_v, rate_x, rate_v] = self.transition(h);
        let e = x - command;
        [command + e.times(by_x) + v.times(by_v), e.times(rate_x) + v.times(rate_v)]
    }

    /// What becomes of a distance from the command and of a speed within `h` s: rows of the distance, then of the speed.
    pub fn transition(&self, h: f64) -> [f64; 4] {
        let (w, d) = (self.angular_frequency, self.damping_ratio);
        if w.is_infinite() {
            return [0.0; 4];
        }
        let decay = (-d * w * h).exp();
        let root = (1.0 - d * d).abs().sqrt() * w;
        // Below a damping ratio of one sine and cosine, above it those of hyperbolas, at one h and 1.
        let (s, c) = if d < 1.0 {
            ((root * h).sin() / root, (root * h).cos())
        } else if d > 1.0 {
            ((root * h).sinh() / root, (root * h).cosh())
        } else {
            (h, 1.0)
        };
        [decay * (c + d * w * s), decay * s, -decay * w * w * s, decay * (c - d * w * s)]
    }

    /// Shows each of its numbers.
    pub(crate) fn numbers(&mut self, see: &mut dyn FnMut(&mut S)) {
        self.state.iter_mut().for_each(&mut *see);
        self.acts.iter_mut().for_each(|(_, value)| see(value));
    }
}

impl Spool {
    /// The same in other numbers, at rest in the centre under commands of zero.
    pub(crate) fn at_rest<S: Number>(&self) -> Spool<S> {
        Spool {
            state: [S::zero(); 2],
            acts: self.acts.iter().map(|&(acts, _)| (acts, S::zero())).collect(),
            angular_frequency: self.angular_frequency,
            damping_ratio: self.damping_ratio,
        }
    }

    /// Position and speed as shares of opening, behind an overlap.
    pub fn share(&self, overlap: f64) -> [f64; 2] {
        let [x, v] = self.state;
        let whole = 1.0 / (1.0 - overlap);
        [x.signum() * ((x.abs() - overlap) * whole).max(0.0), v * whole]
    }
}
