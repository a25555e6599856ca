"""Cycles of a campaign in one Parquet file: their rows, and a reader part by part.

Form of a campaign file: Parquet, with one row for each sample. The rows of a cycle are together and in the order of
time. A column numbers the cycle (``cycle = { column = "cycle" }`` in the layout's ``[columns]``). The other columns are
those of any recording, and 32-bit floats are allowed. Time may restart in each cycle. Every cycle is treated as a
separate recording, by the same code.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.tables import open_table
from pneudrive.signals.importer import read_rows
from pneudrive.signals.layout import Layout, stem
from pneudrive.signals.load import to_recording
from pneudrive.signals.tables.text_table import column_number

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pneudrive.signals.recording import Recording

BATCH_SAMPLES = 2_000_000  # samples that a worker holds at once: about 100 MB with its copies


@dataclass(frozen=True)
class Cycles:
    """Part of a campaign file: first row of each cycle and the row after the last, with the cycles' numbers."""

    path: Path
    layout: Layout
    bounds: NDArray[np.int64]
    numbers: NDArray[np.int64]

    def __len__(self) -> int:
        """Return the number of cycles."""
        return self.numbers.size

    def part(self, start: int, stop: int) -> Cycles:
        """Return the cycles from ``start`` to ``stop`` (exclusive)."""
        return replace(self, bounds=self.bounds[start : stop + 1], numbers=self.numbers[start:stop])

    def parts(self, count: int) -> list[Cycles]:
        """Divide the cycles into this many parts of similar size, in order."""
        ends = [len(self) * i // count for i in range(count + 1)]
        return [self.part(start, stop) for start, stop in pairwise(ends) if stop > start]


def find_cycles(path: Path, layout: Layout) -> Cycles:
    """Find where each cycle of a campaign file starts.

    Raises
    ------
    RecordingError
        If the file is not Parquet, has no such column or no rows, or a cycle is in two places.
    """
    said = layout.for_file(path)
    if said.format != "parquet":
        raise RecordingError(
            "cycles are read from Parquet only",
            where=str(path),
            value=f'format = "{said.format}"',
            remedy="write the campaign as one Parquet file, or each cycle as a file without columns.cycle",
        )
    if not said.is_plain:
        raise RecordingError(
            "a campaign file needs a column for each channel",
            where=str(path),
            rule="the keys rate, date, clock and wraps are for files of one recording",
        )
    table = open_table(path, "parquet")
    column = table.names[column_number(said.cycle or 0, table.names, len(table.names), path)]
    numbers = table.get([column])[column]
    if numbers.size == 0:
        raise RecordingError("there are no rows", where=str(path))
    starts = np.concatenate(([0], np.flatnonzero(numbers[1:] != numbers[:-1]) + 1))
    found = numbers[starts]
    values, counts = np.unique(found, return_counts=True)
    if (counts > 1).any():
        raise RecordingError(
            f"the rows of cycle {values[counts > 1][0]} are not together",
            where=str(path),
            rule="all rows of a cycle must be together, in the order of time",
        )
    return Cycles(path, layout, np.concatenate((starts, [numbers.size])).astype(np.int64), found)


def read_cycles(cycles: Cycles) -> Iterator[Recording]:
    """Yield one cycle after the other, reading a batch of rows at a time."""
    said = cycles.layout.for_file(cycles.path)
    start = 0
    while start < len(cycles):
        last = int(np.searchsorted(cycles.bounds, cycles.bounds[start] + BATCH_SAMPLES, side="right")) - 1
        stop = min(max(last, start + 1), len(cycles))
        first_row, end_row = int(cycles.bounds[start]), int(cycles.bounds[stop])
        raw = read_rows(cycles.path, said, (first_row, end_row))
        for index in range(start, stop):
            part = slice(int(cycles.bounds[index]) - first_row, int(cycles.bounds[index + 1]) - first_row)
            name = f"{stem(cycles.path)}/{cycles.numbers[index]}"
            yield to_recording(name, cycles.path, said, {c: column[part] for c, column in raw.items()}, {}, None)
        start = stop
