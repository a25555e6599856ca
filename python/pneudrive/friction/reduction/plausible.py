"""Unusual values: doubts, which are flags of the friction map and sentences of the notes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.sentences import sentence
from pneudrive.signals.impossible import PRESSURES_PA, SPEEDS_M_S

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.signals.recording import Recording

BELOW_AMBIENT = 0.1  # of ambient pressure: lower ones are a vacuum, or gauge pressures written as absolute
UNFOLLOWED = 0.25  # of pressure times area: least unexplained part of the force
SMALLEST_N = 1e-3  # friction below the resolution of force sensors of piston drives
FULL_PRESSURE_PA = 10e5  # friction above the force of this pressure on the piston would stop any drive


def doubts_of(
    recording: Recording,
    gauge_pa: dict[str, float],
    speed_m_s: float,
    friction_n: float,
    offset_n: float,
    u_offset_n: float,
) -> dict[str, str]:
    """Return the doubts on a speed class: flag -> sentence with a check.

    A recording with zero areas has no pressure force: its force is the friction itself.
    """
    ambient, areas = recording.ambient_pressure_pa, (recording.area_a_m2, recording.area_b_m2)
    lowest, highest = min(gauge_pa.values()) + ambient, max(gauge_pa.values()) + ambient
    pushed = gauge_pa["b"] * areas[1] - gauge_pa["a"] * areas[0] + recording.weight_n
    friction, missed = abs(friction_n), abs(offset_n)  # the offset is NaN if one direction is missing
    unfollowed = missed > max(UNFOLLOWED * abs(pushed), friction, 3.0 * u_offset_n) and abs(pushed) > friction
    full = FULL_PRESSURE_PA * max(areas)
    seen = {
        "below_ambient": lowest < (1.0 - BELOW_AMBIENT) * ambient,
        "beyond_usual": highest > PRESSURES_PA[1] or speed_m_s > SPEEDS_M_S[1],
        "force_not_pressure": any(areas) and unfollowed,
        "friction_beyond_piston": any(areas) and friction > full,
        "no_friction": any(areas) and friction < SMALLEST_N,
    }
    values = {
        "lowest": lowest / 1e5,
        "highest": highest / 1e5,
        "speed_m_s": speed_m_s,
        "force_n": pushed + offset_n,
        "pushed_n": pushed,
        "friction_n": friction,
        "full_n": full,
    }
    return {flag: sentence(f"doubt.{flag}", **values) for flag, is_so in seen.items() if is_so}


NEGATIVE = "negative friction"
OUTLIER = "outlier"
SURE = 3.0  # standard errors below zero: negative beyond noise
NEIGHBOURS = 6  # nearest cycles in speed for the comparison of a cycle's friction
ENOUGH = 4
FAR = 10.0  # factor of friction to neighbouring speeds: an error of sensor, unit or range, not a seal


def implausible_friction(
    condition: NDArray[np.int64],
    speed_m_s: NDArray[np.float64],
    friction_n: NDArray[np.float64],
    stderr_n: NDArray[np.float64],
) -> tuple[str, ...]:
    """Return for each cycle of a campaign, shape (n,), why its friction is impossible; "" if possible."""
    pace = np.log(np.maximum(speed_m_s, 1e-12))
    found: list[str] = [""] * friction_n.size
    for here in (np.flatnonzero(condition == k) for k in np.unique(condition)):
        order = here[np.argsort(pace[here], kind="stable")]
        for at, i in enumerate(order.tolist()):
            near = order[max(at - NEIGHBOURS, 0) : at + NEIGHBOURS + 1]
            near = near[near != i]
            near = near[np.argsort(np.abs(pace[near] - pace[i]), kind="stable")][:NEIGHBOURS]
            usual = float(np.median(np.abs(friction_n[near]))) if near.size >= ENOUGH else 0.0
            if friction_n[i] < -SURE * stderr_n[i]:
                found[i] = NEGATIVE
            elif usual > 0 and not usual / FAR <= abs(friction_n[i]) <= usual * FAR:
                found[i] = OUTLIER
    return tuple(found)
