//! The gas of a description, and its warnings.

use crate::ground::Lifted;
use crate::specification;
use math::Lane;
use physics::heat::Transport;
use physics::{Gas, IdealGas, Virial};

/// Source of the virial coefficients.
pub(super) const VIRIAL_SOURCE: &str = "libretexts-virial";

/// The gas of a description.
pub(super) fn gas<P: Lane>(lifted: &Lifted<specification::Gas>) -> Gas<P> {
    let ideal = IdealGas::new(
        lifted.number(|gas| gas.heat_capacity_ratio),
        lifted.number(|gas| gas.gas_constant_j_kg_k),
    );
    let virial = lifted.optional(|gas| gas.virial.as_ref()).map(|virial| Virial {
        a: virial.number(|own| own.a_m3_kg),
        b: virial.number(|own| own.b_m3_kg),
        c: virial.number(|own| own.c_k),
    });
    let specification::Gas { heat_capacity_ratio, gas_constant_j_kg_k, .. } = *lifted.value;
    let transport = Transport::of(&IdealGas::new(heat_capacity_ratio, gas_constant_j_kg_k));
    Gas { ideal, virial, transport }
}

/// Least pressure fraction of a third virial coefficient that gives a warning (assumed).
const MUCH_OFF: f64 = 0.1;

/// Warns about a gas for which the second virial coefficient is not sufficient.
pub(super) fn virial_warning(gas: &Gas<f64>, pressure: f64, temperature: f64) -> Option<String> {
    let off = gas.virial?.off(gas, pressure, temperature);
    (off.abs() > MUCH_OFF).then(|| {
        format!(
            "at {:.3} bar abs and {temperature:.1} K the gas is {:.0} % off the ideal one: above {:.0} % the third virial \
             coefficient counts, which is left out",
            pressure / 1e5,
            100.0 * off.abs(),
            100.0 * MUCH_OFF
        )
    })
}
