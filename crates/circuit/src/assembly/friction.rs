//! The friction of a description: a law and its modifiers, with every value checked.

use super::own_law::{check_levels, own_law};
use crate::ground::{DIRECTIONS, Error, Lifted, Sensitive, refuse, seeds};
use crate::specification::{self, Friction, Numbers, StribeckShape};
use math::Lane;
use physics::friction::formula::{Formula, OwnLaw};
use physics::friction::{
    AnyLaw, At, Choices, Composition, Contact, Direction, Dwell, ELEMENTS, Element, Evolution, Harmonic,
    Heating, LAWS, Meta, Position, Relaxation, SealLips, Shape, SideLoad, Table, Wear,
};
use physics::{Parameter, in_usual_unit};
use std::collections::BTreeMap;

/// Largest number of points of a position table, because each costs time at every evaluation.
const MOST_POINTS: usize = 50;

/// Largest number of harmonics of position. More would describe the noise of a recording.
const MOST_HARMONICS: usize = 4;

/// Largest deviation of the sum of fractions from 1: rounding to four digits.
const SHARES_WITHIN: f64 = 1e-3;

/// Reads the friction of a description. An error for an unknown name lists the choices.
pub fn friction_law(spec: &Friction) -> Result<Contact<f64>, Error> {
    contact(&Lifted::plain(spec))
}

/// Reads the same with derivatives.
pub(crate) fn contact<P: Lane>(spec: &Lifted<Friction>) -> Result<Contact<P>, Error> {
    let law = law(spec)?;
    let lips = modifier(spec, "pressure", SealLips::<f64>::PARAMETERS, |spec| spec.pressure.as_ref())?;
    let composition = composition(spec, law.meta())?;
    Ok(Contact::new(law, lips.map(|lips| SealLips::from_values(&lips)), composition))
}

/// Returns steady sliding at each of `places`: the forces, N, and their derivatives by the numbers `names`, place by
/// place. `json` is the friction of a description without `parameters`.
pub fn steady_sensitivity(
    json: &str,
    parameters: &Numbers,
    names: &[String],
    places: &[At<f64>],
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let mut seeds = seeds::<Friction>(json, "friction", names)?;
    seeds.value.parameters = parameters.clone();
    let mut derivatives = vec![0.0; places.len() * names.len()];
    for first in (0..names.len()).step_by(DIRECTIONS) {
        let friction = contact::<Sensitive>(&Lifted::new(&seeds, first))?;
        let last = names.len().min(first + DIRECTIONS);
        for (row, at) in derivatives.chunks_exact_mut(names.len()).zip(places) {
            let force = friction.steady(&at.map(Sensitive::from));
            row[first..last].copy_from_slice(&force.eps[..last - first]);
        }
    }
    let friction = friction_law(&seeds.value)?;
    Ok((places.iter().map(|at| friction.steady(at)).collect(), derivatives))
}

/// Returns the table of the law, and the law itself if it is custom.
pub(super) fn meta(spec: &Friction) -> Result<(&'static Meta, Option<&'static OwnLaw>), Error> {
    if let Some(formula) = &spec.formula {
        let own = own_law(formula).map_err(|refusal| Error::Specification(refusal.to_string()))?;
        return Ok((&own.meta, Some(own)));
    }
    let Some(meta) = LAWS.iter().find(|meta| meta.key == spec.law) else {
        let names: Vec<&str> = LAWS.iter().map(|meta| meta.key).collect();
        return refuse!("friction.law = \"{}\" is unknown; choose one of {}", spec.law, names.join(", "));
    };
    Ok((meta, None))
}

/// Refuses values of a table that are unknown, missing or out of bounds. `key` names a parameter in the description.
fn check(
    (table, of): (&str, &str),
    parameters: &[Parameter],
    numbers: &Lifted<Numbers>,
    key: fn(&Parameter) -> String,
) -> Result<(), Error> {
    let keys: Vec<String> = parameters.iter().map(key).collect();
    if let Some(other) = numbers.tables().flat_map(BTreeMap::keys).find(|other| !keys.contains(other)) {
        return refuse!("{table}.{other} is not a parameter of \"{of}\"; it has {}", keys.join(", "));
    }
    for (parameter, key) in parameters.iter().zip(keys) {
        let Parameter { key: name, unit, bounds, .. } = parameter;
        let Some(value) = numbers.value.get(&key).copied().or(parameter.default) else {
            return refuse!("{table}.{name} is missing: {} [{unit}]", parameter.meaning.trim());
        };
        if !bounds.contain(value) {
            let rule = bounds.rule(value);
            return refuse!("{table}.{name} = {value} {unit} is out of bounds: it must be {rule}");
        }
    }
    Ok(())
}

/// Refuses values of a law's parameters that are invalid or inconsistent.
fn check_law(lifted: &Lifted<Friction>, meta: &Meta) -> Result<(), Error> {
    let table = lifted.table(|spec| &spec.parameters);
    check(("friction", meta.key), meta.parameters, &table, |parameter| parameter.key.into())?;
    if let (Some(fc), Some(fs)) = (table.value.get("coulomb"), table.value.get("breakaway"))
        && fs < fc
    {
        return refuse!("friction.breakaway = {fs} N must not be below friction.coulomb = {fc} N");
    }
    Ok(())
}

/// Returns the same friction with other values of its law's parameters. `None` if other quantities depend on these
/// parameters.
pub(super) fn with_values(like: &Contact<f64>, spec: &Friction) -> Result<Option<Contact<f64>>, Error> {
    let (meta, own) = meta(spec)?;
    if own.is_some() || meta.elements {
        return Ok(None);
    }
    let plain = Lifted::plain(spec);
    check_law(&plain, meta)?;
    Ok(Some(like.with_law(like.law.lifted(&mut |parameter| number(&plain, parameter)))))
}

fn law<P: Lane>(lifted: &Lifted<Friction>) -> Result<AnyLaw<P>, Error> {
    let spec = lifted.value;
    let (meta, own) = meta(spec)?;
    check_law(lifted, meta)?;
    check_elements(spec, meta)?;
    let (evolution, shape) = (evolution(spec, meta)?, shape(spec, meta, own.is_some())?);
    if let Some(own) = own {
        check_levels(spec, own)?;
        Formula::new(own, numbers(lifted, meta)).examine().map_err(Error::Specification)?;
        return Ok(AnyLaw::Formula(Formula::new(own, numbers(lifted, meta))));
    }
    // A free exponent includes 2, whose value alone would be a square.
    let is_free = lifted.is_free(|spec| named(spec, "stribeck_exponent").unwrap_or(0.0));
    let choices = Choices { shape: shape.or(is_free.then_some(Shape::Power)), evolution };
    let plain = AnyLaw::build(meta.key, &mut |parameter| number(lifted, parameter), &choices);
    let mut law = plain.expect("the name is registered").lifted(&mut |parameter| number(lifted, parameter));
    if let (AnyLaw::MaxwellSlip(law), false) = (&mut law, spec.elements.is_empty()) {
        let element = |i: usize| Element {
            stiffness: lifted.number(|spec| spec.elements[i].stiffness),
            level: lifted.number(|spec| spec.elements[i].level),
        };
        law.set_elements((0..spec.elements.len()).map(element).collect());
    }
    Ok(law)
}

/// Returns the values of all parameters, which have been checked.
fn numbers<P: Lane>(lifted: &Lifted<Friction>, law: &Meta) -> Vec<P> {
    law.parameters.iter().map(|parameter| number(lifted, parameter)).collect()
}

fn named(spec: &Friction, key: &str) -> Option<f64> {
    spec.parameters.get(key).copied()
}

/// Returns the value of a parameter that has been checked.
fn number<P: Lane>(lifted: &Lifted<Friction>, parameter: &Parameter) -> P {
    match (parameter.key, lifted.value.stribeck_shape) {
        ("stribeck_exponent", Some(StribeckShape::Exponential)) => P::one(),
        (key, _) => lifted.number_or(parameter.default.unwrap_or(f64::NAN), |spec| named(spec, key)),
    }
}

fn shape(spec: &Friction, law: &Meta, own: bool) -> Result<Option<Shape>, Error> {
    let Some(shape) = spec.stribeck_shape else { return Ok(None) };
    let takes = |key: &str| law.parameters.iter().any(|parameter| parameter.key == key);
    if own || !takes("stribeck_exponent") {
        return refuse!("friction.stribeck_shape needs a Stribeck curve, but law \"{}\" has none", law.key);
    }
    if shape != StribeckShape::Free && spec.parameters.get("stribeck_exponent").is_some_and(|n| *n != 2.0) {
        return refuse("friction.stribeck_exponent needs friction.stribeck_shape = \"free\"");
    }
    let shape = match shape {
        StribeckShape::Gaussian => Some(Shape::Gaussian),
        StribeckShape::Exponential => Some(Shape::Power),
        StribeckShape::Lorentzian => Some(Shape::Lorentzian),
        StribeckShape::Free => None,
    };
    Ok(shape)
}

/// Refuses elements that do not belong to the law, or whose numbers are impossible.
fn check_elements(spec: &Friction, law: &Meta) -> Result<(), Error> {
    let listed = &spec.elements;
    let stiffness = spec.parameters.get("bristle_stiffness").filter(|k| k.is_finite());
    match (law.elements, listed.is_empty(), stiffness) {
        (false, false, _) => {
            return refuse!("friction.elements belongs to law \"gms\"; law \"{}\" has none", law.key);
        }
        (false, true, _) | (true, true, Some(_)) => return Ok(()),
        (true, true, None) => {
            return refuse(
                "friction.bristle_stiffness is missing: give it, or the elements themselves as friction.elements",
            );
        }
        (true, false, Some(_)) => {
            return refuse(
                "friction.bristle_stiffness and friction.elements both give the stiffness: give one of them",
            );
        }
        (true, false, None) => {}
    }
    if !ELEMENTS.contains(&listed.len()) {
        return refuse!(
            "friction.elements has {} elements; it must have {} to {}",
            listed.len(),
            ELEMENTS.start(),
            ELEMENTS.end()
        );
    }
    for (i, element) in listed.iter().enumerate() {
        for (key, value) in [("stiffness", element.stiffness), ("share", element.level)] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse!("friction.elements[{i}].{key} = {value} must be greater than 0");
            }
        }
    }
    let total: f64 = listed.iter().map(|element| element.level).sum();
    if (total - 1.0).abs() > SHARES_WITHIN {
        return refuse!("friction.elements: the shares add up to {total}; they must add up to 1");
    }
    Ok(())
}

fn evolution(spec: &Friction, law: &Meta) -> Result<Evolution, Error> {
    if spec.evolution.is_some() && !law.evolves {
        return refuse!(
            "friction.evolution belongs to law \"rate-and-state\"; law \"{}\" has no such state",
            law.key
        );
    }
    Ok(spec.evolution.unwrap_or_default())
}

/// Returns the key of a modifier's parameter in a description, which carries the unit.
fn key_with_unit(parameter: &Parameter) -> String {
    let unit = match parameter.unit {
        "N" => "_n",
        "s" => "_s",
        "m" => "_m",
        "K" => "_k",
        "rad" => "_rad",
        "K/W" => "_k_w",
        "1/K" => "_per_k",
        "1/m" => "_per_m",
        _ => "",
    };
    format!("{}{unit}", parameter.key)
}

/// Returns the values of a table, in the order of the parameters and within their bounds.
fn values<P: Lane>(name: &str, parameters: &[Parameter], table: &Lifted<Numbers>) -> Result<Vec<P>, Error> {
    check((name, name), parameters, table, key_with_unit)?;
    let number = |parameter: &Parameter| {
        let (key, default) = (key_with_unit(parameter), parameter.default.unwrap_or(f64::NAN));
        table.number_or(default, |numbers| numbers.get(&key).copied())
    };
    Ok(parameters.iter().map(number).collect())
}

/// Returns the values of a modifier, if the description has it.
fn modifier<P: Lane>(
    spec: &Lifted<Friction>,
    key: &str,
    parameters: &[Parameter],
    table: fn(&Friction) -> Option<&Numbers>,
) -> Result<Option<Vec<P>>, Error> {
    spec.optional(table).map(|table| values(&format!("friction.{key}"), parameters, &table)).transpose()
}

fn composition<P: Lane>(lifted: &Lifted<Friction>, law: &Meta) -> Result<Composition<P>, Error> {
    let spec = lifted.value;
    if spec.relaxation.is_some() && !law.bristles {
        let laws = LAWS.iter().filter(|meta| meta.bristles).map(|meta| meta.key);
        return refuse!(
            "friction.relaxation needs elastic bristles, but law \"{}\" has none; choose one of {}",
            law.key,
            laws.collect::<Vec<_>>().join(", ")
        );
    }
    let modifier = |key, parameters, table| modifier::<P>(lifted, key, parameters, table);
    let dwell = modifier("dwell", Dwell::<f64>::PARAMETERS, |s| s.dwell.as_ref().map(|d| &d.numbers))?;
    let dwell = dwell.zip(spec.dwell.as_ref()).map(|(values, dwell)| Dwell::new(dwell.growth, &values));
    let relaxation = modifier("relaxation", Relaxation::<f64>::PARAMETERS, |s| s.relaxation.as_ref())?;
    let direction = modifier("direction", Direction::<f64>::PARAMETERS, |s| s.direction.as_ref())?;
    let side_load = modifier("side_load", SideLoad::<f64>::PARAMETERS, |s| s.side_load.as_ref())?;
    // Without the last one: the circuit has the ambient temperature.
    let of_heating = Heating::<f64>::PARAMETERS.split_last().expect("parameters").1;
    let heating = modifier("temperature", of_heating, |s| s.temperature.as_ref())?;
    let heating = heating.map(|values| Heating::from_values(&[&values[..], &values[..1]].concat()));
    let wear = modifier("wear", Wear::<f64>::PARAMETERS, |s| s.wear.as_ref())?;
    Ok(Composition {
        position: lifted.optional(|s| s.position.as_ref()).map(|table| position(&table)).transpose()?,
        direction: direction.map(|values| Direction::from_values(&values, law.sense)),
        heating,
        wear: wear.map(|values| Wear::from_values(&values)),
        side_load: side_load.map(|values| SideLoad::from_values(&values)),
        dwell,
        relaxation: relaxation.map(|values| Relaxation::from_values(&values)),
    })
}

fn position_table<P: Lane>(position: &Lifted<specification::Position>) -> Result<Table<P>, Error> {
    let points = &position.value.table;
    if points.len() == 1 || points.len() > MOST_POINTS {
        return refuse!(
            "friction.position.table has {} points; it must have 2 to {MOST_POINTS}",
            points.len()
        );
    }
    for pair in points.windows(2) {
        let [before, after] = [pair[0].position_m, pair[1].position_m];
        if before.is_nan() || after <= before || !after.is_finite() {
            let [before, after] = [before, after].map(|position| in_usual_unit(position, "m"));
            return refuse!("friction.position.table: the position {after} must be above {before}");
        }
    }
    if let Some(point) = points.iter().find(|point| !(point.factor > 0.0 && point.factor.is_finite())) {
        return refuse!("friction.position.table: the factor {} must be greater than 0", point.factor);
    }
    let number = |k: usize, of: fn(&specification::PositionPoint) -> f64| {
        position.number(|position| of(&position.table[k]))
    };
    let points: Vec<[P; 2]> =
        (0..points.len()).map(|k| [number(k, |p| p.position_m), number(k, |p| p.factor)]).collect();
    Ok(Table::new(&points))
}

fn position<P: Lane>(table: &Lifted<specification::Position>) -> Result<Position<P>, Error> {
    let waves = &table.value.harmonics;
    if waves.len() > MOST_HARMONICS {
        return refuse!(
            "friction.position has {} harmonics; it may have at most {MOST_HARMONICS}",
            waves.len()
        );
    }
    let total: f64 = waves.iter().filter_map(|wave| wave.get("amplitude")).map(|a| a.abs()).sum();
    if total >= 1.0 {
        return refuse!(
            "friction.position: the amplitudes add up to {total}, so that friction would change its sign; \
             they must add up to less than 1"
        );
    }
    for (key, value) in [("slope", table.value.slope_per_m), ("reference", table.value.reference_m)] {
        if !value.is_finite() {
            return refuse!("friction.position.{key} = {value} is out of bounds: it must be finite");
        }
    }
    let harmonics = (0..waves.len()).map(|k| {
        let wave = table.table(|table| &table.harmonics[k]);
        let values = values("friction.position.harmonics", Harmonic::<f64>::PARAMETERS, &wave)?;
        Ok(Harmonic::from_values(&values))
    });
    Ok(Position {
        table: position_table(table)?,
        harmonics: harmonics.collect::<Result<_, Error>>()?,
        slope: table.number(|table| table.slope_per_m),
        reference: table.number(|table| table.reference_m),
    })
}
