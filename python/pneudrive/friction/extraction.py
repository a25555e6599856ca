"""Recording -> motion -> frames of strokes -> speed levels. Long recordings take the same way, part by part.

Memory is limited to one part, for any length of the recording. Each part begins one stroke before its first counted
stroke. Every stroke is therefore counted once, with the rest before it. Speed classes are found from the strokes of all
parts. The window is that of the layout, or the middle of the strokes of the first part. The samples of the part with
the largest force are kept, for figures and the uncertainty budget.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Event
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.batching import in_advance
from pneudrive.errors import RecordingError
from pneudrive.friction.bins import MIDDLE
from pneudrive.friction.level import RecordingResult, level_of
from pneudrive.friction.motion import RecordedMotion
from pneudrive.friction.strokes import Strokes, stroke_grid, stroke_use
from pneudrive.progress import UNWATCHED
from pneudrive.signals.motion import speed_levels
from pneudrive.signals.pressure_delay import pressure_delay
from pneudrive.signals.recording import clean

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.motion import SampleChoice
    from pneudrive.progress import Watch
    from pneudrive.signals.load import LongFile
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

    Part = tuple[RecordedMotion, tuple[Stroke, ...]]

LONG_SAMPLES = 4_000_000  # samples above which a recording is read part by part
PART_SAMPLES = 1_000_000
LEAST_STROKES = 4  # strokes in a part: the one before, one that is counted, and two for the start of the next part
LARGEST_PART = 16  # multiple of the usual part: longer strokes cannot be separated


def extract(recording: Recording, choice: SampleChoice) -> RecordingResult:
    """Extract friction from one recording, after the delay of its pressures is removed.

    Raises
    ------
    RecordingError
        Without motion, with too few samples, or without a stroke with settled samples in the window.
    """
    recording = clean(recording)
    delay = pressure_delay(recording)
    if delay is not None and delay.is_clear:
        recording = delay.removed(recording)
    motion = RecordedMotion.of(recording, choice, delay=delay)
    window = window_of(motion, choice)
    position, classes = motion.position_m, speed_levels(list(motion.strokes))
    tables = [Strokes.of(motion, members, window, stroke_grid(position, members, window)) for members in classes]
    return _result(motion, motion.strokes, tables, window, choice)


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
    with ThreadPoolExecutor(1) as hashing:  # the samples are hashed on a thread while they are read
        sha256 = hashing.submit(file.sha256, ended)
        try:
            motion, strokes, tables, window = _all_parts(file, choice, watch)
            motion = replace(motion, recording=replace(motion.recording, sha256=sha256.result()))
        finally:
            ended.set()  # an error does not wait for the hash
    if not tables:
        return _result(motion, strokes, [], window, choice)
    # The parts number their strokes separately: classes of the whole recording are found by place.
    whole, classes = Strokes.joined(tables), speed_levels([replace(s, index=i) for i, s in enumerate(strokes)])
    level_of_stroke = {id(strokes[s.index]): number for number, members in enumerate(classes) for s in members}
    numbers = [level_of_stroke[id(stroke)] for stroke in whole.strokes]
    rows = ([row for row, at in enumerate(numbers) if at == number] for number in range(len(classes)))
    return _result(motion, strokes, [whole.at(some) for some in rows if some], window, choice)


def _all_parts(
    file: LongFile, choice: SampleChoice, watch: Watch
) -> tuple[RecordedMotion, list[Stroke], list[Strokes], tuple[float, float]]:
    """Read the parts: the one with the largest force, all counted strokes, their frames, and the window."""
    kept: RecordedMotion | None = None
    window: tuple[float, float] | None = None
    strokes: list[Stroke] = []
    tables: list[Strokes] = []
    flags: dict[str, int] = {}
    largest_n = -np.inf
    for motion, counted in _parts(file, choice, watch):
        window = window or window_of(motion, choice)
        strokes += counted
        for members in speed_levels(list(counted)):
            bins = tables[0].grid.in_window if tables else None
            table = Strokes.of(motion, members, window, stroke_grid(motion.position_m, members, window, bins))
            tables += [table] if table.directions else []
        for kind, count in motion.recording.flags.items():
            flags[kind] = flags.get(kind, 0) + count
        if (most := float(np.abs(motion.recording.force_n).max())) > largest_n:
            kept, largest_n = motion, most
    if kept is None or window is None:
        raise RecordingError("no stroke was found", where=file.file.name, rule="the position must move back and forth")
    return replace(kept, recording=replace(kept.recording, flags=flags)), strokes, tables, window


def _result(
    motion: RecordedMotion,
    strokes: Sequence[Stroke],
    tables: list[Strokes],
    window: tuple[float, float],
    choice: SampleChoice,
) -> RecordingResult:
    """Make the levels of the speed classes, and count the strokes that they use.

    Raises
    ------
    RecordingError
        If no speed class has settled samples in the window.
    """
    place = {id(stroke): i for i, stroke in enumerate(strokes)}
    levels, used, counting = [], set(), set()
    for table in tables:
        rows = {place[id(table.strokes[row])] for rows in table.directions.values() for row in rows}
        counting |= rows
        level = level_of(motion, len(levels), table, window, uses_window=choice.uses_window)
        if level is not None:
            levels.append(level)
            used |= rows
    use = stroke_use(strokes, used, counting, window)
    if not levels:
        raise RecordingError(
            "no stroke has settled samples in the window",
            where=motion.recording.name,
            value=f"window {window[0] * 1e3:.4g} mm .. {window[1] * 1e3:.4g} mm, {use.recorded} strokes: {use.why}",
            remedy="widen window.position in the layout, or record longer strokes",
        )
    return RecordingResult(**vars(motion), levels=tuple(levels), stroke_use=use)


def window_of(motion: RecordedMotion, choice: SampleChoice) -> tuple[float, float]:
    """Return the positions between which friction is averaged: those of the layout, or the middle of the strokes.

    Raises
    ------
    RecordingError
        The bounds of the layout are outside the motion.
    """
    recording, strokes = motion.recording, motion.strokes
    low = float(np.median([min(s.from_m, s.to_m) for s in strokes]))
    high = float(np.median([max(s.from_m, s.to_m) for s in strokes]))
    if not choice.uses_window:
        return low, high
    if recording.window_m is None:
        return low + MIDDLE[0] * (high - low), low + MIDDLE[1] * (high - low)
    if recording.window_m[0] >= high or recording.window_m[1] <= low:
        raise RecordingError(
            "the window lies outside the motion",
            where=recording.name,
            value=f"window {recording.window_m[0] * 1e3:.4g} .. {recording.window_m[1] * 1e3:.4g} mm, "
            f"strokes {low * 1e3:.4g} .. {high * 1e3:.4g} mm",
            remedy="change window.position in the layout",
        )
    return recording.window_m


def _parts(file: LongFile, choice: SampleChoice, watch: Watch) -> Iterator[Part]:
    """Read a recording part by part, each with its counted strokes; the next part is read in the background."""
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
            rows = int(np.flatnonzero(recording.time_s >= begin)[0])
            left = {channel: values[rows:].copy() for channel, values in raw.items()}
            is_first = False
    watch.tell(count, count, f"rows of {name}")
