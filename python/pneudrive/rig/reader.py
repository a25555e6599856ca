"""Reading of rig files: values with unit and source, known keys only, one file extending another."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, create_model

from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.formulas.law import law_of
from pneudrive.describe.keys import wrong
from pneudrive.describe.tables.friction import Friction
from pneudrive.errors import DescriptionError, Problems
from pneudrive.rig.keys import KEYS, MOUNTING, Key

SCHEMA = 1
#: Top-level keys of a rig file that are not tables.
TOP = ("schema", "name", "kind", "extends")
_PURE = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d+)?$")
RULE = '{ value = "25 mm", source = "assumed", reason = "..." }'


@dataclass(frozen=True)
class Source:
    """Source of a value of the rig.

    Attributes
    ----------
    value : str
        As written, with its unit.
    source : str
        Key of references.bib, or ``assumed``.
    reason : str
    """

    value: str
    source: str
    reason: str


def bare(text: str) -> str | float:
    """Convert quoted pure numbers and percentages to the form of a drive file, without quotes."""
    plain = text.strip().removesuffix("%").rstrip()
    if not _PURE.match(plain):
        return text
    return float(plain) / 100.0 if "%" in text else float(plain)


@lru_cache(maxsize=1)
def _rig_class() -> type[Described]:
    """Return the class of a rig file, with a table for each of `KEYS`."""
    tables = {name: (_table_class(name, keys), ...) for name, keys in KEYS.items()}
    mounting = _table_class("mounting", MOUNTING)
    fields: dict[str, Any] = {"mounting": (dict[str, mounting], Field(default_factory=dict))}  # type: ignore[valid-type]
    return create_model("RigTables", __base__=Described, **tables, **fields)


def _table_class(name: str, keys: dict[str, Key]) -> type[Described]:
    fields: dict[str, Any] = {
        key: (Annotated[Any, one.mark], Field(default=one.default, alias=key, description=one.meaning))
        for key, one in keys.items()
    }
    return create_model(f"Rig{name.title()}", __base__=Described, **fields)


def read_tables(path: Path) -> tuple[str, Any, Friction, dict[str, Source]]:
    """Read a rig file: name, tables in SI, friction, and the source of each value.

    Raises
    ------
    DescriptionError
        The file is not valid; the error lists all problems.
    """
    content = open_file(path)
    problems, sources = Problems(), dict[str, Source]()
    plain = {
        name: problems.take(_plain, name, table, sources, problems, otherwise={})
        for name, table in content.items()
        if name not in TOP
    }
    before = dict(problems.found)
    friction = problems.take(_friction, plain.pop("friction", {}), path)
    tables = problems.take(_rig_class().model_validate, {name: {} for name in KEYS} | plain)
    keys = {place: getattr(one, "key", None) or "" for place, one in problems.found.items()}
    unknown = tuple(keys[place] for place, one in problems.found.items() if "is not a known key" in one.what)
    without_source = {keys[place] for place in before if not keys[place].startswith(unknown)}
    for place, key in keys.items():  # one error for each key: unknown, without source, or another problem
        if (place in before) != (key in without_source):
            del problems.found[place]
    with toml.locating(path, toml.read(path)[1]):
        problems.tell()
    return str(content.get("name", path.stem)), tables, friction, sources


def _friction(given: dict[str, Any], path: Path) -> Friction:
    """Read the friction table, as in a drive file but with a required law."""
    law = given.get("law")
    if not isinstance(law, str):
        raise wrong("friction.law", "friction.law is missing", rule='law = "stribeck", without source')
    return Friction.model_validate(given | {"law": law_of(law, path.parent) or law})


def open_file(path: str | Path) -> dict[str, Any]:
    """Read the tables of a rig file, merged over those of the file that it extends.

    Raises
    ------
    DescriptionError
        A file cannot be read, has another schema, or extends itself.
    """
    return _open(Path(path), ())


def _open(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    where = str(path)
    if path in above:
        raise DescriptionError("the rig file extends itself", where=where)
    content, _ = toml.read(path, start="The guides on rigs show examples of rig files.")
    if content.get("schema") != SCHEMA:
        raise DescriptionError("the rig file has another schema", where=where, rule=f"schema = {SCHEMA}")
    base = content.pop("extends", None)
    if base is None:
        return content
    from pneudrive.rig.loading import shipped_rigs

    below = _open(shipped_rigs().get(str(base), path.parent / str(base)), (*above, path))
    law, old = (_table(one, "friction").get("law") for one in (content, below))
    if law is not None and law != old:  # another friction law drops the values of the old one
        kept = {key: table for key, table in _table(below, "friction").items() if toml.is_table(table)}
        below["friction"] = kept
    return toml.merge(below, content, toml.is_table)


def _table(content: dict[str, Any], name: str) -> dict[str, Any]:
    table = content.get(name)
    return table if isinstance(table, dict) else {}


def _plain(name: str, given: Any, sources: dict[str, Source], problems: Problems) -> Any:  # noqa: ANN401
    """Return the values without sources, in the form of a drive file. A list or pair may give one common source."""
    if name == "friction.law":
        if isinstance(given, str):
            return given
        raise wrong(name, f"{name} takes a name without a source", rule='law = "stribeck", without source')
    if isinstance(given, list) and "." in name:
        return [_plain(f"{name}.{number}", one, sources, problems) for number, one in enumerate(given)]
    if not isinstance(given, dict):
        if "." not in name:
            raise wrong(name, f"{name} = {given!r} is not a table")
        raise wrong(name, f"{name} = {given!r} has no source", rule=RULE)
    said = {key: given[key] for key in ("source", "reason") if key in given}
    inner = {key: value for key, value in given.items() if key not in said}
    if "value" in given and (set(inner) != {"value"} or "source" not in said):
        unknown = next((key for key in inner if key != "value"), None)
        what = f"{name}: {unknown!r} is unknown" if unknown else f"{name} has no source"
        raise wrong(name, what, rule=RULE)
    if isinstance(given.get("value"), list):
        return [
            _plain(f"{name}.{number}", _with(one, said), sources, problems) for number, one in enumerate(given["value"])
        ]
    if "value" in given:
        text = str(given["value"])
        sources[name] = Source(text, str(said["source"]), str(said.get("reason", "")))
        return bare(text)
    return {
        key: problems.take(_plain, f"{name}.{key}", {"value": value} | said if said else value, sources, problems)
        for key, value in inner.items()
    }


def _with(given: object, said: dict[str, Any]) -> dict[str, Any]:
    """Add the source of a list to its entry."""
    return (given if isinstance(given, dict) else {"value": given}) | said
