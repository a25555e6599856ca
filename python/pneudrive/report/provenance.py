"""Provenance: software, data, sources, and validation on real data."""

from __future__ import annotations

import platform
import re
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive import __version__
from pneudrive.describe.tables.friction import friction_laws
from pneudrive.references import entries
from pneudrive.report.page import Items, Paragraph, Section
from pneudrive.report.tables import Topic

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.report.fit import Addition
    from pneudrive.report.page import Block

SOURCE_NOTE = "SOURCE.md"
METHODS = ("gum2008", "paule1982", "huber2009", "bates1988", "smyth2004", "armstrong1994")
PACKAGES = ("numpy", "scipy", "xarray", "polars", "matplotlib")


def section(found: Characterisation | None, study: Addition | None) -> Section:
    """Return the section on provenance of the report."""
    topic = Topic("recordings", "provenance")
    lines = [] if found is None else [topic.say("synthetic" if found.synthetic else "real")]
    rows = [("pneudrive", __version__), *software()]
    if found is not None:
        rows.append(("protocol of the characterisation", found.protocol))
    if study is not None:
        lines.append(study.validity)
        rows += study.settings
    return topic.section(
        Items(tuple(lines)),
        topic.table(rows),
        *(_notes(topic, found) if found is not None else ()),
        *(study.sources if study is not None else ()),
        *topic.listed(references(_keys(found, study)), "sources"),
        synthetic=False,
    )


def _notes(topic: Topic, found: Characterisation) -> Iterator[Block]:
    for note in source_notes(found):
        yield topic.text("note", note=f"{note.parent.name}/{note.name}")
        yield Paragraph(_head(note), "code")


def source_notes(found: Characterisation) -> list[Path]:
    """Return the paths of files SOURCE.md next to the recordings or one folder above."""
    notes = []
    for recording in found.recordings:
        if recording.source is None:
            continue
        for folder in (Path(recording.source).parent, Path(recording.source).parent.parent):
            note = folder / SOURCE_NOTE
            if note.is_file() and note not in notes:
                notes.append(note)
    return notes


def _head(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")[:3000].strip()
    except OSError as error:
        return f"(it cannot be read: {error.strerror})"


def _keys(found: Characterisation | None, study: Addition | None) -> list[str]:
    keys: list[str] = list(METHODS) if found is not None else []
    if study is not None:
        laws = friction_laws()
        keys += [*study.cited, *(laws[name]["source"] for name in study.laws if name in laws)]
    return list(dict.fromkeys(keys))


def reference(key: str) -> str | None:
    """Return an entry of references.bib in a line; None if the key is unknown."""
    entry = entries().get(key)
    if entry is None:
        return None
    fields = {
        name.lower(): _plain(value) for name, value in re.findall(r"(\w+)\s*=\s*[{\"](.*?)[}\"],?\s*(?:\n|$)", entry)
    }
    where = fields.get("journal") or fields.get("publisher") or fields.get("institution") or fields.get("school")
    number = fields.get("number") if "institution" in fields else None
    parts = (fields.get("author"), fields.get("title"), where, number, fields.get("year"), fields.get("note"))
    return f"[{key}] " + ". ".join(p.rstrip(".") for p in parts if p) + "."


def software() -> list[tuple[str, str]]:
    """Return the versions of Python and of the packages that compute and draw."""
    return [("Python", platform.python_version()), *((package, version(package)) for package in PACKAGES)]


def references(keys: Iterable[str]) -> tuple[str, ...]:
    """Return the entries of references.bib in a line each, without unknown keys."""
    return tuple(line for key in keys if (line := reference(key)))


_ACCENTS = {
    '\\"{o}': "ö",
    '\\"{a}': "ä",
    '\\"{u}': "ü",
    "\\'{e}": "é",
    "{\\AA}": "Å",
    "\\AA": "Å",
    "\\'{o}": "ó",
    "\\l": "ł",
}


def _plain(text: str) -> str:
    for tex, letter in _ACCENTS.items():
        text = text.replace(tex, letter).replace(tex.replace("{", "").replace("}", ""), letter)
    return re.sub(r"[{}]", "", text).replace("--", "–").replace("\\&", "&").replace("~", " ").strip()
