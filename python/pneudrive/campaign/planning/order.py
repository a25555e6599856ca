"""The order in which cells are run within a block, and blocks within a campaign."""

from __future__ import annotations

import hashlib
from itertools import product
from typing import TYPE_CHECKING, TypeVar

from pneudrive.campaign.planning.points import Cell, pairs, stop_cells, sweep_cells

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pneudrive.campaign.planning.protocol import Protocol

T = TypeVar("T")


def ordered_blocks(protocol: Protocol) -> list[dict[str, str]]:
    """Return the levels of the hard-to-change factors block by block, one replicate after the other.

    Equal levels of the factor that is hardest to change follow each other, even if levels are shuffled.
    """
    blocks: list[dict[str, str]] = []
    for replicate in range(1, protocol.order.replicates + 1):
        shuffled: list[list[str]] = []
        for name, factor in protocol.hard.items():
            levels = factor.levels
            if protocol.order.kind == "randomised":
                levels = shuffle(levels, str, f"{protocol.seed}/replicate {replicate}/{name}")
            shuffled.append(levels)
        blocks += [dict(zip(protocol.hard, levels, strict=True)) for levels in product(*shuffled)]
    return blocks


def ordered_cells(protocol: Protocol, block: int) -> list[tuple[Cell, int]]:
    """Return the cells of a block with their repeat (from 1) in running order."""
    repeats = range(1, protocol.repeats + 1)
    families = (sweep_cells(protocol), stop_cells(protocol))
    kind = protocol.order.kind
    if kind == "as-given":  # a change of pressure is slow: the list is repeated at each pressure
        out = []
        for cells in families:
            for pair in pairs(protocol):
                here = [cell for cell in cells if cell.pressures == pair]
                out += [(cell, repeat) for repeat in repeats for cell in here]
        return out
    if kind == "interleaved":
        return [(cell, repeat) for repeat in repeats for cells in families for cell in _interleaved(cells)]
    every = [cell for cells in families for cell in cells]
    return [
        (cell, repeat)
        for repeat in repeats
        for cell in shuffle(every, lambda cell: cell.name, f"{protocol.seed}/b{block}/r{repeat}")
    ]


def shuffle(items: Sequence[T], name: Callable[[T], str], seed: str) -> list[T]:
    """Shuffle by the hash of seed and name.

    The order is equal on every machine and version, and independent of other items.
    """
    return sorted(items, key=lambda item: hashlib.sha256(f"{seed}\0{name(item)}".encode()).digest())


def alternate(items: Sequence[T]) -> list[T]:
    """Take items alternately from the first and the second half, which separates neighbouring levels in time.

    Examples
    --------
    >>> alternate([1, 2, 3, 4, 5])
    [1, 4, 2, 5, 3]
    """
    half = (len(items) + 1) // 2
    out: list[T] = []
    for index in range(half):
        out += items[index : index + 1]
        out += items[half + index : half + index + 1]
    return out


def _interleaved(cells: list[Cell]) -> list[Cell]:
    """Alternate within each pressure; pressures follow one after the other."""
    by_pressure: dict[str, list[Cell]] = {}
    for cell in cells:
        by_pressure.setdefault(cell.pressures.name, []).append(cell)
    columns = [alternate(group) for group in alternate(list(by_pressure.values()))]
    return [cell for row in zip(*columns, strict=True) for cell in row]
