"""Text files as tables of numbers."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.bounds import bound, within
from pneudrive.files.packed import pieces
from pneudrive.signals.tables.date_times import seconds

if TYPE_CHECKING:
    import polars as pl
    from numpy.typing import NDArray

NO_SENSOR = 1e100
UNREADABLE_SHARE = 0.01  # largest share of rows that are not numbers


@dataclass(frozen=True)
class TextForm:
    """Format of a text table.

    ``delimiter`` None means any white space; ``thousands`` is a separator inside numbers: all but
    the last are removed if it equals ``decimal``.
    """

    delimiter: str | None = None
    header: bool = False
    decimal: str = "."
    thousands: str | None = None
    skip_lines: int = 0
    comment: str = "#"


@dataclass
class NumberTable:
    """Columns with their names, and units if the file states them; ``flags`` counts rows that could not be read."""

    names: list[str]
    columns: list[NDArray[np.float64]]
    flags: dict[str, int] = field(default_factory=dict)
    units: list[str] = field(default_factory=list)


def read_bytes(path: Path) -> bytes:
    """Read a file, decompressed by its suffix, with one clear message on failure."""
    data = b"".join(pieces(path, RecordingError, folder="name the files, as in folder/*.csv"))
    if not data.strip():
        raise RecordingError("the file is empty", where=str(path))
    _check_lines(data, path)
    return data


def _check_lines(data: bytes, path: Path) -> None:
    """Refuse text in which a line does not end within the bound."""
    most, begin = int(bound("line_bytes")), 0
    while len(data) - begin > most and b"\0" not in data[:4096]:  # binary data are refused elsewhere
        end = max(data.rfind(sign, begin, begin + most) for sign in (b"\n", b"\r"))
        if end < 0:
            within("line_bytes", most + 1, f"a line is longer than {most:,} bytes", RecordingError, str(path))
        begin = end + 1


def decode(data: bytes, path: Path) -> str:
    """Return the text of a file; binary content is refused."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    head = data[:4096]
    control = sum(byte < 9 or 13 < byte < 32 for byte in head)
    if b"\x00" in head or control > 0.05 * len(head):
        raise RecordingError(
            "the file is binary, not text",
            where=str(path),
            value=repr(head[:16]),
            remedy="state its format in the layout (parquet, netcdf, tdms, mf4, mat), or export it as text",
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def split_row(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of one line, without white space and quotes around them."""
    if delimiter is None:
        return line.split()
    quoted = csv.reader([line], delimiter=delimiter, skipinitialspace=True) if '"' in line else [line.split(delimiter)]
    return [part.strip() for part in next(iter(quoted))]


def to_number(text: str, form: TextForm) -> float:
    """Read one field; an empty field is NaN; raise a ValueError for text."""
    if not text:
        return float("nan")
    if form.thousands:
        whole, last, rest = text.rpartition(form.thousands) if form.thousands == form.decimal else (text, "", "")
        text = whole.replace(form.thousands, "") + last + rest
    if form.decimal != ".":
        text = text.replace(form.decimal, ".")
    return float(text)


def measurable(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return numbers with NaN for infinite ones and for those with infinite squares."""
    if values.size and values.min() > -NO_SENSOR and values.max() < NO_SENSOR:  # False if one is NaN
        return values
    return np.where(np.abs(values) < NO_SENSOR, values, np.nan)


def is_words(fields: list[str], form: TextForm) -> bool:
    """Return whether no field of a line is a number: a header or a row of units."""
    for text in fields:
        try:
            to_number(text or "empty", form)
        except ValueError:
            continue
        return False
    return bool(fields)


def read_text(
    path: Path,
    data: bytes,
    form: TextForm,
    wanted: list[int | str],
    dates: dict[int | str, str] | None = None,
    *,
    others: bool = False,
) -> NumberTable:
    """Read the wanted columns of a text table.

    Parameters
    ----------
    path : Path
        For messages.
    data : bytes
    form : TextForm
    wanted : list of int or str
        Numbers or names of columns.
    dates : dict, optional
        Columns of dates and times, with their format; they become seconds since the first one.
    others : bool
        Every other column of numbers too, behind the wanted ones, in the same rows; NaN where it holds none.

    Raises
    ------
    RecordingError
        If a column is missing, or more than 1 % of the rows are not numbers.
    """
    text = decode(data, path)
    lines = text.splitlines()
    start = form.skip_lines
    names: list[str] = []
    units: list[str] = []
    if form.header:
        while start < len(lines) and not lines[start].strip(form.comment + " \t"):
            start += 1
        if start >= len(lines):
            raise RecordingError("there is no header line", where=str(path))
        names = split_row(lines[start].lstrip(form.comment), form.delimiter)
        start += 1
        if start < len(lines) and is_words(words := split_row(lines[start], form.delimiter), form):
            units, start = words, start + 1
    first = next((line for line in lines[start:] if line.strip() and not line.startswith(form.comment)), None)
    if first is None:
        raise RecordingError(
            "there are no rows of numbers",
            where=str(path),
            value=f"{len(lines)} lines",
            remedy="check header, skip_lines and comment in the layout",
        )
    width = len(split_row(first, form.delimiter))
    use = [column_number(column, names, width, path) for column in wanted]
    forms = {at: dates[column] for at, column in enumerate(wanted) if dates and column in dates}
    more = [at for at in range(width) if at not in use] if others else []
    columns, flags = _parse(lines, start, form, (use, more), forms, path)
    known = names if len(names) >= width and len(set(names)) == len(names) else [f"column {at}" for at in range(width)]
    found = [(at, one) for at, one in zip([*use, *more], columns, strict=True) if at in use or np.isfinite(one).any()]
    return NumberTable(
        [known[at] for at, _ in found],
        [one for _, one in found],
        flags,
        [units[at] if at < len(units) else "" for at, _ in found],
    )


def column_number(column: int | str, names: list[str], width: int, path: Path) -> int:
    """Return the number of a column given by name or number; refuse a missing one."""
    if isinstance(column, str):
        if column not in names:
            remedy = "name a column of the header, or give its number from 0"
            if not names:
                remedy = "write header = true, or give its number from 0"
            elif len(names) == 1:
                remedy = 'the header was read as one name: say what separates columns, as delimiter = "comma"'
            raise RecordingError(
                f"there is no column '{column}'",
                where=str(path),
                value=f"columns: {', '.join(names) or 'no header is read (header = false)'}",
                remedy=remedy,
            )
        places = [at for at, name in enumerate(names) if name == column]
        if len(places) > 1:
            raise RecordingError(
                f"{len(places)} columns are named '{column}'",
                where=str(path),
                rule="a name must be unique",
                remedy=f"give its number in the layout: column = {' or '.join(map(str, places))}",
            )
        return places[0]
    if not 0 <= column < width:
        raise RecordingError(
            f"there is no column {column}",
            where=str(path),
            value=f"the first row has {width} columns",
            rule="columns count from 0",
            remedy="check column and delimiter in the layout",
        )
    return column


def _parse(
    lines: list[str],
    start: int,
    form: TextForm,
    places: tuple[list[int], list[int]],
    dates: dict[int, str],
    path: Path,
) -> tuple[list[NDArray[np.float64]], dict[str, int]]:
    """Parse the used columns; count single broken rows, refuse many with the first one in the message.

    `places` are the numbers of the used columns, and of others, which break no row. `dates` gives the format of columns
    of dates and times, by their place among the used ones.
    """
    import polars as pl

    numbers = [at for at, line in enumerate(lines[start:], start) if line.strip() and line[:1] != form.comment]
    rows = pl.Series([lines[at] for at in numbers], dtype=pl.String)
    if form.delimiter is None:
        rows = rows.str.strip_chars().str.replace_all(r"\s+", " ")
    fields = rows.str.split(form.delimiter or " ")
    use, more = (
        [fields.list.get(i, null_on_oob=True).str.strip_chars().str.strip_chars('"') for i in part] for part in places
    )
    values = {at: _numbers(text, form) for at, text in enumerate(use) if at not in dates}
    good = np.ones(len(rows), dtype=bool)
    for text in use:
        good &= text.is_not_null().to_numpy()
    for column in values.values():
        good &= column.is_not_null().to_numpy()
    bad = np.flatnonzero(~good)
    if bad.size > max(UNREADABLE_SHARE * len(rows), 1):
        raise RecordingError(
            f"{bad.size} of {len(rows)} rows are not numbers",
            where=f"{path}, line {numbers[bad[0]] + 1}",
            value=lines[numbers[bad[0]]].strip()[:120],
            remedy="check delimiter, decimal, thousands, header and skip_lines in the layout",
        )
    columns = [
        seconds(text.filter(good).to_list(), dates[at], path)
        if at in dates
        else measurable(values[at].filter(good).to_numpy())
        for at, text in enumerate(use)
    ]
    columns += [measurable(_numbers(text, form).filter(good).to_numpy()) for text in more]
    return columns, ({"unreadable_row": bad.size} if bad.size else {})


def _numbers(text: pl.Series, form: TextForm) -> pl.Series:
    """Read fields like `to_number`, without a comment after a number; null if not a number."""
    import polars as pl

    text = text.str.replace(rf"\s*{re.escape(form.comment)}.*$", "")
    if form.thousands == form.decimal:
        parts = text.str.extract_groups(rf"^(.*)({re.escape(form.decimal)}.*)$").struct.unnest()
        whole, rest = (parts.to_series(i).fill_null("") for i in (0, 1))
        text = (whole.str.replace_all(form.decimal, "", literal=True) + rest).set(rest == "", None).fill_null(text)
    elif form.thousands:
        text = text.str.replace_all(form.thousands, "", literal=True)
    text = text.str.replace(form.decimal, ".", literal=True)
    return text.set(text == "", "nan").cast(pl.Float64, strict=False)
