"""Distance and time after a restart until friction has returned to that of uninterrupted sliding.

  excess(s) = E exp(-s/L) + c        s: travel since the breakaway peak

c is the rest at the end of the move. Friction has recovered when the excess over c has fallen to 5 % of its start.
This distance does not depend on noise, unlike "no longer distinguishable".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import Estimate, student
from pneudrive.estimate.groups import means
from pneudrive.estimate.separable import Scan, refined, scan

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

BACK = 0.05  # of the excess at the peak
BINS_PER_DECADE = 14
LEAST_IN_BIN = 4
FEWEST_BINS = 8
LENGTHS = 60
MISFIT = 0.05  # of the excess: largest misfit of an exponential for reading a distance
#: An excess below this many standard errors cannot be followed.
SIGNIFICANT = 3.0


@dataclass(frozen=True)
class Recovery:
    """Return of friction to that of uninterrupted sliding after a restart.

    Attributes
    ----------
    distance : Estimate
        m, from the peak to 5 % of the excess; high is inf if the move ends before.
    time : Estimate
        s, likewise.
    length_m : float
        L.
    left : Estimate
        c: friction at the end less that before the stop, N.
    seen_m : float
        Travel of the move after the peak.
    complete : bool
        The move is long enough.
    exponential : bool
        The excess is an exponential within its noise; otherwise the distance is read from the bins.
    """

    distance: Estimate
    time: Estimate
    length_m: float
    left: Estimate
    seen_m: float
    complete: bool
    exponential: bool


@dataclass(frozen=True, eq=False)
class Excess:
    """Excess over uninterrupted sliding in bins of travel since the peak, with standard errors; shape (m,) each."""

    travel_m: Array
    time_s: Array
    excess_n: Array
    stderr_n: Array


def bin_excess(travel_m: Array, time_s: Array, excess_n: Array, noise_n: float, texture_n: float) -> Excess | None:
    """Average over bins whose width grows with travel; None if there are too few samples.

    Parameters
    ----------
    travel_m, time_s, excess_n : ndarray, shape (n,)
        Since the peak.
    noise_n : float
        Noise of one sample.
    texture_n : float
        Standard deviation of friction over position in uninterrupted sliding, which bins do not average out.
    """
    known = travel_m > 0
    travel, time, excess = travel_m[known], time_s[known], excess_n[known]
    if travel.size < FEWEST_BINS * LEAST_IN_BIN:
        return None
    low = float(travel[LEAST_IN_BIN])
    edges = np.r_[0.0, np.geomspace(low, float(travel[-1]) * (1 + 1e-9), BINS_PER_DECADE * 4)]
    at = np.searchsorted(edges, travel, side="right") - 1
    number = np.bincount(at, minlength=edges.size)
    # Bins with too few samples join the following one.
    target, carried, label = np.zeros(edges.size, dtype=int), 0, 0
    for i, count in enumerate(number):
        target[i] = label
        carried += int(count)
        if carried >= LEAST_IN_BIN:
            label, carried = label + 1, 0
    group = target[at]
    count = np.bincount(group)
    kept = count >= LEAST_IN_BIN
    if kept.sum() < FEWEST_BINS:
        return None
    stderr = np.hypot(noise_n / np.sqrt(count), texture_n)
    return Excess(*(column[kept] for column in (*means(group, travel, time, excess), stderr)))


def recover(bins: Excess, running_stderr_n: float, speed_m_s: float) -> Recovery | None:
    """Fit the return to uninterrupted sliding.

    Parameters
    ----------
    bins : Excess
    running_stderr_n : float
        Standard error of the level of uninterrupted sliding.
    speed_m_s : float
        Speed of the restart.

    Returns
    -------
    Recovery or None
        None if the excess at the peak is not distinguishable from zero.
    """
    s, y, sigma = bins.travel_m, bins.excess_n, bins.stderr_n
    first = slice(0, max(2, s.size // 10))
    start = float(np.average(y[first], weights=sigma[first] ** -2))
    if start < SIGNIFICANT * float(np.hypot(sigma[first].min(), running_stderr_n)):
        return None
    freedom = s.size - 3
    coarse = np.geomspace(float(s[0]), 3.0 * float(s[-1]), LENGTHS)
    found = refined(lambda at: _scan(s, y, sigma, at), coarse, LENGTHS, lambda one: one.rise(freedom, 1.0))
    lengths = found.shape[:, 0]
    back = lengths * np.log(1.0 / BACK)
    inside = back[found.inside(found.rise(freedom, 1.0))]
    best, cost, (drop, left) = found.best, float(found.cost[found.best]), found.coefficient[found.best].tolist()
    rest = y - drop * np.exp(-s / lengths[best]) - left
    strange = cost > freedom + 3.0 * np.sqrt(2.0 * freedom)
    exponential = not (strange and float(np.sqrt(np.mean(rest**2))) > MISFIT * start)
    value, low, high, seen = float(back[best]), float(inside.min()), float(inside.max()), float(s[-1])
    if not exponential:
        value, low, high = _by_bins(bins, left)
    complete = high <= seen
    high = high if complete else float("inf")
    level = float(np.hypot(np.sqrt(found.scale(freedom, 1.0) * found.covariance[best, 1, 1]), running_stderr_n))
    reach = student(freedom) * level
    to_time = np.r_[0.0, s], np.r_[0.0, bins.time_s]
    at, early, late, last = (_time(x, *to_time, speed_m_s) for x in (value, low, high, 2 * seen))
    return Recovery(
        distance=Estimate(value, low, high, (min(high, 2 * seen) - low) / 4.0, "m"),
        time=Estimate(at, early, late, (min(late, last) - early) / 4.0, "s"),
        length_m=float(lengths[best]),
        left=Estimate(left, left - reach, left + reach, level, "N", float(freedom)),
        seen_m=seen,
        complete=complete,
        exponential=exponential,
    )


def _scan(s: Array, y: Array, sigma: Array, lengths: Array) -> Scan:
    decay = np.exp(-s[None, :] / lengths[:, None])
    return scan(lengths[:, None], np.stack([decay, np.ones_like(decay)], axis=2) / sigma[None, :, None], y / sigma)


def _by_bins(bins: Excess, left_n: float) -> tuple[float, float, float]:
    """Return the distance from the bins: where the excess falls below 5 % and stays there, with its error."""
    above = bins.excess_n - left_n
    top = float(above[: max(2, above.size // 10)].mean())

    def crossing(shift: float) -> float:
        over = np.flatnonzero(above + shift * bins.stderr_n > BACK * top)
        if not over.size:
            return float(bins.travel_m[0])
        last = int(over[-1])
        return float(bins.travel_m[last + 1]) if last + 1 < above.size else float("inf")

    low, value, high = crossing(-1.0), crossing(0.0), crossing(1.0)
    return min(value, bins.travel_m[-1]), low, max(high, value)


def _time(travel: float, known_m: Array, known_s: Array, speed_m_s: float) -> float:
    """Return the time at a travel; beyond the observed travel at the speed of the move."""
    if not np.isfinite(travel):
        return float("inf")
    beyond = max(travel - float(known_m[-1]), 0.0) / max(speed_m_s, 1e-9)
    return float(np.interp(travel, known_m, known_s)) + beyond
