"""Friction map of a campaign of thousands of cycles, in one Parquet file or in many files.

Worker processes read their own part of the file, so no process holds all samples.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive.errors import RecordingError
from pneudrive.friction.recording.closure import closure_point
from pneudrive.friction.recording.pressure_line import friction_points
from pneudrive.friction.reduction.level import RecordingResult, extract
from pneudrive.friction.reduction.stroke_use import StrokeUse
from pneudrive.signals.cycles import Cycles, read_cycles
from pneudrive.signals.load import RecordingFile
from pneudrive.signals.pool import share_out
from pneudrive.signals.pool import workers as usual_workers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pneudrive.friction.friction_map import Row
    from pneudrive.friction.recording.closure import ClosurePoint
    from pneudrive.friction.recording.pressure_line import FrictionPoint
    from pneudrive.friction.reduction.settling import SampleChoice
    from pneudrive.signals.recording import Recording

WORTH_WORKERS = 200  # cycles below which starting processes costs more than it saves


Source = Cycles | RecordingFile


@dataclass(frozen=True)
class Summary:
    """Summary of a recording: map rows and points for closure and pressure lines.

    ``digest`` is equal for recordings with the same samples. ``reason`` explains why it is unusable. ``sha256`` belongs
    to the recording, and is empty without a file.
    """

    name: str
    digest: int
    rows: tuple[Row, ...] = ()
    labels: dict[str, str] = field(default_factory=dict)
    closure_points: tuple[ClosurePoint, ...] = ()
    friction_points: tuple[FrictionPoint, ...] = ()
    reason: str = ""
    sha256: str = ""
    stroke_use: StrokeUse = field(default_factory=StrokeUse)


def summary_of(result: RecordingResult, digest: int = 0) -> Summary:
    """Return the parts of a recording's result for map, closure and pressure lines."""
    rows = tuple(row for level in result.levels for row in level.rows)
    return Summary(
        result.recording.name,
        digest,
        rows,
        result.recording.labels,
        tuple(p for level in result.levels if (p := closure_point(result.recording, level)) is not None),
        tuple(friction_points(result)),
        sha256=result.recording.sha256 or "",
        stroke_use=result.stroke_use,
    )


def summarise(sources: list[Source], choice: SampleChoice, workers: int | None = None) -> list[Summary]:
    """Characterise every cycle, or every file, and return the summaries.

    Parameters
    ----------
    sources
        Parts of campaign files, or single recordings' files.
    choice
        Selection of samples.
    workers
        Number of processes; None: one for each processor, at most 8.

    Returns
    -------
    list of Summary
        In the order of the sources. An unusable cycle or file has a ``reason``, so that one of 7500 cycles may fail.
    """
    number = sum(len(source) if isinstance(source, Cycles) else 1 for source in sources)
    workers = (workers or usual_workers()) if number >= WORTH_WORKERS else 1
    parts = [part for source in sources for part in (source.parts(workers) if isinstance(source, Cycles) else [source])]
    return [one for found in share_out(work, parts, choice, least=2, processes=workers) for one in found]


def work(sources: list[Source], choice: SampleChoice) -> list[list[Summary]]:
    """Characterise the recordings of one source after the other in this process."""
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
