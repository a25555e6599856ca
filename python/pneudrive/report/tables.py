"""Sections and tables of a page: text from files, numbers from records, and pictures."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import lru_cache, partial
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.describe.files.toml import tomllib
from pneudrive.friction.friction_map import Condition, group_of
from pneudrive.numbers import with_interval
from pneudrive.report.page import Block, Items, Paragraph, Picture, Section
from pneudrive.views import ShownFigure, ShownTable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    import matplotlib.figure

    from pneudrive.figures import Figure
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.signals.recording import Recording


# --- Tables of a page, made of records: a column names its field and format; the field's name gives the unit.

# --- Numbers in the report's form, and values that several sections need.

MM = 1e3  # of a metre
MOST_SHOWN = 24  # panels of one kind in a report; a campaign has too many recordings to show all


def condition_names(found: CampaignCharacteristics) -> Callable[[Condition], str]:
    """Return a function that names the conditions of a campaign."""
    return partial(Condition.label, ambient_pressure_pa=found.identity.ambient_pressure_pa)


def seal_of(recording: Recording) -> str:
    """Return the name of the assembly: seal, mounting, drive."""
    return group_of(recording.labels)


def by_seal(found: Characterisation) -> dict[str, list[RecordingResult]]:
    """Group recordings by seal, each group in order of pressure."""
    groups: dict[str, list[RecordingResult]] = {}
    for result in found.results:
        groups.setdefault(seal_of(result.recording), []).append(result)
    return {seal: sorted(group, key=lambda r: gauge_bar(r.levels[0])) for seal, group in groups.items()}


def gauge_bar(level: Level) -> float:
    """Return the higher gauge pressure of both chambers, mean of both directions, bar."""
    return level.pressure_pa / 1e5


def speed_mm_s(level: Level) -> float:
    """Return the mean speed of both directions in the window, mm/s."""
    return 1e3 * level.speed_m_s


def chance(p: float) -> str:
    """Return a probability of chance as text.

    Examples
    --------
    >>> chance(0.0342), chance(1e-5), chance(float("nan"))
    ('0.034', '< 0.001', '–')
    """
    return "–" if not np.isfinite(p) else "< 0.001" if p < 1e-3 else f"{p:.2g}"


def spread_evenly(items: Sequence, most: int = MOST_SHOWN) -> list:
    """Return at most `most` of the items, evenly spread over all of them."""
    if len(items) <= most:
        return list(items)
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, most).astype(int))]


def broken(name: str, most: int) -> str:
    r"""Return a name in lines of at most `most` letters, where its parts allow it.

    Examples
    --------
    >>> broken("Kidney_2bar_tweederun", 18), broken("O-ring_1bar", 18)
    ('Kidney_2bar_\ntweederun', 'O-ring_1bar')
    """
    lines = [""]
    for part in re.findall(r"[^_\s]+[_\s]*|[_\s]+", name):
        if lines[-1] and len(lines[-1] + part.rstrip()) > most:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)


def plural(count: int, one: str, many: str = "") -> str:
    """Return a count with its noun.

    Examples
    --------
    >>> plural(1, "seal"), plural(3, "seal")
    ('1 seal', '3 seals')
    """
    return f"{count} {one if count == 1 else many or one + 's'}"


def sentence(text: str) -> str:
    """Return a text as a sentence: capital letter, one full stop, printed signs.

    Examples
    --------
    >>> sentence("area 5 cm2 +-0.1 cm2")
    'Area 5 cm² ±0.1 cm².'
    """
    text = text.replace("+-", "±").replace("cm2", "cm²")
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


# --- Tables of a page, made of records: a column names its field and format; the field's name gives the unit.

#: End of a field's name -> SI unit of its value. The longest match counts.
_ENDINGS = {
    "_m": "m",
    "_m_s": "m/s",
    "_s": "s",
    "_n": "N",
    "_n_s": "N/s",
    "_n_m": "N/m",
    "_n_s_m": "N s/m",
    "_pa": "Pa",
}
NOTHING, SPARE = "–", "spare"
#: Forms beside those of ``format``.
_FORMS: Mapping[str, Callable[[Any], str]] = {
    "chance": chance,
    "percent": lambda share: f"{100 * share:.0f} %",
    "plain interval": lambda estimate: with_interval(estimate, unit=""),
    SPARE: str,
    "shown": lambda yes: "yes" if yes else "not shown",
}


class PageColumn(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    head : str
        Its heading; the unit follows from the end of the field's name.
    field : str
        Name of the field of a record (``"stop.speed_m_s"``). "" takes the values of a tuple one after the other.
    form : str
        Format of a number, as in ``format``, or one of the named forms. "spare": a column that is left out if empty.
    """

    head: str
    field: str = ""
    form: str = ""

    @classmethod
    def read(cls, text: str) -> PageColumn:
        """Read ``head | field | form``.

        Examples
        --------
        >>> PageColumn.read("speed | speed_m_s | .3g"), PageColumn.read("p || chance")
        (PageColumn(head='speed', field='speed_m_s', form='.3g'), PageColumn(head='p', field='', form='chance'))
        """
        return cls(*(part.strip() for part in text.split("|")))


def table(caption: str, records: Iterable[Any], columns: Sequence[PageColumn]) -> ShownTable:
    """Make a table with a row for each record.

    Parameters
    ----------
    caption : str
    records : iterable
        Results, or tuples of as many values as there are columns.
    columns : sequence of PageColumn

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> made = table("", [SimpleNamespace(speed_m_s=0.0204)], [PageColumn("speed", "speed_m_s", ".3g")])
    >>> made.head, made.rows
    (('speed, mm/s',), (('20.4',),))
    """
    sizes = [quantity(column.field) for column in columns]
    head = tuple(f"{c.head}, {unit}" if unit else c.head for c, (_, unit) in zip(columns, sizes, strict=True))
    rows = []
    for record in records:
        values = [attrgetter(c.field)(record) if c.field else record[i] for i, c in enumerate(columns)]
        in_unit = [v if size == 1.0 else v / size for v, (size, _) in zip(values, sizes, strict=True)]
        rows.append(tuple(cell(value, column.form) for value, column in zip(in_unit, columns, strict=True)))
    kept = [i for i, c in enumerate(columns) if c.form != SPARE or any(row[i] not in ("", NOTHING) for row in rows)]
    rows = [tuple(row[i] for i in kept) for row in rows]
    return ShownTable(caption, tuple(head[i] for i in kept), tuple(rows))


def cell(value: Any, form: str = "") -> str:  # noqa: ANN401 - whatever results hold
    """Return a value as text: estimates with their interval, a missing value as a dash."""
    if isinstance(value, str):
        return value
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return NOTHING
    if form in _FORMS:
        return _FORMS[form](value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    return with_interval(value) if hasattr(value, "stderr") else format(value, form)


def quantity(field: str) -> tuple[float, str]:
    """Return size in SI and name of the usual unit of a field, from the field's name.

    Examples
    --------
    >>> quantity("speed_m_s"), quantity("friction_n"), quantity("flags")
    ((0.001, 'mm/s'), (1.0, 'N'), (1.0, ''))
    """
    known = [end for end in _ENDINGS if field.endswith(end)]
    return units.readable(_ENDINGS[max(known, key=len)]) if known else (1.0, "")


# --- Sections of a page: text from a table, numbers and pictures from results.

TEXTS = Path(__file__).with_name("texts")


@lru_cache
def texts_of(file: Path) -> dict[str, Any]:
    """Return the texts of a page: topic -> name -> text, with places for numbers as in ``str.format``."""
    return tomllib.loads(file.read_text(encoding="utf-8"))


class Topic:
    """A section of a page.

    Parameters
    ----------
    page : str or Path
        File of its texts: the name of one in the folder ``texts``, or the path of a study's file.
    key : str
        Topic in the file, and of the section.
    """

    def __init__(self, page: str | Path, key: str) -> None:
        file = page if isinstance(page, Path) else TEXTS / f"{page}.toml"
        self.key, self.texts = key, texts_of(file)[key]

    def say(self, name: str = "text", /, **values: object) -> str:
        """Return a text with its values."""
        return self.texts[name].format(**values)

    def text(self, name: str = "text", kind: str = "plain", /, **values: object) -> Paragraph:
        """Return a paragraph."""
        return Paragraph(self.say(name, **values), kind)

    def listed(self, items: Iterable[str], name: str = "", kind: str = "plain") -> tuple[Block, ...]:
        """Return a paragraph with a list of sentences; nothing without sentences."""
        lines = tuple(items)
        lead = (self.text(name, kind),) if name else ()
        return (*lead, Items(lines)) if lines else ()

    def picture(
        self, name: str, figure: Figure | matplotlib.figure.Figure, synthetic: bool | None = None, /, **values: object
    ) -> Picture:
        """Return a picture with its caption."""
        return Picture(name, self.texts["pictures"][name].format(**values), figure, synthetic)

    def figure(self, name: str, figure: Figure, /, **values: object) -> ShownFigure:
        """Return a figure of a view with its caption."""
        return ShownFigure(name, self.texts["pictures"][name].format(**values), figure)

    def table(self, records: Iterable[Any], name: str = "table", /, **values: object) -> ShownTable:
        """Return a table of records."""
        said = self.texts[name]
        read = [PageColumn.read(text) for text in said["columns"]]
        columns = [column._replace(head=column.head.format(**values)) for column in read]
        return table(said.get("caption", "").format(**values), records, columns)

    def shown(self, records: Iterable[Any], name: str = "table", /, **values: object) -> ShownTable:
        """Return a table of a view; its caption is that of the table, or the title of the topic."""
        made = self.table(records, name, **values)
        return made if made.caption else replace(made, caption=self.say("title", **values))

    def section(self, *blocks: Block | None, synthetic: bool | None = None, **values: object) -> Section:
        """Return a section of the blocks that are not None."""
        there = tuple(block for block in blocks if block is not None)
        return Section(self.texts.get("key", self.key), self.say("title", **values), there, synthetic)
