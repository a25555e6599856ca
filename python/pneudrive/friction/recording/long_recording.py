"""Long recordings, read part by part (some strokes each), with the same equations.

Memory is limited to one part, for any length of the recording. Each part begins one stroke before its first counted
stroke. Every stroke is therefore counted once, with the rest before it. The results of strokes (their bins, means and
peaks)
are combined as for any other recording: speed classes are found from all strokes. The window is that of the layout, or
the middle of the strokes of the first part. The samples of the part with the largest force are kept, for figures and
the uncertainty budget.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.batching import in_advance
from pneudrive.errors import RecordingError
from pneudrive.friction.reduction.level import RecordingResult, result_of, window_of
from pneudrive.friction.reduction.motion import RecordedMotion
from pneudrive.friction.reduction.strokes import StrokeFriction, stroke_frictions, stroke_grid
from pneudrive.progress import UNWATCHED
from pneudrive.signals.levels import speed_levels
from pneudrive.signals.samples import clean

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Future

    from numpy.typing import NDArray

    from pneudrive.friction.reduction.level import Level
    from pneudrive.friction.reduction.motion import SampleChoice
    from pneudrive.friction.reduction.pairing import Grid
    from pneudrive.progress import Watch
    from pneudrive.signals.load import LongFile
    from pneudrive.signals.motion import Stroke

LONG_SAMPLES = 4_000_000  # samples above which a recording is read part by part
PART_SAMPLES = 1_000_000
LEAST_STROKES = 4  # strokes in a part: the one before, one that is counted, and two for the start of the next part
LARGEST_PART = 16  # multiple of the usual part: longer strokes cannot be separated


def extract_long(file: LongFile, choice: SampleChoice, watch: Watch = UNWATCHED) -> RecordingResult:
    """Extract friction from a long recording.

    Parameters
    ----------
    file : LongFile
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
    ended = Event()
    with ThreadPoolExecutor(1) as beside:  # the samples are hashed on a thread while they are read
        sha256 = beside.submit(file.sha256, ended)
        try:
            return _extracted(file, choice, watch, sha256)
        finally:
            ended.set()  # an error does not wait for the hash


def _extracted(file: LongFile, choice: SampleChoice, watch: Watch, sha256: Future[str]) -> RecordingResult:
    """Read the parts and combine their strokes."""
    window: tuple[float, float] | None = None
    shown: tuple[RecordedMotion, int] | None = None  # with the number of its first stroke
    grids: list[Grid] = []
    strokes: list[Stroke] = []
    frictions: list[StrokeFriction] = []
    flags: dict[str, int] = {}
    for motion, counted in _parts(file, choice, watch):
        window = window or window_of(motion, choice)
        first = len(strokes) - counted[0].index
        for members in speed_levels(list(counted)):
            grid = stroke_grid(motion.position_m, members, window, grids[0].in_window if grids else None)
            if found := stroke_frictions(motion, members, window, grid):
                grids.append(grid)
                frictions += [_numbered(one, first) for one in found]
        strokes += [replace(s, index=s.index + first) for s in counted]
        if shown is None or _largest(motion) > _largest(shown[0]):
            shown = motion, first
        for kind, count in motion.recording.flags.items():
            flags[kind] = flags.get(kind, 0) + count
    if shown is None or window is None:
        raise RecordingError("no stroke was found", where=file.file.name, rule="the position must move back and forth")
    motion, first = shown
    whole = replace(motion, recording=replace(motion.recording, flags=flags, sha256=sha256.result()))
    result = result_of(whole, _levels(grids, strokes, frictions), window, choice, strokes)
    return replace(result, levels=tuple(_of_part(level, motion, first) for level in result.levels))


def _largest(motion: RecordedMotion) -> float:
    force = motion.recording.force_n
    return float(max(force.max(), -force.min()))


def _of_part(level: Level, motion: RecordedMotion, first: int) -> Level:
    """Keep the strokes and peaks of a level whose samples are kept."""
    members = {s.index - first for s in level.strokes}
    strokes = tuple(s for s in motion.strokes if s.index in members)
    peaks = tuple(replace(p, stroke=p.stroke - first) for p in level.peaks if p.stroke - first in members)
    kept = {s.index: s for s in strokes}
    sides = {
        d: replace(side, used=tuple(kept[i] for s in side.used if (i := s.index - first) in kept))
        for d, side in level.sides.items()
    }
    return replace(level, strokes=strokes, sides=sides, peaks=tuple(p for p in peaks if p.stroke in kept))


def _parts(file: LongFile, choice: SampleChoice, watch: Watch) -> Iterator[tuple[RecordedMotion, tuple[Stroke, ...]]]:
    """Read a recording part by part, each with its strokes; the next part is read in the background."""
    name, first, count = file.file.name, file.first, file.count
    blocks = [(begin, min(begin + PART_SAMPLES, count)) for begin in range(first, count, PART_SAMPLES)]
    left: dict[str, NDArray[np.float64]] = {}
    is_first = True
    for block, read in zip(blocks, in_advance(file.read, blocks, 1, ahead=1), strict=True):
        watch.tell(block[0], count, f"rows of {name}")
        raw = {channel: np.concatenate((left[channel], new)) if left else new for channel, new in read.items()}
        recording = file.recording(raw)
        motion = RecordedMotion.of(clean(recording), choice)
        is_last, n = block is blocks[-1], len(motion.strokes)
        if not is_last and n < LEAST_STROKES:
            if len(recording) >= LARGEST_PART * PART_SAMPLES:
                raise RecordingError(
                    f"{len(recording)} samples hold {n} strokes",
                    where=str(file.file.path),
                    rule=f"a recording of more than {LONG_SAMPLES} samples is read part by part, and a part has "
                    f"{LEAST_STROKES} strokes",
                    remedy="record fewer samples per stroke, or a file for each part",
                )
            left = raw
            continue
        counted = motion.strokes[0 if is_first else 1 : n if is_last else n - 1]
        if counted:
            yield motion, counted
        if not is_last:
            # The next part counts from the last stroke; the one before it, with its rest, is included.
            begin = float(motion.recording.time_s[motion.strokes[-3].stop - 1])
            kept = int(np.flatnonzero(recording.time_s >= begin)[0])
            left = {channel: values[kept:].copy() for channel, values in raw.items()}
            is_first = False
    watch.tell(count, count, f"rows of {name}")


def _numbered(friction: StrokeFriction, first: int) -> StrokeFriction:
    """Return a stroke of a part with its number in the whole recording."""
    number = friction.stroke.index + first
    peak = replace(friction.peak, stroke=number) if friction.peak else None
    return replace(friction, stroke=replace(friction.stroke, index=number), peak=peak)


def _levels(
    grids: list[Grid], strokes: list[Stroke], frictions: list[StrokeFriction]
) -> list[tuple[Grid, list[StrokeFriction]]]:
    """Divide the strokes of all parts into speed levels; use the bins of the window from all parts."""
    if not grids:
        return []
    grid = replace(grids[0], first=min(g.first for g in grids), stop=max(g.stop for g in grids))
    level_of = {s.index: i for i, members in enumerate(speed_levels(strokes)) for s in members}
    groups: dict[int, list[StrokeFriction]] = {}
    for friction in frictions:
        groups.setdefault(level_of[friction.stroke.index], []).append(friction)
    return [(grid, groups[i]) for i in sorted(groups)]
