"""All sliding cycles of a campaign over common positions: one friction, one offset, one force of the air per cycle.

Cycles at high speed need a longer path to settle than slow ones. Friction varies over the path, so means over different
parts differ. The pattern over position is found from all cycles together. Each cycle's mean is then its value over the
common range.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.autocorrelation import stderrs_of_means
from pneudrive.estimate.moderate import moderate
from pneudrive.friction.bins import known_mean
from pneudrive.friction.budget import chance_n, unseen_n
from pneudrive.friction.spread import pair_stderr

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.cycle import CycleData

    Array = NDArray[np.float64]

ITERATIONS = 8
ENOUGH_CYCLES = 4  # least number for a pattern over position
COMMON_SHARE = 0.5  # of the cycles have settled in a bin of the common range
SMALL_FRICTION = 0.2  # of the median: least friction for a relative pattern
FREEDOM_PER_CYCLE = 10.0  # degrees of freedom of the noise of one cycle: independent stretches of about 60 bins


@dataclass(frozen=True, eq=False)
class Reduced:
    """Cycles with both directions, shape (n,) unless said otherwise; N.

    Attributes
    ----------
    data : tuple of CycleData
    speed_m_s : ndarray
        Mean of both directions.
    friction_n, offset_n, air_n : ndarray
        Half the difference and half the sum of the balance; half the difference of the chambers' force, positive
        against the motion.
    friction_stderr_n, offset_stderr_n, air_stderr_n, total_stderr_n : ndarray
        From the cycle alone: scatter of its strokes, at least the noise within them.
    position_m : ndarray, shape (bins,)
    common : ndarray of bool, shape (bins,)
    pattern : ndarray, shape (bins,)
        Friction over its mean in the common range less one; NaN in bins without data.
    offset_pattern_n : ndarray, shape (bins,)
    relative_n : ndarray, shape (n, bins)
        Friction of each cycle over its mean; NaN if nothing has settled.
    coverage : float
        Share of the whole way that the common range covers.
    """

    data: tuple[CycleData, ...]
    speed_m_s: Array
    friction_n: Array
    offset_n: Array
    air_n: Array
    friction_stderr_n: Array
    offset_stderr_n: Array
    air_stderr_n: Array
    total_stderr_n: Array
    position_m: Array
    common: NDArray[np.bool_]
    pattern: Array
    offset_pattern_n: Array
    relative_n: Array
    coverage: float

    @property
    def total_n(self) -> Array:
        """Half the difference of the force sensor's readings, without weight and inertia."""
        return self.friction_n + self.air_n

    @property
    def u_position(self) -> float:
        """Relative standard uncertainty of the common range's mean as an estimate of the whole stroke's mean."""
        return unseen_n(self.pattern[self.common], self.coverage)

    @property
    def u_position_offset_n(self) -> float:
        """The same for half the sum, N."""
        return unseen_n(self.offset_pattern_n[self.common], self.coverage)


def reduce(data: Sequence[CycleData], edges_m: Array, steady: NDArray[np.bool_]) -> Reduced:
    """Bring cycles with both directions to the common range of position.

    Parameters
    ----------
    data : sequence of CycleData
        With both sides.
    edges_m : ndarray, shape (bins + 1,)
    steady : ndarray of bool, shape (n,)
        Cycles used for the pattern: those without stick-slip.
    """
    up = np.array([d.sides[1].balance_n for d in data])
    down = np.array([d.sides[-1].balance_n for d in data])
    air = -np.array([d.sides[1].air_n - d.sides[-1].air_n for d in data]) / 2.0
    friction, offset = (up - down) / 2.0, (up + down) / 2.0
    air = np.where(np.isfinite(friction), air, np.nan)
    covered = np.isfinite(friction)
    tells = steady if steady.sum() >= ENOUGH_CYCLES else np.ones(len(data), dtype=bool)
    common: NDArray[np.bool_] = np.asarray(covered[tells].mean(axis=0) >= COMMON_SHARE)
    if not common.any():
        common = np.asarray(covered.any(axis=0))
    pattern = _relative_pattern(friction[tells], common)
    offset_pattern = _additive_pattern(offset[tells], common)
    mean_friction = _relative_means(friction, pattern, common)
    mean_offset = _additive_means(offset, offset_pattern, common)
    air_pattern = _additive_pattern(air[tells], common)
    mean_air = _additive_means(air, air_pattern, common)
    speed = np.array([(d.sides[1].velocity_m_s - d.sides[-1].velocity_m_s) / 2.0 for d in data])
    spare = np.sqrt(tells.sum() / max(tells.sum() - 1.0, 1.0)) if tells.sum() >= ENOUGH_CYCLES else 1.0
    rest = friction - mean_friction[:, None] * (1.0 + np.nan_to_num(pattern))
    rest_air = air - mean_air[:, None] - np.nan_to_num(air_pattern)
    rests = (rest, offset - mean_offset[:, None] - np.nan_to_num(offset_pattern), rest_air, rest + rest_air)
    scatter = np.array([pair_stderr(d.sides[1].spread, d.sides[-1].spread) for d in data])
    # The scatter of strokes is that of the balance: the air's force alone has only its noise.
    scatters = (scatter, scatter, np.full(len(data), np.nan), scatter)
    stderrs = [_by_chance(own, spare * r, common, speed) for own, r in zip(scatters, rests, strict=True)]
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = friction / mean_friction[:, None]
    return Reduced(
        data=tuple(data),
        speed_m_s=speed,
        friction_n=mean_friction,
        offset_n=mean_offset,
        air_n=mean_air,
        friction_stderr_n=stderrs[0],
        offset_stderr_n=stderrs[1],
        air_stderr_n=stderrs[2],
        total_stderr_n=stderrs[3],
        position_m=(edges_m[:-1] + edges_m[1:]) / 2.0,
        common=common,
        pattern=np.where(covered.any(axis=0), pattern, np.nan),
        offset_pattern_n=offset_pattern,
        relative_n=relative,
        coverage=float(common.mean()),
    )


def _relative_pattern(values: Array, common: NDArray[np.bool_]) -> Array:
    """Return the relative deviation from the mean of each row, mean over rows; zero with too few rows."""
    bins = values.shape[1]
    level = _additive_means(values, np.zeros(bins), common)
    if values.shape[0] < ENOUGH_CYCLES or level.min() < SMALL_FRICTION * np.median(level):
        return np.zeros(bins)
    pattern = np.zeros(bins)
    for _ in range(ITERATIONS):
        level = _relative_means(values, pattern, common)
        pattern = known_mean(values / level[:, None], axis=0) - 1.0
        pattern = np.nan_to_num(pattern - pattern[common].mean())
    return pattern


def _additive_pattern(values: Array, common: NDArray[np.bool_]) -> Array:
    pattern = np.zeros(values.shape[1])
    if values.shape[0] < ENOUGH_CYCLES:
        return pattern
    for _ in range(ITERATIONS):
        pattern = known_mean(values - _additive_means(values, pattern, common)[:, None], axis=0)
        pattern = np.nan_to_num(pattern - pattern[common].mean())
    return pattern


def _relative_means(values: Array, pattern: Array, common: NDArray[np.bool_]) -> Array:
    """Return the mean of each row over the common bins, with missing bins filled from the pattern."""
    here = np.isfinite(values) & _used(values, common)
    total = np.where(here, values, 0.0).sum(axis=1)
    return total / (here * (1.0 + pattern)).sum(axis=1)


def _additive_means(values: Array, pattern: Array, common: NDArray[np.bool_]) -> Array:
    here = np.isfinite(values) & _used(values, common)
    total = (np.where(here, values, 0.0) - here * pattern).sum(axis=1)
    return total / here.sum(axis=1)


def _used(values: Array, common: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the common bins; all bins in a row without them."""
    has = np.asarray((np.isfinite(values) & common).any(axis=1))
    return np.where(has[:, None], common[None, :], True)


def _by_chance(scatter: Array, rest: Array, common: NDArray[np.bool_], speed: Array) -> Array:
    """Return `chance_n` of each row's mean, shrunk towards its trend over speed."""
    used = _used(rest, common) & np.isfinite(rest)
    count, own = used.sum(axis=1), np.zeros(rest.shape[0])
    for number in np.unique(count[count > 0]).tolist():
        members = count == number
        own[members] = stderrs_of_means(rest[members][used[members]].reshape(-1, number))
    own = chance_n(scatter, own)
    known = own > 0.0
    if known.sum() < ENOUGH_CYCLES:
        return own
    out = own.copy()
    out[known] = np.sqrt(moderate(own[known] ** 2, np.full(int(known.sum()), FREEDOM_PER_CYCLE), speed[known]))
    return out
