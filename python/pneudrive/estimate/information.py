"""Information of least-squares problems: covariance, and directions without information [bates1988]."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Share of the largest singular value of the scaled Jacobian below which a direction has no information.
SINGULAR_SHARE = 1e-4
#: Component of such a direction from which a coordinate counts as part of it.
TAKES_PART = 0.3


def covariance_of(jacobian: Array, variance: float = 1.0) -> Array:
    """Return the covariance of the coordinates of a least-squares problem, without directions without information.

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
    """Return the change of the coordinates with the residuals, shape (p,), along directions with information."""
    size = _sizes(jacobian)
    return np.linalg.pinv(jacobian / size, rcond=SINGULAR_SHARE) @ residual / size


def weak_coordinates(jacobian: Array) -> NDArray[np.bool_]:
    """Return a mask of coordinates without effect, or with a part in a direction without information.

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
