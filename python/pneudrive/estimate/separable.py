"""Least squares of laws that are linear except for shape parameters: grid of shapes, and intervals by profile.

At each shape, a linear fit gives the best coefficients, so that the profile over the shape needs no repeated fits. An
interval is open if the data set no bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import student

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


#: Share of the largest singular value below which a direction is left out.
NEGLIGIBLE = 1e-10


@dataclass(frozen=True, eq=False)
class Scan:
    """Linear fits over a grid of g shapes.

    Attributes
    ----------
    shape : ndarray, shape (g, k)
    cost : ndarray, shape (g,)
        Sum of squared whitened residuals.
    coefficient : ndarray, shape (g, p)
    covariance : ndarray, shape (g, p, p)
        Covariance of the coefficients, for unit variance.
    """

    shape: Array
    cost: Array
    coefficient: Array
    covariance: Array

    @property
    def best(self) -> int:
        """Index of the best shape."""
        return int(np.argmin(self.cost))

    def scale(self, freedom: float, least: float = 0.0) -> float:
        """Return the variance of the whitened residuals, not below `least`."""
        return max(float(self.cost[self.best]) / freedom, least)

    def rise(self, freedom: float, least: float = 0.0) -> float:
        """Return the rise of the cost at the ends of the 95 % interval of one quantity."""
        return self.scale(freedom, least) * student(freedom) ** 2

    def inside(self, rise: float) -> NDArray[np.intp]:
        """Return a mask of the shapes whose cost exceeds the smallest one by at most `rise`."""
        return np.flatnonzero(self.cost <= self.cost[self.best] + rise)

    def interval(self, rows: Array, rise: float) -> tuple[float, float]:
        """Return the interval of a linear function of the coefficients over all shapes within `rise`.

        Parameters
        ----------
        rows : ndarray, shape (g, p) or (p,)
        rise : float
        """
        inside = self.inside(rise)
        rows = np.broadcast_to(rows, self.coefficient.shape)[inside]
        slack = np.maximum(self.cost[self.best] + rise - self.cost[inside], 0.0)
        value = np.einsum("gi,gi->g", rows, self.coefficient[inside])
        variance = np.einsum("gi,gij,gj->g", rows, self.covariance[inside], rows)
        reach = np.sqrt(slack) * np.sqrt(np.maximum(variance, 0.0))
        return float((value - reach).min()), float((value + reach).max())

    def shape_interval(self, k: int, rise: float, sought: tuple[float, float]) -> tuple[float, float]:
        """Return the interval of a shape parameter; an end is 0 or inf if it reaches the end of the grid."""
        allowed = self.shape[self.inside(rise), k]
        low, high = float(allowed.min()), float(allowed.max())
        return (
            0.0 if low <= sought[0] * (1.0 + 1e-9) else low,
            float("inf") if high >= sought[1] * (1.0 - 1e-9) else high,
        )


def scan(shape: Array, designs: Array, values: Array) -> Scan:
    """Fit at every shape.

    Parameters
    ----------
    shape : ndarray, shape (g, k)
    designs : ndarray, shape (g, n, p)
        Whitened design matrix of each shape.
    values : ndarray, shape (n,)
        Whitened observations.

    Examples
    --------
    A decay over a length of 2, among three lengths:

    >>> x, lengths = np.arange(6.0), np.array([[1.0], [2.0], [4.0]])
    >>> found = scan(lengths, np.exp(-x / lengths)[:, :, None], 3.0 * np.exp(-x / 2.0))
    >>> found.shape[found.best].tolist(), found.coefficient[found.best].round(6).tolist()
    ([2.0], [3.0])
    """
    size = np.linalg.norm(designs, axis=1, keepdims=True)
    size[size == 0.0] = 1.0
    scaled = designs / size
    q, r = np.linalg.qr(scaled)  # r has the singular values of the design, and is small
    inverse = np.linalg.pinv(r, rcond=NEGLIGIBLE)
    found = (inverse @ (q.swapaxes(1, 2) @ values)[:, :, None])[:, :, 0]
    rest = values - np.einsum("gnp,gp->gn", scaled, found)
    factor = size[:, 0, :]
    covariance = (inverse @ inverse.swapaxes(1, 2)) / (factor[:, :, None] * factor[:, None, :])
    return Scan(shape, np.einsum("gn,gn->g", rest, rest), found / factor, covariance)


def refined(at: Callable[[Array], Scan], coarse: Array, count: int, rise: Callable[[Scan], float]) -> Scan:
    """Scan a first shape parameter, then `count` values of it in the range that the first scan allows.

    Parameters
    ----------
    at : callable
        Values of the parameter -> scan of shapes with these values.
    coarse : ndarray
        First values, ascending, in logarithmic steps.
    count : int
    rise : callable
        Scan -> allowed rise of the cost.
    """
    first = at(coarse)
    allowed = np.searchsorted(coarse, first.shape[first.inside(rise(first)), 0])
    low, high = max(int(allowed.min()) - 1, 0), min(int(allowed.max()) + 1, coarse.size - 1)
    return at(np.geomspace(coarse[low], coarse[high], count))


def corrected_criterion(deviance: float, parameters: int, n: int) -> float:
    """Return Akaike's criterion corrected for few data [burnham2002]; inf for too few data.

    Examples
    --------
    >>> corrected_criterion(10.0, 2, 8)
    16.4
    """
    spare = n - parameters - 1
    return float(deviance + 2 * parameters + 2 * parameters * (parameters + 1) / spare) if spare > 0 else float("inf")


# --- Positive definite and triangular systems with LAPACK only.
#
# Arguments are not checked, because small systems are solved very often and the checks would take most of the time.


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
