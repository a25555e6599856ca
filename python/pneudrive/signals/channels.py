"""Open recordings of any length for display, with columns in the units of the layout or of the file."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneudrive.errors import CommandError, DescriptionError, LayoutError, RecordingError
from pneudrive.files.tables import Table, open_table
from pneudrive.signals.force_calibration import ForceCalibration
from pneudrive.signals.layout import Column, FileLayout, Layout
from pneudrive.signals.load import TEXT_KINDS, names_of, read_channels, read_foreign
from pneudrive.signals.text_table import sniff_format
from pneudrive.simulation.trajectory import meaning, save_columns
from pneudrive.units import converter, is_unit

Array = NDArray[Any]
Names = dict[str, str]  # by name of a column

MOST_CHANNELS = 16
MOST_COLUMNS = 200
LEAST_SAMPLES, SEGMENT = 32, 1 << 14
UNEVEN = 0.01  # largest deviation of a step of time from the median one, as a share
_TIME_NAMES = ("time", "t", "time_s", "time (s)", "time [s]")


@dataclass(frozen=True)
class FileChannel:
    """One column of numbers.

    Attributes
    ----------
    column : str
    label : str
        Meaning as text.
    unit : str
        Unit of the displayed numbers.
    quantity : str
        Name of the quantity, by which the columns of two files are paired. It comes from the layout, or is the name of
        the column without its unit.
    slope, zero : float
        SI value = slope * displayed number + zero, pressures absolute. NaN if the conversion is unknown.
    said : Column or None
        Conversion of the file's numbers to `unit`, as the layout states it. None: the numbers are already in `unit`.
    curve : ForceCalibration or None
        Calibration of the force sensor.
    """

    column: str
    label: str
    unit: str
    quantity: str
    slope: float = math.nan
    zero: float = math.nan
    said: Column | None = None
    curve: ForceCalibration | None = None

    def of(self, raw: Array) -> Array:
        """Convert numbers of the file to the displayed unit."""
        if self.said is None:
            return raw
        value = self.said.in_unit(raw)
        return value if self.curve is None else self.said.corrected(self.slope * value, self.curve) / self.slope

    def si(self, shown: Any) -> Any:  # noqa: ANN401 - a number or an array
        """Convert displayed numbers to SI."""
        return self.slope * shown + self.zero


@dataclass(frozen=True)
class ChannelFile:
    """An open recording: columns by name, without the samples skipped by its layout.

    Attributes
    ----------
    name : str
        Name of the file.
    table : Table
        Columns of the file, or of the converted file.
    time : FileChannel or None
        Time column; None: sample numbers replace the time.
    channels : tuple of FileChannel
    first : int
        Row of the first sample in the table.
    origin : datetime64 or None
        Date and time of time 0, if the file has dates.
    notes : tuple of str
        Notes on how the file was read.
    """

    name: str
    table: Table
    time: FileChannel | None
    channels: tuple[FileChannel, ...]
    first: int = 0
    origin: np.datetime64 | None = None
    notes: tuple[str, ...] = ()

    def count(self) -> int:
        """Return the number of samples."""
        return max(self.table.count() - self.first, 0)

    def read(self, names: Sequence[str], rows: tuple[int, int]) -> tuple[Array, dict[str, Array]]:
        """Return times in s, or sample numbers if the time column is missing, and values of columns in their units."""
        wanted = [*names, *([] if self.time is None else [self.time.column])]
        raw = self.table.get(wanted, (self.first + rows[0], self.first + rows[1]))
        by_name = {channel.column: channel for channel in self.channels}
        values = {name: by_name[name].of(np.asarray(raw[name], float)) for name in names}
        if self.time is None:
            return np.arange(*rows, dtype=float), values
        time = raw[self.time.column]
        if self.origin is not None:
            time = (time.astype("datetime64[ns]") - self.origin) / np.timedelta64(1, "ns") / 1e9
        return self.time.si(self.time.of(np.asarray(time, float))), values

    def counted(self, fall: int) -> ChannelFile:
        """Return the file without its time column, because the times do not increase at sample `fall`."""
        return replace(
            self, time=None, notes=(*self.notes, f"the time decreases at sample {fall}: sample numbers replace it")
        )


def first_fall(seconds: Array, before: float) -> int | None:
    """Return the first sample whose time is missing or less than the previous time; None if all times increase.

    Parameters
    ----------
    seconds : ndarray, shape (n,)
    before : float
        Time of the sample before the first one; if there is none, time of the first sample.
    """
    falls = ~(np.diff(seconds, prepend=before) >= 0.0)
    return int(np.argmax(falls)) if falls.any() else None


def open_channels(path: Path, layout: Layout | None, cache: Path) -> ChannelFile:
    """Open a recording of any format, like `load_recording`.

    If the layout does not fit the file, the file is opened without the layout.

    Parameters
    ----------
    path : Path
    layout : Layout or None
        Layout of the columns. None: the meaning of columns follows from their names.
    cache : Path
        Folder for the converted copy of a file that is not Parquet.

    Raises
    ------
    RecordingError, LayoutError
        The file cannot be read with or without its layout, or has no column of numbers.
    """
    said: FileLayout | None = None
    notes: tuple[str, ...] = ()
    try:
        said = None if layout is None else layout.for_file(path, layout.kind)
        table, units, roles = _open(path, said, cache)
    except (RecordingError, LayoutError) as error:
        if layout is None:
            raise
        try:
            said, (table, units, roles) = None, _open(path, None, cache)
        except RecordingError:
            raise error from None
        told = (f"the layout does not fit this file: {error.what}", "its columns are shown unchanged", error.remedy)
        notes = ("; ".join(filter(None, told)),)
    kinds = {name: kind for name, kind in _kinds(table, table.names[:MOST_COLUMNS]).items() if kind in "iufM"}
    if not any(kind in "iuf" for kind in kinds.values()):
        raise RecordingError("the file has no column of numbers", where=path.name)
    time = _time(said, units, roles, kinds)
    first = 0 if said is None else said.skip_samples
    origin = None
    if time is not None and kinds[time.column] == "M":
        begin = table.get([time.column], (0, first + 1))[time.column].astype("datetime64[ns]")
        origin = next((one for one in begin if not np.isnat(one)), begin[0])
    found = [
        _channel(name, roles.get(name), said, units.get(name, ""))
        for name in sorted(kinds, key=lambda one: one not in roles)
        if kinds[name] in "iuf" and (time is None or name != time.column)
    ]
    notes += () if time is not None else ("no time column: sample numbers replace the time",)
    if late := [role for role, column in (said.channels.items() if said else ()) if column.delay_s]:
        notes += (f"shown as recorded, without the layout's delay_s: {', '.join(late)}",)
    if len(found) > MOST_CHANNELS:
        notes += (f"the first {MOST_CHANNELS} of {len(found)} channels are shown",)
    return ChannelFile(path.name, table, time, tuple(found[:MOST_CHANNELS]), first, origin, notes)


def pairs(own: ChannelFile, other: ChannelFile) -> list[tuple[FileChannel, FileChannel]]:
    """Return the columns that two recordings have in common.

    Two columns form a pair if they have the same `quantity`, and both convert to SI or have equal units. ``slope`` and
    ``zero`` of the second column of a pair convert to the unit of the first column, not to SI.

    Raises
    ------
    CommandError
        Only one of the two recordings has times.
    """
    if (own.time is None) != (other.time is None):
        counted, timed = sorted((own, other), key=lambda one: one.time is not None)
        raise CommandError.of("signals.samples-and-seconds", counted=counted.name, timed=timed.name)
    out = []
    for one in own.channels:
        same = next((it for it in other.channels if it.quantity == one.quantity), None)
        if same is None:
            continue
        if math.isfinite(one.slope + same.slope):
            line = {"slope": same.slope / one.slope, "zero": (same.zero - one.zero) / one.slope}
            out.append((one, replace(same, **line)))
        elif one.unit == same.unit:
            out.append((one, replace(same, slope=1.0, zero=0.0)))
    return out


def _channel(name: str, role: str | None, said: FileLayout | None, unit: str) -> FileChannel:
    if role is not None and said is not None:
        column = said.channels[role]
        line = column.conversion
        zero = line.shift + (said.ambient_pa if line.gauge else 0.0)
        label = f"{role.replace('_', ' ')} ({name})"
        curve = said.force_calibration if role == "force" else None
        return FileChannel(name, label, line.text, role, line.factor, zero, column, curve)
    quantity, si_unit, _ = meaning(name)
    unit = unit or ("" if si_unit == "1" else si_unit)
    slope, zero = (1.0, 0.0) if unit == si_unit != "1" else (math.nan, math.nan)
    return FileChannel(name, quantity.replace("_", " "), unit, quantity, slope, zero)


def _open(path: Path, said: FileLayout | None, cache: Path) -> tuple[Table, Names, Names]:
    """Open a file as a table that can be read in parts. Also return the unit and the role of columns by name.

    A file that is not Parquet, or has dates as texts, is first converted to Parquet.

    Raises
    ------
    RecordingError
        The file cannot be read, or its layout does not fit.
    """
    if (sniff_format(path) if said is None else said.format) == "parquet":
        table = open_table(path, "parquet")
        if said is None:
            return table, {}, {}
        names = names_of(said.places, table.names, path)
        if said.is_plain and TEXT_KINDS.isdisjoint(_kinds(table, names.values()).values()):
            return table, {}, {names[column.column]: channel for channel, column in said.channels.items()}
    how = (said.format, said.text_form, said.channels) if said is not None else ()
    converted = cache / f"table-{hashlib.sha256(repr(how).encode()).hexdigest()[:16]}.parquet"
    if not converted.is_file():
        if said is None:
            file = read_foreign(path)
            names = file.names if len({*file.names}) == file.columns else [f"column {k}" for k in range(file.columns)]
            columns = {name: file.values[at] for at, name in enumerate(names) if at not in file.words}
            about: dict[str, Names] = {"units": dict(zip(names, file.units, strict=False))}
        else:
            foreign, channels = read_channels(path, said, others=True)
            # A time at a rate has no column.
            places = {role: foreign.places.get(c.column, "time at a rate") for role, c in said.channels.items()}
            rest = {name: column for name, column in foreign.columns.items() if name not in foreign.places.values()}
            columns = {places[role]: column for role, column in channels.items()} | rest
            about = {"units": foreign.units, "roles": {name: role for role, name in places.items()}}
        cache.mkdir(parents=True, exist_ok=True)
        save_columns(columns, about, converted)
    table = open_table(converted, "parquet")
    about = json.loads(table.metadata["pneudrive"])
    return table, about["units"], about.get("roles", {})


def _kinds(table: Table, names: Iterable[str]) -> Names:
    """Return the type code of each column (NumPy's ``dtype.kind``), from its first rows."""
    return {name: first.dtype.kind for name, first in table.get(names, (0, 16)).items() if first.ndim == 1}


def _time(said: FileLayout | None, units: Names, roles: Names, kinds: Names) -> FileChannel | None:
    """Return the time column with its conversion to s: from the layout, or else by the name of the column."""
    for name, role in roles.items():
        if role == "time" and said is not None and name in kinds:
            return _channel(name, role, said, "s")
    for name in kinds:
        unit = units.get(name, "").strip("[]() ")
        if name.lower() in _TIME_NAMES and name not in roles:
            try:
                return FileChannel(name, "time", "s", "time", converter(unit, "s")[0] if is_unit(unit) else 1.0, 0.0)
            except DescriptionError:
                continue
    return None


def amplitude_density(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Return frequencies and the one-sided amplitude density by Welch's method (`scipy.signal.welch`, Hann windows).

    The mean of each segment is subtracted. Segments of at most 16384 samples overlap by half.

    Parameters
    ----------
    time_s, values : ndarray, shape (n,)
        At least 32 samples, evenly spaced within 1 %.

    Returns
    -------
    frequency_hz, density : ndarray
        Frequency in Hz, and density in the unit of the values per root Hz. The integral of the squared density over
        frequency is the variance.

    Raises
    ------
    RecordingError
        There are too few samples, their times are uneven, or a value is missing.
    """
    from scipy.signal import welch

    if len(time_s) < LEAST_SAMPLES:
        raise RecordingError(f"{len(time_s)} samples are too few for a spectrum", rule=f"at least {LEAST_SAMPLES}")
    steps = np.diff(time_s)
    step = float(np.median(steps))
    if not step > 0.0 or np.abs(steps - step).max() > UNEVEN * step:
        raise RecordingError("the samples are not evenly spaced in time", rule="steps must be equal within 1 %")
    if not np.isfinite(values).all():
        raise RecordingError("a value is missing", remedy="Choose a part without gaps.")
    frequency, power = welch(np.asarray(values, float), 1.0 / step, nperseg=min(SEGMENT, len(values)))
    return frequency[1:], np.sqrt(power[1:])
