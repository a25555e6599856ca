"""Format of a foreign file: type, delimiter, decimal sign, header, first row of numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive.errors import RecordingError
from pneudrive.files.content import check_file
from pneudrive.files.packed import COMPRESSIONS
from pneudrive.signals.tables.date_times import guess_form, looks_like_date_time
from pneudrive.signals.tables.text_table import TextForm, decode, is_words, read_bytes, split_row, to_number
from pneudrive.units import is_unit

if TYPE_CHECKING:
    from pathlib import Path

SAMPLED_LINES = 400
MOSTLY = 0.95  # least share of lines with numbers for a valid reading
# First bytes of formats that are not text.
MAGIC = {b"PAR1": "parquet", b"\x89HDF": "netcdf", b"TDSm": "tdms", b"MDF ": "mf4", b"MATL": "mat"}
DELIMITERS: tuple[str | None, ...] = ("\t", ";", ",", "|", None)
TABLE_ROWS = 3  # successive rows of numbers that make a table
NO_UNIT = ("-", "1", "%", "V", "mV", "A", "mA", "raw", "date-time")  # appear in rows of units beside known units
_WORD = re.compile(r"[^\W\d_]")  # a text that nobody takes for a number begins with a letter
_GROUPED = re.compile(r"[-+]?\d{1,3}([.,'])\d{3}(?:\1\d{3})+$")


@dataclass(frozen=True)
class FileForm:
    """Form of a file: ``form`` for text, names of the columns if any, their number.

    ``dates`` holds the columns of dates and times, by number, with their formats, ``words`` those of texts.
    """

    format: str
    form: TextForm
    names: list[str]
    units: list[str]
    columns: int
    dates: dict[int, str] = field(default_factory=dict)
    words: frozenset[int] = frozenset()


def sniff_format(path: Path) -> str:
    """Return the format from the first bytes; ``csv`` for text."""
    check_file(path, RecordingError)
    if path.suffix in COMPRESSIONS:
        return "csv"
    with path.open("rb") as file:
        head = file.read(4)
    if head == b"\x89HDF" and path.suffix == ".mat":
        return "mat"
    return MAGIC.get(head, "csv")


def sniff_text(path: Path) -> FileForm:
    """Find delimiter, decimal sign, thousands separator and header of a text table.

    Raises
    ------
    RecordingError
        If the file is empty, binary, or has no table of numbers.
    """
    lines = decode(read_bytes(path), path).splitlines()
    tail = [line for line in lines if line.strip() and not line.startswith("#")]
    step = max(len(tail) // SAMPLED_LINES, 1)
    sample = tail[len(tail) // 10 :: step][:SAMPLED_LINES] or tail
    best: tuple[float, TextForm, int, frozenset[int]] | None = None
    for form in _candidates(sample):
        share, width, words = _score(sample, form)
        numbers = width - len(words)
        # More columns of numbers explain a line better than fewer; among equals the earlier candidate wins.
        if share >= MOSTLY and numbers >= 2 and (best is None or numbers * share > best[0] + 1e-9):
            best = (numbers * share, form, width, words)
    if best is None:
        raise RecordingError(
            "no table of numbers was found",
            where=str(path),
            value=(sample[0].strip()[:120] if sample else "no lines"),
            remedy="write the layout by hand: delimiter, decimal, header, skip_lines",
        )
    return _with_header(lines, *best[1:])


def _candidates(sample: list[str]) -> list[TextForm]:
    forms = []
    for delimiter in DELIMITERS:
        for decimal in (".", ","):
            if decimal == delimiter:
                continue
            grouped = {m.group(1) for line in sample for f in split_row(line, delimiter) if (m := _GROUPED.match(f))}
            separators = (None, *sorted(grouped - {delimiter}))
            forms += [TextForm(delimiter=delimiter, decimal=decimal, thousands=mark) for mark in separators]
    return forms


def _score(sample: list[str], form: TextForm) -> tuple[float, int, frozenset[int]]:
    """Return the share of lines that are numbers in the usual number of columns, that number, and columns of texts."""
    rows = [split_row(line, form.delimiter) for line in sample]
    widths = [len(row) for row in rows]
    usual = max(set(widths), key=widths.count)
    right = [row for row in rows if len(row) == usual]
    words: frozenset[int] = frozenset()
    if form.delimiter is not None:  # white space stands in texts, too
        words = frozenset(at for at in range(usual) if all(_is_word(row[at], form) for row in right))
    good = sum(_is_numbers(row, form, words) for row in right)
    return good / len(rows), usual, words


def _is_number(text: str, form: TextForm) -> bool:
    """Return whether a field is a number, a date, or empty."""
    if not looks_like_date_time(text):
        try:
            to_number(text, form)
        except ValueError:
            return False
    return True


def _is_word(text: str, form: TextForm) -> bool:
    return bool(_WORD.match(text)) and not _is_number(text, form)


def _is_numbers(fields: list[str], form: TextForm, words: frozenset[int]) -> bool:
    """Return whether a row holds numbers, dates and empty fields, and not only empty ones, but for columns of texts."""
    own = [text for at, text in enumerate(fields) if at not in words]
    return any(own) and all(_is_number(text, form) for text in own)


def _with_header(lines: list[str], form: TextForm, width: int, words: frozenset[int]) -> FileForm:
    """Find the first row of numbers and the header above it."""
    first = _first_of_numbers(lines, form, width, words)
    names, units, skip = _names_above(lines[:first], form, width)
    delimiter = None if form.delimiter == "\t" and not names else form.delimiter
    found = TextForm(
        delimiter=delimiter,
        header=bool(names),
        decimal=form.decimal,
        thousands=form.thousands,
        skip_lines=skip if names else first,
    )
    dates = _dates([lines[first], *lines[-SAMPLED_LINES:]], form, width)
    return FileForm("csv", found, names, units, width, dates, words)


def _first_of_numbers(lines: list[str], form: TextForm, width: int, words: frozenset[int]) -> int:
    """Return the first line of the table: a row of numbers followed by others, since a preamble may hold some, too."""
    first = length = 0
    longest = (0, 0)
    for i, line in enumerate(lines):
        if not line.strip(" ") or line.startswith(form.comment):
            continue
        fields = split_row(line, form.delimiter)
        is_row = len(fields) == width and _is_numbers(fields, form, words)
        first, length = (i if length == 0 else first, length + 1) if is_row else (first, 0)
        if length > longest[0]:
            longest = (length, first)
        if length == TABLE_ROWS:
            break
    return longest[1]


def _names_above(above: list[str], form: TextForm, width: int) -> tuple[list[str], list[str], int]:
    """Return names and units of the columns, and the number of lines above the names; no names if no line fits.

    The names are in the line above the numbers, or above a row of units: any line further up is
    a preamble, even if padded with delimiters. Every column has a name, except columns without
    one; a line with names for fewer than half of them is not a header.
    """
    filled = [i for i, line in enumerate(above) if line.strip()]
    rows = [(i, _header_row(above[i], form, width)) for i in reversed(filled[-2:])]
    units: list[str] = []
    if len(rows) == 2 and rows[0][1] and rows[1][1] and _are_units(rows[0][1]) and _names_most(rows[1][1]):
        units = rows.pop(0)[1]
    if rows and _names_most(rows[0][1]):
        return rows[0][1], units, rows[0][0]
    return [], [], 0


def _header_row(line: str, form: TextForm, width: int) -> list[str]:
    """Return the fields of a line that may name the columns, as many as there are; empty if it cannot.

    Loggers put a column of comments after the last column of numbers.
    """
    fields = split_row(line.lstrip("# "), form.delimiter)
    may_be_longer = form.delimiter is not None
    if len(fields) < width or (len(fields) > width and not may_be_longer) or not is_words(fields, form):
        return []
    return fields[:width]


def _names_most(fields: list[str]) -> bool:
    return 2 * sum(map(bool, fields)) > len(fields)


def _are_units(fields: list[str]) -> bool:
    """Return whether every non-empty field is a unit, and at least one is not dimensionless."""
    bare = [text.strip("[]() ") for text in fields]
    known = [text for text in bare if text and text not in NO_UNIT]
    return bool(known) and all(is_unit(text) for text in known)


def _dates(lines: list[str], form: TextForm, width: int) -> dict[int, str]:
    """Find the columns of dates and times, and their formats."""
    rows = [row for line in lines if len(row := split_row(line, form.delimiter)) == width]
    found = {}
    for column in range(width):
        texts = [row[column] for row in rows if row[column]]
        if texts and all(map(looks_like_date_time, texts)) and (written := guess_form(texts)) is not None:
            found[column] = written
    return found
