"""Position bins: pairing of both directions at equal positions, and scatter of stroke means.

Statistical uncertainty comes from the scatter between strokes, never only from the samples of one stroke. Samples of
one stroke share lubrication, temperature and position pattern, so they are not independent. A standard error from the
number of samples would be many times too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneudrive import _core
from pneudrive.arrays import Array, Bools
from pneudrive.estimate.autocorrelation import stderr_of_mean, stderrs_of_means
from pneudrive.signals.motion import straight_line

ALTERNATIONS, CONVERGED = 50, 1e-9
MIDDLE = (0.2, 0.8)  # of the way: the window, if the layout does not state it


@dataclass(frozen=True)
class Grid:
    """Position bins of equal width. Bin 0 begins at the lower end of the window; both window ends are bin edges.

    Attributes
    ----------
    low_m, width_m : float
        Lower end of the window, width of a bin.
    in_window : int
        Number of bins of the window.
    first, stop : int
        Index of the first bin (negative below the window), and index after the last bin.
    whole : bool
        Whether to leave out each bin that the settled part of a stroke covers only partly. True for bins that are
        common to all cycles.
    """

    low_m: float
    width_m: float
    in_window: int
    first: int
    stop: int
    whole: bool = False

    @property
    def edges_m(self) -> Array:
        """Edges of the bins, in m."""
        return np.asarray(self.low_m + self.width_m * np.arange(self.first, self.stop + 1), dtype=float)

    @property
    def is_in_window(self) -> Bools:
        """Whether each bin is in the window."""
        number = np.arange(self.first, self.stop)
        return (number >= 0) & (number < self.in_window)


@dataclass(frozen=True, eq=False)  # holds arrays: equal only to itself
class Profile:
    """Balance, friction and offset over position for one recording and speed level.

    Attributes
    ----------
    position_m : ndarray, shape (m,)
        Centres of the bins.
    up_n, down_n : ndarray, shape (m,)
        Mean balance of the strokes in +x and in -x.
    friction_n, offset_n : ndarray, shape (m,)
        Half the difference and half the sum of ``up_n`` and ``down_n``. NaN if a direction has no settled samples.
    up_strokes_n, down_strokes_n : ndarray, shape (strokes, m)
        Mean balance of each stroke.
    in_window : ndarray of bool, shape (m,)
        Bins that are averaged for the friction map.
    """

    position_m: Array
    up_n: Array
    down_n: Array
    friction_n: Array
    offset_n: Array
    up_strokes_n: Array
    down_strokes_n: Array
    in_window: Bools


def grid_of(edges_m: Array) -> Grid:
    """Return the grid with these bin edges, which are common to all cycles. Its window is the middle of the travel."""
    bins = edges_m.size - 1
    first, stop = (round(share * bins) for share in MIDDLE)
    width_m = float(edges_m[1] - edges_m[0])
    return Grid(float(edges_m[first]), width_m, stop - first, -first, bins - first, whole=True)


def bin_means(
    position_m: Array, values: Array, edges_m: Array, parts: Sequence[slice], chosen: Bools | None = None
) -> Array:
    """Return the mean of ``values`` in each position bin over the samples in `parts`; NaN in empty bins.

    Parameters
    ----------
    position_m, values : ndarray, shape (n,)
    edges_m : ndarray, shape (bins + 1,)
    parts : sequence of slice
    chosen : ndarray of bool, shape (n,), optional
        Mask of the samples to use; None: all.
    """
    bins = (float(edges_m[0]), float(edges_m[-1]), edges_m.size - 1)
    columns = np.ascontiguousarray(position_m), np.ascontiguousarray(values)
    return _core.bin_means(*columns, chosen, [(part.start, part.stop) for part in parts], bins)


def mean_profile(strokes_n: Array) -> Array:
    """Return the mean over strokes in each bin, shape (bins,), by a model with a separate level for each stroke.

    A stroke with missing bins (a gap in the recording) must not shift the profile in these bins. The two-way model
    value = stroke + bin is fitted by alternation, and the profile is bin + mean stroke.

    Parameters
    ----------
    strokes_n : ndarray, shape (strokes, bins)
    """
    if strokes_n.shape[0] == 0:
        return np.full(strokes_n.shape[1], np.nan)
    known = np.isfinite(strokes_n)
    if known.all():
        return strokes_n.mean(axis=0)
    level = np.zeros(strokes_n.shape[0])
    profile = np.zeros(strokes_n.shape[1])
    for _ in range(ALTERNATIONS):
        profile = known_mean(strokes_n - level[:, None], axis=0)
        change = np.nan_to_num(known_mean(strokes_n - profile, axis=1) - level)
        level += change - (level + change).mean()
        if np.abs(change).max() <= CONVERGED * np.abs(strokes_n[known]).max(initial=0.0):
            break
    return profile


def known_mean(values: Array, axis: int) -> Array:
    """Return the mean of the finite values. If all values are missing, the mean is NaN without a warning."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    total = np.where(known, values, 0.0).sum(axis=axis)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


TREND_LEVEL = 0.05
MINIMUM_FOR_TREND = 5


@dataclass(frozen=True)
class Spread:
    """Spread of stroke means in one direction.

    ``stderr_n`` is NaN for a single stroke. ``trend_p`` is the p-value of Kendall's test for a drift (1 if not
    testable). ``effective`` is the number of independent strokes; a drift makes it smaller than ``strokes``.
    """

    strokes: int
    mean_n: float
    deviation_n: float
    stderr_n: float
    effective: float
    trend_p: float = 1.0

    @property
    def has_trend(self) -> bool:
        """Whether the drift is significant at 5 %."""
        return self.trend_p < TREND_LEVEL


def spread_of(stroke_means_n: Array) -> Spread:
    """Return the spread of the means of successive strokes, shape (strokes,). Strokes with NaN are left out."""
    values = stroke_means_n[np.isfinite(stroke_means_n)]
    n = values.size
    if n == 0:
        return Spread(0, np.nan, np.nan, np.nan, 0.0)
    mean = float(values.mean())
    if n == 1:
        return Spread(1, mean, np.nan, np.nan, 1.0)
    deviation, p = float(values.std(ddof=1)), 1.0
    if n >= MINIMUM_FOR_TREND and np.ptp(values) > 0:
        from scipy.stats import kendalltau

        p = float(np.asarray(kendalltau(np.arange(n), values))[1])
    # A significant correlation of neighbouring strokes reduces the number of independent strokes.
    effective, away = float(n), values - values.mean()
    power = away @ away
    if n >= 4 and power != 0:
        r = away[1:] @ away[:-1] / power
        if p < TREND_LEVEL or r >= 1.645 / np.sqrt(n):
            r = float(np.clip(r, 0.0, 0.9))
            effective = max(n * (1 - r) / (1 + r), 2.0)
    return Spread(n, mean, deviation, deviation / np.sqrt(effective), effective, p)


def pair_stderr(deviation_n: Array, effective: Array) -> Array:
    """Return the standard errors of half the difference between the means of both directions, shape (n,).

    A direction with a single stroke takes the scatter of the other direction. The result is NaN if both are unknown.

    Parameters
    ----------
    deviation_n, effective : ndarray, shape (n, 2)
        Scatter of the strokes, and effective number of strokes, of both directions.
    """
    pooled = np.where(np.isfinite(deviation_n), deviation_n, -np.inf).max(axis=1)
    filled = np.where(np.isfinite(deviation_n), deviation_n, pooled[:, None])
    parts = filled**2 / np.maximum(effective, 1.0)
    return np.where(np.isfinite(pooled), 0.5 * np.sqrt(parts[:, 0] + parts[:, 1]), np.nan)


def profile_stderr(profile_n: Array) -> float:
    """Estimate the standard error of a profile's mean for a single stroke, from the profile alone.

    A straight line is removed first, because the coarse pattern over position is not random.
    """
    values = profile_n[np.isfinite(profile_n)]
    n = values.size
    if n < 4:
        return np.nan
    x = np.arange(n, dtype=float)
    slope, intercept = straight_line(x, values)
    return stderr_of_mean(values - (intercept + slope * x)) * np.sqrt((n - 1) / (n - 2))


def within_stderr(strokes_n: Array) -> float:
    """Estimate the standard error of the mean of all strokes from noise inside the strokes only.

    The scatter of two or three stroke means may be small by chance. This value is a lower limit of the error.

    Parameters
    ----------
    strokes_n
        Balance of each stroke in each bin, shape (strokes, bins), for at least two strokes.
    """
    strokes_n = strokes_n[:, np.isfinite(strokes_n).all(axis=0)]
    strokes, bins = strokes_n.shape
    if strokes < 2 or bins < 4:
        return 0.0
    # The mean of the strokes in each bin takes its share of their noise.
    rest = strokes_n - strokes_n.mean(axis=0) - strokes_n.mean(axis=1, keepdims=True) + strokes_n.mean()
    return float(np.sqrt(np.mean(stderrs_of_means(rest) ** 2) / (strokes - 1)))
