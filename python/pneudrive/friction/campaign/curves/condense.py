"""Grouping of the cycles of large campaigns: neighbouring repeats at one place count as one row of a model.

Memory of a mixed model grows with the square of its rows, time with their cube.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Whole = NDArray[np.int64]


def grouped(place: Whole, stretch: Whole, level: Whole, rows: int, cells: int) -> tuple[list[list[int]], int]:
    """Group successive cycles of one place, level and stretch of the campaign.

    Where there are very many combinations of the three, neighbouring stretches of the same levels count as one, then
    neighbouring levels.

    Parameters
    ----------
    place, stretch, level : ndarray of int, shape (n,)
        Of each cycle, in the order in which they were run; from 0.
    rows : int
        Approximate number of groups.
    cells : int
        Most combinations that stay separate.

    Returns
    -------
    list of list of int
        Members of each group, in the order of their middle ones; together every cycle once.
    int
        Number of neighbouring levels that count as one.
    """
    stretches = levels = 1
    while np.unique(cell := _cells(place, stretch // stretches, level // levels)).size > cells:
        if stretches <= stretch.max():
            stretches += 1
        elif levels <= level.max():
            levels += 1
        else:
            break
    members: dict[int, list[int]] = {}
    for i, key in enumerate(cell.tolist()):
        members.setdefault(key, []).append(i)
    each = -(-cell.size // rows)
    groups = [some[k : k + each] for some in members.values() for k in range(0, len(some), each)]
    groups.sort(key=lambda group: group[len(group) // 2])
    return groups, levels


def _cells(place: Whole, stretch: Whole, level: Whole) -> Whole:
    """Return one number for each combination."""
    return (place * (level.max() + 1) + level) * (stretch.max() + 1) + stretch
