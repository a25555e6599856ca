//! The chambers of a cylinder.

use crate::component::{Instance, Vessel};
use crate::part::ChamberLaw;
use math::Lane;

pub(super) fn chamber_law<P: Lane>(own: &Instance<P>) -> ChamberLaw {
    if own.choices[0] == 0 { ChamberLaw::EnergyBalance } else { ChamberLaw::AsPrinted }
}

/// Returns the dead volume of the chamber at an end, m3.
pub(super) fn dead_volume<P: Lane>(own: &Instance<P>, end: &str) -> P {
    let mut each = own.kind().parameters.iter().zip(&own.numbers);
    let own = each.find(|(row, _)| row.key.strip_prefix("dead_volume_") == Some(end));
    own.and_then(|(_, number)| *number).expect("a number that was checked")
}

/// Adds a chamber with this dead volume, m3.
pub(super) fn vessel<P: Lane>(own: &Instance<P>, dead_volume: P, ambient_temperature: P) -> Vessel<P> {
    // A wall that stores heat gives the heat itself.
    let by_wall = own.given("wall_capacity").is_some();
    Vessel {
        law: chamber_law(own),
        dead_volume,
        wall: P::zero(),
        heat_transfer: if by_wall { P::zero() } else { own.number("heat_transfer") },
        wall_temperature: own.given("wall_temperature").unwrap_or(ambient_temperature),
    }
}
