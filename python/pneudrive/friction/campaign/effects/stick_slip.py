"""Stick-slip in a campaign: place, size, and the speed below which it starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.friction.campaign.effects.effect import StickSlipPoint, StickSlipThreshold
from pneudrive.friction.plausible import NAMES, STICK_SLIP

if TYPE_CHECKING:
    from pneudrive.friction.campaign.curves.points import Points
    from pneudrive.friction.conditions import Condition


def stick_slip_points(points: Points) -> tuple[StickSlipPoint, ...]:
    """Return the conditions and speeds at which sliding was not steady."""
    found = []
    for index, condition in enumerate(points.conditions):
        for level in range(points.level_speeds_m_s.size):
            members = _members(points, index, level)
            bad = [i for i in members if points.reasons[i] in NAMES]
            if not bad:
                continue
            sides = [side for i in members for side in points.reduced.data[i].sides.values()]
            slipping = [s for s in sides if s.stick_slip]
            nothing = float("nan")
            ripples = [max(np.nan_to_num([s.ripple, s.piston_ripple])) for s in sides]
            found.append(
                StickSlipPoint(
                    condition=condition,
                    speed_m_s=float(points.level_speeds_m_s[level]),
                    share=len(bad) / len(members),
                    strokes=len(sides),
                    ripple=float(np.median(ripples)),
                    period_s=float(np.median([s.period_s for s in slipping])) if slipping else nothing,
                    step_m=float(np.median([s.step_m for s in slipping])) if slipping else nothing,
                    amplitude_n=float(np.median([s.swing_n for s in sides])),
                )
            )
    return tuple(found)


def _members(points: Points, condition: int, level: int) -> list[int]:
    return np.flatnonzero((points.condition == condition) & (points.level == level)).tolist()


def thresholds(points: Points) -> tuple[StickSlipThreshold, ...]:
    """Return the speed below which stick-slip starts, as the interval between two measured speeds."""
    found = []
    for index, condition in enumerate(points.conditions):
        with_it, without = [], []
        for level, speed in enumerate(points.level_speeds_m_s.tolist()):
            members = _members(points, index, level)
            if members:
                # An uneven speed may come from the axis or its encoder, and is therefore not sufficient evidence.
                slips = sum(points.reasons[i] in STICK_SLIP for i in members)
                steady = sum(points.reasons[i] not in NAMES for i in members)
                if slips > 0.5 * len(members):
                    with_it.append(speed)
                elif steady >= 0.5 * len(members):
                    without.append(speed)
        if with_it or without:
            found.append(_threshold(condition, with_it, without))
    return tuple(found)


def _threshold(condition: Condition, with_it: list[float], without: list[float]) -> StickSlipThreshold:
    if not with_it:
        lowest = min(without)
        return StickSlipThreshold(condition, 0.0, lowest, f"no stick-slip down to {1e3 * lowest:.3g} mm/s")
    top = max(with_it)
    above = [speed for speed in without if speed > top]
    if not above:
        return StickSlipThreshold(condition, top, float("inf"), f"stick-slip up to {1e3 * top:.3g} mm/s, the highest")
    text = f"stick-slip starts between {1e3 * top:.3g} and {1e3 * min(above):.3g} mm/s"
    mixed = [speed for speed in without if speed < top]
    if mixed:
        text += f"; none at the lower speed of {', '.join(f'{1e3 * v:.3g}' for v in sorted(mixed))} mm/s"
    return StickSlipThreshold(condition, top, min(above), text)
