"""The catalogue of parts and drives: every value with its source, or marked as assumed.

A part is a TOML file under ``parts/``, a drive one under ``drives/``; each of their values is a table with ``value``
and either ``source`` (a key of references.bib) or ``assumed`` (the reason). A drive names its parts and adds what they
leave open.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from pneudrive.describe import toml
from pneudrive.errors import DescriptionError, nearest

PREFIX = "catalogue:"
FOLDER = Path(__file__).resolve().parent.parent / "data" / "catalogue"


@dataclass(frozen=True)
class Value:
    """One value of the catalogue.

    Parameters
    ----------
    key : str
        Dotted key of the drive file, or of its table for a part.
    value : object
        As it stands in a drive file.
    source : str or None
        Key of references.bib.
    assumed : str or None
        Why it is assumed, where it has no source.
    note : str
        How the value comes from the source, where it is not printed there as it is.
    """

    key: str
    value: Any
    source: str | None
    assumed: str | None
    note: str = ""


@dataclass(frozen=True)
class Entry:
    """A part or a drive of the catalogue."""

    name: str
    kind: str  # "drive", or the table of the drive file that the part fills
    title: str
    values: tuple[Value, ...]
    parts: dict[str, str]  # table -> part, for a drive
    note: str = ""


@lru_cache(maxsize=1)
def entries() -> dict[str, Entry]:
    """Return all parts and drives by name.

    Raises
    ------
    DescriptionError
        An entry is not valid: a value without source and without reason, for instance.
    """
    found = {}
    for path in [*sorted((FOLDER / "drives").glob("*.toml")), *sorted((FOLDER / "parts").glob("*.toml"))]:
        found[path.stem] = _read(path)
    return found


def entry(name: str) -> Entry:
    """Return one part or drive.

    Raises
    ------
    DescriptionError
        There is none of that name; the message names the nearest.
    """
    known = entries()
    name = name.removeprefix(PREFIX)
    if name not in known:
        raise DescriptionError(f"the catalogue has no '{name}'", remedy=nearest(name, known))
    return known[name]


def all_values(drive: Entry) -> list[Value]:
    """Return a drive's values, those of its parts included, with keys of the drive file."""
    out = {}
    for table, name in drive.parts.items():
        for v in entry(name).values:
            out[f"{table}.{v.key}"] = Value(f"{table}.{v.key}", v.value, v.source, v.assumed, v.note)
    out |= {v.key: v for v in drive.values}
    return list(out.values())


def drive_tables(reference: str) -> dict[str, Any]:
    """Return the tables of a drive file for ``catalogue:NAME``."""
    name = reference.removeprefix(PREFIX)
    drives = [known for known, e in entries().items() if e.kind == "drive"]
    if name not in drives:
        error = DescriptionError(f"the catalogue has no drive '{name}'", remedy=nearest(name, drives))
        error.key = "drive"
        raise error
    found = entry(name)
    tables: dict[str, Any] = {"schema": 1, "name": found.title}
    for v in all_values(found):
        *path, last = v.key.split(".")
        at = tables
        for part in path:
            at = at.setdefault(part, {})
        at[last] = v.value
    return tables


def _read(path: Path) -> Entry:
    tables, text = toml.read(path)
    values = []
    for key, given in tables.get("values", {}).items():
        sourced = isinstance(given, dict) and "value" in given and ("source" in given) != ("assumed" in given)
        if not sourced:
            line = toml.line_of(text, f"values.{key}")
            raise DescriptionError(
                f"{key} has neither a source nor a reason", where=f"{path}:{line}", rule="value, and source or assumed"
            )
        values.append(Value(key, given["value"], given.get("source"), given.get("assumed"), given.get("note", "")))
    return Entry(
        name=path.stem,
        kind=tables["kind"],
        title=tables["title"],
        values=tuple(values),
        parts=dict(tables.get("parts", {})),
        note=tables.get("note", ""),
    )
