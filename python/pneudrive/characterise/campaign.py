"""Campaigns: thousands of cycles, in one Parquet file or in many files, as one friction map.

Form of a campaign file: Parquet, one row per sample, the rows of a cycle together and in the order of
time, a column that numbers the cycle (``cycle = { column = "cycle" }`` in the layout's ``[columns]``) and the
columns of any other recording, 32-bit floats allowed; time may start anew in each cycle. Every cycle is treated as a
recording of its own, by the same code.

Worker processes read their own part of the file, so neither the samples nor their copies meet in one process.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.extract import RecordingResult, extract, friction_points
from pneudrive.characterise.layout import Layout, stem
from pneudrive.characterise.load import RecordingFile, read_rows, to_recording
from pneudrive.characterise.pool import share_out
from pneudrive.characterise.pool import workers as usual_workers
from pneudrive.characterise.text_table import column_number
from pneudrive.errors import RecordingError
from pneudrive.files.tables import open_table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from pneudrive.characterise.closure import ClosurePoint
    from pneudrive.characterise.pressure_line import FrictionPoint
    from pneudrive.characterise.recording import Recording
    from pneudrive.characterise.settling import SampleChoice
    from pneudrive.friction.friction_map import Row

BATCH_SAMPLES = 2_000_000  # samples that a worker holds at once: about 100 MB with its copies
WORTH_WORKERS = 200  # cycles below which starting processes costs more than it saves


@dataclass(frozen=True)
class Cycles:
    """Part of a campaign file: first row of each cycle and the row after the last, with the cycles' numbers."""

    path: Path
    layout: Layout
    bounds: NDArray[np.int64]
    numbers: NDArray[np.int64]

    def __len__(self) -> int:
        """Give the number of cycles."""
        return self.numbers.size

    def part(self, start: int, stop: int) -> Cycles:
        """Cycles from ``start`` to ``stop`` (exclusive)."""
        return replace(self, bounds=self.bounds[start : stop + 1], numbers=self.numbers[start:stop])

    def parts(self, count: int) -> list[Cycles]:
        """Divide the cycles into so many parts of about equal numbers, in order."""
        ends = [len(self) * i // count for i in range(count + 1)]
        return [self.part(start, stop) for start, stop in pairwise(ends) if stop > start]


Source = Cycles | RecordingFile


@dataclass(frozen=True)
class Summary:
    """What one recording of a campaign leaves: map rows and points for closure and pressure lines.

    ``digest`` is equal for recordings with the same samples; ``reason`` says why it could not be used.
    """

    name: str
    digest: int
    rows: tuple[Row, ...] = ()
    labels: dict[str, str] = field(default_factory=dict)
    closure_points: tuple[ClosurePoint, ...] = ()
    friction_points: tuple[FrictionPoint, ...] = ()
    reason: str = ""


def summary_of(result: RecordingResult, digest: int = 0) -> Summary:
    """Keep of a recording's result what map, closure and pressure lines need."""
    rows = tuple(row for level in result.levels for row in level.rows)
    return Summary(
        result.recording.name,
        digest,
        rows,
        result.recording.labels,
        result.closure_points,
        tuple(friction_points(result)),
    )


def find_cycles(path: Path, layout: Layout) -> Cycles:
    """Find where each cycle of a campaign file starts.

    Raises
    ------
    RecordingError
        Not a Parquet file, no such column, no rows, or a cycle in two places.
    """
    said = layout.for_file(path)
    if said.format != "parquet":
        raise RecordingError(
            "cycles are read from Parquet only",
            where=str(path),
            value=f'format = "{said.format}"',
            remedy="write the campaign as one Parquet file, or each cycle as a file without columns.cycle",
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
            rule="all rows of a cycle stand together, in the order of time",
        )
    return Cycles(path, layout, np.concatenate((starts, [numbers.size])).astype(np.int64), found)


def read_cycles(cycles: Cycles) -> Iterator[Recording]:
    """Read cycles one after the other, a batch of rows at a time."""
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


def summarise(sources: list[Source], choice: SampleChoice, workers: int | None = None) -> list[Summary]:
    """Characterise every cycle, or every file, and keep what the map needs.

    Parameters
    ----------
    sources
        Parts of campaign files, or single recordings' files.
    choice
        Which samples count.
    workers
        Processes; None takes the processors there are, at most 8.

    Returns
    -------
    list of Summary
        In the order of the sources. A cycle or file that cannot be used has a ``reason``: of 7500 cycles one may fail.
    """
    number = sum(len(source) if isinstance(source, Cycles) else 1 for source in sources)
    workers = (workers or usual_workers()) if number >= WORTH_WORKERS else 1
    parts = [part for source in sources for part in (source.parts(workers) if isinstance(source, Cycles) else [source])]
    return [one for found in share_out(work, parts, choice, least=2, processes=workers) for one in found]


def work(sources: list[Source], choice: SampleChoice) -> list[list[Summary]]:
    """Characterise the recordings of each source one after the other in this process."""
    return [[_summary(name, read, choice) for name, read in _recordings(source)] for source in sources]


def _summary(name: str, read: Callable[[], Recording], choice: SampleChoice) -> Summary:
    try:
        recording = read()
        digest = zlib.crc32(recording.position_m.tobytes()) << 32 | zlib.crc32(recording.force_n.tobytes())
        return summary_of(extract(recording, choice), digest)
    except RecordingError as error:
        return Summary(name, 0, reason=error.what)


def _recordings(source: Source) -> Iterator[tuple[str, Callable[[], Recording]]]:
    """Yield the name of each recording and a function that gives it."""
    if isinstance(source, Cycles):
        for recording in read_cycles(source):
            yield recording.name, lambda recording=recording: recording
    else:
        yield source.name, source.read
