"""Covariances of smooth functions for random effects of mixed models, shape (m, n) for m and n points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def integrated_wiener(s: Array, t: Array) -> Array:
    """Return the covariance of an integrated Wiener process with variance 1 at 1.

    Its estimate is the cubic spline [wahba1983].

    Examples
    --------
    >>> integrated_wiener(np.array([1.0]), np.array([0.5, 1.0])).tolist()
    [[0.3125, 1.0]]
    """
    low = np.minimum(s[:, None], t[None, :])
    high = np.maximum(s[:, None], t[None, :])
    return low**2 * (3.0 * high - low) / 2.0


def matern(s: Array, t: Array, reach: float) -> Array:
    """Return the covariance of a function that is smooth over `reach` and uncorrelated far beyond (Matern 3/2).

    Examples
    --------
    >>> matern(np.array([0.0]), np.array([0.0, 1.0]), 1.0).round(4).tolist()
    [[1.0, 0.4834]]
    """
    away = np.sqrt(3.0) * np.abs(s[:, None] - t[None, :]) / reach
    return (1.0 + away) * np.exp(-away)


def gaussian(s: Array, t: Array, reach: float) -> Array:
    """Return the squared-exponential covariance, of a very smooth function with correlation length `reach`."""
    away = (s[:, None] - t[None, :]) / reach
    return np.exp(-0.5 * away * away)


def centred_walk(order: Array) -> Array:
    """Return the covariance of a random walk over the observations' order, minus its mean, shape (n, n)."""
    walk = np.minimum(order[:, None], order[None, :])
    walk = walk - walk.mean(axis=0, keepdims=True)
    return walk - walk.mean(axis=1, keepdims=True)
