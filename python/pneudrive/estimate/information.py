"""What derivatives say of the values they belong to: covariance, and directions without information [bates1988]."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Singular values of the scaled Jacobian below this share of the largest are directions without information.
SINGULAR_SHARE = 1e-4
#: Share of such a direction from which a coordinate takes part in it.
TAKES_PART = 0.3


def covariance_of(jacobian: Array, variance: float = 1.0) -> Array:
    """Covariance of the coordinates of a least-squares problem; directions without information are left out.

    Parameters
    ----------
    jacobian : ndarray, shape (n, p)
        Derivatives of the residuals.
    variance : float
        Of one residual.

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
    """Change of the coordinates with the residuals, shape (p,), along the directions that carry information."""
    size = _sizes(jacobian)
    return np.linalg.pinv(jacobian / size, rcond=SINGULAR_SHARE) @ residual / size


def weak_coordinates(jacobian: Array) -> NDArray[np.bool_]:
    """Return which coordinates have no effect, or take part in a direction without information.

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
