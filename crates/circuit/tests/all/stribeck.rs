//! Exact sticking: a mass below its breakaway force does not move, not by one bit, for as long as
//! one likes; it leaves at breakaway, stops where a mass with dry friction stops, and no rate at
//! which the force crosses zero makes stick and slip chatter.

use crate::support::*;
use circuit::{AxisId, Circuit, PartId};
use ode::{NoOutput, Stepper};
use physics::friction::AnyLaw;

const FC: f64 = 30.0;
const FS: f64 = 45.0;

/// A mass with friction, pulled through a spring by a carriage.
struct Pulled {
    circuit: Circuit<f64>,
    mass: AxisId,
    carriage: AxisId,
    drive: PartId,
}

fn pulled(mass: f64, friction: AnyLaw<f64>, force: f64, stiffness: f64) -> Pulled {
    let mut circuit = empty();
    let mass = circuit.axis(mass, 0.0, force, Some(friction.into()));
    let (carriage, drive) = circuit.servo(circuit::Carriage::rigid());
    circuit.link(carriage, mass, stiffness, 0.0);
    Pulled { circuit: circuit.build(false), mass, carriage, drive }
}

impl Pulled {
    fn start(&self, carriage: (f64, f64), rtol: f64) -> Stepper<f64, Circuit<f64>> {
        let mut circuit = self.circuit.clone();
        let y = circuit.initial(&[], &[(self.mass, 0.0, 0.0), (self.carriage, carriage.0, carriage.1)]);
        Stepper::new(circuit, 0.0, &y, options(rtol))
    }

    fn motion(&self, stepper: &Stepper<f64, Circuit<f64>>) -> (f64, f64) {
        let node = now(stepper)[self.mass];
        (node.x, node.v)
    }

    /// The carriage swings by a square wave of jerk, `periods` times; true where the mass never moved.
    fn swing(&self, stepper: &mut Stepper<f64, Circuit<f64>>, period: f64, periods: u32, jerk: f64) -> bool {
        let mut still = true;
        let mut until = stepper.time(0);
        for sign in [1.0, -1.0, -1.0, 1.0].into_iter().cycle().take(4 * periods as usize) {
            until += 0.25 * period;
            stepper.system_mut().set_input(self.drive.input(0), 0, sign * jerk);
            advance(stepper, until, &mut NoOutput);
            still &= self.motion(stepper) == (0.0, 0.0);
        }
        still
    }
}

/// Jerk and start (position, velocity) of a carriage that swings by +-`amplitude` in `period`.
fn swinging(amplitude: f64, period: f64) -> (f64, (f64, f64)) {
    // Four quarters q of jerk +j, -j, -j, +j from the velocity -j q^2/2: the velocity swings by
    // +-j q^2/2 and the position by -j q^3/3 at its first turn, +j q^3/3 at its second.
    let quarter = 0.25 * period;
    let jerk = 3.0 * amplitude / quarter.powi(3);
    (jerk, (0.0, -0.5 * jerk * quarter * quarter))
}

#[test]
fn it_does_not_move_by_one_bit_below_breakaway() {
    for force in [0.99 * FS, -0.99 * FS, 0.0] {
        let rig = pulled(2.0, stribeck(), force, 1e-9);
        let mut stepper = rig.start((0.0, 0.0), 1e-6);
        let mut trace = Trace::every(0.1, 1000.0);
        advance(&mut stepper, 1000.0, &mut trace);
        trace.finish(&stepper);
        assert_eq!(trace.states.len(), 10_001);
        for y in &trace.states {
            let node = nodes(stepper.system(), y)[rig.mass];
            assert!(node.x == 0.0 && node.v == 0.0 && node.a == 0.0 && node.friction == node.force);
        }
        assert_eq!(stepper.statistics(0).events, 0);
    }
    let rig = pulled(2.0, stribeck(), 1.01 * FS, 1e-9);
    let mut stepper = rig.start((0.0, 0.0), 1e-6);
    advance(&mut stepper, 1.0, &mut NoOutput);
    assert!(rig.motion(&stepper).1 > 0.1, "but above breakaway it does");
}

#[test]
fn a_swinging_force_below_breakaway_moves_nothing() {
    for period in [10.0, 0.1, 1e-3] {
        let rig = pulled(2.0, stribeck(), 0.0, 1e4);
        let (jerk, start) = swinging(0.9 * FS / 1e4, period);
        let mut stepper = rig.start(start, 1e-6);
        assert!(rig.swing(&mut stepper, period, 100, jerk), "period {period}");
        assert_eq!(stepper.statistics(0).events, 0);
    }
}

#[test]
fn it_leaves_when_the_force_is_the_breakaway_force() {
    let (stiffness, speed) = (1e4, 0.003);
    for direction in [1.0, -1.0] {
        let rig = pulled(2.0, stribeck(), 0.0, stiffness);
        let leaves = FS / (stiffness * speed);
        let mut stepper = rig.start((0.0, direction * speed), 1e-6);
        advance(&mut stepper, leaves * (1.0 - 1e-9), &mut NoOutput);
        assert_eq!(rig.motion(&stepper), (0.0, 0.0));
        advance(&mut stepper, leaves * (1.0 + 1e-6), &mut NoOutput);
        assert!(direction * rig.motion(&stepper).1 > 0.0, "it follows the force");
        assert_eq!(stepper.statistics(0).events, 1);
    }
}

#[test]
fn dry_friction_takes_the_same_from_every_half_swing() {
    // k x with Fc: each half period sqrt(m/k) pi costs 2 Fc/k of amplitude, until k |x| < Fc.
    let (mass, stiffness) = (2.0, 1000.0);
    let mut circuit = empty();
    let axis = circuit.axis(mass, 0.0, 0.0, Some(law("coulomb", &[("coulomb", FC)]).into()));
    circuit.spring(axis, stiffness, 0.4);
    let mut circuit = circuit.build(false);
    let lost = 2.0 * FC / stiffness;
    // 0.4 m away: 0.4, -0.34, 0.28, -0.22, 0.16, -0.10, 0.04, then 0.02 < 0.03 = Fc/k holds.
    let y = circuit.initial(&[], &[(axis, 0.8, 0.0)]);
    let half = std::f64::consts::PI * (mass / stiffness).sqrt();
    let mut stepper = Stepper::new(circuit, 0.0, &y, options(1e-10));
    let mut amplitude: f64 = 0.4;
    for swing in 1..=7 {
        amplitude -= lost;
        advance(&mut stepper, f64::from(swing) * half, &mut NoOutput);
        let side = if swing % 2 == 0 { 1.0 } else { -1.0 };
        let x = now(&stepper)[axis].x - 0.4;
        assert!((x - side * amplitude).abs() < 1e-8, "swing {swing}: {x} {amplitude}");
    }
    advance(&mut stepper, 100.0, &mut NoOutput);
    let node = now(&stepper)[axis];
    assert!(node.v == 0.0 && (node.x - 0.42).abs() < 1e-8, "it rests at {}", node.x);
    // It never stood still before: six reversals and one stop.
    assert_eq!(stepper.statistics(0).events, 7);
}

#[test]
fn no_rate_of_crossing_zero_makes_it_chatter() {
    let periods = 40;
    for stiffness in [1e3, 1e5, 1e7] {
        for period in [3.0, 0.3, 0.03, 3e-3, 3e-4] {
            for over in [1.05, 1.5, 6.0] {
                let rig = pulled(1.5, stribeck(), 0.0, stiffness);
                let (jerk, start) = swinging(over * FS / stiffness, period);
                let mut stepper = rig.start(start, 1e-6);
                rig.swing(&mut stepper, period, periods, jerk);
                // A mass stops at most once a half period of the force or of its own swing on the
                // spring, and every stop may be followed by one start.
                let own = (1.5 / stiffness).sqrt() * std::f64::consts::TAU;
                let halves = 2.0 * f64::from(periods) * (1.0 + period / own);
                let events = stepper.statistics(0).events as f64;
                assert!(
                    events <= 2.0 * halves + 2.0,
                    "{stiffness} {period} {over}: {events} events, {halves}"
                );
                let statistics = stepper.statistics(0);
                let work = (statistics.steps + statistics.rejected) as f64;
                assert!(work < 100.0 * halves + 2000.0, "{stiffness} {period} {over}: {work} attempts");
            }
        }
    }
}
