use crate::component::prelude::*;
use crate::component::valves::switching::{EXHAUST, FIVE, OPENS, SHUTS, five};
use crate::part::Armature;

/// A 5/2 valve with two coils.
pub struct Impulse52;

impl Component for Impulse52 {
    const KIND: Kind = Kind {
        key: "valve/impulse-5/2",
        title: "5/2 impulse valve",
        text: "Two coils and no spring: command 1 opens 1 to 4 and 2 to 3, command -1 opens 1 to 2 and 4 to 5, and without a \
               command, 0, the valve keeps its position. After a command the armature waits for the dead time, then it \
               travels at a constant rate to the end, even if the command ends; edges of one port are never open at \
               once. A pulse that is shorter than the dead time does not move it.",
        parameters: table! {
            conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C of the paths from port 1, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), "Critical pressure ratio b of the paths from port 1";
            ..EXHAUST;
            time_on: "s", physics::above(0.0), "Time from command 1 to the middle of the travel";
            time_off: "s", physics::above(0.0), follows "the time under command 1",
                "Time from command -1 to the middle of the travel back";
            travel_share: "1", physics::between(0.0, 1.0), default 0.2, assumed "usual for a small solenoid valve",
                "Fraction of these times for the whole travel";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        inputs: &[("command", "1", "1, 0 or -1: first coil, none or second coil")],
        ..FIVE
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let signal = build.circuit.signal();
        let zero = P::zero();
        let part = build.circuit.add(Armature { acts: zero, remembered: zero, commanded: zero, signal });
        let on = own.number("time_on").get(0);
        let times = [on, own.given("time_off").map_or(on, |off| off.get(0))];
        let share = own.number("travel_share").get(0);
        let (dead, travel) = (times.map(|time| time * (1.0 - 0.5 * share)), times.map(|time| time * share));
        let timing = Timing::Keep { part, dead, travel };
        build.columns(own, 0, [Quantity::Input(timing.commanded()), Quantity::Signal(signal)]);
        build.input(own, 0, Acts::Timed(timing, physics::within(-1.0, 1.0)));
        build.starts.push((Starting::Kept(signal), vec![format!("{}.position", own.name)]));
        five(own, at, (signal, [OPENS, SHUTS, SHUTS, OPENS]), build);
    }
}
