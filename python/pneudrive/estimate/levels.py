"""Distinct levels among measured values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Relative difference below which two speeds count as one level.
SAME_SPEED = 0.05


def distinct(values: Array, share: float = SAME_SPEED) -> int:
    """Return the number of levels among `values`."""
    return len(distinct_levels(values, share))


def distinct_levels(values: Array, share: float = SAME_SPEED) -> list[tuple[float, float]]:
    """Return the lowest and highest value of each level; values closer than `share` of the larger form one level."""
    levels: list[tuple[float, float]] = []
    for value in np.sort(np.abs(values)).tolist():
        if not levels or value - levels[-1][0] > share * value:
            levels.append((value, value))
        levels[-1] = (levels[-1][0], value)
    return levels
