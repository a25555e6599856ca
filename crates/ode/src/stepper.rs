//! The integration loop: the same for a single system, for lanes and for every caller.

mod attempt;
mod memory;
mod refresh;
mod refusal;
mod saltation;
mod samples;
mod search;

use crate::approach::FAR_OFF;
use crate::control::{Control, Failure, Options, Statistics, factor};
use crate::dense::Step;
use crate::event::{Found, LOOKOUTS};
use crate::linear::{Linear, blocks};
use crate::output::{Accepted, Output};
use crate::stages::{BLOCK, Block, MOST_STAGES, Method, zeros};
use crate::structure::{DIRECTIONS, Structure};
use crate::swing::Swing;
use crate::system::System;
use math::{Dual, Lane, Real, Work};
use std::sync::Arc;

/// Steps below this fraction of the present time (or of 1) do not advance the clock reliably.
const MIN_RELATIVE_STEP: f64 = 4.0 * f64::EPSILON;

/// Returns whether the clock cannot tell two times, s, apart, so that no step leads from one to the other.
pub fn same_time(one: f64, other: f64) -> bool {
    (one - other).abs() <= MIN_RELATIVE_STEP * other.abs().max(1.0)
}

/// The first step may change the state by about this fraction of its size.
const FIRST_SHARE: f64 = 0.01;
/// Relative rate of a state, 1/s, below which it counts as at rest when the first step is chosen.
const LEAST_RATE: f64 = 1e-9;
/// Least first trial step, s.
const LEAST_FIRST_STEP: f64 = 1e-9;
/// Step of an idle lane, s. Any value that keeps its numbers finite is correct.
const IDLE_STEP: f64 = 1e-9;

type Direction<R> = Dual<R, DIRECTIONS>;

/// Returns whether [`System::inside`] is negative or NaN.
#[inline(always)]
fn is_outside<R: Lane>(inside: R::Plain, lane: usize) -> bool {
    let value = inside.get(lane);
    value.is_nan() || value <= 0.0
}

/// Reason why `advance` returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paused {
    /// Every lane is at the target or has failed; see [`Stepper::failure`].
    Arrived,
    /// The budget of attempts is used up. Call again to continue.
    Budget,
}

/// A running integration. It can be resumed and cloned, and it keeps step size and Jacobian.
#[derive(Clone)]
pub struct Stepper<R: Lane, Sys: System<R>> {
    system: Sys,
    options: Options,
    structure: Arc<Structure>,
    lanes: Vec<Control>,
    t: Vec<f64>,
    y: Vec<Block<R>>,
    f0: Vec<Block<R>>,
    f_t: Vec<Block<R>>,
    linear: Linear<R>,
    u: Vec<Block<R>>,
    stage: Vec<Block<R>>,
    rhs: Vec<Block<R>>,
    step: Step<R>,
    scale: Vec<Block<R::Plain>>,
    g0: Vec<R>,
    /// Event functions at the interior points of the present attempt, if they were evaluated.
    looks: [Vec<R>; LOOKOUTS.len()],
    looked: bool,
    /// Whether the attempt ends in the valid range of the equations, if this was checked.
    inside: Option<R::Plain>,
    g_look: Vec<R>,
    /// Distances to the obstacles, at the start of an attempt and at its end.
    obstacles: [Vec<R>; 2],
    /// Derivative of the time of the present event by the differentiated numbers. Its value is zero.
    event_shift: R,
    seeded: bool,
    fresh: bool,
    started: Vec<bool>,
    /// Target time of each lane, s. Minus infinity for an idle lane.
    until: Vec<f64>,
    /// Limit on the attempts of each lane.
    allowed: Vec<u64>,
    /// Attempts that remain for the method of `begin_with`.
    begun_with: u64,
    completes: bool,
    work: Sys::Work<R>,
    dual_work: Sys::Work<Direction<R>>,
    dual_y: Vec<Direction<R>>,
    dual_dy: Vec<Direction<R>>,
}

/// End of an attempt of this length, with its output.
struct Conclusion<'s, R: Lane, Sys: System<R>, O>(&'s mut Stepper<R, Sys>, R::Plain, &'s mut O);

impl<R: Lane, Sys: System<R>, O: Output<R, Sys>> Work for Conclusion<'_, R, Sys, O> {
    type Out = ();
    #[inline(always)]
    fn work(self) {
        self.0.judge_lanes(self.1, self.2);
    }
}

impl<R: Lane, Sys: System<R>> Stepper<R, Sys> {
    /// Starts at time `t0` with state `y0` (one entry for each state).
    pub fn new(system: Sys, t0: f64, y0: &[R], options: Options) -> Self {
        let structure = system.structure().clone();
        let n = structure.n;
        assert_eq!(y0.len(), n, "one initial value for each state");
        let blocks = blocks(n);
        let mut y = zeros(blocks);
        y.as_flattened_mut()[..n].copy_from_slice(y0);
        let mut scale = vec![[R::Plain::one(); BLOCK]; blocks];
        for (scale, own) in scale.as_flattened_mut().iter_mut().zip(system.scale()) {
            *scale = own.plain();
        }
        let (n_events, n_obstacles) = (system.n_events(), system.n_obstacles());
        let (work, dual_work) = (system.work::<R>(), system.work::<Direction<R>>());
        let swings = |lane: usize| {
            let each = system.swings().into_iter();
            each.map(|(state, speed)| Swing::new(state, speed.get(lane), options.rtol)).collect()
        };
        Stepper {
            options,
            lanes: (0..R::L).map(|lane| Control::new(swings(lane))).collect(),
            t: vec![t0; R::L],
            y,
            f0: zeros(blocks),
            f_t: zeros(if structure.depends_on_time { blocks } else { 0 }),
            linear: Linear::new(&structure),
            u: zeros(MOST_STAGES * blocks),
            stage: zeros(blocks),
            rhs: zeros(blocks),
            step: Step::new(blocks),
            scale,
            g0: vec![R::zero(); n_events],
            looks: std::array::from_fn(|_| vec![R::zero(); n_events]),
            looked: false,
            inside: None,
            g_look: vec![R::zero(); n_events],
            obstacles: std::array::from_fn(|_| vec![R::zero(); n_obstacles]),
            event_shift: R::zero(),
            seeded: false,
            fresh: false,
            started: vec![false; R::L],
            until: vec![f64::NEG_INFINITY; R::L],
            allowed: vec![options.max_attempts; R::L],
            begun_with: 0,
            completes: system.completes(),
            work,
            dual_work,
            dual_y: vec![Direction::zero(); n],
            dual_dy: vec![Direction::zero(); n],
            structure,
            system,
        }
    }

    /// Returns the integrated system.
    pub fn system(&self) -> &Sys {
        &self.system
    }

    /// Returns the system, to set its inputs. The next step uses them and keeps the step size.
    pub fn system_mut(&mut self) -> &mut Sys {
        self.fresh = false;
        &mut self.system
    }

    /// Returns the time that a lane has reached, s.
    pub fn time(&self, lane: usize) -> f64 {
        self.t[lane]
    }

    /// Returns the present state, one entry for each state.
    pub fn state(&self) -> &[R] {
        &self.y.as_flattened()[..self.structure.n]
    }

    /// Returns the present state, to change it between two steps. The next step keeps the step size.
    pub fn state_mut(&mut self) -> &mut [R] {
        self.fresh = false;
        &mut self.y.as_flattened_mut()[..self.structure.n]
    }

    /// Sets the time of every lane, s, and the state.
    pub fn skip(&mut self, t: f64, y: &[R]) {
        self.t.fill(t);
        self.state_mut().copy_from_slice(y);
    }

    /// Continues from time, state and step size of another stepper whose system is equal.
    pub fn follow(&mut self, other: &Self) {
        self.lanes.clone_from(&other.lanes);
        self.t.copy_from_slice(&other.t);
        self.y.copy_from_slice(&other.y);
        self.scale.copy_from_slice(&other.scale);
        self.started.copy_from_slice(&other.started);
        self.allowed.copy_from_slice(&other.allowed);
        self.event_shift = other.event_shift;
        self.fresh = false;
    }

    /// Makes the next attempts, at most this many, by a method. Others, and those after `attempts` is 0, are made by the
    /// default method.
    pub fn begin_with(&mut self, method: Method, attempts: u64) {
        self.options.method = if attempts > 0 { method } else { Method::default() };
        self.begun_with = attempts;
    }

    /// Allows this many further attempts.
    pub fn allow(&mut self, attempts: u64) {
        let done = self.lanes.iter().map(|lane| lane.statistics.factorisations).max().unwrap_or(0);
        self.allowed.fill(done.saturating_add(attempts));
    }

    /// Allows this many attempts for the state that was loaded into a lane.
    pub fn allow_in(&mut self, lane: usize, attempts: u64) {
        self.allowed[lane] = attempts;
    }

    /// Returns the reason why a lane stopped early, if any.
    pub fn failure(&self, lane: usize) -> Option<Failure> {
        self.lanes[lane].failure
    }

    /// Returns the work counts of a lane.
    pub fn statistics(&self, lane: usize) -> Statistics {
        self.lanes[lane].statistics
    }

    /// Integrates every lane up to `until`, or for `budget` attempts. A sample before `until` is given as
    /// soon as its step is accepted. A sample at `until` belongs to the next call.
    pub fn advance(&mut self, until: f64, budget: u64, output: &mut impl Output<R, Sys>) -> Paused {
        self.until.fill(until);
        for _ in 0..budget {
            if (0..R::L).all(|lane| self.finished(lane)) {
                return Paused::Arrived;
            }
            self.attempt_one(output);
        }
        if (0..R::L).all(|lane| self.finished(lane)) { Paused::Arrived } else { Paused::Budget }
    }

    /// Integrates each lane towards its own time, until one has arrived or failed, or for `budget` attempts.
    /// A lane whose time is minus infinity is idle.
    pub fn advance_each(&mut self, until: &[f64], budget: u64, output: &mut impl Output<R, Sys>) -> Paused {
        self.until.copy_from_slice(until);
        for _ in 0..budget {
            if (0..R::L).any(|lane| until[lane] > f64::NEG_INFINITY && self.finished(lane)) {
                return Paused::Arrived;
            }
            self.attempt_one(output);
        }
        Paused::Budget
    }

    /// Starts another state in a lane at a time. The system must already have the lane's new member.
    pub fn load(&mut self, lane: usize, t: f64, y: &[f64]) {
        let swings = self.system.swings().into_iter();
        let swings = swings.map(|(state, speed)| Swing::new(state, speed.get(lane), self.options.rtol));
        self.lanes[lane] = Control::new(swings.collect());
        self.t[lane] = t;
        let own = self.y.as_flattened_mut().iter_mut().zip(self.scale.as_flattened_mut());
        for (((state, scale), new), y) in own.zip(self.system.scale()).zip(y) {
            state.put(lane, *y);
            scale.put(lane, new.get(lane));
        }
        self.started[lane] = false;
        self.fresh = false;
    }

    fn attempt_one(&mut self, output: &mut impl Output<R, Sys>) {
        if !self.fresh {
            self.refresh();
        }
        if !self.started.iter().all(|started| *started) {
            self.start();
        }
        let h = self.proposals();
        self.attempt(h);
        self.conclude(h, output);
        if self.begun_with > 0 {
            self.begin_with(self.options.method, self.begun_with - 1);
        }
    }

    fn finished(&self, lane: usize) -> bool {
        self.t[lane] >= self.until[lane] || self.lanes[lane].failure.is_some()
    }

    /// Chooses a first step from the size of the state and its rate.
    fn start(&mut self) {
        let rtol = self.options.rtol;
        let new: Vec<usize> = (0..R::L).filter(|&lane| !self.started[lane]).collect();
        for &lane in &new {
            let (mut size, mut rate) = (0.0_f64, 0.0_f64);
            let states = self.y.as_flattened().iter().zip(self.f0.as_flattened());
            for ((y, f), scale) in states.zip(self.scale.as_flattened()) {
                let (y, f) = (y.get(lane).abs(), f.get(lane).abs());
                size = size.max(y / (scale.get(lane) + y));
                rate = rate.max(f / (scale.get(lane) + y));
            }
            let h = FIRST_SHARE * size.max(rtol) / rate.max(LEAST_RATE);
            let h = h.max(self.options.least_first_step);
            self.lanes[lane].wish = h.min(self.until[lane] - self.t[lane]).max(LEAST_FIRST_STEP);
        }
        for lane in new {
            if self.starts_outside(lane) && self.system.meet(lane) {
                self.refresh();
            }
            if self.starts_outside(lane) {
                self.lanes[lane].failure = Some(Failure::Outside { t: self.t[lane] });
            }
            self.started[lane] = true;
        }
    }

    fn starts_outside(&mut self, lane: usize) -> bool {
        let n = self.structure.n;
        is_outside::<R>(self.system.inside(&self.y.as_flattened()[..n], &mut self.work), lane)
    }

    fn proposals(&mut self) -> R::Plain {
        let mut h = R::Plain::one();
        for lane in 0..R::L {
            let (t, until) = (self.t[lane], self.until[lane]);
            let control = &mut self.lanes[lane];
            let attempts = control.statistics.factorisations;
            if attempts >= self.allowed[lane] && t < until && control.failure.is_none() {
                control.failure = Some(Failure::TooManyAttempts { t, attempts });
            }
            let idle = self.finished(lane);
            let control = &mut self.lanes[lane];
            // An idle lane repeats a step that is never accepted.
            h.put(
                lane,
                if idle { IDLE_STEP } else { control.propose(self.t[lane], until, self.options.max_step) },
            );
        }
        h
    }

    /// Adds the part of one lane's quadratures that their integrals do not cover, at the end of the attempt.
    fn complete(&mut self, lane: usize) {
        let n = self.structure.n;
        let more = &mut self.rhs.as_flattened_mut()[..n];
        more.fill(R::zero());
        self.system.complete(&mut Accepted { step: &mut self.step, u: &self.u }, more);
        let first = self.structure.n_coupled;
        let quadratures = self.step.y1.as_flattened_mut()[..n].iter_mut().zip(more.iter()).skip(first);
        for (y1, more) in quadratures {
            y1.take(lane, &(*y1 + *more));
        }
    }

    /// Accepts, rejects or cuts the attempt, lane by lane.
    fn conclude(&mut self, h: R::Plain, output: &mut impl Output<R, Sys>) {
        R::within(Conclusion(self, h, output));
    }

    #[inline(always)]
    fn judge_lanes(&mut self, h: R::Plain, output: &mut impl Output<R, Sys>) {
        let error = self.error();
        let factor = factor(error);
        (self.looked, self.inside) = (false, None);
        let (mut any_accepted, mut taken_over) = (false, 0);
        let n = self.structure.n;
        for lane in 0..R::L {
            if self.finished(lane) {
                continue;
            }
            let (t0, h_lane) = (self.t[lane], h.get(lane));
            let control = &mut self.lanes[lane];
            control.statistics.right_hand_sides += self.options.method.right_hand_sides();
            control.statistics.factorisations += 1;
            if !control.judge(h_lane, error.get(lane), factor.get(lane)) {
                self.check_progress(lane, error.get(lane));
                let error = error.get(lane);
                if !self.obstacles[0].is_empty() && (error > FAR_OFF || error.is_nan()) {
                    self.stop_before_obstacle(lane, h_lane);
                }
                continue;
            }
            let mut taken = None;
            if !self.g0.is_empty() {
                match self.look_for_event(lane, t0, h_lane, h) {
                    Found::Nothing => {}
                    Found::AtEnd(event) => taken = Some(event),
                    // If the clock's rounding leaves no room for a cut, the event is at the end of the step.
                    Found::Inside(theta, event) if theta >= 1.0 => taken = Some(event),
                    Found::Inside(theta, event) => {
                        let control = &mut self.lanes[lane];
                        control.statistics.steps -= 1;
                        control.statistics.rejected += 1;
                        if theta * h_lane > MIN_RELATIVE_STEP * t0.abs().max(1.0) {
                            control.cut_onto_event(theta * h_lane);
                        } else {
                            output.changes(lane, &self.system);
                            self.switch(lane, event, false);
                            any_accepted = true;
                        }
                        self.check_progress(lane, error.get(lane));
                        continue;
                    }
                }
            }
            let t1 = if self.lanes[lane].last { self.until[lane] } else { t0 + h_lane };
            let inside = match self.inside {
                Some(inside) => inside,
                None => self.system.inside(&self.step.y1.as_flattened()[..n], &mut self.work),
            };
            self.inside = Some(inside);
            if is_outside::<R>(inside, lane) {
                self.lanes[lane].take_back(h_lane);
                output.changes(lane, &self.system);
                if !self.system.meet(lane) {
                    self.check_outside(lane);
                }
                continue;
            }
            if self.completes {
                self.complete(lane);
            }
            if let Some(theta) = self.give_samples(lane, t0, h_lane, t1, output) {
                // The step now ends at the sample. Earlier samples stay.
                let control = &mut self.lanes[lane];
                control.take_back(theta * h_lane);
                control.cut = Some(theta * h_lane);
                self.check_outside(lane);
                continue;
            }
            let states = &mut Accepted { step: &mut self.step, u: &self.u };
            output.step(lane, t0, h_lane, states, &self.system);
            self.t[lane] = t1;
            let ends = [&self.step.y0, &self.step.y1].map(|y| y.as_flattened());
            self.lanes[lane].follow(h_lane, |state| ends.map(|y| y[state].get(lane)));
            any_accepted = true;
            match taken {
                Some(event) => {
                    self.take_over(1 << lane);
                    output.changes(lane, &self.system);
                    self.switch(lane, event, true);
                }
                None => {
                    taken_over |= 1 << lane;
                    let control = &mut self.lanes[lane];
                    control.idle_switches = 0;
                    control.cuts = if control.cutting { control.cuts } else { 0 };
                    self.event_shift = R::zero();
                }
            }
        }
        if any_accepted {
            self.take_over(taken_over);
            self.fresh = false;
        }
    }

    /// Makes the end of the attempt the state of these lanes.
    #[inline(always)]
    fn take_over(&mut self, lanes: u64) {
        let mask = R::mask_of(lanes);
        for (y, y1) in self.y.as_flattened_mut().iter_mut().zip(self.step.y1.as_flattened()) {
            *y = R::select(mask, *y1, *y);
        }
    }
}
