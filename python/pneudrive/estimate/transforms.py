"""Transforms between bounded values and the unbounded coordinates of a search.

    signed                x = size q
    above a bound         x = lower + exp(q)
    between two bounds    x = lower + (upper - lower) / (1 + exp(-q))
    an excess             x = base + exp(q), base another value or a number

The Jacobians are exact. First-order intervals are computed on the scale of the coordinate: the logarithm of a positive
value, the logit of a value between two bounds [bates1988].
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

#: Smallest distance from a bound, as a share of the range between two bounds.
MARGIN = 1e-6
#: Largest exponent of the factors of an interval.
MOST_EXPONENT = 700.0


class Transforms:
    """Transform between p values and their coordinates.

    Parameters
    ----------
    lower, upper : array_like, shape (p,)
        Open bounds; a value without a lower bound is signed.
    size : array_like, shape (p,)
        Usual change of a signed value.
    excess : int, optional
        Value whose excess over another one is positive.
    over : int or float
        The other value: its index, or a constant.
    least_excess : float
        Smallest excess, relative to the other value. A smaller excess is raised to this.

    Examples
    --------
    >>> scales = Transforms([0.0, 0.0], excess=1, over=0)
    >>> q = scales.internal([30.0, 40.0])
    >>> q.round(3), scales.natural(q).round(9)
    (array([3.401, 2.303]), array([30., 40.]))
    >>> scales.jacobian(q).round(9)
    array([[30.,  0.],
           [30., 10.]])
    """

    def __init__(
        self,
        lower: ArrayLike,
        upper: ArrayLike = np.inf,
        size: ArrayLike = 1.0,
        *,
        excess: int | None = None,
        over: float = 0,
        least_excess: float = 1e-9,
    ) -> None:
        lower = np.array(lower, dtype=np.float64)
        self.lower, self.upper, self.size = (np.array(np.broadcast_to(x, lower.shape)) for x in (lower, upper, size))
        self.excess, self.over, self.least_excess = excess, over, least_excess
        if excess is not None:
            self.lower[excess], self.upper[excess] = 0.0, np.inf
        self.signed = np.isinf(self.lower)
        self._odds = ~self.signed & np.isfinite(self.upper)
        self._log = ~self.signed & ~self._odds

    def _base(self, values: Array) -> Any:  # noqa: ANN401 - a number, or one for each point
        return values[..., self.over] if isinstance(self.over, int) else self.over

    def internal(self, values: ArrayLike) -> Array:
        """Return the coordinates of values, shape (p,)."""
        x = np.array(values, dtype=np.float64)
        if self.excess is not None:
            base = self._base(x)
            x[self.excess] = max(x[self.excess] - base, self.least_excess * max(abs(base), 1e-12))
        q = x / self.size
        q[self._log] = np.log((x - self.lower)[self._log])
        if self._odds.any():
            low, high = self.lower[self._odds], self.upper[self._odds]
            inside = np.clip(x[self._odds], low + MARGIN * (high - low), high - MARGIN * (high - low))
            q[self._odds] = np.log((inside - low) / (high - inside))
        return q

    def natural(self, q: Array) -> Array:
        """Return the values at coordinates, shape (p,), or at many points, shape (n, p)."""
        x = self.size * q
        x[..., self._log] = self.lower[self._log] + _exp(q[..., self._log])
        if self._odds.any():
            low, high = self.lower[self._odds], self.upper[self._odds]
            x[..., self._odds] = low + (high - low) * (1.0 / (1.0 + _exp(-q[..., self._odds])))
        if self.excess is not None:
            x[..., self.excess] += self._base(x)
        return x

    def jacobian(self, q: Array) -> Array:
        """Return the derivatives of the values by the coordinates, shape (p, p)."""
        slope = self.size.copy()
        slope[self._log] = _exp(q[self._log])
        if self._odds.any():
            share = 1.0 / (1.0 + _exp(-q[self._odds]))
            slope[self._odds] = (self.upper - self.lower)[self._odds] * share * (1.0 - share)
        out = np.diag(slope)
        if self.excess is not None and isinstance(self.over, int):
            out[self.excess, self.over] = slope[self.over]
        return out


def _exp(q: Array) -> Array:
    """Return exp(q); infinite beyond the largest number, without a warning."""
    with np.errstate(over="ignore"):
        return np.exp(q)


def intervals(values: Array, reach: Array, lower: ArrayLike, upper: ArrayLike = np.inf) -> tuple[Array, Array]:
    """Return first-order intervals on the scales of the coordinates, shape (p,) for each end.

    Parameters
    ----------
    values, reach : ndarray, shape (p,)
        Values within their bounds, and half widths of their first-order intervals.
    lower, upper : array_like, shape (p,)
        Bounds, as for `Transforms`.

    Examples
    --------
    >>> low, high = intervals(np.array([10.0, -1.0]), np.array([2.0, 3.0]), [0.0, -np.inf])
    >>> low.round(3), high.round(3)
    (array([ 8.187, -4.   ]), array([12.214,  2.   ]))
    """
    lower, upper = (np.broadcast_to(np.asarray(x, dtype=np.float64), values.shape) for x in (lower, upper))
    low, high = values - reach, values + reach
    for k in np.flatnonzero(np.isfinite(lower)):
        above = values[k] - lower[k]
        if np.isinf(upper[k]):
            factor = np.exp(min(reach[k] / above, MOST_EXPONENT))
            low[k], high[k] = lower[k] + above / factor, lower[k] + above * factor
            continue
        room, below = upper[k] - lower[k], upper[k] - values[k]
        factor = np.exp(min(reach[k] * room / (above * below), MOST_EXPONENT))
        odds = above / below
        low[k], high[k] = (lower[k] + room * (o / (1.0 + o)) for o in (odds / factor, odds * factor))
    return low, high
