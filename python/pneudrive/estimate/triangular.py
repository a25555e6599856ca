"""Positive definite and triangular systems with LAPACK only.

Arguments are not checked, because small systems are solved very often and the checks would take most of the time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def factorise(matrix: Array) -> Array:
    """Return the lower Cholesky factor L of a symmetric positive definite matrix L L^T, shape (n, n).

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is not positive definite.
    """
    from scipy.linalg.lapack import dpotrf  # pyright: ignore[reportAttributeAccessIssue] - it has no stub

    lower, info = dpotrf(matrix, lower=True, clean=True)
    if info:
        raise np.linalg.LinAlgError(f"the leading minor of order {info} is not positive definite")
    return lower


def solve_factorised(lower: Array, right: Array) -> Array:
    """Return the solution of ``L L^T x = right``, shape (n,) or (n, m)."""
    from scipy.linalg.lapack import dpotrs  # pyright: ignore[reportAttributeAccessIssue] - it has no stub

    return dpotrs(lower, right, lower=True)[0]


def solve_lower(lower: Array, right: Array) -> Array:
    """Return the solution of ``L x = right`` with a lower triangle, shape (n,) or (n, m).

    Examples
    --------
    >>> solve_lower(np.array([[2.0, 0.0], [1.0, 1.0]]), np.array([4.0, 5.0]))
    array([2., 3.])
    """
    return _solve(lower, right, is_lower=True)


def solve_upper(upper: Array, right: Array) -> Array:
    """Return the solution of ``U x = right`` with an upper triangle, shape (n,) or (n, m)."""
    return _solve(upper, right, is_lower=False)


def _solve(triangle: Array, right: Array, *, is_lower: bool) -> Array:
    from scipy.linalg.lapack import dtrtrs  # pyright: ignore[reportAttributeAccessIssue]

    if not right.size:
        return np.empty_like(right)
    if triangle.flags.f_contiguous:
        found, info = dtrtrs(triangle, right, lower=is_lower)
    else:  # LAPACK reads columns: the transposed triangle
        found, info = dtrtrs(triangle.T, right, lower=not is_lower, trans=1)
    if info:
        raise np.linalg.LinAlgError(f"the triangle has a zero in row {info - 1}")
    return found
