"""Type aliases for arrays, intervals, rows and plain data, and helpers for names and indices."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

#: Array of real numbers.
Array: TypeAlias = NDArray[np.float64]
#: Array of booleans, and array of integers.
Bools: TypeAlias = NDArray[np.bool_]
Ints: TypeAlias = NDArray[np.int64]
#: Two arrays: values and derivatives, or lower and upper ends.
ArrayPair: TypeAlias = tuple[Array, Array]
#: Columns of a table.
Columns: TypeAlias = dict[str, Array]
#: Lower and upper end.
Interval: TypeAlias = tuple[float, float]
#: Two numbers: one for each chamber, or the coordinates of a point.
Pair: TypeAlias = tuple[float, float]
#: Values by column or key.
Row: TypeAlias = dict[str, Any]
#: Real numbers by name.
NamedNumbers: TypeAlias = dict[str, float]
#: Intervals by name.
NamedIntervals: TypeAlias = dict[str, Interval]
#: Plain data by key, as in TOML and JSON: writable, and read-only.
Plain: TypeAlias = dict[str, Any]
Keyed: TypeAlias = Mapping[str, Any]

Name = TypeVar("Name")
Value = TypeVar("Value")


def by_name(names: Iterable[Name], values: Iterable[Value]) -> dict[Name, Value]:
    """Map names to values. Values of an array become Python numbers.

    Examples
    --------
    >>> by_name("ab", np.array([1.0, 2.0]))
    {'a': 1.0, 'b': 2.0}
    """
    return dict(zip(names, values.tolist() if isinstance(values, np.ndarray) else values, strict=True))


def attributes_of(record: object, *names: str) -> Plain:
    """Return the named attributes of a record as a dictionary."""
    return {name: getattr(record, name) for name in names}


def rows_of(columns: Mapping[str, Array], rows: Bools | Ints | slice) -> Columns:
    """Return the selected rows of each column."""
    return {name: column[rows] for name, column in columns.items()}


def groups_by(values: Sequence[float], is_apart: Callable[[float, float], bool]) -> list[slice]:
    """Return the groups of ascending values as slices.

    A value begins a new group if ``is_apart(lowest, value)``. ``lowest`` is the first value of the current group.
    """
    starts: list[int] = []
    for i, value in enumerate(values):
        if not starts or is_apart(values[starts[-1]], value):
            starts.append(i)
    return [slice(*ends) for ends in pairwise([*starts, len(values)])]


def evenly(count: int, most: int) -> Ints:
    """Return at most `most` indices, evenly spread from 0 to ``count - 1``.

    Examples
    --------
    >>> evenly(10, 4), evenly(2, 4)
    (array([0, 3, 6, 9]), array([0, 1]))
    """
    return np.unique(np.linspace(0, count - 1, most).astype(np.int64))
