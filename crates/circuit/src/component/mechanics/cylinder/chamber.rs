//! The chambers of a cylinder.

use crate::component::prelude::*;
use crate::part::ChamberLaw;
use std::f64::consts::PI;

pub(super) fn chamber_law<P: Lane>(own: &Instance<P>) -> ChamberLaw {
    if own.choices[0] == 0 { ChamberLaw::EnergyBalance } else { ChamberLaw::AsPrinted }
}

/// Returns the dead volume of the chamber at an end, m3.
pub(super) fn dead_volume<P: Lane>(own: &Instance<P>, end: &str) -> P {
    let mut each = own.table.parameters.iter().zip(&own.numbers);
    let own = each.find(|(row, _)| row.key.strip_prefix("dead_volume_") == Some(end));
    own.and_then(|(_, number)| *number).expect("a number that was checked")
}

/// Heat-transfer coefficient of chambers whose balance is that of the source paper, W/(m2 K) (assumed).
const AS_PRINTED_HEAT: f64 = 30.0;

/// Returns a volume of a cylinder with this dead volume, m3, and diameter, m. The law of heat transfer gives the dead
/// volume the wall of more barrel.
pub(super) fn vessel<P: Lane>(
    own: &Instance<P>,
    [dead_volume, bore]: [P; 2],
    ambient_temperature: P,
) -> Vessel<P> {
    let is_printed = chamber_law(own) == ChamberLaw::AsPrinted;
    let stated = own.given("heat_transfer").or_else(|| is_printed.then(|| P::c(AS_PRINTED_HEAT)));
    let (wall, heat) = match stated {
        // A wall that stores heat gives the heat itself.
        Some(_) if own.given("wall_capacity").is_some() => (P::zero(), WallHeat::Constant(P::zero())),
        Some(coefficient) => (P::zero(), WallHeat::Constant(coefficient)),
        None => {
            let (scale, port) = (own.number("heat_transfer_scale"), own.given("port_diameter"));
            let area = Some(P::c(0.25 * PI) * bore * bore);
            (P::c(4.0) * dead_volume / bore, WallHeat::Vessel { scale, bore, area, port })
        }
    };
    Vessel {
        law: chamber_law(own),
        dead_volume,
        wall,
        heat,
        wall_temperature: own.given("wall_temperature").unwrap_or(ambient_temperature),
    }
}
