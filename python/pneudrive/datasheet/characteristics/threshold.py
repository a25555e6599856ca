"""Least supply pressure that moves the piston, and breakaway."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.datasheet.characteristic import DIRECTIONS, ResultValue, characteristic
from pneudrive.datasheet.plant import LEAST_VELOCITY, RTOL
from pneudrive.errors import CommandError, SimulationError
from pneudrive.numbers import plain

if TYPE_CHECKING:
    from pneudrive.datasheet.characteristic import Found
    from pneudrive.datasheet.plant import HeldDrive

# The pressure rises so slowly that bristles neither oscillate nor slide: in 10 s they deflect 1.1 % below breakaway, in
# 100 s 0.2 %.
RISING_S, RISES = 600.0, 1200
CLOSE = 2e-5  # of the interval between ambient and supply: where bisection ends
LASTING_S, LOOKS = 660.0, 60  # a piston that is not there then does not move; looks in between
DONE = 0.99  # of the stroke
STARTED = 0.01


def _reaches(plant: HeldDrive, pressure: float, direction: float, share: float) -> bool:
    """Return whether a slowly rising pressure moves the piston over a fraction of the stroke from rest."""
    start = 0.0 if direction > 0.0 else plant.stroke_m
    gas = np.tile(plant.ambient, (len(plant.nodes), 1))
    session = plant.session(0.0, start, 0.0, gas, rtol=RTOL)
    plant.set(session, direction)
    rise = np.linspace(plant.ambient[0], pressure, RISES + 1)
    session.schedule(plant.supply, list(zip(RISING_S * np.arange(RISES + 1) / RISES, rise.tolist(), strict=True)))
    for k in range(1, LOOKS + 1):
        session.advance(LASTING_S * k / LOOKS)
        if abs(session.read(f"{plant.piston}.position_m") - start) >= share * plant.stroke_m:
            return True
    return False


def least_pressure(plant: HeldDrive, direction: float, share: float = DONE) -> float:
    """Return the least absolute supply pressure at which the piston moves, Pa, by bisection on runs.

    Raises
    ------
    SimulationError
        Even the supply of the drive does not move it.
    """
    low, high = plant.ambient[0], plant.supply_pa
    if not _reaches(plant, high, direction, share):
        raise SimulationError(f"the supply of {plain(1e-5 * high)} bar abs does not move the piston over its stroke")
    width = CLOSE * (high - low)
    while high - low > width:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _reaches(plant, middle, direction, share) else (middle, high)
    return high


@characteristic(
    "minimum-pressure",
    algorithm="bisection on simulated runs to 0.002 % of the span from ambient to supply",
    standard="form of ISO 10099",
    slow=True,
    held=False,
)
def _minimum(plant: HeldDrive) -> Found:
    """Minimum pressure and breakaway.

    Least supply pressure, above ambient, at which the piston, with its load, covers 99 % of its stroke within 660
    s from rest at full command. The pressure rises from ambient over 600 s and is then held.
    """
    if plant.supply_pa <= plant.ambient[0]:
        raise CommandError(f"{plant.name}: the supply is not above ambient pressure")
    rows = []
    for direction in (1.0, -1.0):
        x = 0.0 if direction > 0.0 else plant.stroke_m
        breakaway = abs(plant.sliding(direction * LEAST_VELOCITY, (plant.ambient[0], plant.ambient[0]), x))
        rows.append((least_pressure(plant, direction) - plant.ambient[0], breakaway))
    values = np.array(rows)
    return {"direction": DIRECTIONS}, {
        "minimum_pressure": ResultValue(
            ("direction",),
            values[:, 0],
            "Pa",
            "least supply pressure above ambient that moves the piston, with its load, over its stroke",
        ),
        "breakaway_force": ResultValue(
            ("direction",),
            values[:, 1],
            "N",
            "steady friction at the onset of sliding, both chambers at ambient pressure",
        ),
    }
