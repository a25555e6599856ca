"""Recordings as the page shows them: channels by name, windows of any width, strokes, a layout proposed."""

from __future__ import annotations

import hashlib
import json
import threading
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import CommandError, PneudriveError, RecordingError
from pneudrive.files.tables import open_table
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import load_recording
from pneudrive.signals.motion import find_strokes
from pneudrive.signals.spectrum import amplitude_density
from pneudrive.signals.tables.raw_table import read_raw_table
from pneudrive.signals.tables.sniff import sniff_format
from pneudrive.signals.trajectories import is_trajectory, read_trajectory
from pneudrive.trajectory import SUFFIXES, meaning, save_columns
from pneudrive.watch import Watch
from pneudrive.web.samples import KeptSamples
from pneudrive.web.tiles import BLOCK, Pyramid, TileWindow
from pneudrive.web.workspace import CACHE, TABLES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.files.tables import Table
    from pneudrive.signals.layout import SampledLayout
    from pneudrive.web.workspace import Workspace

    Array = NDArray[Any]

ENDS = 1 << 16  # bytes at both ends of a file that its key is made of
MOST_CHANNELS = 16
MOST_OPEN = 16  # recordings
MOST_SAMPLES_OF_STROKES = 5_000_000  # beyond, strokes take longer than a page waits
MOST_STROKES = 5000
MOST_SAMPLES_OF_SPECTRUM = 1 << 21
_TIME_NAMES = ("time", "t", "time_s", "time (s)", "time [s]")


@dataclass(frozen=True)
class ShownChannel:
    """One channel: its column, what it is, and the unit of its numbers."""

    column: str
    label: str
    unit: str


@dataclass(frozen=True)
class OpenRecording:
    """A recording with its blocks."""

    table: Table
    time: tuple[str, float] | None  # column and what one of its units is in s; None: samples are counted
    channels: tuple[ShownChannel, ...]
    pyramid: Pyramid
    notes: tuple[str, ...] = ()

    def window(self, span: tuple[float, float], pixels: int, columns: Sequence[str]) -> TileWindow:
        """Return a view; see `Pyramid.window`."""
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
        """Its samples, of which those near the last view are kept."""
        return KeptSamples(self.table, self.time)

    @cached_property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""
        return float(self.pyramid.time[0, 0]), float(self.pyramid.time[-1, 1])


@dataclass
class Reading:
    """A recording that is being read for the first time."""

    share: float = 0.0
    error: PneudriveError | None = None
    done: OpenRecording | None = None
    ended: threading.Event = field(default_factory=threading.Event)


class Recordings:
    """The recordings of a workspace that are open; each is read once, in the background."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = threading.Lock()
        self._open: dict[tuple[str, str], Reading] = {}

    def opened(self, name: str) -> Reading:
        """Return a recording, or how far its reading is; the first call begins it."""
        path = self.workspace.path(name, TABLES)
        layout = layout_in(self.workspace, path)
        key = (_key(path), "" if layout is None else hashlib.sha256(layout.text.encode()).hexdigest())
        with self._lock:
            found = self._open.get(key)
            if found is None:
                while len(self._open) >= MOST_OPEN:
                    self._open.pop(next(iter(self._open)))
                found = self._open[key] = Reading()
                threading.Thread(target=self._read, args=(path, layout, key[0], found), daemon=True).start()
        found.ended.wait(0.2)
        return found

    def _read(self, path: Path, layout: Layout | None, key: str, reading: Reading) -> None:
        def tell(done: float, total: float, _: str) -> None:
            reading.share = done / total if total else 0.0

        try:
            reading.done = _opened(path, layout, self.workspace.root / CACHE / key, Watch(tell))
        except PneudriveError as error:
            reading.error = error
        finally:
            reading.ended.set()

    def need(self, name: str) -> OpenRecording:
        """Return a recording that has been read.

        Raises
        ------
        CommandError
            It is still being read.
        PneudriveError
            It cannot be read.
        """
        reading = self.opened(name)
        if reading.error is not None:
            raise reading.error
        if reading.done is None:
            raise CommandError(f"{name} is being read: {100 * reading.share:.0f} %")
        return reading.done

    def strokes(self, name: str) -> list[dict[str, float]]:
        """Return the strokes of a recording that has a layout, or is a trajectory: begin, end, direction, speed."""
        path = self.workspace.path(name, TABLES)
        if self.need(name).pyramid.count > MOST_SAMPLES_OF_STROKES:
            return []
        layout = layout_in(self.workspace, path)
        if layout is not None and layout.kind == "rig":
            recording = load_recording(path, layout)
        elif layout is None and path.suffix in SUFFIXES and is_trajectory(path):
            recording = read_trajectory(path, path.stem)
        else:
            return []
        time = recording.time_s
        return [
            {"from": time[one.start], "to": time[one.stop - 1], "direction": one.direction, "speed": one.speed_m_s}
            for one in find_strokes(recording.name, time, recording.position_m)[:MOST_STROKES]
        ]


def layout_in(workspace: Workspace, path: Path) -> Layout | None:
    """Return the layout beside a recording, or in the folder above, inside the workspace; None without one."""
    for folder in (path.parent, path.parent.parent):
        place = folder / "layout.toml"
        if place.is_file() and place.resolve().is_relative_to(workspace.root):
            return Layout.load(place)
    return None


def _key(path: Path) -> str:
    """Return the key of a file: its size, its time, and the bytes at both ends."""
    status = path.stat() if path.is_file() else None
    if status is None:
        raise RecordingError("there is no such file", where=path.name)
    digest = hashlib.sha256(f"{status.st_size} {status.st_mtime_ns}".encode())
    with path.open("rb") as file:
        digest.update(file.read(ENDS))
        file.seek(max(status.st_size - ENDS, 0))
        digest.update(file.read(ENDS))
    return digest.hexdigest()[:32]


def _opened(path: Path, layout: Layout | None, cache: Path, watch: Watch) -> OpenRecording:
    """Open a recording: a file that is not Parquet is converted once, its blocks are made once."""
    table, units = _table(path, cache)
    said = None if layout is None else _for_file(layout, path)
    numbers = _numbers(table)
    if not numbers:
        raise RecordingError("the file has no column of numbers", where=path.name)
    time, roles = _roles(said, table.names, numbers)
    units |= {} if layout is None else _stated(layout, table.names)
    channels = tuple(
        ShownChannel(name, roles.get(name, meaning(name)[0].replace("_", " ")), units.get(name, "") or _unit(name))
        for name in sorted(numbers, key=lambda one: one not in roles)
        if time is None or name != time[0]
    )[:MOST_CHANNELS]
    names = [one.column for one in channels]
    place = cache / hashlib.sha256(repr((time, names)).encode()).hexdigest()[:16]
    pyramid = Pyramid.open(place)
    if pyramid is None:
        count = table.count()
        if not count:
            raise RecordingError("the file holds no samples", where=path.name)
        pyramid = Pyramid.build(names, count, lambda rows: _times(table, time, rows), table.get, watch)
        if time is not None and not pyramid.rises:  # the clock was set back: samples are counted
            time = None
            pyramid = Pyramid.build(names, count, lambda rows: _times(table, time, rows), table.get, watch)
        else:
            pyramid.save(place)
    notes = () if time is not None else ("no column of rising times: samples are counted",)
    return OpenRecording(table, time, channels, pyramid, notes)


def _table(path: Path, cache: Path) -> tuple[Table, dict[str, str]]:
    """Open a file as a table that can be read in parts, and the units that it states."""
    if sniff_format(path) == "parquet":
        return open_table(path, "parquet"), {}
    converted = cache / "table.parquet"
    if not converted.is_file():
        form, columns = read_raw_table(path)
        names = form.names if len(set(form.names)) == len(columns) else [f"column {at}" for at in range(len(columns))]
        cache.mkdir(parents=True, exist_ok=True)
        units = dict(zip(names, form.units, strict=False))
        save_columns(dict(zip(names, columns, strict=True)), {"units": units}, converted)
    table = open_table(converted, "parquet")
    return table, json.loads(table.metadata["pneudrive"])["units"]


def _for_file(layout: Layout, path: Path) -> SampledLayout:
    if layout.kind == "rig":
        return layout.for_file(path)
    return layout.for_drive_file(path) if layout.kind == "drive" else layout.for_volume_file(path)


def _numbers(table: Table) -> list[str]:
    """Return the columns that hold numbers, by their first rows."""
    out = []
    for name in table.names[:200]:
        first = table.get([name], (0, 16)).get(name)
        if first is not None and first.ndim == 1 and first.dtype.kind in "iuf":
            out.append(name)
    return out


def _roles(
    said: SampledLayout | None, names: list[str], numbers: list[str]
) -> tuple[tuple[str, float] | None, dict[str, str]]:
    """Return the column of the time with its unit in s, and what the layout calls the other columns."""
    roles, time = {}, None
    for role, column in said.columns.items() if said is not None else ():
        place = column.column
        name = names[place] if isinstance(place, int) and place < len(names) else str(place)
        if name in numbers and role == "time":
            time = (name, column.unit.factor * column.scale)
        elif name in numbers:
            roles[name] = f"{role.replace('_', ' ')} ({name})"
    if time is None:
        found = next((name for name in numbers if name.lower() in _TIME_NAMES), None)
        time = None if found is None else (found, 1.0)
    return time, roles


def _stated(layout: Layout, names: list[str]) -> dict[str, str]:
    """Return the units that a layout states, by column."""
    out = {}
    for given in layout.tree.get("columns", {}).values():
        column = given.get("column")
        out[names[column] if isinstance(column, int) and column < len(names) else str(column)] = given.get("unit", "")
    return out


def _unit(name: str) -> str:
    unit = meaning(name)[1]
    return "" if unit == "1" else unit


def _times(table: Table, time: tuple[str, float] | None, rows: tuple[int, int]) -> Array:
    """Return the times of rows, s; without a column of times their numbers."""
    if time is None:
        return np.arange(*rows, dtype=float)
    return np.asarray(table.get([time[0]], rows)[time[0]], float) * time[1]


def proposed(path: Path) -> dict[str, Any]:
    """Propose a layout for a recording: its text, what is not clear yet, and why each column is what it is.

    Raises
    ------
    RecordingError
        As for `propose_layout`.
    """
    from pneudrive.signals.proposal.propose import propose_layout

    found = propose_layout(path)
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
