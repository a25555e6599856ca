"""Display of results and descriptions, as a short table, at the Python prompt and in a notebook.

A class derives from `Shown` and provides a `Card`. If a class has a picture, a notebook shows it
above the card. Long content is cut, and the card states the number of omitted rows. Severe findings are never cut.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import fields
from html import escape
from itertools import islice, zip_longest
from typing import NamedTuple

from pneudrive.errors import is_severe

#: Largest sizes of a card.
MOST_ROWS, MOST_NOTES, MOST_LETTERS, MOST_ENTRIES = 30, 8, 200, 6


class Card(NamedTuple):
    """Content of the display of an object.

    Attributes
    ----------
    title : str
    head : sequence of str
        Names of the columns; may be empty.
    rows : sequence of sequences of str
    notes : sequence of str
        Sentences below the table.
    """

    title: str
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()


class Shown:
    """Base of classes that show their card as ``repr`` and in a notebook."""

    def _card(self) -> Card:
        """Return the card: by default, the lines of ``str``, or the fields of a class without ``__str__``.

        The first line of ``str`` is the title. Lines with columns separated by two spaces are rows; others are notes.
        """
        if type(self).__str__ is not object.__str__:
            title, *lines = str(self).splitlines() or [""]
            cells = [re.split(r"\s{2,}|\s+(?=95 %: )", line.strip()) for line in lines]
            notes = [row[0] for row in cells if len(row) == 1]
            return Card(title, rows=[row for row in cells if len(row) > 1], notes=notes)
        values = {field.name: getattr(self, field.name) for field in fields(self) if field.repr}  # type: ignore[arg-type]
        rows = [(name, brief(value)) for name, value in values.items() if value is not None]
        return Card(type(self).__name__, rows=[row for row in rows if row[1]])

    def __repr__(self) -> str:
        return text_of(self._card())

    def _repr_html_(self) -> str:
        return html_of(self._card())


def brief(value: object) -> str:
    """Write a value in a few words. Long values are replaced by their type and size.

    Examples
    --------
    >>> brief(1.0 / 3.0), brief((1.0, 2.0)), brief(range(1000))
    ('0.33333', '1, 2', '1000 int')
    """
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, float):
        return str(value) if type(value) is not float else f"{value:.5g}"
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple):
        return f"array {shape}" if shape else f"{value:.5g}"
    if isinstance(value, Mapping):
        plain = all(isinstance(one, bool | str | int | float) for one in value.values())
        keys = (f"{key} = {brief(one)}" if plain else str(key) for key, one in islice(value.items(), MOST_ENTRIES))
        return ", ".join(keys) + (f", ... {len(value)} in all" if len(value) > MOST_ENTRIES else "")
    if isinstance(value, Collection):
        plain = all(isinstance(one, bool | str | int | float) for one in islice(value, MOST_ENTRIES))
        if plain and len(value) <= MOST_ENTRIES:
            return ", ".join(map(brief, value))
        kinds = {type(one).__name__ for one in islice(value, MOST_ENTRIES)}
        return f"{len(value)} {' or '.join(sorted(kinds))}"
    named = type(value).__str__ is object.__str__ and not isinstance(value, int)  # int does not define ``__str__``
    return type(value).__name__ if named else str(value)


def text_of(card: Card) -> str:
    """Return a card as lines of text with aligned columns."""
    card = _short(card)
    table = [row for row in (card.head, *card.rows) if row]
    lines = [aligned(table)] if table else []
    return "\n".join([card.title, *lines, *(f"  {note}" for note in card.notes)])


def aligned(
    rows: Iterable[Sequence[str]], right_from: int | None = None, indent: str = "  ", left: Collection[int] = ()
) -> str:
    """Return rows as lines, each column as wide as its widest entry.

    Columns are right-aligned from `right_from` on, except those in `left`.

    Examples
    --------
    >>> print(aligned([("bore", "m/s"), ("4 mm", "0.812")], right_from=1, indent=""))
    bore    m/s
    4 mm  0.812
    """
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip_longest(*rows, fillvalue="")]
    is_left = (right_from is None or index < right_from or index in left for index in range(len(widths)))
    sides = ["<" if each else ">" for each in is_left]
    lines = (
        "  ".join(f"{text:{side}{width}}" for text, side, width in zip(row, sides, widths, strict=False))
        for row in rows
    )
    return "\n".join((indent + line).rstrip() for line in lines)


def html_of(card: Card) -> str:
    """Return a card as HTML. Every text is escaped."""
    card = _short(card)
    cell = '<td style="text-align:left">{}</td>'
    rows = ["<tr>" + "".join(cell.format(escape(text)) for text in row) + "</tr>" for row in card.rows]
    head = "".join(f'<th style="text-align:left">{escape(text)}</th>' for text in card.head)
    table = f"<table>{f'<tr>{head}</tr>' if head else ''}{''.join(rows)}</table>" if rows else ""
    notes = "".join(f"<div>{escape(note)}</div>" for note in card.notes)
    return f"<div><strong>{escape(card.title)}</strong>{table}{notes}</div>"


def _short(card: Card) -> Card:
    rows = [[_cut(text) for text in row] for row in card.rows[:MOST_ROWS]]
    if len(card.rows) > MOST_ROWS:
        rows.append([f"... {len(card.rows) - MOST_ROWS} more"])
    severe, others = ([note for note in card.notes if is_severe(note) == kind] for kind in (True, False))
    notes = [*severe, *map(_cut, others[:MOST_NOTES])]
    if len(others) > MOST_NOTES:
        notes.append(f"... {len(others) - MOST_NOTES} more lines")
    return Card(" ".join(card.title.split()), [_cut(text) for text in card.head], rows, notes)


def _cut(text: str) -> str:
    text = " ".join(str(text).split())
    return text if len(text) <= MOST_LETTERS else text[: MOST_LETTERS - 4] + " ..."
