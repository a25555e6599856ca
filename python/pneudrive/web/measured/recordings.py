"""Recordings for the page: channels by name, windows of any width, strokes, a proposed layout."""

from __future__ import annotations

import hashlib
import os
import shutil
import threading
from collections.abc import Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from pydantic import Field, FiniteFloat, StrictStr

from pneudrive.arrays import Array, Columns, Interval, Plain, attributes_of, by_name
from pneudrive.errors import CommandError, PneudriveError, RecordingError
from pneudrive.files.content import unreadable
from pneudrive.progress import Watch
from pneudrive.signals.channels import ChannelFile, amplitude_density, open_channels, pairs
from pneudrive.signals.drive_recording import NEEDED
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import is_trajectory, load_recording
from pneudrive.signals.motion import find_strokes
from pneudrive.signals.recording import clean
from pneudrive.simulation.trajectory import SUFFIXES, columns_in
from pneudrive.web.measured.tiles import BLOCK, Pyramid
from pneudrive.web.messages import MOST_PIXELS, PageRequest, pack, page_error, problems_of
from pneudrive.web.workspace import TABLES, Workspace, cache_folder, safe

ENDS = 1 << 16  # bytes at both ends of a file that enter its key
MOST_OPEN = 16  # recordings
PART, MOST_PARTS = 1 << 17, 256  # samples of a part of a column, 1 MB, and number of kept parts
MOST_VERSIONS = 2  # kept versions of a changing file: the shown one, and the one that is being read
MOST_SAMPLES_OF_STROKES = 5_000_000  # above this, strokes take longer than the page waits
MOST_STROKES = 5000
MOST_PLACES = 1000  # listed faults of one kind
MOST_SAMPLES = 1 << 21  # of a view, for a spectrum or as numbers


@dataclass(frozen=True, eq=False)  # it is the key of its kept columns
class OpenRecording:
    """A recording with the blocks of its pyramid."""

    file: ChannelFile
    pyramid: Pyramid
    key: str  # changes with the file and with its layout

    def sample_at(self, at: float, columns: Sequence[str]) -> tuple[float, dict[str, float]]:
        """Return time and values of the sample nearest to a time."""
        block = max(int(np.searchsorted(self.pyramid.time[:, 0], at, "right")) - 1, 0)
        rows = (max(block - 1, 0) * BLOCK, min((block + 2) * BLOCK, self.pyramid.count))
        time_s, values = self.samples(columns, rows)
        row = int(np.abs(time_s - at).argmin())
        return float(time_s[row]), {name: float(values[name][row]) for name in columns}

    def window(self, span: Interval, pixels: int, columns: Sequence[str]) -> tuple[Array, Columns, Plain]:
        """Return a view. See `Pyramid.window`."""
        return self.pyramid.window(span, pixels, columns, self.samples)

    def samples_in(self, span: Interval, columns: Sequence[str]) -> tuple[Array, Columns]:
        """Return times and values of all samples of channels within a span of time.

        Raises
        ------
        CommandError
            The span holds too many samples.
        """
        blocks = self.pyramid.time
        first = int(np.searchsorted(blocks[:, 1], span[0])) * BLOCK
        last = min(int(np.searchsorted(blocks[:, 0], span[1], "right")) * BLOCK, self.pyramid.count)
        if last - first > MOST_SAMPLES:
            raise CommandError.of("web.long-view", samples=last - first, most=MOST_SAMPLES)
        time_s, values = self.samples(columns, (first, last))
        inside = (time_s >= span[0]) & (time_s <= span[1])
        return time_s[inside], {name: values[name][inside] for name in columns}

    def samples(self, names: Sequence[str], rows: tuple[int, int]) -> tuple[Array, Columns]:
        """Return times in s between two rows, and values of columns, with NaN for missing numbers.

        Columns are read in parts. The parts of the last views are cached.
        """
        first = rows[0] // PART
        parts = range(first, max(-(-rows[1] // PART), first + 1))
        inside = slice(rows[0] - first * PART, rows[1] - first * PART)
        time_s, *values = (
            np.concatenate([column_part(self, key, at) for at in parts])[inside] for key in (None, *names)
        )
        return time_s, by_name(names, values)

    @cached_property
    def span(self) -> Interval:
        """First and last time, in s. For a single sample, the span is one second, because a view needs a width."""
        first, last = float(self.pyramid.time[0, 0]), float(self.pyramid.time[-1, 1])
        return (first, last) if first < last else (first - 0.5, last + 0.5)


@lru_cache(MOST_PARTS)
def column_part(recording: OpenRecording, column: str | None, number: int) -> Array:
    """Return a part of a column, or of the times."""
    rows = (number * PART, min((number + 1) * PART, recording.pyramid.count))
    time_s, values = recording.file.read([] if column is None else [column], rows)
    return time_s if column is None else np.where(np.isfinite(values[column]), values[column], np.nan)


class Reading(Future[OpenRecording]):
    """A recording that is being read for the first time, in the background."""

    share = 0.0  # that has been read

    def read(self, path: Path, layout: Layout | None, key: str) -> None:
        """Read the recording. At the end, the result or the error is set."""

        def tell(done: float, total: float, _: str) -> None:
            self.share = done / total if total else 0.0

        try:
            self.set_result(_opened(path, layout, key, Watch(tell)))
        except OSError as error:  # the file was removed, or the disk is full
            self.set_exception(unreadable(path, error, RecordingError))
        except BaseException as error:  # also an unexpected one; without an end the page would wait forever
            self.set_exception(page_error(error))


class Recordings:
    """Open recordings of a workspace. Each recording is read once, in the background.

    A file may change while it is shown. Data are stored under the key that the file had before reading. A change
    gives the file another key, so that the next request reads it again.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = threading.Lock()
        self._open: dict[str, Reading] = {}
        self._versions: dict[Path, list[str]] = {}  # past keys of a file, the newest last

    def opened(self, name: str) -> Reading:
        """Return a recording, or the progress of its reading. The first call starts the reading."""
        path = self.workspace.path(name, TABLES)
        layout = layout_in(self.workspace, path)
        own = _key(path)
        key = f"{own}-{'' if layout is None else hashlib.sha256(layout.text.encode()).hexdigest()}"
        with self._lock:
            found = self._open.get(key)
            if found is None:
                while len(self._open) >= MOST_OPEN:
                    self._open.pop(next(iter(self._open)))
                found = self._open[key] = Reading()
                # The stored data of earlier versions are deleted. Otherwise a growing file would fill the disk.
                keys = self._versions.setdefault(path, [])
                keys[:] = [*(known for known in keys if known != own), own]
                while len(keys) > MOST_VERSIONS:
                    older = keys.pop(0)
                    self._open = {known: one for known, one in self._open.items() if not known.startswith(older)}
                    shutil.rmtree(cache_folder() / older, ignore_errors=True)
                threading.Thread(target=found.read, args=(path, layout, key), daemon=True).start()
        wait([found], 0.2)
        return found

    def need(self, name: str) -> OpenRecording:
        """Return a recording that has already been read.

        Raises
        ------
        CommandError
            The recording is still being read.
        PneudriveError
            The recording cannot be read.
        """
        reading = self.opened(name)
        if not reading.done():
            raise CommandError(f"{name} is being read: {100 * reading.share:.0f} %")
        return reading.result()

    def version(self, name: str, key: str) -> OpenRecording | None:
        """Return the recording with this key, or None if this version is no longer readable."""
        path = self.workspace.path(name, TABLES)
        with self._lock:
            reading = self._open.get(key)
        if reading is None or not reading.done() or reading.exception() is not None:
            return None
        found = reading.result()
        is_changed = found.file.table.path == path and _key(path) != key.partition("-")[0]
        return None if is_changed else found  # a converted file does not change


class ViewRequest(PageRequest):
    """A part of a recording: start and end in s or samples, width of the drawing, names of columns (one per line).

    Attributes
    ----------
    start, end : float
    pixels : int
    columns : str
    beside : str or None
        Another recording that is drawn in the same panels.
    shift : float
        Time shift of the other recording, in s.
    """

    start: FiniteFloat = Field(alias="from")
    end: FiniteFloat = Field(alias="to")
    pixels: int = 1000
    columns: StrictStr = ""
    beside: StrictStr | None = None
    shift: FiniteFloat = 0.0

    @property
    def span(self) -> Interval:
        """Start and end of the view, in s.

        Raises
        ------
        CommandError
            The times do not increase, or the drawing is too wide.
        """
        if not (self.start < self.end and 1 <= self.pixels <= MOST_PIXELS):
            raise CommandError("the view is out of bounds", rule=f"start < end, 1 to {MOST_PIXELS} pixels")
        return self.start, self.end

    def columns_in(self, recording: OpenRecording) -> list[str]:
        """Return the requested columns that a recording has."""
        known = [channel.column for channel in recording.file.channels]
        return [name for name in self.columns.split("\n") if name in known]


def shown_recording(workspace: Workspace, path: str) -> Plain:
    """Open a recording, which may be incomplete. Until it is read, report progress or errors of the reading."""
    file = workspace.path(path, TABLES)
    try:
        reading = workspace.state(Recordings).opened(path)
        if not reading.done():
            return {"share": reading.share}
        found, layout = reading.result(), layout_in(workspace, file)
    except PneudriveError as error:
        return {"problems": problems_of(error)}
    return {
        **attributes_of(found, "key", "span"),
        "channels": [attributes_of(one, "column", "label", "unit") for one in found.file.channels],
        "samples": found.pyramid.count,
        "time": found.file.time is not None,
        "layout": "own names" if needs_none(file) else None if layout is None else layout.kind,
        "notes": found.file.notes if layout else found.file.notes + layout_above(workspace, file),
    }


def shown_window(workspace: Workspace, request: ViewRequest, path: str, key: str, number: object = None) -> bytes:
    """Return a view of a recording as a frame; the frame is empty if the recording does not have the requested key.

    A recording with another key has changed: its times and channels would not match those in the page.
    """
    head: Plain = {"number": number, "path": path, "key": None}
    recordings = workspace.state(Recordings)
    if (found := recordings.version(path, key)) is None:
        return pack(head, {})
    columns, span = request.columns_in(found), request.span
    time_s, channels, about = found.window(span, request.pixels, columns)
    if recordings.version(path, key) is None:  # the file was replaced during the reading
        return pack(head, {})
    head |= {"key": found.key, "from": span[0], "to": span[1], **about}
    arrays = {"time": time_s, **channels}
    if request.beside:
        other = recordings.need(request.beside)
        both = [(mine, its) for mine, its in pairs(found.file, other.file) if mine.column in columns]
        first, last = span[0] - request.shift, span[1] - request.shift
        arrays["beside/time"] = np.empty(0)
        if both and first <= other.span[1] and last >= other.span[0]:
            time_s, channels, _ = other.window((first, last), request.pixels, [its.column for _, its in both])
            arrays["beside/time"] = time_s + request.shift
            arrays |= {f"beside/{mine.column}": its.si(channels[its.column]) for mine, its in both}
    return pack(head, arrays, drawn=True)


def shown_spectrum(workspace: Workspace, path: str, request: ViewRequest) -> bytes:
    """Return the spectra of channels within a view as a frame.

    Raises
    ------
    CommandError
        The view holds too many samples, or the recording has no times.
    RecordingError
        As for `pneudrive.signals.channels.amplitude_density`.
    """
    found, span = workspace.state(Recordings).need(path), request.span
    if found.file.time is None:
        raise CommandError("a spectrum needs times", remedy="Name the column of time in layout.toml.")
    time_s, values = found.samples_in(span, request.columns_in(found))
    arrays = {}
    for name, own in values.items():
        arrays[f"hz/{name}"], arrays[f"density/{name}"] = amplitude_density(time_s, own)
    return pack({"from": span[0], "to": span[1]}, arrays)


def shown_samples(workspace: Workspace, path: str, request: ViewRequest) -> bytes:
    """Return all samples of channels within a view as a frame."""
    found = workspace.state(Recordings).need(path)
    time_s, values = found.samples_in(request.span, request.columns_in(found))
    return pack({}, {"time": time_s, **values})


def shown_strokes(workspace: Workspace, path: str) -> Plain:
    """Return the strokes and faults of a file: a recording that has a layout, or a trajectory.

    A stroke has start, end, direction and speed. A kind of fault has a count, and start and end of each occurrence.
    Without times, or with too many samples, both are empty and a note states the reason.
    """
    file, nothing = workspace.path(path, TABLES), {"strokes": [], "faults": {}}
    reading = workspace.state(Recordings).opened(path)
    if not reading.done():  # the file was replaced, and the new one is not shown yet
        return nothing
    opened, layout = reading.result(), layout_in(workspace, file)
    has_strokes = file.suffix in SUFFIXES and is_trajectory(file) if layout is None else layout.kind != "fixed-volume"
    if not has_strokes:
        return nothing
    if note := _hindrance(path, opened, layout):
        return {**nothing, "note": note}
    recording = load_recording(file, layout)
    times = recording.time_s
    strokes = [
        {
            "from": times[one.start],
            "to": times[one.stop - 1],
            "direction": one.direction,
            "speed": one.speed_m_s,
        }
        for one in find_strokes(recording.name, times, recording.position_m)
    ]
    is_cut, places = len(strokes) > MOST_STROKES, dict[str, list[Interval]]()
    flags = clean(recording, places).flags
    return {
        "strokes": strokes[:MOST_STROKES],
        "faults": {kind: {"count": flags[kind], "places": places.get(kind, [])[:MOST_PLACES]} for kind in flags},
        "note": f"The first {MOST_STROKES:,} of {len(strokes):,} strokes are shaded." if is_cut else "",
    }


def measured(
    workspace: Workspace,
    path: StrictStr,
    at: tuple[FiniteFloat, FiniteFloat],
    columns: tuple[StrictStr, ...],
    beside: StrictStr,
    shift: FiniteFloat,
) -> Plain:
    """Return the channels of a recording, and of another one if given, at the samples nearest to two times.

    Values of the other recording have the units and the clock of the first.

    Parameters
    ----------
    workspace : Workspace
    path : str
    at : (float, float)
        Two times in s, or two sample numbers.
    columns : tuple of str
    beside : str
        Another recording; may be empty.
    shift : float
        Time shift of the other recording, in s.
    """
    recordings, rows = workspace.state(Recordings), list[Plain]()
    own = recordings.need(path)
    #: Channel of a recording -> label, unit, and conversion of its values.
    shown: Plain = {one.column: (one.label, one.unit, float) for one in own.file.channels if one.column in columns}
    sides = [(path, own, 0.0, shown)]
    if beside:
        other = recordings.need(beside)
        both = [(mine, its) for mine, its in pairs(own.file, other.file) if mine.column in shown]
        converted = {its.column: (mine.label, mine.unit, its.si) for mine, its in both}
        sides.append((beside, other, shift, converted))
    for name, recording, behind, channels in sides:
        ends = [recording.sample_at(time - behind, list(channels)) for time in at]
        times = [time + behind for time, _ in ends]
        between = times[1] - times[0]
        for column, (label, unit, convert) in channels.items():
            first, second = (convert(values[column]) for _, values in ends)
            slope = (second - first) / between if between else None
            row = {"recording": name, "label": label, "unit": unit, "time_s": times, "values": [first, second]}
            rows.append({**row, "difference": second - first, "slope": slope})
    return {"rows": rows}


def _hindrance(name: str, opened: OpenRecording, layout: Layout | None) -> str:
    """Return the reason why strokes and faults of a recording are not shown; empty if they are shown."""
    count = opened.pyramid.count
    if count > MOST_SAMPLES_OF_STROKES:
        reason = f"Strokes and faults are not detected: {count:,} samples, and the limit is {MOST_SAMPLES_OF_STROKES:,}"
        is_of_rig = layout is None or layout.kind == "rig"
        return reason + (f". In a terminal: pneudrive characterise {safe(name)} finds strokes." if is_of_rig else ".")
    if opened.file.time is None:
        return "Strokes and faults are not shown: they need times, but the file has sample numbers only."
    return ""


def layout_in(workspace: Workspace, path: Path) -> Layout | None:
    """Return the layout next to a recording, or in the folder above, inside the workspace; None without a layout.

    A file with the column names of pneudrive needs no layout, and a layout of another file would not fit.
    """
    if needs_none(path):
        return None
    for folder in (path.parent, path.parent.parent):
        place = folder / "layout.toml"
        if place.is_file() and place.resolve().is_relative_to(workspace.root):
            return Layout.load(place)
    return None


def layout_above(workspace: Workspace, path: Path) -> tuple[str, ...]:
    """Return a note about a layout above the workspace.

    Commands use this layout for a file in the workspace, but the page does not.
    """
    above = path.parent == workspace.root and (workspace.root.parent / "layout.toml").is_file()
    if not above or needs_none(path):
        return ()
    remedy = "copy it into this folder, or start pneudrive web in the folder above"
    return (f"the folder above has a layout.toml, which commands use but the page does not: {remedy}",)


def needs_none(path: Path) -> bool:
    """Return whether a file has the column names of a run or of a recording of a drive."""
    if path.suffix not in SUFFIXES or not path.is_file():
        return False
    status = path.stat()
    return _has_own_names(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=4 * MOST_OPEN)
def _has_own_names(path: Path, _size: int, _changed_ns: int) -> bool:
    """Return the result of `needs_none`, cached for an unchanged file, because the reader process may be busy."""
    return is_trajectory(path) or len(columns_in(path, NEEDED)) == len(NEEDED)


def _key(path: Path) -> str:
    """Return the key of a file: its path, its inode, its size and times, and the bytes at both ends.

    A different file of the same size and time has another inode. A file that was changed only in the middle has another
    change time (ctime), which users cannot set.
    """
    if not path.is_file():
        raise RecordingError("there is no such file", where=path.name)
    try:
        status = path.stat()
        said = (str(path), status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
        digest = hashlib.sha256(repr(said).encode("utf-8", "surrogateescape"))
        with path.open("rb") as file:
            digest.update(file.read(ENDS))
            file.seek(max(status.st_size - ENDS, 0))
            digest.update(file.read(ENDS))
    except OSError as error:
        raise unreadable(Path(path.name), error, RecordingError) from None
    return digest.hexdigest()[:32]


def _opened(path: Path, layout: Layout | None, key: str, watch: Watch) -> OpenRecording:
    """Open a recording. Blocks, and the Parquet copy of a file in another format, are cached."""
    cache = cache_folder() / key.partition("-")[0]
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    os.utime(cache)  # `forget_unused` reads this time
    file = open_channels(path, layout, cache)
    pyramid = _blocks(path, file, cache, watch)
    if pyramid.fall is not None:
        file = file.counted(pyramid.fall)
        pyramid = _blocks(path, file, cache, watch)
    return OpenRecording(file, pyramid, key)


def _blocks(path: Path, file: ChannelFile, cache: Path, watch: Watch) -> Pyramid:
    """Return the blocks of a recording. They are cached for each selection of time and channels."""
    how = (file.table.path.name, file.first, file.time, file.channels)
    place = cache / hashlib.sha256(repr(how).encode()).hexdigest()[:16]
    pyramid = Pyramid.open(place)
    if pyramid is None:
        count = file.count()
        if not count:
            raise RecordingError("the file holds no samples", where=path.name)
        pyramid = Pyramid.build([one.column for one in file.channels], count, file.read, watch)
        pyramid.save(place)
    return pyramid


def proposed(workspace: Workspace, path: str) -> Plain:
    """Propose a layout for a recording: its text, the open points, and the reason for each column.

    Raises
    ------
    RecordingError
        As for `propose_layout`.
    """
    from pneudrive.signals.proposal import propose_layout

    found = propose_layout(workspace.path(path, TABLES))
    return {
        **attributes_of(found, "text", "problem", "kind"),
        "strokes": len(found.strokes),
        "guesses": [
            {"role": one.role, "column": str(one.column), "unit": one.unit, "why": one.reason} for one in found.guesses
        ],
    }
