"""Recordings that are not text: Parquet, netCDF, and formats of optional libraries."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.formats import UNIT_OF
from pneudrive.files.tables import open_table
from pneudrive.signals.tables.date_times import ISO, UNIT, guess_form, seconds
from pneudrive.signals.tables.text_table import NumberTable, column_number, measurable
from pneudrive.signals.tables.timing import overlap

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

WITH_CLOCKS = ("tdms", "mf4")  # formats in which each channel has its own times
TEXT_KINDS = frozenset("OSTU")  # kinds of arrays of texts
GUESSED_FROM = 400  # number of values for a guess of the format of dates


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
    columns = [as_numbers(np.asarray(values[name]), name, path, forms.get(name)) for name in names]
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
            column = as_numbers(np.asarray(values[name]), name, path)
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


def read_all(
    form: str, path: Path
) -> tuple[list[str], list[NDArray[np.float64]], dict[int, str], list[str], dict[str, int]]:
    """Read every column of numbers, or dates and times, with the most common length.

    Returns
    -------
    list of str, list of ndarray, dict, list of str, dict
        Names, columns, columns of dates (by place) with their format, the units that the file states (TDMS:
        ``unit_string``), else empty, and the channels of other lengths.
    """
    opened = open_table(path, form)
    found: dict[str, tuple[NDArray[np.float64], str | None]] = {}
    for name, values in opened.get(opened.names).items():
        column = np.asarray(values)
        date_form = ISO if column.dtype.kind == "M" else None
        if column.ndim == 1 and column.dtype.kind in TEXT_KINDS:
            date_form = guess_form([str(text) for text in column[:GUESSED_FROM].tolist()])
        try:
            found[name] = as_numbers(column, name, path, date_form), date_form
        except RecordingError:
            continue  # texts, tables
    sizes = [column.size for column, _ in found.values()]
    usual = max(sizes, key=sizes.count, default=0)
    kept = {name: pair for name, pair in found.items() if pair[0].size == usual}
    dates = {place: written for place, (_, written) in enumerate(kept.values()) if written is not None}
    units = [opened.metadata.get(UNIT_OF + name, "") for name in kept]
    others = {name: pair[0].size for name, pair in found.items() if name not in kept}
    return list(kept), [column for column, _ in kept.values()], dates, units, others


def as_numbers(column: NDArray[Any], name: str, path: Path, date_form: str | None = None) -> NDArray[np.float64]:
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
