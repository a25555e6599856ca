//! The friction of a description: a law and its modifiers, with every value checked.

use super::own_law::{check_levels, own_law};
use crate::ground::{DIRECTIONS, Error, Lifted, seeds};
use crate::specification::{self, Growth, StribeckShape};
use math::{Dual, Lane};
use physics::Parameter;
use physics::friction::formula::{Formula, OwnLaw};
use physics::friction::{
    self, AnyLaw, At, Choices, Composition, Contact, Direction, Dwell, ELEMENTS, Element, Harmonic, Heating,
    LAWS, Meta, Position, Relaxation, SealLips, Shape, SideLoad, Table, Wear,
};
use std::collections::BTreeMap;

/// Largest number of points of a position table, because each costs time at every evaluation.
const MOST_POINTS: usize = 50;

/// Largest number of harmonics of position. More would describe the noise of a recording.
const MOST_HARMONICS: usize = 4;

/// Largest deviation of the sum of fractions from 1: rounding to four digits.
const SHARES_WITHIN: f64 = 1e-3;

fn refuse<T>(message: String) -> Result<T, Error> {
    Err(Error::Specification(message))
}

/// Reads the friction of a description. An error for an unknown name lists the choices.
pub fn friction_law(spec: &specification::Friction) -> Result<Contact<f64>, Error> {
    contact(&Lifted::plain(spec))
}

/// Reads the same with derivatives.
pub(crate) fn contact<P: Lane>(spec: &Lifted<specification::Friction>) -> Result<Contact<P>, Error> {
    let law = law(spec)?;
    let lips = spec.optional(|spec| spec.pressure.as_ref()).map(|lips| SealLips {
        coulomb_a: lips.number(|p| p.coulomb_a),
        coulomb_b: lips.number(|p| p.coulomb_b),
        breakaway_a: lips.number(|p| p.breakaway_a),
        breakaway_b: lips.number(|p| p.breakaway_b),
    });
    let composition = composition(spec, law.meta())?;
    Ok(Contact::new(law, lips, composition))
}

/// Returns steady sliding at each of `places`: the forces, N, and their derivatives by the numbers `names`, place by
/// place. `json` is the friction of a description without `parameters`.
pub fn steady_sensitivity(
    json: &str,
    parameters: &BTreeMap<String, f64>,
    names: &[String],
    places: &[At<f64>],
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let mut seeds = seeds::<specification::Friction>(json, "friction", names)?;
    seeds.value.parameters = parameters.clone();
    let mut derivatives = vec![0.0; places.len() * names.len()];
    for first in (0..names.len()).step_by(DIRECTIONS) {
        let friction = contact::<Dual<f64, DIRECTIONS>>(&Lifted::new(&seeds, first))?;
        let last = names.len().min(first + DIRECTIONS);
        for (row, at) in derivatives.chunks_exact_mut(names.len()).zip(places) {
            let force = friction.steady(&at.map(Dual::from));
            row[first..last].copy_from_slice(&force.eps[..last - first]);
        }
    }
    let friction = friction_law(&seeds.value)?;
    Ok((places.iter().map(|at| friction.steady(at)).collect(), derivatives))
}

/// Returns the table of the law, and the law itself if it is custom.
pub(super) fn meta(
    spec: &specification::Friction,
) -> Result<(&'static Meta, Option<&'static OwnLaw>), Error> {
    if let Some(formula) = &spec.formula {
        let own = own_law(formula).map_err(|refusal| Error::Specification(refusal.to_string()))?;
        return Ok((&own.meta, Some(own)));
    }
    let Some(meta) = LAWS.iter().find(|meta| meta.key == spec.law) else {
        let names: Vec<&str> = LAWS.iter().map(|meta| meta.key).collect();
        return refuse(format!(
            "friction.law = \"{}\" is unknown; choose one of {}",
            spec.law,
            names.join(", ")
        ));
    };
    Ok((meta, None))
}

/// Refuses parameter values that are missing, out of bounds or inconsistent.
fn check_values(spec: &specification::Friction, meta: &Meta) -> Result<(), Error> {
    for parameter in meta.parameters {
        match spec.parameters.get(parameter.key).copied().or(parameter.default) {
            None => {
                return refuse(format!(
                    "friction.{} is missing: {} [{}]",
                    parameter.key,
                    parameter.meaning.trim(),
                    parameter.unit
                ));
            }
            Some(value) => within("friction", parameter, value)?,
        }
    }
    let value = |key: &str| spec.parameters.get(key);
    if let (Some(fc), Some(fs)) = (value("coulomb"), value("breakaway"))
        && fs < fc
    {
        return refuse(format!("friction.breakaway = {fs} N must not be below friction.coulomb = {fc} N"));
    }
    Ok(())
}

/// Returns the same friction with other values of its law's parameters. `None` if other quantities depend on these
/// parameters.
pub(super) fn with_values(
    like: &Contact<f64>,
    spec: &specification::Friction,
) -> Result<Option<Contact<f64>>, Error> {
    let (meta, own) = meta(spec)?;
    if own.is_some() || meta.elements {
        return Ok(None);
    }
    check_values(spec, meta)?;
    let plain = Lifted::plain(spec);
    Ok(Some(like.with_law(like.law.lifted(&mut |parameter| number(&plain, parameter)))))
}

fn law<P: Lane>(lifted: &Lifted<specification::Friction>) -> Result<AnyLaw<P>, Error> {
    let spec = lifted.value;
    let (meta, own) = meta(spec)?;
    for key in lifted.tables().flat_map(|spec| spec.parameters.keys()) {
        if !meta.parameters.iter().any(|parameter| parameter.key == key) {
            let names: Vec<&str> = meta.parameters.iter().map(|parameter| parameter.key).collect();
            return refuse(format!(
                "friction.{key} is not a parameter of \"{}\"; it has {}",
                meta.key,
                names.join(", ")
            ));
        }
    }
    check_values(spec, meta)?;
    if let Some(own) = own {
        check_levels(spec, own)?;
        Formula::new(own, numbers(lifted, meta)).examine().map_err(Error::Specification)?;
    }
    let mut choices = choices(spec, meta, own.is_some())?;
    if let Some(own) = own {
        return Ok(AnyLaw::Formula(Formula::new(own, numbers(lifted, meta))));
    }
    if choices.shape.is_none() && lifted.is_free(|spec| named(spec, "stribeck_exponent").unwrap_or(0.0)) {
        // This includes the exponent 2, whose value alone would be a square.
        choices.shape = Some(Shape::Power);
    }
    let plain = AnyLaw::build(meta.key, &mut |parameter| number(lifted, parameter), &choices);
    let mut law = plain.expect("the name is registered").lifted(&mut |parameter| number(lifted, parameter));
    if let (AnyLaw::MaxwellSlip(law), false) = (&mut law, spec.elements.is_empty()) {
        let element = |i: usize| Element {
            stiffness: lifted.number(|spec| spec.elements[i].stiffness_n_m),
            level: lifted.number(|spec| spec.elements[i].share),
        };
        law.set_elements((0..spec.elements.len()).map(element).collect());
    }
    Ok(law)
}

/// Returns the values of all parameters, which have been checked.
fn numbers<P: Lane>(lifted: &Lifted<specification::Friction>, law: &Meta) -> Vec<P> {
    law.parameters.iter().map(|parameter| number(lifted, parameter)).collect()
}

fn named(spec: &specification::Friction, key: &str) -> Option<f64> {
    spec.parameters.get(key).copied()
}

/// Returns the value of a parameter that has been checked.
fn number<P: Lane>(lifted: &Lifted<specification::Friction>, parameter: &Parameter) -> P {
    match (parameter.key, lifted.value.stribeck_shape) {
        ("stribeck_exponent", Some(StribeckShape::Exponential)) => P::one(),
        (key, _) => lifted.number_or(parameter.default.unwrap_or(f64::NAN), |spec| named(spec, key)),
    }
}

/// Choices of the description.
fn choices(spec: &specification::Friction, law: &Meta, own: bool) -> Result<Choices, Error> {
    let (elements, evolution) = (elements(spec, law)?, evolution(spec, law)?);
    Ok(Choices { shape: shape(spec, law, own)?, elements, evolution })
}

fn shape(spec: &specification::Friction, law: &Meta, own: bool) -> Result<Option<Shape>, Error> {
    let Some(shape) = spec.stribeck_shape else { return Ok(None) };
    let takes = |key: &str| law.parameters.iter().any(|parameter| parameter.key == key);
    if own || !takes("stribeck_exponent") {
        return refuse(format!(
            "friction.stribeck_shape needs a Stribeck curve, but law \"{}\" has none",
            law.key
        ));
    }
    if shape != StribeckShape::Free && spec.parameters.get("stribeck_exponent").is_some_and(|n| *n != 2.0) {
        return refuse("friction.stribeck_exponent needs friction.stribeck_shape = \"free\"".into());
    }
    let shape = match shape {
        StribeckShape::Gaussian => Some(Shape::Gaussian),
        StribeckShape::Exponential => Some(Shape::Power),
        StribeckShape::Lorentzian => Some(Shape::Lorentzian),
        StribeckShape::Free => None,
    };
    Ok(shape)
}

/// Returns the elements of a description, in N/m and fractions of the force level.
fn elements(spec: &specification::Friction, law: &Meta) -> Result<Vec<Element<f64>>, Error> {
    let listed = &spec.elements;
    let stiffness = spec.parameters.get("bristle_stiffness").filter(|k| k.is_finite());
    match (law.elements, listed.is_empty(), stiffness) {
        (false, false, _) => {
            return refuse(format!("friction.elements belongs to law \"gms\"; law \"{}\" has none", law.key));
        }
        (false, true, _) | (true, true, Some(_)) => return Ok(Vec::new()),
        (true, true, None) => {
            return refuse(
                "friction.bristle_stiffness is missing: give it, or the elements themselves as friction.elements"
                    .into(),
            );
        }
        (true, false, Some(_)) => {
            return refuse(
                "friction.bristle_stiffness and friction.elements both give the stiffness: give one of them"
                    .into(),
            );
        }
        (true, false, None) => {}
    }
    if !ELEMENTS.contains(&listed.len()) {
        return refuse(format!(
            "friction.elements has {} elements; it must have {} to {}",
            listed.len(),
            ELEMENTS.start(),
            ELEMENTS.end()
        ));
    }
    for (i, element) in listed.iter().enumerate() {
        for (key, value) in [("stiffness", element.stiffness_n_m), ("share", element.share)] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(format!("friction.elements[{i}].{key} = {value} must be greater than 0"));
            }
        }
    }
    let total: f64 = listed.iter().map(|element| element.share).sum();
    if (total - 1.0).abs() > SHARES_WITHIN {
        return refuse(format!("friction.elements: the shares add up to {total}; they must add up to 1"));
    }
    let scaled =
        |e: &specification::SlipElement| Element { stiffness: e.stiffness_n_m, level: e.share / total };
    Ok(listed.iter().map(scaled).collect())
}

fn evolution(spec: &specification::Friction, law: &Meta) -> Result<friction::Evolution, Error> {
    if spec.evolution.is_some() && !law.evolves {
        return refuse(format!(
            "friction.evolution belongs to law \"rate-and-state\"; law \"{}\" has no such state",
            law.key
        ));
    }
    Ok(match spec.evolution {
        None | Some(specification::Evolution::Ageing) => friction::Evolution::Ageing,
        Some(specification::Evolution::Slip) => friction::Evolution::Slip,
    })
}

/// Refuses a value outside the bounds of its parameter.
fn within(table: &str, parameter: &Parameter, value: f64) -> Result<(), Error> {
    if parameter.bounds.contain(value) {
        return Ok(());
    }
    refuse(format!(
        "{table}.{} = {value} {} is out of bounds: it must be {}",
        parameter.key,
        parameter.unit,
        parameter.bounds.rule(value)
    ))
}

/// Returns the numbers of a table, with values within the bounds of their parameters.
fn checked<P: Lane, T, const N: usize>(
    name: &str,
    parameters: &[Parameter],
    table: &Lifted<T>,
    numbers: impl Fn(&T) -> [f64; N],
) -> Result<[P; N], Error> {
    for (parameter, value) in parameters.iter().zip(numbers(table.value)) {
        within(name, parameter, value)?;
    }
    Ok(table.numbers(numbers))
}

fn composition<P: Lane>(spec: &Lifted<specification::Friction>, law: &Meta) -> Result<Composition<P>, Error> {
    let dwell = spec.optional(|spec| spec.dwell.as_ref()).map(|table| dwell(&table)).transpose()?;
    let relaxation = spec.optional(|spec| spec.relaxation.as_ref());
    let relaxation = relaxation.map(|table| relaxed(&table, law)).transpose()?;
    let position = spec.optional(|spec| spec.position.as_ref()).map(|table| position(&table)).transpose()?;
    let direction = spec.optional(|spec| spec.direction.as_ref()).map(|table| {
        let numbers = |table: &specification::Direction| [table.positive, table.negative];
        let [positive, negative] =
            checked("friction.direction", Direction::<f64>::PARAMETERS, &table, numbers)?;
        Ok(Direction { positive, negative, sense: law.sense })
    });
    let side_load = spec.optional(|spec| spec.side_load.as_ref()).map(|table| {
        let numbers = |table: &specification::SideLoad| [table.force_n, table.coefficient];
        let [force, coefficient] =
            checked("friction.side_load", SideLoad::<f64>::PARAMETERS, &table, numbers)?;
        Ok(SideLoad { force, coefficient })
    });
    let (direction, side_load) = (direction.transpose()?, side_load.transpose()?);
    let heating = spec.optional(|spec| spec.temperature.as_ref()).map(|table| {
        let numbers = |t: &specification::Temperature| {
            [t.reference_k, t.viscous_per_k, t.levels_per_k, t.resistance_k_w, t.time_s]
        };
        let [reference, viscous, levels, resistance, time] =
            checked("friction.temperature", Heating::<f64>::PARAMETERS, &table, numbers)?;
        Ok(Heating { reference, viscous, levels, resistance, time, ambient: reference })
    });
    let wear = spec.optional(|spec| spec.wear.as_ref()).map(|table| {
        let numbers = |t: &specification::Wear| [t.run_in, t.run_in_distance_m, t.rate_per_m, t.slid_m];
        let [run_in, run_in_distance, rate, slid] =
            checked("friction.wear", Wear::<f64>::PARAMETERS, &table, numbers)?;
        Ok(Wear { run_in, run_in_distance, rate, slid })
    });
    let (heating, wear) = (heating.transpose()?, wear.transpose()?);
    Ok(Composition { position, direction, heating, wear, side_load, dwell, relaxation })
}

fn dwell<P: Lane>(table: &Lifted<specification::Dwell>) -> Result<Dwell<P>, Error> {
    let growth = match table.value.growth {
        Growth::Saturating => friction::Growth::Saturating,
        Growth::Log => friction::Growth::Logarithmic,
        Growth::Hyperbolic => friction::Growth::Hyperbolic,
    };
    let numbers = |table: &specification::Dwell| {
        [
            table.increment_n,
            table.time_s,
            table.exponent,
            table.distance_m,
            table.pressure_a,
            table.pressure_b,
        ]
    };
    Ok(Dwell::new(growth, checked("friction.dwell", Dwell::<f64>::PARAMETERS, table, numbers)?))
}

fn relaxed<P: Lane>(table: &Lifted<specification::Relaxation>, law: &Meta) -> Result<Relaxation<P>, Error> {
    if !law.bristles {
        let laws = LAWS.iter().filter(|meta| meta.bristles).map(|meta| meta.key);
        return refuse(format!(
            "friction.relaxation needs elastic bristles, but law \"{}\" has none; choose one of {}",
            law.key,
            laws.collect::<Vec<_>>().join(", ")
        ));
    }
    let numbers = |table: &specification::Relaxation| [table.share, table.time_s, table.distance_m];
    let [share, time, distance] =
        checked("friction.relaxation", Relaxation::<f64>::PARAMETERS, table, numbers)?;
    Ok(Relaxation { share, time, distance })
}

fn position_table<P: Lane>(position: &Lifted<specification::Position>) -> Result<Table<P>, Error> {
    let points = &position.value.table;
    if points.len() == 1 || points.len() > MOST_POINTS {
        return refuse(format!(
            "friction.position.table has {} points; it must have 2 to {MOST_POINTS}",
            points.len()
        ));
    }
    for pair in points.windows(2) {
        let [before, after] = [pair[0].position_m, pair[1].position_m];
        if before.is_nan() || after <= before || !after.is_finite() {
            return refuse(format!(
                "friction.position.table: the position {after} m must be above {before} m"
            ));
        }
    }
    if let Some(point) = points.iter().find(|point| !(point.factor > 0.0 && point.factor.is_finite())) {
        return refuse(format!(
            "friction.position.table: the factor {} must be greater than 0",
            point.factor
        ));
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
        return refuse(format!(
            "friction.position has {} harmonics; it may have at most {MOST_HARMONICS}",
            waves.len()
        ));
    }
    let total: f64 = waves.iter().map(|wave| wave.amplitude.abs()).sum();
    if total >= 1.0 {
        return refuse(format!(
            "friction.position: the amplitudes add up to {total}, so that friction would change its sign; \
             they must add up to less than 1"
        ));
    }
    for (key, value) in [("slope", table.value.slope_per_m), ("reference", table.value.reference_m)] {
        if !value.is_finite() {
            return refuse(format!("friction.position.{key} = {value} is out of bounds: it must be finite"));
        }
    }
    let harmonics = (0..waves.len()).map(|k| {
        let numbers = |wave: &specification::Harmonic| [wave.period_m, wave.amplitude, wave.phase_rad];
        let wave = table.table(|table| &table.harmonics[k]);
        let [period, amplitude, phase] =
            checked("friction.position.harmonics", Harmonic::<f64>::PARAMETERS, &wave, numbers)?;
        Ok(Harmonic { period, amplitude, phase })
    });
    Ok(Position {
        table: position_table(table)?,
        harmonics: harmonics.collect::<Result<_, Error>>()?,
        slope: table.number(|table| table.slope_per_m),
        reference: table.number(|table| table.reference_m),
    })
}
