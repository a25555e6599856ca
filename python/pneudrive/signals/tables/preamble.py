"""Lines above a table: the rate of the samples, the units, and the start of each channel, if they state them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.signals.tables.column_units import header_unit
from pneudrive.signals.tables.date_times import guess_form, looks_like_date_time, seconds
from pneudrive.signals.tables.text_table import split_row

if TYPE_CHECKING:
    from pneudrive.signals.tables.text_table import TextForm

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
