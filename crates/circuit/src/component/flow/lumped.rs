use crate::component::flow::line::Line;
use crate::component::flow::tube::{self, Tube, steady};
use crate::component::prelude::*;
use crate::part::ChamberLaw;
use math::{Deps, Over, Real};
use std::f64::consts::PI;

/// A tube as one volume between two flow paths.
pub struct Lumped;

const PORTS: &[Port] = &[Port { volume: 0.0, ..gas("1") }, Port { volume: 0.0, ..gas("2") }];

/// Parameters of every tube, and of a measured tube.
const STEADY: [Row; 5] = *table! {
    length: "m", physics::above(0.0), "Length L";
    diameter: "m", physics::above(0.0), "Inner diameter d";
    conductance: "m3/(s Pa)", physics::above(0.0), follows "from length and diameter by an empirical formula (assumed)",
        "Measured sonic conductance C of the whole tube; without waves";
    critical_pressure_ratio: "1", physics::between(0.0, 1.0), follows "from conductance and diameter by an empirical formula (assumed)",
        "Measured critical pressure ratio b of the whole tube; without waves";
    LINEAR_ABOVE;
};

const KIND: Kind =
    Kind { sources: &["iso6358-2013", "gnielinski1976"], ports: PORTS, open: true, ..Kind::PLAIN };

/// Iterations for the halves of a tube. Each iteration leaves less than half of the error.
const ITERATIONS: usize = 60;

/// Returns sonic conductance and critical pressure ratio of each of two equal paths that have C and b in series. The
/// series rule of ISO 6358-3 applies, with u = 1 - b of a half:
///
///   `C = g C_half,   1 - b = 2 u g^2,   g = (1 - u + u sqrt(2 u))/(1 + u^2)`
fn halves<P: Real>([conductance, ratio]: [P; 2]) -> [P; 2] {
    let (one, two) = (P::one(), P::c(2.0));
    let g = |u: P| (one - u + u * (two * u).sqrt()) / (one + u * u);
    let left = one - ratio;
    let u = (0..ITERATIONS).fold(left, |u, _| {
        let g = g(u);
        left / (two * g * g)
    });
    [conductance / g(u), one - u]
}

impl Component for Lumped {
    const KIND: Kind = Kind {
        key: "tube/lumped",
        title: "Tube, lumped",
        text: "The whole volume of the tube with its wall, Nu = 3.66 for laminar flow and Gnielinski's for turbulent flow, between two equal flow paths by ISO 6358 that have in series the C \
               and b of the steady tube; subsonic flow is up to 0.7 % higher. It stores gas and heat, without waves.",
        parameters: table! {
            ..STEADY;
            ..TUBE_WALL;
        },
        outputs: Line::KIND.outputs,
        ..KIND
    };

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let (length, diameter) = (own.number("length"), own.number("diameter"));
        let cell = build.volume(Vessel {
            law: ChamberLaw::EnergyBalance,
            dead_volume: P::c(0.25 * PI) * diameter * diameter * length,
            wall: P::c(PI) * diameter * length,
            heat: tube_heat(own),
            wall_temperature: own.given("wall_temperature").unwrap_or(build.ambient[1]),
        });
        build.gas_starts(cell, format!("{}.cell", own.name));
        let half = build.usual_path(halves(steady(own)), own.number("linear_above"));
        let edges = [build.passage(half.clone(), from, cell), build.passage(half, cell, to)];
        build.columns(own, 0, edges.map(|edge| Quantity::along(Path::of(edge))));
    }
}

/// A tube whose model depends on its length.
pub struct Auto;

/// Speed of sound for the decision between short and long tubes, m/s: air at 20 degC.
const SOUND: f64 = 343.2;
/// Fraction of a wave length below which a tube is short.
const SHORT: f64 = 0.05;

/// Returns whether waves are negligible up to the bandwidth.
fn is_short<P: Lane>(own: &Instance<P>) -> bool {
    own.number("length").get(0) * own.number("bandwidth").get(0) < SHORT * SOUND
}

impl Component for Auto {
    const KIND: Kind = Kind {
        key: "tube/auto",
        title: "Tube, steady or with waves",
        text: "A steady tube, kind tube, where L < c/(20 f_max) with c = 343.2 m/s, 0.86 m for 20 Hz; else one with waves, \
               kind tube/distributed. Each model uses its own keys.",
        sources: &["modelica-straight-pipe", "iso6358-2013", "gnielinski1976"],
        parameters: table! {
            ..STEADY;
            bandwidth: "Hz", physics::above(0.0), default 20.0, assumed "usual for a positioning drive",
                "Frequency f_max up to which the tube must be accurate";
            cells: "1", physics::within(1.0, 150.0), follows "length and bandwidth", "With waves: number N of lengths with inertia";
            friction_scale: "1", physics::at_least(0.0), default 1.0, "With waves: factor on the friction of a smooth pipe";
            loss: "1", physics::at_least(0.0), default 0.0, "With waves: coefficient zeta of local losses, bends included, over the whole tube";
            viscosity: "Pa s", physics::above(0.0), default 1.82e-5, assumed "usual for air at 20 degC", "With waves: dynamic viscosity";
            ..TUBE_WALL;
        },
        discrete: Line::KIND.discrete,
        outputs: Line::KIND.outputs,
        ..KIND
    };

    fn bring<P: Lane>(own: &Instance<P>, port: usize, ambient_temperature: P) -> Brings<P> {
        if is_short(own) { Tube::bring(own, port, ambient_temperature) } else { Brings::Nothing }
    }

    fn series<P: Lane>(own: &Instance<P>) -> Option<[P; 2]> {
        is_short(own).then(|| steady(own))
    }

    fn check(own: &Instance<f64>) -> Result<(), Error> {
        Line::check(own)
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>)
    where
        Deps: Over<P>,
    {
        if !is_short(own) {
            return Line::compose(own, at, build);
        }
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let path = tube::steady_path(own, from, to, build);
        build.columns(own, 0, [Quantity::along(path); 2]);
    }
}
