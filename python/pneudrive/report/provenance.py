"""Where everything comes from: software, data, sources; what is validated on real data and what is not."""

from __future__ import annotations

import platform
import re
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive import __version__
from pneudrive.paper.chamber_laws import FULL_STROKE
from pneudrive.paper.stick_slip import SLOW_DRIVE
from pneudrive.references import entries
from pneudrive.report.page import Items, Section, Table, Text

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pneudrive.characterise import Characterisation
    from pneudrive.report.write import Reproduction

SOURCE_NOTE = "SOURCE.md"
METHODS = ("gum2008", "paule1982", "huber2009", "bates1988", "smyth2004", "armstrong1994")
PACKAGES = ("numpy", "scipy", "xarray", "polars", "matplotlib")


def section(found: Characterisation | None, made: Reproduction | None) -> Section:
    """Provenance of everything in the report."""
    blocks: list = [Items(validity(found, made)), _software(found, made)]
    if found is not None:
        for note in source_notes(found):
            blocks += [Text(f"{note.parent.name}/{note.name} beside the recordings says:"), Text(_head(note), "code")]
    if made is not None:
        blocks += _rig_values(made)
        blocks += [Text("The simulated drives, all values assumed:"), *_drives()]
    cited = [line for key in _keys(found, made) if (line := reference(key))]
    if cited:
        blocks += [Text("Sources of laws and methods:"), Items(tuple(cited))]
    return Section("provenance", "Provenance and sources", tuple(blocks))


def validity(found: Characterisation | None, made: Reproduction | None) -> tuple[str, ...]:
    """Say in sentences what is validated on real data and what only on synthetic."""
    out = []
    if found is not None and not found.synthetic:
        out.append(
            "Real: the recordings, the friction map, closure, drift, reversals, flags and the fit to the map. Not "
            "validated: bristle parameters, dwell, breakaway, anything outside the speeds and pressures shown."
        )
    elif found is not None:
        out.append(
            "Synthetic: the recordings come from a simulated rig. Nothing in this report was measured on hardware."
        )
    if made is not None:
        out.append(
            "Synthetic: the simulated rig, the paper's figures, stick-slip and both chamber laws. No measured "
            "trajectory of a drive under valve control stands behind them."
        )
    return tuple(out)


def _software(found: Characterisation | None, made: Reproduction | None) -> Table:
    rows = [("pneudrive", __version__), ("Python", platform.python_version())]
    rows += [(package, version(package)) for package in PACKAGES]
    if found is not None:
        rows.append(("protocol of the characterisation", found.protocol))
    if made is not None:
        run = made.chambers.runs["energy-balance"].attrs
        rows.append(("solver of the simulations", f"{run['solver']}"))
        rows.append(("seed of the simulated sensors", str(made.seed)))
    return Table(("software, settings", "version, value"), tuple(rows), numbers_from=9)


def source_notes(found: Characterisation) -> list[Path]:
    """Find files SOURCE.md beside the recordings or one folder above."""
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


def _rig_values(made: Reproduction) -> list[Text | Table]:
    """Values of the default rig, then those that the other rigs have beside them or instead."""
    base = made.rig.description.sources
    blocks: list[Text | Table] = []
    rigs = {made.rig.description.name: base, **{d.name: d.sources for d in made.rigs.values()}}
    for name, sources in rigs.items():
        own = sources if sources is base else {k: s for k, s in sources.items() if s != base.get(k)}
        said = "" if sources is base else ", where they are not those of the default rig"
        rows = tuple((key, s.value, s.source, s.reason) for key, s in own.items())
        blocks += [
            Text(f"Values of the {name[0].lower()}{name[1:]}{said}, each with its source:"),
            Table(("value", "", "source", "why"), rows, numbers_from=9),
        ]
    return blocks


def _drives() -> list[Text]:
    """Drive files of the stick-slip figures and of the chamber comparison, as they are."""
    return [Text(path.read_text(encoding="utf-8").strip(), "code") for path in (SLOW_DRIVE, FULL_STROKE)]


def _keys(found: Characterisation | None, made: Reproduction | None) -> list[str]:
    keys: list[str] = list(METHODS) if found is not None else []
    if made is not None:
        keys += ["bracha", *(k for run in made.chambers.runs.values() for k in run.attrs["citations"])]
        keys += _cited_laws(("lugre", "stribeck"))
    return list(dict.fromkeys(keys))


def _cited_laws(names: Iterable[str]) -> list[str]:
    from pneudrive.describe.friction import friction_laws

    return [laws["source"] for name in names if (laws := friction_laws().get(name))]


def reference(key: str) -> str | None:
    """Write one entry of references.bib in a line; None where there is none of that key."""
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
