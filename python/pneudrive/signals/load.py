"""Read files as recordings: foreign files by a layout, and trajectories of simulations.

A foreign file of any format becomes columns in SI. `read_foreign` reads every column of a file without a layout.
`read_channels` reads the columns of a layout in the units of the file, and returns one value per channel and time.
`import_file` converts these columns to SI, with absolute pressures. No other module depends on the file format.

A recording is a whole file, a cycle of a campaign file, or a part of a long file.
"""

from __future__ import annotations

import hashlib
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Columns, Ints, Plain, rows_of
from pneudrive.errors import DescriptionError, RecordingError, warn
from pneudrive.files.content import check_file, kind_of_toml
from pneudrive.files.formats import UNIT_OF
from pneudrive.files.tables import Table, open_table
from pneudrive.signals import text_table, times
from pneudrive.signals.columns import SECONDARY, ColumnUnit, chamber_of, header_unit, role_of, split_name, words_of
from pneudrive.signals.layout import KINDS, UNITS, AnyLayout, FileLayout, Layout, stem
from pneudrive.signals.recording import CHANNELS, ParallelForce, Recording
from pneudrive.signals.text_table import ForeignFile, ForeignTable, read_bytes, read_text, sniff_format, sniff_text
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns
from pneudrive.units import converter, suffix

if TYPE_CHECKING:
    import xarray as xr

# --- A foreign file as columns in SI.

WITH_CLOCKS = ("tdms", "mf4")  # formats with names group/channel, in which each channel has its own times
TEXT_KINDS = frozenset("OSTU")  # kinds of arrays of texts
GUESSED_FROM = 400  # number of values for a guess of the format of dates
#: Channel of a layout -> name of its column in SI.
SI_NAMES = {channel: f"{channel}_{suffix(unit)}" if unit else channel for channel, unit in UNITS.items()}
SIGNAL_NOISE = 0.02  # of full opening: largest excess of a measured signal over its range (assumed)


def read_foreign(path: Path) -> ForeignFile:
    """Return the format of a file and its columns.

    Raises
    ------
    RecordingError
        The file does not exist, is empty or of an unknown format, or has no table of numbers.
    """
    form = sniff_format(path)
    if form == "csv":
        data = read_bytes(path)
        reading = sniff_text(path, data)
        wanted: list[int | str] = [at for at in range(reading.columns) if at not in reading.words]
        table = read_text(path, data, reading.form, wanted, {**reading.dates})
        none = np.full_like(table.columns[table.places[wanted[0]]], np.nan)
        values = [table.columns.get(table.places.get(at, ""), none) for at in range(reading.columns)]
        return replace(reading, values=values)
    opened, dates = open_table(path, form), dict[str, str]()
    arrays = opened.get(opened.names)
    for name, values in arrays.items():
        if values.dtype.kind == "M":
            dates[name] = times.ISO
        elif values.ndim == 1 and values.dtype.kind in TEXT_KINDS:
            written = times.guess_form([str(text) for text in values[:GUESSED_FROM].tolist()])
            dates |= {} if written is None else {name: written}
    found = _numeric(arrays, dates, path)
    sizes = [column.size for column in found.values()]
    usual = max(sizes, key=sizes.count, default=0)
    columns = {name: column for name, column in found.items() if column.size == usual}
    return ForeignFile(
        form,
        text_table.TextForm(),
        len(columns),
        names=list(columns),
        units=[opened.metadata.get(UNIT_OF + name, "") for name in columns],
        values=list(columns.values()),
        dates={number: dates[name] for number, name in enumerate(columns) if name in dates},
        other_lengths={name: column.size for name, column in found.items() if column.size != usual},
    )


def _numeric(arrays: Mapping[str, NDArray[Any]], dates: Mapping[str, str], path: Path) -> Columns:
    """Return columns of numbers, and columns of dates and times as numbers. Leave out texts and other arrays."""
    found = {}
    for name, values in arrays.items():
        with suppress(RecordingError):
            found[name] = _as_numbers(values, name, path, dates.get(name))
    return found


def read_binary(
    path: Path, layout: FileLayout, rows: tuple[int, int] | None = None, *, others: bool = False
) -> ForeignTable:
    """Read the columns of a layout from a file that is not text.

    Parameters
    ----------
    path : Path
    layout : FileLayout
    rows : tuple of int, optional
        First row and the row after the last, for Parquet; None: all.
    others : bool
        Whether to read every other column of numbers with the same length, after the requested ones.

    Raises
    ------
    RecordingError
        A column is missing or does not hold numbers, or the file has another format.
    """
    opened = open_table(path, layout.format)
    places = names_of(layout.places, opened.names, path)
    dates = {places[place]: written for place, written in layout.dates.items()}
    arrays = opened.get(opened.names if others else places.values(), rows, dates=frozenset(dates))
    names = list(dict.fromkeys(places.values()))
    columns = {name: _as_numbers(arrays.pop(name), name, path, dates.get(name)) for name in names}
    size = next(iter(columns.values())).size
    if any(column.size != size for column in columns.values()):
        sizes = ", ".join(f"{name}: {columns[name].size}" for name in names)
        raise RecordingError.of("signals.columns-differ", where=str(path), value=sizes)
    part = slice(None)
    if layout.format in WITH_CLOCKS:  # channels that start later, or end earlier, than the others
        part = times.overlap(columns.values(), size)
        if part.start >= part.stop:
            raise RecordingError("the channels have no time in common", where=str(path), value=", ".join(names))
    columns |= {name: column for name, column in _numeric(arrays, {}, path).items() if column.size == size}
    units = {name: opened.metadata.get(UNIT_OF + name, "") for name in columns}
    unread = [name for name in opened.names if name not in columns]
    return ForeignTable(rows_of(columns, part), places, units, {}, [], unread)


def names_of(wanted: list[int | str], names: list[str], path: Path) -> dict[int | str, str]:
    """Return the name of each column given by name or number. A TDMS channel with a unique name needs no group.

    Raises
    ------
    RecordingError
        A column is missing.
    """
    short: dict[str, list[str]] = {}
    for name in names:
        short.setdefault(name.rpartition("/")[2], []).append(name)
    only = {name: full[0] for name, full in short.items() if len(full) == 1}
    full = {w: only.get(w, w) if isinstance(w, str) else w for w in wanted}
    return {w: names[text_table.column_number(column, names, len(names), path)] for w, column in full.items()}


def _as_numbers(column: NDArray[Any], name: str, path: Path, date_form: str | None) -> Array:
    """Return a column as float64; dates and times become seconds since the first value.

    Raises
    ------
    RecordingError
        The column cannot be read as numbers.
    """
    if column.ndim == 1 and column.dtype.kind in {*TEXT_KINDS, "M"} and date_form is not None:
        return times.seconds(column if column.dtype.kind == "M" else column.astype(object).tolist(), date_form, path)
    if column.ndim != 1 or column.dtype.kind not in "iuf":
        parts = {"where": str(path), "value": f"{column.dtype}, {column.shape}", "name": name}
        if column.dtype.kind == "M":
            raise RecordingError.of("signals.dates-not-numbers", **parts)
        raise RecordingError.of("signals.no-numbers", **parts)
    if date_form is not None:
        raise RecordingError.of("signals.numbers-not-dates", where=str(path), value=f"{column[:1].tolist()}", name=name)
    return text_table.measurable(column.astype(np.float64, copy=False))


def read_channels(
    path: Path, layout: FileLayout, data: bytes | None = None, *, others: bool = False
) -> tuple[ForeignTable, Columns]:
    """Read the columns of a layout in all rows, and the channels of the layout with one value for each time.

    Parameters
    ----------
    path : Path
    layout : FileLayout
    data : bytes, optional
        Content of the file, if it has already been read.
    others : bool
        Whether to read all other columns of numbers in the file, too.

    Returns
    -------
    ForeignTable, dict
        The columns of the file, and the numbers of each channel, for rows in which all channels have values.

    Raises
    ------
    RecordingError
        The layout does not fit the file, many samples share a time stamp, or the time restarts in a segment.
    """
    if layout.format == "csv":
        data = data or read_bytes(path)
        table = read_text(path, data, layout.text_form, layout.places, layout.dates, others=others)
    else:
        table = read_binary(path, layout, others=others)
    wraps, time_column = 0, layout.time
    size = next(iter(table.columns.values())).size
    if time_column.column is None:
        assert time_column.rate_hz is not None
        time = np.arange(size) / time_column.rate_hz
    elif time_column.date is not None:
        time = table.columns[table.places[time_column.column]] + table.columns[table.places[time_column.date]]
    else:
        time = table.columns[table.places[time_column.column]]
        if (stamps := times.samples_of_a_stamp(time)) > 1.0:
            where = f"{path}, column {time_column.column!r}"
            raise RecordingError.of("signals.shared-stamps", where=where, count=stamps)
        form = time_column.format if time_column.is_date else None
        time, midnights = times.unwrapped(time, times.clocks_of(form, time_column.conversion.factor), forward=True)
        if not midnights:
            time, count = times.unwrapped(time, time_column.moduli, forward=True)
            wraps += count if time_column.wraps is None else 0
        for number, row in enumerate(table.segments, 2):
            if 0 < row < size and time[row] < time[row - 1]:
                back = f"{time[row]:g} after {time[row - 1]:g}"
                raise RecordingError.of("signals.time-again", where=f"{path}, row {row + 1}", value=back, number=number)
    channels: Columns = {}
    completed = []
    for channel, column in layout.channels.items():
        if column.column is None or channel == "time":
            channels[channel] = time
            continue
        raw = table.columns[table.places[column.column]]
        if column.wraps is not None or channel == "position":
            raw, count = times.unwrapped(raw, column.moduli)
            wraps += count if column.wraps is None else 0
        if column.clock is not None:
            full = times.on_clock(time, table.columns[table.places[column.clock]], raw)
        else:
            full = times.filled(time, raw, held=channel == "command")
        completed += [full] if full is not raw else []
        channels[channel] = full
    part = times.overlap(completed, time.size)
    flags = table.flags | ({"counter_wrap": wraps} if wraps else {})
    return replace(table, columns=rows_of(table.columns, part), flags=flags), rows_of(channels, part)


def import_file(path: Path, layout: FileLayout) -> tuple[Plain, dict[str, int], str]:
    """Read the columns of a layout, and convert them to SI.

    Returns
    -------
    dict, dict, str
        Columns of `si_columns`, counts of faults on reading, and hash of the file.

    Raises
    ------
    RecordingError
        The layout does not fit the file, or no sample is left.
    """
    data = read_bytes(path)
    table, channels = read_channels(path, layout, data)
    for doubt in _doubts(layout, table):
        warn(f"{path.name}: {doubt}")
    raw = rows_of(channels, slice(layout.skip_samples, None))
    if raw["time"].size == 0:
        numbers = {"size": channels["time"].size, "skip_samples": layout.skip_samples}
        raise RecordingError.of("signals.no-sample-left", where=str(path), **numbers)
    guessed = sum(column.guessed for column in layout.channels.values())
    flags = table.flags | ({"unit_guessed": guessed} if guessed else {})
    return si_columns(layout, raw), flags, hashlib.sha256(data).hexdigest()


def _doubts(layout: FileLayout, table: ForeignTable) -> Iterator[str]:
    """Yield messages on units that differ between file and layout, and on unused pressures of chambers.

    A file states a unit in the name of the column, or in a row of units below the names.
    """
    for channel, column in layout.channels.items():
        cell = table.units.get(table.places.get(column.column, ""), "")
        named = header_unit(cell) or split_name(str(column.column))[1]
        if named is None or not named.si or not isinstance(unit := column.unit, ColumnUnit):
            continue
        where = f'the column "{column.column}" of {channel}'
        try:
            factor = converter(named.unit, UNITS.get(channel, "Pa"))[0]
        except DescriptionError:
            yield f"{where} is in {named.unit} in the file, which is not a unit of {channel}: check the column"
            continue
        is_other = not math.isclose(factor, unit.factor, rel_tol=1e-3) and column.scale == 1.0
        turned = None not in (named.gauge, unit.gauge) and named.gauge is not unit.gauge
        if is_other or turned:
            sort = "" if named.gauge is None else " gauge" if named.gauge else " abs"
            yield f"{where} is in {named.unit}{sort} in the file, but in {unit.text} in the layout"
    stated = layout.chamber_pressures().items()
    sides = {channel[-1] for channel, pressure in stated if pressure == layout.ambient_pa}
    unread = []
    for name in table.unread if sides else ():
        bare = split_name(name)[0]
        if role_of(bare) == "pressure" and not SECONDARY.search(words_of(bare)) and chamber_of(bare) in {*sides, ""}:
            unread.append(f"'{name}'")
    if unread:
        yield (
            f"in the layout a chamber is open to ambient, so {', '.join(unread)} is not used: "
            "if it is the pressure of a chamber, name it pressure_a or pressure_b"
        )


def si_columns(layout: FileLayout, raw: Columns) -> Plain:
    """Convert raw columns, by channel, to SI on one time base; add stated pressures and parallel forces.

    Pressures become absolute. A force is corrected by the calibration of its sensor.

    Names are those of `SI_NAMES`, and ``force 1`` for the first ``[[force]]``. A pressure that the layout states is a
    single number, not an array. Delayed channels are shifted. Samples at the ends, where a shifted channel has no
    values, are left out.
    """
    values: Columns = {}
    for channel, numbers in raw.items():
        column, curve = layout.channels[channel], layout.force_calibration
        unit = column.conversion
        value = unit.factor * column.in_unit(numbers) + unit.shift
        if channel == "force" and curve is not None:
            value = column.corrected(value, curve)
        if channel == "command" and column.range is not None:  # noise of the measured signal at full opening
            value = np.where(np.abs(value) < 1.0 + SIGNAL_NOISE, np.clip(value, -1.0, 1.0), value)
        values[channel] = value + layout.ambient_pa if unit.gauge else value
    time, delay_s = values["time"], layout.time.delay_s
    known = np.isfinite(time)
    late = {name: delay for name, column in layout.channels.items() if (delay := column.delay_s - delay_s)}
    if late and known.any() and (np.diff(time[known]) >= 0).all():  # the recording refuses other times
        for channel, delay in late.items():
            measured = values[channel][known]
            values[channel] = np.interp(time, time[known] - delay, measured, left=np.nan, right=np.nan)
    part = times.overlap((values[channel] for channel in late), time.size)
    values = rows_of(values, part)
    for number, force in enumerate(layout.force, 1):
        across = values.pop(f"force {number}: pressure") - values.pop(f"force {number}: against", layout.ambient_pa)
        values[f"force {number}"] = (1 if force.positive == "+x" else -1) * force.area_m2 * across
    return {SI_NAMES.get(channel, channel): column for channel, column in (values | layout.chamber_pressures()).items()}


# --- Recordings of files.

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
        """Read the file as one recording, or make a recording from some rows of its raw columns.

        Parameters
        ----------
        raw : dict, optional
            Rows from `rows`. The recording then has no hash of the file.
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
        """Return the hash of a long recording, from the bytes of its file or from the columns of a trajectory."""
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
    """Return the recordings in a folder, sorted by path. Without a layout, and for a campaign, the list is empty.

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
    """Return the possible hashes of the recording in a file, from its content and from the columns of a trajectory.

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
    column = table.names[text_table.column_number(said.columns.cycle or 0, table.names, len(table.names), path)]
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
