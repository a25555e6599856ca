"""Statistical uncertainty from the spread between strokes, never only from samples inside a stroke.

Samples inside a stroke share the stroke's lubrication, temperature and position pattern, so they are not independent.
Their spread divided by the root of their number is therefore many times too small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.autocorrelation import stderr_of_mean, stderrs_of_means
from pneudrive.signals.motion import straight_line

if TYPE_CHECKING:
    from numpy.typing import NDArray

TREND_LEVEL = 0.05
MINIMUM_FOR_TREND = 5
MOST_PAIRED = 1000  # most strokes for slopes of all pairs; of more, this many evenly spread ones


@dataclass(frozen=True)
class Spread:
    """Spread of stroke means in one direction.

    ``stderr_n`` is NaN for a single stroke. ``slope_n`` is the robust drift per stroke (Theil-Sen),
    ``trend_p`` the two-sided probability of Kendall's test that it is chance (1 if not testable).
    ``effective`` is the number of independent strokes, smaller than ``strokes`` if they drift.
    """

    strokes: int
    mean_n: float
    deviation_n: float
    stderr_n: float
    effective: float
    slope_n: float
    trend_p: float

    @property
    def has_trend(self) -> bool:
        """Whether the drift is significant at 5 %."""
        return self.trend_p < TREND_LEVEL


def spread_of(stroke_means_n: NDArray[np.float64]) -> Spread:
    """Describe the means of successive strokes, shape (strokes,), NaN ignored."""
    values = stroke_means_n[np.isfinite(stroke_means_n)]
    n = values.size
    if n == 0:
        return Spread(0, float("nan"), float("nan"), float("nan"), 0.0, float("nan"), 1.0)
    mean = float(values.mean())
    if n == 1:
        return Spread(1, mean, float("nan"), float("nan"), 1.0, float("nan"), 1.0)
    deviation = float(values.std(ddof=1))
    slope, p = _trend(values)
    effective = _effective_number(values, has_trend=p < TREND_LEVEL)
    return Spread(n, mean, deviation, deviation / np.sqrt(effective), effective, slope, p)


def _trend(values: NDArray[np.float64]) -> tuple[float, float]:
    n = values.size
    some = np.unique(np.linspace(0, n - 1, MOST_PAIRED).astype(np.int64)) if n > MOST_PAIRED else np.arange(n)
    first, second = (some[index] for index in np.triu_indices(some.size, 1))
    slope = float(np.median((values[second] - values[first]) / (second - first)))
    if n < MINIMUM_FOR_TREND or np.ptp(values) == 0:
        return slope, 1.0
    from scipy.stats import kendalltau

    return slope, float(np.asarray(kendalltau(np.arange(n), values))[1])


def _effective_number(values: NDArray[np.float64], *, has_trend: bool) -> float:
    """Estimate the number of independent strokes: fewer if neighbouring strokes are significantly correlated."""
    n = values.size
    away = values - values.mean()
    power = float(away @ away)
    if n < 4 or power == 0:
        return float(n)
    r = float(away[1:] @ away[:-1]) / power
    if not has_trend and r < 1.645 / np.sqrt(n):
        return float(n)
    r = float(np.clip(r, 0.0, 0.9))
    return max(n * (1 - r) / (1 + r), 2.0)


def pair_stderr(up: Spread, down: Spread) -> float:
    """Return the standard error of half the difference of both directions' means; NaN without a known spread.

    If one direction has a single stroke, the spread of the other direction is used.
    """
    deviations = [s.deviation_n for s in (up, down) if np.isfinite(s.deviation_n)]
    if not deviations:
        return float("nan")
    pooled = max(deviations)
    parts = [(s.deviation_n if np.isfinite(s.deviation_n) else pooled) ** 2 / max(s.effective, 1.0) for s in (up, down)]
    return 0.5 * float(np.sqrt(sum(parts)))


def profile_stderr(profile_n: NDArray[np.float64]) -> float:
    """Estimate the standard error of a profile's mean for a single stroke, from the profile alone.

    A straight line is removed, because the pattern over position is not random, in particular its coarse part.
    """
    values = profile_n[np.isfinite(profile_n)]
    n = values.size
    if n < 4:
        return float("nan")
    x = np.arange(n, dtype=np.float64)
    slope, intercept = straight_line(x, values)
    return stderr_of_mean(values - (intercept + slope * x)) * float(np.sqrt((n - 1) / (n - 2)))


def within_stderr(strokes_n: NDArray[np.float64]) -> float:
    """Estimate the standard error of the mean of all strokes from noise inside the strokes only.

    The spread of two or three stroke means may be small by chance, but their error is never below this.

    Parameters
    ----------
    strokes_n
        Balance of each stroke in each bin, shape (strokes, bins), at least two strokes.
    """
    strokes_n = strokes_n[:, np.isfinite(strokes_n).all(axis=0)]
    strokes, bins = strokes_n.shape
    if strokes < 2 or bins < 4:
        return 0.0
    # The mean of the strokes in each bin takes its share of their noise.
    rest = strokes_n - strokes_n.mean(axis=0) - strokes_n.mean(axis=1, keepdims=True) + strokes_n.mean()
    return float(np.sqrt(np.mean(stderrs_of_means(rest) ** 2) / (strokes - 1)))
