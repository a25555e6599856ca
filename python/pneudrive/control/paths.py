"""Paths as polynomials: from point to point within limits, through points, and along lines at constant speed.

A piece is a row: begin, s, duration, s, and ten coefficients, m, for the powers of the elapsed fraction of the
duration.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Row = list[float]

POWERS = 10
ORDER = 7  # of splines
REST = 4  # coefficients of a spline that are equal at an end where it is at rest with continuous jerk
#: Blends from 0 to 1 by their order: with three and with four continuous derivatives.
BLENDS = {7: (0, 0, 0, 0, 35, -84, 70, -20), 9: (0, 0, 0, 0, 0, 126, -420, 540, -315, 70)}
#: Largest speed of the blend of order 7 over its mean.
PEAK = 2.1875
#: Velocity that grows from 0 to 1 by the blend of order 7, integrated.
_RUN_UP = (0, 0, 0, 0, 0, 7, -14, 10, -2.5)
_ROUNDS = 200  # steps of a bisection: to the last bit


class PathLimits(NamedTuple):
    """Limits of a move.

    Attributes
    ----------
    velocity_m_s, acceleration_m_s2, jerk_m_s3, snap_m_s4 : float
    """

    velocity_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float
    snap_m_s4: float


def piece(begin_s: float, duration_s: float, start_m: float, way_m: float, shape: Sequence[float]) -> Row:
    """Return a piece: a start position plus a distance times a polynomial."""
    numbers = [way_m * own for own in (*shape, *[0.0] * (POWERS - len(shape)))]
    return [begin_s, duration_s, start_m + numbers[0], *numbers[1:]]


def blended(begin_s: float, duration_s: float, start_m: float, to_m: float, order: int) -> list[Row]:
    """Return a move as one blend."""
    return [piece(begin_s, duration_s, start_m, to_m - start_m, BLENDS[order])]


def within_limits(begin_s: float, start_m: float, to_m: float, limits: PathLimits) -> list[Row]:
    """Return the fastest move of 15 pieces of constant snap within limits.

    Snap s for t_s makes the jerk s t_s, which is kept for t_j. The acceleration is kept for t_a, and the velocity for
    t_v. Each time is as long as the limits and the way allow, one after the other.

    Examples
    --------
    >>> rows = within_limits(0.0, 0.0, 0.3, PathLimits(1.0, 10.0, 500.0, 5e4))
    >>> len(rows), round(sum(row[1] for row in rows), 6)
    (15, 0.43)
    """
    way = abs(to_m - start_m)
    if way == 0.0:
        return []
    v, a, j, s = limits

    def fits(t_s: float, t_j: float = 0.0, t_a: float = 0.0) -> bool:
        jerk = s * t_s
        acceleration = jerk * (t_s + t_j)
        velocity = acceleration * (2.0 * t_s + t_j + t_a)
        return jerk <= j and acceleration <= a and velocity <= v and velocity * (2.0 * (2.0 * t_s + t_j) + t_a) <= way

    t_s = _longest(fits)
    t_j = _longest(lambda t: fits(t_s, t))
    t_a = _longest(lambda t: fits(t_s, t_j, t))
    top = s * t_s * (t_s + t_j) * (2.0 * t_s + t_j + t_a)
    t_v = max(0.0, way / top - 2.0 * (2.0 * t_s + t_j) - t_a)
    up = [(t_s, s), (t_j, 0.0), (t_s, -s)]
    down = [(t, -snap) for t, snap in up]
    faster, slower = [*up, (t_a, 0.0), *down], [*down, (t_a, 0.0), *up]
    return _integrated(begin_s, start_m, math.copysign(1.0, to_m - start_m), [*faster, (t_v, 0.0), *slower])


def _longest(fits: Callable[[float], bool]) -> float:
    """Return the longest time that fits; 0 if no time does."""
    low, high = 0.0, 1e-6
    while fits(high):
        low, high = high, 2.0 * high
    for _ in range(_ROUNDS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def _integrated(begin_s: float, start_m: float, sign: float, each: Sequence[tuple[float, float]]) -> list[Row]:
    """Integrate intervals of constant snap."""
    rows, (x, v, a, j) = [], (start_m, 0.0, 0.0, 0.0)
    for t, size in each:
        s = sign * size
        numbers = [x, v * t, a * t**2 / 2.0, j * t**3 / 6.0, s * t**4 / 24.0]
        if t > 0.0:
            rows.append([begin_s, t, *numbers, *[0.0] * (POWERS - len(numbers))])
        x, v, a, j = sum(numbers), v + a * t + j * t**2 / 2 + s * t**3 / 6, a + j * t + s * t**2 / 2, j + s * t
        begin_s += t
    return rows


def along_line(begin_s: float, start_m: float, to_m: float, duration_s: float, run_up_s: float) -> list[Row]:
    """Return a move at constant velocity, with blends at its begin and end.

    `duration_s` is the duration at constant velocity for the whole distance. The blends add `run_up_s`, which is
    limited to `duration_s`.
    """
    way = to_m - start_m
    run_up = min(run_up_s, duration_s)
    velocity, at = way / duration_s, run_up
    first = piece(begin_s, run_up, start_m, velocity * run_up, _RUN_UP)
    half = 0.5 * velocity * run_up
    straight = duration_s - run_up
    rows = [first]
    if straight > 0.0:
        rows.append(piece(begin_s + at, straight, start_m + half, velocity * straight, (0.0, 1.0)))
    # Backwards: the rest of the way is the mirrored run-up.
    last = np.polynomial.Polynomial([1.0, -1.0])
    mirrored = -np.polynomial.Polynomial(_RUN_UP)(last)
    rows.append(piece(begin_s + at + straight, run_up, to_m, velocity * run_up, mirrored.coef.tolist()))
    return rows


def through(times_s: Sequence[float], points_m: Sequence[float]) -> list[Row]:
    """Return a spline of order 7 that passes points at their times, at rest at both ends."""
    from scipy.interpolate import PPoly, make_interp_spline

    rest = [(order, 0.0) for order in (1, 2, 3)]
    return _of_spline(PPoly.from_spline(make_interp_spline(times_s, points_m, k=ORDER, bc_type=(rest, rest))))


def near(times_s: Array, points_m: Array, knot_s: float) -> list[Row]:
    """Return the spline of order 7, with knots at this distance, that fits the samples of a record best.

    At both ends it is at rest at the record's position.
    """
    from scipy.interpolate import BSpline, PPoly
    from scipy.sparse.linalg import spsolve

    begin, end = float(times_s[0]), float(times_s[-1])
    count = max(REST, math.ceil((end - begin) / knot_s))
    knots = np.concatenate([[begin] * ORDER, np.linspace(begin, end, count + 1), [end] * ORDER])
    basis: Any = BSpline.design_matrix(times_s, knots, ORDER).tocsc()
    # The four coefficients at an end determine the value and three derivatives there.
    numbers = np.empty(len(knots) - ORDER - 1)
    numbers[:REST], numbers[-REST:] = points_m[0], points_m[-1]
    inner = basis[:, REST:-REST]
    rest = points_m - basis[:, :REST] @ numbers[:REST] - basis[:, -REST:] @ numbers[-REST:]
    solved: Any = spsolve((inner.T @ inner).tocsc(), inner.T @ rest)
    numbers[REST:-REST] = solved
    return _of_spline(PPoly.from_spline(BSpline(knots, numbers, ORDER)))


def _of_spline(spline: Any) -> list[Row]:  # noqa: ANN401 - scipy's own
    breaks, numbers = spline.x, spline.c[::-1]
    rows = []
    for i, (begin, end) in enumerate(pairwise(breaks)):
        if end > begin:
            scaled = numbers[:, i] * (end - begin) ** np.arange(len(numbers))
            rows.append([float(begin), float(end - begin), *map(float, scaled), *[0.0] * (POWERS - len(scaled))])
    return rows
