"""Recordings for the page: channels by name, windows of any width, strokes, a proposed layout."""

from __future__ import annotations

import hashlib
import os
import shutil
import threading
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import CommandError, PneudriveError, RecordingError
from pneudrive.files.content import unreadable
from pneudrive.progress import Watch
from pneudrive.signals.channels import open_channels, pairs
from pneudrive.signals.drive_recording import NEEDED
from pneudrive.signals.layout import Layout, stem
from pneudrive.signals.load import load_drive_motion, load_recording
from pneudrive.signals.motion import find_strokes
from pneudrive.signals.samples import find_faults
from pneudrive.signals.spectrum import amplitude_density
from pneudrive.signals.trajectories import is_trajectory, read_trajectory
from pneudrive.simulation.trajectory import SUFFIXES, columns_in
from pneudrive.web.cache import cache_folder
from pneudrive.web.measured.samples import KeptSamples
from pneudrive.web.measured.tiles import BLOCK, Pyramid, TileWindow
from pneudrive.web.messages import fault_of
from pneudrive.web.workspace import TABLES, safe

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from pneudrive.signals.channels import ChannelFile, FileChannel
    from pneudrive.signals.recording import Recording
    from pneudrive.web.workspace import Listed, Workspace

    Array = NDArray[Any]

ENDS = 1 << 16  # bytes at both ends of a file that enter its key
MOST_OPEN = 16  # recordings
MOST_VERSIONS = 2  # kept versions of a changing file: the shown one, and the one that is being read
MOST_SAMPLES_OF_STROKES = 5_000_000  # above this, strokes take longer than the page waits
MOST_STROKES = 5000
MOST_PLACES = 1000  # listed faults of one kind
MOST_SAMPLES_OF_SPECTRUM = 1 << 21


@dataclass(frozen=True)
class OpenRecording:
    """A recording with its blocks."""

    file: ChannelFile
    pyramid: Pyramid
    key: str = ""  # changes with the file and with its layout

    @property
    def time(self) -> FileChannel | None:
        """Column of the time. None if samples are counted instead of times."""
        return self.file.time

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on how the file was read."""
        return self.file.notes

    @property
    def channels(self) -> tuple[FileChannel, ...]:
        """Displayed metadata."""
        return self.file.channels

    def sample_at(self, at: float, columns: Sequence[str]) -> tuple[float, dict[str, float]]:
        """Return time and values of the sample nearest to a time."""
        block = max(int(np.searchsorted(self.pyramid.time[:, 0], at, "right")) - 1, 0)
        rows = (max(block - 1, 0) * BLOCK, min((block + 2) * BLOCK, self.pyramid.count))
        found = self.samples.get(columns, rows)
        row = nearest_sample(found.time_s, at)
        return float(found.time_s[row]), {name: float(found.values[name][row]) for name in columns}

    def window(self, span: tuple[float, float], pixels: int, columns: Sequence[str]) -> TileWindow:
        """Return a view. See `Pyramid.window`."""
        return self.pyramid.window(span, pixels, columns, self.samples)

    def spectrum(self, span: tuple[float, float], column: str) -> tuple[Any, Any]:
        """Return frequencies, Hz, and amplitude density of a channel within a span of time.

        Raises
        ------
        CommandError
            The span holds too many samples, or the recording has no times.
        RecordingError
            As for `pneudrive.signals.spectrum.amplitude_density`.
        """
        if self.time is None:
            raise CommandError("a spectrum needs times", remedy="Name the column of time in layout.toml.")
        blocks = self.pyramid.time
        first = int(np.searchsorted(blocks[:, 1], span[0]))
        last = int(np.searchsorted(blocks[:, 0], span[1], "right"))
        rows = (first * BLOCK, min(last * BLOCK, self.pyramid.count))
        if rows[1] - rows[0] > MOST_SAMPLES_OF_SPECTRUM:
            raise CommandError(
                f"the view has {rows[1] - rows[0]} samples",
                rule=f"a spectrum of at most {MOST_SAMPLES_OF_SPECTRUM}",
                remedy="Look closer.",
            )
        found = self.samples.get([column], rows)
        inside = (found.time_s >= span[0]) & (found.time_s <= span[1])
        return amplitude_density(found.time_s[inside], found.values[column][inside])

    @cached_property
    def samples(self) -> KeptSamples:
        """Samples of the recording. Samples near the last view are kept."""
        return KeptSamples(self.file)

    @cached_property
    def span(self) -> tuple[float, float]:
        """First and last time, s. A single time gets a span of one second, because a view needs a width."""
        first, last = float(self.pyramid.time[0, 0]), float(self.pyramid.time[-1, 1])
        return (first, last) if first < last else (first - 0.5, last + 0.5)


@dataclass
class Reading:
    """A recording that is being read for the first time."""

    share: float = 0.0
    error: PneudriveError | None = None
    done: OpenRecording | None = None
    ended: threading.Event = field(default_factory=threading.Event)

    @property
    def goes_on(self) -> bool:
        """The reading has not ended."""
        return self.done is None and self.error is None

    def need(self, name: str) -> OpenRecording:
        """Return the recording after reading.

        Raises
        ------
        CommandError
            It is still being read.
        PneudriveError
            It cannot be read.
        """
        if self.error is not None:
            raise self.error
        if self.done is None:
            raise CommandError(f"{name} is being read: {100 * self.share:.0f} %")
        return self.done


class Recordings:
    """Open recordings of a workspace. Each recording is read once, in the background.

    A file may change while it is shown. Data that were read have the key that the file had before reading. Later
    additions give the
    file another key, so that the next request reads it again.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = threading.Lock()
        self._open: dict[tuple[str, str], Reading] = {}
        self._versions: dict[Path, list[str]] = {}  # past keys of a file, the newest last

    def opened(self, name: str) -> Reading:
        """Return a recording, or the progress of its reading. The first call starts the reading."""
        path = self.workspace.path(name, TABLES)
        layout = layout_in(self.workspace, path)
        key = (_key(path), "" if layout is None else hashlib.sha256(layout.text.encode()).hexdigest())
        with self._lock:
            found = self._open.get(key)
            if found is None:
                while len(self._open) >= MOST_OPEN:
                    self._open.pop(next(iter(self._open)))
                found = self._open[key] = Reading()
                self._forget_older(path, key[0])
                threading.Thread(target=self._read, args=(path, layout, key, found), daemon=True).start()
        found.ended.wait(0.2)
        return found

    def _forget_older(self, path: Path, key: str) -> None:
        """Delete the stored data of an earlier version of a file. Otherwise a growing file would fill the disk."""
        keys = self._versions.setdefault(path, [])
        if key in keys:
            keys.remove(key)
        keys.append(key)
        while len(keys) > MOST_VERSIONS:
            older = keys.pop(0)
            for one in [one for one in self._open if one[0] == older]:
                del self._open[one]
            shutil.rmtree(cache_folder() / older, ignore_errors=True)

    def _read(self, path: Path, layout: Layout | None, key: tuple[str, str], reading: Reading) -> None:
        def tell(done: float, total: float, _: str) -> None:
            reading.share = done / total if total else 0.0

        try:
            found = _opened(path, layout, cache_folder() / key[0], Watch(tell))
            reading.done = replace(found, key="-".join(key))
        except PneudriveError as error:
            reading.error = error
        except OSError as error:  # the file was removed, or the disk is full
            reading.error = unreadable(path, error, RecordingError)
        except BaseException as fault:  # unexpected error; without an end the page would wait forever
            reading.error = fault_of(fault)
        finally:
            reading.ended.set()

    def need(self, name: str) -> OpenRecording:
        """Return a recording that has been read. See `Reading.need`."""
        return self.opened(name).need(name)

    def version(self, name: str, key: str) -> OpenRecording | None:
        """Return the recording with this key, or None if this version is no longer readable."""
        path = self.workspace.path(name, TABLES)
        with self._lock:
            reading = self._open.get(tuple(key.split("-", 1)))  # pyright: ignore[reportArgumentType] - of any length
        found = None if reading is None else reading.done
        is_changed = found is not None and found.file.table.path == path and _key(path) != key.partition("-")[0]
        return None if is_changed else found  # a converted file does not change

    def motion(self, name: str) -> dict[str, Any]:
        """Return strokes and faults of a rig's or a drive's recording with a layout, or of a trajectory.

        A stroke has start, end, direction and speed. A kind of fault has a count, and places as first and last time. If
        samples are counted or too many, strokes and faults are None, and a reason is given.
        """
        path = self.workspace.path(name, TABLES)
        reading = self.opened(name)
        if reading.goes_on:  # the file was replaced, and the new one is not shown yet
            return {"strokes": [], "faults": {}}
        opened, layout = reading.need(name), layout_in(self.workspace, path)
        moves = layout is not None or (path.suffix in SUFFIXES and is_trajectory(path))
        note = _hindrance(name, opened, layout) if moves else ""
        if note:
            return {"strokes": [], "faults": {}, "note": note}
        recording = motion_of(path, layout)
        if recording is None:
            return {"strokes": [], "faults": {}}
        times = recording.time_s
        found = find_strokes(recording.name, times, recording.position_m)
        every = [(float(times[one.start]), float(times[one.stop - 1]), one) for one in found]
        strokes = [
            {"from": begin, "to": end, "direction": one.direction, "speed": one.speed_m_s}
            for begin, end, one in every[:MOST_STROKES]
        ]
        if len(every) > MOST_STROKES:
            note = f"The first {MOST_STROKES:,} of {len(every):,} strokes are shaded."
        faults = {
            kind: {"count": one.count, "places": one.places[:MOST_PLACES]}
            for kind, one in find_faults(recording).items()
        }
        return {"strokes": strokes, "faults": faults, "note": note}

    def beside(
        self,
        own: OpenRecording,
        name: str,
        span: tuple[float, float],
        shift: float,
        pixels: int,
        columns: Sequence[str],
    ) -> dict[str, Array]:
        """Return a view of another recording with the columns, units and clock of this one."""
        other = self.need(name)
        both = [one for one in pairs(own.file, other.file) if one.own.column in columns]
        low, high = other.span
        first, last = span[0] - shift, span[1] - shift
        if not both or last < low or first > high:
            return {"beside/time": np.empty(0)}
        found = other.window((first, last), pixels, [one.other.column for one in both])
        values = {f"beside/{one.own.column}": one.of(found.channels[one.other.column]) for one in both}
        return {"beside/time": found.time_s + shift, **values}


def nearest_sample(time_s: Array, at: float) -> int:
    """Return the index of the sample nearest to a time among increasing times.

    The earlier of two equally near samples.
    """
    after = min(int(np.searchsorted(time_s, at)), len(time_s) - 1)
    return after - 1 if after and at - time_s[after - 1] <= time_s[after] - at else after


def motion_of(path: Path, layout: Layout | None) -> Recording | None:
    """Return a recording of a rig or a drive by its layout, or a trajectory.

    None for others, whose motion is unknown.
    """
    if layout is not None:
        read = {"rig": load_recording, "drive": load_drive_motion}.get(layout.kind)
        return None if read is None else read(path, layout)
    return read_trajectory(path, path.stem) if path.suffix in SUFFIXES and is_trajectory(path) else None


def by_stem(files: Iterable[Listed]) -> dict[str, list[str]]:
    """Return the recordings of each name without folder and suffix, which results may refer to."""
    out: dict[str, list[str]] = {}
    for one in files:
        if one.kind == "recording":
            out.setdefault(stem(Path(one.path)), []).append(one.path)
    return out


def _hindrance(name: str, opened: OpenRecording, layout: Layout | None) -> str:
    """Return the reason why strokes and faults of a recording are not shown. Empty if they are."""
    count = opened.pyramid.count
    if count > MOST_SAMPLES_OF_STROKES:
        strokes = (
            ""
            if layout is not None and layout.kind != "rig"
            else f". In a terminal: pneudrive characterise {safe(name)} finds strokes"
        )
        return (
            f"Strokes and faults are not searched: {count:,} samples, at most {MOST_SAMPLES_OF_STROKES:,} here"
            f"{strokes}."
        )
    return "Strokes and faults are not shown: they have times, but samples are counted." if opened.time is None else ""


def layout_in(workspace: Workspace, path: Path) -> Layout | None:
    """Return the layout next to a recording, or in the folder above, inside the workspace. None without a layout.

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
    remedy = "copy it into this folder, or start pneudrive web in that one"
    return (f"the folder above has a layout.toml, which commands use and the page does not open: {remedy}",)


def needs_none(path: Path) -> bool:
    """Return whether a file has the column names of a run or of a recording of a drive."""
    if path.suffix not in SUFFIXES or not path.is_file():
        return False
    status = path.stat()
    return _has_own_names(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=4 * MOST_OPEN)
def _has_own_names(path: Path, _size: int, _changed_ns: int) -> bool:
    """Query a file once, because the reader process may be busy."""
    return is_trajectory(path) or len(columns_in(path, NEEDED)) == len(NEEDED)


def _key(path: Path) -> str:
    """Return the key of a file: its path, its inode, its size and times, and the bytes at both ends.

    Another file of the same size and time has another inode. A file with a changed middle has another change time,
    which users cannot set.
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


def _opened(path: Path, layout: Layout | None, cache: Path, watch: Watch) -> OpenRecording:
    """Open a recording. A file that is not Parquet is converted once, and its blocks are made once."""
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    os.utime(cache)  # `forget_unused` reads this time
    file = open_channels(path, layout, cache)
    pyramid = _blocks(path, file, cache, watch)
    if pyramid.fall is not None:
        file = file.counted(pyramid.fall)
        pyramid = _blocks(path, file, cache, watch)
    return OpenRecording(file, pyramid)


def _blocks(path: Path, file: ChannelFile, cache: Path, watch: Watch) -> Pyramid:
    """Return the blocks of a recording. Blocks are made once for each way of reading."""
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


def proposed(workspace: Workspace, name: str) -> dict[str, Any]:
    """Propose a layout for a recording: its text, the open points, and the reason for each column.

    Raises
    ------
    RecordingError
        As for `propose_layout`.
    """
    from pneudrive.signals.proposal.propose import propose_layout

    found = propose_layout(workspace.path(name, TABLES))
    guesses = [
        {"role": one.role, "column": str(one.column), "unit": one.unit, "why": one.reason} for one in found.guesses
    ]
    return {
        "text": found.text,
        "problem": found.problem,
        "kind": found.kind,
        "strokes": len(found.strokes),
        "guesses": guesses,
    }
