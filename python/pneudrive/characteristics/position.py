"""Friction against position: its pattern over the common range, trend and harmonics, cycles being the repeats."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import student
from pneudrive.characteristics.basics import Condition, Estimate
from pneudrive.characteristics.effects import Harmonic, PositionDependence

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characteristics.curves import Points

    Array = NDArray[np.float64]

HARMONICS = 6
FEWEST_CYCLES = 4
COVERED = 0.9  # of the common bins: cycles that lack more do not tell of trend and harmonics


def position_dependence(points: Points) -> tuple[PositionDependence, ...]:
    """Describe friction over position: all cycles together, then each condition that has enough of them."""
    use = points.use
    groups: list[tuple[Condition | None, NDArray[np.bool_]]] = [(None, use)]
    if len(points.conditions) > 1:
        groups += [(c, use & (points.condition == i)) for i, c in enumerate(points.conditions)]
    found = (_describe(points, condition, members) for condition, members in groups)
    return tuple(one for one in found if one is not None)


def _describe(points: Points, condition: Condition | None, members: NDArray[np.bool_]) -> PositionDependence | None:
    reduced = points.reduced
    rows = reduced.relative_n[members][:, reduced.common]
    position = reduced.position_m[reduced.common]
    rows = rows[np.isfinite(rows).mean(axis=1) >= COVERED]
    if rows.shape[0] < FEWEST_CYCLES or position.size < 2 * HARMONICS + 4:
        return None
    known = np.isfinite(rows)
    count = known.sum(axis=0)
    mean = np.where(known, rows, 0.0).sum(axis=0) / np.maximum(count, 1)
    deviation = np.sqrt((np.where(known, rows - mean, 0.0) ** 2).sum(axis=0) / np.maximum(count - 1, 1))
    half = np.array([student(n - 1) for n in count]) * deviation / np.sqrt(np.maximum(count, 1))
    width = float(position[1] - position[0])
    length = position.size * width
    coefficients = np.array([_fit(position, row, length) for row in rows])
    trend = _estimate(coefficients[:, 1], "1/m")
    harmonics = tuple(
        _harmonic(k, length / k, coefficients[:, 2 * k], coefficients[:, 2 * k + 1]) for k in range(1, HARMONICS + 1)
    )
    return PositionDependence(condition, position, mean, mean - half, mean + half, trend, harmonics, rows.shape[0])


def _fit(position: Array, row: Array, length: float) -> Array:
    """Fit mean, trend and harmonics to one cycle."""
    known = np.isfinite(row)
    phase = 2.0 * np.pi * (position[known] - position[0]) / length
    columns = [np.ones(int(known.sum())), position[known] - position.mean()]
    for k in range(1, HARMONICS + 1):
        columns += [np.cos(k * phase), np.sin(k * phase)]
    return np.asarray(np.linalg.lstsq(np.column_stack(columns), row[known], rcond=None)[0], dtype=float)


def _estimate(values: Array, unit: str) -> Estimate:
    from scipy.special import stdtr

    n = values.size
    mean, stderr = float(values.mean()), float(values.std(ddof=1) / np.sqrt(n))
    half = student(n - 1) * stderr
    p = 2.0 * float(stdtr(n - 1, -abs(mean) / stderr)) if stderr > 0 else float(mean == 0.0)
    return Estimate(mean, mean - half, mean + half, stderr, unit, n - 1, p)


def _harmonic(order: int, wavelength: float, cosine: Array, sine: Array) -> Harmonic:
    """Estimate one harmonic; its amplitude is tested by Hotelling's T2 of both parts."""
    from scipy.special import fdtrc

    n = cosine.size
    both = np.column_stack([cosine, sine])
    mean = both.mean(axis=0)
    covariance = np.cov(both.T) / n
    size = float(np.hypot(*mean))
    along = mean / size if size > 0 else np.array([1.0, 0.0])
    stderr = float(np.sqrt(max(along @ covariance @ along, 0.0)))
    half = student(n - 1) * stderr
    try:
        t2 = float(mean @ np.linalg.solve(covariance, mean))
        p = float(fdtrc(2, n - 2, t2 * (n - 2) / (2.0 * (n - 1))))
    except np.linalg.LinAlgError:
        p = float(size == 0.0)
    amplitude = Estimate(size, max(size - half, 0.0), size + half, stderr, "1", n - 1, p)
    return Harmonic(order, wavelength, _estimate(cosine, "1"), _estimate(sine, "1"), amplitude)
