"""Text files as tables of numbers."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files.bounds import bound, within
from pneudrive.files.packed import pieces
from pneudrive.signals.times import looks_like_date_time, seconds

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    import polars as pl
    from numpy.typing import NDArray

NO_SENSOR = 1e100
UNREADABLE_SHARE = 0.01  # largest share of rows that are not numbers
MISSING = ("", "na", "n/a", "#n/a", "null", "none", "-", "--", "---")  # fields without a value, in lower case
_BEGIN = re.compile(r"[-+]?(?:[.,]?\d|nan|inf)", re.IGNORECASE)  # of a number
HEADER_ROWS = 4  # most rows of words below the names: units, descriptions


@dataclass(frozen=True)
class TextForm:
    """Format of a text table.

    ``delimiter`` None means any white space. ``thousands`` is a separator inside numbers. If ``thousands`` equals
    ``decimal``, the last sign is the decimal one. ``header_delimiter`` is empty if the header has the delimiter of the
    numbers.
    """

    delimiter: str | None = None
    header: bool = False
    decimal: str = "."
    thousands: str | None = None
    skip_lines: int = 0
    comment: str = "#"
    header_delimiter: str | None = ""

    @property
    def of_header(self) -> str | None:
        """The delimiter of the header."""
        return self.delimiter if self.header_delimiter == "" else self.header_delimiter


@dataclass(frozen=True)
class ForeignTable:
    """The columns of numbers of a file.

    Attributes
    ----------
    columns : dict
        Numbers by the name of the column.
    places : dict
        Requested name or number of a column -> its name in `columns`.
    units : dict
        Units that the file states, by name.
    flags : dict
        Counts of rows that could not be read.
    segments : list of int
        First row of each further segment of a file with repeated headers.
    unread : list of str
        Names of the file's other columns.
    """

    columns: dict[str, NDArray[np.float64]]
    places: dict[int | str, str]
    units: dict[str, str] = field(default_factory=dict)
    flags: dict[str, int] = field(default_factory=dict)
    segments: list[int] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)


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
    if head.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        what = "the file is a workbook or an archive, not text"
        raise RecordingError(what, where=str(path), remedy="save the sheet with the recording as CSV")
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
        return [part.strip('"') for part in line.split()]
    if '"' not in line:
        return [part.strip() for part in line.split(delimiter)]
    try:
        return [part.strip() for part in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
    except csv.Error:  # a field that never ends
        return [part.strip(' "') for part in line.split(delimiter)]


@lru_cache(maxsize=64)
def number_pattern(form: TextForm) -> str:
    """Return the regular expression of a number: only groups of three digits, and only the signs of the form."""
    decimal, whole = re.escape(form.decimal), r"\d*"
    if form.thousands == form.decimal:
        whole = rf"\d{{1,3}}(?:{decimal}\d{{3}})*|\d*"
    elif form.thousands:
        whole = rf"[1-9]\d{{0,2}}(?:{_thousands(form)}\d{{3}})+|\d*"
    return rf"(?i)^[-+]?(?:(?:{whole})(?:{decimal}\d*)?(?:e[-+]?\d+)?|nan|inf(?:inity)?)$"


def _thousands(form: TextForm) -> str:
    """Return the expression of the separator of thousands. Each blank represents all blanks."""
    mark = form.thousands or ""
    return r"[\s\u00a0\u202f]" if mark.isspace() else re.escape(mark)


def measurable(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return numbers with NaN in place of infinite numbers and numbers with infinite squares."""
    if values.size and values.min() > -NO_SENSOR and values.max() < NO_SENSOR:  # False if one is NaN
        return values
    return np.where(np.abs(values) < NO_SENSOR, values, np.nan)


def is_number(text: str, form: TextForm) -> bool:
    """Return whether a field is a number, a date, or empty."""
    if text.lower() in MISSING or looks_like_date_time(text):
        return True
    return _BEGIN.match(text) is not None and re.match(number_pattern(form), text) is not None


def is_words(fields: list[str], form: TextForm) -> bool:
    """Return whether no field of a line is a number: a header or a row of units."""
    there = [text for text in fields if text.lower() not in MISSING]
    return any(fields) and not any(is_number(text, form) for text in there)


def is_row_of_numbers(fields: list[str], form: TextForm, texts: Collection[int] = ()) -> bool:
    """Return whether a row holds numbers, dates and empty fields, except in columns of texts."""
    own = [text for at, text in enumerate(fields) if at not in texts]
    return any(own) and all(is_number(text, form) for text in own)


def read_text(
    path: Path,
    data: bytes,
    form: TextForm,
    wanted: list[int | str],
    dates: dict[int | str, str] | None = None,
    *,
    others: bool = False,
) -> ForeignTable:
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
        Columns of dates and times, with their format. They become seconds since the first one.
    others : bool
        Every other column with numbers, after the requested ones, in the same rows. NaN for other values.

    Raises
    ------
    RecordingError
        If a column is missing, or more than 1 % of the rows are not numbers.
    """
    lines = decode(data, path).splitlines()
    start, names, units = _header(lines, form, path)
    first = next((line for line in lines[start:] if line.strip() and not line.startswith(form.comment)), None)
    if first is None:
        raise RecordingError(
            "there are no rows of numbers",
            where=str(path),
            value=f"{len(lines)} lines",
            remedy="check header, skip_lines and comment in the layout",
        )
    width = len(split_row(first, form.delimiter))
    use = {column: column_number(column, names, width, path, is_text=True) for column in wanted}
    rows = [at for at, line in enumerate(lines[start:], start) if line.strip() and line[:1] != form.comment]
    rows, segments = without_headers(lines, rows, form, lines[start - 1] if names else None)
    known = names if len(names) >= width and len(set(names)) == len(names) else [f"column {at}" for at in range(width)]
    places = {known[at]: at for at in (*use.values(), *(range(width) if others else ()))}
    needed = [known[at] for at in dict.fromkeys(use.values())]
    forms = {known[use[column]]: written for column, written in (dates or {}).items()}
    columns, good = _parse(_fields([lines[at] for at in rows], form, places), form, needed, forms, path)
    bad = np.flatnonzero(~good)
    if bad.size > max(UNREADABLE_SHARE * len(rows), 1):
        raise RecordingError(
            f"{bad.size} of {len(rows)} rows are not numbers",
            where=f"{path}, line {rows[bad[0]] + 1}",
            value=lines[rows[bad[0]]].strip()[:120],
            remedy="check delimiter, decimal, thousands, header and skip_lines in the layout",
        )
    return ForeignTable(
        {name: column for name, column in columns.items() if name in needed or np.isfinite(column).any()},
        {column: known[at] for column, at in use.items()},
        {name: units[at] for name, at in places.items() if at < len(units)},
        {"unreadable_row": bad.size} if bad.size else {},
        segments,
        [name for at, name in enumerate(names) if at not in use.values()],
    )


def _header(lines: list[str], form: TextForm, path: Path) -> tuple[int, list[str], list[str]]:
    """Return the line below the header, the names and the units of the columns."""
    start = form.skip_lines
    if not form.header:
        return start, [], []
    while start < len(lines) and not lines[start].strip(form.comment + " \t"):
        start += 1
    if start >= len(lines):
        raise RecordingError("there is no header line", where=str(path))
    start = _below_remarks(lines, start, form)
    names = split_row(lines[start].lstrip(form.comment), form.of_header)
    units: list[str] = []
    for row in lines[start + 1 : start + 1 + HEADER_ROWS]:
        line = row.lstrip(form.comment)
        words = split_row(line, form.of_header)
        if any(words) and not is_words(split_row(line, form.delimiter), form):
            break
        units, start = units or (words if any(words) else []), start + 1
    return start + 1, names, units


def _below_remarks(lines: list[str], start: int, form: TextForm) -> int:
    """Return the line of a header below remarks behind the comment sign, or the first remark if it is the header."""
    plain = (at for at in range(start, len(lines)) if lines[at].strip() and lines[at].lstrip()[0] != form.comment)
    header, below = next(plain, None), next(plain, None)
    if header in (None, start) or below is None:
        return start
    names, width = split_row(lines[header], form.of_header), len(split_row(lines[below], form.delimiter))
    remark = split_row(lines[start].lstrip(form.comment), form.of_header)
    return header if len(remark) < width == len(names) and is_words(names, form) else start


def without_headers(
    lines: list[str], rows: list[int], form: TextForm, last_of_header: str | None
) -> tuple[list[int], list[int]]:
    """Return the rows of numbers without the headers of further segments, and the first row of each segment.

    Programs that append to a file repeat the header. The last header line marks each segment, and the lines between it
    and the last row of numbers belong to the header.
    """
    if last_of_header is None or not rows:
        return rows, []
    marks = [at for at in rows if lines[at] == last_of_header]
    if not marks:
        return rows, []
    texts = {at for at, text in enumerate(split_row(lines[rows[0]], form.delimiter)) if is_words([text], form)}
    dropped: set[int] = set()
    for mark in marks:
        at = mark
        while at > rows[0] and not is_row_of_numbers(split_row(lines[at], form.delimiter), form, texts):
            dropped.add(at)
            at -= 1
    kept = [at for at in rows if at not in dropped]
    return kept, [kept.index(at) for mark in marks if (at := next((row for row in kept if row > mark), 0))]


def column_number(column: int | str, names: list[str], width: int, path: Path, *, is_text: bool = False) -> int:
    """Return the number of a column given by name or number; refuse a missing one."""
    if isinstance(column, str):
        if column not in names:
            remedy = "name a column of the header, or give its number from 0"
            if not names and is_text:
                remedy = "write header = true, or give its number from 0"
            elif len(names) == 1 and is_text:
                remedy = 'the header was read as one name: state what separates columns, as delimiter = "comma"'
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
    fields: pl.DataFrame, form: TextForm, needed: list[str], dates: dict[str, str], path: Path
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.bool_]]:
    """Return the numbers of readable rows by column, and which rows are readable: those with all needed numbers.

    `dates` gives the format of columns of dates and times.
    """
    import polars as pl

    fields = fields.with_columns(_number(pl.col(n), form).alias(n) for n in fields.columns if n not in dates)
    good = fields.select(pl.all_horizontal(pl.col(needed).is_not_null())).to_series()
    numbers = fields if good.all() else fields.filter(good)
    columns = {
        name: seconds(column.to_list(), dates[name], path) if name in dates else measurable(column.to_numpy())
        for name, column in numbers.to_dict().items()
    }
    return columns, good.to_numpy()


def _fields(rows: list[str], form: TextForm, places: dict[str, int]) -> pl.DataFrame:
    """Return the fields of some columns, by name and number, as texts; null in rows that are too short."""
    import polars as pl

    if any('"' in row for row in rows):
        split = [split_row(row, form.delimiter) for row in rows]
        columns = {name: [row[at] if at < len(row) else None for row in split] for name, at in places.items()}
        return pl.DataFrame(columns, schema=dict.fromkeys(places, pl.String))
    row = pl.col("row")
    if form.delimiter is None:
        row = row.str.strip_chars().str.replace_all(r"\s+", " ")
    parts = row.str.split(form.delimiter or " ").list
    fields = [parts.get(at, null_on_oob=True).str.strip_chars().alias(name) for name, at in places.items()]
    return pl.Series("row", rows, dtype=pl.String).to_frame().select(fields)


def _number(text: pl.Expr, form: TextForm) -> pl.Expr:
    """Return the expression that reads fields as numbers, without a comment behind them; null if not a number."""
    import polars as pl

    text = text.str.replace(rf"\s*{re.escape(form.comment)}.*$", "")
    text = pl.when(text.str.to_lowercase().is_in(MISSING)).then(pl.lit("nan")).otherwise(text)
    if form.thousands or form.decimal != ".":
        text = pl.when(text.str.contains(number_pattern(form))).then(text)
    if form.thousands == form.decimal:  # the last sign is the decimal one
        sign = re.escape(form.decimal)
        whole, rest = (text.str.extract(rf"^(.*)({sign}.*)$", group).fill_null("") for group in (1, 2))
        joined = whole.str.replace_all(form.decimal, "", literal=True) + rest
        text = pl.when(rest != "").then(joined).otherwise(text)
    elif form.thousands:
        text = text.str.replace_all(_thousands(form), "")
    return text.str.replace(form.decimal, ".", literal=True).cast(pl.Float64, strict=False)
