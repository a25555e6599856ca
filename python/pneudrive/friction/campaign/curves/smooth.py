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

from pneudrive.estimate.mixed import Functionals, MixedFit, MixedModel, Predicted, RandomEffect, independent
from pneudrive.estimate.splines import centred_walk, integrated_wiener, matern

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

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
    """Observations of curves, shape (n,) each, and what may act on them beside the curves.

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
    blocks : ndarray, shape (n, blocks), or None
        Share of each block (or day) in each observation, where the design carries their own deviations.
    drift : bool
        Whether the design carries a drift (see `carried_drift`).
    logarithmic : bool
        The response is the logarithm: curves share their shape, blocks and drift act, in proportion to friction.
    """

    y: Array
    noise: Array
    speed_m_s: Array
    curve: NDArray[np.int64]
    order: Array
    count: Array
    chance: Array
    blocks: Array | None = None
    drift: bool = True
    logarithmic: bool = False

    def __len__(self) -> int:
        return self.y.size

    @property
    def level(self) -> float:
        """Median size of the response, 1 where it is a logarithm: what shares of friction are taken of."""
        return 1.0 if self.logarithmic else float(np.median(np.abs(self.y)))

    def part(self, rows: NDArray[np.intp]) -> CurveData:
        """Take some observations."""
        arrays = {name: values[rows] for name, values in vars(self).items() if isinstance(values, np.ndarray)}
        return replace(self, **arrays)

    def logarithms(self) -> CurveData:
        """Take the logarithm of a positive response."""
        return replace(self, y=np.log(self.y), noise=self.noise / self.y**2, logarithmic=True)


@dataclass(frozen=True, eq=False)
class CurveFit:
    """Fitted curves.

    Attributes
    ----------
    data : CurveData
    fit : MixedFit
    relative : float
        Probability that a cycle's own chance is in proportion to friction, not the same in newton at all frictions.
    drift : ndarray, shape (n,)
        Best estimate of the drift at each observation, mean zero.
    drift_half : ndarray, shape (n,)
        Half of its 95 % interval.
    """

    data: CurveData
    fit: MixedFit
    relative: float
    drift: Array
    drift_half: Array
    known: dict[tuple[int, bytes], Predicted] = field(default_factory=dict)  # asked for before

    @property
    def logarithmic(self) -> bool:
        """The response is the logarithm of friction."""
        return self.data.logarithmic

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the sources of chance that the design carries."""
        return tuple(c.name for c in self.fit.model.components if c.name in {"cycle", "drift", "block"})

    def at(self, curve: int, speed_m_s: Array) -> Predicted:
        """Curve at these speeds, in the unit of the response (its logarithm where `logarithmic`)."""
        key = (curve, speed_m_s.tobytes())
        if key not in self.known:
            self.known[key] = self.over(curve, speed_m_s).predict()
        return self.known[key]

    def over(self, curve: int, speed_m_s: Array) -> Functionals:
        """Curve at these speeds as linear functions of the model."""
        basis = _Basis.of(self.data)
        number = np.full(speed_m_s.size, curve, dtype=np.int64)
        fixed = basis.fixed(speed_m_s, number, observed=False)[:, basis.kept]
        own = basis.kernels((speed_m_s, number), (speed_m_s, number))
        return Functionals(self.fit, fixed, basis.with_data(speed_m_s, number), own)

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
        return replace(basis, kept=independent(basis.fixed(data.speed_m_s, data.curve, observed=True)))

    def place(self, speed_m_s: Array) -> Array:
        """Stretched speed from 0 to 1 over the measured range."""
        return np.nan_to_num(stretched(speed_m_s, self.lowest) / self.width)

    def fixed(self, speed_m_s: Array, curve: NDArray[np.int64], *, observed: bool) -> Array:
        """One level per curve, a common slope, and the zero where there is one: seen, but no part of a curve."""
        levels = (curve[:, None] == np.arange(self.curves)[None, :]).astype(float)
        slope = np.where(curve >= 0, self.place(speed_m_s) - 0.5, 0.0)
        zero = np.full((curve.size, int((self.data.curve < 0).any())), float(observed))
        return np.column_stack([zero, levels, slope])

    def with_data(self, speed_m_s: Array, curve: NDArray[np.int64]) -> dict[str, Array]:
        """Covariance of the smooth deviations with the observations'."""
        return self.kernels((speed_m_s, curve), (self.data.speed_m_s, self.data.curve))

    def kernels(
        self, first: tuple[Array, NDArray[np.int64]], second: tuple[Array, NDArray[np.int64]]
    ) -> dict[str, Array]:
        """Covariance of the smooth deviations between speeds on curves."""
        (s, i), (t, j) = first, second
        s, t = self.place(s), self.place(t)
        on = (i >= 0)[:, None] & (j >= 0)[None, :]
        bend = integrated_wiener(s, t)
        found = {"shape": bend * on}
        if self.curves > 1:
            same = on & (i[:, None] == j[None, :])
            found["own shape"] = (bend + 3.0 * (s - 0.5)[:, None] * (t - 0.5)[None, :]) * same
            found["local"] = matern(s * self.width, t * self.width, LOCAL_REACH) * same
        return found


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


def fit_curves(data: CurveData) -> CurveFit:
    """Fit all curves of a campaign."""
    return _described(data, curve_model(data).fit(), relative=float(data.logarithmic))


def _described(data: CurveData, fit: MixedFit, relative: float) -> CurveFit:
    walk = {c.name: c.kernel for c in fit.model.components if c.name == "drift"}
    nothing = np.zeros((len(data), fit.model.x.shape[1]))
    found = fit.predict(nothing, walk, {name: np.diag(kernel) for name, kernel in walk.items()})
    return CurveFit(data, fit, relative, found.mean, found.half_width())


def either_chance(fitted: CurveFit) -> CurveFit:
    """Average over both ways in which a cycle's own chance may act, in newton and in proportion to friction.

    Which response describes the curves better, friction or its logarithm, is one question; how cycles scatter is
    another, and few cycles answer it: what they leave open has to be in the band.

    Parameters
    ----------
    fitted : CurveFit
        With a chance that is the same at all frictions in the unit of its response; of positive friction.
    """
    steady = np.exp(fitted.steady()) if fitted.logarithmic else fitted.steady()
    share = np.maximum(steady / steady.mean(), LEAST_FRICTION)
    data = replace(fitted.data, chance=1.0 / share if fitted.logarithmic else share)
    fit, (weight,) = fitted.fit.averaged(curve_model(data).fit())
    return _described(fitted.data, fit, 1.0 - weight if fitted.logarithmic else weight)


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
    return _described(fitted.data, fit, fitted.relative)


def curve_model(data: CurveData) -> MixedModel:
    """Give the model that `fit_curves` fits."""
    basis = _Basis.of(data)
    on = data.curve >= 0
    spread = max(float(np.std(data.y[on])), 1e-9 * float(np.abs(data.y[on]).max() + 1e-12), 1e-12)
    usual = CYCLE_SCALE if data.logarithmic else CYCLE_SCALE * max(float(np.abs(data.y[on]).mean()), spread)
    scales = {"shape": 5.0 * spread, "own shape": spread, "local": usual}
    kernels = basis.with_data(data.speed_m_s, data.curve)
    components = [RandomEffect(name, kernel, scales[name]) for name, kernel in kernels.items()]
    components.append(RandomEffect("cycle", on * data.chance**2 / data.count, usual, power=FEW_AGREE))
    if data.drift:
        components.append(RandomEffect("drift", centred_walk(data.order), usual))
    if data.blocks is not None:
        components.append(RandomEffect("block", data.blocks @ data.blocks.T, usual))
    x = basis.fixed(data.speed_m_s, data.curve, observed=True)[:, basis.kept]
    return MixedModel(data.y, x, data.noise, tuple(components))
