//! Controller model of a drive, read from the description of its circuit.

use crate::numbers::{given, number};
use crate::refuse;
use crate::valves::valves;
use circuit::specification::{Circuit, Component, Friction};
use circuit::{Error, PistonSide, friction_law};
use control::{ConstantGas, Model, Side, Slip};
use physics::{Gas, IdealGas};

/// The components of an axis that is controlled, by their names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Name of the cylinder.
    pub cylinder: String,
    /// Names of its valves, in the order of their commands.
    pub valves: Vec<String>,
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

/// Heat-transfer coefficient in the controller model if the drive states none, W/(m2 K) (assumed): the law of heat
/// transfer gives 20 to 60 W/(m2 K) in strokes.
const HEAT_TRANSFER: f64 = 30.0;

/// The only component whose kind begins with this text.
fn only<'c>(circuit: &'c Circuit, kind: &str, what: &str) -> Result<&'c Component, Error> {
    let mut each = circuit.components.iter().filter(|own| own.kind.starts_with(kind));
    match (each.next(), each.next()) {
        (Some(own), None) => Ok(own),
        (None, _) => refuse!("the circuit has no {what}: a controller needs one"),
        (Some(one), Some(other)) => refuse!(
            "the circuit has {} and {}: a controller needs exactly one {what}. Describe only the controlled axis",
            one.name,
            other.name
        ),
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

/// Chambers a and b of a cylinder with a stroke, m.
fn sides(circuit: &Circuit, cylinder: &Component, stroke: f64) -> Result<[Side; 2], Error> {
    let [bore, rod] = [given(cylinder, "bore")?, given(cylinder, "rod_diameter")?];
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
    Ok([side(0, "dead_volume_a")?, side(1, "dead_volume_b")?])
}

/// Stiffness of the contact in stick, N/m, and its damping over its stiffness, s, of a moving mass, kg.
fn stick(friction: &Friction, mass: f64) -> [f64; 2] {
    let of_elements = friction.elements.iter().map(|own| own.stiffness).reduce(|sum, own| sum + own);
    let bristle = |key: &str| friction.parameters.get(key).copied();
    let Some(stiffness) = of_elements.or(bristle("bristle_stiffness")) else {
        return [STICK_STIFFNESS * mass, STICK_DAMPING];
    };
    [stiffness, bristle("bristle_damping").unwrap_or(0.0) / stiffness]
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
    let stroke = given(cylinder, "stroke")?;
    let mass = given(cylinder, "moving_mass")? + of_loads("mass");
    let weight = mass * physics::constants::STANDARD_GRAVITY * given(cylinder, "incline")?.sin();
    let Some(friction) = &cylinder.friction else {
        return refuse!("{} has no friction", cylinder.name);
    };
    let contact = friction_law(friction)?;
    let [stick_stiffness, stick_damping_time] = stick(friction, mass);
    let ambient =
        ConstantGas { pressure: circuit.ambient.pressure_pa, temperature: circuit.ambient.temperature_k };
    let model = Model {
        ambient,
        supply: ConstantGas {
            pressure: given(supply, "pressure")?,
            temperature: number(supply, "temperature").unwrap_or(ambient.temperature),
        },
        sides: sides(circuit, cylinder, stroke)?,
        stroke,
        mass,
        load: of_loads("force") - weight,
        heat_transfer: number(cylinder, "heat_transfer").unwrap_or(HEAT_TRANSFER),
        wall_temperature: number(cylinder, "wall_temperature").unwrap_or(ambient.temperature),
        valve,
        friction_shares: [1.0; 2],
        stick_stiffness,
        stick_damping_time,
        slip: Slip::of(&contact.law),
        friction: contact,
        gas: Gas::from(&gas),
    };
    let name = |own: &Component| own.name.clone();
    let axis = Axis {
        cylinder: name(cylinder),
        valves: commanded.into_iter().map(name).collect(),
        supply: name(supply),
        left_out: others.into_iter().map(name).collect(),
    };
    Ok((model, axis))
}
