"""Sections of a page: text from a table, numbers and pictures from results."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.describe.files.toml import tomllib
from pneudrive.report.page import Block, Items, Paragraph, Picture, Section
from pneudrive.report.tables import PageColumn, table
from pneudrive.views import ShownFigure, ShownTable

if TYPE_CHECKING:
    from collections.abc import Iterable

    import matplotlib.figure

    from pneudrive.figures import Figure

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
