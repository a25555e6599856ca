"""Description of a rig in the core's form: plain data in SI."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.constants import LEAK_CRITICAL_RATIO
from pneudrive.errors import SimulationError
from pneudrive.simulation.bench_circuit import AMBIENT, Dragged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.rig.description import RigDescription, RigMounting

    Array = NDArray[np.float64]


def core_friction(d: RigDescription, mounting: RigMounting | None = None) -> dict[str, Any]:
    """Return the friction of the piston, including that of the guide under a side load of the mounting."""
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
    """Return the friction of steady sliding, N, with the sign of the velocity.

    Parameters
    ----------
    friction : dict
        Result of `core_friction`.
    velocity_m_s : float or ndarray
    gauges_pa : (float, float)
        Gauge pressures in the chambers.
    position_m : float
        Position, m, for friction that depends on it.

    Returns
    -------
    ndarray
        Friction, N, one-dimensional.
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
) -> Dragged:
    """Return the rig with its chambers or regulators at these absolute pressures, Pa.

    Parameters
    ----------
    d : RigDescription
    pressures_pa : (float, float)
    friction : dict, optional
        Result of `core_friction`; the default is the rig's friction.
    temperature_k : float, optional
        Temperature of the room, K; the default is that of the rig file.
    """
    (area_a, area_b), servo = d.areas_m2, d.servo
    rods = {"rodless": (0, 0), "single-rod": (0, 1), "through-rod": (1, 1)}[d.cylinder]
    perimeter_a, perimeter_b = (math.pi * (d.bore_m + rod * d.rod_diameter_m) for rod in rods)
    carriage = {"release_time": servo["release_time"]}
    if servo["bandwidth"] is not None:
        carriage |= {"servo_bandwidth": servo["bandwidth"], "servo_damping_ratio": servo["damping_ratio"]}
    if servo["ripple"] > 0.0:
        carriage |= {"ripple_velocity": servo["ripple"], "ripple_pitch": servo["pitch"]}
    rig = Dragged(
        friction or core_friction(d),
        {
            "area_a": area_a,
            "area_b": area_b,
            "perimeter_a": perimeter_a,
            "perimeter_b": perimeter_b,
            "stroke": d.stroke_m,
            "moving_mass": d.moving_mass_kg,
            "incline": d.incline_rad,
        },
        {"stiffness": d.stiffness_n_m, "damping": d.damping_n_s_m},
        carriage,
        d.ambient_pressure_pa,
        temperature_k or d.ambient_temperature_k,
    )
    if d.chambers["kind"] == "held":
        for name, pressure in zip("ab", pressures_pa, strict=True):
            rig.hold(name, pressure)
    else:
        _supply(rig, d, pressures_pa)
    return rig


def _supply(rig: Dragged, d: RigDescription, pressures_pa: tuple[float, float]) -> None:
    """Add the air supply of the chambers: ports to the room, or regulators with shut-off, a volume and lines."""
    c = d.chambers
    kind, ratio, heat = c["kind"], c["critical_pressure_ratio"], c["heat_transfer"]
    if kind == "common" and pressures_pa[0] != pressures_pa[1]:
        raise SimulationError(
            f"one regulator cannot set both {pressures_pa[0]:g} Pa and {pressures_pa[1]:g} Pa",
            rule="chambers on a common manifold have the same pressure",
        )

    def regulator(volume: str, pressure: float) -> None:
        source = f"source_{volume}"
        rig.hold(source, pressure)
        # A hose of this volume and diameter has 4 V/d of wall.
        wall = 4.0 * c["manifold_volume"] / c["hose_diameter"]
        rig.volume(volume, pressure, volume=c["manifold_volume"], wall_area=wall, heat_transfer=heat)
        rig.path(f"regulator_{volume}", c["regulator_conductance"], ratio, (source, volume))
        rig.shutters.append(f"regulator_{volume}")

    for side, pressure in zip("ab", pressures_pa, strict=True):
        rest = d.ambient_pressure_pa if kind == "open" else pressure
        rig.volume(side, rest, volume=c["dead_volume"], heat_transfer=heat)
    if kind == "common":
        regulator("manifold", pressures_pa[0])
    for side, pressure in zip("ab", pressures_pa, strict=True):
        source = {"open": AMBIENT, "common": "manifold", "separate": f"hose_{side}"}[kind]
        rig.sources[side] = source
        if kind == "separate":
            regulator(source, pressure)
        rig.path(f"line_{side}", c["line_conductance"], ratio, (source, side))
        if kind == "open":
            rig.shutters.append(f"line_{side}")
    leaks = {("a", "b"): c["piston_leakage"], ("a", AMBIENT): c["leakage"], ("b", AMBIENT): c["leakage"]}
    for ends, conductance in leaks.items():
        if conductance > 0.0:
            rig.path("leak_" + "_".join(ends), conductance, LEAK_CRITICAL_RATIO, ends)
