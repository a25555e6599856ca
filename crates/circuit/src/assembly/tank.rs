use super::leak::leak;
use super::shoot::{Shooting, Shot, shoot};
use super::variables::{Assembly, Quantity, Settable, Starting, Variables};
use crate::circuit::Circuit;
use crate::lifted::{Lifted, seeds};
use crate::part::ChamberLaw;
use crate::run::Error;
use crate::specification;
use math::{Deps, Lane, Over};
use physics::IdealGas;
use physics::flow::Iso6358;

/// A volume without a piston, on a line with a restriction and with a leak into the ambient air. A command is
/// the share of the line's opening.
#[derive(Clone, Debug)]
pub struct Tank {
    assembly: Assembly,
}

/// The equations, from numbers with or without derivatives.
fn wire<P: Lane>(lifted: &Lifted<specification::Tank>) -> Assembly<P>
where
    Deps: Over<P>,
{
    let number = |f: fn(&specification::Tank) -> f64| -> P { lifted.number(f) };
    let gas = IdealGas::new(number(|s| s.gas.heat_capacity_ratio), number(|s| s.gas.gas_constant_j_kg_k));
    let is_air =
        IdealGas::new(lifted.value.gas.heat_capacity_ratio, lifted.value.gas.gas_constant_j_kg_k).is_air();
    let ambient = [number(|s| s.ambient.pressure_pa), number(|s| s.ambient.temperature_k)];
    let mut circuit = Circuit::new(&gas, ambient[0], ambient[1]);
    let around = circuit.reservoir(ambient[0], ambient[1]);
    // The whole wall's conductance: a coefficient, W/(m2 K), on a wall of 1 m2.
    let heat = number(|s| s.volume.heat_transfer_w_k);
    let wall = number(|s| s.volume.wall_temperature_k);
    let volume = number(|s| s.volume.volume_m3);
    let tank = circuit.volume(ChamberLaw::EnergyBalance, volume, P::one(), heat, wall);
    let line = lifted.optional(|spec| spec.line.as_ref()).map(|line| {
        let other = circuit.reservoir(line.number(|l| l.pressure_pa), line.number(|l| l.temperature_k));
        let index = |l: &specification::Line| l.subsonic_index;
        let law = Iso6358::for_gas(
            line.number(|l| l.conductance_m3_s_pa),
            line.number(|l| l.critical_pressure_ratio),
            line.number(index),
            line.number(|l| l.linear_above),
            index(line.value) == 0.5 && !line.is_free(index),
            &gas,
            is_air,
        );
        circuit.restriction(law, other, tank)
    });
    let leakage = |s: &specification::Tank| s.volume.leakage_m3_s_pa;
    let leaks = leakage(lifted.value) != 0.0 || lifted.is_free(leakage);
    let gap = leaks.then(|| circuit.restriction(leak(lifted.number(leakage), &gas, is_air), tank, around));
    let mut circuit = circuit.build(false);
    if let Some(gap) = gap {
        circuit.set_input(gap, 0, P::one());
    }
    let inputs = line.map(|line| Settable::of(&circuit, line, "command", "opening of the line"));
    let mut variables = Variables {
        inputs: inputs.into_iter().collect(),
        starts: vec![(Starting::Gas(tank), ["pressure_pa", "temperature_k"].map(Into::into).to_vec())],
        ..Variables::default()
    };
    variables.read([
        ("time_s", Quantity::Time),
        ("pressure_pa", Quantity::Pressure(tank)),
        ("temperature_k", Quantity::Temperature(tank)),
        ("mass_flow_kg_s", Quantity::MassFlow(tank)),
    ]);
    Assembly::new(circuit, variables)
}

impl Tank {
    /// Assembles the tank.
    pub fn assemble(spec: &specification::Tank) -> Self {
        Tank { assembly: wire(&Lifted::plain(spec)) }
    }

    /// Names of the numbers that a run starts from.
    pub fn start_names(&self) -> Vec<String> {
        self.assembly.start_names()
    }

    /// Runs the segments of `asked`, with exact derivatives, as [`Drive::shoot`](super::Drive::shoot) does.
    pub fn shoot(
        &self,
        json: &str,
        asked: &Shooting,
        interrupted: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Shot, Error> {
        let lift = || {
            let seeds = seeds::<specification::Tank>(json, "", &asked.parameters)?;
            Ok(move |first| Ok(wire(&Lifted::new(&seeds, first))))
        };
        shoot(&self.assembly, lift, asked, interrupted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ode::Options;
    use physics::constants::{RHO_0, T_0};

    const P_A: f64 = 1e5;
    const T_A: f64 = 293.15;
    const R: f64 = 287.05;

    /// A discharge from 8 bar into a vacuum, so that the flow is choked to the end.
    fn json(heat: f64) -> String {
        format!(
            r#"{{"gas": {{"heat_capacity_ratio": 1.4, "gas_constant_j_kg_k": {R}}},
                 "ambient": {{"pressure_pa": {P_A}, "temperature_k": {T_A}}},
                 "volume": {{"volume_m3": 2e-3, "heat_transfer_w_k": {heat}, "wall_temperature_k": {T_A}}},
                 "line": {{"conductance_m3_s_pa": 5e-9, "critical_pressure_ratio": 0.4, "subsonic_index": 0.5,
                           "linear_above": 0.999, "pressure_pa": 1.0, "temperature_k": {T_A}}}}}"#
        )
    }

    fn pressures(heat: f64, parameters: &[&str]) -> (Vec<f64>, Shot) {
        let json = json(heat);
        let times: Vec<f64> = (0..=40).map(|i| 0.05 * f64::from(i)).collect();
        let asked = Shooting {
            times: vec![0.0],
            commands: vec![1.0],
            sample_times: times.clone(),
            starts: vec![0],
            initial: vec![8e5, T_A],
            parameters: parameters.iter().map(ToString::to_string).collect(),
            with_initial: true.into(),
            outputs: vec!["pressure_pa".into()],
            options: Options { rtol: 1e-9, ..Options::default() },
            threads: 1,
        };
        let tank = Tank::assemble(&serde_json::from_str(&json).unwrap());
        (times, tank.shoot(&json, &asked, &mut |_| false).unwrap())
    }

    /// tau = V / (C rho0 R sqrt(T0 T)), rho0 and T0 of the standard reference atmosphere.
    fn tau() -> f64 {
        2e-3 / (5e-9 * RHO_0 * R * (T_0 * T_A).sqrt())
    }

    #[test]
    fn choked_discharge_follows_the_closed_forms() {
        let k = 1.4;
        let (times, adiabatic) = pressures(0.0, &[]);
        let (_, isothermal) = pressures(1e7, &[]);
        for (i, t) in times.iter().enumerate() {
            let expected = 8e5 * (1.0 + (k - 1.0) / 2.0 * t / tau()).powf(-2.0 * k / (k - 1.0));
            assert!((adiabatic.values[i] / expected - 1.0).abs() < 1e-6, "{t}: {}", adiabatic.values[i]);
            let expected = 8e5 * (-t / tau()).exp();
            assert!((isothermal.values[i] / expected - 1.0).abs() < 1e-6, "{t}: {}", isothermal.values[i]);
        }
    }

    #[test]
    fn derivatives_are_those_of_the_closed_form() {
        let (times, shot) = pressures(0.0, &["line.conductance_m3_s_pa"]);
        let k: f64 = 1.4;
        for (i, t) in times.iter().enumerate() {
            // By the logarithm of C: the time counts in tau, which goes with 1/C.
            let s = 1.0 + (k - 1.0) / 2.0 * t / tau();
            let expected = -8e5 * k * (t / tau()) * s.powf(-2.0 * k / (k - 1.0) - 1.0);
            let found = shot.sensitivities[3 * i] * 5e-9;
            assert!((found - expected).abs() < 1e-6 * 8e5, "{t}: {found} {expected}");
            // By the start: pressures scale with it.
            let found = shot.sensitivities[3 * i + 1];
            assert!((found - shot.values[i] / 8e5).abs() < 1e-3, "{t}: {found}");
        }
    }
}
