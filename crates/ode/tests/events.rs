//! Events are found where they are, none is missed, and an integration that is stopped, copied and
//! taken up again gives the bits of one that was not.

mod support;

use math::Real;
use ode::{NoOutput, Paused, Stepper};
use support::*;

const G: f64 = 9.81;
const RESTITUTION: f64 = 0.8;

/// A ball on a floor: (height, velocity, time); notes when it bounces.
#[derive(Clone, Default)]
struct Ball {
    bounces: Vec<f64>,
}

impl Equations for Ball {
    const EVENTS: usize = 1;
    const EVENT_TOLERANCE: f64 = 1e-12;
    fn n(&self) -> usize {
        3
    }
    fn f<S: Real + From<f64>>(&self, _t: S, y: &[S], dy: &mut [S]) {
        (dy[0], dy[1], dy[2]) = (y[1], S::from(-G), S::one());
    }
    fn events(&self, _t: f64, y: &[f64], out: &mut [f64]) {
        out[0] = y[0];
    }
    fn switch(&mut self, _event: usize, y: &mut [f64]) {
        (y[0], y[1]) = (0.0, -RESTITUTION * y[1]);
        self.bounces.push(y[2]);
    }
}

#[test]
fn a_ball_bounces_when_it_should() {
    let fall = (2.0_f64 / G).sqrt();
    let end = 0.999 * fall * (1.0 + 2.0 * RESTITUTION / (1.0 - RESTITUTION));
    let run = run(Ball::default(), (0.0, end), &[1.0, 0.0, 0.0], tolerance(1e-6));
    let mut exact = fall;
    let mut flight = 2.0 * fall;
    let bounces = &run.system().equations.bounces;
    for &bounce in bounces {
        assert!((bounce - exact).abs() < 1e-8, "{bounce} {exact}");
        flight *= RESTITUTION;
        exact += flight;
    }
    assert!(exact > end, "no bounce is missed");
    assert!(bounces.len() > 25);
    // Parabolas cost no step of their own: nearly all work is the events.
    let statistics = run.statistics(0);
    assert_eq!(statistics.events, bounces.len() as u64);
    assert!(statistics.steps + statistics.rejected < 8 * statistics.events);
}

/// An oscillator seen by a relay: the relay is on while x > threshold.
#[derive(Clone)]
struct Relay {
    threshold: f64,
    on: bool,
    switched: Vec<f64>,
}

impl Equations for Relay {
    const EVENTS: usize = 1;
    const EVENT_TOLERANCE: f64 = 1e-12;
    fn n(&self) -> usize {
        3
    }
    fn f<S: Real + From<f64>>(&self, _t: S, y: &[S], dy: &mut [S]) {
        (dy[0], dy[1], dy[2]) = (y[1], -y[0], S::one());
    }
    fn events(&self, _t: f64, y: &[f64], out: &mut [f64]) {
        let over = y[0] - self.threshold;
        out[0] = if self.on { over } else { -over };
    }
    fn switch(&mut self, _event: usize, y: &mut [f64]) {
        self.on = !self.on;
        self.switched.push(y[2]);
    }
}

#[test]
fn a_short_dip_below_the_threshold_is_seen() {
    // At the loosest tolerance a step spans much of a period, and the dip lies inside it.
    for (threshold, rtol) in [(0.0, 1e-9), (-0.9, 1e-9), (-0.9, 1e-3), (0.5, 1e-3)] {
        let relay = Relay { threshold, on: true, switched: Vec::new() };
        let periods = 20;
        let end = std::f64::consts::TAU * f64::from(periods);
        let run = run(relay, (0.0, end), &[1.0, 0.0, 0.0], tolerance(rtol));
        let switched = &run.system().equations.switched;
        assert_eq!(switched.len(), 2 * periods as usize, "{threshold} {rtol}");
        let down = threshold.acos();
        for (k, &t) in switched.iter().enumerate() {
            let phase = [down, std::f64::consts::TAU - down][k % 2];
            let exact = std::f64::consts::TAU * (k / 2) as f64 + phase;
            let bound = 100.0 * rtol * (1.0 + exact);
            assert!((t - exact).abs() < bound, "{threshold} {rtol}: {t} {exact}");
        }
    }
}

/// What a run leaves: everything that another run must equal, bit for bit.
fn trace(stepper: &Stepper<f64, Problem<Ball>>, samples: &Samples) -> (Vec<u64>, String) {
    let mut all = bits(stepper.state());
    all.extend(bits(&stepper.system().equations.bounces));
    all.extend(samples.states.iter().flat_map(|y| bits(y)));
    (all, format!("{:?}", stepper.statistics(0)))
}

#[test]
fn pieces_and_copies_give_the_same_bits() {
    let end = 4.0;
    let start = || {
        (
            Stepper::new(Problem::new(Ball::default()), 0.0, &[1.0, 0.0, 0.0], tolerance(1e-8)),
            Samples::at((0..4000).map(|k| f64::from(k) * 1e-3).collect()),
        )
    };
    let (mut whole, mut whole_samples) = start();
    finish(&mut whole, end, &mut whole_samples);
    assert_eq!(whole_samples.states.len(), 4000);

    let (mut pieces, mut pieces_samples) = start();
    let mut calls = 0;
    while pieces.advance(end, 1, &mut pieces_samples) == Paused::Budget {
        calls += 1;
        // Others go on from a copy, to another place, without a trace in this one.
        let mut copy = pieces.clone();
        let _ = copy.advance(0.5 * end, 3, &mut NoOutput);
        if calls % 7 == 0 {
            pieces = pieces.clone();
        }
    }
    assert!(calls > 40, "{calls}");
    let expected = trace(&whole, &whole_samples);
    assert_eq!(trace(&pieces, &pieces_samples), expected);
}
