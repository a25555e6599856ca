"""Losses of robust estimates: weight of a residual u, in standard deviations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.autocorrelation import distinct

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Loss:
    """Loss rho(u) with its derivatives.

    Attributes
    ----------
    tuning : float
        Residual, in standard deviations, above which the loss is no longer a square.
    psi, slope, rho : callable
        First and second derivative of rho, and rho itself, as functions of residuals u (n,).
    scipy : str or callable
        The loss for ``scipy.optimize.least_squares``, as a function of z = (u/tuning)^2.
    """

    tuning: float
    psi: Callable[[Array], Array]
    slope: Callable[[Array], Array]
    rho: Callable[[Array], Array]
    scipy: str | Callable[[Array], Array]


#: Huber's tuning constant: 99 % efficiency on normal errors. The usual 1.345 (95 %) is slightly more robust, but its
#: intervals on a dozen levels cover the true value 1 % less often [huber2009].
HUBER_K = 2.0
#: Tuning constants with the efficiency of Huber's loss on normal errors (a test integrates it).
SOFT_K, TUKEY_K = 2.7012, 6.9924


def _tukey_scipy(z: Array) -> Array:
    inside = np.clip(1.0 - z, 0.0, None)
    return np.stack([(1.0 - inside**3) / 3.0, inside**2, -2.0 * inside])


LINEAR = Loss(np.inf, lambda u: u, np.ones_like, lambda u: 0.5 * u**2, "linear")
LOSSES = {
    "huber": Loss(
        HUBER_K,
        lambda u: np.clip(u, -HUBER_K, HUBER_K),
        lambda u: (np.abs(u) <= HUBER_K).astype(float),
        lambda u: np.where(np.abs(u) <= HUBER_K, 0.5 * u**2, HUBER_K * np.abs(u) - 0.5 * HUBER_K**2),
        "huber",
    ),
    "soft-l1": Loss(
        SOFT_K,
        lambda u: u / np.sqrt(1.0 + (u / SOFT_K) ** 2),
        lambda u: (1.0 + (u / SOFT_K) ** 2) ** -1.5,
        lambda u: SOFT_K**2 * (np.sqrt(1.0 + (u / SOFT_K) ** 2) - 1.0),
        "soft_l1",
    ),
    "tukey": Loss(
        TUKEY_K,
        lambda u: u * np.clip(1.0 - (u / TUKEY_K) ** 2, 0.0, None) ** 2,
        lambda u: np.clip(1.0 - (u / TUKEY_K) ** 2, 0.0, None) * (1.0 - 5.0 * (u / TUKEY_K) ** 2),
        lambda u: TUKEY_K**2 / 6.0 * (1.0 - np.clip(1.0 - (u / TUKEY_K) ** 2, 0.0, None) ** 3),
        _tukey_scipy,
    ),
}


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
        Variances (> 0) and their degrees of freedom (inf: exact, unchanged).
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
    trend, rest = _trend(e, np.log(speed[few]), distinct(speed[few]) // ROWS_PER_TREND)
    spread = rest - float(np.mean(polygamma(1, d / 2.0)))
    out = variance.copy()
    if spread <= 0.0:
        out[few] = np.exp(trend)
        return out
    d0 = 2.0 * _inverse_trigamma(spread)
    s0 = np.exp(trend + digamma(d0 / 2.0) - np.log(d0 / 2.0))
    out[few] = (d0 * s0 + d * variance[few]) / (d0 + d)
    return out


def _trend(values: Array, x: Array, most: int) -> tuple[NDArray, float]:
    """Fit the constant, line or parabola with the smallest AICc; return the curve and the variance around the curve."""
    best: float = np.inf
    out = (np.zeros(values.size) + float(values.mean()), float(np.var(values, ddof=1)))
    for count in range(1, min(3, most) + 1):
        columns = np.vander(x - x.mean(), count)
        fitted = columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
        rest, k = float(np.sum((values - fitted) ** 2)), count + 1
        if values.size <= k + 1 or rest <= 0.0:
            break
        score = values.size * np.log(rest) + 2.0 * k + 2.0 * k * (k + 1) / (values.size - k - 1)
        if score < best:
            best, out = score, (fitted, rest / (values.size - count))
    return np.asarray(out[0]), out[1]


def _inverse_trigamma(x: float) -> float:
    from scipy.special import polygamma

    y = 0.5 + 1.0 / x
    for _ in range(50):
        tri = polygamma(1, y)
        step = tri * (1.0 - tri / x) / polygamma(2, y)
        y += step
        if -step / y < 1e-10:
            break
    return float(y)
