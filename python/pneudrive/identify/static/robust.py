"""Robust weighted least squares for the sliding laws: start values, Huber estimate, scale, covariance, profiles.

The estimate is Huber's M-estimator with his "proposal 2" for the scale. Its covariance and the equivalent least squares
problem (pseudo-values, used by the profile intervals) follow [huber2009].

Two runs of one seal can differ much more than the strokes within each run. If values were weighted only by the standard
error of the strokes, the run with the least noise would dominate the fit. As in the random-effects model of a
meta-analysis, a common variance is therefore added to the variance of each value. The size of the common variance makes
the residuals consistent with their standard errors [paule1982].

At a given Stribeck velocity and exponent, the law is linear in all other parameters. On a grid of these two parameters,
linear least squares therefore gives the cost, the best forces and their variances without repeated fits. The interval
of a parameter contains all values with a cost below a threshold, over the whole grid. Unlike value +- t * standard
error, the interval is open if the data do not bound the parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pneudrive.arrays import Array, ArrayPair, Bools, Interval, NamedIntervals, NamedNumbers, by_name
from pneudrive.estimate.autocorrelation import HUBER, LINEAR, Loss, corrected_criterion, covariance_of, shift_of
from pneudrive.estimate.estimates import rms, robust_deviation, student
from pneudrive.identify.static.model import EXPONENT_BOUNDS, FrictionModel, Observations, StaticLaw

#: Lower limit of the scale, as a fraction of the largest friction: smaller residuals are rounding errors.
SCALE_FLOOR = 1e-10
#: Largest number of rounds (estimate, scale). The scale converges to 1e-6 within three to five rounds.
MAX_ROUNDS = 20
#: Difference of ln vs below which two starts ended at the same estimate.
SAME_VELOCITY = 0.05
#: Difference of cost (half the deviance) below which another estimate counts as not significantly worse (p = 0.05).
HARDLY_WORSE = 1.92


@dataclass(frozen=True)
class RobustEstimate:
    """Robust estimate of a law from values, in internal coordinates.

    Attributes
    ----------
    model : StaticLaw
    data : Observations
    q : ndarray, shape (p,)
    scale : float
        Robust standard deviation of the whitened residuals (1 if the stated standard errors are right).
    residual : ndarray, shape (n,)
        Whitened residuals (friction - model) / stderr.
    jacobian : ndarray, shape (n, p)
        Whitened derivative of the model with respect to the internal coordinates.
    weight : ndarray, shape (n,)
        Huber weights in (0, 1]; below 1 for outliers.
    pseudo : ndarray, shape (n,)
        Pseudo-values: plain least squares on the pseudo-values has the same estimate and variance.
    variance : float
        Variance of the whitened pseudo-values about the model, with the small-sample factor.
    active : ndarray of bool, shape (p,)
        Mask of coordinates at a bound.
    cost : float
        Sum of the loss at `scale`.
    starts, agreeing : int
        Number of starts of the search, and number of starts that led to this estimate.
    rival : float
        Stribeck velocity in m/s of another estimate that is not significantly worse (p > 0.05); NaN without one.
    scatter_n : float
        Standard deviation between levels in N, included in the standard errors of `data`; 0 without scatter.
    """

    model: Any
    data: Observations
    q: Array
    scale: float
    residual: Array
    jacobian: Array
    weight: Array
    pseudo: Array
    variance: float
    active: Bools
    cost: float
    starts: int = 1
    agreeing: int = 1
    rival: float = np.nan
    scatter_n: float = 0.0

    @property
    def dof(self) -> int:
        """Degrees of freedom: number of values minus number of parameters."""
        return len(self.data) - len(self.model.names) - self.model.chosen

    @property
    def natural(self) -> NamedNumbers:
        """Parameters by name, in SI."""
        return by_name(self.model.names, map(float, self.model.transforms.natural(self.q)))

    @property
    def deviance(self) -> float:
        """Twice the negative log-likelihood, up to a constant, of the density exp(-loss) [huber2009].

        The density is normal for a quadratic loss.
        """
        scales = len(self.data) * np.log(self.scale)
        return 2.0 * (self.cost + scales + np.sum(np.log(self.data.stderr_n)))

    @property
    def pseudo_cost(self) -> float:
        """Sum of squares of the pseudo-values about the model."""
        residual = self.pseudo - self.model.value(self.q, self.data)
        return float(np.sum((residual / self.data.stderr_n) ** 2))

    @property
    def covariance(self) -> Array:
        """Covariance in natural units, without directions that the data do not determine (open intervals)."""
        to_natural = self.model.transforms.jacobian(self.q)
        matrix = to_natural @ covariance_of(self.jacobian, self.variance) @ to_natural.T
        return 0.5 * (matrix + matrix.T)

    @property
    def systematic(self) -> NamedNumbers:
        """Standard uncertainty of each parameter from errors shared by all rows, to first order."""
        shift = shift_of(self.jacobian, self.data.u_systematic_n / self.data.stderr_n)
        sizes = np.abs(self.model.transforms.jacobian(self.q) @ shift)
        return by_name(self.model.names, sizes)

    def pseudo_fit(self, model: StaticLaw, starts: Sequence[Array] = ()) -> RobustEstimate:
        """Return the plain least squares estimate of a law from the pseudo-values, with the pseudo-values' variance."""
        pseudo = replace(self.data, friction_n=self.pseudo)
        other = estimate(model, pseudo, LINEAR, starts=starts)
        return replace(other, data=self.data, pseudo=self.pseudo, variance=self.variance)

    def statistics(self) -> NamedNumbers:
        """Return the statistics of a fit; AICc and BIC come from the deviance."""
        residual, n, stderr = self.residual, len(self.data), self.data.stderr_n
        rms_n, rounding_n = rms(residual * stderr), SCALE_FLOOR * np.abs(self.data.friction_n).max()
        weighted_mean = np.average(self.data.friction_n, weights=stderr**-2)
        spread = np.sum(((self.data.friction_n - weighted_mean) / stderr) ** 2)
        k = n - self.dof + 1
        explained = 1.0 - np.sqrt(np.sum(residual**2) / spread) if spread > 0.0 and self.dof > 0 else np.nan
        return {
            "values": float(n),
            "degrees_of_freedom": float(self.dof),
            "scale": self.scale,
            "variance": self.variance,
            "scatter_n": self.scatter_n,
            "mean_n": weighted_mean,
            "noise_n": float(np.sqrt(self.variance) * np.median(stderr)),
            "rms_n": rms_n if rms_n > rounding_n else 0.0,
            "outlying": float(np.sum(self.weight < 0.5)),
            "fit_percent": 100.0 * explained,
            "starts": float(self.starts),
            "starts_agreeing": float(self.agreeing),
            "aicc": corrected_criterion(self.deviance, k, n),
            "bic": self.deviance + k * np.log(n),
        }


def estimate(
    model: StaticLaw,
    data: Observations,
    kind: Loss = HUBER,
    *,
    fixed_scale: bool = False,
    starts: Sequence[Array] = (),
) -> RobustEstimate:
    """Estimate the free parameters of `model` robustly.

    Parameters
    ----------
    model : StaticLaw
    data : Observations
    kind : Loss
        Huber's loss, or ``LINEAR`` for plain weighted least squares.
    fixed_scale : bool
        Whether to treat the stated standard errors as exact (required if there are not more rows than parameters).
    starts : sequence of ndarray, shape (p,)
        Start coordinates. Default: `starting_points` of the model.

    Returns
    -------
    RobustEstimate
    """
    dof = max(len(data) - len(model.names) - model.chosen, 1)
    floor = SCALE_FLOOR * (np.max(np.abs(data.friction_n)) / np.median(data.stderr_n))
    starts = starts or model.starting_points(data)
    small_sample = np.sqrt(len(data) / dof)
    scale = 1.0 if fixed_scale else max(robust_deviation(_residual(model, starts[0], data)) * small_sample, floor)
    candidates = [_polish(model, data, q, kind, scale) for q in starts]
    q, best = min(candidates, key=lambda c: c[1])
    near = [c for c in candidates if c[1] <= best + HARDLY_WORSE * scale**2]
    others = [c[0] for c in near if model.stribeck and abs(c[0][2] - q[2]) > SAME_VELOCITY]
    for _ in range(0 if fixed_scale else MAX_ROUNDS):
        updated = max(proposal_2(_residual(model, q, data), scale, dof, kind.tuning), floor)
        done = abs(updated / scale - 1.0) < 1e-6
        scale = updated
        if done or kind is LINEAR:
            break
        q = _polish(model, data, q, kind, scale)[0]
    lower, upper = model.bounds(data)
    reach = 1e-6 * np.maximum(np.abs(q), 1.0)
    q = np.where((lower == 0.0) & (q < reach), 0.0, q)  # the search ends just inside its bounds
    value, jac = model.value_and_jacobian(q, data)
    residual = (data.friction_n - value) / data.stderr_n
    u = residual / scale
    psi, slope = kind.psi(u), kind.slope(u)
    mean_slope = max(float(np.mean(slope)), 1.0 / u.size)
    # Huber's small-sample factor for regression [huber2009]
    correction = 1.0 + len(model.names) / u.size * float(np.var(slope)) / mean_slope**2
    variance = correction**2 * float(np.sum(psi**2)) / dof * (scale / mean_slope) ** 2
    weight = np.divide(psi, u, out=np.ones_like(u), where=np.abs(u) > 1e-12)
    active = (q - lower < reach) | (upper - q < reach)
    if model.stribeck:  # an excess indistinguishable from zero counts as at its bound
        active[1] = active[1] or np.exp(q[1]) < 1e-6 * np.max(np.abs(data.friction_n))
    return RobustEstimate(
        model=model,
        data=data,
        q=q,
        scale=scale,
        residual=residual,
        jacobian=jac / data.stderr_n[:, None],
        weight=weight,
        pseudo=value + data.stderr_n * psi * scale / mean_slope,
        variance=1.0 if fixed_scale else variance,
        active=active,
        cost=float(np.sum(kind.rho(u))),
        starts=len(starts),
        agreeing=len(near) - len(others),
        rival=float(np.exp(others[0][2])) if others else np.nan,
    )


def _residual(model: StaticLaw, q: Array, data: Observations) -> Array:
    return (data.friction_n - model.value(q, data)) / data.stderr_n


def _polish(model: StaticLaw, data: Observations, q: Array, kind: Loss, scale: float) -> tuple[Array, float]:
    from scipy.optimize import least_squares

    lower, upper = model.bounds(data)
    found = least_squares(
        lambda x: -_residual(model, x, data),
        np.clip(q, lower, upper),
        jac=lambda x: model.value_and_jacobian(x, data)[1] / data.stderr_n[:, None],  # pyright: ignore[reportArgumentType]
        bounds=(lower, upper),
        x_scale="jac",
        loss=kind.name,  # pyright: ignore[reportArgumentType]
        f_scale=1.0 if kind is LINEAR else kind.tuning * scale,
        xtol=1e-10,
        ftol=1e-12,
        gtol=1e-12,
        max_nfev=200,
    )
    return found.x, float(found.cost)


def proposal_2(residual: Array, scale: float, dof: int, k: float) -> float:
    """Return the scale by Huber's proposal 2: the mean of psi(r/scale)^2 equals its value for normal errors."""
    from scipy.special import ndtr

    if not np.isfinite(k):
        return float(np.sqrt(np.sum(residual**2) / dof))
    density = np.exp(-0.5 * k * k) / np.sqrt(2.0 * np.pi)
    expected = 2.0 * ndtr(k) - 1.0 - 2.0 * k * density + 2.0 * k * k * (1.0 - ndtr(k))
    for _ in range(200):
        if scale <= 0.0:
            return 0.0
        psi = np.clip(residual / scale, -k, k)
        factor = np.sqrt(np.sum(psi**2) / (dof * expected))
        scale *= factor
        if abs(factor - 1.0) < 1e-9:
            break
    return scale


#: p-value of the residuals, given their standard errors, below which a scatter is added.
CHANCE = 0.01
#: Least degrees of freedom to detect a scatter.
LEAST_DOF = 3
#: Decrease of deviance above which a common factor on the standard errors is preferred to a scatter (p = 0.01 for one
#: parameter). A scatter is the usual and safe choice.
CLEARLY = 6.6


def estimated(model: StaticLaw, data: Observations) -> RobustEstimate:
    """Estimate a law. If the residuals are too large, a scatter that explains them is added to the standard errors.

    The alternative is a common factor on the standard errors. The factor is chosen only if it is clearly more likely.
    """
    from scipy.optimize import brentq
    from scipy.special import chdtrc

    dof = len(data) - len(model.names) - model.chosen
    found = estimate(model, data, HUBER if dof > 0 else LINEAR, fixed_scale=dof == 0)
    even = np.ptp(data.stderr_n) <= 1e-6 * data.stderr_n.max()
    if dof < LEAST_DOF or even or chdtrc(dof, dof * found.scale**2) > CHANCE:
        return found

    def widened(scatter: float, starts: Sequence[Array] = ()) -> RobustEstimate:
        wider = replace(data, stderr_n=np.hypot(data.stderr_n, scatter))
        return estimate(model, wider, starts=starts)

    def excess(log_scatter: float) -> float:
        return np.log(widened(np.exp(log_scatter), [found.q]).scale)

    most = 2.0 * found.scale * data.stderr_n.max() + 2.0 * np.ptp(data.friction_n)
    low, high = np.log(0.1 * data.stderr_n.min()), np.log(most)
    if excess(low) <= 0.0 or excess(high) >= 0.0:  # a scatter does not explain them
        return found
    scatter = float(np.exp(brentq(excess, low, high, xtol=1e-2)))  # pyright: ignore[reportCallIssue, reportArgumentType]
    again = widened(scatter)
    return replace(again, scatter_n=scatter) if again.deviance < found.deviance + CLEARLY else found


FINE_POINTS = 161
COARSE_POINTS = 81
EXPONENT_POINTS = 41
#: Largest number of values of the law in memory. The whole grid of a large map would take half a gigabyte.
MOST_AT_ONCE = 500_000
#: Fraction of the largest scaled singular value below which a direction counts as undetermined: far above rounding
#: errors (1e-15), far below the resolution of any measurement.
SINGULAR_SHARE = 1e-7


def profile_intervals(found: RobustEstimate, quantile: float, least: float | None = None) -> NamedIntervals:
    """Return the intervals of all free parameters in natural units.

    Parameters
    ----------
    found : RobustEstimate
        Estimate of a `FrictionModel`; its pseudo-values and variance define the equivalent plain least squares problem.
    quantile : float
        Two-sided Student quantile of the requested probability.
    least : float, optional
        Sum of squares of the best model; by default the sum of this model.

    Returns
    -------
    dict
        Name -> (lower, upper). Empty if no value is below the threshold. An open end is infinite, or zero for a
        non-negative parameter.
    """
    model, data = found.model, found.data
    best = found.pseudo_cost if least is None else least
    most = best + found.variance * quantile**2
    if found.pseudo_cost > most:
        return {}
    velocities, exponents = _grid(found, quantile)
    linear = [n for n in model.names if not n.startswith("stribeck_")]
    parts = np.array_split(velocities, -(-velocities.size * len(data) // MOST_AT_ONCE))
    grid = [_forces(found, linear, part, exponent, most) for exponent in exponents for part in parts]
    cost, lowest, highest = (np.concatenate(part) for part in zip(*grid, strict=True))
    slack = (most - cost).reshape(exponents.size, velocities.size).T
    inside = cost <= most
    low = by_name(linear, lowest[inside].min(axis=0, initial=np.inf))
    high = by_name(linear, highest[inside].max(axis=0, initial=-np.inf))
    if model.stribeck:
        low["stribeck_velocity"], high["stribeck_velocity"] = _crossings(velocities, slack.max(axis=1))
        if model.exponent is None:
            low["stribeck_exponent"], high["stribeck_exponent"] = _crossings(exponents, slack.max(axis=0))
    lower, upper = np.exp(model.bounds(data))
    # The breakaway force may reach beyond the bounds of the search, or the Stribeck velocity may reach its lower bound.
    # Then any smaller Stribeck velocity fits as well, with a larger breakaway force.
    is_open = model.stribeck and (high["breakaway"] > upper[1] or low["stribeck_velocity"] <= lower[2] * 1.001)
    out = {}
    for name, value in found.natural.items():
        lo, hi = min(low[name], value), max(high[name], value)
        if name == "stribeck_velocity":
            lo = 0.0 if is_open else lo
            hi = np.inf if hi >= upper[2] * 0.999 else hi
        elif name == "stribeck_exponent":
            lo = 0.0 if lo <= EXPONENT_BOUNDS[0] * 1.001 else lo
            hi = np.inf if hi >= EXPONENT_BOUNDS[1] * 0.999 else hi
        elif name in {"coulomb", "breakaway", "viscous"}:
            lo = max(lo, 0.0)
        hi = np.inf if is_open and name.startswith("breakaway") else hi
        out[name] = (float(lo), float(hi))
    return out


def _crossings(log_value: Array, slack: Array) -> Interval:
    """Return the outermost values at which the cost reaches its threshold, interpolated between grid points."""
    inside = np.flatnonzero(slack >= 0.0)
    if inside.size == 0:
        return np.inf, -np.inf

    def edge(i: int, j: int) -> float:
        if j < 0 or j >= slack.size:
            return float(log_value[i])
        share = slack[i] / (slack[i] - slack[j])
        return float(log_value[i] + share * (log_value[j] - log_value[i]))

    first, last = int(inside[0]), int(inside[-1])
    return float(np.exp(edge(first, first - 1))), float(np.exp(edge(last, last + 1)))


def _grid(found: RobustEstimate, quantile: float) -> ArrayPair:
    """Return grids of log vs and log n: coarse over the whole range, fine near the estimate."""
    model, nothing = found.model, np.zeros(1)
    if not model.stribeck:
        return nothing, nothing
    lower, upper = model.bounds(found.data)
    size = np.linalg.norm(found.jacobian, axis=0)  # scaled, as squares of pressures are 1e10 times larger than forces
    size[size == 0.0] = 1.0
    information = found.jacobian.T @ found.jacobian / np.outer(size, size)
    covariance = found.variance * np.linalg.pinv(information, rcond=1e-12, hermitian=True) / np.outer(size, size)

    def around(k: int, coarse: int, fine: int) -> Array:
        half = 1.6 * quantile * np.sqrt(max(covariance[k, k], 0.0))
        half = min(max(half, 1e-9), float(upper[k] - lower[k]))
        near = np.linspace(found.q[k] - half, found.q[k] + half, fine)
        far = np.linspace(lower[k], upper[k], coarse)
        return np.unique(np.clip(np.r_[near, far, found.q[k]], lower[k], upper[k]))

    if model.exponent is not None:
        return around(2, COARSE_POINTS, FINE_POINTS), nothing
    return around(2, EXPONENT_POINTS, EXPONENT_POINTS), around(3, EXPONENT_POINTS // 2, EXPONENT_POINTS // 2)


def _forces(
    found: RobustEstimate, linear: list[str], log_velocities: Array, log_exponent: float, most: float
) -> tuple[Array, Array, Array]:
    """Return the least cost of the linear problem at each velocity, shape (g,), and the ends of the forces, (g, p).

    Between the ends of a force, the cost is at most `most`. A negative excess is held at zero; the ends of the excess
    and its slopes then also cover the fit with a free excess.
    """
    data = found.data
    y = found.pseudo / data.stderr_n
    columns = found.model.linear_columns(data, log_velocities, log_exponent) / data.stderr_n[:, None]
    cost, value, spread = _least_squares(columns, y)
    low, high = _ends(cost, value, spread, most)
    if not found.model.stribeck:
        return cost, low, high
    c, s = linear.index("coulomb"), linear.index("breakaway")
    below = value[:, s] < value[:, c]
    if below.any():
        merged = columns[below]
        merged[..., c] += merged[..., s]
        cost[below], value, spread = _least_squares(np.delete(merged, s, axis=2), y)
        ends = _ends(cost[below], value, spread, most)
        lowest, highest = (np.insert(end, s, end[:, c], axis=1) for end in ends)
        of_excess = np.char.startswith(linear, "breakaway")
        high[below] = np.where(of_excess, np.maximum(high[below], highest), highest)
        low[below] = np.where(of_excess, np.minimum(low[below], lowest), lowest)
        low[below, s] = lowest[:, s]
    return cost, low, high


def _ends(cost: Array, value: Array, spread: Array, most: float) -> ArrayPair:
    """Return the lower and upper ends of the values, between which the cost is at most `most`."""
    slack = np.maximum(most - cost, 1e-300)  # above zero, so that an unknown spread stays infinite
    reach = np.sqrt(slack[:, None] * spread)
    return value - reach, value + reach


def _least_squares(columns: Array, y: Array) -> tuple[Array, Array, Array]:
    """Solve g linear least squares problems, columns (g, n, p). Undetermined parameters have infinite variance."""
    size = np.linalg.norm(columns, axis=1)
    size[size == 0.0] = 1.0
    u, singular, vt = np.linalg.svd(columns / size[:, None, :], full_matrices=False)
    good = singular > SINGULAR_SHARE * singular[:, :1]
    inverse = np.where(good, 1.0 / np.where(good, singular, 1.0), 0.0)
    projected = np.einsum("gnk,n->gk", u, y)
    value = np.einsum("gkp,gk->gp", vt, inverse * projected) / size
    spread = np.einsum("gkp,gk->gp", vt**2, inverse**2) / size**2
    lost = ((np.abs(vt) > 1e-3) & ~good[..., None]).any(axis=1)
    rest = y - np.einsum("gnk,gk->gn", u, np.where(good, projected, 0.0))
    return np.einsum("gn,gn->g", rest, rest), value, np.where(lost, np.inf, spread)


# --- Estimates and intervals over the knees of a dependence on pressure, and over the shapes of the Stribeck curve.

#: Candidate knees, as multiples of the largest gauge pressure. Above 4, the curve is nearly a straight line (within 20
#: % of its final value); below 0.1, it is nearly a step.
KNEES = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6, 2.5, 4.0)

#: Factors of further knees between the best knee and its neighbours.
FINER = np.geomspace(0.6, 1.0 / 0.6, 9)
#: Candidate shapes: exponent of the Stribeck curve (0.5 to 2 in the literature [armstrong1994]), and whether the curve
#: is Lorentzian.
SHAPES = ((0.5, False), (1.0, False), (2.0, False), (2.0, True))
#: Factors of knees about the best one. Intervals are joined over the knees that the data allow.
NEIGHBOURS = np.geomspace(1.0, 40.0, 61)[1:]


def _largest_gauge(data: Observations) -> float:
    return float(np.abs(data.gauges_pa).max())


def with_knee(model: FrictionModel, data: Observations) -> FrictionModel:
    """Choose the most likely of a few knees of a saturating dependence on pressure."""
    if model.pressure != "saturating" or not model.chambers:
        return model
    top, starts, sizes = _largest_gauge(data), [], {}
    for share in KNEES[::-1]:  # beginning nearest to a straight line, each starts from the estimate before
        found = estimate(replace(model, knee_pa=share * top), data, starts=starts)
        starts, sizes[share] = [found.q], found.deviance
    for share in min(sizes, key=lambda one: sizes[one]) * FINER:
        if KNEES[0] <= share <= KNEES[-1]:
            found = estimate(replace(model, knee_pa=share * top), data, starts=starts)
            sizes.setdefault(share, found.deviance)
    return replace(model, knee_pa=min(sizes, key=lambda one: sizes[one]) * top)


def _joined(first: Interval, second: Interval) -> Interval:
    """Return the interval that contains two intervals."""
    return min(first[0], second[0]), max(first[1], second[1])


def interval_over_knees(found: RobustEstimate, quantile: float) -> NamedIntervals:
    """Return profile intervals over all knees that the data allow. Those at a single knee would be far too narrow."""
    out, model = profile_intervals(found, quantile), found.model
    if model.knee_pa is None:
        return out
    top, least = _largest_gauge(found.data), found.pseudo_cost
    for side in (NEIGHBOURS, 1.0 / NEIGHBOURS):
        for knee in model.knee_pa * side:
            if not KNEES[0] * top <= knee <= KNEES[-1] * top:
                break
            near = found.pseudo_fit(replace(model, knee_pa=float(knee)), [found.q])
            more = profile_intervals(near, quantile, least)
            if not more:
                break
            out = {name: _joined(ends, more[name]) for name, ends in out.items()}
    return out


def interval_over_shapes(found: RobustEstimate, intervals: NamedIntervals) -> NamedIntervals:
    """Return the intervals of the forces over all Stribeck shapes that fit as well as the chosen shape.

    The breakaway force depends on the unknown shape at low speed. At a single exponent, the intervals of the forces
    would be too narrow. Parameters of the shape keep their own intervals.
    """
    model, out = found.model, dict(intervals)
    if not model.stribeck or model.exponent is None:
        return out
    for exponent, lorentzian in SHAPES:
        if (exponent, lorentzian) != (model.exponent, model.lorentzian):
            near = found.pseudo_fit(replace(model, exponent=exponent, lorentzian=lorentzian))
            more = profile_intervals(near, student(found.dof), found.pseudo_cost)
            for name in (n for n in more if not n.startswith("stribeck_")):
                out[name] = _joined(out[name], more[name])
    return out
