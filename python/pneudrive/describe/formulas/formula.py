"""Formula of a component, from a file or from Python: a mass flow or a force with parameters."""

from __future__ import annotations

import json
from functools import cached_property, partial
from typing import TYPE_CHECKING, ClassVar

from pneudrive.describe.formulas import written
from pneudrive.errors import wrong

if TYPE_CHECKING:
    from pneudrive.arrays import Keyed, Plain

GUIDE = "own-component.md"
OUTPUTS = ("mass_flow", "force")


class ComponentFormula(written.Written):
    """Formula that is the equation of a component.

    Frozen. Formulas are text in SI; ``pneudrive components KIND`` lists the available names, and
    `docs/guide/own-component.md` has examples.

    Parameters
    ----------
    kind : str
        Kind of component: "restriction/formula" or "force/formula".
    name : str
        Name in messages.
    output : str
        Formula of the kind's output: a mass flow, kg/s, or a force, N.
    parameters, let, title, source
        As in `pneudrive.FrictionLaw`.

    Raises
    ------
    DescriptionError
        Wrong syntax, unknown names, wrong units or a possible division by zero; the message gives formula and column.

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
    def of(cls, tables: Plain, entry: Keyed) -> ComponentFormula:
        """Make the formula from the tables of its file; `entry` is the core's entry of the component's kind.

        Raises
        ------
        DescriptionError
            The tables are not valid; the message gives formula and column.
        """
        wanted = entry["formula"]["output"]
        own = cls.from_tables(tables, (wanted,), entry["formula"]["unit"])
        return cls.model_validate(own | {"kind": entry["kind"], "output": own.pop(wanted)})

    @cached_property
    def entry(self) -> Plain:
        """Entry of the component in the form of `component_kinds`, with the parameters of the formula."""
        return written.core_entry("formula_component", OUTPUTS, self.kind, json.dumps(self.core()))

    def core(self) -> Plain:
        """Return the formula in the core's form, in SI."""
        return super().core() | {"output": self.output}

    def to_dict(self) -> Plain:
        """Return the tables of the formula's file."""
        return super().to_dict() | {"output": {self.entry["formula"]["output"]: self.output}}

    __hash__ = written.Written.__hash__


def formula_of(given: object, *, entry: Keyed) -> ComponentFormula:
    """Return the formula of a component, given as a formula, its tables, or ``file:NAME.toml``.

    Raises
    ------
    DescriptionError
        The value has none of these forms, or the formula is not valid.
    """
    if isinstance(given, ComponentFormula) and given.kind == entry["kind"]:
        return given
    found = written.written_as(given, "formula", partial(ComponentFormula.of, entry=entry), GUIDE)
    if found is None:
        what = "formula is missing" if given is None else f"formula = {given!r} is not a formula of a {entry['kind']}"
        raise wrong("formula", what, remedy='Write formula = "file:NAME.toml", or a table [components.NAME.formula].')
    return found
