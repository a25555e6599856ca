//! Results kept of a member: numbers that are computed from its run step by step.

use circuit::{Assembly, Circuit, Net, Quantity, sample_times};
use math::{Lane, Work};
use ode::{Accepted, Course, Output, System, locate};

/// Points of a step at which a column is evaluated: its ends and the quarters between them.
const POINTS: usize = 5;
/// Weights of the integral over a step, from the values at the points, after Boole: exact to the fifth power
/// of time.
const WEIGHTS: [f64; POINTS] = [7.0 / 90.0, 32.0 / 90.0, 12.0 / 90.0, 32.0 / 90.0, 7.0 / 90.0];
/// Positions of the points, as fractions of a step.
fn theta(k: usize) -> f64 {
    k as f64 / (POINTS - 1) as f64
}

/// Number of parabolas that refine an extreme between the points.
const PARABOLAS: usize = 2;

/// Reduction of a column to numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Statistic {
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
    /// First time at which it is above (or below) a value, s. NaN if this does not happen.
    When {
        /// The value, in the column's unit.
        value: f64,
        /// Whether the column must rise above the value. Otherwise it must fall below.
        above: bool,
    },
    /// Greatest rate, 1/s of its unit, at which a state passes a value. NaN if this does not happen.
    Rate {
        /// The value, in the column's unit.
        value: f64,
        /// Whether the state must rise above the value. Otherwise it must fall below.
        above: bool,
    },
    /// Samples at a fixed rate, 1/s, from the start to the end.
    Samples {
        /// Rate, 1/s.
        rate: f64,
    },
}

/// Samples of a lane whose columns are computed together.
const MOST_WAITING: usize = 1024;

/// A column and its reduction.
#[derive(Clone, Copy, Debug)]
pub struct Reduction {
    /// Index of the column among those of the circuit.
    pub column: usize,
    /// Reduction of the column.
    pub what: Statistic,
}

/// Intermediate result of one reduction of one member.
#[derive(Clone, Debug, Default)]
struct Fold {
    value: f64,
    samples: Vec<f64>,
}

/// Follows the members in the lanes of a run.
pub struct Reducer<'a, R: Lane> {
    assembly: &'a Assembly,
    asked: &'a [Reduction],
    sources: Vec<Option<usize>>,
    /// Intermediate results, one for each lane and reduction.
    folds: Vec<Fold>,
    /// Sample times, and the next sample of each lane.
    times: Vec<f64>,
    next: Vec<usize>,
    /// Time and states of the samples whose columns are not computed yet. One row has the samples of all
    /// lanes.
    waiting: Vec<Vec<f64>>,
    /// Time and states of one sample of each lane.
    at: Vec<R>,
    needs_rows: bool,
    net: Net<R>,
    /// Current attempt of a step. All lanes that accept it share the fields below.
    attempt: u64,
    /// Course of each reduction's state over the step.
    courses: Vec<Option<Course<R>>>,
    /// Lanes in which the state of a reduction stays far from its threshold in this attempt, one bit mask for
    /// each reduction. `found` has the lanes that have passed it before.
    far: Vec<u64>,
    found: Vec<u64>,
    /// Lanes with work to do in this attempt. A second mask has the lanes that have taken a step.
    busy: u64,
    begun: u64,
    /// All columns at the points of the step.
    rows: [Vec<R>; POINTS],
    row: Vec<R>,
}

impl<'a, R: Lane> Reducer<'a, R> {
    /// Creates a follower for members with the structure of `assembly`, over `duration` s if samples are requested.
    pub fn new(assembly: &'a Assembly, asked: &'a [Reduction], duration: f64) -> Self {
        let quantity = |asked: &Reduction| assembly.variables.quantities[asked.column];
        let source = |asked: &Reduction| {
            let (axis, offset) = match quantity(asked) {
                Quantity::Position(axis) => (axis, 0),
                Quantity::Velocity(axis) => (axis, 1),
                _ => return None,
            };
            Some(assembly.circuit.position_state(axis)? + offset)
        };
        let sources: Vec<Option<usize>> = asked.iter().map(source).collect();
        let rate = asked.iter().find_map(|asked| match asked.what {
            Statistic::Samples { rate } => Some(rate),
            _ => None,
        });
        Reducer {
            folds: vec![Fold::default(); R::L * asked.len()],
            times: rate.map_or(Vec::new(), |rate| sample_times(duration, rate)),
            next: vec![usize::MAX; R::L],
            waiting: vec![Vec::new(); R::L],
            at: vec![R::zero(); 1 + assembly.circuit.structure().n],
            needs_rows: sources
                .iter()
                .zip(asked)
                .any(|(source, asked)| source.is_none() && !is_whole(asked.what)),
            net: Circuit::<R>::gather(&vec![&*assembly.circuit; R::L]).work(),
            rows: std::array::from_fn(|_| vec![R::zero(); assembly.columns().len()]),
            row: vec![R::zero(); assembly.columns().len()],
            attempt: 0,
            courses: vec![None; asked.len()],
            far: vec![0; asked.len()],
            found: vec![0; asked.len()],
            busy: 0,
            begun: 0,
            sources,
            assembly,
            asked,
        }
    }

    /// Starts a new member in a lane.
    pub fn init(&mut self, lane: usize) {
        self.next[lane] = 0;
        self.waiting[lane].clear();
        self.attempt = 0;
        self.begun &= !(1 << lane);
        self.found.iter_mut().for_each(|found| *found &= !(1 << lane));
        for (fold, asked) in self.folds[lane * self.asked.len()..].iter_mut().zip(self.asked) {
            fold.samples.clear();
            fold.value = match asked.what {
                Statistic::Mean | Statistic::Integral => 0.0,
                _ => f64::NAN,
            };
        }
    }

    /// Ends the member of a lane in the settled state `y`, and returns its numbers one after the other.
    pub fn finish(&mut self, lane: usize, (t, y): (f64, &[R]), circuit: &Circuit<R>, out: &mut [f64]) {
        while self.next[lane] < self.times.len() {
            self.sample(lane, self.times[self.next[lane]], y, circuit);
        }
        self.changes(lane, circuit);
        let row = &mut self.row;
        if self.asked.iter().any(|asked| asked.what == Statistic::Final) {
            self.assembly.row(circuit, R::c(t), y, &mut self.net, row);
        }
        let mut out = out.iter_mut();
        let mut put = |value: f64| *out.next().expect("room for each number") = value;
        for (fold, asked) in self.folds[lane * self.asked.len()..].iter().zip(self.asked) {
            match asked.what {
                Statistic::Final => put(row[asked.column].get(lane)),
                Statistic::Mean => put(fold.value / t),
                Statistic::Samples { .. } => fold.samples.iter().for_each(|value| put(*value)),
                _ => put(fold.value),
            }
        }
    }

    /// Returns a column at a fraction of a step.
    fn value(&mut self, r: usize, lane: usize, theta: f64, step: &mut AcceptedStep<'_, '_, R>) -> f64 {
        if let Some(course) = self.courses[r] {
            return course.of(lane).value(theta);
        }
        let (circuit, time) = (step.circuit, R::c(step.time(theta)));
        let y = &step.states.at(theta)[..circuit.structure().n];
        self.assembly.row(circuit, time, y, &mut self.net, &mut self.row);
        self.row[self.asked[r].column].get(lane)
    }

    /// Returns a column at the points of a step.
    fn points(&self, r: usize, lane: usize, states: &mut Accepted<'_, R>) -> [f64; POINTS] {
        std::array::from_fn(|k| match (self.sources[r], self.courses[r]) {
            (Some(i), _) if k == 0 => states.before()[i].get(lane),
            (Some(i), _) if k == POINTS - 1 => states.after()[i].get(lane),
            (_, Some(course)) => course.of(lane).value(theta(k)),
            _ => self.rows[k][self.asked[r].column].get(lane),
        })
    }

    /// Prepares the data of an attempt that all lanes share.
    #[inline(always)]
    fn look(&mut self, step: &mut AcceptedStep<'_, '_, R>) {
        self.attempt = step.states.attempt();
        self.busy = !self.begun;
        for (r, asked) in self.asked.iter().enumerate() {
            if is_whole(asked.what) {
                continue;
            }
            let Some(i) = self.sources[r] else {
                self.busy = !0;
                continue;
            };
            let course = step.states.course(i);
            self.courses[r] = Some(course);
            if let Statistic::When { value, .. } | Statistic::Rate { value, .. } = asked.what {
                let way = (course.value(0.0) - R::c(value)).abs();
                self.far[r] = R::mask_bits(course.spread().lt(way));
                self.busy |= !(self.far[r] | self.found[r]);
            } else {
                self.busy = !0;
            }
        }
        if !self.needs_rows {
            return;
        }
        let n = step.circuit.structure().n;
        for (k, row) in self.rows.iter_mut().enumerate() {
            let time = R::c(step.time(theta(k)));
            let y = match k {
                0 => step.states.before(),
                k if k == POINTS - 1 => step.states.after(),
                _ => step.states.at(theta(k)),
            };
            self.assembly.row(step.circuit, time, &y[..n], &mut self.net, row);
        }
    }

    /// Returns the greatest value of a step from the values at its points, or the least value if `sign` is
    /// minus one. If it cannot exceed the previous extreme, the interval between the points is not searched.
    fn extreme(
        &mut self,
        (r, lane): (usize, usize),
        (points, sign, so_far): ([f64; POINTS], f64, f64),
        step: &mut AcceptedStep<'_, '_, R>,
    ) -> f64 {
        let greater = |best: usize, k: usize| if sign * points[k] > sign * points[best] { k } else { best };
        let best = (0..POINTS).fold(0, greater);
        let range = points.iter().fold(0.0_f64, |range, value| range.max((value - points[best]).abs()));
        if sign * points[best] + range < sign * so_far {
            return points[best];
        }
        let middle = best.clamp(1, POINTS - 2);
        let mut three = [middle - 1, middle, middle + 1].map(|k| (theta(k), points[k]));
        if best != middle {
            // The extreme may be near an end of the step.
            let between = 0.5 * (theta(best) + theta(middle));
            let new = (between, self.value(r, lane, between, step));
            let (first, last) = (best.min(middle), best.max(middle));
            three = [(theta(first), points[first]), new, (theta(last), points[last])];
        }
        let mut greatest = three
            .iter()
            .fold(points[best], |so_far, one| if sign * one.1 > sign * so_far { one.1 } else { so_far });
        for _ in 0..PARABOLAS {
            let [(a, fa), (b, fb), (c, fc)] = three;
            let (left, right) = ((b - a) * (fb - fc), (b - c) * (fb - fa));
            let peak = b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right);
            if !(peak > a && peak < c) || peak == b {
                break;
            }
            let value = self.value(r, lane, peak, step);
            if sign * value > sign * greatest {
                greatest = value;
            }
            let new = (peak, value);
            three = match (sign * value > sign * fb, peak < b) {
                (true, true) => [three[0], new, three[1]],
                (true, false) => [three[1], new, three[2]],
                (false, true) => [new, three[1], three[2]],
                (false, false) => [three[0], three[1], new],
            };
        }
        greatest
    }

    /// Returns the first time in a step at which a column passes a value.
    fn passing(
        &mut self,
        (r, lane): (usize, usize),
        (value, above): (f64, bool),
        step: &mut AcceptedStep<'_, '_, R>,
    ) -> Option<f64> {
        let points = self.points(r, lane, step.states);
        let sign = if above { 1.0 } else { -1.0 };
        let left = |column: f64| sign * (value - column);
        let k = (0..POINTS).find(|&k| left(points[k]) < 0.0)?;
        let Some(before) = k.checked_sub(1) else { return Some(step.t) };
        if left(points[before]) == 0.0 {
            return Some(step.time(theta(before)));
        }
        let (low, high) = ((theta(before), left(points[before])), (theta(k), left(points[k])));
        let root = locate(low.0, low.1, high.0, high.1, |theta| left(self.value(r, lane, theta, step)));
        Some(step.time(root))
    }
}

/// An accepted step from a time t, of a length h, s.
struct AcceptedStep<'l, 's, R: Lane> {
    t: f64,
    h: f64,
    states: &'l mut Accepted<'s, R>,
    circuit: &'l Circuit<R>,
}

impl<R: Lane> AcceptedStep<'_, '_, R> {
    /// Returns the time at a fraction of the step, s.
    #[inline(always)]
    fn time(&self, theta: f64) -> f64 {
        theta.mul_add(self.h, self.t)
    }
}

/// Prepares the data of an attempt that all lanes share.
struct AttemptWork<'w, 'a, 'l, 's, R: Lane>(&'w mut Reducer<'a, R>, &'w mut AcceptedStep<'l, 's, R>);

impl<R: Lane> Work for AttemptWork<'_, '_, '_, '_, R> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        self.0.look(self.1);
    }
}

/// Returns whether no step has to be evaluated.
fn is_whole(what: Statistic) -> bool {
    matches!(what, Statistic::Final | Statistic::Samples { .. })
}

impl<R: Lane> Output<R, Circuit<R>> for Reducer<'_, R> {
    fn due(&self, lane: usize) -> f64 {
        self.times.get(self.next[lane]).copied().unwrap_or(f64::INFINITY)
    }

    #[inline(always)]
    fn sample(&mut self, lane: usize, t: f64, y: &[R], circuit: &Circuit<R>) {
        let waiting = &mut self.waiting[lane];
        waiting.push(t);
        waiting.extend(y.iter().map(|state| state.get(lane)));
        self.next[lane] += 1;
        if waiting.len() >= MOST_WAITING * self.at.len() {
            self.changes(lane, circuit);
        }
    }

    #[inline(always)]
    fn changes(&mut self, lane: usize, circuit: &Circuit<R>) {
        if !self.waiting[lane].is_empty() {
            self.put_samples(lane, circuit);
        }
    }

    #[inline(always)]
    fn step(&mut self, lane: usize, t: f64, h: f64, states: &mut Accepted<'_, R>, circuit: &Circuit<R>) {
        let mut step = AcceptedStep { t, h, states, circuit };
        if self.attempt != step.states.attempt() {
            R::within(AttemptWork(self, &mut step));
        }
        if self.busy >> lane & 1 == 1 {
            self.attend(lane, &mut step);
        }
    }
}

impl<R: Lane> Reducer<'_, R> {
    /// Computes the columns of all waiting samples of a lane, and of as many samples of each other lane.
    fn put_samples(&mut self, lane: usize, circuit: &Circuit<R>) {
        let (width, end) = (self.at.len(), self.waiting[lane].len());
        for from in (0..end).step_by(width) {
            let of = |other: usize| self.waiting[other].get(from..from + width);
            let own = &self.waiting[lane][from..from + width];
            for (i, at) in self.at.iter_mut().enumerate() {
                *at = R::from_lanes(|other| of(other).unwrap_or(own)[i]);
            }
            self.assembly.row(circuit, self.at[0], &self.at[1..], &mut self.net, &mut self.row);
            let all = self.folds.chunks_exact_mut(self.asked.len()).enumerate();
            for (other, folds) in all.filter(|(other, _)| of(*other).is_some()) {
                for (fold, asked) in folds.iter_mut().zip(self.asked) {
                    if let Statistic::Samples { .. } = asked.what {
                        fold.samples.push(self.row[asked.column].get(other));
                    }
                }
            }
        }
        for waiting in &mut self.waiting {
            waiting.drain(..end.min(waiting.len()));
        }
    }

    /// Evaluates an accepted step of a lane whose outputs need this step.
    fn attend(&mut self, lane: usize, step: &mut AcceptedStep<'_, '_, R>) {
        let (t, h) = (step.t, step.h);
        self.begun |= 1 << lane;
        for r in 0..self.asked.len() {
            let what = self.asked[r].what;
            let place = lane * self.asked.len() + r;
            let so_far = self.folds[place].value;
            let value = match what {
                Statistic::Final | Statistic::Samples { .. } => continue,
                Statistic::When { .. } if !so_far.is_nan() => continue,
                // Far from the threshold, the step is not evaluated.
                _ if t > 0.0 && self.far[r] >> lane & 1 == 1 => continue,
                Statistic::When { value, above } => {
                    let Some(time) = self.passing((r, lane), (value, above), step) else { continue };
                    self.found[r] |= 1 << lane;
                    time
                }
                Statistic::Rate { value, above } => {
                    let Some(course) = self.courses[r].map(|course| course.of(lane)) else { continue };
                    let time = self.passing((r, lane), (value, above), step);
                    let Some(time) = time.filter(|time| *time > t) else { continue };
                    so_far.max((course.value_and_slope((time - t) / h)[1] / h).abs())
                }
                Statistic::Mean | Statistic::Integral => {
                    let points = self.points(r, lane, step.states);
                    h.mul_add((0..POINTS).fold(0.0, |sum, k| points[k].mul_add(WEIGHTS[k], sum)), so_far)
                }
                Statistic::Max | Statistic::Min => {
                    let points = self.points(r, lane, step.states);
                    let sign = if what == Statistic::Max { 1.0 } else { -1.0 };
                    let own = self.extreme((r, lane), (points, sign, so_far), step);
                    if sign * own <= sign * so_far { so_far } else { own }
                }
            };
            self.folds[place].value = value;
        }
    }
}
