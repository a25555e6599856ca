"""Linear mixed models: restricted likelihood, with the uncertainty of the standard deviations.

    y = X b + sum_i g_i + e,   g_i ~ N(0, s_i^2 K_i),   e ~ N(0, W)

y are the results of cycles, and b the coefficients of the fixed effects. Each K_i is the covariance structure of a
random effect (a block, a day, the drift, the cycle itself, the deviation of a curve from a line). W is the known noise
within cycles. The standard deviations s_i are found by restricted maximum likelihood [patterson1971] with a weak prior.
Because the s_i are uncertain, every result is averaged over points about their estimate, weighted by probability.
Intervals from few cycles are therefore wide enough [rue2009].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.special import fdtrc, stdtrit

from pneudrive.arrays import Array, ArrayPair, Columns, Interval, by_name
from pneudrive.estimate.estimates import MOST_FREEDOM, NORMAL_95, Estimate, FTest, student

# --- Least squares of laws that are linear except for shape parameters: grid of shapes, and intervals by profile.
#
# At each shape, a linear fit gives the best coefficients, so that the profile over the shape needs no repeated
# fits. An interval is open if the data set no bound.

#: Fraction of the largest singular value below which a direction is left out.
NEGLIGIBLE = 1e-10


class Scan:
    """A linear fit for each of g sets of nonlinear (shape) parameters.

    Parameters
    ----------
    shape : ndarray, shape (g, k)
    designs : ndarray, shape (g, n, p)
        Whitened design matrix of each shape.
    values : ndarray, shape (n,)
        Whitened observations.
    freedom : float
        Degrees of freedom of the residuals. Infinite if no interval is needed.
    least : float
        Lower limit of the variance of the residuals.

    Attributes
    ----------
    shape : ndarray, shape (g, k)
    cost : ndarray, shape (g,)
        Sum of squared whitened residuals.
    coefficient : ndarray, shape (g, p)
    covariance : ndarray, shape (g, p, p)
        Covariance of the coefficients for residuals of unit variance.

    Examples
    --------
    Three lengths are tried for a decay whose length is 2:

    >>> x, lengths = np.arange(6.0), np.array([[1.0], [2.0], [4.0]])
    >>> found = Scan(lengths, np.exp(-x / lengths)[:, :, None], 3.0 * np.exp(-x / 2.0))
    >>> found.shape[found.best].tolist(), found.coefficient[found.best].round(6).tolist()
    ([2.0], [3.0])
    """

    def __init__(
        self, shape: Array, designs: Array, values: Array, freedom: float = np.inf, least: float = 0.0
    ) -> None:
        size = np.linalg.norm(designs, axis=1, keepdims=True)
        size[size == 0.0] = 1.0
        scaled = designs / size
        q, r = np.linalg.qr(scaled)  # r has the singular values of the design, and is small
        inverse = np.linalg.pinv(r, rcond=NEGLIGIBLE)
        found = (inverse @ (q.swapaxes(1, 2) @ values)[:, :, None])[:, :, 0]
        rest = values - np.einsum("gnp,gp->gn", scaled, found)
        factor, self.freedom, self.least = size[:, 0, :], freedom, least
        self.shape, self.cost, self.coefficient = shape, np.einsum("gn,gn->g", rest, rest), found / factor
        self.covariance = (inverse @ inverse.swapaxes(1, 2)) / (factor[:, :, None] * factor[:, None, :])

    @property
    def best(self) -> int:
        """Index of the shape with the smallest cost."""
        return int(np.argmin(self.cost))

    @property
    def scale(self) -> float:
        """Variance of the whitened residuals at the best shape."""
        return max(float(self.cost[self.best]) / self.freedom, self.least)

    @property
    def limit(self) -> float:
        """Cost at the bounds of a 95 % interval of one quantity."""
        return self.cost[self.best] + self.scale * student(self.freedom) ** 2

    @property
    def inside(self) -> NDArray[np.intp]:
        """Indices of the shapes whose cost is within the limit."""
        return np.flatnonzero(self.cost <= self.limit)

    def interval(self, rows: Array) -> Interval:
        """Return the 95 % interval of a linear function of the coefficients, `rows` of shape (g, p) or (p,)."""
        inside = self.inside
        rows = np.broadcast_to(rows, self.coefficient.shape)[inside]
        slack = np.maximum(self.limit - self.cost[inside], 0.0)
        value = np.einsum("gi,gi->g", rows, self.coefficient[inside])
        variance = np.einsum("gi,gij,gj->g", rows, self.covariance[inside], rows)
        reach = np.sqrt(slack) * np.sqrt(np.maximum(variance, 0.0))
        return float((value - reach).min()), float((value + reach).max())

    def shape_interval(self, k: int, sought: Interval) -> Interval:
        """Return the 95 % interval of shape parameter `k`. A bound at an end of the range `sought` becomes 0 or inf."""
        allowed = self.shape[self.inside, k]
        low, high = float(allowed.min()), float(allowed.max())
        return (
            0.0 if low <= sought[0] * (1.0 + 1e-9) else low,
            np.inf if high >= sought[1] * (1.0 - 1e-9) else high,
        )


def refined(at: Callable[[Array], Scan], coarse: Array, count: int) -> Scan:
    """Scan one shape parameter coarsely, then with `count` values in the range that the coarse scan allows.

    Parameters
    ----------
    at : callable
        Function from values of the parameter to a scan over these values.
    coarse : ndarray
        First values, ascending, in logarithmic steps.
    count : int
    """
    first = at(coarse)
    allowed = np.searchsorted(coarse, first.shape[first.inside, 0])
    low = max(int(allowed.min()) - 1, 0)
    high = min(int(allowed.max()) + 1, coarse.size - 1)
    return at(np.geomspace(coarse[low], coarse[high], count))


# --- Linear mixed models: restricted likelihood, with the uncertainty of the standard deviations.

#: Bounds of a standard deviation, as factors of its component's scale.
REACH = (1e-4, 1e2)
#: Fraction of the noise added to every variance, so that equal cycles do not make the equations singular.
JITTER = 1e-10
#: Finite-difference step of log standard deviations, for the curvature of the likelihood.
STEP = 0.05
#: Number of cycles above which standard deviations are fitted to every k-th cycle only. Results use all cycles.
MOST_FOR_SEARCH = 500


@dataclass(frozen=True, eq=False)
class RandomEffect:
    """Random effect of a mixed model: its covariance, and the prior of its standard deviation.

    Attributes
    ----------
    name : str
    kernel : ndarray, shape (n, n)
        Covariance between the observations at standard deviation 1.
    scale : float
        Scale of the half-Cauchy prior of the standard deviation [gelman2006].
    power : float
        Exponent of the prior density near a standard deviation of zero. With 0, the estimate may be zero [chung2013].
    """

    name: str
    kernel: Array
    scale: float
    power: float = 0.0


@dataclass(frozen=True, eq=False)
class MixedModel:
    """Observations and their linear model with random effects.

    Attributes
    ----------
    y : ndarray, shape (n,)
    x : ndarray, shape (n, p)
        Design matrix of the fixed effects, with full column rank.
    noise : ndarray, shape (n,)
        Known variance of each observation.
    components : tuple of RandomEffect
        At least one.
    """

    y: Array
    x: Array
    noise: Array
    components: tuple[RandomEffect, ...]

    @property
    def scales(self) -> Array:
        """Scales (k,) of the priors of the standard deviations."""
        return np.array([c.scale for c in self.components])

    def fit(self) -> MixedFit:
        """Fit the standard deviations, and find the points that represent their uncertainty."""
        few = self._few()
        best = _search(few, None)
        points, weights = _points(few, best)
        return MixedFit(self, np.exp(best), weights, tuple(_State(self, np.exp(p)) for p in points))

    def most_probable(self, start: Array | None) -> tuple[Array, float]:
        """Return the most probable standard deviations and their cost. The search begins at `start`.

        The cost is the negative log posterior without its constant term.
        """
        few = self._few()
        best = _search(few, start)
        return np.exp(best), _cost(few, best)[0]

    def left_out(self, sd: Array) -> ArrayPair:
        """Compare each observation with its prediction from all others, at these standard deviations.

        Returns
        -------
        ndarray, shape (n,)
            Observation minus its prediction from the others.
        ndarray, shape (n,)
            Standard deviation of the difference.
        """
        state = _State(self, sd)
        inverse = state.solve(np.eye(self.y.size))
        vx = inverse @ self.x
        diagonal = np.diag(inverse) - np.einsum("ij,jk,ik->i", vx, state.beta_covariance, vx)
        # Zero if a column of x belongs to a single observation, because the others do not predict it.
        known = diagonal > JITTER * np.diag(inverse)
        diagonal = np.where(known, diagonal, 1.0)
        return np.where(known, state.solved, 0.0) / diagonal, np.where(known, 1.0 / np.sqrt(diagonal), np.inf)

    def _few(self) -> MixedModel:
        """Return the model with every k-th observation if there are more than `MOST_FOR_SEARCH`.

        Columns of x that the remaining observations do not determine are left out.
        """
        n = self.y.size
        if n <= MOST_FOR_SEARCH:
            return self
        rows = np.arange(0, n, -(-n // MOST_FOR_SEARCH))
        x = self.x[rows]
        parts = (replace(c, kernel=c.kernel[np.ix_(rows, rows)]) for c in self.components)
        return MixedModel(self.y[rows], x[:, independent(x)], self.noise[rows], tuple(parts))

    def covariance(self, sd: Array) -> Array:
        """Return the covariance (n, n) of the observations at these standard deviations."""
        total = np.diag(self.noise)
        for component, s in zip(self.components, sd, strict=True):
            total = total + s**2 * component.kernel
        return total + np.eye(len(total)) * (JITTER * max(float(np.mean(np.diag(total))), 1e-300))


class _State:
    """Solution of the model at one set of standard deviations.

    Attributes
    ----------
    sd : ndarray, shape (k,)
    lower : ndarray, shape (n, n)
        Cholesky factor L of the covariance V.
    half_x : ndarray, shape (n, p)
        L^-1 X.
    beta, beta_covariance : ndarray, shape (p,) and (p, p)
        Coefficients of the fixed effects.
    residual, solved : ndarray, shape (n,)
        y - X b, and V^-1 (y - X b).
    """

    def __init__(self, model: MixedModel, sd: Array) -> None:
        self.sd = sd
        self.lower = cholesky(model.covariance(sd), lower=True, check_finite=False)
        self.half_x, half_y = (
            solve_triangular(self.lower, right, lower=True, check_finite=False) for right in (model.x, model.y)
        )
        q, self._r = np.linalg.qr(self.half_x)
        rights = q.T @ half_y, np.eye(self._r.shape[0])
        self.beta, inverse = (solve_triangular(self._r, right, check_finite=False) for right in rights)
        self.beta_covariance = inverse @ inverse.T
        self.residual = model.y - model.x @ self.beta
        self.solved = self.solve(self.residual)

    def solve(self, right: Array) -> Array:
        """Return V^-1 times `right`, which has shape (n,) or (n, m)."""
        return cho_solve((self.lower, True), right, check_finite=False)

    def deviance(self) -> float:
        """Return the restricted log-likelihood times -2."""
        of_v = float(np.sum(np.log(np.diag(self.lower))))
        of_x = float(np.sum(np.log(np.abs(np.diag(self._r)))))
        return 2.0 * of_v + 2.0 * of_x + float(self.residual @ self.solved)


@dataclass(frozen=True, eq=False)
class Predicted:
    """Means, variances and degrees of freedom (of Student's t) of m linear functions of the model."""

    mean: Array
    variance: Array
    freedom: Array

    def half_width(self) -> Array:
        """Half width of the 95 % interval."""
        return stdtrit(self.freedom, 0.975) * np.sqrt(self.variance)

    def estimates(self, unit: str = "N") -> list[Estimate]:
        """Return an estimate of each function, with interval and p-value (hypothesis: zero)."""
        columns = (self.mean, np.sqrt(self.variance), self.freedom)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return [Estimate.of(value, stderr, freedom, unit) for value, stderr, freedom in rows]


@dataclass(frozen=True, eq=False)
class MixedFit:
    """Fitted mixed model, solved at q points that represent the uncertainty of the standard deviations.

    Attributes
    ----------
    model : MixedModel
    sd : ndarray, shape (k,)
        Most probable standard deviation of each component.
    weights : ndarray, shape (q,)
        Probability of each point.
    states : tuple of _State, length q
    """

    model: MixedModel
    sd: Array
    weights: Array
    states: tuple[_State, ...]

    def averaged(self, *others: MixedFit, odds: Sequence[float] = ()) -> tuple[MixedFit, Array]:
        """Average this fit and others of the same data (with other kernels or noise), weighted by probability.

        Parameters
        ----------
        *others : MixedFit
        odds : sequence of float, optional
            Prior odds of each other fit against this one; 1 by default.

        Returns
        -------
        MixedFit
            Averaged fit. Its most probable standard deviations are those of the most probable single fit.
        ndarray
            Weight of each other fit.
        """
        every = (self, *others)
        log = np.array([fit.log_likelihood() for fit in every])
        log[1:] += np.log(odds) if len(odds) else 0.0
        share = np.exp(log - log.max())
        share /= share.sum()
        weights = np.concatenate([s * fit.weights for s, fit in zip(share, every, strict=True)])
        states = tuple(state for fit in every for state in fit.states)
        return replace(every[int(np.argmax(log))], weights=weights, states=states), share[1:]

    def contrast(self, row: Array, unit: str = "N") -> Estimate:
        """Estimate a linear function of b, with interval and p-value (hypothesis: zero)."""
        return Functionals(self, np.atleast_2d(row)).estimates(unit)[0]

    def f_test(self, rows: Array, extra: float = 0.0) -> FTest:
        """Test whether all q linear functions `rows` (q, p) of b are zero (Wald's test, approximate F).

        `extra` is a variance of the first function in addition to the random effects.
        """
        q = rows.shape[0]
        mean = np.average([rows @ s.beta for s in self.states], axis=0, weights=self.weights)
        covariance = np.average([rows @ s.beta_covariance @ rows.T for s in self.states], axis=0, weights=self.weights)
        covariance[0, 0] += extra
        freedom = float(1.0 / np.mean(1.0 / Functionals(self, rows).predict().freedom))
        # Covariance of Student's t is its squared scale times freedom / (freedom - 2).
        shrink = freedom / (freedom - 2.0) if freedom > 4.0 else 1.0
        f = shrink * float(mean @ np.linalg.solve(covariance, mean)) / q
        return FTest(f, q, freedom, float(fdtrc(q, freedom, f)))

    def most_probable_sd(self, name: str) -> float:
        """Return the most probable standard deviation of a random effect; 0 if the model does not contain it."""
        return by_name((c.name for c in self.model.components), self.sd).get(name, 0.0)

    def deviation(self, name: str) -> Estimate:
        """Estimate the standard deviation of a component, with its interval."""
        index = [c.name for c in self.model.components].index(name)
        logs = np.log([s.sd[index] for s in self.states])
        mean = float(self.weights @ logs)
        spread = float(np.sqrt(max(self.weights @ (logs - mean) ** 2, 0.0)))
        reach = NORMAL_95 * spread
        value = float(self.sd[index])
        return Estimate(value, float(np.exp(mean - reach)), float(np.exp(mean + reach)), value * spread, "N")

    def log_likelihood(self) -> float:
        """Return the restricted log-likelihood at the most probable standard deviations."""
        return -0.5 * _State(self.model, self.sd).deviance()


@dataclass(frozen=True, eq=False)
class Functionals:
    """A set of m linear functions X* b + sum_i g_i* of a fitted model.

    Attributes
    ----------
    fit : MixedFit
    fixed : ndarray, shape (m, p)
    cross : dict
        Random effect -> covariance (m, n) of g_i* with the g_i of the observations at standard deviation 1. Effects
        that the model does not contain have no influence.
    own : dict
        Random effect -> covariance (m, m) of g_i* at standard deviation 1.
    """

    fit: MixedFit
    fixed: Array
    cross: Columns = field(default_factory=dict)
    own: Columns = field(default_factory=dict)

    def combine(self, rows: Array) -> Functionals:
        """Return linear combinations of the m functions. `rows` contains their factors, shape (r, m)."""
        cross = {name: rows @ part for name, part in self.cross.items()}
        own = {name: rows @ part @ rows.T for name, part in self.own.items()}
        return Functionals(self.fit, rows @ self.fixed, cross, own)

    def mean(self) -> Functionals:
        """Return the mean of all functions."""
        return self.combine(np.full((1, len(self.fixed)), 1.0 / len(self.fixed)))

    def predict(self) -> Predicted:
        """Predict the mean and the variance of each function."""
        x, model = self.fixed, self.fit.model
        means, variances = [], []
        for state in self.fit.states:
            cross, own = np.zeros((x.shape[0], model.y.size)), np.zeros(x.shape[0])
            for component, s in zip(model.components, state.sd, strict=True):
                if component.name in self.cross:
                    cross += s**2 * self.cross[component.name]
                    own += s**2 * np.diag(self.own[component.name])
            means.append(x @ state.beta + cross @ state.solved)
            half = solve_triangular(state.lower, cross.T, lower=True, check_finite=False)
            left = x - half.T @ state.half_x
            own = own - np.sum(half**2, axis=0) + np.einsum("ij,jk,ik->i", left, state.beta_covariance, left)
            variances.append(np.maximum(own, 0.0))
        return _mixed(np.array(means), np.array(variances), self.fit.weights)

    def estimates(self, unit: str = "N") -> list[Estimate]:
        """Estimate each function, with interval and p-value (hypothesis: zero)."""
        return self.predict().estimates(unit)


def _mixed(means: Array, variances: Array, weights: Array) -> Predicted:
    """Average the means and variances (q, m) over the q points.

    The scatter of the variances gives the degrees of freedom of Student's t.
    """
    mean = weights @ means
    within = weights @ variances
    scatter = weights @ (variances - within) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = np.where(scatter > 0.0, 4.0 + 2.0 * within**2 / scatter, np.inf)
    scale = np.where(np.isfinite(freedom), within * (1.0 - 2.0 / freedom), within)
    return Predicted(mean, scale + weights @ (means - mean) ** 2, np.minimum(freedom, MOST_FREEDOM))


def independent(x: Array) -> NDArray[np.intp]:
    """Return the indices of the columns that are not linear combinations of earlier columns."""
    kept: list[int] = []
    basis = np.zeros((x.shape[0], 0))
    for k in range(x.shape[1]):
        column = x[:, k] / max(float(np.linalg.norm(x[:, k])), 1e-300)
        rest = column - basis @ (basis.T @ column)
        rest -= basis @ (basis.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > 1e-9:
            kept.append(k)
            basis = np.column_stack([basis, rest / size])
    return np.array(kept, dtype=np.intp)


# --- restricted likelihood -------------------------------------------------------------------


def _cost(model: MixedModel, log_sd: Array) -> tuple[float, Array]:
    """Return the negative log posterior density, and its gradient with respect to the log standard deviations."""
    sd = np.exp(log_sd)
    state = _State(model, sd)
    inverse = state.solve(np.eye(model.y.size))
    vx = inverse @ model.x
    p = inverse - vx @ state.beta_covariance @ vx.T
    kernels = [component.kernel for component in model.components]
    gradient = sd**2 * np.array([np.sum(p * k) - state.solved @ k @ state.solved for k in kernels])
    share = (sd / model.scales) ** 2
    power = 1.0 + np.array([c.power for c in model.components])
    prior = float(np.sum(0.5 * (1.0 + power) * np.log1p(share) - power * log_sd))
    return 0.5 * state.deviance() + prior, gradient + (1.0 + power) * share / (1.0 + share) - power


def _search(model: MixedModel, sd: Array | None) -> Array:
    """Return the most probable log standard deviations. The search begins at `sd`, or near the scales of the priors."""
    from scipy.optimize import fmin_l_bfgs_b

    start = np.log(model.scales) - 1.0 if sd is None else np.log(sd)
    bounds = [(np.log(REACH[0] * s), np.log(REACH[1] * s)) for s in model.scales]
    return fmin_l_bfgs_b(lambda q: _cost(model, q), start, bounds=bounds)[0]


def _points(model: MixedModel, best: Array) -> tuple[list[Array], Array]:
    """Return points on the principal axes of the curvature about the optimum, and their weights by probability.

    With 2 d + 1 points, averages of cubic polynomials are exact for a normal distribution. The weights contain the
    ratio of the true density to the normal density, which corrects for skewness.
    """
    d = best.size
    curvature = np.empty((d, d))
    for i, step in enumerate(STEP * np.eye(d)):
        high, low = _cost(model, best + step)[1], _cost(model, best - step)[1]
        curvature[i] = (high - low) / (2.0 * STEP)
    values, axes = np.linalg.eigh(0.5 * (curvature + curvature.T))
    spread = axes / np.sqrt(np.maximum(values, 0.1))
    reach = np.sqrt(d + 1.0)
    points = [best, *(best + sign * reach * axis for axis in spread.T for sign in (1.0, -1.0))]
    bounds = np.log(REACH[0] * model.scales), np.log(REACH[1] * model.scales)
    points = [np.clip(p, *bounds) for p in points]
    costs = np.array([_cost(model, p)[0] for p in points])
    normal = np.r_[0.0, np.full(2 * d, 0.5 * reach**2)]
    share = np.r_[1.0 / (d + 1.0), np.full(2 * d, 0.5 / (d + 1.0))]
    # Limits the weight of a point that is far more probable than under the normal distribution.
    weights = share * np.exp(np.clip(normal - (costs - costs[0]), -50.0, 3.0))
    return points, weights / weights.sum()
