"""How a foreign file is written: format, delimiter, decimal sign, header, first row of numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pneudrive.characterise.date_times import guess_form, looks_like_date_time
from pneudrive.characterise.text_table import COMPRESSIONS, TextForm, decode, is_words, read_bytes, split_row, to_number
from pneudrive.errors import RecordingError

if TYPE_CHECKING:
    from pathlib import Path

SAMPLED_LINES = 400
MOSTLY = 0.95  # share of lines that must be numbers for a reading to count
# First bytes of formats that are not text.
MAGIC = {b"PAR1": "parquet", b"\x89HDF": "netcdf", b"TDSm": "tdms", b"MDF ": "mf4", b"MATL": "mat"}
DELIMITERS: tuple[str | None, ...] = ("\t", ";", ",", "|", None)
_GROUPED = re.compile(r"[-+]?\d{1,3}([.,'])\d{3}(?:\1\d{3})+$")


@dataclass(frozen=True)
class Reading:
    """How a file is read: ``form`` for text, names of the columns where there are any, their number.

    ``dates`` holds the columns of dates and times, by number, and how they are written.
    """

    format: str
    form: TextForm
    names: list[str]
    units: list[str]
    columns: int
    dates: dict[int, str] = field(default_factory=dict)


def sniff_format(path: Path) -> str:
    """Tell the format from the first bytes; ``csv`` where they are text."""
    if path.suffix in COMPRESSIONS:
        return "csv"
    try:
        with path.open("rb") as file:
            head = file.read(4)
    except OSError:
        return "csv"  # the reader says what is wrong
    if head == b"\x89HDF" and path.suffix == ".mat":
        return "mat"
    return MAGIC.get(head, "csv")


def sniff_text(path: Path) -> Reading:
    """Find delimiter, decimal sign, thousands separator and header of a text table.

    Raises
    ------
    RecordingError
        Empty, binary, or no table of numbers in it.
    """
    lines = decode(read_bytes(path), path).splitlines()
    tail = [line for line in lines if line.strip() and not line.startswith("#")]
    step = max(len(tail) // SAMPLED_LINES, 1)
    sample = tail[len(tail) // 10 :: step][:SAMPLED_LINES] or tail
    best: tuple[float, TextForm, int] | None = None
    for form in _candidates(sample):
        share, width = _score(sample, form)
        # More columns of numbers explain a line better than fewer; of equals the earlier candidate stays.
        if share >= MOSTLY and width >= 2 and (best is None or width * share > best[0] + 1e-9):
            best = (width * share, form, width)
    if best is None:
        raise RecordingError(
            "no table of numbers was found",
            where=str(path),
            value=(sample[0].strip()[:120] if sample else "no lines"),
            remedy="write the layout by hand: delimiter, decimal, header, skip_lines",
        )
    return _with_header(lines, best[1], best[2])


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


def _score(sample: list[str], form: TextForm) -> tuple[float, int]:
    """Share of lines that are numbers in the usual number of columns, and that number."""
    rows = [split_row(line, form.delimiter) for line in sample]
    widths = [len(row) for row in rows]
    usual = max(set(widths), key=widths.count)
    good = sum(len(row) == usual and _is_numbers(row, form) for row in rows)
    return good / len(rows), usual


def _is_numbers(fields: list[str], form: TextForm) -> bool:
    try:
        for text in fields:
            if not looks_like_date_time(text):
                to_number(text, form)
    except ValueError:
        return False
    return True


def _with_header(lines: list[str], form: TextForm, width: int) -> Reading:
    """Find the first row of numbers and what stands above it."""
    first = next(
        i for i, line in enumerate(lines) if len(f := split_row(line, form.delimiter)) == width and _is_numbers(f, form)
    )
    above = [i for i in range(first) if lines[i].strip()]
    heads = [i for i in above[-2:] if _could_be_header(lines[i], form, width)]
    names, units = [], []
    skip = first
    if heads:
        rows = [split_row(lines[i].lstrip("# "), form.delimiter) for i in heads]
        names, units = rows[0], (rows[1] if len(rows) > 1 else [])
        skip = heads[0]
    delimiter = None if form.delimiter == "\t" and not names else form.delimiter
    found = TextForm(
        delimiter=delimiter,
        header=bool(names),
        decimal=form.decimal,
        thousands=form.thousands,
        skip_lines=skip if skip and (names or first) else 0,
    )
    return Reading("csv", found, names, units, width, _dates([lines[first], *lines[-SAMPLED_LINES:]], form, width))


def _dates(lines: list[str], form: TextForm, width: int) -> dict[int, str]:
    """Find the columns of dates and times, and how these are written."""
    rows = [row for line in lines if len(row := split_row(line, form.delimiter)) == width]
    found = {}
    for column in range(width):
        texts = [row[column] for row in rows if row[column]]
        if texts and all(map(looks_like_date_time, texts)) and (written := guess_form(texts)) is not None:
            found[column] = written
    return found


def _could_be_header(line: str, form: TextForm, width: int) -> bool:
    fields = split_row(line.lstrip("# "), form.delimiter)
    return len(fields) == width and is_words(fields, form)
