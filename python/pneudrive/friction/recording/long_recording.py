"""Long recordings, read part by part (some strokes each), with the same equations.

Memory is that of one part, however long the recording is. Each part begins one stroke before the first one that is
counted in it, so that every stroke is counted once, with the rest before it. The results of strokes (their
bins, means and peaks) are combined as for any other recording: speed classes are found from all strokes. The window
is that of the layout, or the middle of the strokes of the first part. Of the samples, those of the part with the
largest force are kept, for figures and the uncertainty budget.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.tables import open_table
from pneudrive.friction.recording.extract import RecordingResult, result_of, window_of
from pneudrive.friction.reduction.sliding import Sliding, StrokeFriction, find_motion, judge, stroke_frictions
from pneudrive.signals.levels import speed_levels
from pneudrive.signals.load import read_rows, to_recording
from pneudrive.signals.samples import clean
from pneudrive.watch import UNWATCHED

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.recording.extract import Level
    from pneudrive.friction.reduction.pairing import Grid
    from pneudrive.friction.reduction.sliding import SampleChoice
    from pneudrive.signals.load import RecordingFile
    from pneudrive.signals.motion import Stroke
    from pneudrive.watch import Watch

LONG_SAMPLES = 4_000_000  # samples above which a recording is read part by part
PART_SAMPLES = 1_000_000
LEAST_STROKES = 4  # strokes in a part: the one before, one that is counted, and two for the start of the next part
LARGEST_PART = 16  # multiple of the usual part: longer strokes cannot be separated
_CHUNK = 1 << 20


def is_long(file: RecordingFile) -> bool:
    """Return whether a file is read part by part: a Parquet table with more rows than are held at once."""
    if file.layout is None or file.has_cycles:
        return False
    said = file.layout.for_file(file.path)
    if said.format != "parquet" or said.dates:
        return False
    count = open_table(file.path, "parquet").count()
    return count is not None and count > LONG_SAMPLES


def extract_long(file: RecordingFile, choice: SampleChoice, watch: Watch = UNWATCHED) -> RecordingResult:
    """Extract friction from a long recording.

    Parameters
    ----------
    file : RecordingFile
        A file for which `is_long` is true.
    choice : SampleChoice
    watch : Watch
        Receives the number of rows done.

    Returns
    -------
    RecordingResult
        As from `extract`; recording, strokes and samples are those of one part, levels those of all.

    Raises
    ------
    RecordingError
        As in `extract`.
    """
    window: tuple[float, float] | None = None
    shown: tuple[Sliding, int] | None = None  # with the number of its first stroke
    grids: list[Grid] = []
    strokes: list[Stroke] = []
    frictions: list[StrokeFriction] = []
    flags: dict[str, int] = {}
    for sliding, counted in _parts(file, choice, watch):
        window = window or window_of(sliding, choice)
        first = len(strokes) - counted[0].index
        for members in speed_levels(list(counted)):
            grid, found = stroke_frictions(sliding, members, window, grids[0].in_window if grids else None)
            if found:
                grids.append(grid)
                frictions += [_numbered(one, first) for one in found]
        strokes += [replace(s, index=s.index + first) for s in counted]
        if shown is None or _largest(sliding) > _largest(shown[0]):
            shown = sliding, first
        for kind, count in sliding.recording.flags.items():
            flags[kind] = flags.get(kind, 0) + count
    if shown is None or window is None:
        raise RecordingError("no stroke was found", where=file.name, rule="the position must move back and forth")
    sliding, first = shown
    whole = replace(sliding, recording=replace(sliding.recording, flags=flags, sha256=_hash(file)))
    result = result_of(whole, _levels(grids, strokes, frictions), window, choice)
    return replace(result, levels=tuple(_of_part(level, sliding, first) for level in result.levels))


def _largest(sliding: Sliding) -> float:
    return float(np.abs(sliding.recording.force_n).max())


def _of_part(level: Level, sliding: Sliding, first: int) -> Level:
    """Keep the strokes and peaks of a level whose samples are kept."""
    members = {s.index - first for s in level.strokes}
    strokes = tuple(s for s in sliding.strokes if s.index in members)
    peaks = tuple(replace(p, stroke=p.stroke - first) for p in level.peaks if p.stroke - first in members)
    kept = {s.index for s in strokes}
    return replace(level, strokes=strokes, peaks=tuple(p for p in peaks if p.stroke in kept))


def _parts(file: RecordingFile, choice: SampleChoice, watch: Watch) -> Iterator[tuple[Sliding, tuple[Stroke, ...]]]:
    """Read a recording part by part, each with the strokes that are counted in it."""
    assert file.layout is not None
    said = file.layout.for_file(file.path)
    rows = open_table(file.path, "parquet").count() or 0
    start, size, is_first = said.skip_samples, PART_SAMPLES, True
    while start < rows:
        watch.tell(start, rows, f"rows of {file.name}")
        stop = min(start + size, rows)
        recording = to_recording(file.name, file.path, said, read_rows(file.path, said, (start, stop)), {}, None)
        sliding = judge(find_motion(clean(recording)), choice)
        is_last, n = stop == rows, len(sliding.strokes)
        if not is_last and n < LEAST_STROKES:
            size *= 2
            if size > LARGEST_PART * PART_SAMPLES:
                raise RecordingError(
                    f"{size // 2} samples hold {n} strokes",
                    where=str(file.path),
                    rule=f"a recording of more than {LONG_SAMPLES} samples is read part by part, and a part has "
                    f"{LEAST_STROKES} strokes",
                    remedy="record fewer samples per stroke, or a file for each part",
                )
            continue
        counted = sliding.strokes[0 if is_first else 1 : n if is_last else n - 1]
        if counted:
            yield sliding, counted
        if is_last:
            break
        # The next part counts from the last stroke; the one before it, with its rest, is included.
        begin = float(sliding.recording.time_s[sliding.strokes[-3].stop - 1])
        start += int(np.flatnonzero(recording.time_s >= begin)[0])
        is_first, size = False, max(size, PART_SAMPLES)
    watch.tell(rows, rows, f"rows of {file.name}")


def _hash(file: RecordingFile) -> str:
    digest = hashlib.sha256()
    with file.path.open("rb") as data:
        while chunk := data.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def _numbered(friction: StrokeFriction, first: int) -> StrokeFriction:
    """Return a stroke of a part with its number in the whole recording."""
    number = friction.stroke.index + first
    peak = replace(friction.peak, stroke=number) if friction.peak else None
    return replace(friction, stroke=replace(friction.stroke, index=number), peak=peak)


def _levels(
    grids: list[Grid], strokes: list[Stroke], frictions: list[StrokeFriction]
) -> list[tuple[Grid, list[StrokeFriction]]]:
    """Divide the strokes of all parts into speed levels, over the bins of all parts: these share the window's."""
    if not grids:
        return []
    grid = replace(grids[0], first=min(g.first for g in grids), stop=max(g.stop for g in grids))
    level_of = {s.index: i for i, members in enumerate(speed_levels(strokes)) for s in members}
    groups: dict[int, list[StrokeFriction]] = {}
    for friction in frictions:
        groups.setdefault(level_of[friction.stroke.index], []).append(friction)
    return [(grid, groups[i]) for i in sorted(groups)]
