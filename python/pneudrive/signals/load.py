"""Reading of files as recordings: by a layout (whole, by cycles or in parts), and trajectories of simulations."""

from __future__ import annotations

import hashlib
import sys
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from pneudrive.arrays import Columns, Ints, rows_of
from pneudrive.errors import RecordingError
from pneudrive.files.content import check_file, kind_of_toml
from pneudrive.files.tables import Table, open_table
from pneudrive.signals.importer import SI_NAMES, import_file, read_binary, si_columns
from pneudrive.signals.layout import KINDS, AnyLayout, FileLayout, Layout, stem
from pneudrive.signals.recording import CHANNELS, ParallelForce, Recording
from pneudrive.signals.text_table import column_number, read_bytes
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import xarray as xr
    from numpy.typing import NDArray


HASHED_ROWS = 1 << 18  # of a long file at a time
#: Suffixes of texts and pictures beside recordings, and columns of friction tables that pneudrive writes there.
NO_RECORDING = frozenset({"", ".toml", ".md", ".json", ".html", ".pdf", ".png", ".svg", ".jpg", ".jpeg"})
OF_RESULTS = ("u_systematic_n", "model_n")
MISSING_LAYOUT = "give a layout with --layout LAYOUT.toml; 'pneudrive layout FILE' proposes one"


@dataclass(frozen=True)
class RecordingFile:
    """A file, its layout (None for a trajectory file), the name of its recording, and its kind."""

    path: Path
    layout: Layout | None
    name: str
    kind: str = "rig"

    @cached_property
    def said(self) -> FileLayout | None:
        """Layout with the overrides that match the name of the file."""
        return None if self.layout is None else self.layout.for_file(self.path, self.kind)

    @property
    def has_cycles(self) -> bool:
        """Whether the file is a campaign file, with a recording for each cycle."""
        return self.said is not None and self.said.columns.cycle is not None

    def read(self, raw: Columns | None = None, name: str = "") -> Recording:
        """Read the only recording of the file, or make one from some rows of its raw columns.

        Parameters
        ----------
        raw : dict, optional
            Rows from `rows`. Their recording has no hash of the file.
        name : str
            Name of a cycle; "": name of the file.
        """
        layout = self.said
        if layout is None:
            columns = read_columns(self.path, COLUMNS) if raw is None else raw
            return from_trajectory(columns, self.name, self.path, is_part=raw is not None)
        flags, sha256 = dict[str, int](), None
        if raw is None:
            columns, flags, sha256 = import_file(self.path, layout)
        else:
            columns = si_columns(layout, raw)
        _, *rig_channels = KINDS["rig"]["units"]
        measured = {SI_NAMES[name]: layout.channels[name] for name in rig_channels if name in layout.channels}
        limits = {name: column.range for name, column in measured.items() if column.range is not None}
        curve = layout.force_calibration if "force" in layout.channels else None
        if curve is not None and "force_n" in limits:
            low, high = layout.channels["force"].corrected(np.array(limits["force_n"]), curve)
            limits["force_n"] = (float(low), float(high))
        area_a, area_b = layout.geometry.areas() if layout.kind == "rig" else (0.0, 0.0)
        geometry = layout.geometry
        accuracy = {"area": geometry.area_accuracy} if geometry.bore_m is None else {"bore_m": geometry.bore_accuracy}
        accuracy |= {"alignment_rad": layout.rig.alignment_rad}
        accuracy |= {name: column.accuracy for name, column in measured.items()}
        return Recording(
            name=name or self.name,
            time_s=columns["time_s"],
            **{name: columns.get(name, 0.0) for name in CHANNELS},  # type: ignore[arg-type]
            area_a_m2=area_a,
            area_b_m2=area_b,
            ambient_pressure_pa=layout.ambient_pa,
            **layout.rig.model_dump(include={"mass_beyond_sensor_kg", "incline_rad", "stiffness_n_m"}),
            accuracy={name: value for name, value in accuracy.items() if value is not None},
            labels=layout.labels,
            window_m=layout.window.position,
            source=self.path,
            sha256=sha256,
            flags=flags,
            limits=limits,
            calibration={name: column.calibration for name, column in measured.items() if column.calibration},
            force_calibration=curve.applied() if curve is not None else None,
            parallel=tuple(
                ParallelForce(force.name, force.area_m2, force.area_accuracy, columns[f"force {number}"])
                for number, force in enumerate(layout.force, 1)
            ),
        )

    @cached_property
    def table(self) -> Table | None:
        """Table of a Parquet file with one recording, whose rows are independent and without dates; otherwise None."""
        said = self.said
        if said is None:
            is_plain = self.path.suffix == ".parquet"
        else:
            is_plain = said.format == "parquet" and said.is_plain and not said.dates and not self.has_cycles
        return open_table(self.path, "parquet") if is_plain else None

    @property
    def span(self) -> tuple[int, int]:
        """First used row and number of rows of a file that can be read in parts; zeros for other files."""
        if self.table is None:
            return 0, 0
        return (0 if self.said is None else self.said.skip_samples), self.table.count()

    def rows(self, rows: tuple[int, int]) -> Columns:
        """Read the raw columns, by channel, from row `rows[0]` up to and excluding row `rows[1]`."""
        if self.said is None:
            return read_columns(self.path, MEASURED, rows, self.table)
        table = read_binary(self.path, self.said, rows)
        return {channel: table.columns[table.places[c.column]] for channel, c in self.said.channels.items()}

    def sha256(self) -> str:
        """Return the hash of a long recording: of the bytes of its file, or of the columns of a trajectory."""
        if self.said is None and self.table is not None:
            edges = [*range(0, self.table.count(), HASHED_ROWS), self.table.count()]
            pieces = ((column, part) for column in COLUMNS for part in pairwise(edges))
            return digest_of(read_columns(self.path, [c], part, self.table)[c] for c, part in pieces)
        with self.path.open("rb", buffering=0) as data:
            return hashlib.file_digest(data, "sha256").hexdigest()


def recording_files(paths: Iterable[str | Path], layout: AnyLayout) -> list[RecordingFile]:
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
        if file.suffix.lower() in NO_RECORDING - {""} and file.is_file():
            kind = kind_of_toml(file) if file.suffix == ".toml" else "text or picture"
            raise RecordingError.of("signals.other-file", where=str(file), kind=kind)
        own = given
        if given is None and not is_trajectory(file):
            own = beside[file.parent] = beside.get(file.parent) or layout_beside(file)
        found.append(RecordingFile(file, own, name))
    return found


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings in a folder, sorted by path. The list is empty without a layout, and for a campaign.

    Pictures, texts and tables of results are not recordings.
    """
    if not (folder / "layout.toml").is_file() or (folder / "rig.json").exists():
        return []
    files = (one for one in folder.iterdir() if one.is_file() and not one.name.startswith("."))
    return sorted(f for f in files if f.suffix.lower() not in NO_RECORDING and not columns_in(f, OF_RESULTS))


def load_recordings(paths: Iterable[str | Path], layout: AnyLayout = None) -> list[Recording]:
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
        The message gives file, value, rule and remedy.
    """
    return [file.read() for file in recording_files(paths, layout)]


def hashes_of(path: Path) -> frozenset[str]:
    """Return the possible hashes of the recording in a file: those of its content and of a trajectory's columns.

    Raises
    ------
    RecordingError
        The file cannot be read.
    """
    found = [hashlib.sha256(read_bytes(path)).hexdigest()]
    if is_trajectory(path):
        columns = read_columns(path, COLUMNS)
        found.append(digest_of(columns[name] for name in COLUMNS))
    return frozenset(found)


def find_layout(file: Path) -> Layout | None:
    """Load ``layout.toml`` from the folder of a file, or from the folder above; return None without such a file."""
    above = file.parent.parent if file.parent.parts else Path("..")  # of a bare name both would be "."
    there = [f / "layout.toml" for f in (file.parent, above) if (f / "layout.toml").is_file()]
    return Layout.load(there[0]) if there else None


def layout_beside(file: Path) -> Layout:
    """Load ``layout.toml`` from the folder of a file, or from the folder above."""
    if (layout := find_layout(file)) is not None:
        return layout
    check_file(file, RecordingError)
    raise RecordingError("there is no layout for this file", where=str(file), remedy=MISSING_LAYOUT)


def load_recording(path: Path, layout: Layout | None) -> Recording:
    """Read one file through a layout, or a trajectory file (.parquet, .csv, .nc) without a layout.

    For a drive, the force is zero if it was not measured.

    Raises
    ------
    RecordingError, LayoutError
        As for `load_recordings`.
    """
    return RecordingFile(path, layout, stem(path), "rig" if layout is None else layout.kind).read()


BATCH_SAMPLES = 2_000_000  # samples that a worker holds at once: about 100 MB with its copies


def find_cycles(file: RecordingFile) -> tuple[Ints, Iterator[Recording]]:
    """Return the numbers of the cycles of a campaign file, and an iterator over their recordings.

    A campaign file is Parquet, with one row for each sample. The rows of a cycle are together and in the order of time.
    A column numbers the cycle (``cycle = { column = "cycle" }`` in the layout's ``[columns]``). The other columns are
    those of any recording, and 32-bit floats are allowed. Time may restart in each cycle. Every cycle is treated as a
    separate recording, by the same code.

    Raises
    ------
    RecordingError
        The file is not Parquet, has no such column or no rows, or the rows of a cycle are not together.
    """
    import polars as pl

    path, said = file.path, file.said
    assert said is not None
    if said.format != "parquet":
        raise RecordingError.of("signals.cycles-not-parquet", where=str(path), format=said.format)
    if not said.is_plain:
        raise RecordingError.of("signals.cycles-without-columns", where=str(path))
    table = open_table(path, "parquet")
    column = table.names[column_number(said.columns.cycle or 0, table.names, len(table.names), path)]
    runs = pl.Series(table.get([column])[column]).rle().struct.unnest()
    if runs.is_empty():
        raise RecordingError("there are no rows", where=str(path))
    again = runs["value"].filter(runs["value"].is_duplicated())
    if len(again):
        raise RecordingError.of("signals.cycle-apart", where=str(path), cycle=again.min())
    numbers = runs["value"].to_numpy()
    return numbers, _recordings(file, np.cumsum([0, *runs["len"]]), numbers)


def _recordings(file: RecordingFile, bounds: Ints, numbers: Ints) -> Iterator[Recording]:
    """Yield the recordings of the cycles of a campaign file, which is read in batches of rows.

    `bounds` contains the first row of each cycle, and the end of the last cycle.
    """
    start = 0
    while start < numbers.size:
        last = int(np.searchsorted(bounds, bounds[start] + BATCH_SAMPLES, side="right")) - 1
        stop = min(max(last, start + 1), numbers.size)
        rows = bounds[start : stop + 1] - bounds[start]
        raw = file.rows((int(bounds[start]), int(bounds[stop])))
        for number, first, end in zip(numbers[start:stop], rows[:-1], rows[1:], strict=True):
            yield file.read(rows_of(raw, slice(first, end)), f"{stem(file.path)}/{number}")
        start = stop


# Columns that identify a trajectory file; other files lack some.
COLUMNS = ("time_s", "position_m", "velocity_m_s", "friction_force_n", "pressure_a_pa", "pressure_b_pa", "command")
#: Columns of a trajectory that form a recording: time, and `CHANNELS`.
MEASURED = ("time_s", "position_m", "friction_force_n", "pressure_a_pa", "pressure_b_pa")
VARIABLES = tuple(meaning(column)[0] for column in COLUMNS)


def from_trajectory(
    columns: dict[str, NDArray], name: str, source: Path | None = None, *, is_part: bool = False
) -> Recording:
    """Make a recording from a trajectory's columns; a part of a trajectory has no hash.

    The force is the friction force, as from an ideal sensor between rig and piston in steady sliding. The areas are
    zero, because this force does not contain pressure forces.
    """
    measured = dict(zip(("time_s", *CHANNELS), (columns[c] for c in MEASURED), strict=True))
    return Recording(
        name=name,
        **measured,
        area_a_m2=0.0,
        area_b_m2=0.0,
        accuracy=dict.fromkeys((*CHANNELS, "area", "alignment_rad"), 0.0),
        source=source,
        sha256=None if is_part else digest_of(columns[c] for c in COLUMNS),
        synthetic=True,
    )


def digest_of(columns: Iterable[NDArray]) -> str:
    """Return the hash of the samples, one column after the other. Each column may be given in parts."""
    total = hashlib.sha256()
    for values in columns:
        total.update(np.ascontiguousarray(values).data)
    return total.hexdigest()


def is_run(item: object) -> TypeGuard[xr.Dataset]:
    """Return whether an object is a Dataset, without importing xarray."""
    kind = getattr(sys.modules.get("xarray"), "Dataset", None)  # none while another thread imports it
    return kind is not None and isinstance(item, kind)


def from_run(run: xr.Dataset, name: str = "trajectory") -> Recording:
    """Make a recording from a result of ``pn.simulate``.

    Raises
    ------
    RecordingError
        The Dataset is not a trajectory.
    """
    missing = [v for v in VARIABLES if v not in run.variables]
    if missing:
        raise RecordingError(f"the Dataset is not a trajectory: it lacks {', '.join(missing)}", where=name)
    return from_trajectory({c: run[v].to_numpy() for c, v in zip(COLUMNS, VARIABLES, strict=True)}, name)


def is_trajectory(path: Path) -> bool:
    """Return whether a file has the columns of a trajectory.

    Raises
    ------
    RecordingError
        The file does not exist or is damaged.
    """
    return len(columns_in(path, COLUMNS)) == len(COLUMNS)
