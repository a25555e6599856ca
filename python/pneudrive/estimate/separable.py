"""Least squares of laws that are linear but for a shape: all shapes of a grid at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Columns whose singular value is below this share of the largest carry nothing.
NEGLIGIBLE = 1e-10


@dataclass(frozen=True, eq=False)
class Scan:
    """Linear fits over a grid of g shapes.

    Attributes
    ----------
    cost : ndarray, shape (g,)
        Sum of squared whitened residuals.
    coefficient : ndarray, shape (g, p)
    covariance : ndarray, shape (g, p, p)
        Of the coefficients, for unit variance.
    """

    cost: Array
    coefficient: Array
    covariance: Array

    @property
    def best(self) -> int:
        """Index of the best shape."""
        return int(np.argmin(self.cost))


def scan(designs: Array, values: Array) -> Scan:
    """Fit at every shape.

    Parameters
    ----------
    designs : ndarray, shape (g, n, p)
        Whitened.
    values : ndarray, shape (n,)
        Whitened.
    """
    size = np.linalg.norm(designs, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    scaled = designs / size
    inverse = np.linalg.pinv(scaled, rcond=NEGLIGIBLE)
    found = inverse @ values
    rest = values - np.einsum("gnp,gp->gn", scaled, found)
    factor = size[:, 0, :]
    covariance = (inverse @ inverse.swapaxes(1, 2)) / (factor[:, :, None] * factor[:, None, :])
    return Scan(np.einsum("gn,gn->g", rest, rest), found / factor, covariance)
