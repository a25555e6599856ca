use super::evaluate::shoot::{Shooting, Shot, shoot};
use super::gas;
use super::wiring::{self, Joint, Joints};
use crate::assembly::variables::{Assembly, Settable, Variables};
use crate::component::{Acts, Instance, Node, Quantity, Starting};
use crate::ground::{Error, Lifted, seeds};
use crate::specification;
use math::{Deps, Lane, Over};
use physics::flow::LEAK_RATIO;
use std::collections::BTreeMap;
use std::iter;

/// A volume without a piston. The volume has a line with a restriction and an optional tube, and a leak into the
/// ambient air. A
/// command is the opening fraction of the line.
#[derive(Clone, Debug)]
pub struct Tank {
    assembly: Assembly,
}

type Spec = specification::Tank;

/// Indices of the volume and of the line among the components of a tank.
const VOLUME: usize = 0;
const LINE: usize = 1;

/// A tank as components and joints.
fn components<P: Lane>(lifted: &Lifted<Spec>) -> (Vec<Instance<P>>, Joints) {
    let number = |f: fn(&Spec) -> f64| Some((lifted.number(f), lifted.is_free(f)));
    // Conductance of the whole wall: a coefficient, W/(m2 K), on a wall of 1 m2.
    let volume = Instance::new("volume", "tank", |key| match key {
        "volume" => number(|s| s.volume.volume_m3),
        "wall_area" => Some((P::one(), false)),
        "heat_transfer" => number(|s| s.volume.heat_transfer_w_k),
        "wall_temperature" => number(|s| s.volume.wall_temperature_k),
        _ => None,
    });
    let (mut each, mut at_volume, mut joints) = (vec![volume], vec![(VOLUME, 0)], Vec::new());
    if let Some(line) = lifted.optional(|spec| spec.line.as_ref()) {
        let number = |f: fn(&specification::Line) -> f64| Some((line.number(f), line.is_free(f)));
        each.push(Instance::new("line", "fitting", |key| match key {
            "conductance" => number(|l| l.conductance_m3_s_pa),
            "critical_pressure_ratio" => number(|l| l.critical_pressure_ratio),
            "subsonic_index" => number(|l| l.subsonic_index),
            "linear_above" => number(|l| l.linear_above),
            _ => None,
        }));
        each.push(Instance::new("other_side", "reservoir", |key| match key {
            "pressure" => number(|l| l.pressure_pa),
            "temperature" => number(|l| l.temperature_k),
            _ => None,
        }));
        joints.push(vec![(LINE + 1, 0), (LINE, 0)]);
        if let Some(tube) = lifted.optional(|spec| spec.tube.as_ref()) {
            joints.push(vec![(LINE, 1), (each.len(), 0)]);
            at_volume.push((each.len(), 1));
            each.push(Instance::new("tube", "tube/distributed", |key| {
                let one = |table: &BTreeMap<String, f64>| table.get(key).copied();
                one(tube.value)?;
                Some((tube.number_or(0.0, one), tube.is_free(|table| one(table).unwrap_or(f64::NAN))))
            }));
        } else {
            at_volume.push((LINE, 1));
        }
    }
    let leakage = |s: &Spec| s.volume.leakage_m3_s_pa;
    let mut open = Vec::new();
    if leakage(lifted.value) != 0.0 || lifted.is_free(leakage) {
        at_volume.push((each.len(), 0));
        open.push((each.len(), 1));
        each.push(Instance::new("leak", "fitting", |key| match key {
            "conductance" => number(leakage),
            "critical_pressure_ratio" => Some((P::c(LEAK_RATIO), false)),
            _ => None,
        }));
    }
    joints.push(at_volume);
    let joints = joints.into_iter().map(|ports| Joint { ports, ambient: false });
    let joints: Vec<Joint> = joints.chain([Joint { ports: open, ambient: true }]).collect();
    (each, joints.into())
}

/// Returns the equations, from numbers with or without derivatives.
fn wire<P: Lane>(lifted: &Lifted<Spec>) -> Result<Assembly<P>, Error>
where
    Deps: Over<P>,
{
    let number = |f: fn(&Spec) -> f64| -> P { lifted.number(f) };
    let gas = gas::gas(&lifted.table(|spec| &spec.gas));
    let is_air = gas::gas::<f64>(&Lifted::plain(&lifted.value.gas)).is_air();
    let ambient = [number(|s| s.ambient.pressure_pa), number(|s| s.ambient.temperature_k)];
    let (each, joints) = components(lifted);
    let wiring::Wired { circuit, nodes, inputs, starts, .. } =
        wiring::wire(&gas, is_air, ambient, (&each, &joints), false, None)?;
    let Node::Gas(tank) = nodes[VOLUME][0] else { unreachable!("a tank holds gas") };
    let command = inputs.iter().find_map(|(name, _, acts)| match acts {
        Acts::On(id) if name == "line.opening" => Some(*id),
        _ => None,
    });
    let alike = starts.into_iter().filter_map(|(starting, _)| match starting {
        Starting::Gas(node) if node != tank => Some((Starting::Alike(node), Vec::new())),
        _ => None,
    });
    let own = (Starting::Gas(tank), ["pressure_pa", "temperature_k"].map(Into::into).to_vec());
    let mut variables = Variables {
        inputs: (command.iter())
            .map(|line| Settable::of(&circuit, *line, "command", "opening of the line"))
            .collect(),
        starts: iter::once(own).chain(alike).collect(),
        ..Variables::default()
    };
    variables.read([
        ("time_s", Quantity::Time),
        ("pressure_pa", Quantity::Pressure(tank)),
        ("temperature_k", Quantity::Temperature(tank)),
        ("mass_flow_kg_s", Quantity::MassFlow(tank)),
    ]);
    if let Some(Node::Gas(inlet)) = nodes.get(LINE).map(|ports| ports[1]) {
        variables.read([("inlet_pressure_pa", Quantity::Pressure(inlet))]);
    }
    Ok(Assembly::new(circuit, variables))
}

impl Tank {
    /// Assembles the tank.
    pub fn assemble(spec: &Spec) -> Result<Self, Error> {
        Ok(Tank { assembly: wire(&Lifted::plain(spec))? })
    }

    /// Names of the numbers that a run starts from.
    pub fn start_names(&self) -> Vec<String> {
        self.assembly.start_names()
    }

    /// Runs the segments of `asked` with exact derivatives, as [`Drive::shoot`](super::Drive::shoot) does.
    pub fn shoot(
        &self,
        json: &str,
        asked: &Shooting,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Shot, Error> {
        let lift = || {
            let seeds = seeds::<Spec>(json, "", &asked.parameters)?;
            Ok(move |first| wire(&Lifted::new(&seeds, first)))
        };
        shoot(&self.assembly, lift, asked, interrupted)
    }
}
