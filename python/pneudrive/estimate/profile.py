"""Intervals by profile likelihood: one coordinate is held, all others are fitted again [bates1988]."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

Point = TypeVar("Point")

#: Largest number of steps to find an end, and relative error of the root of the cost's growth at it.
STEPS, ROOT_ERROR = 8, 0.02
#: Distance without sufficient growth of the cost beyond which a side is open.
FARTHEST = 50.0


def profile_interval(
    held: Callable[[float, Point], tuple[float, Point]],
    point: Point,
    estimate: float,
    step: float,
    least: float,
    allowed: float,
    farthest: float = FARTHEST,
) -> tuple[float, float]:
    """Return the interval of one coordinate in which the cost grows by no more than `allowed`.

    The secant rule finds the root of the cost's growth at each end, as this root is linear for a linear model.

    Parameters
    ----------
    held : callable
        ``held(value, start)`` holds the coordinate at a value, fits all others from a start, and returns the cost and
        the point where it ended, from which the next step starts. The cost may be infinite.
    point : object
        Point of the estimate: start of the first step to either side.
    estimate : float
        Coordinate at the estimate.
    step : float
        First step; the half width of the first-order interval.
    least, allowed : float
        Cost at the estimate, and its growth at the ends.
    farthest : float
        Distance from the estimate beyond which a side is open.

    Returns
    -------
    float, float
        Ends; infinite if the cost never grows so far.

    Examples
    --------
    The model 3 x of the values 3, 6 and 9 at unit weights grows by (3^2 + 6^2 + 9^2) (x - 1)^2 about x = 1.

    >>> low, high = profile_interval(lambda x, _: (126.0 * (x - 1.0) ** 2, None), None, 1.0, 0.1, 0.0, 126.0)
    >>> round(low, 6), round(high, 6)
    (0.0, 2.0)
    """
    ends = []
    for sign in (-1.0, 1.0):
        away, last, root_last, start = step if step > 0.0 else 1.0, 0.0, 0.0, point
        for _ in range(STEPS):
            cost, start = held(estimate + sign * away, start)
            root = np.sqrt(max(cost - least, 0.0) / allowed) if np.isfinite(cost) else 2.0
            if abs(root - 1.0) < ROOT_ERROR:
                break
            slope = (root - root_last) / (away - last)
            last, root_last = away, root
            if slope <= 1e-3 / max(away, 1e-300):
                away = np.inf
                break
            away = float(np.clip(last + (1.0 - root) / slope, 0.3 * last, 3.0 * last))
            if away > farthest:
                away = np.inf
                break
        ends.append(estimate + sign * away)
    return ends[0], ends[1]
