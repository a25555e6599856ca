//! Balances of a circuit: what each of them counts.

/// Quantity of a quadrature. Flows are positive into the circuit's gas, masses and springs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Mass from a reservoir, kg.
    Mass,
    /// Energy in any form, J.
    Energy,
    /// Entropy carried by gas or heat over the boundary of the gas, J/K.
    EntropyIn,
    /// Entropy produced in the gas, J/K. It never falls.
    EntropyOfGas,
    /// Entropy produced in solids by friction and dampers, J/K. It never falls.
    EntropyOfSolid,
}

/// One balance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Part and quantity of a balance.
    pub name: String,
    /// Its kind.
    pub kind: Kind,
}
