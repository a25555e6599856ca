"""Importer: converts a foreign file of any format to SI columns, according to a layout.

`read_foreign` reads every column of a file without a layout. `read_channels` reads the columns of a layout in the units
of the file, and returns one value per channel and time. `import_file` converts these columns to SI, with absolute
pressures. No other module depends on the file format.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Array, Columns, Plain, rows_of
from pneudrive.errors import DescriptionError, RecordingError, warn
from pneudrive.files.formats import UNIT_OF
from pneudrive.files.tables import open_table
from pneudrive.signals import text_table, times
from pneudrive.signals.columns import SECONDARY, ColumnUnit, chamber_of, header_unit, role_of, split_name, words_of
from pneudrive.signals.layout import UNITS, FileLayout
from pneudrive.signals.text_table import FileForm, ForeignTable, read_bytes, read_text, sniff_format, sniff_text
from pneudrive.units import converter, suffix

WITH_CLOCKS = ("tdms", "mf4")  # formats in which each channel has its own times
TEXT_KINDS = frozenset("OSTU")  # kinds of arrays of texts
GUESSED_FROM = 400  # number of values for a guess of the format of dates
#: Channel of a layout -> name of its column in SI.
SI_NAMES = {channel: f"{channel}_{suffix(unit)}" if unit else channel for channel, unit in UNITS.items()}
SIGNAL_NOISE = 0.02  # of full opening: largest excess of a measured signal over its range (assumed)


def read_foreign(path: Path) -> tuple[FileForm, list[Array]]:
    """Return the format of a file and its columns of numbers; columns of texts are empty.

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
        return reading, [table.columns.get(table.places.get(at, ""), none) for at in range(reading.columns)]
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
    reading = FileForm(
        form,
        text_table.TextForm(),
        list(columns),
        [opened.metadata.get(UNIT_OF + name, "") for name in columns],
        len(columns),
        {number: dates[name] for number, name in enumerate(columns) if name in dates},
        other_lengths={name: column.size for name, column in found.items() if column.size != usual},
    )
    return reading, list(columns.values())


def _numeric(arrays: Mapping[str, NDArray[Any]], dates: Mapping[str, str], path: Path) -> Columns:
    """Return the columns of numbers, dates and times as numbers. Leave out texts and other arrays."""
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
    """Read all rows of the columns of a layout, and its channels with one value for each time.

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
