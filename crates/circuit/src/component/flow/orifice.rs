use crate::component::prelude::*;
use physics::IdealGas;
use physics::constants::{RHO_0, T_0};
use physics::flow::{NOZZLE_RATIO, choked_factor};
use std::f64::consts::PI;

/// A hole of known diameter.
pub struct Orifice;

impl Component for Orifice {
    const KIND: Kind = Kind {
        key: "orifice",
        title: "Orifice, nozzle",
        text: "A hole of diameter d and discharge coefficient C_d as a flow path by ISO 6358, in both directions: \
               C = C_d (pi d^2/4) psi/(rho0 sqrt(R T0)) with psi = sqrt(k) (2/(k + 1))^((k + 1)/(2 (k - 1))) of choked air, \
               0.199 dm3/(s bar) per mm2 of C_d pi d^2/4.",
        parameters: table! {
            diameter: "m", physics::above(0.0), "Diameter d";
            discharge_coefficient: "1", physics::Bounds { open: true, ..physics::within(0.0, 1.0) }, default 0.8,
                assumed "usual for a short hole with sharp edges", "Discharge coefficient C_d in choked flow";
            critical_pressure_ratio: "1", physics::between(0.0, 1.0), default NOZZLE_RATIO, assumed "usual for an ideal nozzle",
                "Critical pressure ratio b";
            SUBSONIC_INDEX;
            LINEAR_ABOVE;
        },
        open: true,
        ..Kind::PATH
    };

    fn series<P: Lane>(own: &Instance<P>) -> Option<[P; 2]> {
        own.in_series(conductance(own))
    }

    fn compose<P: Lane>(own: &Instance<P>, at: &Terminals, build: &mut Build<P>) {
        let (Some(from), Some(to)) = (at.gas(0), at.gas(1)) else { return };
        let law = own.path_of(conductance(own), build);
        let edge = build.passage(law, from, to);
        build.column(own, 0, Quantity::along(Path::of(edge)));
    }
}

fn conductance<P: Lane>(own: &Instance<P>) -> P {
    let (air, diameter) = (IdealGas::air(), own.number("diameter"));
    let area = P::c(0.25 * PI) * diameter * diameter * own.number("discharge_coefficient");
    let choked = choked_factor(air.heat_capacity_ratio) / (RHO_0 * (air.gas_constant * T_0).sqrt());
    area * P::c(choked)
}
