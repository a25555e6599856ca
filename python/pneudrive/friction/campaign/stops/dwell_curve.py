"""Breakaway increment against stop duration without a law: a curve over the logarithm of the duration.

  y = level_c + slope_c u + bend + place + drift + block + block slope + scatter,   u = log10(stop duration)

at each condition c. The bend is smooth over u (a slow and a quicker part), and partly common to all conditions. The
bend, the blocks, their slopes and the scatter between cycles are random effects. Results are averages over the possible
sizes of these effects (`pneudrive.estimate.mixed`). Intervals therefore cover the choice of the law as well as the
scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.groups import cells, levels
from pneudrive.estimate.mixed import Functionals, MixedFit, MixedModel, RandomEffect, independent
from pneudrive.estimate.splines import gaussian

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.friction.conditions import Condition

    Array = NDArray[np.float64]

#: Correlation length of the bends in decades (the known laws turn within one or two), and their prior size as a
#: share of the swing of the increments (assumed; chosen by the coverage of simulated campaigns under six laws).
BENDS = {"quick bend": (0.6, 0.05), "slow bend": (1.5, 0.2)}
#: Share of the bend that conditions have in common: ageing at one pressure resembles that at another.
COMMON_BEND = 0.8
#: The scatter's variance grows with the increment, between these multiples of the mean one.
GROWTH_RANGE = (0.25, 4.0)
#: Least number of blocks for the scatter of their slopes.
BLOCKS_FOR_SLOPES = 3
#: Variance inflation of the slope by drift above which the two cannot be separated.
CONFOUNDED = 5.0
#: Durations within this many decades (2 %) count as one.
SAME_DURATION = 0.0086
#: Huber's constant for outlying stops, and number of updates of their weights.
HUBER_K, ROUNDS = 2.5, 3
LEAST_FREEDOM = 2
#: Number of stops beyond the unknowns above which places and drift are unknowns too.
SPARE_FOR_PLACES, SPARE_FOR_DRIFT = 4, 6


@dataclass(frozen=True, eq=False)
class DwellData:
    """Stops of one series, shape (n,) each.

    Attributes
    ----------
    key : tuple of str
    duration_s, increment_n, stderr_n : ndarray
        stderr_n comes from noise within the cycle.
    condition : ndarray of int
        Index into `conditions`.
    place : ndarray of int
        Direction and position of the stop: places differ by a constant.
    began_s : ndarray
        The rig's clock.
    block : ndarray of int
    conditions : tuple of Condition
    drift_prior_n : float
        Standard deviation of the increments' drift over half the campaign if the order of the stops hides it.
    """

    key: tuple[str, ...]
    duration_s: Array
    increment_n: Array
    stderr_n: Array
    condition: NDArray[np.int64]
    place: NDArray[np.int64]
    began_s: Array
    block: NDArray[np.int64]
    conditions: tuple[Condition, ...]
    drift_prior_n: float = 0.0

    @property
    def log_s(self) -> Array:
        """Decadic logarithm of the duration."""
        return np.log10(self.duration_s)

    @property
    def durations(self) -> int:
        """Largest number of different durations at a condition."""
        level = levels(self.log_s, SAME_DURATION)
        return max(np.unique(level[self.condition == c]).size for c in range(len(self.conditions)))

    def __len__(self) -> int:
        """Return the number of stops."""
        return self.duration_s.size


@dataclass(frozen=True, eq=False)
class DwellCurve:
    """The fitted curve.

    Attributes
    ----------
    data : DwellData
    fit : MixedFit
    centre : float
        log10 duration of the levels.
    extra : ndarray, shape (n, .)
        Fixed columns in addition to levels and slopes: positions, drift.
    inflation : float
        Variance inflation of the slope by drift.
    weight : ndarray, shape (n,)
        Huber's weight of each stop; below 1 for an outlying stop.
    """

    data: DwellData
    fit: MixedFit
    centre: float
    extra: Array
    inflation: float
    weight: Array

    def values(self, log_s: Array) -> Functionals:
        """Return the increment at log10 durations, N; condition by condition."""
        return self._functionals(log_s, derivative=False)

    def slopes(self, log_s: Array) -> Functionals:
        """Return the slope per decade at log10 durations, N."""
        return self._functionals(log_s, derivative=True)

    def gains(self, low: float, high: float) -> Functionals:
        """Return the mean slope per decade between two log10 durations, at each condition."""
        row = np.array([[-1.0, 1.0]]) / (high - low)
        rows = np.kron(np.eye(len(self.data.conditions)), row)
        return self.values(np.array([low, high])).combine(rows.astype(np.float64))

    def scatter_covariance(self) -> Array:
        """Return the covariance of the stops without the bends, shape (n, n): for the comparison of laws."""
        model = self.fit.model
        kept = [i for i, c in enumerate(model.components) if c.name not in BENDS]
        part = replace(model, components=tuple(model.components[i] for i in kept))
        return part.covariance(self.fit.sd[kept])

    def _functionals(self, log_s: Array, *, derivative: bool) -> Functionals:
        conditions = len(self.data.conditions)
        of, at = np.repeat(np.arange(conditions), log_s.size), np.tile(log_s, conditions)
        rows, fixed = np.arange(of.size), np.zeros((of.size, self.fit.model.x.shape[1]))
        fixed[rows, of] = 0.0 if derivative else 1.0
        fixed[rows, conditions + of] = 1.0 if derivative else at - self.centre
        with_stops = np.where(of[:, None] == self.data.condition[None, :], 1.0, COMMON_BEND)
        with_each = np.where(of[:, None] == of[None, :], 1.0, COMMON_BEND)
        cross, own = {}, {}
        for name, (length, _) in BENDS.items():
            k, z = gaussian(at, self.data.log_s, length), gaussian(at, at, length)
            if derivative:
                away = (at[:, None] - at[None, :]) / length
                k = -k * (at[:, None] - self.data.log_s[None, :]) / length**2
                z = z * (1.0 - away * away) / length**2
            cross[name], own[name] = k * with_stops, z * with_each
        return Functionals(self.fit, fixed, cross, own)


def fit_curve(data: DwellData) -> DwellCurve | None:
    """Fit the curve; None if too few stops are left to estimate the scatter.

    Parameters
    ----------
    data : DwellData
        At least two durations at each condition.
    """
    n, conditions = len(data), len(data.conditions)
    u, rows = data.log_s, np.arange(n)
    centre = float(u.mean())
    x = np.zeros((n, 2 * conditions))
    x[rows, data.condition] = 1.0
    x[rows, conditions + data.condition] = u - centre
    if n - x.shape[1] < LEAST_FREEDOM:
        return None
    extra, hidden, inflation = _places_and_drift(data, x)
    x = np.c_[x, extra]
    components = _components(data, x, hidden)
    weight = np.ones(n)
    curve = None
    for _ in range(ROUNDS):
        scatter = replace(components[0], kernel=components[0].kernel / weight)
        model = MixedModel(data.increment_n, x, data.stderr_n**2 / weight, (scatter, *components[1:]))
        curve = DwellCurve(data, model.fit(), centre, extra, inflation, weight)
        away = _standardised(curve)
        updated = np.minimum(1.0, HUBER_K / np.maximum(away, 1e-12))
        if np.allclose(updated, weight, atol=0.02):
            break
        weight = updated
    return curve


def _places_and_drift(data: DwellData, x: Array) -> tuple[Array, Array, float]:
    """Return fixed columns of places and drift, the column of a hidden drift, and its variance inflation."""
    n = len(data)
    names, member = np.unique(data.place, return_inverse=True)
    extra = (member[:, None] == np.arange(names.size)[None, :]).astype(float) - 1.0 / names.size
    extra = extra[:, independent(np.c_[x, extra])[x.shape[1] :] - x.shape[1]]
    if n - x.shape[1] - extra.shape[1] < SPARE_FOR_PLACES:
        extra = np.zeros((n, 0))
    spare = n - x.shape[1] - extra.shape[1]
    time = data.began_s - data.began_s.mean()
    if np.ptp(time) == 0:
        return extra, np.zeros((n, 0)), 1.0
    drift = (time / np.abs(time).max())[:, None]
    inflation = _inflation(np.c_[x, extra], len(data.conditions), drift)
    if inflation < CONFOUNDED and spare > SPARE_FOR_DRIFT:
        return np.c_[extra, drift], np.zeros((n, 0)), inflation
    return extra, drift * data.drift_prior_n if data.drift_prior_n > 0 else np.zeros((n, 0)), inflation


def _inflation(x: Array, conditions: int, drift: Array) -> float:
    """Return the factor on the variance of the mean slope with drift as a further unknown."""
    wanted = np.zeros(x.shape[1])
    wanted[conditions : 2 * conditions] = 1.0 / conditions
    both = np.c_[x, drift]
    if np.linalg.matrix_rank(both) < both.shape[1]:
        return float("inf")
    before = wanted @ np.linalg.pinv(x.T @ x) @ wanted
    wider = np.r_[wanted, 0.0]
    return float(wider @ np.linalg.inv(both.T @ both) @ wider / max(before, 1e-300))


def _components(data: DwellData, x: Array, hidden: Array) -> tuple[RandomEffect, ...]:
    """Return the sources of scatter; the scatter from stop to stop comes first."""
    y, u = data.increment_n, data.log_s
    line = np.abs(x @ np.linalg.lstsq(x, y, rcond=None)[0])
    size = np.clip(line / max(float(line.mean()), 1e-300), *GROWTH_RANGE)
    tau = _first_scatter(data, x)
    swing = max(float(np.ptp(line)), tau)
    out = [RandomEffect("scatter", size / size.mean(), tau)]
    if data.durations > 2:
        share = np.where(data.condition[:, None] == data.condition[None, :], 1.0, COMMON_BEND)
        out += [
            RandomEffect(name, gaussian(u, u, length) * share, swing * size) for name, (length, size) in BENDS.items()
        ]
    names, member = np.unique(data.block, return_inverse=True)
    if names.size > 1:
        same = (member[:, None] == member[None, :]).astype(float)
        out.append(RandomEffect("block", same, tau))
        if names.size >= BLOCKS_FOR_SLOPES:
            away = (u - u.mean()) / max(float(u.std()), 1e-9)
            out.append(RandomEffect("block slope", same * np.outer(away, away), tau))
    if hidden.shape[1]:
        out.append(RandomEffect("drift", hidden @ hidden.T, 1.0))
    return tuple(out)


def _first_scatter(data: DwellData, x: Array) -> float:
    """Return a first estimate of the scatter beyond noise: within equal stops, otherwise about lines."""
    y = data.increment_n
    cell = cells(data.condition, levels(data.log_s, SAME_DURATION))
    counts = np.bincount(cell)
    repeats = int((counts - 1).sum())
    if repeats >= 3:
        total = float(((y - (np.bincount(cell, y) / counts)[cell]) ** 2).sum() / repeats)
    else:
        rest = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
        total = float(rest @ rest) / max(y.size - x.shape[1], 1)
    noise = float(np.mean(data.stderr_n**2))
    return float(np.sqrt(max(total - noise, 0.05 * total, 0.05 * noise, 1e-18 * float(y @ y), 1e-300)))


def _standardised(curve: DwellCurve) -> Array:
    """Return the distance of each stop from curve and blocks, in standard deviations of the stop."""
    model, weight = curve.fit.model, curve.weight
    scatter = model.components[0]
    own = (model.noise + curve.fit.sd[0] ** 2 * scatter.kernel) * weight
    solved = np.linalg.solve(model.covariance(curve.fit.sd), model.y - model.x @ curve.fit.states[0].beta)
    return np.abs(own / weight * solved) / np.sqrt(np.maximum(own, 1e-300))
