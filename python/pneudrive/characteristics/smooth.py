"""Curves over speed with the chance that lies between cycles: a smoothing spline inside a mixed model.

A curve is a line and a deviation from it that is as smooth as the data say: an integrated Wiener process, whose
estimate is the cubic smoothing spline and whose posterior gives the band [wahba1983]. Curves of one campaign share
their shape as far as the data say so. Smoothness is meant over a stretched speed, in which the Stribeck part
(decades) and the viscous part (proportion) both bend slowly.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.mixed import MixedFit, MixedModel, Predicted, RandomEffect, independent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.estimate.estimates import Estimate

    Array = NDArray[np.float64]

#: Speed from which on a stretched speed grows with speed itself; below, with its logarithm (assumed).
PROPORTIONAL_FROM_M_S = 0.1
CYCLE_SCALE = 0.02  # of the response: standard deviations that are usual from cycle to cycle, block to block, in drift
#: Stretched speed over which a curve may leave the common shape by itself: a factor of 7 at low speed, about the width
#: of a Stribeck fall (assumed).
LOCAL_REACH = 2.0
#: Power of a standard deviation with which its prior falls towards zero: a few sentinels that happen to agree do not
#: make a rig that repeats perfectly, least of all where a curve may follow each of its points (assumed).
FEW_AGREE = 4.0
LEAST_FRICTION = 0.1  # over the mean friction, below which chance in proportion to it falls no further (assumed)
CARRIED = 0.98  # share of a drift that the curves could take for their own, beyond which the design does not carry it
CURVE_DEGREE = 5  # polynomials in stretched speed that stand for all curves in that question


def stretched(speed_m_s: Array, lowest_m_s: float) -> Array:
    """Stretched speed: logarithmic at low, proportional at high speed; zero at the lowest.

    Examples
    --------
    >>> stretched(np.array([1e-3, 1e-2]), 1e-3).round(3).tolist()
    [0.0, 2.393]
    """
    speed = np.maximum(np.asarray(speed_m_s, dtype=float), 1e-12)
    return np.log(speed / lowest_m_s) + (speed - lowest_m_s) / PROPORTIONAL_FROM_M_S


@dataclass(frozen=True, eq=False)
class CurveData:
    """Observations of curves, shape (n,) each.

    Attributes
    ----------
    y, noise : ndarray
        Response and the variance of its noise within the cycle.
    speed_m_s : ndarray
        NaN where an observation lies on no curve: a tare, which shows the zero alone.
    curve : ndarray of int
        Which curve, from 0; -1: none.
    order : ndarray
        Place of the cycle in the campaign, 0 to 1.
    count : ndarray
        Cycles that an observation is the mean of.
    chance : ndarray
        Standard deviation of a cycle over that at the mean friction: 1 everywhere where it is the same, in the unit of
        the response, at all frictions.
    """

    y: Array
    noise: Array
    speed_m_s: Array
    curve: NDArray[np.int64]
    order: Array
    count: Array
    chance: Array

    def __len__(self) -> int:
        return self.y.size


@dataclass(frozen=True, eq=False)
class CurveFit:
    """Fitted curves.

    Attributes
    ----------
    data : CurveData
    fit : MixedFit
    logarithmic : bool
        The response is the logarithm: curves share their shape, blocks and drift act, in proportion to friction.
    relative : float
        Probability that a cycle's own chance is in proportion to friction, not the same in newton at all frictions.
    sources : tuple of str
        Names of the components of chance that the design carries.
    drift : ndarray, shape (n,)
        Best estimate of the drift at each observation, mean zero.
    drift_half : ndarray, shape (n,)
        Half of its 95 % interval.
    """

    data: CurveData
    fit: MixedFit
    logarithmic: bool
    relative: float
    sources: tuple[str, ...]
    drift: Array
    drift_half: Array
    known: dict[tuple[int, bytes], Predicted] = field(default_factory=dict)  # asked for before

    def at(self, curve: int, speed_m_s: Array) -> Predicted:
        """Curve at these speeds, in the unit of the response (its logarithm where `logarithmic`)."""
        key = (curve, speed_m_s.tobytes())
        if key not in self.known:
            self.known[key] = self._at(curve, speed_m_s)
        return self.known[key]

    def _at(self, curve: int, speed_m_s: Array) -> Predicted:
        basis = _Basis.of(self.data)
        number = np.full(speed_m_s.size, curve, dtype=np.int64)
        x = basis.fixed(speed_m_s, number, observed=False)[:, basis.kept]
        kernels, prior = basis.kernels(speed_m_s, number)
        names = [c.name for c in self.fit.model.components]
        return self.fit.predict(
            x, {k: v for k, v in kernels.items() if k in names}, {k: v for k, v in prior.items() if k in names}
        )

    def mean_at(self, curve: int, speed_m_s: Array, unit: str = "N") -> Estimate:
        """Mean of a curve over these speeds, in the unit of the response."""
        basis = _Basis.of(self.data)
        number = np.full(speed_m_s.size, curve, dtype=np.int64)
        x = basis.fixed(speed_m_s, number, observed=False)[:, basis.kept].mean(axis=0, keepdims=True)
        names = [c.name for c in self.fit.model.components]
        kernels, own = basis.kernels(speed_m_s, number)[0], basis.between(speed_m_s)
        found = self.fit.predict(
            x,
            {k: v.mean(axis=0, keepdims=True) for k, v in kernels.items() if k in names},
            {k: np.array([v.mean()]) for k, v in own.items() if k in names},
        )
        return found.estimates(unit)[0]

    def sd(self, name: str) -> float:
        """Most probable standard deviation of a component; 0 where there is none."""
        names = [c.name for c in self.fit.model.components]
        return float(self.fit.sd[names.index(name)]) if name in names else 0.0

    def steady(self) -> Array:
        """Curves at the observations, in the unit of the response, shape (n,); NaN for those on no curve."""
        found = np.full(len(self.data), np.nan)
        for number in range(int(self.data.curve.max()) + 1):
            members = self.data.curve == number
            found[members] = self.at(number, self.data.speed_m_s[members]).mean
        return found


@dataclass(frozen=True, eq=False)
class _Basis:
    """Columns and kernels of the curves."""

    data: CurveData
    lowest: float
    width: float
    curves: int
    kept: NDArray[np.intp]

    @classmethod
    def of(cls, data: CurveData) -> _Basis:
        on = data.curve >= 0
        lowest = float(data.speed_m_s[on].min())
        width = max(float(stretched(data.speed_m_s[on], lowest).max()), 1e-6)
        basis = cls(data, lowest, width, int(data.curve.max()) + 1, np.zeros(0, dtype=np.intp))
        kept = independent(basis.fixed(data.speed_m_s, data.curve, observed=True))
        return cls(data, lowest, width, basis.curves, kept)

    def place(self, speed_m_s: Array) -> Array:
        """Stretched speed from 0 to 1 over the measured range."""
        return np.nan_to_num(stretched(speed_m_s, self.lowest) / self.width)

    def fixed(self, speed_m_s: Array, curve: NDArray[np.int64], *, observed: bool) -> Array:
        """One level per curve, a common slope, and the zero where there is one: seen, but no part of a curve."""
        levels = (curve[:, None] == np.arange(self.curves)[None, :]).astype(float)
        slope = np.where(curve >= 0, self.place(speed_m_s) - 0.5, 0.0)
        zero = np.full((curve.size, int((self.data.curve < 0).any())), float(observed))
        return np.column_stack([zero, levels, slope])

    def kernels(self, speed_m_s: Array, curve: NDArray[np.int64]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Covariance with the observations, and own variance, of the smooth deviations."""
        own, seen = self.place(speed_m_s), self.place(self.data.speed_m_s)
        on = (curve >= 0)[:, None] & (self.data.curve >= 0)[None, :]
        same = on & (curve[:, None] == self.data.curve[None, :])
        bend = _integrated_wiener(own, seen)
        tilt = 3.0 * (own - 0.5)[:, None] * (seen - 0.5)[None, :]
        common = {"shape": bend * on}
        prior = {"shape": own**3}
        if self.curves > 1:
            common["own shape"] = (bend + tilt) * same
            prior["own shape"] = own**3 + 3.0 * (own - 0.5) ** 2
            common["local"] = _local(own * self.width, seen * self.width) * same
            prior["local"] = np.ones(own.size)
        return common, prior

    def between(self, speed_m_s: Array) -> dict[str, Array]:
        """Covariance of the smooth deviations of one curve between these speeds, shape (m, m)."""
        own = self.place(speed_m_s)
        bend = _integrated_wiener(own, own)
        local = _local(own * self.width, own * self.width)
        return {"shape": bend, "own shape": bend + 3.0 * np.outer(own - 0.5, own - 0.5), "local": local}


def _local(s: Array, t: Array) -> Array:
    """Covariance of a deviation that is smooth over `LOCAL_REACH` and forgets itself beyond (Matern 3/2)."""
    away = np.sqrt(3.0) * np.abs(s[:, None] - t[None, :]) / LOCAL_REACH
    return (1.0 + away) * np.exp(-away)


def _integrated_wiener(s: Array, t: Array) -> Array:
    """Covariance of an integrated Wiener process with variance 1 at 1, shape (m, n)."""
    low = np.minimum(s[:, None], t[None, :])
    high = np.maximum(s[:, None], t[None, :])
    return low**2 * (3.0 * high - low) / 2.0


def carried_drift(data: CurveData) -> float:
    """Share of a steady drift that curves could take for their own: 1 where order and speed are one thing."""
    on = data.curve >= 0
    if on.sum() < 3 or np.ptp(data.order[on]) == 0:
        return 1.0
    basis = _Basis.of(data)
    place = basis.place(data.speed_m_s[on])
    curve = data.curve[on]
    speeds = np.unique(np.round(np.log(data.speed_m_s[on]), 2)).size
    degree = min(CURVE_DEGREE, speeds - 1)
    levels = (curve[:, None] == np.arange(basis.curves)[None, :]).astype(float)
    columns = np.hstack([levels * place[:, None] ** k for k in range(degree + 1)])
    time = data.order[on]
    left = time - columns @ np.linalg.lstsq(columns, time, rcond=None)[0]
    away = time - time.mean()
    return 1.0 - float(left @ left) / float(away @ away)


def fit_curves(data: CurveData, *, logarithmic: bool, drift: bool, blocks: Array | None = None) -> CurveFit:
    """Fit all curves of a campaign.

    Parameters
    ----------
    data : CurveData
        With logarithms in `y` where `logarithmic`.
    logarithmic : bool
    drift : bool
        Whether the design carries a drift (see `carried_drift`).
    blocks : ndarray, shape (n, blocks), optional
        Share of each block (or day) in each observation, where the design carries their own deviations.
    """
    fit = curve_model(data, logarithmic=logarithmic, drift=drift, blocks=blocks).fit()
    return _described(data, fit, logarithmic=logarithmic, relative=float(logarithmic))


def _described(data: CurveData, fit: MixedFit, *, logarithmic: bool, relative: float) -> CurveFit:
    components, x = fit.model.components, fit.model.x
    names = tuple(c.name for c in components if c.name in {"cycle", "drift", "block"})
    estimate, half = np.zeros(len(data)), np.zeros(len(data))
    if "drift" in names:
        kernel = components[[c.name for c in components].index("drift")].kernel
        found = fit.predict(np.zeros((len(data), x.shape[1])), {"drift": kernel}, {"drift": np.diag(kernel)})
        estimate, half = found.mean, found.half_width()
    return CurveFit(data, fit, logarithmic, relative, names, estimate, half)


def either_chance(fitted: CurveFit, blocks: Array | None) -> CurveFit:
    """Average over both ways in which a cycle's own chance may act, in newton and in proportion to friction.

    Which response describes the curves better, friction or its logarithm, is one question; how cycles scatter is
    another, and few cycles answer it: what they leave open has to be in the band.

    Parameters
    ----------
    fitted : CurveFit
        With a chance that is the same at all frictions in the unit of its response; of positive friction.
    blocks : ndarray, optional
        As in `fit_curves`.
    """
    steady = np.exp(fitted.steady()) if fitted.logarithmic else fitted.steady()
    share = np.maximum(steady / steady.mean(), LEAST_FRICTION)
    data = replace(fitted.data, chance=1.0 / share if fitted.logarithmic else share)
    other = curve_model(data, logarithmic=fitted.logarithmic, drift="drift" in fitted.sources, blocks=blocks).fit()
    fit, (weight,) = fitted.fit.averaged(other)
    relative = 1.0 - weight if fitted.logarithmic else weight
    return _described(fitted.data, fit, logarithmic=fitted.logarithmic, relative=relative)


def with_doubt(fitted: CurveFit, readings: Sequence[NDArray[np.intp]], spread: float, odds: float) -> CurveFit:
    """Average over several readings of doubtful cycles: that they count as all others do, or that some tell little.

    Parameters
    ----------
    fitted : CurveFit
        In which all of them count.
    readings : sequence of ndarray of int
        Rows of its data that tell little, of each other reading.
    spread : float
        Standard deviation of a cycle that tells little, in the unit of the response.
    odds : float
        That a cycle tells little, before the data are seen.
    """
    model = fitted.fit.model
    others = []
    for rows in readings:
        little = np.zeros(len(fitted.data))
        little[rows] = spread**2
        others.append(replace(model, noise=model.noise + little).fit())
    fit, _ = fitted.fit.averaged(*others, odds=[odds**rows.size for rows in readings])
    return _described(fitted.data, fit, logarithmic=fitted.logarithmic, relative=fitted.relative)


def curve_model(data: CurveData, *, logarithmic: bool, drift: bool, blocks: Array | None = None) -> MixedModel:
    """Give the model that `fit_curves` fits."""
    basis = _Basis.of(data)
    on = data.curve >= 0
    spread = max(float(np.std(data.y[on])), 1e-9 * float(np.abs(data.y[on]).max() + 1e-12), 1e-12)
    usual = CYCLE_SCALE if logarithmic else CYCLE_SCALE * max(float(np.abs(data.y[on]).mean()), spread)
    kernels, _ = basis.kernels(data.speed_m_s, data.curve)
    components = [RandomEffect("shape", kernels["shape"], 5.0 * spread)]
    if "own shape" in kernels:
        components.append(RandomEffect("own shape", kernels["own shape"], spread))
        components.append(RandomEffect("local", kernels["local"], usual))
    components.append(RandomEffect("cycle", on * data.chance**2 / data.count, usual, power=FEW_AGREE))
    if drift:
        components.append(RandomEffect("drift", centred_walk(data.order), usual))
    if blocks is not None:
        components.append(RandomEffect("block", blocks @ blocks.T, usual))
    x = basis.fixed(data.speed_m_s, data.curve, observed=True)[:, basis.kept]
    return MixedModel(data.y, x, data.noise, tuple(components))


def centred_walk(order: Array) -> Array:
    """Covariance of a random walk over the campaign, less its mean over the observations."""
    walk = np.minimum(order[:, None], order[None, :])
    walk = walk - walk.mean(axis=0, keepdims=True)
    return walk - walk.mean(axis=1, keepdims=True)
