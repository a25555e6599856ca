//! What all parts of a circuit share.

use math::{Over, Real};
use physics::Gas;
// The standard reference atmosphere, as the zero of entropy.
use physics::constants::{P_0, T_0};

/// Data that all parts share.
#[derive(Clone, Copy, Debug)]
pub struct Common<P> {
    /// The gas of the circuit.
    pub gas: Gas<P>,
    /// Ambient pressure, Pa absolute.
    pub ambient_pressure: P,
    /// Ambient temperature, K.
    pub ambient_temperature: P,
}

math::gather!(Common { gas, ambient_pressure, ambient_temperature });

/// ln x for a balance. A trial stage may be outside the physical range. Its balances may have any value except NaN, so
/// that the steps are the same with and without a ledger.
pub(crate) fn log<S: Real>(x: S) -> S {
    x.max(S::c(f64::MIN_POSITIVE)).ln()
}

/// Entropy per mass relative to the reference state, J/(kg K).
pub(crate) fn specific_entropy<P: Real, S: Over<P>>(t: S, p: S, common: &Common<P>) -> S {
    let (cp, r) = (S::from(common.gas.cp), S::from(common.gas.gas_constant));
    let ideal = |p: S| cp * log(t / S::c(T_0)) - r * log(p / S::c(P_0));
    common.gas.virial.as_ref().map_or_else(
        || ideal(p),
        |virial| {
            let density = virial.density(&common.gas, p, t);
            ideal(density * r * t) + virial.residual_entropy(&common.gas, density, t)
        },
    )
}
