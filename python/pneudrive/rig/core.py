"""What the core takes: a rig's description as plain data in SI."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.rig.description import Mounting, RigDescription

    Array = NDArray[np.float64]


def core_friction(d: RigDescription, mounting: Mounting | None = None) -> dict[str, Any]:
    """Return the friction of the piston; a side load of the mounting adds that of the guide."""
    table = {"law": d.law, "parameters": d.parameters, "pressure": d.pressure, **d.dependences}
    if mounting is not None and mounting.side_load_n > 0.0:
        table["side_load"] = {"force_n": mounting.side_load_n, "coefficient": mounting.coefficient}
    return table


def steady_friction_n(
    friction: dict[str, Any],
    velocity_m_s: float | Array,
    gauges_pa: tuple[float, float] = (0.0, 0.0),
    position_m: float = 0.0,
) -> Array:
    """Return the friction of steady sliding, N, of the sign of the velocity.

    Parameters
    ----------
    friction : dict
        As `core_friction` gives it.
    velocity_m_s : float or ndarray
    gauges_pa : (float, float)
        Gauge pressures in the chambers.
    position_m : float
        Where, for friction that depends on it.

    Returns
    -------
    ndarray
        One-dimensional.
    """
    from pneudrive import _core

    velocity = np.atleast_1d(np.asarray(velocity_m_s, dtype=np.float64))
    others = {name: table for name, table in friction.items() if name not in ("law", "parameters", "pressure")}
    law, parameters, pressure = friction["law"], friction["parameters"], friction.get("pressure")
    steady = _core.steady_friction(law, parameters, velocity, *gauges_pa, pressure, others, position_m)
    return np.asarray(steady)


def core_rig(
    d: RigDescription,
    pressures_pa: tuple[float, float],
    friction: dict[str, Any] | None = None,
    temperature_k: float | None = None,
) -> dict[str, Any]:
    """Return the rig with its chambers held at, or its regulators set to, these absolute pressures.

    Parameters
    ----------
    d : RigDescription
    pressures_pa : (float, float)
    friction : dict, optional
        As `core_friction` gives it; the rig's own where nothing is said.
    temperature_k : float, optional
        Of the room; that of the file where nothing is said.
    """
    area_a, area_b = d.areas_m2
    servo = d.servo
    out = {
        "friction": friction or core_friction(d),
        "area_a_m2": area_a,
        "area_b_m2": area_b,
        "moving_mass_kg": d.moving_mass_kg,
        "ambient_pressure_pa": d.ambient_pressure_pa,
        "pressure_a_pa": pressures_pa[0],
        "pressure_b_pa": pressures_pa[1],
        "stroke_m": d.stroke_m,
        "incline_rad": d.incline_rad,
        "sensor_stiffness_n_m": d.stiffness_n_m,
        "sensor_damping_n_s_m": d.damping_n_s_m,
        "temperature_k": temperature_k or d.ambient_temperature_k,
        "release_time_s": servo["release_time"],
        "chambers": _chambers(d),
    }
    if servo["bandwidth"] is not None:
        out["servo"] = {"bandwidth_hz": servo["bandwidth"], "damping_ratio": servo["damping_ratio"]}
    if servo["ripple"] > 0.0:
        out["ripple"] = {"velocity": servo["ripple"], "pitch_m": servo["pitch"]}
    return out


def _chambers(d: RigDescription) -> dict[str, Any] | None:
    c = d.chambers
    if c["kind"] == "held":
        return None
    rods = {"rodless": (0, 0), "single-rod": (0, 1), "through-rod": (1, 1)}[d.cylinder]
    perimeters = [math.pi * (d.bore_m + rod * d.rod_diameter_m) for rod in rods]

    def orifice(conductance: float) -> dict[str, float]:
        return {"conductance_m3_s_pa": conductance, "critical_pressure_ratio": c["critical_pressure_ratio"]}

    lines = [orifice(c["line_conductance"])] * 2
    supply: dict[str, Any] = {"kind": c["kind"]}
    if c["kind"] == "open":
        supply["ports"] = lines
    else:
        # A hose of this volume and diameter has 4 V/d of wall.
        wall = 4.0 * c["manifold_volume"] / c["hose_diameter"]
        supply["manifold"] = {"volume_m3": c["manifold_volume"], "wall_m2": wall}
        supply |= {"regulator": orifice(c["regulator_conductance"]), "lines": lines}
    a, b = (
        {"dead_volume_m3": c["dead_volume"], "perimeter_m": perimeter, "leakage_m3_s_pa": c["leakage"]}
        for perimeter in perimeters
    )
    return {
        "supply": supply,
        "a": a,
        "b": b,
        "heat_transfer_w_m2_k": c["heat_transfer"],
        "piston_leakage_m3_s_pa": c["piston_leakage"],
    }
