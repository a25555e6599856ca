"""Sensitivity of a function to its arguments: Sobol indices and Morris' elementary effects.

Both methods use points in the unit cube. The caller converts them to the distribution of each argument.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import qmc

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Half a cell of scipy's Sobol points, which are multiples of 2^-30: none lies on a face of the cube.
HALF_CELL = 2.0**-31
#: Resamples of the bootstrap that are evaluated together.
RESAMPLED = 50


@dataclass(frozen=True)
class SobolIndices:
    """Fractions of the variance of each output that arguments cause, with intervals.

    Attributes
    ----------
    first, total : ndarray, shape (d, s)
        Fraction that an argument causes alone, and with all its interactions, for s outputs.
    first_interval, total_interval : ndarray, shape (2, d, s)
        Lower and upper end, by the bootstrap.
    rows : ndarray of int, shape (s,)
        Number of base points that count for an output: those with finite values only.
    """

    first: Array
    total: Array
    first_interval: Array
    total_interval: Array
    rows: NDArray[np.int64]


def sobol_points(n: int, d: int, seed: int) -> Array:
    """Return the points at which Sobol indices are estimated, shape (n (d + 2), d), within the unit cube.

    The points are n points A, n points B, and for each argument the points A with this argument from B [saltelli2010].
    A and B are
    halves of one scrambled Sobol sequence in 2 d dimensions; n should be a power of 2.
    """
    both = qmc.Sobol(2 * d, scramble=True, rng=seed).random_base2(int(np.ceil(np.log2(n))))[:n] + HALF_CELL
    a, b = both[:, :d], both[:, d:]
    mixed = np.repeat(a[None], d, axis=0)
    for k in range(d):
        mixed[k, :, k] = b[:, k]
    return np.concatenate([a, b, mixed.reshape(-1, d)])


def sobol_indices(
    values: Array, d: int, *, confidence: float = 0.95, resamples: int = 1000, seed: int = 0
) -> SobolIndices:
    """Estimate Sobol indices of first and total order.

    First order by Saltelli's estimator of 2010, total by Jansen's: ``S_i = mean(f_B (f_ABi - f_A)) / V`` and ``T_i =
    mean((f_A - f_ABi)^2) / (2 V)``. V is the variance of f over A and B, and f is taken minus its mean
    [saltelli2010,jansen1999].
    For each output, a base point is left out if one of its d + 2 values is not finite.

    Parameters
    ----------
    values : ndarray, shape (n (d + 2), s)
        Values of s outputs at the points of `sobol_points`.
    d : int
        Number of arguments.
    confidence : float
        Nominal coverage probability of an interval, from a percentile bootstrap over base points.
    resamples : int
        Number of bootstrap samples, rounded up to a multiple of 50.
    seed : int
        Random seed of the bootstrap.

    Returns
    -------
    SobolIndices
        NaN for an output that does not vary, or with less than 2 base points.
    """
    each = np.asarray(values, dtype=np.float64).reshape(d + 2, -1, np.shape(values)[1])
    s = each.shape[2]
    found, ends = np.full((2, d, s), np.nan), np.full((2, 2, d, s), np.nan)
    rows = np.zeros(s, dtype=np.int64)
    shares = [0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)]
    for k in range(s):
        f = each[:, np.isfinite(each[..., k]).all(axis=0), k]
        rows[k] = m = f.shape[1]
        if m < 2 or np.ptp(f[:2]) == 0.0:
            continue
        f = f - f[:2].mean()
        found[..., k] = _indices(f, np.full((1, m), 1.0 / m))[0]
        rng = np.random.default_rng([seed, k])
        again = [
            _indices(f, rng.multinomial(m, np.full(m, 1.0 / m), size=RESAMPLED) / m)
            for _ in range(0, resamples, RESAMPLED)
        ]
        ends[..., k] = np.moveaxis(np.nanquantile(np.concatenate(again), shares, axis=0), 1, 0)
    return SobolIndices(found[0], found[1], ends[0], ends[1], rows)


def _indices(f: Array, weights: Array) -> Array:
    """Return first and total order of one output, shape (r, 2, d), for r weightings of its base points.

    Parameters
    ----------
    f : ndarray, shape (d + 2, m)
        Values at A, B, and A with each argument of B.
    weights : ndarray, shape (r, m)
        Weights of the base points. Each row adds up to 1.
    """
    a, b, mixed = f[0], f[1], f[2:]
    mean, moved = weights @ (0.5 * (a + b)), mixed - a
    variance = weights @ (0.5 * (a * a + b * b)) - mean * mean
    first = weights @ (b * moved).T - mean[:, None] * (weights @ moved.T)
    with np.errstate(invalid="ignore", divide="ignore"):  # a resample that is all one point
        return np.stack([first, 0.5 * (weights @ (moved * moved).T)], axis=1) / variance[:, None, None]


@dataclass(frozen=True)
class ElementaryEffects:
    """Morris' measures of each argument for each output, in units of the output over the unit range of the argument.

    Attributes
    ----------
    mu, mu_star, sigma : ndarray, shape (d, s)
        Mean, mean of the absolute values, and standard deviation of the elementary effects.
    mu_star_interval : ndarray, shape (2, d, s)
        Interval from the bootstrap.
    trajectories : ndarray of int, shape (s,)
        Base points that count for an output: those with finite values.
    """

    mu: Array
    mu_star: Array
    sigma: Array
    mu_star_interval: Array
    trajectories: NDArray[np.int64]


def morris_points(trajectories: int, d: int, seed: int, levels: int = 4) -> Array:
    """Return Morris' trajectories through a grid in the unit cube, shape (trajectories (d + 1), d) [morris1991].

    Each trajectory starts at a random point of a grid of `levels` cells. It moves one argument after the other, in
    random order and by levels / (2 (levels - 1)) of its range. The grid uses the centres of cells, so no point is on a
    face of the cube, where the value of a normal distribution would be infinite.
    """
    rng = np.random.default_rng(seed)
    step = levels // 2
    out = np.empty((trajectories, d + 1, d))
    for path in out:
        at = rng.integers(levels, size=d)
        path[0] = at
        for k, argument in enumerate(rng.permutation(d), start=1):
            at[argument] += step if at[argument] < step else -step
            path[k] = at
    return (out.reshape(-1, d) + 0.5) / levels


def elementary_effects(
    points: Array, values: Array, *, confidence: float = 0.95, resamples: int = 1000, seed: int = 0
) -> ElementaryEffects:
    """Estimate Morris' measures [morris1991], with the mean of absolute effects [campolongo2007].

    Parameters
    ----------
    points : ndarray, shape (trajectories (d + 1), d)
        Points from `morris_points`.
    values : ndarray, shape (trajectories (d + 1), s)
        Values of s outputs there; a trajectory with one that is not finite is left out, output by output.
    confidence, resamples, seed
        As for `sobol_indices`.

    Returns
    -------
    ElementaryEffects
        NaN for an output with less than 2 trajectories.
    """
    d, s = points.shape[1], values.shape[1]
    moves = np.diff(points.reshape(-1, d + 1, d), axis=1)
    order = np.abs(moves).argmax(axis=2)
    sizes = np.take_along_axis(moves, order[..., None], axis=2)
    effects = np.empty((len(moves), d, s))
    by_step = np.diff(values.reshape(-1, d + 1, s), axis=1) / sizes
    np.put_along_axis(effects, order[..., None], by_step, axis=1)
    complete = np.isfinite(effects.sum(axis=1))
    mu, star, sigma = (np.full((d, s), np.nan) for _ in range(3))
    interval = np.full((2, d, s), np.nan)
    ends = [0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)]
    for k in range(s):
        own = effects[complete[:, k], :, k]
        if len(own) < 2:
            continue
        mu[:, k], star[:, k], sigma[:, k] = own.mean(axis=0), np.abs(own).mean(axis=0), own.std(axis=0, ddof=1)
        picks = np.random.default_rng([seed, k]).integers(len(own), size=(resamples, len(own)))
        interval[..., k] = np.quantile(np.abs(own)[picks].mean(axis=1), ends, axis=0)
    return ElementaryEffects(mu, star, sigma, interval, complete.sum(axis=0))
