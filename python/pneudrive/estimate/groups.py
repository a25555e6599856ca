"""Groups of values that are equal except for noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def levels(values: NDArray[np.float64], reach: float) -> NDArray[np.int64]:
    """Return the level number of each value. A level contains the values within `reach` of its smallest value.

    Examples
    --------
    >>> levels(np.array([3.0, 1.0, 1.1, 2.9]), 0.2).tolist()
    [1, 0, 0, 1]
    """
    level = np.zeros(values.size, dtype=np.int64)
    least, number = -np.inf, -1
    for i in np.argsort(values):
        if values[i] - least > reach:
            least, number = values[i], number + 1
        level[i] = number
    return level


def means(group: NDArray[np.int64], *columns: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the mean of each column over each group; every group has members.

    Examples
    --------
    >>> [one.tolist() for one in means(np.array([0, 0, 1]), np.array([1.0, 3.0, 5.0]))]
    [[2.0, 5.0]]
    """
    count = np.bincount(group)
    return [np.bincount(group, column) / count for column in columns]


def cells(*columns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of each row's combination of values, from columns of shape (n,).

    Examples
    --------
    >>> cells(np.array([0, 0, 1, 0]), np.array([2, 5, 2, 2])).tolist()
    [0, 1, 2, 0]
    """
    return np.unique(np.column_stack(columns), axis=0, return_inverse=True)[1].ravel()
