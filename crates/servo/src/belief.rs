//! Controller model of a drive, read from the description of its circuit.

use crate::refuse;
use crate::valves::valves;
use circuit::specification::{Circuit, Component};
use circuit::{ComponentKind, Error, PistonSide, friction_law, kinds};
use control::{Held, Model, Side, Slip};
use physics::{Gas, IdealGas};

/// The components of an axis that is controlled, by their names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Name of the cylinder.
    pub cylinder: String,
    /// Names of its valves, in the order of their commands.
    pub valves: Vec<String>,
    /// These are open or shut.
    pub switches: bool,
    /// Name of its supply.
    pub supply: String,
    /// Components that a law ignores, except for the volume of tubes at the chambers: for the law, the valve is
    /// directly at the cylinder and at its supply.
    pub left_out: Vec<String>,
}

/// Stiffness over mass, 1/s2, and damping over stiffness, s, of a sticking contact whose law has neither. It is
/// nearly the stiffest that steps of 1 ms can follow, so a resting mass moves little in the model (assumed).
const STICK_STIFFNESS: f64 = 5e5;
const STICK_DAMPING: f64 = 1e-3;

/// The only component whose kind begins with this text.
fn only<'c>(circuit: &'c Circuit, kind: &str, what: &str) -> Result<&'c Component, Error> {
    let mut each = circuit.components.iter().filter(|own| own.kind.starts_with(kind));
    match (each.next(), each.next()) {
        (Some(own), None) => Ok(own),
        (None, _) => refuse(format!("the circuit has no {what}: a law commands a circuit with one")),
        (Some(one), Some(other)) => refuse(format!(
            "the circuit has {} and {}: a law commands a circuit with one {what}. Describe the axis that is controlled alone",
            one.name, other.name
        )),
    }
}

/// A number of a component: the given value, or the default.
pub(crate) fn number(own: &Component, key: &str) -> Option<f64> {
    let kind: &ComponentKind = kinds().into_iter().find(|kind| kind.key == own.kind)?;
    let row = kind.parameters.iter().find(|row| row.key == key)?;
    own.numbers.get(key).copied().or(row.default)
}

pub(crate) fn given(own: &Component, key: &str) -> Result<f64, Error> {
    match number(own, key) {
        Some(value) => Ok(value),
        None => refuse(format!("{}.{key} is missing: a law needs it", own.name)),
    }
}

/// Volume of the tubes that lead to a chamber, m3. This volume is filled and emptied together with the chamber.
fn tubes_at(circuit: &Circuit, cylinder: &Component, chamber: &str) -> f64 {
    let mut tubes: Vec<_> = circuit.components.iter().filter(|own| own.kind.starts_with("tube")).collect();
    let mut ends = vec![format!("{}.{chamber}", cylinder.name)];
    let mut volume = 0.0;
    while let Some(end) = ends.pop() {
        for port in circuit.joints.iter().filter(|joint| joint.contains(&end)).flatten() {
            let name = port.rsplit_once('.').map_or("", |(name, _)| name);
            let Some(place) = tubes.iter().position(|own| own.name == name) else { continue };
            let tube = tubes.remove(place);
            ends.extend(["1", "2"].map(|port| format!("{name}.{port}")));
            let [length, diameter] = ["length", "diameter"].map(|key| number(tube, key).unwrap_or(0.0));
            volume += PistonSide::of_bore(diameter, 0.0).area * length;
        }
    }
    volume
}

/// The controller model of a drive with one cylinder and valves, and its components.
pub fn belief(circuit: &Circuit) -> Result<(Model, Axis), Error> {
    let cylinder = only(circuit, "cylinder/", "cylinder")?;
    let supply = only(circuit, "reservoir", "reservoir")?;
    let gas = IdealGas::new(circuit.gas.heat_capacity_ratio, circuit.gas.gas_constant_j_kg_k);
    let (commanded, valve) = valves(circuit, cylinder, supply, &gas)?;
    let (loads, others): (Vec<&Component>, Vec<&Component>) = (circuit.components.iter())
        .filter(|own| !commanded.iter().chain([&cylinder, &supply]).any(|known| known.name == own.name))
        .partition(|own| own.kind == "load");
    let of_loads = |key: &str| loads.iter().filter_map(|own| number(own, key)).sum::<f64>();
    let [bore, rod, stroke, incline] = [
        given(cylinder, "bore")?,
        given(cylinder, "rod_diameter")?,
        given(cylinder, "stroke")?,
        given(cylinder, "incline")?,
    ];
    let rods = match &*cylinder.kind {
        "cylinder/rodless" => [0.0, 0.0],
        "cylinder/through-rod" => [rod, rod],
        _ => [0.0, rod],
    };
    let side = |i: usize, key: &str| -> Result<Side, Error> {
        let PistonSide { area, perimeter, end_wall } = PistonSide::of_bore(bore, rods[i]);
        Ok(Side {
            area,
            perimeter,
            end_wall,
            dead_volume: given(cylinder, key)? + tubes_at(circuit, cylinder, ["a", "b"][i]),
            length: [0.0, stroke][i],
            sign: [1.0, -1.0][i],
        })
    };
    let mass = given(cylinder, "moving_mass")? + of_loads("mass");
    let Some(friction) = &cylinder.friction else {
        return refuse(format!("{} has no friction", cylinder.name));
    };
    let of_elements = friction.elements.iter().map(|own| own.stiffness_n_m).reduce(|sum, own| sum + own);
    let bristle = |key: &str| friction.parameters.get(key).copied();
    let stiffness = of_elements.or(bristle("bristle_stiffness"));
    let contact = friction_law(friction)?;
    let stick_stiffness = stiffness.unwrap_or(STICK_STIFFNESS * mass);
    let stick_damping_time = match (stiffness, bristle("bristle_damping")) {
        (None, _) => STICK_DAMPING,
        (_, damping) => damping.unwrap_or(0.0) / stick_stiffness,
    };
    let ambient = Held { pressure: circuit.ambient.pressure_pa, temperature: circuit.ambient.temperature_k };
    let model = Model {
        ambient,
        supply: Held {
            pressure: given(supply, "pressure")?,
            temperature: number(supply, "temperature").unwrap_or(ambient.temperature),
        },
        sides: [side(0, "dead_volume_a")?, side(1, "dead_volume_b")?],
        stroke,
        mass,
        load: of_loads("force") - mass * physics::constants::STANDARD_GRAVITY * incline.sin(),
        heat_transfer: given(cylinder, "heat_transfer")?,
        wall_temperature: number(cylinder, "wall_temperature").unwrap_or(ambient.temperature),
        valve,
        friction_shares: [1.0; 2],
        stick_stiffness,
        stick_damping_time,
        slip: Slip::of(&contact.law),
        friction: contact,
        gas: Gas::from(&gas),
    };
    let switches = !model.valve.arrangement.is_proportional();
    let left_out = others.into_iter().map(|own| own.name.clone()).collect();
    let name = |own: &Component| own.name.clone();
    Ok((
        model,
        Axis {
            cylinder: name(cylinder),
            valves: commanded.into_iter().map(name).collect(),
            switches,
            supply: name(supply),
            left_out,
        },
    ))
}
