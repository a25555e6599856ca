"""Height of a peak between a steep rise and a slow fall: a sharp or rounded corner.

  F(t) = p + r (t - c) + d S(t - c) + q S(t - c)^2,   S(u) = s ln(1 + exp(u / s))

Smoothing reduces the height of a corner; a fit does not. This module does not treat peaks that are round over several
samples. The parameters p, r, d, q are linear. Corner c and roundness s are evaluated on a grid. The height is the
average over the grid, weighted by the quality of each fit. Its uncertainty therefore includes the uncertainty of c and
s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.separable import scan
from pneudrive.signals.motion import straight_line

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.estimate.separable import Scan

    Array = NDArray[np.float64]

#: Parts of the excess down to which samples on both sides are fitted: the widest that a corner describes.
DEPTHS = (0.6, 0.35, 0.2)
LEAST_DEPTH = 8.0  # deviations of the noise
BEHIND, BEFORE = 160, 60  # samples at most on either side
FEWEST_BEFORE, FEWEST_BEHIND = 3, 12
PLACES = 33  # of the corner
FINER = 3  # refinements of the grid, while samples resolve the corner better than its spacing
KNOWN = 1.5  # spacings: largest standard deviation of the place without refinement
ROUNDNESS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)  # samples
SHARP = 1.0  # samples: a rounder corner is smoothed without loss, and parabolas describe it better
FITS = 1.3  # largest ratio of squared residual to noise for a corner
FINE = 8  # points per sample for the maximum of a fitted corner
#: Multiples of the sensor's lag before and after a peak between which rise and fall are fitted, where the lag has
#: died away; a shorter lag counts as this many samples, so that noise does not pass for slopes.
RISE_LAGS, FALL_LAGS, FEWEST_ON_A_SIDE, LEAST_LAG = (1.0, 6.0), (2.0, 7.0), 3, 3.0


def corner_height(
    friction_n: Array, top: int, excess_n: float, one_n: float, many_n: float
) -> tuple[float, float] | None:
    """Return height and standard error of the peak.

    Parameters
    ----------
    friction_n : ndarray, shape (n,)
        Evenly spaced samples.
    top : int
        Approximate index of the highest sample.
    excess_n : float
        Approximate excess of the peak over running friction.
    one_n : float
        Standard deviation of one sample.
    many_n : float
        The same for a mean of many samples. The value is larger for correlated noise.

    Returns
    -------
    (float, float) or None
        None if no corner describes the samples.
    """
    if excess_n < LEAST_DEPTH * one_n:
        return None  # hardly a peak: the start of a plateau is not a falling corner
    for depth in DEPTHS:
        part = _window(friction_n, top, max(depth * excess_n, LEAST_DEPTH * one_n))
        if part is None:
            continue
        found = _fit(friction_n[part], top - part.start, one_n, many_n)
        if found is not None:
            return found
    return None


def lag_loss(time_s: Array, friction_n: Array, at_s: float, bandwidth_hz: float) -> float:
    """Return the loss of height by a first-order sensor, N: exact for a corner, an upper bound for a round peak.

    A rise r that turns into a fall q at a corner appears lower by q tau ln(1 + r / q), tau = 1 / (2 pi f). This follows
    from the largest response of the lag to two ramps.

    Parameters
    ----------
    time_s, friction_n : ndarray, shape (n,)
    at_s : float
        Time of the peak as shown.
    bandwidth_hz : float
        f, at which the sensor shows 71 % of an amplitude.
    """
    lag = 1.0 / (2.0 * np.pi * bandwidth_hz)
    unit = max(lag, LEAST_LAG * float(np.median(np.diff(time_s)))) if time_s.size > 1 else lag

    def slope(begin: float, end: float) -> float:
        part = slice(*np.searchsorted(time_s, (at_s + begin * unit, at_s + end * unit)).tolist())
        few = time_s[part].size < FEWEST_ON_A_SIDE
        return 0.0 if few else straight_line(time_s[part], friction_n[part])[0]

    rise, fall = slope(-RISE_LAGS[1], -RISE_LAGS[0]), -slope(*FALL_LAGS)
    return float(fall * lag * np.log1p(rise / fall)) if rise > 0.0 and fall > 0.0 else 0.0


def _window(friction: Array, top: int, depth: float) -> slice | None:
    level = friction[top] - depth
    below = np.flatnonzero(friction[max(top - BEFORE, 0) : top] < level)
    begin = max(top - BEFORE, 0) + (int(below[-1]) + 1 if below.size else 0)
    begin = min(begin, top - FEWEST_BEFORE)
    after = np.flatnonzero(friction[top : top + BEHIND] < level)
    end = top + (int(after[0]) if after.size else BEHIND)
    end = min(end, friction.size)
    return slice(begin, end) if begin >= 0 and end - top >= FEWEST_BEHIND else None


def _fit(friction: Array, top: int, one_n: float, many_n: float) -> tuple[float, float] | None:
    found, weight = _places(friction, top, many_n)
    if found.cost[found.best] > FITS * (friction.size - 6.0) * one_n**2 or found.shape[found.best, 1] > SHARP:
        return None
    chosen = np.flatnonzero(weight > 1e-3)
    corner, each = found.shape[chosen, 0], np.arange(chosen.size)
    even = np.linspace(0.0, friction.size - 1.0, FINE * friction.size)
    columns = _columns(np.c_[np.broadcast_to(even, (chosen.size, even.size)), corner], found.shape[chosen])
    values = (columns @ found.coefficient[chosen, :, None])[:, :, 0]
    at = np.argmax(values, axis=1)
    heights, rows = values[each, at], columns[each, at]
    variances = np.einsum("gi,gij,gj->g", rows, found.covariance[chosen], rows) * many_n**2
    share = weight[chosen] / weight[chosen].sum()
    height = float(share @ heights)
    return height, float(np.sqrt(share @ (variances + (heights - height) ** 2)))


def _places(friction: Array, top: int, many_n: float) -> tuple[Scan, Array]:
    """Fit corners at all places and roundnesses, and return a weight for each.

    The distance of places in the grid is the smallest that the samples resolve.
    """
    low, high = max(top - 6.0, 0.5), top + 6.0
    tried = _scanned(friction, low, high, many_n)
    for _ in range(FINER):
        found, weight = tried
        step, corner = (high - low) / (PLACES - 1), found.shape[:, 0]
        share = weight / weight.sum()
        middle = float(share @ corner)
        if share @ (corner - middle) ** 2 > (KNOWN * step) ** 2:
            break
        low, high = middle - 2.0 * KNOWN * step, middle + 2.0 * KNOWN * step
        tried = _scanned(friction, low, high, many_n)
    return tried


def _scanned(friction: Array, low: float, high: float, many_n: float) -> tuple[Scan, Array]:
    places = np.linspace(low, high, PLACES)
    grid = np.column_stack([np.tile(places, len(ROUNDNESS)), np.repeat(ROUNDNESS, PLACES)])
    found = scan(grid, _columns(np.arange(friction.size, dtype=float), grid), friction)
    return found, np.exp(-0.5 * (found.cost - found.cost[found.best]) / many_n**2)


def _columns(t: Array, grid: Array) -> Array:
    """Return columns at times (n,) or (g, n) of each corner and roundness, shape (g, 2); shape (g, n, 4)."""
    corner, roundness = grid[:, :1], grid[:, 1:]
    away = t - corner
    width = np.where(roundness > 0.0, roundness, 1.0)
    bend = np.where(roundness > 0.0, width * np.logaddexp(0.0, away / width), np.maximum(away, 0.0))
    return np.stack([np.ones_like(away), away, bend, bend**2], axis=2)
