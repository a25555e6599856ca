"""Curves over speed with scatter between cycles, and outliers: a smoothing spline inside a mixed model.

A curve is a line plus a smooth deviation. The data determine the smoothness. The deviation is an integrated Wiener
process. Its estimate is the cubic smoothing spline, and its posterior gives the band [wahba1983]. Curves of one
campaign share their shape as far as the data support this. Smoothness refers to a stretched speed, which is logarithmic
at low and proportional at high speed. Both the Stribeck part and the viscous part are smooth over the stretched speed.

Outliers are cycles that do not fit any curve. Two outliers can mask each other, because both increase the scatter, and
an outlier can make a good repeat look like an outlier. Each cycle is therefore compared with its prediction from all
others [cook1982]: neighbours in speed, other pressures, repeats. In each step, the cycle with the largest deviation
relative to the robust scatter is removed, and the model is fitted again. The number of outliers is the most probable
one [box1968]: an outlier may show any friction, but is rare. Finally, each removed cycle is used again if it agrees
with the prediction from the good cycles. A cycle is suspect if the data do not show whether it is an outlier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Columns, Ints
from pneudrive.estimate import mixed
from pneudrive.estimate.autocorrelation import centred_walk, integrated_wiener, matern, projection
from pneudrive.estimate.estimates import robust_deviation

#: Speed above which the stretched speed is proportional to speed; below, it is logarithmic (assumed).
PROPORTIONAL_FROM_M_S = 0.1
CYCLE_SCALE = 0.02  # usual standard deviations, shares of the response: cycle to cycle, block to block, drift
#: Correlation length, in stretched speed, of a curve's own deviation from the common shape: a factor of 7 at low speed,
#: about the width of the Stribeck region (assumed).
LOCAL_REACH = 2.0
#: Exponent with which the prior of a standard deviation falls towards zero (assumed). A few control runs that agree by
#: chance do not prove a perfectly repeatable rig.
FEW_AGREE = 4.0
POSITIVE_SHARE = 0.2  # of the median friction: least friction for relative scatter
LEAST_FRICTION = 0.1  # share of the mean friction below which proportional scatter falls no further (assumed)
CARRIED = 0.98  # share of a drift that curves could absorb, above which the design does not determine it
CURVE_DEGREE = 5  # polynomials in stretched speed that represent all curves there


def stretched(speed_m_s: Array, lowest_m_s: float) -> Array:
    """Return the stretched speed: logarithmic at low speed, proportional at high speed, zero at the lowest speed.

    Examples
    --------
    >>> stretched(np.array([1e-3, 1e-2]), 1e-3).round(3).tolist()
    [0.0, 2.393]
    """
    speed = np.maximum(np.asarray(speed_m_s, dtype=float), 1e-12)
    return np.log(speed / lowest_m_s) + (speed - lowest_m_s) / PROPORTIONAL_FROM_M_S


@dataclass(frozen=True, eq=False)
class CurveData:
    """Observations of curves, as arrays (n,), and possible further effects.

    Attributes
    ----------
    y, noise : ndarray
        Response and the variance of its noise within the cycle.
    speed_m_s : ndarray
        NaN for a zero run, which is not on a curve and shows only the zero.
    curve : ndarray of int
        Index of the curve; -1: none.
    order : ndarray
        Relative position of the cycle in the campaign, 0 to 1.
    count : ndarray
        Number of cycles averaged in an observation.
    chance : ndarray or 1
        Standard deviation of a cycle relative to that at mean friction; 1 if this deviation, in the unit of the
        response, does not depend on friction.
    blocks : ndarray, shape (n, blocks), or None
        Fraction of each block (or day) in each observation, if the design determines their deviations.
    drift : bool
        Whether the design determines a drift (see `determines_drift`).
    logarithmic : bool
        Whether the response is log friction: curves then share their shape, and blocks and drift are proportional to
        friction.
    """

    y: Array
    noise: Array
    speed_m_s: Array
    curve: Ints
    order: Array
    count: Array
    chance: Array | float = 1.0
    blocks: Array | None = None
    drift: bool = True
    logarithmic: bool = False

    def __len__(self) -> int:
        return self.y.size

    @property
    def level(self) -> float:
        """Reference size of the response: its median absolute value, or 1 for a logarithm."""
        return 1.0 if self.logarithmic else float(np.median(np.abs(self.y)))

    @cached_property
    def span(self) -> tuple[float, float]:
        """Lowest speed of all curves, and the range of the stretched speed."""
        speed = self.speed_m_s[self.curve >= 0]
        return speed.min(), max(stretched(speed, speed.min()).max(), 1e-6)

    @cached_property
    def kept(self) -> NDArray[np.intp]:
        """Indices of the independent columns of `fixed`."""
        return mixed.independent(self.fixed(self.speed_m_s, self.curve, observed=True))

    def place(self, speed_m_s: Array) -> Array:
        """Return the stretched speed, scaled to 0 to 1 over the measured range."""
        lowest_m_s, width = self.span
        return np.nan_to_num(stretched(speed_m_s, lowest_m_s) / width)

    def fixed(self, speed_m_s: Array, curve: Ints, *, observed: bool) -> Array:
        """Return the columns of the fixed effects: one level per curve, a common slope, and the zero of zero runs."""
        slope = np.where(curve >= 0, self.place(speed_m_s) - 0.5, 0.0)
        zero = np.full((curve.size, int((self.curve < 0).any())), float(observed))
        levels = curve[:, None] == np.arange(self.curve.max() + 1)
        return np.column_stack([zero, levels, slope])

    def kernels(self, first: tuple[Array, Ints], second: tuple[Array, Ints]) -> Columns:
        """Return the covariances of the smooth deviations between two sets of points (speed, curve)."""
        (s, i), (t, j) = first, second
        s, t = self.place(s), self.place(t)
        on = (i >= 0)[:, None] & (j >= 0)
        bend = integrated_wiener(s, t)
        found = {"shape": bend * on}
        if self.curve.max() > 0:
            same = on & (i[:, None] == j)
            found["own shape"] = (bend + 3.0 * (s - 0.5)[:, None] * (t - 0.5)) * same
            _, width = self.span
            found["local"] = matern(s * width, t * width, LOCAL_REACH) * same
        return found


@dataclass(frozen=True, eq=False)
class CurveFit:
    """Curves of a campaign, fitted by one mixed model.

    Attributes
    ----------
    data : CurveData
    fit : MixedFit
    relative : float
        Probability that the scatter of a cycle is proportional to friction, rather than constant in newton.
    """

    data: CurveData
    fit: mixed.MixedFit
    relative: float

    @cached_property
    def drift(self) -> mixed.Predicted:
        """Best estimate of the drift at each observation. Its mean is zero."""
        walk = {c.name: c.kernel for c in self.fit.model.components if c.name == "drift"}
        nothing = np.zeros((len(self.data), self.fit.model.x.shape[1]))
        return mixed.Functionals(self.fit, nothing, walk, walk).predict()

    def at(self, curve: Ints | int, speed_m_s: Array) -> mixed.Functionals:
        """Return one curve, or the curve of each speed, as linear functions in the unit of the response."""
        data, at = self.data, (speed_m_s, np.broadcast_to(curve, speed_m_s.shape))
        fixed = data.fixed(*at, observed=False)[:, data.kept]
        return mixed.Functionals(self.fit, fixed, data.kernels(at, (data.speed_m_s, data.curve)), data.kernels(at, at))

    def steady(self) -> Array:
        """Return the curve at each observation, in the unit of the response; NaN without a curve (shape (n,))."""
        found, on = np.full(len(self.data), np.nan), self.data.curve >= 0
        found[on] = self.at(self.data.curve[on], self.data.speed_m_s[on]).predict().mean
        return found


def determines_drift(data: CurveData) -> bool:
    """Return whether a steady drift is distinguishable from the curves; False if speed follows the order of cycles."""
    on = data.curve >= 0
    if on.sum() < 3 or np.ptp(data.order[on]) == 0:
        return False
    place, levels = data.place(data.speed_m_s[on]), np.eye(data.curve.max() + 1)[data.curve[on]]
    speeds = np.unique(np.round(np.log(data.speed_m_s[on]), 2)).size
    degree = min(CURVE_DEGREE, speeds - 1)
    columns = np.hstack([levels * place[:, None] ** k for k in range(degree + 1)])
    time = data.order[on]
    left = time - projection(time, columns)
    away = time - time.mean()
    return bool(1.0 - left @ left / (away @ away) < CARRIED)


def fit_curves(data: CurveData) -> CurveFit:
    """Fit all curves of a campaign by one mixed model."""
    return CurveFit(data, curve_model(data).fit(), relative=float(data.logarithmic))


def fit_friction(data: CurveData) -> CurveFit:
    """Fit friction and its logarithm. Return the more likely fit, averaged over both forms of a cycle's scatter.

    The scatter is constant in newton, or proportional to friction. A few cycles do not determine its form, so the band
    covers both forms. The choice of the response (friction or its logarithm) is independent of this form.
    """
    plain = fit_curves(data)
    if data.y.min() <= POSITIVE_SHARE * np.median(data.y):
        return plain
    relative = fit_curves(replace(data, y=np.log(data.y), noise=data.noise / data.y**2, logarithmic=True))
    # Densities of y and of ln y differ by a factor y for each degree of freedom of the restricted likelihood.
    freedom = len(data) - plain.fit.model.x.shape[1]
    likelier = relative.fit.log_likelihood() - freedom * np.mean(np.log(data.y))
    better = relative if likelier > plain.fit.log_likelihood() else plain
    del plain, relative  # free the other one before a third: each takes much memory
    is_log, steady = better.data.logarithmic, better.steady()
    steady = np.exp(steady) if is_log else steady
    share = np.maximum(steady / steady.mean(), LEAST_FRICTION)
    other = replace(better.data, chance=1.0 / share if is_log else share)
    fit, (weight,) = better.fit.averaged(curve_model(other).fit())
    return CurveFit(better.data, fit, 1.0 - weight if is_log else weight)


def with_doubt(fitted: CurveFit, readings: Sequence[NDArray[np.intp]]) -> CurveFit:
    """Average over several hypotheses: all suspect cycles are good, or some are outliers.

    Parameters
    ----------
    fitted : CurveFit
        Fit that treats all suspect cycles as good.
    readings : sequence of ndarray of int
        Rows of the data that are outliers, for each other hypothesis.
    """
    model, spread = fitted.fit.model, WILD_SPREAD * fitted.data.level
    noises = (model.noise + spread**2 * np.isin(np.arange(model.y.size), rows) for rows in readings)
    others = (replace(model, noise=noise).fit() for noise in noises)
    fit, _ = fitted.fit.averaged(*others, odds=[(WILD / (1.0 - WILD)) ** rows.size for rows in readings])
    return CurveFit(fitted.data, fit, fitted.relative)


def curve_model(data: CurveData) -> mixed.MixedModel:
    """Return the model that `fit_curves` fits."""
    on, observed = data.curve >= 0, (data.speed_m_s, data.curve)
    y = data.y[on]
    spread = max(np.std(y), 1e-9 * (np.abs(y).max() + 1e-12), 1e-12)
    usual = CYCLE_SCALE if data.logarithmic else CYCLE_SCALE * max(np.abs(y).mean(), spread)
    scales = {"shape": 5.0 * spread, "own shape": spread, "local": usual}
    kernels = data.kernels(observed, observed)
    components = [mixed.RandomEffect(name, kernel, scales[name]) for name, kernel in kernels.items()]
    components.append(mixed.RandomEffect("cycle", np.diag(on * data.chance**2 / data.count), usual, FEW_AGREE))
    if data.drift:
        components.append(mixed.RandomEffect("drift", centred_walk(data.order), usual))
    if data.blocks is not None:
        components.append(mixed.RandomEffect("block", data.blocks @ data.blocks.T, usual))
    return mixed.MixedModel(data.y, data.fixed(*observed, observed=True)[:, data.kept], data.noise, tuple(components))


ENOUGH = 9  # least number of cycles to find a wild one
SUSPECT = 3.0  # robust deviations beyond which a cycle is examined
SURE = 5.0  # standard deviations of the prediction from the others, beyond which a cycle is wild
TRIED = 3  # suspects among which the one is sought without which all others fit best
LEAST_SHARE = 0.1  # share of friction: a smaller deviation is not a failure of a sensor
WILD = 0.02  # prior probability of a wild cycle (assumed)
WILD_SPREAD = 0.5  # share of friction: standard deviation of wild cycles (assumed)
OPEN = 4.0  # difference of logarithms: readings less than 2 % as probable as the likeliest are left out (assumed)
FEW = 100  # cycles, among which wild ones hide each other
ON_TRIAL = 2  # cycles that are removed though none stands out
MOST_SHARE = 0.1  # share of the cycles (and at least two): more are not outliers, but typical of the rig


def wild_cycles(data: CurveData) -> tuple[list[int], list[list[int]]]:
    """Find the outliers, as rows of the data.

    Returns
    -------
    list of int
        Outliers.
    list of list of int
        Rows of further possible outliers, one list for each hypothesis. Each list contains the previous one.
    """
    if len(data) < ENOUGH:
        return [], []
    path = _path(data)
    least_cost = min(cost for _, _, cost in path)
    possible = [(rows, sd) for rows, sd, cost in path if cost < least_cost + OPEN]
    taken, sd = possible[0][0].copy(), possible[0][1]
    while taken:
        own = [_against(data, taken, i, sd) for i in taken]
        least = int(np.argmin(own))
        if own[least] > SURE:
            break
        taken.pop(least)
        sd, _ = _others(data, taken)[1].most_probable(sd)
    readings = [sorted(set(rows) - set(taken)) for rows, _ in possible]
    return sorted(taken), [rows for rows in readings if rows]


def _path(data: CurveData) -> list[tuple[list[int], Array, float]]:
    """Remove cycles one by one. Each step removes the cycle whose removal makes the other cycles most probable.

    Return for each step, beginning with no removal: removed cycles, standard deviations of the rest, negative log
    probability.
    """
    size = len(data)
    most = max(2, int(MOST_SHARE * size))
    # Cost of an outlier: -log(odds of an outlier * its density / density of a good cycle).
    price = np.log((1.0 - WILD) / WILD) + np.log(WILD_SPREAD * data.level)
    path = [([], *_others(data, [])[1].most_probable(None))]
    while len(path[-1][0]) < most:
        taken, sd, _ = path[-1]
        rows, model = _others(data, taken)
        off, far = model.left_out(sd)
        z = np.abs(off) / far
        usual = max(robust_deviation(off / far), 1e-12)
        curve = data.curve[rows]
        has_others = np.bincount(curve[curve >= 0], minlength=curve.max() + 1)[curve] > 1
        large = (np.abs(off) > LEAST_SHARE * data.level) & has_others
        suspect = (z > SUSPECT * usual) & large
        if not suspect.any():
            # Among few cycles, two outliers hide each other by their scatter: neither is visible before both are
            # removed. So some are removed on trial.
            best = min(range(len(path)), key=lambda k: path[k][2])
            if size > FEW or len(path) - 1 - best >= ON_TRIAL or not large.any():
                break
            suspect = large
        order = rows[np.flatnonzero(suspect)[np.argsort(-z[suspect])]].tolist()
        # Among very many cycles, a few outliers change nothing: remove all at once. Among few cycles, an outlier that
        # bends the curve makes its neighbours look like outliers. Remove the cycle without which the others are most
        # likely.
        tries = [order[: most - len(taken)]] if size > mixed.MOST_FOR_SEARCH else [[i] for i in order[:TRIED]]
        removed = ([*taken, *some] for some in tries)
        found = [(some, *_others(data, some)[1].most_probable(sd)) for some in removed]
        taken, sd, cost = min(found, key=lambda step: step[2])
        path.append((taken, sd, cost + price * len(taken)))
    # With very many cycles the standard deviations come from some of them: their costs are not comparable.
    return path if size <= mixed.MOST_FOR_SEARCH else path[-1:]


def _others(data: CurveData, taken: list[int]) -> tuple[NDArray[np.intp], mixed.MixedModel]:
    """Return the rows of the remaining cycles, and their model."""
    rows = np.setdiff1d(np.arange(len(data)), taken)
    columns = {field.name: getattr(data, field.name) for field in fields(data)}
    others = {name: values[rows] for name, values in columns.items() if isinstance(values, np.ndarray)}
    return rows, curve_model(replace(data, **others))


def _against(data: CurveData, taken: list[int], one: int, sd: Array) -> float:
    """Return the deviation of a removed cycle from the others, in standard deviations."""
    rows, model = _others(data, [i for i in taken if i != one])
    (off, far), at = model.left_out(sd), np.searchsorted(rows, one)
    return abs(off[at]) / far[at] if abs(off[at]) > LEAST_SHARE * data.level else 0.0
