"""Stick-slip in a campaign: where it is, how large, and below which speed it starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characteristics.curves import RIPPLE_LIMIT
from pneudrive.characteristics.effects import StickSlipPoint, StickSlipThreshold

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characteristics.curves import Points


def stick_slip_points(points: Points) -> tuple[StickSlipPoint, ...]:
    """Give the conditions and speeds at which a stroke shows stick-slip, or a speed ripple above 20 %."""
    found = []
    for index, condition in enumerate(points.conditions):
        for level in range(points.level_speeds_m_s.size):
            sides = _sides(points, index, level)
            if not sides:
                continue
            slipping = [s for s in sides if s.stick_slip]
            ripple = float(np.median([np.nan_to_num(s.ripple) for s in sides]))
            if not slipping and ripple <= RIPPLE_LIMIT:
                continue
            nothing = float("nan")
            found.append(
                StickSlipPoint(
                    condition=condition,
                    speed_m_s=float(points.level_speeds_m_s[level]),
                    share=len(slipping) / len(sides),
                    strokes=len(sides),
                    ripple=ripple,
                    period_s=float(np.median([s.period_s for s in slipping])) if slipping else nothing,
                    step_m=float(np.median([s.step_m for s in slipping])) if slipping else nothing,
                    amplitude_n=float(np.median([s.swing_n for s in slipping])) if slipping else nothing,
                )
            )
    return tuple(found)


def _sides(points: Points, condition: int, level: int) -> list:
    members: NDArray[np.bool_] = (points.condition == condition) & (points.level == level)
    chosen = (d for d, member in zip(points.reduced.data, members, strict=True) if member)
    return [side for d in chosen for side in d.sides.values()]


def thresholds(points: Points) -> tuple[StickSlipThreshold, ...]:
    """Give the speed below which stick-slip starts, as the interval between two measured speeds."""
    found = []
    for index, condition in enumerate(points.conditions):
        with_it, without = [], []
        for level, speed in enumerate(points.level_speeds_m_s.tolist()):
            sides = _sides(points, index, level)
            if sides:
                slips = sum(s.stick_slip or np.nan_to_num(s.ripple) > RIPPLE_LIMIT for s in sides)
                (with_it if slips > 0.5 * len(sides) else without).append(speed)
        found.append(_threshold(condition, with_it, without))
    return tuple(found)


def _threshold(condition, with_it: list[float], without: list[float]) -> StickSlipThreshold:  # noqa: ANN001
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
        text += f"; at {', '.join(f'{1e3 * v:.3g}' for v in sorted(mixed))} mm/s below that there is none"
    return StickSlipThreshold(condition, top, min(above), text)
