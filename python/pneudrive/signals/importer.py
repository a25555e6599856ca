"""One importer: a foreign file of any format becomes columns of numbers, and through a layout columns in SI.

`read_foreign` reads every column of a file without a layout. `read_raw` reads the channels of a layout. `si_columns`
brings them to SI, with absolute pressures and one value for each time. Nothing behind this module knows the format.
"""

from __future__ import annotations

import hashlib
import math
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import DescriptionError, RecordingError, warn
from pneudrive.files.formats import UNIT_OF
from pneudrive.files.tables import open_table
from pneudrive.signals.layout_tables import UNITS
from pneudrive.signals.tables.column_units import ColumnUnit, split_name
from pneudrive.signals.tables.date_times import ISO, UNIT, guess_form, seconds
from pneudrive.signals.tables.names import SECONDARY, role_of, side_of, words_of
from pneudrive.signals.tables.sniff import FileForm, sniff_format, sniff_text
from pneudrive.signals.tables.text_table import (
    NumberTable,
    TextForm,
    column_number,
    measurable,
    read_bytes,
    read_text,
)
from pneudrive.signals.tables.timing import (
    COUNTERS,
    clocks_of,
    filled,
    on_clock,
    overlap,
    refuse_equal_stamps,
    unwrapped,
)
from pneudrive.units import converter

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.signals.layout import FileLayout
    from pneudrive.signals.layout_tables import TimeTable

    Array = NDArray[np.float64]
    Columns = dict[str, Array]

WITH_CLOCKS = ("tdms", "mf4")  # formats in which each channel has its own times
TEXT_KINDS = frozenset("OSTU")  # kinds of arrays of texts
GUESSED_FROM = 400  # number of values for a guess of the format of dates
#: Channel of a layout -> name of its column in SI.
SI_NAMES = {
    "time": "time_s",
    "position": "position_m",
    "force": "force_n",
    "velocity": "velocity_m_s",
    **{name: f"{name}_pa" for name in ("pressure", "inlet_pressure", "pressure_a", "pressure_b")},
    **{name: f"{name}_k" for name in ("temperature_a", "temperature_b")},
}
SIGNAL_NOISE = 0.02  # of full opening: largest excess of a measured signal over its range (assumed)


def read_foreign(path: Path) -> tuple[FileForm, list[Array]]:
    """Return the form of a file and its columns of numbers; columns of texts are empty.

    Raises
    ------
    RecordingError
        The file does not exist, is empty or of an unknown format, or has no table of numbers.
    """
    form = sniff_format(path)
    if form != "csv":
        return _read_all(form, path)
    reading = sniff_text(path)
    wanted: list[int | str] = [at for at in range(reading.columns) if at not in reading.words]
    found = dict(
        zip(wanted, read_text(path, read_bytes(path), reading.form, wanted, {**reading.dates}).columns, strict=True)
    )
    none = np.full_like(found[wanted[0]], np.nan)
    return reading, [found.get(at, none) for at in range(reading.columns)]


def _read_all(form: str, path: Path) -> tuple[FileForm, list[Array]]:
    """Read every column of numbers, or dates and times, with the most common length."""
    opened = open_table(path, form)
    found: dict[str, tuple[Array, str | None]] = {}
    for name, values in opened.get(opened.names).items():
        column = np.asarray(values)
        date_form = ISO if column.dtype.kind == "M" else None
        if column.ndim == 1 and column.dtype.kind in TEXT_KINDS:
            date_form = guess_form([str(text) for text in column[:GUESSED_FROM].tolist()])
        with suppress(RecordingError):  # texts, tables
            found[name] = _as_numbers(column, name, path, date_form), date_form
    sizes = [column.size for column, _ in found.values()]
    usual = max(sizes, key=sizes.count, default=0)
    kept = {name: pair for name, pair in found.items() if pair[0].size == usual}
    dates = {place: written for place, (_, written) in enumerate(kept.values()) if written is not None}
    units = [opened.metadata.get(UNIT_OF + name, "") for name in kept]
    others = {name: pair[0].size for name, pair in found.items() if name not in kept}
    reading = FileForm(form, TextForm(), list(kept), units, len(kept), dates, other_lengths=others)
    return reading, [column for column, _ in kept.values()]


def read_columns(
    form: str,
    path: Path,
    wanted: list[int | str],
    dates: dict[int | str, str] | None = None,
    rows: tuple[int, int] | None = None,
    *,
    others: bool = False,
) -> NumberTable:
    """Read the wanted columns of a file that is not text.

    Parameters
    ----------
    form : str
        Key of `FORMATS`.
    path : Path
    wanted : list of int or str
        Numbers or names of columns.
    dates : dict, optional
        Columns of dates and times, with the format of texts. They become seconds since the first one.
    rows : tuple of int, optional
        First row and the one after the last, for Parquet; None: all.
    others : bool
        Every other column of numbers with the same length, after the requested ones.

    Raises
    ------
    RecordingError
        If a column is missing or does not hold numbers, or the file has another format.
    """
    opened = open_table(path, form)
    names = names_of(wanted, opened.names, path)
    forms = {name: dates[column] for name, column in zip(names, wanted, strict=True) if dates and column in dates}
    more = [name for name in opened.names if name not in names] if others else []
    values = opened.get([*names, *more], rows, dates=frozenset(forms))
    columns = [_as_numbers(np.asarray(values[name]), name, path, forms.get(name)) for name in names]
    if len({column.size for column in columns}) > 1:
        sizes = ", ".join(f"{n}: {c.size}" for n, c in zip(names, columns, strict=True))
        rule = "all channels must have one rate; resample others before"
        raise RecordingError("the columns differ in length", where=str(path), value=sizes, rule=rule)
    if form in WITH_CLOCKS:  # channels that start later, or end earlier, than the others
        part = overlap(columns, columns[0].size)
        if part.start >= part.stop:
            raise RecordingError("the channels have no time in common", where=str(path), value=", ".join(names))
        columns, length = [column[part] for column in columns], columns[0].size
    else:
        part, length = slice(None), columns[0].size
    for name in more:
        with suppress(RecordingError):  # texts, tables
            column = _as_numbers(np.asarray(values[name]), name, path)
            if column.size == length:
                names.append(name)
                columns.append(column[part])
    units = [opened.metadata.get(UNIT_OF + name, "") for name in names]
    return NumberTable(names, columns, units=units, unread=[name for name in opened.names if name not in names])


def names_of(wanted: list[int | str], names: list[str], path: Path) -> list[str]:
    """Return the names of columns given by name or number; a TDMS channel may omit its group if unique.

    Raises
    ------
    RecordingError
        If a column is missing.
    """
    short: dict[str, list[str]] = {}
    for name in names:
        short.setdefault(name.rpartition("/")[2], []).append(name)
    full = [short[w][0] if isinstance(w, str) and len(short.get(w, [])) == 1 else w for w in wanted]
    return [names[column_number(column, names, len(names), path)] for column in full]


def _as_numbers(column: NDArray[Any], name: str, path: Path, date_form: str | None = None) -> NDArray[np.float64]:
    """Return a column as float64, dates and times as seconds since the first one.

    Raises
    ------
    RecordingError
        It does not contain the columns that the layout names.
    """
    if column.ndim == 1 and column.dtype.kind in {*TEXT_KINDS, "M"} and date_form is not None:
        return seconds(column if column.dtype.kind == "M" else column.astype(object).tolist(), date_form, path)
    if column.ndim != 1 or column.dtype.kind not in "iuf":
        is_date = column.dtype.kind == "M"
        raise RecordingError(
            f"column '{name}' holds dates and times" if is_date else f"column '{name}' is not a row of numbers",
            where=str(path),
            value=f"{column.dtype}, {column.shape}",
            remedy=f'unit = "{UNIT}" in the layout' if is_date else "name another column in the layout",
        )
    if date_form is not None:
        raise RecordingError(
            f"column '{name}' holds numbers, not dates and times",
            where=str(path),
            value=f"{column[:1].tolist()}",
            remedy='state its unit: unit = "s", or unit = "day"',
        )
    return measurable(column.astype(np.float64, copy=False))


def read_table(path: Path, said: FileLayout, data: bytes | None = None, *, others: bool = False) -> NumberTable:
    """Read the raw columns that a layout names, in its order, of all rows.

    Parameters
    ----------
    path : Path
    said : FileLayout
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
        form = said.tables.text_form
        table = read_text(path, data or read_bytes(path), form, said.places, said.dates, others=others)
    else:
        table = read_columns(said.format, path, said.places, said.dates, others=others)
    return _timed(table, said, str(path))


def _timed(table: NumberTable, said: FileLayout, where: str) -> NumberTable:
    """Return the columns of the channels, in their order, each with one value for each time; then other columns.

    Raises
    ------
    RecordingError
        Many samples share a stamp, or the time restarts in a segment.
    """
    read: dict[int | str | None, Array] = dict(zip(said.places, table.columns, strict=False))
    size = table.columns[0].size
    time, wraps = _time_of(said.time, read, size, table, where)
    found: Columns = {}
    completed = []
    for channel, column in said.columns.items():
        if channel == "time":
            found[channel] = time
            continue
        raw = read[column.column]
        if column.wraps is not None or channel == "position":
            raw, count = unwrapped(raw, COUNTERS if column.wraps is None else (column.wraps,))
            wraps += count if column.wraps is None else 0
        full = filled(time, raw, held=channel == "command")
        if column.clock is not None:
            full = on_clock(time, read[column.clock], raw)
        if full is not raw:
            completed.append(full)
        found[channel] = full
    part, others = overlap(completed, size), slice(len(said.places), None)
    units = table.units or [""] * len(table.names)
    known: Mapping[Any, tuple[str, str]] = dict(zip(said.places, zip(table.names, units, strict=True), strict=False))
    headers = [known.get(column.column, ("time at a rate", "")) for column in said.columns.values()]
    return NumberTable(
        [*(name for name, _ in headers), *table.names[others]],
        [column[part] for column in (*found.values(), *table.columns[others])],
        table.flags | ({"counter_wrap": wraps} if wraps else {}),
        [*(unit for _, unit in headers), *table.units[others]],
        unread=table.unread,
    )


def _time_of(
    column: TimeTable, read: Mapping[int | str | None, Array], size: int, table: NumberTable, where: str
) -> tuple[Array, int]:
    """Return the times in the unit of their column, and the number of wraps of a counter."""
    if column.rate_hz is not None:
        return np.arange(size) / column.rate_hz, 0
    time = read[column.column]
    if column.date is not None:
        return time + read[column.date], 0
    refuse_equal_stamps(time, column.column, where)
    clocks = clocks_of(column.format if column.is_date else None, column.conversion.factor)
    time, midnights = unwrapped(time, clocks, forward=True)
    counters = COUNTERS if column.wraps is None else (column.wraps,)
    time, wraps = (time, 0) if midnights else unwrapped(time, counters, forward=True)
    for number, row in enumerate(table.segments, 2):
        if 0 < row < size and time[row] < time[row - 1]:
            raise RecordingError(
                f"the time begins again in segment {number}",
                where=f"{where}, row {row + 1}",
                value=f"{time[row]:g} after {time[row - 1]:g}",
                remedy="save each segment as a separate file; if they follow each other without a gap, "
                'give the rate: time = { rate = "50 Hz" }',
            )
    return time, 0 if column.wraps is not None else wraps


def read_rows(path: Path, said: FileLayout, rows: tuple[int, int]) -> Columns:
    """Read some rows of the raw columns that a layout names, by channel, from a Parquet file."""
    return dict(zip(said.columns, read_columns(said.format, path, said.places, said.dates, rows).columns, strict=True))


def read_raw(path: Path, said: FileLayout) -> tuple[Columns, dict[str, int], str]:
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


def unit_doubts(said: FileLayout) -> list[str]:
    """Return differences between the unit in a column's name and the layout: sizes, and gauge or absolute."""
    doubts = []
    for channel, column in said.columns.items():
        _, named = split_name(column.column) if isinstance(column.column, str) else ("", None)
        if named is None or not named.si or not isinstance(unit := column.unit, ColumnUnit):
            continue
        where = f'the column "{column.column}" of {channel}'
        try:
            factor = converter(named.unit, UNITS.get(channel, "Pa"))[0]
        except DescriptionError:
            doubts.append(f"{where} is in {named.unit} by its name, which is not a unit of {channel}: check the column")
            continue
        is_other = not math.isclose(factor, unit.factor, rel_tol=1e-3) and column.scale == 1.0
        turned = None not in (named.gauge, unit.gauge) and named.gauge is not unit.gauge
        if is_other or turned:
            sort = "" if named.gauge is None else " gauge" if named.gauge else " abs"
            doubts.append(f"{where} is in {named.unit}{sort} by its name, but in {unit.text} by the layout")
    return doubts


def unread_pressures(said: FileLayout, unread: Iterable[str]) -> list[str]:
    """Return columns that are not read, and whose names say that they are pressures of a chamber open to ambient."""
    stated = said.rig.chamber_pressures().items()
    sides = {channel[-1] for channel, pressure in stated if pressure == said.ambient_pressure_pa}
    names = {name: split_name(name)[0] for name in unread if sides}
    return [
        name
        for name, bare in names.items()
        if role_of(bare) == "pressure"
        and not SECONDARY.search(words_of(bare))
        and {"1": "a", "2": "b"}.get(side := side_of(bare) or "", side) in {*sides, ""}
    ]


def si_columns(said: FileLayout, raw: Columns) -> Columns:
    """Return raw columns in SI on one time base, by the names of `SI_NAMES`; pressures absolute."""
    values = aligned(said, {channel: convert(said, channel, column) for channel, column in raw.items()})
    return {SI_NAMES.get(channel, channel): column for channel, column in values.items()}


def convert(said: FileLayout, channel: str, raw: Array) -> Array:
    """Return the raw values of one channel in SI, pressures absolute."""
    column = said.columns[channel]
    unit, curve = column.conversion, said.tables.force_calibration
    value = column.in_unit(raw)
    value = value if unit.factor == 1.0 else unit.factor * value
    value = value + unit.shift  # always: the result is never the raw column, and has no zero with a sign
    if channel == "force" and curve is not None:  # of the sensor, before the sign
        sign = 1 if column.positive == "+x" else -1
        value = sign * curve.force_n(sign * value)
    if channel == "command" and column.range is not None:  # noise of the measured signal at full opening
        value = np.where(np.abs(value) < 1.0 + SIGNAL_NOISE, np.clip(value, -1.0, 1.0), value)
    return value + said.ambient_pressure_pa if unit.gauge else value


def aligned(said: FileLayout, values: Columns) -> Columns:
    """Return all channels on the time base, without the ends at which a delayed channel has no values."""
    time = values["time"]
    delays = {channel: said.columns[channel].delay_s - said.columns["time"].delay_s for channel in values}
    late = {channel: shifted(time, values[channel], delay) for channel, delay in delays.items() if delay}
    if not late:
        return values
    part = overlap(late.values(), time.size)
    return {channel: column[part] for channel, column in (values | late).items()}


def shifted(time_s: Array, values: Array, delay_s: float) -> Array:
    """Return the values of a channel with the delay ``delay_s``, on the common time base. NaN for missing values."""
    order = np.isfinite(time_s)
    if not order.any() or (np.diff(time_s[order]) < 0).any():
        return values  # the recording refuses such times with its own message
    return np.interp(time_s, time_s[order] - delay_s, values[order], left=np.nan, right=np.nan)
