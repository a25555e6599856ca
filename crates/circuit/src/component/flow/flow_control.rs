use crate::component::prelude::*;

/// A one-way flow control: a needle parallel to a check valve.
pub struct FlowControl;

/// Port 1 is on the valve's side, and port 2 on the cylinder's.
impl Component for FlowControl {
    const KIND: Kind = Kind {
        key: "flow-control",
        title: "One-way flow control",
        text: "A needle of conductance C_n in parallel with a check valve of conductance C. Port 1 is the side of the \
               valve, port 2 that of the cylinder; throttles = out lets gas into the cylinder freely and throttles what \
               leaves it (meter-out).",
        parameters: table! {
            needle_conductance: "m3/(s Pa)", physics::above(0.0), "Sonic conductance C_n of the needle at its setting, for air";
            check_conductance: "m3/(s Pa)", physics::above(0.0), unless "throttles = both", was "conductance",
                "Sonic conductance C of the check valve, for air";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a fitting of this kind",
                "Critical pressure ratio b of both paths";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
            cracking_pressure: "Pa", physics::at_least(0.0), default 1e4, assumed "a usual spring",
                "Cracking pressure of the check valve, a difference";
        },
        choices: &[Choice {
            name: "throttles",
            options: &["out", "in", "both"],
            meaning: "Throttled direction: gas out of the cylinder, gas into it, or both",
        }],
        open: true,
        ..Kind::PATH
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(valve), Some(cylinder)) = (at.gas(0), at.gas(1)) else { return };
        let needle = own.path("needle_conductance", build);
        let needle = Path::of(build.passage(needle, valve, cylinder));
        let cracking = own.number("cracking_pressure");
        let free = match own.choices[0] {
            0 => Some(build.check_valve(own.path("check_conductance", build), cracking, valve, cylinder)),
            1 => Some(
                build.check_valve(own.path("check_conductance", build), cracking, cylinder, valve).backward(),
            ),
            _ => None,
        };
        build.column(own, 0, Quantity::Flow([Some(needle), free]));
    }
}
