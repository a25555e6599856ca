//! End stops for descriptions without end-stop values. These stops are so stiff that a typical drive cannot reach a
//! cover. Softer stops of a description have covers behind them.

use crate::part::{Covers, Follows, PistonSide};
use math::Lane;
use physics::IdealGas;
use physics::constants::{P_0, STANDARD_GRAVITY, T_0};
use physics::mechanics::EndStop;

/// Fraction of the dead length (dead volume over area) that a stop may use (assumed).
const DEPTH_SHARE: f64 = 0.5;
/// Largest distance by which the driving force alone presses a piston into a stop, m (assumed). Without it, a stop in
/// front of a large dead volume would add a visible length to the stroke. A force that acts at once overshoots by 16 %,
/// and still stays below 1 mm.
const MOST_PRESSED: f64 = 0.8e-3;
/// Largest speed of arrival, relative to the speed that a choked exhaust allows (assumed). A faster piston compresses
/// its gas, which brakes the piston.
const FLOW_FACTOR: f64 = 4.0;
/// Every stop must absorb this speed, m/s (assumed), because a run may start with it.
const LEAST_SPEED: f64 = 1.0;
/// Damping ratio of mass and stop (assumed). The piston rebounds with about a sixth of its speed.
const DAMPING_RATIO: f64 = 0.5;
/// Fraction of the depth from which the damper acts fully (assumed).
const DAMPING_SHARE: f64 = 0.1;

/// Fraction of the dead length at which a piston with a fully compressed stop meets the cover, and the fraction that
/// the cover may use (assumed).
const COVER_BEGINS: f64 = 0.8;
const COVER_SHARE: f64 = 0.1;
/// A cover absorbs this multiple of the piston's speed, and at least this speed, m/s (assumed).
const COVER_FACTOR: f64 = 2.0;
const LEAST_COVER_SPEED: f64 = 10.0;

/// The ends of a stroke.
#[derive(Clone, Debug)]
pub(crate) struct Ends<P> {
    pub stop: EndStop<P>,
    /// Depth at which the stop is fully compressed.
    pub covers: Option<Covers<P>>,
    /// Stiffness with which no piston of the drive reaches the covers, N/m.
    pub enough: P,
    pub taken: Taken<P>,
    /// Growth of a default stop with the pressure of a start.
    pub follows: Option<Follows<P>>,
}

impl Ends<f64> {
    /// Returns the stop of a run with this highest start pressure, Pa absolute, and its design load on `area` m2 over
    /// `stroke` m.
    pub fn from(&self, start: f64, area: f64, stroke: f64) -> (EndStop<f64>, Taken<f64>) {
        let Some(follows) = &self.follows else { return (self.stop.clone(), self.taken) };
        let Taken { mass, speed, force, depth } = self.taken;
        let more = (start - follows.supply).max(0.0) * area;
        let speed = (speed * speed + 2.0 * more * stroke / mass).sqrt();
        (follows.law(start), Taken { mass, speed, force: force + more, depth })
    }
}

/// Design load of a derived stop.
#[derive(Clone, Copy, Debug)]
pub struct Taken<P> {
    /// Moving mass with load, kg, its speed, m/s, and the driving force, N.
    pub mass: P,
    pub speed: P,
    pub force: P,
    /// Depth, m.
    pub depth: P,
}

/// Design data of the ends of a cylinder, in SI units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EndStopDesign<'a, P> {
    pub sides: &'a [PistonSide<P>; 2],
    pub dead_volumes: [P; 2],
    /// Moving mass and load.
    pub mass: P,
    pub stroke: P,
    pub incline: P,
    /// Supply pressure, absolute.
    pub supply_pressure: P,
    /// Highest temperature of supply and ambient air.
    pub hottest: P,
    /// External force, and the largest force of springs.
    pub forces: [P; 2],
    pub gas_constant: P,
    /// Largest sonic conductance through which gas leaves a chamber.
    pub conductance: P,
    /// Stiffness, damping and damping depth, if described.
    pub given: [Option<P>; 3],
}

/// Returns the ends of a cylinder. Values of its description are kept.
///
///   `k = (M v^2 + 2 F d)/d^2                                        [N/m]`
///   `c = 2 zeta sqrt(k M),   d_c = d/10                             [N s/m], [m]`
///
/// They follow from k d^2/2 = M v^2/2 + F d. Over the depth d, the spring absorbs the kinetic energy of the moving mass
/// and load, M kg, and the work of the largest driving force, F N. The depth d is half of the shorter dead length,
/// V_dead/A, but at most `s + sqrt(s^2 + M v^2 s/F)`. At this depth F alone presses the piston s = 0.8 mm into the stop.
/// F is the absolute supply pressure on the larger area, plus the largest values of weight, load force and load spring.
/// The speed v, m/s, is at least 1 m/s. Otherwise it is the smaller of two values. The first is sqrt(2 F
/// L/M), from the work of F over the stroke L. The second is four times the piston speed at a choked exhaust, C p_0
/// sqrt(R T/(R_0 T_0))/A, with p_0, R_0 and T_0 of air at standard conditions.
///
/// If a start pressure exceeds the supply pressure by p Pa, the stop is stiffer by 2 p A (L + d)/d^2, with A the larger
/// area. This is the work of the excess pressure over stroke and depth. The damping ratio does not change.
///
/// A described stop may be too soft to keep such a piston within 0.8 of the dead length. In this case the covers behind
/// the stop act.
/// A cover is a contact of the same form, with d a tenth of the dead length, and v twice as large but at least 10 m/s.
pub(crate) fn ends<P: Lane>(driven: &EndStopDesign<'_, P>) -> Ends<P> {
    let c = P::c;
    let EndStopDesign { sides, mass, stroke, conductance, .. } = *driven;
    let [area_a, area_b] = [sides[0].area, sides[1].area];
    let (large, small) = (area_a.max(area_b), area_a.min(area_b));
    let weight = mass * c(STANDARD_GRAVITY) * driven.incline.sin().abs();
    let [load, spring] = driven.forces;
    let force = driven.supply_pressure * large + weight + load.abs() + spring;
    let sound = driven.gas_constant * driven.hottest * c(1.0 / (IdealGas::air().gas_constant * T_0));
    let exhaust = conductance * c(P_0) * sound.sqrt() / small;
    let by_work = (c(2.0) * force * stroke / mass).sqrt();
    let speed = (c(FLOW_FACTOR) * exhaust).min(by_work).max(c(LEAST_SPEED));
    let rooms = [driven.dead_volumes[0] / area_a, driven.dead_volumes[1] / area_b];
    let room = rooms[0].min(rooms[1]);
    let pressed = c(MOST_PRESSED);
    let depth = (c(DEPTH_SHARE) * room)
        .min(pressed + (pressed * pressed + mass * speed * speed * pressed / force).sqrt());
    let holds = |speed: P, depth: P| (mass * speed * speed + c(2.0) * force * depth) / (depth * depth);
    let damping = |stiffness: P| c(2.0 * DAMPING_RATIO) * (stiffness * mass).sqrt();

    let enough = holds(speed, depth);
    let stiffness = driven.given[0].unwrap_or(enough);
    let stop = EndStop {
        stiffness,
        damping: driven.given[1].unwrap_or_else(|| damping(stiffness)),
        damping_depth: driven.given[2].unwrap_or_else(|| c(DAMPING_SHARE) * depth),
    };
    let soft = stiffness.get(0) < holds(speed, c(COVER_BEGINS) * room).get(0);
    let covers = soft.then(|| {
        let depth = c(COVER_SHARE) * room;
        let stiffness = holds((c(COVER_FACTOR) * speed).max(c(LEAST_COVER_SPEED)), depth);
        let law = EndStop { stiffness, damping: damping(stiffness), damping_depth: c(DAMPING_SHARE) * depth };
        Covers::new(law, rooms.map(|room| c(COVER_BEGINS) * room), 1.0 - COVER_BEGINS)
    });
    let follows = driven.given[0].is_none().then(|| Follows {
        law: stop.clone(),
        damped: driven.given[1].is_none(),
        supply: driven.supply_pressure,
        rise: (c(2.0) * large * (stroke + depth) / (depth * depth)).max(large / pressed),
        start: driven.supply_pressure,
    });
    Ends { stop, covers, enough, taken: Taken { mass, speed, force, depth }, follows }
}
