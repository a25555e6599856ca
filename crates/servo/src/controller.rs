//! Controllers from their descriptions.

use crate::belief::{Axis, belief};
use crate::{refuse, specification};
use circuit::Error;
use control::{AnyLaw, Controller, Gain, GainValues, LAWS};
use std::collections::BTreeMap;

/// A controller as it is described, with the axis that it commands. Position sensors have this deviation, m.
pub fn controller(spec: &specification::Controller, deviation: f64) -> Result<(Controller, Axis), Error> {
    let period = spec.period_s;
    if !(LEAST_PERIOD..=LONGEST_PERIOD).contains(&period) {
        return refuse!("period = {period} s: it must lie within {LEAST_PERIOD} and {LONGEST_PERIOD} s");
    }
    let (model, axis) = belief(&spec.belief)?;
    let no_law =
        |key: &str| Error::Specification(format!("there is no law \"{key}\"; there are {}", LAWS.join(", ")));
    let controller = Controller::tuned(&spec.law, &model, period, deviation);
    let mut controller = controller.ok_or_else(|| no_law(&spec.law))?;
    let law = controller.law.key();
    set(&format!("the law {law}"), law, controller.law.gains(), &spec.gains)?;
    controller.scale(spec.factors).map_err(Error::Specification)?;
    let pulses = controller.model.valve.arrangement.acts_for(period);
    if pulses < period * (1.0 - 1e-9) {
        return refuse!(
            "the valves pulse every {pulses} s, more often than the law is sampled, every {period} s: take a lower pwm_frequency or \
             a shorter period"
        );
    }
    if spec.valves.is_empty() || !controller.valves.gains().is_empty() {
        set("the valves", "valves", controller.valves.gains(), &spec.valves)?;
    } else {
        return refuse!(
            "valves: one proportional 5/3 valve has no numbers of its own here. Leave the table out",
        );
    }
    if !spec.adaptation {
        controller.adaptation = None;
    }
    controller.hold = spec.hold.map(|[band, after]| control::Hold::new(band, after));
    let plant = controller.plant;
    if let Some(own) = &mut controller.supervisor {
        own.rules = spec.supervision;
        if let Some(key) = &spec.standby {
            own.standby = AnyLaw::tuned(key, &model, &plant).ok_or_else(|| no_law(key))?;
            own.serves_own = true;
        }
    }
    Ok((controller, axis))
}

/// Sets numbers of the component of this name, under this name of their table.
fn set(
    what: &str,
    table: &str,
    mut own: GainValues<'_>,
    values: &BTreeMap<String, f64>,
) -> Result<(), Error> {
    for (key, &value) in values {
        let keys: Vec<_> = own.iter().map(|(gain, _)| gain.key).collect();
        let Some((Gain { unit, bounds, .. }, own)) = own.iter_mut().find(|(gain, _)| gain.key == key) else {
            return refuse!("{what} has no gain \"{key}\"; it has {}", keys.join(", "));
        };
        if !value.is_finite() || !bounds.contain(value) {
            return refuse!("{table}.{key} = {value} {unit} is out of bounds: it must be {bounds}");
        }
        **own = value;
    }
    Ok(())
}

/// Periods within which laws are sampled, s.
const LEAST_PERIOD: f64 = 1e-5;
const LONGEST_PERIOD: f64 = 0.1;
