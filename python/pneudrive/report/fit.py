"""Report of a fit of any kind, additions of studies to reports, and provenance: software, data, sources."""

from __future__ import annotations

import platform
import re
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias
from unicodedata import normalize

from pneudrive import __version__
from pneudrive.describe.tables.friction import friction_laws
from pneudrive.references import entries
from pneudrive.report.page import Block, Items, Paragraph, Section, Topic, view_report

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.identify.base import Fit
    from pneudrive.identify.static.result import FrictionFit

    Fits: TypeAlias = Mapping[str, Mapping[str, FrictionFit]]


# --- Page of a fit of any kind: values with intervals, undetermined values, residuals, data.


def write_fit_report(fit: Fit, folder: str | Path, more: Iterable[Section] = ()) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    fit : Fit
        Fit of any kind. A fit from a file has no residuals.
    folder : path-like
        Made if it does not exist.
    more : iterable of Section
        Further sections, before the data.

    Returns
    -------
    pathlib.Path
        Folder of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    data, view = Topic("fit", "data"), fit.view()
    # Recordings and nested tables of the provenance are shown elsewhere.
    plain = {k: str(v) for k, v in fit.provenance.items() if not isinstance(v, list | tuple | dict)}
    facts = [*fit.statistics.items(), *plain.items()]
    rows = [(k, v if isinstance(v, str) else f"{v:.6g}") for k, v in facts]
    words = [data.text("intervals"), *([] if view.figures else [data.text("none")])]
    recordings = data.listed(fit.recordings, "recordings")
    about = data.section(*words, data.table(rows), *recordings, synthetic=False)
    return view_report(view, *more, about, synthetic=fit.synthetic).write(folder)


# --- Additions of a study to the report of recordings.


@dataclass(frozen=True)
class Addition:
    """The addition of a study to a report.

    Attributes
    ----------
    title : str
        Title of a report that contains only the study.
    verdict : tuple of str
        Lines of the verdict.
    sections : tuple of Section
        Sections that follow those of the recordings. A section with an existing key continues that section.
    validity : str
        Text on validation with real data, and its limits.
    settings : tuple
        Rows of the table of software: name, value.
    sources : tuple
        Sources of the study's values.
    cited, laws : tuple of str
        Keys of references.bib, and friction laws whose sources are named.
    """

    title: str
    verdict: tuple[str, ...]
    sections: tuple[Section, ...]
    validity: str
    settings: tuple[tuple[str, str], ...] = ()
    sources: tuple[Block, ...] = ()
    cited: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()


class Study(Protocol):
    """An object that adds to the report of recordings."""

    def addition(self, found: Characterisation | None) -> Addition:
        """Return the sections that this study adds to a report, with or without recordings."""
        ...


# --- Provenance: software, data, sources, and validation on real data.

SOURCE_NOTE = "SOURCE.md"
METHODS = ("gum2008", "paule1982", "huber2009", "bates1988", "smyth2004", "armstrong1994")
PACKAGES = ("numpy", "scipy", "xarray", "polars", "matplotlib")


def provenance_section(found: Characterisation | None, study: Addition | None) -> Section:
    """Return the section on provenance of the report."""
    topic = Topic("recordings", "provenance")
    lines: list[str] = []
    keys: list[str] = []
    blocks: list[Block] = []
    rows = [("pneudrive", __version__), *software()]
    if found is not None:
        lines.append(topic.say("synthetic" if found.synthetic else "real"))
        rows.append(("protocol of the characterisation", found.protocol))
        blocks += _notes(topic, found)
        keys += METHODS
    if study is not None:
        laws = friction_laws()
        lines.append(study.validity)
        rows += study.settings
        blocks += study.sources
        keys += [*study.cited, *(laws[name]["source"] for name in study.laws if name in laws)]
    blocks += topic.listed(references(dict.fromkeys(keys)), "sources")
    return topic.section(Items(tuple(lines)), topic.table(rows), *blocks, synthetic=False)


def _notes(topic: Topic, found: Characterisation) -> Iterator[Block]:
    """Yield the files SOURCE.md next to the recordings or one folder above."""
    sources = (Path(recording.source) for recording in found.recordings if recording.source is not None)
    for folder in dict.fromkeys(folder for source in sources for folder in source.parents[:2]):
        if (folder / SOURCE_NOTE).is_file():
            yield topic.text("note", note=f"{folder.name}/{SOURCE_NOTE}")
            yield Paragraph(_head(folder / SOURCE_NOTE), "code")


def _head(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")[:3000].strip()
    except OSError as error:
        return f"(it cannot be read: {error.strerror})"


def reference(key: str) -> str | None:
    """Return an entry of references.bib as one line; None if the key is unknown."""
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
    """Return entries of references.bib, one line each. Unknown keys are left out."""
    return tuple(line for key in keys if (line := reference(key)))


_ACCENTS = {'"': "\u0308", "'": "\u0301"}  # of TeX -> combining signs


def _plain(text: str) -> str:
    text = re.sub(r"""\\(["'])\{?(\w)\}?""", lambda found: normalize("NFC", found[2] + _ACCENTS[found[1]]), text)
    text = text.replace("\\AA", "Å").replace("\\l", "ł")
    return re.sub(r"[{}]", "", text).replace("--", "–").replace("\\&", "&").replace("~", " ").strip()
