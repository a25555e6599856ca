"""Robust weighted least squares for the sliding laws: start values, Huber estimate, scale, covariance.

The estimate is Huber's M-estimator with his "proposal 2" for the scale. Its covariance and the equivalent least squares
problem (pseudo-values, used by the profile intervals) follow [huber2009].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import robust_deviation
from pneudrive.estimate.losses import LINEAR, LOSSES, Loss

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.identify.static.model import Observations, StaticLaw

    Array = NDArray[np.float64]

#: Floor of the scale, as a share of the largest friction: smaller residuals are rounding.
SCALE_FLOOR = 1e-10
#: Rounds of (estimate, scale); the scale settles to 1e-6 in three to five.
MAX_ROUNDS = 20
#: Difference of ln vs below which two starts ended at the same estimate.
SAME_VELOCITY = 0.05
#: Difference of cost, half the deviance, below which another estimate is a rival (p = 0.05 for one parameter).
HARDLY_WORSE = 1.92


@dataclass(frozen=True)
class RobustEstimate:
    """Robust estimate in internal coordinates.

    Attributes
    ----------
    q : ndarray, shape (p,)
    scale : float
        Robust standard deviation of the whitened residuals (1 if the stated standard errors are right).
    residual : ndarray, shape (n,)
        Whitened residuals (friction - model) / stderr.
    jacobian : ndarray, shape (n, p)
        Whitened derivative of the model by the internal coordinates.
    weight : ndarray, shape (n,)
        Huber weights in (0, 1]; below 1 for outliers.
    pseudo : ndarray, shape (n,)
        Pseudo-values: plain least squares on them has this estimate and this variance.
    variance : float
        Variance of the whitened pseudo-values about the model, with the small-sample factor.
    active : ndarray of bool, shape (p,)
        Coordinates at a bound.
    cost : float
        Sum of the loss at `scale`.
    starts, agreeing : int
        Number of starts, and of those that ended at this estimate.
    rival : float
        Stribeck velocity, m/s, of another estimate that is not significantly worse (p > 0.05); NaN without one.
    """

    q: Array
    scale: float
    residual: Array
    jacobian: Array
    weight: Array
    pseudo: Array
    variance: float
    active: NDArray[np.bool_]
    cost: float
    starts: int = 1
    agreeing: int = 1
    rival: float = float("nan")


def estimate(
    model: StaticLaw,
    data: Observations,
    *,
    loss: str = "huber",
    fixed_scale: bool = False,
    starts: Sequence[Array] = (),
) -> RobustEstimate:
    """Estimate the free parameters of `model` robustly.

    Parameters
    ----------
    model : StaticLaw
    data : Observations
    loss : str
        ``linear`` (plain weighted least squares) or a name in ``LOSSES``. The scale is always Huber's, because a loss
        without weight for far outliers does not define a scale.
    fixed_scale : bool
        Treat the stated standard errors as exact (required without more rows than parameters).
    starts : sequence of ndarray, shape (p,)
        Internal coordinates to start from; by default those of `starting_points`.

    Returns
    -------
    RobustEstimate
    """
    if loss not in ("linear", "huber"):
        near = estimate(model, data, fixed_scale=fixed_scale, starts=starts)
        q = _polish(model, data, near.q, LOSSES[loss], near.scale)[0]
        found = _describe(model, data, q, near.scale, LOSSES[loss], fixed_scale)
        return replace(found, starts=near.starts, agreeing=near.agreeing, rival=near.rival)
    kind = LINEAR if loss == "linear" else LOSSES[loss]
    dof = _freedom(model, data)
    floor = SCALE_FLOOR * float(np.max(np.abs(data.friction_n)) / np.median(data.stderr_n))
    starts = starts or model.starting_points(data)
    scale = 1.0 if fixed_scale else max(_mad(_residual(model, starts[0], data), dof), floor)
    candidates = [_polish(model, data, q, kind, scale) for q in starts]
    q, best = min(candidates, key=lambda c: c[1])
    near = [c for c in candidates if c[1] <= best + HARDLY_WORSE * scale**2]
    others = [c[0] for c in near if model.stribeck and abs(c[0][2] - q[2]) > SAME_VELOCITY]
    counts = {
        "starts": len(starts),
        "agreeing": len(near) - len(others),
        "rival": float(np.exp(others[0][2])) if others else float("nan"),
    }
    for _ in range(0 if fixed_scale else MAX_ROUNDS):
        updated = max(proposal_2(_residual(model, q, data), scale, dof, kind.tuning), floor)
        done = abs(updated / scale - 1.0) < 1e-6
        scale = updated
        if done or kind is LINEAR:
            break
        q = _polish(model, data, q, kind, scale)[0]
    found = _describe(model, data, q, scale, kind, fixed_scale)
    return replace(found, **counts)


def _freedom(model: StaticLaw, data: Observations) -> int:
    return max(len(data) - len(model.names) - model.chosen, 1)


def deviance(data: Observations, found: RobustEstimate) -> float:
    """Return twice the negative log-likelihood of the density with the loss as logarithm [huber2009], up to a constant.

    The density is normal for a quadratic loss.
    """
    return 2.0 * (found.cost + len(data) * np.log(found.scale) + float(np.sum(np.log(data.stderr_n))))


def _residual(model: StaticLaw, q: Array, data: Observations) -> Array:
    return (data.friction_n - model.value(q, data)) / data.stderr_n


def _polish(model: StaticLaw, data: Observations, q: Array, kind: Loss, scale: float) -> tuple[Array, float]:
    from scipy.optimize import least_squares

    lower, upper = model.bounds(data)
    memo: dict[bytes, tuple[Array, Array]] = {}

    def both(x: Array) -> tuple[Array, Array]:
        key = x.tobytes()
        if key not in memo:
            memo.clear()
            value, jac = model.value_and_jacobian(x, data)
            memo[key] = (value - data.friction_n) / data.stderr_n, jac / data.stderr_n[:, None]
        return memo[key]

    found = least_squares(
        lambda x: both(x)[0],
        np.clip(q, lower, upper),
        jac=lambda x: both(x)[1],  # pyright: ignore[reportArgumentType]
        bounds=(lower, upper),
        x_scale="jac",
        loss=kind.scipy,  # pyright: ignore[reportArgumentType]
        f_scale=1.0 if kind is LINEAR else kind.tuning * scale,
        xtol=1e-10,
        ftol=1e-12,
        gtol=1e-12,
        max_nfev=200,
    )
    return found.x, float(found.cost)


def _mad(residual: Array, dof: int) -> float:
    """Return the median absolute deviation from zero as a standard deviation, with a small-sample factor."""
    return robust_deviation(residual) * float(np.sqrt(residual.size / dof))


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
        factor = float(np.sqrt(np.sum(psi**2) / (dof * expected)))
        scale *= factor
        if abs(factor - 1.0) < 1e-9:
            break
    return scale


def _describe(
    model: StaticLaw, data: Observations, q: Array, scale: float, kind: Loss, fixed_scale: bool
) -> RobustEstimate:
    value, jac = model.value_and_jacobian(q, data)
    residual = (data.friction_n - value) / data.stderr_n
    u = residual / scale
    psi, slope = kind.psi(u), kind.slope(u)
    mean_slope = max(float(np.mean(slope)), 1.0 / u.size)
    # Huber's small-sample factor for regression [huber2009]
    correction = 1.0 + len(model.names) / u.size * float(np.var(slope)) / mean_slope**2
    variance = correction**2 * float(np.sum(psi**2)) / _freedom(model, data) * (scale / mean_slope) ** 2
    if fixed_scale:
        variance = 1.0
    weight = np.where(np.abs(u) > 1e-12, psi / np.where(np.abs(u) > 1e-12, u, 1.0), 1.0)
    lower, upper = model.bounds(data)
    reach = 1e-6 * np.maximum(np.abs(q), 1.0)
    active = (q - lower < reach) | (upper - q < reach)
    if model.stribeck:  # an excess indistinguishable from zero counts as at its bound
        active[1] = active[1] or np.exp(q[1]) < 1e-6 * np.max(np.abs(data.friction_n))
    return RobustEstimate(
        q=q,
        scale=scale,
        residual=residual,
        jacobian=jac / data.stderr_n[:, None],
        weight=weight,
        pseudo=value + data.stderr_n * psi * scale / mean_slope,
        variance=variance,
        active=active,
        cost=float(np.sum(kind.rho(u))),
    )
