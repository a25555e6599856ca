"""Profile-likelihood intervals of a sliding law.

At a given Stribeck velocity and exponent, the law is linear in all other parameters. The profile therefore needs no
repeated fits: over a grid of these two parameters, linear least squares gives the cost, the best forces and their
variances. The interval
of a parameter is the union over the grid of values below the threshold of the cost. Unlike value +- t * standard error,
it is open if the data do not bound the parameter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.static.model import EXPONENT_BOUNDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.static.model import FrictionModel, Observations
    from pneudrive.identify.static.robust import RobustEstimate

    Array = NDArray[np.float64]

FINE_POINTS = 161
COARSE_POINTS = 81
EXPONENT_POINTS = 41
#: Number of values of the law in memory: the whole grid of a large map would take half a gigabyte.
MOST_AT_ONCE = 500_000
#: Share of the largest scaled singular value below which a direction has no information: far above rounding (1e-15),
#: far below the resolution of any measurement.
SINGULAR_SHARE = 1e-7


def profile_intervals(
    model: FrictionModel, data: Observations, found: RobustEstimate, quantile: float, least: float | None = None
) -> dict[str, tuple[float, float]]:
    """Return the intervals of all free parameters in natural units.

    Parameters
    ----------
    model : FrictionModel
    data : Observations
    found : RobustEstimate
        Estimate; its pseudo-values and variance define the equivalent plain least squares problem.
    quantile : float
        Two-sided Student quantile of the requested probability.
    least : float, optional
        Sum of squares of the best model; by default that of this model.

    Returns
    -------
    dict
        Name -> (lower, upper). Empty if no value is below the threshold. An end without a bound from the data is
        infinite, or zero for a non-negative parameter.
    """
    y = found.pseudo / data.stderr_n
    allowed = found.variance * quantile**2
    best = float(np.sum((y - model.value(found.q, data) / data.stderr_n) ** 2))
    if least is not None:
        if best > least + allowed:
            return {}
        best = least
    velocities, exponents = _grid(model, data, found, quantile)
    linear = [n for n in model.names if not n.startswith("stribeck_")]
    slack = np.empty((velocities.size, exponents.size))
    low = dict.fromkeys(model.names, np.inf)
    high = dict.fromkeys(model.names, -np.inf)
    for j, log_exponent in enumerate(exponents):
        parts = np.array_split(velocities, -(-velocities.size * len(data) // MOST_AT_ONCE))
        parts_of_grid = [_forces(model, data, y, linear, part, log_exponent) for part in parts]
        cost, value, spread = (np.concatenate(part) for part in zip(*parts_of_grid, strict=True))
        slack[:, j] = best + allowed - cost
        inside = slack[:, j] >= 0.0
        if not inside.any():
            continue
        reach = np.sqrt(slack[inside, j, None] * spread[inside])
        for k, name in enumerate(linear):
            low[name] = min(low[name], float(np.min(value[inside, k] - reach[:, k])))
            high[name] = max(high[name], float(np.max(value[inside, k] + reach[:, k])))
    if model.stribeck:
        low["stribeck_velocity"], high["stribeck_velocity"] = _crossings(velocities, slack.max(axis=1))
        if model.exponent is None:
            low["stribeck_exponent"], high["stribeck_exponent"] = _crossings(exponents, slack.max(axis=0))
    return _close(model, data, found, low, high)


def _crossings(log_value: Array, slack: Array) -> tuple[float, float]:
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


def _grid(model: FrictionModel, data: Observations, found: RobustEstimate, quantile: float) -> tuple[Array, Array]:
    """Return grids of log vs and log n: coarse over the whole range, fine about the estimate."""
    nothing = np.zeros(1)
    if not model.stribeck:
        return nothing, nothing
    lower, upper = model.bounds(data)
    size = np.linalg.norm(found.jacobian, axis=0)  # scaled, as squares of pressures are 1e10 times larger than forces
    size[size == 0.0] = 1.0
    information = found.jacobian.T @ found.jacobian / np.outer(size, size)
    covariance = found.variance * np.linalg.pinv(information, rcond=1e-12, hermitian=True) / np.outer(size, size)

    def around(k: int, coarse: int, fine: int) -> Array:
        half = 1.6 * quantile * float(np.sqrt(max(covariance[k, k], 0.0)))
        half = min(max(half, 1e-9), float(upper[k] - lower[k]))
        near = np.linspace(found.q[k] - half, found.q[k] + half, fine)
        far = np.linspace(lower[k], upper[k], coarse)
        return np.unique(np.clip(np.r_[near, far, found.q[k]], lower[k], upper[k]))

    if model.exponent is not None:
        return around(2, COARSE_POINTS, FINE_POINTS), nothing
    return around(2, EXPONENT_POINTS, EXPONENT_POINTS), around(3, EXPONENT_POINTS // 2, EXPONENT_POINTS // 2)


def _forces(
    model: FrictionModel, data: Observations, y: Array, linear: list[str], log_velocities: Array, log_exponent: float
) -> tuple[Array, Array, Array]:
    """Return cost (g,), forces (g, p) and their unit variances (g, p) of the linear problem at each velocity.

    A negative excess is held at zero.
    """
    columns = model.linear_columns(data, log_velocities, log_exponent) / data.stderr_n[:, None]
    cost, value, spread = _least_squares(columns, y)
    if not model.stribeck:
        return cost, value, spread
    c, s = linear.index("coulomb"), linear.index("breakaway")
    below = value[:, s] < value[:, c]
    if below.any():
        merged = columns[below]
        merged[..., c] += merged[..., s]
        keep = np.delete(np.arange(len(linear)), s)
        rows = np.flatnonzero(below)[:, None]
        cost[below], value[rows, keep], spread[rows, keep] = _least_squares(merged[..., keep], y)
        value[below, s], spread[below, s] = value[below, c], spread[below, c]
    return cost, value, spread


def _least_squares(columns: Array, y: Array) -> tuple[Array, Array, Array]:
    """Solve linear least squares, columns (g, n, p), with infinite variance for undetermined parameters."""
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


def _close(
    model: FrictionModel, data: Observations, found: RobustEstimate, low: dict[str, float], high: dict[str, float]
) -> dict[str, tuple[float, float]]:
    """Set ends that the data do not limit to infinity; for a non-negative parameter the lower end is zero."""
    lower, upper = model.bounds(data)
    estimate = dict(zip(model.names, model.natural(found.q), strict=True))
    out = {}
    for name in model.names:
        lo, hi = min(low[name], estimate[name]), max(high[name], estimate[name])
        if name == "stribeck_velocity":
            lo = 0.0 if lo <= np.exp(lower[2]) * 1.001 else lo
            hi = np.inf if hi >= np.exp(upper[2]) * 0.999 else hi
        elif name == "stribeck_exponent":
            lo = 0.0 if lo <= EXPONENT_BOUNDS[0] * 1.001 else lo
            hi = np.inf if hi >= EXPONENT_BOUNDS[1] * 0.999 else hi
        elif name in {"coulomb", "breakaway", "viscous"}:
            lo = max(lo, 0.0)
        out[name] = (float(lo), float(hi))
    return out
