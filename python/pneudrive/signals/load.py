"""Reading of files as recordings, through a layout."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import DescriptionError, RecordingError, warn
from pneudrive.files.tables import open_table
from pneudrive.signals.layout import FileLayout, Layout, SampledLayout, stem
from pneudrive.signals.layout_tables import CHANNEL_UNITS, UNITS
from pneudrive.signals.recording import ParallelForce, Recording
from pneudrive.signals.tables import date_times
from pneudrive.signals.tables.column_units import split_name
from pneudrive.signals.tables.formats import read_columns
from pneudrive.signals.tables.names import SECONDARY, role_of, side_of, words_of
from pneudrive.signals.tables.text_table import read_bytes, read_text
from pneudrive.signals.tables.timing import overlap, timed
from pneudrive.signals.trajectories import (
    COLUMNS,
    MEASURED,
    digest_of,
    is_trajectory,
    read_trajectory,
    recording_of,
)
from pneudrive.simulation.trajectory import read_columns as read_trajectory_columns
from pneudrive.units import converter

if TYPE_CHECKING:
    from collections.abc import Iterable
    from threading import Event

    from numpy.typing import NDArray

    from pneudrive.files.tables import Table
    from pneudrive.signals.layout import Parallel
    from pneudrive.signals.tables.text_table import NumberTable

SIGNAL_NOISE = 0.02  # of full opening: largest excess of a measured signal over its range (assumed)
HASHED_ROWS, HASHED_BYTES = 1 << 18, 1 << 20  # of a long file at a time
NO_RECORDING = frozenset({"", ".toml", ".md", ".json", ".html"})  # suffixes of texts beside recordings
MISSING_LAYOUT = "give a layout with --layout LAYOUT.toml; 'pneudrive layout FILE' proposes one"


@dataclass(frozen=True)
class RecordingFile:
    """A file, its layout (None: a trajectory file), and the name of its recording."""

    path: Path
    layout: Layout | None
    name: str

    @property
    def has_cycles(self) -> bool:
        """Whether it is a campaign file, with a recording for each cycle."""
        return self.layout is not None and self.layout.for_file(self.path).cycle is not None

    def read(self) -> Recording:
        """Read its single recording."""
        if self.layout is None:
            return read_trajectory(self.path, self.name)
        return load_recording(self.path, self.layout, self.name)


def recording_files(paths: Iterable[str | Path], layout: Layout | str | Path | None = None) -> list[RecordingFile]:
    """Find the layout and the name of each file; duplicate names get their folder as prefix."""
    files = [Path(p) for p in paths]
    if not files:
        raise RecordingError("no recording is given", remedy="give at least one file")
    given = layout if layout is None or isinstance(layout, Layout) else Layout.load(layout)
    beside: dict[Path, Layout] = {}
    counts = Counter(stem(file) for file in files)
    found = []
    for file in files:
        name = stem(file) if counts[stem(file)] == 1 else f"{file.parent.name}/{stem(file)}"
        if given is None and is_trajectory(file):
            found.append(RecordingFile(file, None, name))
            continue
        if given is None and file.parent not in beside:
            beside[file.parent] = layout_beside(file)
        found.append(RecordingFile(file, given or beside[file.parent], name))
    return found


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings of a folder with a layout, by name. Empty without a layout, and for a campaign folder."""
    if not (folder / "layout.toml").is_file() or (folder / "rig.json").exists():
        return []
    files = (one for one in folder.iterdir() if one.is_file() and not one.name.startswith("."))
    return sorted(one for one in files if one.suffix.lower() not in NO_RECORDING)


def load_recordings(paths: Iterable[str | Path], layout: Layout | str | Path | None = None) -> list[Recording]:
    """Read recordings, one per file.

    Parameters
    ----------
    paths
        Files; the order is kept.
    layout
        A layout or its file. None: ``layout.toml`` next to each recording, or in the folder above. Trajectory files do
        not need one.

    Returns
    -------
    list of Recording
        One per file.

    Raises
    ------
    RecordingError, LayoutError
        With file, value, rule and remedy.
    """
    return [file.read() for file in recording_files(paths, layout)]


def hashes_of(path: Path) -> frozenset[str]:
    """Return the hashes that a recording of a file may carry: of its content, and of the columns of a trajectory.

    Raises
    ------
    RecordingError
        If the file cannot be read.
    """
    found = [hashlib.sha256(read_bytes(path)).hexdigest()]
    if is_trajectory(path):
        columns = read_trajectory_columns(path, COLUMNS)
        found.append(digest_of(columns[name] for name in COLUMNS))
    return frozenset(found)


def find_layout(file: Path) -> Layout | None:
    """Load ``layout.toml`` from the folder of a file, or from the folder above; return None if there is none."""
    above = file.parent.parent if file.parent.parts else Path("..")  # of a bare name both would be "."
    there = [f / "layout.toml" for f in (file.parent, above) if (f / "layout.toml").is_file()]
    return Layout.load(there[0]) if there else None


def layout_beside(file: Path) -> Layout:
    """Load ``layout.toml`` from the folder of a file, or from the one above."""
    if (found := find_layout(file)) is not None:
        return found
    if not file.exists():
        raise RecordingError("there is no such file", where=str(file))
    raise RecordingError("there is no layout for this file", where=str(file), remedy=MISSING_LAYOUT)


def load_recording(path: Path, layout: Layout, name: str | None = None) -> Recording:
    """Read one file through a layout."""
    said = layout.for_file(path)
    raw, flags, digest = read_raw(path, said)
    return to_recording(name or stem(path), path, said, raw, flags, digest)


def load_drive_motion(path: Path, layout: Layout) -> Recording:
    """Read position and pressures of one file of a drive, and a force of zero if the force was not measured.

    Raises
    ------
    RecordingError, LayoutError
        As for `load_recordings`.
    """
    sampled = layout.for_drive_file(path)
    said = FileLayout(
        **vars(sampled),
        cycle=None,
        area_a_m2=0.0,
        area_b_m2=0.0,
        chamber_pressures={},
        incline_rad=0.0,
        mass_beyond_sensor_kg=0.0,
        stiffness_n_m=None,
        geometry_accuracy={},
        window_m=None,
    )
    raw, flags, digest = read_raw(path, sampled)
    return to_recording(stem(path), path, said, raw, flags, digest)


def read_rows(path: Path, said: FileLayout, rows: tuple[int, int]) -> dict[str, NDArray[np.float64]]:
    """Read some rows of the raw columns that a layout names, by channel, from a Parquet file."""
    return dict(zip(said.columns, read_columns(said.format, path, said.places, said.dates, rows).columns, strict=True))


@dataclass(frozen=True)
class LongFile:
    """A Parquet file of many rows that is read part by part.

    Attributes
    ----------
    file : RecordingFile
    said : FileLayout or None
        None: a trajectory.
    count : int
        Rows of the file.
    table : Table
        The file, open.
    """

    file: RecordingFile
    said: FileLayout | None
    count: int
    table: Table

    @property
    def first(self) -> int:
        """First row that is used."""
        return 0 if self.said is None else self.said.skip_samples

    def read(self, rows: tuple[int, int]) -> dict[str, NDArray[np.float64]]:
        """Read some rows of the raw columns, by channel."""
        if self.said is None:
            return read_trajectory_columns(self.file.path, MEASURED, rows, self.table)
        return read_rows(self.file.path, self.said, rows)

    def recording(self, raw: dict[str, NDArray[np.float64]]) -> Recording:
        """Return the recording of raw columns, without the hash of the file."""
        if self.said is None:
            return recording_of(raw, self.file.name, self.file.path, None)
        return to_recording(self.file.name, self.file.path, self.said, raw, {}, None)

    def sha256(self, ended: Event) -> str:
        """Return the hash that a recording of the whole file has: of its bytes, or of the columns of a trajectory.

        After `ended` is set, no caller waits for the hash, which then covers only the part that was read.
        """
        path = self.file.path
        if self.said is None:
            parts = [(begin, min(begin + HASHED_ROWS, self.count)) for begin in range(0, self.count, HASHED_ROWS)]
            pieces = ((column, part) for column in COLUMNS for part in parts if not ended.is_set())
            return digest_of(read_trajectory_columns(path, [c], part, self.table)[c] for c, part in pieces)
        total, buffer = hashlib.sha256(), memoryview(bytearray(HASHED_BYTES))
        with path.open("rb", buffering=0) as data:
            while not ended.is_set() and (count := data.readinto(buffer)):
                total.update(buffer[:count])
        return total.hexdigest()


def find_long(file: RecordingFile, least: int) -> LongFile | None:
    """Return a Parquet file with more than `least` rows for reading in parts; None for other files and for dates."""
    said = None if file.layout is None or file.has_cycles else file.layout.for_file(file.path)
    if file.has_cycles or (said is not None and (said.format != "parquet" or said.dates or not said.is_plain)):
        return None
    if said is None and file.path.suffix != ".parquet":
        return None
    table = open_table(file.path, "parquet")
    count = table.count()
    return LongFile(file, said, count, table) if count is not None and count > least else None


def read_raw(
    path: Path, said: FileLayout | SampledLayout
) -> tuple[dict[str, NDArray[np.float64]], dict[str, int], str]:
    """Read the raw columns that a layout names, by channel, the flags of reading, and the hash of the file.

    Raises
    ------
    RecordingError
        If the file cannot be read so, or no sample is left.
    """
    data = read_bytes(path)
    for doubt in unit_doubts(said):
        warn(f"{path.name}: {doubt}")
    table = read_table(path, said, data)
    if unread := unread_pressures(said, table.unread):
        shown = ", ".join(f"'{name}'" for name in unread)
        warn(
            f"{path.name}: the layout takes a chamber as open to ambient and does not use {shown}: "
            "name it as pressure_a or pressure_b if it is the pressure of a chamber"
        )
    raw = {channel: values[said.skip_samples :] for channel, values in zip(said.columns, table.columns, strict=True)}
    if raw["time"].size == 0:
        raise RecordingError(
            "no sample is left",
            where=str(path),
            value=f"{table.columns[0].size} rows, skip_samples = {said.skip_samples}",
            remedy="lower skip_samples in the layout",
        )
    guessed = sum(column.guessed for column in said.columns.values())
    return raw, table.flags | ({"unit_guessed": guessed} if guessed else {}), hashlib.sha256(data).hexdigest()


def unit_doubts(said: FileLayout | SampledLayout) -> list[str]:
    """Return differences between the unit in a column's name and the layout: sizes, and gauge or absolute."""
    doubts = []
    for channel, column in said.columns.items():
        _, named = split_name(column.column) if isinstance(column.column, str) else ("", None)
        if named is None or not named.si or column.unit.text in ("", date_times.UNIT):
            continue
        where = f'the column "{column.column}" of {channel}'
        try:
            factor = converter(named.unit, UNITS.get(channel, "Pa"))[0]
        except DescriptionError:
            doubts.append(f"{where} is in {named.unit} by its name, which is not a unit of {channel}: check the column")
            continue
        is_other = not math.isclose(factor, column.unit.factor, rel_tol=1e-3) and column.scale == 1.0
        turned = None not in (named.gauge, column.unit.gauge) and named.gauge is not column.unit.gauge
        if is_other or turned:
            sort = "" if named.gauge is None else " gauge" if named.gauge else " abs"
            doubts.append(f"{where} is in {named.unit}{sort} by its name, but in {column.unit.text} by the layout")
    return doubts


def unread_pressures(said: FileLayout | SampledLayout, unread: Iterable[str]) -> list[str]:
    """Return columns that are not read, and whose names say that they are pressures of a chamber open to ambient."""
    stated = said.chamber_pressures if isinstance(said, FileLayout) else {}
    sides = {channel[-1] for channel, pressure in stated.items() if pressure == said.ambient_pressure_pa}
    names = {name: split_name(name)[0] for name in unread if sides}
    return [
        name
        for name, bare in names.items()
        if role_of(bare) == "pressure"
        and not SECONDARY.search(words_of(bare))
        and {"1": "a", "2": "b"}.get(side := side_of(bare) or "", side) in {*sides, ""}
    ]


def read_table(
    path: Path, said: FileLayout | SampledLayout, data: bytes | None = None, *, others: bool = False
) -> NumberTable:
    """Read the raw columns that a layout names, in its order, of all rows.

    Parameters
    ----------
    path : Path
    said : FileLayout or SampledLayout
    data : bytes, optional
        Content of the file, if it is known.
    others : bool
        Every other column of numbers too, behind them.

    Raises
    ------
    RecordingError
        If the file cannot be read so.
    """
    if said.format == "csv":
        table = read_text(path, data or read_bytes(path), said.text, said.places, said.dates, others=others)
    else:
        table = read_columns(said.format, path, said.places, said.dates, others=others)
    return timed(table, said.columns, said.places, str(path))


def to_recording(
    name: str,
    path: Path,
    said: FileLayout,
    raw: dict[str, NDArray[np.float64]],
    flags: dict[str, int],
    sha256: str | None,
) -> Recording:
    """Convert raw columns to SI, absolute pressures and one time base."""
    values = aligned(said, {channel: convert(said, channel, column) for channel, column in raw.items()})
    time = values.pop("time")
    accuracy = dict(said.geometry_accuracy)
    limits: dict[str, tuple[float, float]] = {}
    calibration: dict[str, str] = {}
    channels: dict[str, NDArray[np.float64] | float] = {}
    for channel in CHANNEL_UNITS:
        if channel == "time":
            continue
        suffix = {"position": "position_m", "force": "force_n"}.get(channel, f"{channel}_pa")
        if channel not in values:
            channels[suffix] = 0.0 if channel == "force" else said.chamber_pressures[channel]
            continue
        column = said.columns[channel]
        channels[suffix] = values[channel]
        if column.accuracy_si is not None:
            accuracy[suffix] = column.accuracy_si
        if column.calibration:
            calibration[suffix] = column.calibration
        if column.range_si is not None:
            limits[suffix] = column.range_si
    force = said.columns.get("force")
    curve = None if force is None else force.curve
    if force is not None and curve is not None and "force_n" in limits:
        low, high = force.sign * curve.force_n(force.sign * np.array(limits["force_n"]))
        limits["force_n"] = (float(low), float(high))
    return Recording(
        name=name,
        time_s=time,
        position_m=np.asarray(channels["position_m"]),
        force_n=np.asarray(channels["force_n"]),
        pressure_a_pa=np.asarray(channels["pressure_a_pa"]),
        pressure_b_pa=np.asarray(channels["pressure_b_pa"]),
        area_a_m2=said.area_a_m2,
        area_b_m2=said.area_b_m2,
        ambient_pressure_pa=said.ambient_pressure_pa,
        mass_beyond_sensor_kg=said.mass_beyond_sensor_kg,
        incline_rad=said.incline_rad,
        accuracy=accuracy,
        labels=said.labels,
        window_m=said.window_m,
        source=path,
        sha256=sha256,
        stiffness_n_m=said.stiffness_n_m,
        flags=flags,
        limits=limits,
        calibration=calibration,
        force_calibration=curve.applied() if curve is not None else None,
        parallel=tuple(_parallel_force(force, values, said.ambient_pressure_pa) for force in said.parallel),
    )


def _parallel_force(force: Parallel, values: dict[str, NDArray[np.float64]], ambient_pa: float) -> ParallelForce:
    across = values[force.plus] - (ambient_pa if force.minus is None else values[force.minus])
    return ParallelForce(force.name, force.area_m2, force.uncertainty, force.sign * force.area_m2 * across)


def convert(said: FileLayout | SampledLayout, channel: str, raw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the raw values of one channel in SI, pressures absolute."""
    column = said.columns[channel]
    value = column.in_unit(raw)
    value = value if column.unit.factor == 1.0 else column.unit.factor * value
    value = value + column.unit.shift  # always: what is returned is never the raw column, and has no zero with a sign
    value = column.corrected(value)
    if channel == "command" and column.range_si is not None:  # noise of the measured signal at full opening
        value = np.where(np.abs(value) < 1.0 + SIGNAL_NOISE, np.clip(value, -1.0, 1.0), value)
    return value + said.ambient_pressure_pa if column.unit.gauge else value


def aligned(said: FileLayout | SampledLayout, values: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return all channels on the time base, without the ends at which a delayed channel has no values."""
    time = values["time"]
    delays = {channel: said.columns[channel].delay_s - said.columns["time"].delay_s for channel in values}
    late = {channel: shifted(time, values[channel], delay) for channel, delay in delays.items() if delay}
    if not late:
        return values
    part = overlap(late.values(), time.size)
    return {channel: column[part] for channel, column in (values | late).items()}


def shifted(time_s: NDArray[np.float64], values: NDArray[np.float64], delay_s: float) -> NDArray[np.float64]:
    """Return the values of a channel with the delay ``delay_s``, on the common time base. NaN for missing values."""
    order = np.isfinite(time_s)
    if not order.any() or (np.diff(time_s[order]) < 0).any():
        return values  # the recording refuses such times with its own message
    return np.interp(time_s, time_s[order] - delay_s, values[order], left=np.nan, right=np.nan)
