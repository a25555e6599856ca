"""Text files as tables of numbers: their format (delimiter, decimal sign, header), and the numbers."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain, groupby, islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.files import content
from pneudrive.files.bounds import bound, within
from pneudrive.signals.columns import RATE, SAMPLES, STEP, header_unit, role_of
from pneudrive.signals.times import guess_form, looks_like_date_time, seconds

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence, Set

    import polars as pl

    from pneudrive.arrays import Array, Plain

    Lines = list[str]  # of a file
    Fields = list[str]  # of a line

NO_SENSOR = 1e100
UNREADABLE_SHARE = 0.01  # largest share of rows that are not numbers
MISSING = ("", "na", "n/a", "#n/a", "null", "none", "-", "--", "---")  # fields without a value, in lower case
_BEGIN = re.compile(r"[-+]?(?:[.,]?\d|nan|inf)", re.IGNORECASE)  # of a number
HEADER_ROWS = 4  # most rows of words below the names: units, descriptions


@dataclass(frozen=True)
class TextForm:
    """Format of a text table.

    ``delimiter`` None means any white space. ``thousands`` is a separator inside numbers. If ``thousands`` equals
    ``decimal``, the last sign is the decimal sign. ``header_delimiter`` is empty if the header has the delimiter of
    the numbers.
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

    columns: dict[str, Array]
    places: dict[int | str, str]
    units: dict[str, str]
    flags: dict[str, int]
    segments: list[int]
    unread: list[str]


def read_bytes(path: Path) -> bytes:
    """Read a file, and decompress it according to its suffix; every failure raises a `RecordingError`."""
    data = content.read_bytes(path, RecordingError, "file_bytes", folder="name the files, as in folder/*.csv")
    if not data.strip():
        raise RecordingError("the file is empty", where=str(path))
    most, begin = int(bound("line_bytes")), 0
    while len(data) - begin > most and b"\0" not in data[:4096]:  # binary data are refused elsewhere
        end = max(data.rfind(sign, begin, begin + most) for sign in (b"\n", b"\r"))
        if end < 0:
            within("line_bytes", most + 1, f"a line is longer than {most:,} bytes", RecordingError, str(path))
        begin = end + 1
    return data


def decode(data: bytes, path: Path) -> str:
    """Return the text of a file; reject binary content."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    head = data[:4096]
    if head.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise RecordingError.of("signals.workbook", where=str(path))
    control = sum(byte < 9 or 13 < byte < 32 for byte in head)
    if b"\x00" in head or control > 0.05 * len(head):
        raise RecordingError.of("signals.binary", where=str(path), value=repr(head[:16]))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def split_row(line: str, delimiter: str | None) -> Fields:
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
    """Return the regular expression of a number in this format, including groups of three digits."""
    decimal, whole = re.escape(form.decimal), r"\d*"
    if form.thousands == form.decimal:
        whole = rf"\d{{1,3}}(?:{decimal}\d{{3}})*|\d*"
    elif form.thousands:
        whole = rf"[1-9]\d{{0,2}}(?:{_thousands(form)}\d{{3}})+|\d*"
    return rf"(?i)^[-+]?(?:(?:{whole})(?:{decimal}\d*)?(?:e[-+]?\d+)?|nan|inf(?:inity)?)$"


def _thousands(form: TextForm) -> str:
    """Return the regular expression of the thousands separator. A space also matches other white space."""
    mark = form.thousands or ""
    return r"[\s\u00a0\u202f]" if mark.isspace() else re.escape(mark)


def measurable(values: Array) -> Array:
    """Return the numbers; those that are infinite, or have an infinite square, become NaN."""
    if values.size and values.min() > -NO_SENSOR and values.max() < NO_SENSOR:  # False if one is NaN
        return values
    return np.where(np.abs(values) < NO_SENSOR, values, np.nan)


def is_number(text: str, form: TextForm) -> bool:
    """Return whether a field is a number, a date, or empty."""
    if text.lower() in MISSING or looks_like_date_time(text):
        return True
    return _BEGIN.match(text) is not None and re.match(number_pattern(form), text) is not None


def is_words(fields: Fields, form: TextForm) -> bool:
    """Return whether a line is a header or a row of units: none of its fields is a number."""
    there = [text for text in fields if text.lower() not in MISSING]
    return any(fields) and not any(is_number(text, form) for text in there)


def is_row_of_numbers(fields: Fields, form: TextForm, texts: Collection[int]) -> bool:
    """Return whether a row holds only numbers, dates and empty fields, except in columns of texts."""
    own = [text for at, text in enumerate(fields) if at not in texts]
    return any(own) and all(is_number(text, form) for text in own)


def read_text(
    path: Path,
    data: bytes,
    form: TextForm,
    wanted: list[int | str],
    dates: dict[int | str, str],
    *,
    others: bool = False,
) -> ForeignTable:
    """Read the wanted columns of a text table.

    Parameters
    ----------
    path : Path
        Name of the file in messages.
    data : bytes
    form : TextForm
    wanted : list of int or str
        Numbers or names of columns.
    dates : dict
        Columns of dates and times -> format. They become seconds since the first date.
    others : bool
        Whether to read all other columns with numbers, in the same rows. Fields without a number become NaN.

    Raises
    ------
    RecordingError
        A column is missing, or more than 1 % of the rows are not numbers.
    """
    import polars as pl

    lines = decode(data, path).splitlines()
    start, names, units = _header(lines, form, path)
    rows = [at for at, line in enumerate(lines[start:], start) if line.strip() and not line.startswith(form.comment)]
    if not rows:
        raise RecordingError.of("signals.no-rows", where=str(path), count=len(lines))
    width = len(split_row(lines[rows[0]], form.delimiter))
    use = {column: column_number(column, names, width, path, is_text=True) for column in wanted}
    rows, segments = without_headers(lines, rows, form, lines[start - 1] if names else None)
    known = names if len(names) >= width and len(set(names)) == len(names) else [f"column {at}" for at in range(width)]
    places = {known[at]: at for at in (*use.values(), *(range(width) if others else ()))}
    chosen = {column: known[at] for column, at in use.items()}
    needed = {*chosen.values()}
    forms = {chosen[column]: written for column, written in dates.items()}
    fields = _fields([lines[at] for at in rows], form, places, texts=forms.keys())
    good = fields.select(pl.all_horizontal(pl.col(*needed).is_not_null())).to_series()
    columns = {
        name: seconds(column.to_list(), forms[name], path) if name in forms else measurable(column.to_numpy())
        for name, column in fields.filter(good).to_dict().items()
    }
    bad = np.flatnonzero(~good.to_numpy())
    if bad.size > max(UNREADABLE_SHARE * len(rows), 1):
        where, line = f"{path}, line {rows[bad[0]] + 1}", lines[rows[bad[0]]].strip()[:120]
        sign = "," if form.decimal == "." else "."
        is_other = sign != form.delimiter and re.search(rf"\d{re.escape(sign)}\d", line)
        hint = f'the numbers have another decimal sign than the layout states: decimal = "{sign}"' if is_other else None
        at = {"where": where, "value": line, "remedy": hint}
        raise RecordingError.of("signals.no-number-rows", **at, count=bad.size, every=len(rows))
    return ForeignTable(
        {name: column for name, column in columns.items() if name in needed or np.isfinite(column).any()},
        chosen,
        {name: units[at] for name, at in places.items() if at < len(units)},
        {"unreadable_row": bad.size} if bad.size else {},
        segments,
        [name for at, name in enumerate(names) if at not in use.values()],
    )


def _header(lines: Lines, form: TextForm, path: Path) -> tuple[int, Fields, Fields]:
    """Return the line below the header, the names and the units of the columns."""
    if not form.header:
        return form.skip_lines, [], []
    filled = (at for at in range(form.skip_lines, len(lines)) if lines[at].strip(form.comment + " \t"))
    start = next(filled, None)
    if start is None:
        raise RecordingError("there is no header line", where=str(path))
    # The header is the line below comment lines, or the first comment line.
    plain = (at for at in chain([start], filled) if not lines[at].lstrip().startswith(form.comment))
    header, below = next(plain, None), next(plain, None)
    if header not in (None, start) and below is not None:
        words = split_row(lines[header], form.of_header)
        width = len(split_row(lines[below], form.delimiter))
        remark = split_row(lines[start].lstrip(form.comment), form.of_header)
        start = header if len(remark) < width == len(words) and is_words(words, form) else start
    names = split_row(lines[start].lstrip(form.comment), form.of_header)
    units: Fields = []
    for row in lines[start + 1 : start + 1 + HEADER_ROWS]:
        line = row.lstrip(form.comment)
        words = split_row(line, form.of_header)
        if any(words) and not is_words(split_row(line, form.delimiter), form):
            break
        units, start = units or (words if any(words) else []), start + 1
    return start + 1, names, units


def without_headers(
    lines: Lines, rows: list[int], form: TextForm, last_of_header: str | None
) -> tuple[list[int], list[int]]:
    """Return the rows of numbers, without the headers of further segments, and the first row of each segment.

    Programs that append to a file repeat the header. The last header line marks each segment. Lines between this line
    and the previous row of numbers belong to the header.
    """
    texts = {at for at, text in enumerate(split_row(lines[rows[0]], form.delimiter)) if is_words([text], form)}
    kept, starts = list[int](), list[int]()
    for at in rows:
        kept.append(at)
        if lines[at] == last_of_header:
            while kept[1:] and not is_row_of_numbers(split_row(lines[kept[-1]], form.delimiter), form, texts):
                kept.pop()
            starts.append(len(kept))
    return kept, [start for start in starts if start < len(kept)]


def column_number(column: int | str, names: Fields, width: int, path: Path, *, is_text: bool = False) -> int:
    """Return the number of a column given by name or number; reject a missing column."""
    if isinstance(column, str):
        if column not in names:
            remedy = "name a column, or give its number from 0; correct skip_lines if this line is not the header"
            if not names and is_text:
                remedy = "write header = true, or give its number from 0"
            elif len(names) == 1 and is_text:
                remedy = 'this line has one name: correct skip_lines, or state the separator: delimiter = "comma"'
            value = f"columns: {', '.join(names) or 'no header is read (header = false)'}"
            raise RecordingError(f"there is no column '{column}'", where=str(path), value=value, remedy=remedy)
        places = [at for at, name in enumerate(names) if name == column]
        if len(places) > 1:
            numbers = {"count": len(places), "column": column, "numbers": " or ".join(map(str, places))}
            raise RecordingError.of("signals.same-names", where=str(path), **numbers)
        return places[0]
    if not 0 <= column < width:
        raise RecordingError.of("signals.no-column-number", where=str(path), column=column, width=width)
    return column


def _fields(rows: Lines, form: TextForm, places: dict[str, int], texts: Set[str]) -> pl.DataFrame:
    """Return the fields of some columns, by name and number, as numbers; those in `texts` as unchanged texts.

    The result is null in rows that are too short, and for fields that are not numbers. A trailing comment is ignored.
    """
    import polars as pl

    if any('"' in row for row in rows):
        split = pl.Series([split_row(row, form.delimiter) for row in rows], dtype=pl.List(pl.String))
    else:
        split = pl.Series(rows, dtype=pl.String)
        if form.delimiter is None:
            split = split.str.strip_chars().str.replace_all(r"\s+", " ")
        split = split.str.split(form.delimiter or " ")
    cells = {name: split.list.get(at, null_on_oob=True).str.strip_chars() for name, at in places.items()}
    fields = pl.DataFrame(cells)
    numbers = []
    for name in places.keys() - texts:
        text = pl.col(name).str.replace(rf"\s*{re.escape(form.comment)}.*$", "")
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
        number = text.str.replace(form.decimal, ".", literal=True).cast(pl.Float64, strict=False)
        numbers.append(number.alias(name))
    return fields.with_columns(numbers)


SAMPLED_LINES = 400
FEW_LINES = 40  # that reject most readings
SAMPLED_FIELDS = 8000
MOSTLY = 0.95  # least share of lines with numbers for a valid reading
SEGMENTED = 0.5  # the same for a file whose header comes again and again
# First bytes of formats that are not text.
MAGIC = {b"PAR1": "parquet", b"\x89HDF": "netcdf", b"TDSm": "tdms", b"MDF ": "mf4", b"MATL": "mat"}
DELIMITERS: tuple[str | None, ...] = ("\t", ";", ",", "|", None)
TABLE_ROWS = 3  # successive rows of numbers that make a table
COMMENTS = "#%"  # signs before a header
_WORD = re.compile(r"[^\W\d_]")  # a text that nobody takes for a number begins with a letter
#: Pattern of numbers with groups of three digits, whose separator means thousands, not decimals.
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(?:([.,'’\s\u00a0\u202f])\d{3})+(?:[.,]\d*)?$")
#: Pattern of column names separated by white space, each optionally followed by a unit in brackets.
_LOOSE = re.compile(r"[^\s\[(]+\s*(?:[\[(][^\])]{0,40}[\])])?")
_CELL = re.compile(r"[-+]?\d[\d.,]*+ ([^\W\d_][\w/()]*)")  # a number and its unit


@dataclass(frozen=True, eq=False)
class ForeignFile:
    """Format and columns of a file without a layout, or one interpretation of the lines of a text.

    ``form`` is the format of a text, and ``share`` the fraction of its sampled lines that are rows of numbers.
    ``columns`` is the number of columns, and ``values`` has their numbers; columns of texts are empty. ``dates`` holds
    the columns of dates and times, by number, with their formats. ``words`` holds columns of texts, with the number of
    different texts in the first rows. ``steps_s``, ``starts_s`` and ``source`` are those of `read_preamble`.
    ``other_lengths`` has the lengths, by name, of channels that do not fit into the table.
    """

    format: str
    form: TextForm
    columns: int
    share: float = 1.0
    names: Sequence[str] = ()
    units: Sequence[str] = ()
    values: Sequence[Array] = ()
    dates: dict[int, str] = field(default_factory=dict)
    words: dict[int, int] = field(default_factory=dict)
    steps_s: tuple[float, ...] = ()
    starts_s: dict[int, float] = field(default_factory=dict)
    source: str = ""
    other_lengths: dict[str, int] = field(default_factory=dict)


def sniff_format(path: Path) -> str:
    """Return the format from the first bytes; ``csv`` for text."""
    content.check_file(path, RecordingError)
    if path.suffix in content.COMPRESSIONS:
        return "csv"
    with path.open("rb") as file:
        return MAGIC.get(file.read(4), "csv")


def sniff_text(path: Path, data: bytes) -> ForeignFile:
    """Find delimiter, decimal sign, thousands separator and header of a text table.

    Raises
    ------
    RecordingError
        The file is empty, binary or has no table of numbers, or a sign can mean decimals or thousands.
    """
    lines = decode(data, path).splitlines()
    tail = [line for line in lines if line.strip() and not line.startswith("#")]
    sample = _sample(tail)
    readings = [_read(sample, form) for form in _candidates(sample) if sample]
    readings = [one for one in readings if one.columns - len(one.words) >= 2]
    for least in (MOSTLY, SEGMENTED):
        fit = [one for one in readings if one.share >= least]
        # Where white space separates columns, it does not mean thousands: 0,635 105,2 is two numbers.
        is_blank = any(one.form.delimiter is None for one in fit)
        fit = [one for one in fit if not (is_blank and one.form.thousands == " ")]
        # White space is also used inside dates. It is the delimiter only without other signs.
        fit = [one for one in fit if one.form.delimiter is not None] or fit
        if fit:
            # More columns of numbers are better. Among equals the earlier candidate wins: it has fewer separators.
            worth = [(one.columns - len(one.words)) * one.share for one in fit]
            fit = [one for one, value in zip(fit, worth, strict=True) if value > max(worth) - 1e-9]
            _refuse_ambiguous(fit, sample, path)
            return _with_header(lines, fit[0])
    cells = [found for line in sample[:FEW_LINES] for found in _CELL.finditer(line)]
    if unit := next((found for found in cells if (named := header_unit(found[1])) and named.si), None):
        raise RecordingError.of("signals.units-in-cells", where=str(path), value=unit[0])
    first = sample[0].strip()[:120] if sample else "no lines"
    raise RecordingError.of("signals.no-table", where=str(path), value=first)


def _sample(tail: Lines) -> Lines:
    """Return lines from all parts of a file; fewer lines if they are long."""
    if not tail:
        return []
    width = max(len(line) for line in tail[len(tail) // 2 :][:9]) // 6 + 1
    count = min(SAMPLED_LINES, max(SAMPLED_FIELDS // width, 60))
    step = max(len(tail) // count, 1)
    return tail[len(tail) // 10 :: step][:count] or tail


def _candidates(sample: Lines) -> list[TextForm]:
    """Return the possible formats. Numbers contain the delimiter only inside quotes.

    A sign can separate both thousands and decimals only if a field contains it twice.
    """
    forms, has_quotes = [], any('"' in line for line in sample)
    for delimiter in DELIMITERS:
        fields = [text for line in sample for text in split_row(line, delimiter)]
        grouped = {m.group(1) for text in fields if (m := _GROUPED.match(text))}
        marks = sorted({" " if mark.isspace() else mark for mark in grouped})
        decimals = [sign for sign in ".," if sign != delimiter or has_quotes]
        for decimal in decimals:
            usual = [mark for mark in marks if mark not in (delimiter, decimal) or (mark == delimiter and has_quotes)]
            both = [decimal] if decimal in marks and any(text.count(decimal) > 1 for text in fields) else []
            forms += [TextForm(delimiter, decimal=decimal, thousands=mark) for mark in (None, *usual, *both)]
    return forms


def _read(sample: Lines, form: TextForm) -> ForeignFile:
    """Return the usual number of columns, the fraction of numeric lines that have it, and the text columns."""
    if len(sample) > 2 * FEW_LINES:
        few = _read(sample[:: len(sample) // FEW_LINES], form)
        if few.share < SEGMENTED:
            return few
    rows = [split_row(line, form.delimiter) for line in sample]
    widths = [len(row) for row in rows]
    usual = max(set(widths), key=widths.count)
    right = [row for row in rows if len(row) == usual and not is_words(row, form)]  # no header that comes again
    words = {}
    if form.delimiter is not None:  # white space stands in texts, too
        words = {at: 0 for at in range(usual) if _is_of_words([row[at] for row in right], form)}
    good = sum(is_row_of_numbers(row, form, words) for row in right)
    return ForeignFile("csv", form, usual, good / len(rows), words=words)


def _is_of_words(texts: list[str], form: TextForm) -> bool:
    """Return whether a column holds texts."""
    there = [text for text in texts if text.lower() not in MISSING]
    return bool(there) and all(_WORD.match(text) and not is_number(text, form) for text in there)


def _refuse_ambiguous(fit: list[ForeignFile], sample: Lines, path: Path) -> None:
    """Reject a file with numbers such as 10,307 that may mean 10.307 or 10307.

    Raises
    ------
    RecordingError
        Nothing in the file shows whether a comma means decimals or thousands.
    """
    decimals = [one for one in fit if one.form.decimal == "," and one.form.thousands is None]
    thousands = [one for one in fit if one.form.thousands == "," and one.form.decimal == "."]
    if decimals and thousands and thousands[0].form.delimiter == decimals[0].form.delimiter:
        fields = (text for line in sample for text in split_row(line, fit[0].form.delimiter))
        number = next(text for text in fields if (found := _GROUPED.match(text)) and found[1] == ",")
        raise RecordingError.of("signals.decimals-or-thousands", where=str(path), number=number)


def _with_header(lines: Lines, reading: ForeignFile) -> ForeignFile:
    """Find the first row of numbers and the header above it."""
    form, width = replace(reading.form, header=True), reading.columns
    first = _first_of_numbers(lines, reading)
    about = read_preamble(lines[:first], form, width)
    # The rows next to the numbers are names, units and descriptions. The row of names has names of most roles; among
    # equal rows it is the one above the units. Names for fewer than half of the columns are a preamble.
    rows = list(_rows_above(lines[:first], form, width))
    of_units, units = next(((at, fields) for at, fields, _ in rows if _are_units(fields)), (0, []))
    named = [row for row in rows if row[1] is not units and 2 * sum(map(bool, row[1])) > width]
    roles = {at: sum(role_of(name) is not None for name in fields) for at, fields, _ in named}
    nothing = 0, [], replace(form, header=False)
    skip, names, form = max(named, key=lambda row: (roles[row[0]], row[0] < of_units, row[0]), default=nothing)
    form = replace(form, skip_lines=skip if form.header else first)
    ends = (*lines[first : first + SAMPLED_LINES], *lines[-SAMPLED_LINES:])
    numbers = [row for line in ends if len(row := split_row(line, form.delimiter)) == width]
    dates = {}
    for column in range(width):
        texts = [row[column] for row in numbers if looks_like_date_time(row[column])]
        if 2 * len(texts) > len(numbers) and (written := guess_form(texts)) is not None:
            dates[column] = written
    words = {at: len({row[at] for row in numbers}) for at in reading.words}
    about |= {"units": units} if named and units else {}
    return replace(reading, form=form, names=names, dates=dates, words=words, **about)


def _first_of_numbers(lines: Lines, reading: ForeignFile) -> int:
    """Return the first line of the table.

    Further lines of numbers must follow it, because a preamble may also contain numbers.
    """
    form, width, words, longest = reading.form, reading.columns, reading.words, list[int]()
    filled = (at for at, line in enumerate(lines) if line.strip(" ") and not line.startswith(form.comment))
    fields = ((at, split_row(lines[at], form.delimiter)) for at in filled)
    runs = groupby(fields, lambda row: len(row[1]) == width and is_row_of_numbers(row[1], form, words))
    for are_numbers, run in runs:
        table = [at for at, _ in islice(run, TABLE_ROWS)] if are_numbers else []
        longest = max(longest, table, key=len)
        if len(longest) == TABLE_ROWS:
            break
    return longest[0] if longest else 0


def _rows_above(above: Lines, form: TextForm, width: int) -> Iterator[tuple[int, Fields, TextForm]]:
    """Yield the rows of words above the numbers, from the lowest up, each with row number and format."""
    filled = [at for at, line in enumerate(above) if line.strip()]
    for at in reversed(filled[-HEADER_ROWS:]):
        sign = next((sign for sign in COMMENTS if above[at].lstrip().startswith(sign)), form.comment)
        line = above[at].lstrip(f"{sign} ") if sign in above[at][:3] else above[at]
        # White space last: names hold spaces before their units, by chance as many as there are columns.
        for delimiter in sorted((form.delimiter, *DELIMITERS), key=lambda one: one is None):
            fields = split_row(line, delimiter)
            # Loggers put a column of comments after the last column of numbers.
            is_longer = len(fields) > width and delimiter is not None and delimiter == form.delimiter
            if (len(fields) == width or is_longer) and is_words(fields[:width], form):
                mark = "" if delimiter == form.delimiter else delimiter
                yield at, fields[:width], replace(form, comment=sign, header_delimiter=mark)
                break
        else:
            loose = _LOOSE.findall(line)
            if len(loose) != width or not is_words(loose, form):
                return
            yield at, [text.strip() for text in loose], replace(form, header=False)


def _are_units(fields: Fields) -> bool:
    """Return whether most filled fields are units, and at least one is of a known quantity.

    An unknown unit makes only its own column doubtful, not the whole row.
    """
    filled = [text for text in fields if text.strip("- ")]
    known = [unit for text in filled if (unit := header_unit(text)) is not None]
    return any(unit.si for unit in known) and 2 * len(known) > len(filled)


def read_preamble(lines: Lines, form: TextForm, width: int) -> Plain:
    """Read the lines above a table. The last line of each kind is used.

    Returns
    -------
    dict
        ``units`` of the columns; ``steps_s``, time steps of the samples in s (one for all channels, or one for each);
        ``starts_s``, first times in s by column; and ``source``, the line that states the steps.
    """
    found: Plain = {}
    starts: dict[int, float] = {}
    clocks: dict[int, float] = {}
    for line in lines:
        label, *cells = split_row(line, form.delimiter)[:width] or [""]
        word = label.strip(" #%:").lower()
        numbers = _numbers(cells, form)
        if word == "delta_x" and numbers and min(numbers.values()) > 0:
            found |= {"steps_s": tuple(numbers.values()), "source": line.strip()}
        elif word == "x0" and numbers:
            starts = numbers
        elif word == "time" and cells:
            clocks = _clocks(cells)
        elif word == "y_unit_label" and any(header_unit(cell) for cell in cells):
            found["units"] = ["", *cells]
        elif match := RATE.search(line) or STEP.search(line):
            unit = SAMPLES.get(match.group(2).lower(), 1e-6)
            value = float(match.group(1).replace(",", ".")) * unit
            step = value if match.re is STEP else 1.0 / (value or 1.0)
            found |= {"steps_s": (step,), "source": line.strip()}
    if set(clocks) == set(starts):
        starts = {at: starts[at] + clocks[at] for at in starts}
    first = min(starts.values(), default=0.0)
    starts = {at: start - first for at, start in starts.items()}
    return found | ({"starts_s": starts} if any(starts.values()) else {})


def _numbers(cells: Fields, form: TextForm) -> dict[int, float]:
    """Return the numbers of a labelled line by column; empty if a cell is a text."""
    try:
        return {at: float(cell.replace(form.decimal, ".")) for at, cell in enumerate(cells, 1) if cell}
    except ValueError:
        return {}


def _clocks(cells: Fields) -> dict[int, float]:
    """Return the times of day of a labelled line, by column."""
    texts = {at: cell.replace(",", ".") for at, cell in enumerate(cells, 1) if cell}
    are_clocks = bool(texts) and all(map(looks_like_date_time, texts.values()))
    written = guess_form(list(texts.values())) if are_clocks else None
    if written is None:
        return {}
    return dict(zip(texts, seconds(list(texts.values()), written, Path()).tolist(), strict=True))
