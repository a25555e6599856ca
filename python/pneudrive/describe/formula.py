"""The formula of a component: a mass flow or a force with parameters of its own, from a file or from Python."""

from __future__ import annotations

import json
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Any, ClassVar

from pneudrive.describe import written
from pneudrive.describe.base import wrong

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

GUIDE = "own-component.md"


class ComponentFormula(written.Written):
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

    called: ClassVar[str] = "formula"
    kind: str
    output: str

    @classmethod
    def load(cls, path: str | Path, entry: Mapping[str, Any]) -> ComponentFormula:
        """Read the formula of a component from a TOML file; `entry` is what the core lists of the component's kind.

        Raises
        ------
        DescriptionError
            Something is wrong; the message names file, line, formula and column.
        """
        return written.load(partial(cls.of, entry=entry), path, GUIDE)

    @classmethod
    def of(cls, tables: dict[str, Any], entry: Mapping[str, Any]) -> ComponentFormula:
        """Make the formula from the tables of its file.

        Raises
        ------
        DescriptionError
            As `load`, without the file.
        """
        wanted = entry["formula"]["output"]
        own = cls.from_tables(tables, (wanted,), entry["formula"]["unit"])
        return cls.model_validate(own | {"kind": entry["kind"], "output": own.pop(wanted)})

    @cached_property
    def entry(self) -> dict[str, Any]:
        """The component as `component_kinds` lists those of the core, with the parameters of the formula."""
        return _entry(self.kind, json.dumps(self.core()))

    def core(self) -> dict[str, Any]:
        """Return the formula as the core takes it, SI throughout."""
        return super().core() | {"output": self.output}

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the formula's file."""
        return super().to_dict() | {"output": {self.entry["formula"]["output"]: self.output}}

    __hash__ = written.Written.__hash__


def formula_of(given: object, entry: Mapping[str, Any], folder: Path | None = None) -> ComponentFormula:
    """Return the formula that a component of a kind is given: itself, its tables, or ``file:NAME.toml``.

    Raises
    ------
    DescriptionError
        It is none, or something in it is wrong.
    """
    if isinstance(given, ComponentFormula) and given.kind == entry["kind"]:
        return given
    found = written.written_as(given, "formula", partial(ComponentFormula.of, entry=entry), GUIDE, folder)
    if found is None:
        what = "formula is missing" if given is None else f"formula = {given!r} is no formula of a {entry['kind']}"
        raise wrong("formula", what, remedy='Write formula = "file:NAME.toml", or a table [components.NAME.formula].')
    return found


@lru_cache(maxsize=256)
def _entry(kind: str, text: str) -> dict[str, Any]:
    from pneudrive import _core

    try:
        return _core.formula_component(kind, text)
    except ValueError as error:
        raise written.refused(error, ("mass_flow", "force")) from None
