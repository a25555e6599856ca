"""Lowest and highest value of every column of pixels, so that no sample of a recording is lost on the screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def low_high(values: Array, edges: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return the lowest and the highest value between successive edges; NaN where all are NaN.

    Parameters
    ----------
    values : ndarray, shape (n,)
    edges : ndarray, shape (m + 1,)
        Rising indices from 0 to n.
    """
    starts = edges[:-1]
    return np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
