//! What is kept of a member: numbers that follow from its run step by step.

use circuit::{Assembly, Circuit, Net, Quantity, sample_times};
use math::Lane;
use ode::{Accepted, Course, Output, System, locate};

/// Points of a step at which a column is looked at: its ends and the quarters between them.
const POINTS: usize = 5;
/// Weights of the integral over a step from the values there, after Boole: exact to the fifth power of time.
const WEIGHTS: [f64; POINTS] = [7.0 / 90.0, 32.0 / 90.0, 12.0 / 90.0, 32.0 / 90.0, 7.0 / 90.0];
/// Where the points are, as fractions of a step.
fn theta(k: usize) -> f64 {
    k as f64 / (POINTS - 1) as f64
}

/// Parabolas that come nearer to an extreme between the points.
const PARABOLAS: usize = 2;

/// What becomes of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What {
    /// Its value at the end.
    Final,
    /// Its greatest value.
    Max,
    /// Its least value.
    Min,
    /// Its mean over time.
    Mean,
    /// Its integral over time.
    Integral,
    /// When it is above (or below) a value for the first time, s; not a number where it never is.
    When {
        /// The value, in the column's unit.
        value: f64,
        /// Above it, else below.
        above: bool,
    },
    /// Its values at a rate, 1/s, from the start to the end.
    Samples {
        /// 1/s.
        rate: f64,
    },
}

/// A column and what becomes of it.
#[derive(Clone, Copy, Debug)]
pub struct Reduction {
    /// The place of the column among those of the circuit.
    pub column: usize,
    /// What becomes of it.
    pub what: What,
}

/// Where a column is read.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// It is this state.
    State(usize),
    /// It follows from all states.
    Row,
}

/// What one reduction of one member has come to.
#[derive(Clone, Debug, Default)]
struct Fold {
    value: f64,
    samples: Vec<f64>,
}

/// Follows the members in the lanes of a run.
pub struct Follower<'a, R: Lane> {
    assembly: &'a Assembly,
    asked: &'a [Reduction],
    sources: Vec<Source>,
    /// One for each lane and reduction.
    folds: Vec<Fold>,
    /// When samples are due, and which is the next one of each lane.
    times: Vec<f64>,
    next: Vec<usize>,
    needs_rows: bool,
    net: Net<R>,
    /// The attempt that the following are of: all lanes that it is accepted in share them.
    attempt: u64,
    /// The course of each reduction's state.
    courses: Vec<Option<Course<R>>>,
    /// All columns at the points of the step.
    rows: [Vec<R>; POINTS],
    row: Vec<R>,
}

impl<'a, R: Lane> Follower<'a, R> {
    /// For members that are like `assembly`, over `duration` s where samples are asked for.
    pub fn new(assembly: &'a Assembly, asked: &'a [Reduction], duration: f64) -> Self {
        let quantity = |asked: &Reduction| assembly.variables.quantities[asked.column];
        let source = |asked: &Reduction| match quantity(asked) {
            Quantity::Position(axis) => {
                assembly.circuit.position_state(axis).map_or(Source::Row, Source::State)
            }
            Quantity::Velocity(axis) => {
                assembly.circuit.position_state(axis).map_or(Source::Row, |place| Source::State(place + 1))
            }
            _ => Source::Row,
        };
        let sources: Vec<Source> = asked.iter().map(source).collect();
        let rate = asked.iter().find_map(|asked| match asked.what {
            What::Samples { rate } => Some(rate),
            _ => None,
        });
        Follower {
            folds: vec![Fold::default(); R::L * asked.len()],
            times: rate.map_or(Vec::new(), |rate| sample_times(duration, rate)),
            next: vec![usize::MAX; R::L],
            needs_rows: sources
                .iter()
                .zip(asked)
                .any(|(source, asked)| matches!(source, Source::Row) && !is_whole(asked.what)),
            net: gathered(&assembly.circuit).work(),
            rows: std::array::from_fn(|_| vec![R::zero(); assembly.columns().len()]),
            row: vec![R::zero(); assembly.columns().len()],
            attempt: 0,
            courses: vec![None; asked.len()],
            sources,
            assembly,
            asked,
        }
    }

    /// A new member begins in a lane.
    pub fn init(&mut self, lane: usize) {
        self.next[lane] = 0;
        self.attempt = 0;
        for (fold, asked) in self.folds[lane * self.asked.len()..].iter_mut().zip(self.asked) {
            fold.samples.clear();
            fold.value = match asked.what {
                What::Mean | What::Integral => 0.0,
                _ => f64::NAN,
            };
        }
    }

    /// The member of a lane has come to its end at `y`, settled: its numbers, one after the other.
    pub fn finish(&mut self, lane: usize, (t, y): (f64, &[R]), circuit: &Circuit<R>, out: &mut [f64]) {
        while self.next[lane] < self.times.len() {
            self.sample(lane, self.times[self.next[lane]], y, circuit);
        }
        let row = &mut self.row;
        if self.asked.iter().any(|asked| asked.what == What::Final) {
            self.assembly.row(circuit, t, y, &mut self.net, row);
        }
        let mut out = out.iter_mut();
        let mut put = |value: f64| *out.next().expect("room for each number") = value;
        for (fold, asked) in self.folds[lane * self.asked.len()..].iter().zip(self.asked) {
            match asked.what {
                What::Final => put(row[asked.column].get(lane)),
                What::Mean => put(fold.value / t),
                What::Samples { .. } => fold.samples.iter().for_each(|value| put(*value)),
                _ => put(fold.value),
            }
        }
    }

    /// A column at a fraction of a step.
    fn value(
        &mut self,
        r: usize,
        (lane, t, h): (usize, f64, f64),
        theta: f64,
        states: &mut Accepted<'_, R>,
        circuit: &Circuit<R>,
    ) -> f64 {
        if let Some(course) = self.courses[r] {
            return course.value(theta).get(lane);
        }
        let y = &states.at(theta)[..circuit.structure().n()];
        self.assembly.row(circuit, theta.mul_add(h, t), y, &mut self.net, &mut self.row);
        self.row[self.asked[r].column].get(lane)
    }

    /// A column at the points of a step.
    fn points(&self, r: usize, lane: usize, states: &mut Accepted<'_, R>) -> [f64; POINTS] {
        std::array::from_fn(|k| match (self.sources[r], self.courses[r]) {
            (Source::State(i), _) if k == 0 => states.before()[i].get(lane),
            (Source::State(i), _) if k == POINTS - 1 => states.after()[i].get(lane),
            (_, Some(course)) => course.value(theta(k)).get(lane),
            _ => self.rows[k][self.asked[r].column].get(lane),
        })
    }

    /// What all lanes share of an attempt.
    fn look(&mut self, (t, h): (f64, f64), states: &mut Accepted<'_, R>, circuit: &Circuit<R>) {
        self.attempt = states.attempt();
        for ((course, source), asked) in self.courses.iter_mut().zip(&self.sources).zip(self.asked) {
            *course = match *source {
                Source::State(i) if !is_whole(asked.what) => Some(states.course(i)),
                _ => None,
            };
        }
        if !self.needs_rows {
            return;
        }
        let n = circuit.structure().n();
        for (k, row) in self.rows.iter_mut().enumerate() {
            let y = match k {
                0 => states.before(),
                k if k == POINTS - 1 => states.after(),
                _ => states.at(theta(k)),
            };
            self.assembly.row(circuit, theta(k).mul_add(h, t), &y[..n], &mut self.net, row);
        }
    }

    /// The greatest value of a step, of which the values at the points are given; with `sign` minus one the least one.
    fn extreme(
        &mut self,
        r: usize,
        at: (usize, f64, f64),
        (points, sign): ([f64; POINTS], f64),
        states: &mut Accepted<'_, R>,
        circuit: &Circuit<R>,
    ) -> f64 {
        let best =
            (0..POINTS).fold(0, |best, k| if sign * points[k] > sign * points[best] { k } else { best });
        if best == 0 || best == POINTS - 1 {
            return points[best];
        }
        let mut three = [best - 1, best, best + 1].map(|k| (theta(k), points[k]));
        for _ in 0..PARABOLAS {
            let [(a, fa), (b, fb), (c, fc)] = three;
            let (left, right) = ((b - a) * (fb - fc), (b - c) * (fb - fa));
            let peak = b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right);
            if !(peak > a && peak < c) || peak == b {
                break;
            }
            let value = self.value(r, at, peak, states, circuit);
            let new = (peak, value);
            three = match (sign * value > sign * fb, peak < b) {
                (true, true) => [three[0], new, three[1]],
                (true, false) => [three[1], new, three[2]],
                (false, true) => [new, three[1], three[2]],
                (false, false) => [three[0], three[1], new],
            };
        }
        three[1].1
    }

    /// When a column first passes a value in a step.
    fn passing(
        &mut self,
        r: usize,
        at: (usize, f64, f64),
        points: [f64; POINTS],
        (value, above): (f64, bool),
        states: &mut Accepted<'_, R>,
        circuit: &Circuit<R>,
    ) -> Option<f64> {
        let sign = if above { 1.0 } else { -1.0 };
        let left = |column: f64| sign * (value - column);
        let k = (0..POINTS).find(|&k| left(points[k]) < 0.0)?;
        let (_, t, h) = at;
        let Some(before) = k.checked_sub(1) else { return Some(t) };
        if left(points[before]) == 0.0 {
            return Some(theta(before).mul_add(h, t));
        }
        let (low, high) = ((theta(before), left(points[before])), (theta(k), left(points[k])));
        let root =
            locate(low.0, low.1, high.0, high.1, |theta| left(self.value(r, at, theta, states, circuit)));
        Some(root.mul_add(h, t))
    }
}

/// Whether it looks at no step.
fn is_whole(what: What) -> bool {
    matches!(what, What::Final | What::Samples { .. })
}

/// A circuit of lanes that are all alike.
fn gathered<R: Lane>(circuit: &Circuit<f64>) -> Circuit<R> {
    Circuit::gather(&vec![circuit; R::L])
}

impl<R: Lane> Output<R, Circuit<R>> for Follower<'_, R> {
    fn due(&self, lane: usize) -> f64 {
        self.times.get(self.next[lane]).copied().unwrap_or(f64::INFINITY)
    }

    fn sample(&mut self, lane: usize, t: f64, y: &[R], circuit: &Circuit<R>) {
        self.assembly.row(circuit, t, y, &mut self.net, &mut self.row);
        for (fold, asked) in self.folds[lane * self.asked.len()..].iter_mut().zip(self.asked) {
            if let What::Samples { .. } = asked.what {
                fold.samples.push(self.row[asked.column].get(lane));
            }
        }
        self.next[lane] += 1;
    }

    fn step(&mut self, lane: usize, t: f64, h: f64, states: &mut Accepted<'_, R>, circuit: &Circuit<R>) {
        if self.attempt != states.attempt() {
            self.look((t, h), states, circuit);
        }
        for r in 0..self.asked.len() {
            let (what, at) = (self.asked[r].what, (lane, t, h));
            let place = lane * self.asked.len() + r;
            let so_far = self.folds[place].value;
            let value = match what {
                What::Final | What::Samples { .. } => continue,
                What::When { .. } if !so_far.is_nan() => continue,
                // Far from the value nothing needs to be looked at.
                What::When { value, .. }
                    if self.courses[r].is_some_and(|course| {
                        (course.value(0.0).get(lane) - value).abs() > course.spread().get(lane)
                    }) && t > 0.0 =>
                {
                    continue;
                }
                What::When { value, above } => {
                    let points = self.points(r, lane, states);
                    let Some(time) = self.passing(r, at, points, (value, above), states, circuit) else {
                        continue;
                    };
                    time
                }
                What::Mean | What::Integral => {
                    let points = self.points(r, lane, states);
                    h.mul_add((0..POINTS).fold(0.0, |sum, k| points[k].mul_add(WEIGHTS[k], sum)), so_far)
                }
                What::Max | What::Min => {
                    let points = self.points(r, lane, states);
                    let sign = if what == What::Max { 1.0 } else { -1.0 };
                    let own = self.extreme(r, at, (points, sign), states, circuit);
                    if sign * own <= sign * so_far { so_far } else { own }
                }
            };
            self.folds[place].value = value;
        }
    }
}
