"""Recordings that are too long to be held: read part by part, a part being some strokes, with the same equations.

Memory is that of one part, however long the recording is. Each part begins one stroke before the first one that is
counted in it, so that every stroke is counted once, whole, and with the rest before it. What the strokes leave (their
bins, means and peaks) is put together as for any other recording: speed levels are found from all strokes. The window
is that of the layout, or the middle of the strokes of the first part. Of the samples, those of the part with the
largest force are kept, for figures and for the budget of uncertainty.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.extract import Moved, Pieces, RecordingResult, judged, pieces_of, result_of, window_of
from pneudrive.characterise.levels import speed_levels
from pneudrive.characterise.load import to_recording
from pneudrive.characterise.profile import mean_profile
from pneudrive.characterise.text_table import column_number
from pneudrive.errors import RecordingError
from pneudrive.files.tables import open_table
from pneudrive.watch import UNWATCHED

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive.characterise.extract import Conditions, Level
    from pneudrive.characterise.load import RecordingFile
    from pneudrive.characterise.motion import Stroke
    from pneudrive.characterise.profile import Profile
    from pneudrive.characterise.recording import Recording
    from pneudrive.characterise.settling import SampleChoice
    from pneudrive.files.tables import Table
    from pneudrive.watch import Watch

LONG_SAMPLES = 4_000_000  # from which on a recording is read part by part
PART_SAMPLES = 1_000_000
LEAST_STROKES = 4  # in a part: the one before, one that is counted, and two that the next part begins with
LARGEST_PART = 16  # times the usual part: strokes that do not fit are too long to be told from one another
_CHUNK = 1 << 20


def is_long(file: RecordingFile) -> bool:
    """Whether a file is read part by part: a Parquet table of more rows than are held at once."""
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
        For which `is_long` holds.
    choice : SampleChoice
    watch : Watch
        Is told how many rows are done.

    Returns
    -------
    RecordingResult
        As of `extract`; recording, strokes and samples are those of one part, levels those of all.

    Raises
    ------
    RecordingError
        As of `extract`.
    """
    window, bins = None, None
    shown: tuple[Moved, int] | None = None  # with the number of its first stroke
    strokes: list[Stroke] = []
    pieces: list[Pieces] = []
    flags: dict[str, int] = {}
    for moved, counted in _parts(file, choice, watch):
        window = window or window_of(moved.recording, moved.strokes, choice)
        first = len(strokes) - counted[0].index
        for members in speed_levels(list(counted)):
            taken = pieces_of(moved, members, window, choice, bins)
            if taken is not None:
                bins = int(taken.profile.in_window.sum())
                pieces.append(_numbered(taken, first))
        strokes += [replace(s, index=s.index + first) for s in counted]
        if shown is None or _largest(moved) > _largest(shown[0]):
            shown = moved, first
        for kind, count in moved.recording.flags.items():
            flags[kind] = flags.get(kind, 0) + count
    if shown is None or window is None:
        raise RecordingError("no stroke was found", where=file.name, rule="the position must move and turn back")
    moved, first = shown
    whole = replace(moved, recording=replace(moved.recording, flags=flags, sha256=_hash(file)))
    result = result_of(whole, _merged(pieces, strokes), window, choice)
    return replace(result, levels=tuple(_of_part(level, moved, first) for level in result.levels))


def _largest(moved: Moved) -> float:
    return float(np.abs(moved.recording.force_n).max())


def _of_part(level: Level, moved: Moved, first: int) -> Level:
    """Keep of the strokes and peaks of a level those whose samples are kept."""
    members = {s.index - first for s in level.strokes}
    strokes = tuple(s for s in moved.strokes if s.index in members)
    peaks = tuple(replace(p, stroke=p.stroke - first) for p in level.peaks if p.stroke - first in members)
    kept = {s.index for s in strokes}
    return replace(level, strokes=strokes, peaks=tuple(p for p in peaks if p.stroke in kept))


def _parts(file: RecordingFile, choice: SampleChoice, watch: Watch) -> Iterator[tuple[Moved, tuple[Stroke, ...]]]:
    """Read a recording part by part, each with the strokes that are counted in it."""
    assert file.layout is not None
    said = file.layout.for_file(file.path)
    table = open_table(file.path, "parquet")
    rows = table.count() or 0
    start, size, is_first = said.skip_samples, PART_SAMPLES, True
    while start < rows:
        watch.tell(start, rows, f"rows of {file.name}")
        stop = min(start + size, rows)
        recording = _read(file, table, start, stop)
        moved = judged(recording, choice)
        is_last, n = stop == rows, len(moved.strokes)
        if not is_last and n < LEAST_STROKES:
            size *= 2
            if size > LARGEST_PART * PART_SAMPLES:
                raise RecordingError(
                    f"{size // 2} samples hold {n} strokes",
                    where=str(file.path),
                    rule=f"a recording of more than {LONG_SAMPLES} samples is read part by part, and a part has "
                    f"{LEAST_STROKES} strokes",
                    remedy="give fewer samples a stroke, or a file for each part",
                )
            continue
        counted = moved.strokes[0 if is_first else 1 : n if is_last else n - 1]
        if counted:
            yield moved, counted
        if is_last:
            break
        # The next part counts from the last stroke on; the one before it, with its rest, comes along.
        begin = float(moved.recording.time_s[moved.strokes[-3].stop - 1])
        start += int(np.flatnonzero(recording.time_s >= begin)[0])
        is_first, size = False, max(size, PART_SAMPLES)
    watch.tell(rows, rows, f"rows of {file.name}")


def _read(file: RecordingFile, table: Table, start: int, stop: int) -> Recording:
    assert file.layout is not None
    said = file.layout.for_file(file.path)
    names = {
        channel: table.names[column_number(column.column, table.names, len(table.names), file.path)]
        for channel, column in said.columns.items()
    }
    columns = table.get(names.values(), (start, stop))
    raw = {channel: np.asarray(columns[name], dtype=np.float64) for channel, name in names.items()}
    return to_recording(file.name, file.path, said, raw, {}, None)


def _hash(file: RecordingFile) -> str:
    digest = hashlib.sha256()
    with file.path.open("rb") as data:
        while chunk := data.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def _numbered(pieces: Pieces, first: int) -> Pieces:
    """Give the strokes of a part their numbers in the whole recording."""

    def renumbered(strokes: Sequence[Stroke]) -> list[Stroke]:
        return [replace(s, index=s.index + first) for s in strokes]

    return replace(
        pieces,
        strokes=tuple(renumbered(pieces.strokes)),
        used={d: renumbered(members) for d, members in pieces.used.items()},
        peaks=tuple(replace(p, stroke=p.stroke + first) for p in pieces.peaks),
    )


def _merged(parts: list[Pieces], strokes: list[Stroke]) -> list[Pieces]:
    """Put the pieces of each speed level together; a piece belongs to the level of most of its strokes."""
    level_of = {s.index: i for i, members in enumerate(speed_levels(strokes)) for s in members}
    groups: dict[int, list[Pieces]] = {}
    for pieces in parts:
        levels = [level_of[s.index] for s in pieces.strokes]
        groups.setdefault(max(set(levels), key=levels.count), []).append(pieces)
    return [_joined(groups[i]) for i in sorted(groups)]


def _joined(parts: list[Pieces]) -> Pieces:
    """Put the pieces of one level together."""
    profile, matrices = _joined_profile([p.profile for p in parts])
    directions = [d for d in (1, -1) if any(d in p.used for p in parts)]
    used = {d: [s for p in parts for s in p.used.get(d, [])] for d in directions}
    members = {d: [s.index for p in parts for s in p.strokes if s.direction == d] for d in directions}
    rows = {}
    for d in directions:
        chosen = {s.index for s in used[d]}
        rows[d] = matrices[d][np.array([index in chosen for index in members[d]], dtype=bool)]
    return Pieces(
        strokes=tuple(s for p in parts for s in p.strokes),
        profile=profile,
        used=used,
        rows=rows,
        times_s={d: np.concatenate([p.times_s[d] for p in parts if d in p.times_s]) for d in directions},
        sample_means_n={
            d: np.concatenate([p.sample_means_n[d] for p in parts if d in p.sample_means_n])
            for d in directions
            if any(d in p.sample_means_n for p in parts)
        },
        conditions={
            d: _joined_conditions([(p.conditions[d], len(p.used[d])) for p in parts if d in p.conditions])
            for d in directions
        },
        peaks=tuple(peak for p in parts for peak in p.peaks),
        stick_slip=tuple(s for p in parts for s in p.stick_slip),
    )


def _joined_profile(profiles: list[Profile]) -> tuple[Profile, dict[int, NDArray[np.float64]]]:
    """Bring the bins of all parts to one range of positions; they share the window and so the width of a bin."""
    first = profiles[0]
    width = float(np.diff(first.position_m[:2])[0])
    lead = [round((p.position_m[0] - first.position_m[0]) / width) for p in profiles]
    low = min(lead)
    count = max(at + p.position_m.size for at, p in zip(lead, profiles, strict=True)) - low
    place = first.position_m[0] + width * np.arange(low, low + count)
    matrices = {}
    for d, name in ((1, "up_strokes_n"), (-1, "down_strokes_n")):
        blocks = []
        for at, p in zip(lead, profiles, strict=True):
            block = np.full((getattr(p, name).shape[0], count), np.nan)
            block[:, at - low : at - low + p.position_m.size] = getattr(p, name)
            blocks.append(block)
        matrices[d] = np.concatenate(blocks)
    in_window = np.zeros(count, dtype=bool)
    in_window[lead[0] - low : lead[0] - low + first.position_m.size] = first.in_window
    up, down = mean_profile(matrices[1]), mean_profile(matrices[-1])
    joined = replace(
        first,
        position_m=place,
        up_n=up,
        down_n=down,
        friction_n=(up - down) / 2,
        offset_n=(up + down) / 2,
        up_strokes_n=matrices[1],
        down_strokes_n=matrices[-1],
        in_window=in_window,
    )
    return joined, matrices


def _joined_conditions(parts: list[tuple[Conditions, int]]) -> Conditions:
    """Mean over all strokes."""
    weights = [strokes for _, strokes in parts]

    def mean(name: str) -> float:
        return float(np.average([getattr(c.means, name) for c, _ in parts], weights=weights))

    first = parts[0][0]
    means = replace(first.means, **{name: mean(name) for name in vars(first.means)})
    moves = float(np.median(np.repeat([c.pressure_moves_n for c, _ in parts], weights)))
    return replace(first, means=means, samples=sum(c.samples for c, _ in parts), pressure_moves_n=moves)
