"""Coordinates for the estimation of free values of a drive and its sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.transforms import Transforms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.describe.drive import Drive
    from pneudrive.free.parameters import Parameter
    from pneudrive.identify.dynamic.sensors import SensorParameter

#: Start value of the excess Fs - Fc for a drive without excess, as a share of Fc.
_LEAST_EXCESS = 0.02


def transforms_of(parameters: Sequence[Parameter], sensors: Sequence[SensorParameter], drive: Drive) -> Transforms:
    """Return the coordinates of free values of a drive and its sensors.

    The breakaway force is the Coulomb force plus an excess, so it is never lower. If one of these forces is held, it
    limits the other.
    """
    names, held = [p.name for p in parameters], drive.friction.parameters
    every = [*parameters, *sensors]
    upper = np.array([p.upper for p in every])
    place = {name: names.index(f"friction.{name}") for name in ("coulomb", "breakaway") if f"friction.{name}" in names}
    if "coulomb" in place and "breakaway" not in place and "breakaway" in held:
        upper[place["coulomb"]] = held["breakaway"]
    if "valve.critical_pressure_ratio" in names:
        upper[names.index("valve.critical_pressure_ratio")] = drive.valve.linear_above
    return Transforms(
        [p.lower for p in every],
        upper,
        [p.size if np.isinf(p.lower) else 1.0 for p in every],
        excess=place.get("breakaway") if "coulomb" in held else None,
        over=place.get("coulomb", held.get("coulomb", 0.0)),
        least_excess=_LEAST_EXCESS,
    )
