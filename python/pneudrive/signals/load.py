"""Reading of files as recordings, through a layout."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.tables import open_table
from pneudrive.signals.importer import SI_NAMES, read_raw, read_rows, si_columns
from pneudrive.signals.layout import FileLayout, Layout, stem
from pneudrive.signals.layout_tables import CHANNEL_UNITS
from pneudrive.signals.recording import CHANNELS, ParallelForce, Recording
from pneudrive.signals.tables.text_table import read_bytes
from pneudrive.signals.trajectories import (
    COLUMNS,
    MEASURED,
    digest_of,
    is_trajectory,
    read_trajectory,
    recording_of,
)
from pneudrive.simulation.trajectory import read_columns as read_trajectory_columns

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from threading import Event

    from numpy.typing import NDArray

    from pneudrive.files.tables import Table

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
    """Read one file of a rig through a layout."""
    said = layout.for_file(path)
    return to_recording(name or stem(path), path, said, *read_raw(path, said))


def load_drive_motion(path: Path, layout: Layout) -> Recording:
    """Read position and pressures of one file of a drive, and a force of zero if the force was not measured.

    Raises
    ------
    RecordingError, LayoutError
        As for `load_recordings`.
    """
    said = layout.for_drive_file(path)
    return to_recording(stem(path), path, said, *read_raw(path, said))


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


def to_recording(
    name: str,
    path: Path,
    said: FileLayout,
    raw: dict[str, NDArray[np.float64]],
    flags: dict[str, int],
    sha256: str | None,
) -> Recording:
    """Convert raw columns to SI, absolute pressures and one time base."""
    values = si_columns(said, raw)
    rig, curve = said.rig, said.tables.force_calibration if "force" in said.columns else None
    stated = {f"{channel}_pa": pressure for channel, pressure in rig.chamber_pressures().items()}
    measured = {SI_NAMES[channel]: said.columns[channel] for channel in CHANNEL_UNITS if channel in said.columns}
    limits = {name: column.range for name, column in measured.items() if name != "time_s" and column.range is not None}
    if curve is not None and "force_n" in limits:
        sign = 1 if said.columns["force"].positive == "+x" else -1
        low, high = sign * curve.force_n(sign * np.array(limits["force_n"]))
        limits["force_n"] = (float(low), float(high))
    area_a, area_b = rig.geometry.areas() if said.kind == "rig" else (0.0, 0.0)
    return Recording(
        name=name,
        time_s=values["time_s"],
        **{channel: values.get(channel, stated.get(channel, 0.0)) for channel in CHANNELS},  # type: ignore[arg-type]
        area_a_m2=area_a,
        area_b_m2=area_b,
        ambient_pressure_pa=said.ambient_pressure_pa,
        mass_beyond_sensor_kg=rig.rig.mass_beyond_sensor_kg,
        incline_rad=rig.rig.incline_rad,
        accuracy=rig.geometry_accuracy()
        | {n: c.accuracy for n, c in measured.items() if n != "time_s" and c.accuracy is not None},
        labels=said.labels,
        window_m=rig.window.position,
        source=path,
        sha256=sha256,
        stiffness_n_m=rig.rig.stiffness_n_m,
        flags=flags,
        limits=limits,
        calibration={n: c.calibration for n, c in measured.items() if n != "time_s" and c.calibration},
        force_calibration=curve.applied() if curve is not None else None,
        parallel=tuple(_parallel_forces(said, values)),
    )


def _parallel_forces(said: FileLayout, values: dict[str, NDArray[np.float64]]) -> Iterator[ParallelForce]:
    for number, force in enumerate(said.rig.force, 1):
        against = values.get(f"force {number}: against", said.ambient_pressure_pa)
        area = (1 if force.positive == "+x" else -1) * force.area_m2
        yield ParallelForce(
            force.name, force.area_m2, force.area_accuracy, area * (values[f"force {number}: pressure"] - against)
        )
