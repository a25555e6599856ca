"""Building blocks of estimates: standard errors of autocorrelated values, levels, covariances, losses, variances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneudrive.arrays import Array, Bools, Interval, Ints, groups_by

#: Number of values above which the autocorrelation is computed from block means, with fewer lags.
MOST_VALUES = 400


def stderr_of_mean(values: Array) -> float:
    """Estimate the standard error of the mean of a series (n,) in the order of time or position.

    The autocorrelation is summed until it first falls below zero. The sum also corrects the bias of the variance that
    results from subtracting the mean of the series.

    Returns
    -------
    float
        Standard error; 0 if there are fewer than four values or all are equal.
    """
    series = np.asarray(values, dtype=float)
    return float(stderrs_of_means(series[np.isfinite(series)][None, :])[0])


def stderrs_of_means(rows: Array) -> Array:
    """Estimate the standard error of the mean of each row of a finite array, shape (m, n). Each row is a series."""
    if rows.shape[1] > MOST_VALUES:  # means of neighbours keep the slow part, which dominates
        each = rows.shape[1] // MOST_VALUES
        count = rows.shape[1] // each
        rows = rows[:, : each * count].reshape(-1, count, each).mean(axis=2)
    n = rows.shape[1]
    if n < 4:
        return np.zeros(rows.shape[0])
    away = rows - rows.mean(axis=1)[:, None]
    power = np.array([row @ row for row in away])
    moves = power > 0.0
    away, power = away[moves], power[moves]
    spectrum = np.fft.rfft(away, 2 * n, axis=1)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, axis=1)[:, : n // 2] / power[:, None]
    below = correlation <= 0.0
    reach = np.where(below.any(axis=1), below.argmax(axis=1), n // 2).tolist()
    share = 1.0 - np.arange(1, n) / n
    weighted = (row[1:end] * share[: end - 1] for row, end in zip(correlation, reach, strict=True))
    sums = [np.sum(products) for products in weighted]
    factor = np.minimum(1.0 + 2.0 * np.array(sums), n / 3.0)
    found = np.zeros(rows.shape[0])
    found[moves] = np.sqrt(power / (n - factor) * factor / n)
    return found


# --- Groups of values that are equal except for noise.

#: Relative difference below which two speeds count as one level.
SAME_SPEED = 0.05


def distinct_levels(values: Array) -> list[Interval]:
    """Group values by magnitude, within the fraction `SAME_SPEED`. Return the lowest and highest of each group."""
    ordered = np.sort(np.abs(values)).tolist()
    groups = groups_by(ordered, lambda lowest, value: value - lowest > SAME_SPEED * value)
    return [(ordered[group.start], ordered[group.stop - 1]) for group in groups]


def levels(values: Array, reach: float) -> Ints:
    """Return the level number of each value. A level contains the values within `reach` of its smallest value.

    Examples
    --------
    >>> levels(np.array([3.0, 1.0, 1.1, 2.9]), 0.2).tolist()
    [1, 0, 0, 1]
    """
    level, order = np.zeros(values.size, dtype=np.int64), np.argsort(values)
    for number, group in enumerate(groups_by(values[order].tolist(), lambda least, value: value - least > reach)):
        level[order[group]] = number
    return level


def means(group: Ints, *columns: Array) -> list[Array]:
    """Return the mean of each column for each group. No group may be empty.

    Examples
    --------
    >>> [one.tolist() for one in means(np.array([0, 0, 1]), np.array([1.0, 3.0, 5.0]))]
    [[2.0, 5.0]]
    """
    count = np.bincount(group)
    return [np.bincount(group, column) / count for column in columns]


def projection(values: Array, columns: Array) -> Array:
    """Return the least-squares fit of `columns`, shape (n, p), to `values`, shape (n,), at each of the n values.

    Examples
    --------
    >>> projection(np.array([1.0, 3.0]), np.ones((2, 1))).round(12).tolist()
    [2.0, 2.0]
    """
    return columns @ np.linalg.lstsq(columns, values, rcond=None)[0]


def cells(*columns: Ints) -> Ints:
    """Return a number for each of n rows. Rows with the same combination of values have the same number.

    Examples
    --------
    >>> cells(np.array([0, 0, 1, 0]), np.array([2, 5, 2, 2])).tolist()
    [0, 1, 2, 0]
    """
    return np.unique(np.column_stack(columns), axis=0, return_inverse=True)[1].ravel()


# --- Covariances of smooth functions for random effects of mixed models, shape (m, n) for m and n points.


def integrated_wiener(s: Array, t: Array) -> Array:
    """Return the covariance of an integrated Wiener process with variance 1 at argument 1.

    The estimate with this covariance is the cubic spline [wahba1983].

    Examples
    --------
    >>> integrated_wiener(np.array([1.0]), np.array([0.5, 1.0])).tolist()
    [[0.3125, 1.0]]
    """
    low = np.minimum(s[:, None], t[None, :])
    high = np.maximum(s[:, None], t[None, :])
    return low**2 * (3.0 * high - low) / 2.0


def matern(s: Array, t: Array, reach: float) -> Array:
    """Return the covariance of a function that is smooth over `reach` and uncorrelated far beyond it (Matern 3/2).

    Examples
    --------
    >>> matern(np.array([0.0]), np.array([0.0, 1.0]), 1.0).round(4).tolist()
    [[1.0, 0.4834]]
    """
    away = np.sqrt(3.0) * np.abs(s[:, None] - t[None, :]) / reach
    return (1.0 + away) * np.exp(-away)


def gaussian(s: Array, t: Array, reach: float) -> Array:
    """Return the covariance of a very smooth function with correlation length `reach` (squared exponential)."""
    away = (s[:, None] - t[None, :]) / reach
    return np.exp(-0.5 * away * away)


def centred_walk(order: Array) -> Array:
    """Return the covariance (n, n) of a random walk minus its mean. `order` is the step of each observation."""
    walk = np.minimum(order[:, None], order[None, :])
    walk = walk - walk.mean(axis=0, keepdims=True)
    return walk - walk.mean(axis=1, keepdims=True)


# --- Information of least-squares problems: covariance, and directions without information [bates1988].

#: Fraction of the largest singular value of the scaled Jacobian below which a direction counts as undetermined.
SINGULAR_SHARE = 1e-4
#: Component of an undetermined direction above which a coordinate counts as undetermined.
TAKES_PART = 0.3


def covariance_of(jacobian: Array, variance: float = 1.0) -> Array:
    """Return the covariance (p, p) of least-squares coordinates. Undetermined directions are left out.

    Parameters
    ----------
    jacobian : ndarray, shape (n, p)
        Derivatives of the residuals.
    variance : float
        Variance of one residual.

    Examples
    --------
    >>> covariance_of(np.array([[2.0, 0.0], [0.0, 0.5]]))
    array([[0.25, 0.  ],
           [0.  , 4.  ]])
    """
    size = _sizes(jacobian)
    scaled = jacobian / size
    inner = np.linalg.pinv(scaled.T @ scaled, rcond=SINGULAR_SHARE**2, hermitian=True)
    return variance * (inner / np.outer(size, size))


def shift_of(jacobian: Array, residual: Array) -> Array:
    """Return the least-squares step (p,) of the coordinates for residuals, without undetermined directions."""
    size = _sizes(jacobian)
    return np.linalg.pinv(jacobian / size, rcond=SINGULAR_SHARE) @ residual / size


def weak_coordinates(jacobian: Array) -> Bools:
    """Return the mask of the coordinates that have no effect or are part of an undetermined direction.

    Examples
    --------
    >>> weak_coordinates(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 0.0]]))
    array([ True,  True, False])
    """
    _, singular, vt = np.linalg.svd(jacobian / _sizes(jacobian), full_matrices=False)
    weak = vt[singular < SINGULAR_SHARE * singular[0]]
    return (np.linalg.norm(jacobian, axis=0) == 0.0) | (np.abs(weak) > TAKES_PART).any(axis=0)


def _sizes(jacobian: Array) -> Array:
    size = np.linalg.norm(jacobian, axis=0)
    return np.where(size > 0.0, size, 1.0)


# --- Losses of robust estimates, and a criterion to choose among models.


@dataclass(frozen=True)
class Loss:
    """Huber's loss of residuals u, in standard deviations. It is quadratic up to |u| = `tuning`, and linear beyond."""

    tuning: float

    @property
    def name(self) -> str:
        """Name for ``scipy.optimize.least_squares``."""
        return "huber" if np.isfinite(self.tuning) else "linear"

    def psi(self, u: Array) -> Array:
        """Return the first derivative of the loss with respect to u."""
        return np.clip(u, -self.tuning, self.tuning)

    def slope(self, u: Array) -> Array:
        """Return the second derivative of the loss with respect to u."""
        return (np.abs(u) <= self.tuning).astype(float)

    def rho(self, u: Array) -> Array:
        """Return the loss of each residual."""
        inner = np.abs(self.psi(u))
        return inner * (np.abs(u) - 0.5 * inner)


#: Loss of least squares, quadratic for all residuals.
LINEAR = Loss(np.inf)
#: Huber's loss with an efficiency of 99 % on normal errors. The usual tuning constant 1.345 (95 %) is slightly more
#: robust, but with a dozen levels its intervals cover the true value 1 % less often [huber2009].
HUBER = Loss(2.0)


def corrected_criterion(deviance: float, parameters: int, n: int) -> float:
    """Return Akaike's criterion corrected for few data [burnham2002]; inf for too few data.

    Examples
    --------
    >>> corrected_criterion(10.0, 2, 8)
    16.4
    """
    spare = n - parameters - 1
    return float(deviance + 2 * parameters + 2 * parameters * (parameters + 1) / spare) if spare > 0 else np.inf


# --- Moderated variances: empirical-Bayes estimates from few repetitions.

#: Speed levels needed for each coefficient of the trend of variance over speed.
ROWS_PER_TREND = 4


def moderate(variance: Array, dof: Array, speed: Array) -> Array:
    """Shrink variances that come from few repetitions towards their trend over speed.

    A weight 1/s^2 from three strokes can be wrong by a factor of ten. The empirical-Bayes estimate
    (d0 s0^2 + d s^2) / (d0 + d) avoids this, with d0 and s0 from the spread of log s^2 about its trend [smyth2004].

    Parameters
    ----------
    variance, dof : ndarray, shape (n,)
        Variances (> 0) and their degrees of freedom. A variance with infinite degrees of freedom is exact
        and returned unchanged.
    speed : ndarray, shape (n,)
        Speeds (> 0); the trend is a constant, a line or a parabola in log speed, chosen by AICc.

    Returns
    -------
    ndarray, shape (n,)
    """
    from scipy.special import digamma, polygamma

    variance, dof = np.broadcast_arrays(np.asarray(variance, float), np.asarray(dof, float))
    few = np.isfinite(dof)
    if few.sum() < 3:
        return variance.copy()
    d = dof[few]
    e = np.log(variance[few]) - digamma(d / 2.0) + np.log(d / 2.0)
    trend, rest = _trend(e, np.log(speed[few]), len(distinct_levels(speed[few])) // ROWS_PER_TREND)
    spread = rest - float(np.mean(polygamma(1, d / 2.0)))
    out = variance.copy()
    if spread <= 0.0:
        out[few] = np.exp(trend)
        return out
    d0 = 2.0 * _inverse_trigamma(spread)
    s0 = np.exp(trend + digamma(d0 / 2.0) - np.log(d0 / 2.0))
    out[few] = (d0 * s0 + d * variance[few]) / (d0 + d)
    return out


def _trend(values: Array, x: Array, most: int) -> tuple[Array, float]:
    """Fit the constant, line or parabola with the smallest AICc; return the curve and the variance around the curve."""
    best: float = np.inf
    out = (np.zeros(values.size) + float(values.mean()), float(np.var(values, ddof=1)))
    for count in range(1, min(3, most) + 1):
        columns = np.vander(x - x.mean(), count)
        fitted = projection(values, columns)
        rest, k = float(np.sum((values - fitted) ** 2)), count + 1
        if rest <= 0.0:
            break
        score = corrected_criterion(values.size * np.log(rest), k, values.size)
        if score < best:
            best, out = score, (fitted, rest / (values.size - count))
    return out


def _inverse_trigamma(x: float) -> float:
    """Return y with trigamma(y) = x, by Newton's method on 1 / trigamma [smyth2004]."""
    from scipy.optimize import newton
    from scipy.special import polygamma

    def slope(y: float) -> float:
        return -polygamma(2, y) / polygamma(1, y) ** 2

    def distance(y: float) -> float:
        return 1.0 / polygamma(1, y) - 1.0 / x

    return float(newton(distance, 0.5 + 1.0 / x, slope, tol=1e-300, rtol=1e-10, disp=False))
