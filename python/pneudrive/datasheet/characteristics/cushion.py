"""Capacity of a cushion: end speed and peak pressure over mass and speed, and over the opening of its needle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.datasheet.characteristic import Axis, ResultValue, characteristic, number
from pneudrive.datasheet.characteristics.frequency import moving_gas
from pneudrive.datasheet.characteristics.motion import simulate_plant
from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pneudrive.datasheet.characteristic import Found
    from pneudrive.datasheet.plant import HeldDrive

END_SPEED, PRESSURE_SHARE = 0.1, 2.0  # m/s; times the supply (assumed limits)
BEFORE_M = 1e-3  # ahead of the cushion
SPEEDS, MASSES = (0.2, 0.5, 1.0, 1.5, 2.0, 3.0), (0.5, 1.0, 2.0, 4.0)
NEEDLES = tuple(float(share) for share in np.geomspace(0.1, 10.0, 13))  # times the described opening
LASTING_S, RATE_HZ = 1.0, 5e3


@characteristic(
    "cushion",
    algorithm="one simulated stroke into the cushion for each point",
    x="speed",
    y="end_speed",
    slow=True,
    held=False,
)
def _cushion(
    plant: HeldDrive, end_speed: float = END_SPEED, pressure: float | None = None, speed: float = 1.0
) -> Found:
    """Capacity of the cushion.

    Speed at the end and peak pressure of a piston that enters its cushion with a speed, over mass, speed, and the
    opening of the needle. The command is full, and the pressures are those of slow steady motion.

    Settings
    --------
    end_speed
        largest admissible, m/s (assumed)
    pressure
        largest admissible pressure, Pa; default: twice the supply (assumed)
    speed
        at which the needle is varied, m/s
    """
    table = plant.circuit.components[plant.piston].plain()
    side = next((side for side in "ba" if f"cushion_{side}_length" in table), "")
    if not side:
        raise CommandError(f"{plant.piston} has no cushion", remedy='Add cushion_b = { length = "17 mm", ... }.')
    most = PRESSURE_SHARE * plant.supply_pa if pressure is None else pressure
    masses, speeds = [share * plant.mass for share in MASSES], list(SPEEDS)
    grid = np.array([[_end(_with(plant, mass=mass), side, v) for v in speeds] for mass in masses])
    needles = np.array([_end(_with(plant, needle=(side, share)), side, speed) for share in NEEDLES])
    best = int(np.argmin(needles[:, 0]))
    axes = {
        "mass": Axis(masses, "kg", "moving mass"),
        "speed": Axis(speeds, "m/s", "speed at the beginning of the cushion"),
        "needle": Axis(list(NEEDLES), "1", "opening of the needle, relative to its description"),
    }
    over = ("mass", "speed")
    allowed = (grid[:, :, 0] <= end_speed) & (grid[:, :, 1] <= most)
    limits = f"1 if the end speed is at most {end_speed:g} m/s and the pressure at most {1e-5 * most:g} bar (assumed)"
    ends = f"speed at the end of chamber {side}; 0 if it stops before"
    one = f"end speed from {speed:g} m/s with the described mass"
    return axes, {
        "end_speed": ResultValue(over, grid[:, :, 0], "m/s", ends),
        "peak_pressure": ResultValue(over, grid[:, :, 1], "Pa", "largest absolute pressure in the cushion"),
        "admissible": ResultValue(over, allowed, "1", limits),
        "end_speed_by_needle": ResultValue(("needle",), needles[:, 0], "m/s", one),
        "best_needle": number(NEEDLES[best], "1", "opening with the lowest peak pressure"),
    }


def _with(plant: HeldDrive, mass: float | None = None, needle: tuple[str, float] | None = None) -> HeldDrive:
    """Return the drive with another moving mass, or another opening of the needle."""
    tables = plant.circuit.to_dict()
    own = dict(plant.circuit.components[plant.piston].plain())
    if mass is not None:
        own["moving_mass"] = f"{mass!r} kg"
    if needle is not None:
        key = f"cushion_{needle[0]}_needle_conductance"
        si = getattr(plant.circuit.components[plant.piston], f"{key}_m3_s_pa")
        own[key] = f"{needle[1] * si!r} m3/(s Pa)"
    tables["components"][plant.piston] = own
    return plant.varied(tables)


def _end(plant: HeldDrive, side: str, speed: float) -> tuple[float, float]:
    """Return end speed and peak pressure of a piston that enters a cushion with a speed."""
    toward = 1.0 if side == "b" else -1.0
    length = float(getattr(plant.circuit.components[plant.piston], f"cushion_{side}_length_m"))
    x = plant.stroke_m - length - BEFORE_M if side == "b" else length + BEFORE_M
    a, b = plant.pressures(moving_gas(plant.static, 0.5 * plant.stroke_m))
    a, b = (a, b) if side == "b" else (b, a)
    own = plant.piston
    start = {f"{own}.position": f"{x!r} m", f"{own}.velocity": f"{toward * speed!r} m/s"}
    start |= {f"{own}.a": f"{a!r} Pa abs", f"{own}.b": f"{b!r} Pa abs"}
    plant = plant.with_held_valves  # the valve has opened long before
    run = simulate_plant(plant, plant.plans([(0.0, toward)]), LASTING_S, RATE_HZ, initial=start)
    hit = next((one for one in run.attrs["impacts"] if one["end"] == side), None)
    peak = float(run[f"{own}.{side}.pressure"].max())
    return (hit["speed_m_s"] if hit is not None else 0.0), peak if math.isfinite(peak) else math.nan
