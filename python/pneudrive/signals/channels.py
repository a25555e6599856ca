"""The columns of a recording as they stand in its file, each with what it is: for views of any length of any file."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.tables import open_table
from pneudrive.signals.load import convert
from pneudrive.signals.tables.raw_table import read_raw_table
from pneudrive.signals.tables.sniff import sniff_format
from pneudrive.trajectory import meaning, save_columns

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.files.tables import Table
    from pneudrive.signals.layout import Layout, SampledLayout

    Array = NDArray[Any]

MOST_CHANNELS = 16
MOST_COLUMNS = 200
_TIME_NAMES = ("time", "t", "time_s", "time (s)", "time [s]")


@dataclass(frozen=True)
class FileChannel:
    """One column of numbers.

    Attributes
    ----------
    column : str
    label : str
        What it is, for people.
    unit : str
        Of its numbers.
    quantity : str
        Name by which the columns of two files are the same: that of the layout, or of the column without its unit.
    slope, zero : float
        SI value = slope * number + zero; pressures absolute. NaN: no such line is known.
    """

    column: str
    label: str
    unit: str
    quantity: str
    slope: float = math.nan
    zero: float = math.nan


@dataclass(frozen=True)
class ChannelFile:
    """A recording, open: its columns by name.

    Attributes
    ----------
    table : Table
    time : (str, float) or None
        Column of the time, and what one of its units is in s; None: samples are counted.
    channels : tuple of FileChannel
    """

    table: Table
    time: tuple[str, float] | None
    channels: tuple[FileChannel, ...]

    def times(self, rows: tuple[int, int]) -> Array:
        """Return the times of rows, s; without a column of times their numbers."""
        if self.time is None:
            return np.arange(*rows, dtype=float)
        return np.asarray(self.table.get([self.time[0]], rows)[self.time[0]], float) * self.time[1]


@dataclass(frozen=True)
class SharedChannel:
    """A column of a recording and the same one of another: numbers of the latter in the unit of the former."""

    own: FileChannel
    other: FileChannel
    slope: float
    zero: float

    def of(self, values: Array) -> Array:
        """Return numbers of the other file as this one would have them."""
        return values if (self.slope, self.zero) == (1.0, 0.0) else self.slope * values + self.zero


def open_channels(path: Path, layout: Layout | None, cache: Path) -> ChannelFile:
    """Open a recording of any format.

    Parameters
    ----------
    path : Path
    layout : Layout or None
        What the columns are; None: their names say it.
    cache : Path
        Folder in which a file that is not Parquet is converted, once.

    Raises
    ------
    RecordingError
        The file cannot be read, or has no column of numbers.
    """
    table, units = _table(path, cache)
    said = None if layout is None else _for_file(layout, path)
    numbers = _numbers(table)
    if not numbers:
        raise RecordingError("the file has no column of numbers", where=path.name)
    time, roles = _roles(said, table.names, numbers)
    units |= {} if layout is None else _stated(layout, table.names)
    found = [
        _channel(name, roles.get(name), said, units.get(name, "") or _unit(name))
        for name in sorted(numbers, key=lambda one: one not in roles)
        if time is None or name != time[0]
    ]
    return ChannelFile(table, time, tuple(found[:MOST_CHANNELS]))


def pairs(own: tuple[FileChannel, ...], other: tuple[FileChannel, ...]) -> list[SharedChannel]:
    """Return the columns that two recordings have in common.

    Of the same quantity: through SI where both are known in SI, else only those of the same unit.
    """
    out = []
    for one in own:
        same = next((it for it in other if it.quantity == one.quantity), None)
        if same is None:
            continue
        if (one.slope, one.zero, one.unit) == (same.slope, same.zero, same.unit):
            out.append(SharedChannel(one, same, 1.0, 0.0))
        elif math.isfinite(one.slope + same.slope):
            out.append(SharedChannel(one, same, same.slope / one.slope, (same.zero - one.zero) / one.slope))
        elif one.unit == same.unit and math.isnan(one.slope) and math.isnan(same.slope):
            out.append(SharedChannel(one, same, 1.0, 0.0))
    return out


def _channel(name: str, role: str | None, said: SampledLayout | None, unit: str) -> FileChannel:
    if role is not None and said is not None:
        slope, zero = _line(said, role)
        return FileChannel(name, f"{role.replace('_', ' ')} ({name})", unit, role, slope, zero)
    quantity, si_unit, _ = meaning(name)
    known = unit == si_unit and si_unit != "1"
    return FileChannel(name, quantity.replace("_", " "), unit, quantity, *((1.0, 0.0) if known else ()))


def _line(said: SampledLayout, role: str) -> tuple[float, float]:
    """Return slope and value at 0 of what a layout makes of a number; of a force sensor with a curve NaN."""
    if said.columns[role].curve is not None:
        return math.nan, math.nan
    column = said.columns[role]
    zero = float(convert(said, role, np.zeros(1))[0])
    return column.sign * column.scale * column.unit.factor, zero


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
    for name in table.names[:MOST_COLUMNS]:
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
            roles[name] = role
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
