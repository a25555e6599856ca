"""The formula of a component: a mass flow or a force with parameters of its own, from a file or from Python.

Formulas are read, checked and run by the core; nothing here looks into them.
"""

from __future__ import annotations

import json
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field, field_serializer, model_validator

from pneudrive.describe import toml
from pneudrive.describe.base import Described, wrong
from pneudrive.describe.law import FILE_PREFIX, parameter_core, refused, table_of
from pneudrive.errors import DescriptionError, nearest, warn
from pneudrive.references import entries

if TYPE_CHECKING:
    from collections.abc import Mapping

_TABLES = ("schema", "name", "title", "source", "parameters", "let", "output")


class ComponentFormula(Described):
    """A formula that is the equation of a component.

    Frozen. Formulas are text in SI; ``pneudrive components KIND`` lists the names that they find, and
    `docs/guide/own-component.md` has examples.

    Parameters
    ----------
    kind : str
        The kind of component: "restriction/formula" or "force/formula".
    name : str
        How messages call it.
    output : str
        The formula of what its kind asks for: a mass flow, kg/s, or a force, N.
    parameters, let, title, source
        As those of `pneudrive.FrictionLaw`.

    Raises
    ------
    DescriptionError
        With the place: syntax, unknown names, units, what could divide by zero.

    Examples
    --------
    >>> spring = ComponentFormula(
    ...     kind="force/formula",
    ...     name="soft-wall",
    ...     parameters={"stiffness": {"unit": "N/m", "above": 0}, "wall": {"unit": "m"}},
    ...     output="-stiffness*max(x - wall, 0)",
    ... )
    >>> [one["key"] for one in spring.entry["parameters"]]
    ['stiffness', 'wall']
    """

    schema_version: int = Field(default=1, alias="schema")
    kind: str
    name: str
    title: str = ""
    source: str = ""
    parameters: dict[str, dict[str, Any]] = Field(default_factory=dict)
    let: dict[str, str] = Field(default_factory=dict)
    output: str

    @classmethod
    def load(cls, path: str | Path, entry: Mapping[str, Any]) -> ComponentFormula:
        """Read the formula of a component from a TOML file; `entry` is what the core lists of the component's kind.

        Raises
        ------
        DescriptionError
            Something is wrong; the message names file, line, formula and column.
        """
        tables, text = toml.read(path, start="docs/guide/own-component.md shows a formula to start from.")
        try:
            return cls.of(tables, entry)
        except DescriptionError as error:
            raise toml.located(error, path, text) from None

    @classmethod
    def of(cls, tables: dict[str, Any], entry: Mapping[str, Any]) -> ComponentFormula:
        """Make the formula from the tables of its file.

        Raises
        ------
        DescriptionError
            As `load`, without the file.
        """
        for key in tables:
            if key not in _TABLES:
                raise wrong(key, f"{key} is not a known key of a formula", remedy=nearest(key, _TABLES))
        wanted, unit = entry["formula"]["output"], entry["formula"]["unit"]
        output = table_of(tables, "output")
        for key in output:
            if key != wanted:
                remedy = f"A {entry['kind']} needs {wanted}, in {unit}."
                raise wrong(f"output.{key}", f"output.{key} is not a known key", remedy=remedy)
        if wanted not in output:
            remedy = f'Add [output] with {wanted} = "...", in {unit}.'
            raise wrong(f"output.{wanted}", f"output.{wanted} is missing", remedy=remedy)
        own = {key: value for key, value in tables.items() if key != "output"}
        return cls.model_validate(own | {"kind": entry["kind"], "output": output[wanted]})

    @model_validator(mode="after")
    def _checked(self) -> ComponentFormula:
        if self.schema_version != 1:
            raise wrong("schema", f"schema = {self.schema_version} is not known", rule="schema = 1")
        for message in self.entry["warnings"]:
            warn(f'formula "{self.name}": {message}')
        return self

    @field_serializer("parameters", "let")
    def _plain(self, value: dict[str, Any]) -> dict[str, Any]:
        return dict(value)

    @cached_property
    def entry(self) -> dict[str, Any]:
        """The component as `component_kinds` lists those of the core, with the parameters of the formula."""
        return _entry(self.kind, json.dumps(self.core()))

    def core(self) -> dict[str, Any]:
        """Return the formula as the core takes it, SI throughout."""
        return {
            "name": self.name,
            "title": self.title,
            "source": self.source if self.source in entries() else "",
            "parameters": [parameter_core(key, about) for key, about in self.parameters.items()],
            "lets": [[key, formula] for key, formula in self.let.items()],
            "output": self.output,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the formula's file."""
        out: dict[str, Any] = {"name": self.name}
        out |= {key: value for key in ("title", "source") if (value := getattr(self, key))}
        out |= {key: dict(value) for key in ("parameters", "let") if (value := getattr(self, key))}
        return out | {"output": {self.entry["formula"]["output"]: self.output}}

    def __hash__(self) -> int:
        """Formulas of the same text are equal."""
        return hash((self.kind, json.dumps(self.core())))


def formula_of(given: object, entry: Mapping[str, Any]) -> ComponentFormula:
    """Return the formula that a component of a kind is given: itself, its tables, or ``file:NAME.toml``.

    Raises
    ------
    DescriptionError
        It is none, or something in it is wrong.
    """
    if isinstance(given, ComponentFormula) and given.kind == entry["kind"]:
        return given
    try:
        if isinstance(given, dict):
            return ComponentFormula.of(given, entry)
    except DescriptionError as error:
        error.key = f"formula.{error.key}" if error.key else "formula"
        raise
    if isinstance(given, str) and given.startswith(FILE_PREFIX):
        return ComponentFormula.load(given.removeprefix(FILE_PREFIX).strip(), entry)
    what = "formula is missing" if given is None else f"formula = {given!r} is no formula of a {entry['kind']}"
    raise wrong("formula", what, remedy='Write formula = "file:NAME.toml", or a table [components.NAME.formula].')


def read_formula_file(component: dict[str, Any], key: str, entry: Mapping[str, Any], path: Path, text: str) -> None:
    """Put the formula in place of the name of its file in a component's table; it counts from the folder of `path`.

    Parameters
    ----------
    component, key : dict, str
        The table as it was read, and where it stands in the file.
    entry : Mapping
        What the core lists of its kind.
    path, text : Path, str
        The file and its text, for messages.

    Raises
    ------
    DescriptionError
        There is no such file, or it holds no formula of this kind.
    """
    name = component.get("formula")
    if not (entry["formula"] and isinstance(name, str) and name.startswith(FILE_PREFIX)):
        return
    file = path.parent / name.removeprefix(FILE_PREFIX).strip()
    if not file.is_file():
        what = f"{key}.formula names a file that is not there: {file}"
        raise toml.located(wrong(f"{key}.formula", what, remedy=toml.beside(file)), path, text)
    component["formula"] = ComponentFormula.load(file, entry)


@lru_cache(maxsize=256)
def _entry(kind: str, text: str) -> dict[str, Any]:
    from pneudrive import _core

    try:
        return _core.formula_component(kind, text)
    except ValueError as error:
        raise refused(error, ("mass_flow", "force")) from None
