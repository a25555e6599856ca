"""Reading a rig file: every value with its unit and its source, every key known, one file over another."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, create_model

from pneudrive.describe import toml
from pneudrive.describe.base import Described, wrong
from pneudrive.describe.friction import Friction
from pneudrive.describe.law import law_of
from pneudrive.errors import DescriptionError, Problems
from pneudrive.rig.keys import KEYS, MOUNTING, Key

SCHEMA = 1
#: Keys at the top of a rig file that are no tables.
TOP = ("schema", "name", "kind", "extends")
_PURE = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$")
RULE = '{ value = "25 mm", source = "assumed", reason = "..." }'


@dataclass(frozen=True)
class Source:
    """Where a value of the rig comes from.

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
    """Take the quotes off pure numbers and percentages, which a drive file writes without."""
    plain = text.strip().removesuffix("%").rstrip()
    if not _PURE.match(plain):
        return text
    return float(plain) / 100.0 if "%" in text else float(plain)


@lru_cache(maxsize=1)
def _rig_class() -> type[Described]:
    """Make the class of a rig file, with a table for each of `KEYS`."""
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
    """Read a rig file: its name, its tables in SI, its friction, and where each value comes from.

    Raises
    ------
    DescriptionError
        With everything that is wrong with the file.
    """
    content = open_file(path)
    problems, sources = Problems(), dict[str, Source]()
    plain = {
        name: problems.take(_plain, name, table, sources, problems, otherwise={})
        for name, table in content.items()
        if name not in TOP
    }
    told = dict(problems.found)
    friction = problems.take(_friction, plain.pop("friction", {}), path)
    tables = problems.take(_rig_class().model_validate, {name: {} for name in KEYS} | plain)
    keys = {place: getattr(one, "key", None) or "" for place, one in problems.found.items()}
    unknown = tuple(keys[place] for place, one in problems.found.items() if "is not a known key" in one.what)
    without_source = {keys[place] for place in told if not keys[place].startswith(unknown)}
    for place, key in keys.items():  # each key once: that it is unknown, or says no source, or what else is wrong
        if (place in told) != (key in without_source):
            del problems.found[place]
    with toml.locating(path, toml.read(path)[1]):
        problems.tell()
    return str(content.get("name", path.stem)), tables, friction, sources


def _friction(given: dict[str, Any], path: Path) -> Friction:
    """Read the friction table: as in a drive file, but its law has to be named."""
    law = given.get("law")
    if not isinstance(law, str):
        raise wrong("friction.law", "friction.law is missing", rule='law = "stribeck", without source')
    return Friction.model_validate(given | {"law": law_of(law, path.parent) or law})


def open_file(path: str | Path) -> dict[str, Any]:
    """Read the tables of a rig file over those of the file that it extends.

    Raises
    ------
    DescriptionError
        If a file cannot be read, is of another schema, or extends itself.
    """
    return _open(Path(path), ())


def _open(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    where = str(path)
    if path in above:
        raise DescriptionError("the rig file extends itself", where=where)
    content, _ = toml.read(path, start="The guides on rigs show what stands in one.")
    if content.get("schema") != SCHEMA:
        raise DescriptionError("the rig file has another schema", where=where, rule=f"schema = {SCHEMA}")
    base = content.pop("extends", None)
    if base is None:
        return content
    from pneudrive.rig.loading import shipped_rigs

    below = _open(shipped_rigs().get(str(base), path.parent / str(base)), (*above, path))
    law, old = (_table(one, "friction").get("law") for one in (content, below))
    if law is not None and law != old:  # another friction law takes none of the old one's values
        kept = {key: table for key, table in _table(below, "friction").items() if toml.is_table(table)}
        below["friction"] = kept
    return toml.merge(below, content, toml.is_table)


def _table(content: dict[str, Any], name: str) -> dict[str, Any]:
    table = content.get(name)
    return table if isinstance(table, dict) else {}


def _plain(name: str, given: Any, sources: dict[str, Source], problems: Problems) -> Any:  # noqa: ANN401
    """Take the sources off: what remains is written as in a drive file. A list, or pair, may say its source once."""
    if name == "friction.law":
        if isinstance(given, str):
            return given
        raise wrong(name, f"{name} is a name alone", rule='law = "stribeck", without source')
    if isinstance(given, list) and "." in name:
        return [_plain(f"{name}.{number}", one, sources, problems) for number, one in enumerate(given)]
    if not isinstance(given, dict):
        if "." not in name:
            raise wrong(name, f"{name} = {given!r} is not a table")
        raise wrong(name, f"{name} = {given!r} does not say its source", rule=RULE)
    said = {key: given[key] for key in ("source", "reason") if key in given}
    inner = {key: value for key, value in given.items() if key not in said}
    if "value" in given and (set(inner) != {"value"} or "source" not in said):
        unknown = next((key for key in inner if key != "value"), None)
        what = f"{name}: {unknown!r} is unknown" if unknown else f"{name} does not say its source"
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
    """Give an entry of a list the source that the list says."""
    return (given if isinstance(given, dict) else {"value": given}) | said
