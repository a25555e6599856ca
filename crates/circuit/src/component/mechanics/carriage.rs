use crate::component::prelude::*;
use crate::part::Carriage as Servo;
use physics::{Bounds, above, between};
use std::f64::consts::TAU;

/// A servo axis that moves as commanded.
pub struct CarriageComponent;

impl Component for CarriageComponent {
    const KIND: Kind = Kind {
        key: "carriage",
        title: "Carriage of a servo axis",
        text: "A commanded motion of piecewise constant jerk: x' = v, v' = a, a' = jerk. With a servo the carriage follows it as \
               a position loop of second order with the velocity fed forward, x_f'' = w^2 (x - x_f) + 2 zeta w (v - x_f'), \
               w = 2 pi f; its velocity ripples with x_f. No force changes its motion, except during a release: \
               m x_f'' = F - c x_f' with m = k t^2 and c = 2 k t, until the force F on it is zero.",
        ports: &[Port { holds: Holds::Motion, ..axis("1", false) }],
        parameters: table! {
            servo_bandwidth: "Hz", above(0.0), within "servo", "Natural frequency f of the position loop; without a value the carriage follows its command exactly";
            servo_damping_ratio: "1", above(0.0), within "servo", "Damping ratio zeta of the position loop";
            ripple_velocity: "1", Bounds { open: false, ..between(0.0, 1.0) }, within "ripple", "Relative velocity ripple, of screw or motor: below 1, so that the motion does not reverse";
            ripple_pitch: "m", above(0.0), within "ripple", "Distance after which the ripple repeats";
            release_stiffness: "N/m", above(0.0), within "release", "Stiffness k of the part between carriage and load, such as a force sensor";
            release_time: "s", above(0.0), default 0.02, assumed "a usual admittance control", within "release",
                "Time constant t of the release";
        },
        inputs: &[
            ("jerk_m_s3", "m/s3", "jerk of the command"),
            (
                "giving_way",
                "1",
                "1: the carriage moves until the force on it is zero; 0: it follows its command; only with a release",
            ),
        ],
        outputs: &[
            ("position_m", "m", "position"),
            ("velocity_m_s", "m/s", "velocity"),
            ("acceleration_m_s2", "m/s2", "acceleration"),
        ],
        ..Kind::PLAIN
    };

    fn bring<P: Lane>(_own: &Instance<P>, _port: usize, _ambient_temperature: P) -> Brings<P> {
        Brings::Motion
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let Some(axis) = at.axis(0) else { return };
        let mut servo = Servo { node: axis.0, ..Servo::rigid() };
        if let Some(bandwidth) = own.given("servo_bandwidth") {
            servo = servo.following(P::c(TAU) * bandwidth, own.number("servo_damping_ratio"));
        }
        let ripples = |velocity: &P| velocity.get(0) != 0.0 || own.is_free("ripple_velocity");
        if let Some(velocity) = own.given("ripple_velocity").filter(ripples) {
            servo = servo.rippling(velocity, own.number("ripple_pitch"));
        }
        let release = own.given("release_stiffness");
        if let Some(stiffness) = release {
            servo = servo.yielding(stiffness, own.number("release_time"));
        }
        let part = build.circuit.add(servo);
        build.input(own, 0, Acts::On(part.input(0)));
        if release.is_some() {
            build.input(own, 1, Acts::On(part.input(1)));
        }
        let quantities = [Quantity::Position(axis), Quantity::Velocity(axis), Quantity::Acceleration(axis)];
        build.columns(own, 0, quantities);
    }
}
