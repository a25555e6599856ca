"""Excluded points: the piston did not slide steadily behind the rig's spring.

Seen in three ways: the axis itself runs unevenly; the piston's position, which is the axis' less the deflection of the
force sensor, does; or, where samples are too far apart to show either, the force swings by far more than the sensor's
noise, and so much that at the rig's natural frequency the piston's speed would swing by 40 %.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.campaign.cycles.cycle import CycleData
    from pneudrive.rig.interface import Identity

    Array = NDArray[np.float64]

RIPPLE_LIMIT = 0.2  # of the mean speed: above it the mean friction is not a point of F(v)
SWING_SHARE = 0.05  # of the friction: smaller swings are roughness or noise
SWING_FLOOR = 3.0  # times the noise while standing
UNRESOLVED = 0.4  # worst-case ripple of the piston's speed for a swing at the natural frequency
UNNAMED = "speed ripple"
STICK_SLIP = ("stick-slip", "force swing")
NAMES = (*STICK_SLIP, UNNAMED)


def reasons(data: Sequence[CycleData], tares: Sequence[CycleData], identity: Identity) -> tuple[str, ...]:
    """Return for each cycle why its sliding was not steady; "" if it was steady."""
    floor = _noise(data, tares)
    return tuple(_reason(d, floor, identity) for d in data)


def _reason(d: CycleData, floor: float, identity: Identity) -> str:
    sides = list(d.sides.values())
    if any(s.ripple > RIPPLE_LIMIT for s in sides):
        return "stick-slip" if any(s.stick_slip for s in sides) else UNNAMED
    scatter = max(0.0 if np.isnan(s.scatter_n) else s.scatter_n for s in sides)
    if scatter < SWING_FLOOR * floor:
        return ""
    level = float(np.nanmean([abs(np.nanmean(s.balance_n)) for s in sides]))
    if scatter < SWING_SHARE * level:
        return ""
    if any(s.piston_ripple > RIPPLE_LIMIT for s in sides):
        return "stick-slip" if any(s.stick_slip for s in sides) else UNNAMED
    if identity.stiffness_n_m and identity.mass_beyond_sensor_kg:
        swing = scatter / np.sqrt(identity.stiffness_n_m * identity.mass_beyond_sensor_kg)
        if swing > UNRESOLVED * np.mean([abs(s.velocity_m_s) for s in sides]):
            return "force swing"
    return ""


def _noise(data: Sequence[CycleData], tares: Sequence[CycleData]) -> float:
    """Return the noise of the force at rest; without tares, the lower quartile of the slower half of the cycles.

    Slow noise is visible within a bin of a slow cycle, but not of a fast one.
    """
    if tares:
        return float(np.median([t.standing_sd_n for t in tares]))
    speeds = np.array([np.mean([abs(s.velocity_m_s) for s in d.sides.values()]) for d in data])
    scatters = np.array([max(float(np.nan_to_num(s.scatter_n)) for s in d.sides.values()) for d in data])
    slow = speeds <= np.median(speeds)
    return float(np.quantile(scatters[slow], 0.25))
