//! Cushions at the ends of a cylinder.

use super::chamber::{chamber_law, dead_volume, vessel};
use crate::component::prelude::*;
use crate::ground::{AxisId, GasId};
use crate::part::{ChamberLaw, Cushion};
use physics::flow::{BORE_CONDUCTANCE, LINEAR_ABOVE};
use std::f64::consts::PI;

/// Parameters of the cushion at an end.
macro_rules! cushion_rows {
    ($end:literal) => {
        table! {
            length[concat!("cushion_", $end, "_length")]: "m", physics::above(0.0), within concat!("cushion_", $end),
                "Distance from the end at which the plunger enters its bore";
            plunger_diameter[concat!("cushion_", $end, "_plunger_diameter")]: "m", physics::above(0.0), within concat!("cushion_", $end),
                "Diameter of the plunger";
            needle_conductance[concat!("cushion_", $end, "_needle_conductance")]: "m3/(s Pa)", physics::at_least(0.0), within concat!("cushion_", $end),
                "Sonic conductance of the needle at its setting, for air";
            port_volume[concat!("cushion_", $end, "_port_volume")]: "m3", physics::above(0.0), within concat!("cushion_", $end),
                "Volume of port and line behind the bore with the plunger fully inserted; dead_volume is then the volume of the chamber alone";
            check_conductance[concat!("cushion_", $end, "_check_conductance")]: "m3/(s Pa)", physics::at_least(0.0), default 1e-8, assumed "usual for a lip seal of this size", within concat!("cushion_", $end),
                "Sonic conductance of the check valve that lets gas from the port into the chamber";
            cracking_pressure[concat!("cushion_", $end, "_cracking_pressure")]: "Pa", physics::at_least(0.0), default 1e4, assumed "usual for a lip seal", within concat!("cushion_", $end),
                "Cracking pressure of the check valve, a difference";
            bore_conductance[concat!("cushion_", $end, "_bore_conductance")]: "m3/(s Pa)", physics::above(0.0), follows "the area of the plunger, 0.2 dm3/(s bar) for each mm2", within concat!("cushion_", $end),
                "Sonic conductance of the bore without the plunger";
            critical_pressure_ratio[concat!("cushion_", $end, "_critical_pressure_ratio")]: "1", physics::between(0.0, 1.0), default 0.3, assumed "usual for a needle", within concat!("cushion_", $end),
                "Critical pressure ratio of needle, check valve and bore";
            transition[concat!("cushion_", $end, "_transition")]: "m", physics::above(0.0), default 2e-4, assumed "a modelling parameter", within concat!("cushion_", $end),
                "Distance over which the bore shuts";
        }
    };
}

pub(super) const CUSHION_A: &[Row] = cushion_rows!("a");
pub(super) const CUSHION_B: &[Row] = cushion_rows!("b");

/// Returns whether an end has a cushion.
pub(super) fn cushioned<P: Lane>(own: &Instance<P>, end: &str) -> bool {
    let is_length = |key: &str| {
        key.strip_prefix("cushion_").and_then(|key| key.strip_suffix("_length")).is_some_and(|of| of == end)
    };
    let rows = own.table.parameters.iter().zip(&own.numbers);
    rows.into_iter().any(|(row, number)| number.is_some() && is_length(row.key))
}

/// Returns the area of the plunger at an end, m2.
pub(super) fn plunger<P: Lane>(own: &Instance<P>, end: &str) -> P {
    let diameter = own.number(&format!("cushion_{end}_plunger_diameter"));
    P::c(0.25 * PI) * diameter * diameter
}

pub(super) fn check_cushions(own: &Instance<f64>) -> Result<(), Error> {
    check_cushion(own, "a")?;
    check_cushion(own, "b")?;
    if !(cushioned(own, "a") && cushioned(own, "b")) {
        return Ok(());
    }
    let [a, b, stroke] = ["cushion_a_length", "cushion_b_length", "stroke"].map(|key| own.number(key));
    if a + b > stroke {
        let [a, b, stroke] = [a, b, stroke].map(|length| in_usual_unit(length, "m"));
        return refuse!(
            "{}.cushion_b_length = {b} overlaps {}.cushion_a_length = {a}: together they must not be longer than the \
             stroke, {stroke}",
            own.name,
            own.name
        );
    }
    Ok(())
}

pub(super) fn check_cushion(own: &Instance<f64>, end: &str) -> Result<(), Error> {
    if !cushioned(own, end) {
        return Ok(());
    }
    let number = |key: &str| own.number(&format!("cushion_{end}_{key}"));
    let (diameter, bore) = (number("plunger_diameter"), own.number("bore"));
    let (length, stroke) = (number("length"), own.number("stroke"));
    if diameter >= bore {
        let [diameter, bore] = [diameter, bore].map(|size| in_usual_unit(size, "m"));
        return refuse!(
            "{}.cushion_{end}_plunger_diameter = {diameter} must be less than the bore, {bore}",
            own.name
        );
    }
    if length >= stroke {
        let [length, stroke] = [length, stroke].map(|size| in_usual_unit(size, "m"));
        return refuse!(
            "{}.cushion_{end}_length = {length} must be less than the stroke, {stroke}",
            own.name
        );
    }
    if chamber_law(own) == ChamberLaw::AsPrinted {
        return refuse!("{}: chamber law \"as-printed\" does not support a cushion", own.name);
    }
    Ok(())
}

/// Returns the chamber at an end with this port. With a cushion, it is a separate volume with paths to the port.
pub(super) fn cushion<P: Lane>(
    own: &Instance<P>,
    end: &str,
    (port, axis): (GasId, AxisId),
    build: &mut Build<P>,
) -> GasId {
    if !cushioned(own, end) {
        return port;
    }
    let size = [dead_volume(own, end), own.number("bore")];
    let chamber = build.volume(vessel(own, size, build.ambient[1]));
    build.circuit.starts_as(chamber, port);
    build.circuit.call_gas(chamber, format!("{}.{end}.", own.name));
    build.circuit.call_gas(port, format!("{}.{end}.port_", own.name));
    let key = |key: &str| format!("cushion_{end}_{key}");
    let number = |name: &str| own.number(&key(name));
    let area = plunger(own, end);
    let law = |conductance: P, build: &Build<P>| {
        build.usual_path([conductance, number("critical_pressure_ratio")], P::c(LINEAR_ABOVE))
    };
    for way in ["needle_conductance", "check_conductance"] {
        let conductance = number(way);
        if conductance.get(0) == 0.0 && !own.is_free(&key(way)) {
            continue;
        }
        let law = law(conductance, build);
        if way == "needle_conductance" {
            build.passage(law, chamber, port);
        } else {
            build.check_valve(law, number("cracking_pressure"), port, chamber);
        }
    }
    let conductance = own.given(&key("bore_conductance")).unwrap_or(P::c(BORE_CONDUCTANCE) * area);
    let grows = end == "a";
    let part = Cushion {
        area,
        length: number("length"),
        transition: number("transition"),
        offset: if grows { P::zero() } else { own.number("stroke") },
        bore: law(conductance, build),
        axis: axis.0,
        grows,
        path: build.circuit.between(chamber, port),
    };
    build.path_part(part, conductance);
    let columns =
        [("port_pressure_pa", Quantity::Pressure(port)), ("port_mass_flow_kg_s", Quantity::MassFlow(port))];
    for (name, quantity) in columns {
        build.columns.push((format!("{}.{end}.{name}", own.name), quantity));
    }
    chamber
}

/// Returns the volume that an end stop may use, m3. This is the dead volume, or a smaller volume that keeps the plunger
/// inside its cushion.
pub(super) fn room<P: Lane>(own: &Instance<P>, end: &str, area: P) -> P {
    let chamber = dead_volume(own, end);
    if !cushioned(own, end) {
        return chamber;
    }
    let behind = own.number(&format!("cushion_{end}_port_volume"));
    chamber.min(behind / plunger(own, end) * area)
}
