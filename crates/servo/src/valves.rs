//! Valves of a circuit that a law commands, and their data for the law.

use crate::numbers::{given, number, quantity};
use crate::refuse;
use circuit::Error;
use circuit::specification::{Circuit, Component};
use control::{Armature, Arrangement, Valve};
use physics::flow::Iso6358;
use physics::{IdealGas, in_usual_unit};
use std::f64::consts::TAU;

const PROPORTIONAL_53: &str = "valve/proportional-5/3";
const PROPORTIONAL_32: &str = "valve/proportional-3/2";
const SWITCHING_22: &str = "valve/switching-2/2";
const SWITCHING_53: &str = "valve/switching-5/3";
/// Valves that do not shut a chamber without a command.
const NEVER_SHUT: [&str; 3] = ["valve/switching-3/2", "valve/switching-5/2", "valve/impulse-5/2"];
const COMMANDED: &str = "a controller commands one proportional 5/3 valve, two proportional 3/2 valves, four 2/2 switching valves or one \
                         5/3 switching valve";

/// Returns the valves of a cylinder, in the order of their commands, and their data for the law.
pub fn valves<'c>(
    circuit: &'c Circuit,
    cylinder: &'c Component,
    supply: &'c Component,
    gas: &IdealGas<f64>,
) -> Result<(Vec<&'c Component>, Valve), Error> {
    let of = |kind: &str| circuit.components.iter().filter(|own| own.kind == kind).collect::<Vec<_>>();
    let (fives, threes) = (of(PROPORTIONAL_53), of(PROPORTIONAL_32));
    let (twos, switching) = (of(SWITCHING_22), of(SWITCHING_53));
    let (each, arrangement) = match (&*fives, &*threes, &*switching, &*twos) {
        ([one, other, ..], ..) => {
            return refuse!(
                "the circuit has {} and {}: a law commands a circuit with one proportional 5/3 valve. Describe the axis that is \
                 controlled alone",
                one.name,
                other.name
            );
        }
        ([_], ..) => (fives, Arrangement::One),
        ([], [_, _], [], []) => (in_order(circuit, cylinder, supply, &threes)?, Arrangement::Pair),
        ([], [], [one], []) => {
            let centre = one.choices.get("centre").map_or("closed", String::as_str);
            if centre != "closed" {
                return refuse!(
                    "{}.centre = \"{centre}\": no position of the valve shuts the chambers, so that the drive cannot rest under \
                     a controller. Set centre = \"closed\"",
                    one.name
                );
            }
            same(&[one])?;
            (switching.clone(), Arrangement::Three(armature(one)?))
        }
        ([], [], [], &[a, _, _, _]) => {
            let each = in_order(circuit, cylinder, supply, &twos)?;
            let (armature, frequency) = (armature(a)?, number(a, "pwm_frequency").unwrap_or(0.0));
            let pulses = Arrangement::Pulses(armature, 1.0 / frequency);
            (each, if frequency > 0.0 { pulses } else { Arrangement::Seven(armature) })
        }
        _ => return Err(none_of_them(circuit, &[&*threes, &*switching, &*twos].concat())),
    };
    let valve = valve(each[0], arrangement, gas)?;
    Ok((each, valve))
}

/// The error of a circuit whose valves a law does not command.
fn none_of_them(circuit: &Circuit, found: &[&Component]) -> Error {
    let never = circuit.components.iter().find(|own| NEVER_SHUT.contains(&&*own.kind));
    if let Some(own) = never {
        return Error::Specification(format!(
            "no position of {} shuts the chambers, so that a controller cannot hold the drive at rest: \
             {COMMANDED}",
            own.name
        ));
    }
    let found: Vec<_> = found.iter().map(|own| &*own.name).collect();
    let has = if found.is_empty() {
        "no proportional 5/3 valve".into()
    } else {
        format!("the valves {}", found.join(", "))
    };
    Error::Specification(format!("the circuit has {has}: {COMMANDED}"))
}

fn valve(own: &Component, arrangement: Arrangement, gas: &IdealGas<f64>) -> Result<Valve, Error> {
    let [c, b, m, linear_above] =
        ["conductance", "critical_pressure_ratio", "subsonic_index", "linear_above"]
            .map(|key| given(own, key));
    let (m, is_air) = (m?, gas.is_air());
    // Valves that switch have no spool.
    let of_spool =
        |key: &str, usual: f64| if arrangement.is_proportional() { given(own, key) } else { Ok(usual) };
    let frequency = of_spool("frequency", 0.0)?;
    Ok(Valve {
        arrangement,
        flow: Iso6358::for_gas(c?, b?, m, linear_above?, m == 0.5, gas, is_air),
        angular_frequency: if frequency == 0.0 { f64::INFINITY } else { TAU * frequency },
        damping_ratio: of_spool("damping_ratio", 1.0)?,
        delay: of_spool("delay", arrangement.armature().map_or(0.0, |armature| armature.mean()))?,
        overlap: of_spool("overlap", 0.0)?,
        leakage: of_spool("leakage", 0.0)?,
        leakage_width: of_spool("leakage_width", 1.0)?,
    })
}

fn armature(own: &Component) -> Result<Armature, Error> {
    if own.choices.get("pwm_model").is_some_and(|model| model == "averaged") {
        return refuse!(
            "{}.pwm_model = \"averaged\": a controller commands pulses. Set pwm_model = \"exact\"",
            own.name
        );
    }
    if own.choices.get("normally").is_some_and(|normally| normally == "open") {
        return refuse!(
            "{} is normally open: without a command, a controller needs shut chambers. Set normally = \"closed\"",
            own.name
        );
    }
    let share = given(own, "travel_share")?;
    let times = [given(own, "time_on")?, given(own, "time_off")?];
    Ok(Armature { dead: times.map(|t| t * (1.0 - 0.5 * share)), travel: times.map(|t| t * share) })
}

/// Checks that valves that a law treats as equal are equal.
fn same(each: &[&Component]) -> Result<(), Error> {
    let [first, others @ ..] = each else { return Ok(()) };
    for own in others {
        let keys = first.numbers.keys().chain(own.numbers.keys());
        let (choices, of_own) = (&first.choices, &own.choices);
        if let Some(key) = keys.into_iter().find(|key| number(own, key) != number(first, key)) {
            let shown =
                |one| quantity(one, key).map_or("absent".into(), |(value, unit)| in_usual_unit(value, unit));
            return refuse!(
                "{}.{key} is {}, {}.{key} is {}: a controller assumes that the valves are equal",
                first.name,
                shown(first),
                own.name,
                shown(own)
            );
        }
        if choices != of_own {
            return refuse!(
                "{} and {} differ in a choice: a controller assumes that the valves are equal",
                first.name,
                own.name
            );
        }
    }
    for own in each {
        let pairs = [
            ("exhaust_conductance", "conductance"),
            ("exhaust_critical_pressure_ratio", "critical_pressure_ratio"),
        ];
        for (key, usual) in pairs {
            if own.numbers.get(key).is_some_and(|value| Some(*value) != number(own, usual)) {
                return refuse!(
                    "{0}.{key} differs from {0}.{usual}: a controller assumes that both are equal. Leave it out",
                    own.name
                );
            }
        }
    }
    Ok(())
}

/// Equal valves in the order of their commands: two 3/2 valves at chambers a and b, or four 2/2 valves that fill and vent a,
/// then b.
fn in_order<'c>(
    circuit: &Circuit,
    cylinder: &Component,
    supply: &Component,
    each: &[&'c Component],
) -> Result<Vec<&'c Component>, Error> {
    let joined = |one: &str, other: &str| {
        let has = |joint: &[String], port: &str| joint.iter().any(|own| own == port);
        circuit.joints.iter().any(|joint| has(joint, one) && has(joint, other))
    };
    let at = |own: &Component, port: u32, chamber: &str| {
        joined(&format!("{}.{port}", own.name), &format!("{}.{chamber}", cylinder.name))
    };
    let supply = format!("{}.1", supply.name);
    let between = |(chamber, other): (&str, &str)| {
        each.iter().copied().find(|own| {
            [(1, 2), (2, 1)]
                .into_iter()
                .any(|(near, far)| at(own, near, chamber) && joined(&format!("{}.{far}", own.name), other))
        })
    };
    let (found, what) = if let [one, other] = *each {
        let mut orders = [[one, other], [other, one]].into_iter();
        let order = orders.find(|[a, b]| at(a, 2, "a") && at(b, 2, "b"));
        (order.map(Vec::from), "3/2 valves are joined by port 2 to chambers a and b")
    } else {
        let edges = [("a", &*supply), ("a", "ambient"), ("b", &*supply), ("b", "ambient")];
        (edges.into_iter().map(between).collect(), "2/2 valves fill and vent each of the chambers")
    };
    let Some(found) = found else {
        return refuse!(
            "no {what} of {}: a controller needs valves that connect the cylinder with supply and ambient",
            cylinder.name
        );
    };
    same(&found)?;
    Ok(found)
}
