"""Losses of robust estimates: weight of a residual u, in standard deviations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

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
