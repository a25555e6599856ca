"""Format of a foreign file: type, delimiter, decimal sign, header, first row of numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import RecordingError
from pneudrive.files.content import check_file
from pneudrive.files.packed import COMPRESSIONS
from pneudrive.signals.columns import header_unit, role_of
from pneudrive.signals.text_table import (
    HEADER_ROWS,
    MISSING,
    TextForm,
    decode,
    is_number,
    is_row_of_numbers,
    is_words,
    read_bytes,
    split_row,
)
from pneudrive.signals.times import guess_form, looks_like_date_time, seconds

if TYPE_CHECKING:
    from collections.abc import Iterator

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
#: Groups of three digits behind a sign that is then one of thousands, not of decimals.
_GROUPED = re.compile(r"[-+]?[1-9]\d{0,2}(?:([.,'’\s\u00a0\u202f])\d{3})+(?:[.,]\d*)?$")
#: Names of columns that white space separates, each with a unit in brackets behind more of it.
_LOOSE = re.compile(r"[^\s\[(]+\s*(?:[\[(][^\])]{0,40}[\])])?")
_CELL = re.compile(r"[-+]?\d[\d.,]*+ ([^\W\d_][\w/()]*)")  # a number and its unit
_BARE = re.compile(r"[-+]?\d{1,3}$")


_RATE = re.compile(
    r"(?:(?:sampl\w{0,12}|scan|abtast\w{0,12}|acquisition)[ _-]*(?:rate|freq\w{0,12})?|\bfs\b|\brate\b|frequenz)"
    r"[^\d\n]{0,24}?"
    r"(\d+(?:[.,]\d+)?) *(k?Hz|1/s|S/s)\b",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?:(?:sampl\w{0,12}|scan|abtast\w{0,12})[ _-]*(?:interval|period|time|zeit)?|\bdt\b|time step|increment)"
    r"[^\d\n]{0,24}?"
    r"(\d+(?:[.,]\d+)?) *(s|ms|us|µs)\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Preamble:
    """Statements of the lines above a table.

    ``steps_s`` are the steps of the samples, s, of all channels or of each. ``starts_s`` are the first times by column.
    ``units`` are those of the columns. ``source`` is the line that states the step.
    """

    steps_s: tuple[float, ...] = ()
    starts_s: dict[int, float] = field(default_factory=dict)
    units: list[str] = field(default_factory=list)
    source: str = ""

    @property
    def step_s(self) -> float | None:
        """The common step of all channels, s, or None."""
        return self.steps_s[0] if len(set(self.steps_s)) == 1 else None


@dataclass(frozen=True)
class FileForm:
    """Form of a file: ``form`` for text, names of the columns if any, their number.

    ``dates`` holds the columns of dates and times, by number, with their formats. ``words`` holds columns of texts,
    with the number of different texts in the first rows.
    ``preamble`` holds statements of the lines above the table. ``other_lengths`` holds the lengths of channels that do
    not fit into the table, by name.
    """

    format: str
    form: TextForm
    names: list[str]
    units: list[str]
    columns: int
    dates: dict[int, str] = field(default_factory=dict)
    words: dict[int, int] = field(default_factory=dict)
    preamble: Preamble = field(default_factory=Preamble)
    other_lengths: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class _Reading:
    """One way to read the lines: how many are rows of numbers, how many columns, and which of them hold texts."""

    form: TextForm
    share: float
    width: int
    words: frozenset[int]

    @property
    def worth(self) -> float:
        """More columns of numbers explain a line better than fewer."""
        return (self.width - len(self.words)) * self.share


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
        If the file is empty, binary, or has no table of numbers; if a sign can be that of decimals or of thousands.
    """
    lines = decode(read_bytes(path), path).splitlines()
    tail = [line for line in lines if line.strip() and not line.startswith("#")]
    sample = _sample(tail)
    readings = [_read(sample, form) for form in _candidates(sample)]
    readings = [reading for reading in readings if reading.width - len(reading.words) >= 2]
    for least in (MOSTLY, SEGMENTED):
        fit = [reading for reading in readings if reading.share >= least]
        # White space is also used inside dates. It is the delimiter only without other signs.
        fit = [one for one in fit if one.form.delimiter is not None] or fit
        if fit:
            worth = max(one.worth for one in fit)
            # Among equals the earlier candidate wins: it has fewer separators.
            fit = [one for one in fit if one.worth > worth - 1e-9]
            return _with_header(lines, _told(fit, sample, path))
    cells = [found for line in sample[:FEW_LINES] for found in _CELL.finditer(line)]
    if unit := next((found for found in cells if (named := header_unit(found[1])) and named.si), None):
        raise RecordingError(
            "the numbers have units inside the cells",
            where=str(path),
            value=unit[0],
            remedy="remove the units from the cells, and write them into the header, as in Time [s]",
        )
    raise RecordingError(
        "no table of numbers was found",
        where=str(path),
        value=(sample[0].strip()[:120] if sample else "no lines"),
        remedy="write the layout by hand: delimiter, decimal, thousands, header, skip_lines",
    )


def _sample(tail: list[str]) -> list[str]:
    """Return lines from all parts of a file, with fewer of long ones."""
    if not tail:
        return []
    width = max(len(line) for line in tail[len(tail) // 2 :][:9]) // 6 + 1
    count = min(SAMPLED_LINES, max(SAMPLED_FIELDS // width, 60))
    step = max(len(tail) // count, 1)
    return tail[len(tail) // 10 :: step][:count] or tail


def _candidates(sample: list[str]) -> list[TextForm]:
    forms = []
    for delimiter in DELIMITERS:
        fields = [text for line in sample for text in split_row(line, delimiter)]
        grouped = {m.group(1) for text in fields if (m := _GROUPED.match(text))}
        marks = sorted({" " if mark.isspace() else mark for mark in grouped})
        has_quotes = any('"' in line for line in sample)
        for decimal in (".", ","):
            if decimal == delimiter and not has_quotes:
                continue
            usual = [mark for mark in marks if mark not in (delimiter, decimal) or (mark == delimiter and has_quotes)]
            own = [decimal] if decimal in marks and _has_several(fields, decimal) else []
            separators = (None, *usual, *own)
            forms += [TextForm(delimiter=delimiter, decimal=decimal, thousands=mark) for mark in separators]
    return forms


def _has_several(fields: list[str], mark: str) -> bool:
    return any(text.count(mark) > 1 for text in fields)


def _read(sample: list[str], form: TextForm) -> _Reading:
    """Return the fraction of numeric lines with the usual number of columns, this number, and text columns."""
    if len(sample) > 2 * FEW_LINES:
        few = _read(sample[:: len(sample) // FEW_LINES], form)
        if few.share < SEGMENTED:
            return few
    rows = [split_row(line, form.delimiter) for line in sample]
    widths = [len(row) for row in rows]
    usual = max(set(widths), key=widths.count)
    right = [row for row in rows if len(row) == usual and not is_words(row, form)]  # no header that comes again
    words: frozenset[int] = frozenset()
    if form.delimiter is not None:  # white space stands in texts, too
        words = frozenset(at for at in range(usual) if _is_of_words([row[at] for row in right], form))
    good = sum(is_row_of_numbers(row, form, words) for row in right)
    return _Reading(form, good / len(rows), usual, words)


def _is_of_words(texts: list[str], form: TextForm) -> bool:
    """Return whether a column holds texts."""
    there = [text for text in texts if text.lower() not in MISSING]
    return bool(there) and all(_WORD.match(text) and not is_number(text, form) for text in there)


def _told(fit: list[_Reading], sample: list[str], path: Path) -> _Reading:
    """Return the valid interpretation of numbers such as 10,307, which can mean 10.307 or 10307.

    Raises
    ------
    RecordingError
        If nothing in the file tells whether a comma is that of decimals or of thousands.
    """
    best = fit[0]
    decimals = [one for one in fit if one.form.decimal == "," and one.form.thousands is None]
    thousands = [one for one in fit if one.form.thousands == "," and one.form.decimal == "."]
    if not decimals or not thousands or thousands[0].form.delimiter != decimals[0].form.delimiter:
        return best
    rows = [split_row(line, best.form.delimiter) for line in sample]
    columns = [[row[at] for row in rows if len(row) == best.width and row[at]] for at in range(best.width)]
    marked = [texts for texts in columns if any("," in text for text in texts)]
    # Small whole numbers next to groups of three: a sign of thousands. Decimals are written in every row.
    if any(any(_BARE.match(text) for text in texts) for texts in marked):
        return thousands[0]
    raise RecordingError(
        f"numbers such as {marked[0][0]} can have decimals, or groups of three digits",
        where=str(path),
        rule="nothing else in the file shows which of both is meant",
        remedy='write the layout by hand, with decimal = "," or with thousands = ","',
    )


def _with_header(lines: list[str], reading: _Reading) -> FileForm:
    """Find the first row of numbers and the header above it."""
    form, width = replace(reading.form, header=True), reading.width
    first = _first_of_numbers(lines, reading)
    preamble = read_preamble(lines[:first], form, width)
    names, units, skip, form = _names_above(lines[:first], form, width)
    if (
        form.delimiter == "\t"
        and not names
        and all(len(line.split()) == width for line in lines[first:] if line.strip())
    ):
        form = replace(form, delimiter=None)
    form = replace(form, skip_lines=skip if form.header else first)
    dates = _dates([lines[first], *lines[-SAMPLED_LINES:]], form, width)
    rows = [row for line in lines[first:][:SAMPLED_LINES] if len(row := split_row(line, form.delimiter)) == width]
    words = {at: len({row[at] for row in rows}) for at in reading.words}
    return FileForm("csv", form, names, units or preamble.units, width, dates, words, preamble)


def _first_of_numbers(lines: list[str], reading: _Reading) -> int:
    """Return the first line of the table.

    This row must be followed by further rows of numbers, because a preamble may also contain numbers.
    """
    first = length = 0
    longest = (0, 0)
    for i, line in enumerate(lines):
        if not line.strip(" ") or line.startswith(reading.form.comment):
            continue
        fields = split_row(line, reading.form.delimiter)
        is_row = len(fields) == reading.width and is_row_of_numbers(fields, reading.form, reading.words)
        first, length = (i if length == 0 else first, length + 1) if is_row else (first, 0)
        if length > longest[0]:
            longest = (length, first)
        if length == TABLE_ROWS:
            break
    return longest[1]


def _names_above(above: list[str], form: TextForm, width: int) -> tuple[list[str], list[str], int, TextForm]:
    """Return names and units of the columns, the number of lines above the names, and the form with its header.

    The rows next to the numbers are names, units and descriptions. The row of names is the one that contains names of
    most roles.
    Among equals, they are in the row above the units. Names for fewer than half of the columns are a preamble.
    """
    rows = list(_rows_above(above, form, width))
    units = next((fields for _, fields, _ in rows if _are_units(fields)), [])
    named = [row for row in rows if row[1] is not units and 2 * sum(map(bool, row[1])) > width]
    if not named:
        return [], [], 0, replace(form, header=False)
    places = [row[0] for row in rows if row[1] is units]

    def rank(row: tuple[int, list[str], TextForm]) -> tuple[int, bool, int]:
        return sum(role_of(name) is not None for name in row[1]), bool(places) and row[0] < places[0], row[0]

    place, names, form = max(named, key=rank)
    return names, units, place, form


def _rows_above(above: list[str], form: TextForm, width: int) -> Iterator[tuple[int, list[str], TextForm]]:
    """Yield the rows of words above the numbers, beginning with the lowest, with their number and form."""
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


def _are_units(fields: list[str]) -> bool:
    """Return whether most filled fields are units, and at least one is of a known quantity.

    An unknown unit makes only its column a guess, not the whole row.
    """
    filled = [text for text in fields if text.strip("- ")]
    known = [unit for text in filled if (unit := header_unit(text)) is not None]
    return any(unit.si for unit in known) and 2 * len(known) > len(filled)


def _dates(lines: list[str], form: TextForm, width: int) -> dict[int, str]:
    """Find the columns of dates and times, and their formats."""
    rows = [row for line in lines if len(row := split_row(line, form.delimiter)) == width]
    found = {}
    for column in range(width):
        texts = [row[column] for row in rows if row[column]]
        texts = [text for text in texts if looks_like_date_time(text)] if len(texts) else []
        if texts and 2 * len(texts) > len(rows) and (written := guess_form(texts)) is not None:
            found[column] = written
    return found


def read_preamble(lines: list[str], form: TextForm, width: int) -> Preamble:
    """Read the lines above a table; the last line of each kind counts."""
    steps: tuple[float, ...] = ()
    source = ""
    starts: dict[int, float] = {}
    clocks: dict[int, float] = {}
    units: list[str] = []
    for line in lines:
        label, *cells = split_row(line, form.delimiter)[:width] or [""]
        word = label.strip(" #%:").lower()
        numbers = _numbers(cells, form)
        if word == "delta_x" and numbers and min(numbers.values()) > 0:
            steps, source = tuple(numbers.values()), line.strip()
        elif word == "x0" and numbers:
            starts = numbers
        elif word == "time" and cells:
            clocks = _clocks(cells)
        elif word == "y_unit_label" and any(header_unit(cell) for cell in cells):
            units = ["", *cells]
        elif match := _RATE.search(line):
            factor = 1e3 if match.group(2).lower() == "khz" else 1.0
            steps, source = (1.0 / (_number(match.group(1)) * factor or 1.0),), line.strip()
        elif match := _STEP.search(line):
            factor = {"s": 1.0, "ms": 1e-3}.get(match.group(2).lower(), 1e-6)
            steps, source = (_number(match.group(1)) * factor,), line.strip()
    if set(clocks) == set(starts):
        starts = {at: starts[at] + clocks[at] for at in starts}
    first = min(starts.values(), default=0.0)
    starts = {at: start - first for at, start in starts.items()}
    return Preamble(steps, starts if any(starts.values()) else {}, units, source)


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def _numbers(cells: list[str], form: TextForm) -> dict[int, float]:
    """Return the numbers of a labelled line by column; empty if a cell is a text."""
    texts = {at: cell.replace(form.decimal, ".") for at, cell in enumerate(cells, 1) if cell}
    try:
        return {at: float(text) for at, text in texts.items()}
    except ValueError:
        return {}


def _clocks(cells: list[str]) -> dict[int, float]:
    """Return the times of day of a labelled line, by column."""
    texts = {at: cell.replace(",", ".") for at, cell in enumerate(cells, 1) if cell}
    if not texts or not all(map(looks_like_date_time, texts.values())):
        return {}
    written = guess_form(list(texts.values()))
    if written is None:
        return {}
    return dict(zip(texts, seconds(list(texts.values()), written, Path()).tolist(), strict=True))
