"""What is written as formulas: parameters and steps of a friction law or a component, from a file or from Python.

Formulas are read, checked and run by the core; nothing here looks into them.
"""

from __future__ import annotations

import json
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from pydantic import Field, field_serializer, model_validator

from pneudrive import units
from pneudrive.describe import toml
from pneudrive.describe.base import Described, Quantity, WrongValueError, within, wrong
from pneudrive.describe.marks import Reads
from pneudrive.errors import DescriptionError, nearest, warn
from pneudrive.references import entries

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

#: How a file names formulas in a file of their own, relative to itself.
FILE_PREFIX = "file:"
_SIDES = ("above", "at_least", "below", "at_most")

Made = TypeVar("Made", bound="Written")


def _unit(given: object) -> str:
    if not isinstance(given, str):
        raise WrongValueError(f"{given!r} is no unit", remedy='Write an SI unit, unit = "N", or "-" for a pure number.')
    return units.si_name(given)


class WrittenParameter(Described):
    """A parameter of formulas: its unit, its bounds and its default, in that unit or as quantities."""

    unit: Annotated[str, Reads(_unit)] = Field(examples=["N"])
    above: Any = None
    at_least: Any = None
    below: Any = None
    at_most: Any = None
    usual: Any = Field(default=None, alias="default")
    meaning: Annotated[str, Reads(str)] = ""

    def number(self, key: str, given: object) -> float | None:
        """Return what is given under a key in SI."""
        if given is None:
            return None
        if isinstance(given, bool) or not isinstance(given, int | float | str):
            raise wrong(key, f"{key} = {given!r} is neither a number nor a quantity")
        return Quantity(self.unit).read_at(key, given) if isinstance(given, str) else float(given)

    def core(self) -> dict[str, Any]:
        """Return it as the core takes it, without its name."""
        for one, other in (_SIDES[:2], _SIDES[2:]):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                raise wrong(other, f"both {one} and {other} are given", rule="one for each side")
        bounds = {side: bound for side in _SIDES if (bound := self.number(side, getattr(self, side))) is not None}
        out = {"unit": self.unit or "-", "bounds": bounds}
        return out | {"meaning": self.meaning, "default": self.number("default", self.usual)}


def core_of(table: str, key: str, about: object, kind: type[WrittenParameter] = WrittenParameter) -> dict[str, Any]:
    """Return a parameter or state of formulas, an entry of a table, as the core takes it."""
    try:
        return {"key": key} | kind.model_validate(about).core()
    except DescriptionError as error:
        raise within(error, f"{table}.{key}") from None


class Written(Described):
    """What friction laws and components that are written as formulas have in common."""

    called: ClassVar[str]
    plain_tables: ClassVar[tuple[str, ...]] = ("parameters", "let")
    schema_version: int = Field(default=1, alias="schema")
    name: str
    title: str = ""
    source: str = ""
    parameters: dict[str, dict[str, Any]] = Field(default_factory=dict)
    let: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _checked(self) -> Written:
        if self.schema_version != 1:
            raise wrong("schema", f"schema = {self.schema_version} is not known", rule="schema = 1")
        self.check_names()
        for message in self.entry["warnings"]:
            warn(f'{self.called} "{self.name}": {message}')
        return self

    def check_names(self) -> None:
        """Refuse names that are taken, before the core looks at formulas."""

    @classmethod
    def from_tables(cls, tables: Mapping[str, Any], outputs: tuple[str, ...], unit: str) -> dict[str, Any]:
        """Return the tables of a file with the keys of [output] beside them; the first of the outputs is needed.

        Raises
        ------
        DescriptionError
            A key stands outside the table that it belongs to, is not known, or is missing.
        """
        output, needed = _table(tables, "output"), outputs[0]
        known = ["output", *(key for key in cls.keys() if key not in (*outputs, "kind"))]  # noqa: SIM118 - a method
        for key in tables:
            if key in outputs:
                raise wrong(key, f"{key} stands outside its table", remedy=f"Write it under [output]: {key} = ...")
            if key not in known:
                what = f"{key} is not a known key of a {cls.called}"
                raise wrong(key, what, remedy=nearest(key, known))
        misplaced = next((key for key in outputs if key in _table(tables, "let")), None)
        if misplaced:
            remedy = "Write [output] above it: a key belongs to the last table."
            raise wrong(f"let.{misplaced}", f"{misplaced} stands under [let]", remedy=remedy)
        for key in output:
            if key not in outputs:
                rule = f"it needs {needed}, in {unit}"
                what = f"output.{key} is not a known key"
                raise wrong(f"output.{key}", what, rule=rule, remedy=nearest(key, outputs))
        if needed not in output:
            remedy = f'Add [output] with {needed} = "...", in {unit}.'
            raise wrong(f"output.{needed}", f"output.{needed} is missing", remedy=remedy)
        return {key: value for key, value in tables.items() if key != "output"} | output

    @field_serializer("parameters", "let")
    def _plain(self, value: dict[str, Any]) -> dict[str, Any]:
        return dict(value)

    @cached_property
    def entry(self) -> dict[str, Any]:
        """What the core lists of it: name, title, parameters."""
        raise NotImplementedError

    def core(self) -> dict[str, Any]:
        """Return the formulas as the core takes them, SI throughout."""
        return {
            "name": self.name,
            "title": self.title,
            "source": self.source if self.source in entries() else "",
            "parameters": [core_of("parameters", key, about) for key, about in self.parameters.items()],
            "lets": [[key, formula] for key, formula in self.let.items()],
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the file, but the output."""
        out: dict[str, Any] = {"name": self.name}
        out |= {key: value for key in ("title", "source") if (value := getattr(self, key))}
        return out | {key: dict(value) for key in self.plain_tables if (value := getattr(self, key))}

    def __hash__(self) -> int:
        """Formulas of the same text are equal."""
        return hash(json.dumps(self.core()))


def _table(tables: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise wrong(key, f"{key} = {table!r} is not a table", remedy=f"Write [{key}].")
    return table


def load(of: Callable[[dict[str, Any]], Made], path: str | Path, guide: str) -> Made:
    """Read formulas from a TOML file; `of` makes them of its tables.

    Raises
    ------
    DescriptionError
        Something is wrong; the message names file, line, formula and column.
    """
    tables, text = toml.read(path, start=f"docs/guide/{guide} shows one to start from.")
    with toml.locating(path, text):
        return of(tables)


def written_as(
    given: object, slot: str, of: Callable[[dict[str, Any]], Made], guide: str, folder: Path | None = None
) -> Made | None:
    """Return the formulas that a key means: their tables, or ``file:NAME.toml``; None where it is neither.

    Raises
    ------
    DescriptionError
        Something in them is wrong.
    """
    if isinstance(given, dict):
        try:
            return of(given)
        except DescriptionError as error:
            error.key = f"{slot}.{error.key}" if error.key else slot
            raise
    if isinstance(given, str) and given.startswith(FILE_PREFIX):
        return load(of, (folder or Path()) / given.removeprefix(FILE_PREFIX).strip(), guide)
    return None


def read_file(table: object, slot: str, key: str, make: Callable[[str, Path], Written | None], path: Path) -> None:
    """Put formulas in place of the name of their file, which counts from the folder of the file that names it.

    Parameters
    ----------
    table : object
        The table as it was read.
    slot : str
        Its key that names the file.
    key : str
        Where the table stands in the file.
    make : callable
        Of the name and the folder.
    path : Path
        The file that has the table.

    Raises
    ------
    DescriptionError
        There is no such file, or something in it is wrong.
    """
    name = table.get(slot) if isinstance(table, dict) else None
    if not (isinstance(table, dict) and isinstance(name, str) and name.startswith(FILE_PREFIX)):
        return
    file = path.parent / name.removeprefix(FILE_PREFIX).strip()
    if not file.is_file():
        raise wrong(f"{key}.{slot}", f"{key}.{slot} names a file that is not there: {file}", remedy=toml.beside(file))
    table[slot] = make(name, path.parent)


def refused(error: ValueError, outputs: tuple[str, ...]) -> DescriptionError:
    """Return what the core says of formulas as an error with its key; `outputs` stand under [output]."""
    if len(error.args) != 8:
        return DescriptionError(str(error))
    what, key, formula, line, column, shown, caret, remedy = error.args
    value = None
    if line:
        place = f"line {line}, column {column}" if "\n" in formula else f"column {column}"
        what = f"{what} ({place})"
        value = f"{shown}\n    {caret}"
    full = f"output.{key}" if key in outputs else key
    out = DescriptionError(f"{full}: {what}", value=value, remedy=remedy or None)
    out.key = full
    return out
