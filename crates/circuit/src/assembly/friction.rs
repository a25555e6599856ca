//! The friction of a description: a law, and what acts on it, with every value checked.

use crate::run::Error;
use crate::specification::{self, Growth, StribeckShape};
use physics::Parameter;
use physics::friction::{
    self, AnyLaw, Choices, Composition, Contact, Direction, Dwell, Harmonic, LAWS, Meta, Position,
    Relaxation, SealLips, Shape, SideLoad,
};

/// Harmonics of position that a description may have: more would describe the noise of a recording.
const MOST_HARMONICS: usize = 4;

fn refuse<T>(message: String) -> Result<T, Error> {
    Err(Error::Specification(message))
}

/// The friction of a description; unknown names list the choices.
pub fn friction_law(spec: &specification::Friction) -> Result<Contact<f64>, Error> {
    let law = law(spec)?;
    let lips = spec.pressure.as_ref().map(|p| SealLips {
        coulomb_a: p.coulomb_a,
        coulomb_b: p.coulomb_b,
        breakaway_a: p.breakaway_a,
        breakaway_b: p.breakaway_b,
    });
    let composition = composition(spec, law.meta())?;
    Ok(Contact::new(law, lips, composition))
}

fn law(spec: &specification::Friction) -> Result<AnyLaw<f64>, Error> {
    let Some(meta) = LAWS.iter().find(|meta| meta.key == spec.law) else {
        let names: Vec<&str> = LAWS.iter().map(|meta| meta.key).collect();
        return refuse(format!(
            "friction.law = \"{}\" is unknown; choose one of {}",
            spec.law,
            names.join(", ")
        ));
    };
    for key in spec.parameters.keys() {
        if !meta.parameters.iter().any(|parameter| parameter.key == key) {
            let names: Vec<&str> = meta.parameters.iter().map(|parameter| parameter.key).collect();
            return refuse(format!(
                "friction.{key} is no parameter of \"{}\"; it has {}",
                meta.key,
                names.join(", ")
            ));
        }
    }
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
    let choices = choices(spec, meta)?;
    let mut value = |parameter: &Parameter| match (parameter.key, spec.stribeck_shape) {
        ("stribeck_exponent", Some(StribeckShape::Exponential)) => 1.0,
        (key, _) => spec.parameters.get(key).copied().or(parameter.default).expect("checked above"),
    };
    Ok(AnyLaw::build(meta.key, &mut value, &choices).expect("the name is registered"))
}

/// What the description chooses beside numbers.
fn choices(spec: &specification::Friction, law: &Meta) -> Result<Choices, Error> {
    let Some(shape) = spec.stribeck_shape else { return Ok(Choices::default()) };
    let takes = |key: &str| law.parameters.iter().any(|parameter| parameter.key == key);
    if !takes("stribeck_exponent") {
        return refuse(format!(
            "friction.stribeck_shape needs a Stribeck curve, which law \"{}\" has not",
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
    Ok(Choices { shape })
}

/// Refuses a value out of the bounds of its parameter.
fn within(table: &str, parameter: &Parameter, value: f64) -> Result<(), Error> {
    if parameter.bounds.contain(value) {
        return Ok(());
    }
    refuse(format!(
        "{table}.{} = {value} {} is out of bounds: it must be {}",
        parameter.key, parameter.unit, parameter.bounds
    ))
}

/// The values, all within the bounds of their parameters.
fn checked<const N: usize>(
    table: &str,
    parameters: &[Parameter],
    values: [f64; N],
) -> Result<[f64; N], Error> {
    for (parameter, value) in parameters.iter().zip(values) {
        within(table, parameter, value)?;
    }
    Ok(values)
}

fn composition(spec: &specification::Friction, law: &Meta) -> Result<Composition<f64>, Error> {
    let dwell = spec.dwell.as_ref().map(dwell).transpose()?;
    let relaxation = spec.relaxation.as_ref().map(|table| relaxation(table, law)).transpose()?;
    let position = spec.position.as_ref().map(position).transpose()?;
    let direction = spec.direction.as_ref().map(|table| {
        let values = [table.positive, table.negative];
        let [positive, negative] = checked("friction.direction", Direction::<f64>::PARAMETERS, values)?;
        Ok(Direction { positive, negative, sticks: law.sticks })
    });
    let side_load = spec.side_load.as_ref().map(|table| {
        let values = [table.force_n, table.coefficient];
        let [force, coefficient] = checked("friction.side_load", SideLoad::<f64>::PARAMETERS, values)?;
        Ok(SideLoad { force, coefficient })
    });
    let (direction, side_load) = (direction.transpose()?, side_load.transpose()?);
    Ok(Composition { position, direction, side_load, dwell, relaxation })
}

fn dwell(table: &specification::Dwell) -> Result<Dwell<f64>, Error> {
    let growth = match table.growth {
        Growth::Saturating => friction::Growth::Saturating,
        Growth::Log => friction::Growth::Logarithmic,
        Growth::Hyperbolic => friction::Growth::Hyperbolic,
    };
    let values = [
        table.increment_n,
        table.time_s,
        table.exponent,
        table.distance_m,
        table.pressure_a,
        table.pressure_b,
    ];
    Ok(Dwell::new(growth, checked("friction.dwell", Dwell::<f64>::PARAMETERS, values)?))
}

fn relaxation(table: &specification::Relaxation, law: &Meta) -> Result<Relaxation<f64>, Error> {
    if !law.bristles {
        let laws = LAWS.iter().filter(|meta| meta.bristles).map(|meta| meta.key);
        return refuse(format!(
            "friction.relaxation needs elastic bristles, which law \"{}\" has not; choose one of {}",
            law.key,
            laws.collect::<Vec<_>>().join(", ")
        ));
    }
    let values = [table.share, table.time_s, table.distance_m];
    let [share, time, distance] = checked("friction.relaxation", Relaxation::<f64>::PARAMETERS, values)?;
    Ok(Relaxation { share, time, distance })
}

fn position(table: &specification::Position) -> Result<Position<f64>, Error> {
    let waves = &table.harmonics;
    if waves.len() > MOST_HARMONICS {
        return refuse(format!(
            "friction.position has {} harmonics; at most {MOST_HARMONICS} are taken",
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
    for (key, value) in [("slope", table.slope_per_m), ("reference", table.reference_m)] {
        if !value.is_finite() {
            return refuse(format!("friction.position.{key} = {value} is out of bounds: it must be finite"));
        }
    }
    let harmonics = waves.iter().map(|wave| {
        let values = [wave.period_m, wave.amplitude, wave.phase_rad];
        let [period, amplitude, phase] =
            checked("friction.position.harmonics", Harmonic::<f64>::PARAMETERS, values)?;
        Ok(Harmonic { period, amplitude, phase })
    });
    Ok(Position {
        harmonics: harmonics.collect::<Result<_, Error>>()?,
        slope: table.slope_per_m,
        reference: table.reference_m,
    })
}
