//! Mass, energy and entropy accounts: what crossed the boundary and what was produced, as quadratures.

/// What a quadrature counts. Flows count positive into the circuit's gas, masses and springs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Mass from a reservoir, kg.
    Mass,
    /// Energy in any form, J.
    Energy,
    /// Entropy carried by gas or heat over the boundary of the gas, J/K.
    EntropyIn,
    /// Entropy produced in the gas, J/K; never falls.
    EntropyOfGas,
    /// Entropy produced in solids by friction and dampers, J/K; never falls.
    EntropyOfSolid,
}

/// One account.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    pub name: String,
    pub kind: Kind,
}

/// The three accounts closed: what is stored now minus at the start, minus what came in.
#[derive(Clone, Debug)]
pub struct Balance {
    /// Mass stored minus mass that came in, relative to the mass that was stored or moved, -.
    pub mass_error: f64,
    /// Energy stored minus energy that came in, relative to the energy turned over, -.
    pub energy_error: f64,
    /// Entropy of the gas minus what came in and what was produced, relative to what was turned over, -.
    pub entropy_error: f64,
    /// The least growth of any production account between two samples, J/K; negative breaks the second law.
    pub least_production: f64,
    /// Energy turned over, J: the sum of the magnitudes of all energy accounts.
    pub turnover: f64,
    /// Every account: name, kind, total.
    pub accounts: Vec<(String, Kind, f64)>,
}
