"""Reading a rig file: every value with its unit and its source, every key known, one file over another."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.describe import toml
from pneudrive.describe.base import Bounds, WrongValueError, number, quantity
from pneudrive.describe.components import component_kinds
from pneudrive.describe.parameters import parameter_quantity
from pneudrive.errors import DescriptionError, Problems, nearest
from pneudrive.units import parse_pressure

if TYPE_CHECKING:
    from collections.abc import Mapping

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


@dataclass(frozen=True)
class Key:
    """What a key of a rig file holds.

    Attributes
    ----------
    unit : str
        SI unit as `pneudrive.units` writes it; "1": a pure number or a percentage, "abs": an absolute pressure,
        "delta K": a difference of temperatures, "word": one of `choices`.
    meaning : str
    default : float, str, None or ...
        Where the key is absent; ``...``: it must be there.
    bounds : Bounds
    choices : tuple of str
    """

    unit: str
    meaning: str
    default: Any = ...
    bounds: Bounds = field(default_factory=Bounds)
    choices: tuple[str, ...] = ()

    def read(self, text: str) -> float | str:
        """Return the SI value, or the word, or raise `WrongValueError` or `DescriptionError`."""
        if self.unit == "word":
            if text not in self.choices:
                raise WrongValueError(f"{text!r} is unknown", remedy=nearest(text, self.choices))
            return text
        if self.unit == "1":
            plain = bare(text)
            if isinstance(plain, str):
                raise WrongValueError(f'"{text}" is no pure number')
            return number(plain, self.bounds)
        if self.unit == "abs" and parse_pressure(text).gauge:
            raise WrongValueError(f'"{text}" is no absolute pressure')
        if self.unit == "delta K" and not text.endswith(" K"):
            raise WrongValueError(f'"{text}" is no difference of temperatures', rule='in K, e.g. "0.5 K"')
        if self.unit == "abs":
            return quantity(text.removesuffix("abs"), "Pa", self.bounds)
        return quantity(text, self.unit.removeprefix("delta "), self.bounds)


def bare(text: str) -> str | float:
    """Take the quotes off pure numbers and percentages, which a drive file writes without."""
    plain = text.strip().removesuffix("%").rstrip()
    if not _PURE.match(plain):
        return text
    return float(plain) / 100.0 if "%" in text else float(plain)


def of(path: str, meaning: str = "", default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key that is a parameter of a component, ``kind.key``, with its unit, bounds and default."""
    kind, _, name = path.rpartition(".")
    parameter = next(p for p in component_kinds()[kind]["parameters"] if p["key"] == name)
    if default is ... and parameter["default"] is not None:
        default = parameter["default"]
    own, said = parameter_quantity(parameter), parameter["meaning"]
    return Key(own.si_unit or "1", meaning or said[0].lower() + said[1:], default, own.bounds)


def positive(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key whose value is above zero."""
    return Key(unit, meaning, default, Bounds(above=0.0))


def not_negative(unit: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key whose value is zero or above."""
    return Key(unit, meaning, default, Bounds(at_least=0.0))


def word(*choices: str, meaning: str, default: Any = ...) -> Key:  # noqa: ANN401
    """Make a key that is one of some words."""
    return Key("word", meaning, default, choices=choices)


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

    below = shipped_rigs().get(str(base), path.parent / str(base))
    return _over(_open(below, (*above, path)), content)


def _over(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """Put the values of one file over those of another; another friction law takes none of the old one's values."""
    law = changes.get("friction", {}).get("law")
    if law is not None and law != base.get("friction", {}).get("law"):
        kept = {key: table for key, table in base.get("friction", {}).items() if _is_table(table)}
        base = base | {"friction": kept}
    return _merge(base, changes)


def _merge(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    out = dict(base)
    for key, value in changes.items():
        old = out.get(key)
        if isinstance(old, dict) and _is_table(value) and _is_table(old):
            out[key] = _merge(old, value)
        else:
            out[key] = value
    return out


def _is_table(value: object) -> bool:
    """Tell a table of keys from one value with its source."""
    return isinstance(value, dict) and "source" not in value


class Reader:
    """Takes values with units and sources out of the parsed file; what is left over is unknown.

    Parameters
    ----------
    content : dict
        Of the file; emptied by reading.
    where : str
        What a message calls it.
    """

    def __init__(self, content: dict[str, Any], where: str) -> None:
        self.content = content
        self.where = where
        self.sources: dict[str, Source] = {}
        self.known: dict[str, list[str]] = {}
        self.problems = Problems()

    def table(self, name: str, keys: Mapping[str, Key], given: dict[str, Any] | None = None) -> dict[str, Any]:
        """Take the keys of a table; SI values, words, None where a key without a default is absent.

        What is wrong goes to `problems`, and None stands in its place.
        """
        given = self.content.get(name, {}) if given is None else given
        self.known[name] = list(keys)
        if not isinstance(given, dict):
            self.problems.add(DescriptionError(f"{name} is a table", where=self.where, value=given, rule=f"[{name}]"))
            return dict.fromkeys(keys)
        out: dict[str, Any] = dict.fromkeys(keys)
        for key, kind in keys.items():
            full = f"{name}.{key}"
            if key in given:
                with self.problems.caught():
                    out[key] = self.value(full, given.pop(key), kind)
            elif kind.default is ...:
                remedy = "see the default rig file"
                self.problems.add(DescriptionError(f"{full} is missing", where=self.where, remedy=remedy))
            else:
                out[key] = kind.default
        return out

    def text(self, name: str, entry: object) -> str:
        """Take a value as written, with its source."""
        if not isinstance(entry, dict) or not {"value", "source"} <= set(entry):
            raise DescriptionError(f"{name} does not say its source", where=self.where, value=entry, rule=RULE)
        unknown = set(entry) - {"value", "source", "reason"}
        if unknown:
            raise DescriptionError(f"{name}: {sorted(unknown)[0]!r} is unknown", where=self.where, rule=RULE)
        text = str(entry["value"])
        self.sources[name] = Source(text, str(entry["source"]), str(entry.get("reason", "")))
        return text

    def value(self, name: str, entry: object, kind: Key) -> Any:  # noqa: ANN401
        """Take one value: SI, or a word."""
        text = self.text(name, entry)
        try:
            return kind.read(text)
        except (WrongValueError, DescriptionError) as error:
            what = f"{name}: {error.what}"
            raise DescriptionError(what, where=self.where, rule=error.rule, remedy=error.remedy) from None

    def finish(self) -> None:
        """Refuse what was not read, and all that is wrong with what was.

        Raises
        ------
        DescriptionError
            With everything that is wrong with the file.
        """
        for table, rest in self.content.items():
            if table in TOP:
                continue
            if table not in self.known:
                rule = f"tables: {', '.join(sorted(self.known))}"
                self.problems.add(DescriptionError(f"[{table}] is unknown", where=self.where, rule=rule))
                continue
            rule = f"keys: {', '.join(self.known[table])}"
            for key in rest if isinstance(rest, dict) else ():
                self.problems.add(DescriptionError(f"{table}.{key} is unknown", where=self.where, rule=rule))
        self.problems.tell()
