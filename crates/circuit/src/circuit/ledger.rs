//! Balances of mass, energy and entropy, as quadratures: flows over the boundary, and production.

use super::Circuit;
use crate::ground::{Channel, Kind};

/// The three closed balances: change of the stored quantity minus inflow.
#[derive(Clone, Debug)]
pub struct Balance {
    /// Stored mass minus net inflow, relative to the mass that was stored or moved, -.
    pub mass_error: f64,
    /// Stored energy minus net inflow, -. The reference is the energy throughput, or the energy that masses, chambers
    /// and springs exchange if it is larger. It is at least 1/300 of the stored energy.
    pub energy_error: f64,
    /// Entropy of the gas minus inflow and production, relative to the entropy throughput, -.
    pub entropy_error: f64,
    /// Least growth of any production between two samples, J/K. A negative value violates the second law.
    pub least_production: f64,
    /// Energy throughput, J: the sum of the magnitudes of all energy balances.
    pub turnover: f64,
    /// Every balance: name, kind, total. Balances with the same name are added.
    pub accounts: Vec<(String, Kind, f64)>,
}

/// Least throughput as a fraction of the stored quantity. Each state, including the energy of a gas, has a relative
/// error of `rtol`. An error of `rtol` of the stored quantity then counts as 300 `rtol`. A piston that vibrates at rest
/// on a stiff stop has a smaller throughput.
const LEAST_SHARE: f64 = 1.0 / 300.0;

/// Data of the ledger at one sample. The stored energy of a part may depend on its mode.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Mass, kg, energy, J, and entropy of the gas, J/K.
    pub stored: [f64; 3],
    /// Every balance, kg, J or J/K.
    pub accounts: Vec<f64>,
    /// The energy of each store, J: kinetic and potential energy and bristles of masses, volumes, and springs.
    pub stores: Vec<f64>,
}

/// Closes the balances of a run, from its states at the samples (balances included).
pub fn balance(circuit: &Circuit<f64>, samples: &[Vec<f64>]) -> Balance {
    closed(circuit, &samples.iter().map(|y| circuit.books(y)).collect::<Vec<_>>())
}

/// Closes the balances of a run, from the data at its samples.
pub(crate) fn closed(circuit: &Circuit<f64>, entries: &[Entry]) -> Balance {
    let [first, last] =
        [entries.first(), entries.last()].map(|entry| entry.expect("at least the initial state"));
    let (start, end, last, first) = (first.stored, last.stored, &last.accounts, &first.accounts);
    let total = |kind: Kind| -> f64 { sum(circuit, kind, |i| last[i] - first[i]) };
    let turned = |kind: Kind| -> f64 { sum(circuit, kind, |i| (last[i] - first[i]).abs()) };
    let produced = total(Kind::EntropyOfGas);
    let mut least_production = f64::INFINITY;
    for pair in entries.windows(2) {
        for (i, channel) in circuit.channels().iter().enumerate() {
            if matches!(channel.kind, Kind::EntropyOfGas | Kind::EntropyOfSolid) {
                least_production = least_production.min(pair[1].accounts[i] - pair[0].accounts[i]);
            }
        }
    }
    let turnover = turned(Kind::Energy);
    let entropy_turnover = turned(Kind::EntropyIn) + produced.abs();
    // Energy that oscillates between a mass and a spring or a gas does not appear in any balance.
    let swing = (0..entries[0].stores.len()).map(|store| {
        let each = entries.iter().map(|entry| entry.stores[store]);
        each.clone().fold(f64::MIN, f64::max) - each.fold(f64::MAX, f64::min)
    });
    let stored = start[1].abs().max(end[1].abs());
    let size = swing.fold(turnover, f64::max).max(LEAST_SHARE * stored);
    let relative = |error: f64, size: f64| if size > 0.0 { error / size } else { error };
    Balance {
        mass_error: relative(
            end[0] - start[0] - total(Kind::Mass),
            start[0].max(end[0]).max(turned(Kind::Mass)),
        ),
        energy_error: relative(end[1] - start[1] - total(Kind::Energy), size),
        entropy_error: relative(end[2] - start[2] - total(Kind::EntropyIn) - produced, entropy_turnover),
        least_production,
        turnover,
        accounts: summed(
            circuit.channels().iter().zip(last.iter().zip(first)).map(|(c, (last, first))| (c, last - first)),
        ),
    }
}

/// Adds the balances of one name: both chambers of a cylinder, all edges of a valve.
fn summed<'c>(each: impl Iterator<Item = (&'c Channel, f64)>) -> Vec<(String, Kind, f64)> {
    let mut all: Vec<(String, Kind, f64)> = Vec::new();
    for (Channel { name, kind }, value) in each {
        match all.iter_mut().find(|(other, of, _)| other == name && of == kind) {
            Some((.., sum)) => *sum += value,
            None => all.push((name.clone(), *kind, value)),
        }
    }
    all
}

fn sum(circuit: &Circuit<f64>, kind: Kind, value: impl Fn(usize) -> f64) -> f64 {
    let channels = circuit.channels().iter().enumerate();
    channels.filter(|(_, channel)| channel.kind == kind).map(|(i, _)| value(i)).sum()
}
