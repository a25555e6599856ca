//! End stops, where the description leaves them open: so stiff that a sensible drive cannot reach a cover.

use crate::circuit::PistonSide;
use crate::impacts::Impact;
use crate::lifted::Lifted;
use crate::specification::{self, Valve};
use math::Lane;
use physics::IdealGas;
use physics::constants::{P_0, STANDARD_GRAVITY, T_0};
use physics::mechanics::EndStop;

/// Share of the dead length (dead volume over area) that a stop may take up (assumed).
const DEPTH_SHARE: f64 = 0.5;
/// How many times faster than through a choked exhaust a piston may arrive (assumed): gas that is driven out faster
/// than it can leave is compressed and brakes.
const FLOW_FACTOR: f64 = 4.0;
/// Every stop takes this speed, m/s (assumed): a run may start with one.
const LEAST_SPEED: f64 = 1.0;
/// Damping ratio of mass and stop (assumed): a piston leaves with about a sixth of its speed.
const DAMPING_RATIO: f64 = 0.5;
/// Share of the depth from which the damper acts fully (assumed).
const DAMPING_SHARE: f64 = 0.1;

/// Kinetic energy that a cylinder with cushions takes at its end, J for each m2 of piston (assumed): 2 J at a bore of
/// 25 mm.
const TAKEN_J_M2: f64 = 4000.0;

/// The stop of `lifted`; what its description gives stays as it is.
///
///   k = (M v^2 + 2 F d)/d^2                                        [N/m]
///   c = 2 zeta sqrt(k M),   d_c = d/10                             [N s/m], [m]
///
/// from k d^2/2 = M v^2/2 + F d: over the depth d the spring takes the kinetic energy of the moving mass and load
/// M kg, and what the largest driving force F N does meanwhile. d is half of the shorter dead length, V_dead/A. F is
/// the absolute supply pressure on the larger area, plus weight, load force and load spring at their largest. v m/s is
/// the smaller of sqrt(2 F L/M), all the work of F over the stroke L, and four times the speed at which a choked
/// exhaust lets the piston go, C p_0 sqrt(R T/(R_0 T_0))/A with p_0, R_0 and T_0 of air at standard conditions; but not
/// less than 1 m/s.
pub(super) fn end_stop<P: Lane>(
    lifted: &Lifted<specification::Drive>,
    sides: &[PistonSide<P>; 2],
) -> EndStop<P> {
    type Drive = specification::Drive;
    let number = |f: fn(&Drive) -> f64| -> P { lifted.number(f) };
    let c = P::c;
    let [area_a, area_b] = [sides[0].area, sides[1].area];
    let (large, small) = (area_a.max(area_b), area_a.min(area_b));
    let mass = number(|s| s.cylinder.moving_mass_kg) + number(|s| s.load.mass_kg);
    let stroke = number(|s| s.cylinder.stroke_m);
    let weight = mass * c(STANDARD_GRAVITY) * number(|s| s.cylinder.incline_rad).sin().abs();
    let spring = lifted.optional(|s| s.load.spring.as_ref()).map_or(P::zero(), |spring| {
        let rest: P = spring.number(|s| s.rest_position_m);
        spring.number::<P>(|s| s.stiffness_n_m) * rest.abs().max((stroke - rest).abs())
    });
    let force = number(|s| s.supply.pressure_pa) * large + weight + number(|s| s.load.force_n).abs() + spring;
    let sound = number(|s| s.gas.gas_constant_j_kg_k)
        * number(|s| s.supply.temperature_k).max(number(|s| s.ambient.temperature_k))
        * c(1.0 / (IdealGas::air().gas_constant * T_0));
    let conductance = number(|s| {
        let Valve::Proportional53(valve) = &s.valve;
        valve.conductance_m3_s_pa
    });
    let exhaust = conductance * c(P_0) * sound.sqrt() / small;
    let by_work = (c(2.0) * force * stroke / mass).sqrt();
    let speed = (c(FLOW_FACTOR) * exhaust).min(by_work).max(c(LEAST_SPEED));
    let room = (number(|s| s.cylinder.dead_volume_a_m3) / area_a)
        .min(number(|s| s.cylinder.dead_volume_b_m3) / area_b);
    let depth = c(DEPTH_SHARE) * room;

    let given = |f: fn(&specification::EndStop) -> Option<f64>| -> Option<P> {
        f(&lifted.value.cylinder.end_stop)?;
        Some(lifted.number_or(0.0, |s| f(&s.cylinder.end_stop)))
    };
    let stiffness = given(|stop| stop.stiffness_n_m)
        .unwrap_or_else(|| (mass * speed * speed + c(2.0) * force * depth) / (depth * depth));
    EndStop {
        stiffness,
        damping: given(|stop| stop.damping_n_s_m)
            .unwrap_or_else(|| c(2.0 * DAMPING_RATIO) * (stiffness * mass).sqrt()),
        damping_depth: given(|stop| stop.damping_depth_m).unwrap_or_else(|| c(DAMPING_SHARE) * depth),
    }
}

/// A stop so soft that supply pressure pushes the piston through the dead volume before it.
pub(super) fn stop_warning(
    stop: &EndStop<f64>,
    cylinder: &specification::Cylinder,
    areas: [f64; 2],
    gauge: f64,
) -> Option<String> {
    let depth = |area: f64| gauge * area / stop.stiffness;
    let room = [cylinder.dead_volume_a_m3 / areas[0], cylinder.dead_volume_b_m3 / areas[1]];
    // Chamber a pushes towards b's end, and the other way round.
    let (into_b, into_a) = (depth(areas[0]), depth(areas[1]));
    let (end, depth, room) = if into_b > room[1] { ("b", into_b, room[1]) } else { ("a", into_a, room[0]) };
    (depth > room).then(|| {
        format!(
            "supply pressure pushes the piston {:.3} mm into the end stop, but the dead volume of chamber {end} is only {:.3} mm long: \
             a larger cylinder.end_stop.stiffness or cylinder.dead_volume.{end} keeps the chamber from vanishing",
            1e3 * depth, 1e3 * room
        )
    })
}

/// What to say of the hardest of these impacts, where it is beyond what a cylinder with a piston of this area takes.
pub(super) fn impact_warning(area: f64, impacts: &[Impact]) -> Option<String> {
    let taken = TAKEN_J_M2 * area;
    let beyond = impacts.iter().filter(|impact| impact.energy > taken).count();
    let hardest = impacts.iter().max_by(|a, b| a.energy.total_cmp(&b.energy)).filter(|_| beyond > 0)?;
    Some(format!(
        "{beyond} of {} impacts on the end stops are harder than a cylinder of this bore usually takes, {taken:.2} J (assumed: \
         4 mJ for each mm2 of piston; the data sheet says what yours takes). The hardest: {:.3} J at {:.3} m/s at the end \
         of chamber {}, at {:.4} s. Brake before the end, or add a shock absorber",
        impacts.len(),
        hardest.energy,
        hardest.speed,
        if hardest.at_b { "b" } else { "a" },
        hardest.time
    ))
}
