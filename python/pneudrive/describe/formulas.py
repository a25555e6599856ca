"""Friction laws and components written as formulas, from a file or from Python: parameters and intermediate values.

The core reads, checks and runs the formulas.
"""

from __future__ import annotations

import json
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from pydantic import Field, model_validator

from pneudrive import _core, units
from pneudrive.describe.base import Described, DescribedFile
from pneudrive.describe.files import toml
from pneudrive.describe.marks import Quantity, Reads, Text
from pneudrive.describe.tables.dependences import DEPENDENCES
from pneudrive.errors import DescriptionError, invalid, nearest, warn, within, wrong
from pneudrive.references import entries

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.arrays import Keyed, Plain

#: Prefix of the path of a formula file. The path is relative to the file that contains the path.
FILE_PREFIX = "file:"
_SIDES = ("above", "at_least", "below", "at_most")

Made = TypeVar("Made", bound="Written")


def _unit(given: object) -> str:
    if not isinstance(given, str):
        raise DescriptionError.of("describe.not-a-unit", given=given)
    return units.si_name(given)


class WrittenParameter(Described):
    """Parameter of formulas: unit, bounds and default. Bounds and default without a unit are in this unit."""

    unit: Annotated[str, Reads(_unit)] = Field(examples=["N"])
    above: Any = None
    at_least: Any = None
    below: Any = None
    at_most: Any = None
    usual: Any = Field(default=None, alias="default")
    meaning: Text = ""

    def number(self, key: str, given: object) -> float | None:
        """Return a bound or the default in SI, from a number or a quantity. Errors have the key `key`."""
        if given is None:
            return None
        if isinstance(given, bool) or not isinstance(given, int | float | str):
            raise wrong(key, f"{key} = {given!r} is neither a number nor a quantity")
        return Quantity(self.unit).read_at(key, given) if isinstance(given, str) else float(given)

    def core(self) -> Plain:
        """Return the parameter in the core's form, without its name."""
        for one, other in (_SIDES[:2], _SIDES[2:]):
            if getattr(self, one) is not None and getattr(self, other) is not None:
                raise wrong(other, f"both {one} and {other} are given", rule="at most one lower and one upper bound")
        bounds = {side: bound for side in _SIDES if (bound := self.number(side, getattr(self, side))) is not None}
        out = {"unit": self.unit or "-", "bounds": bounds}
        return out | {"meaning": self.meaning, "default": self.number("default", self.usual)}


def core_of(table: str, key: str, about: object, kind: type[WrittenParameter] = WrittenParameter) -> Plain:
    """Return a parameter or a state, which is an entry of a table, in the core's form."""
    try:
        return {"key": key} | kind.model_validate(about).core()
    except DescriptionError as error:
        raise within(error, f"{table}.{key}") from None


class Written(DescribedFile):
    """Base of friction laws and components that are written as formulas."""

    called: ClassVar[str]
    plain_tables: ClassVar[tuple[str, ...]] = ("parameters", "let")
    name: str
    title: str = ""
    source: str = ""
    parameters: dict[str, dict[str, Any]] = Field(default_factory=dict)
    let: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _checked(self) -> Written:
        for message in self.entry["warnings"]:
            warn(f'{self.called} "{self.name}": {message}')
        return self

    @classmethod
    def from_tables(cls, tables: Keyed, outputs: tuple[str, ...], unit: str) -> Plain:
        """Return the tables of a file, with the keys of [output] at the top level; the first output must be given.

        Raises
        ------
        DescriptionError
            A key is outside its table, unknown or missing.
        """
        output, needed = _table(tables, "output"), outputs[0]
        known = ["output", *(key for key in cls.keys() if key not in (*outputs, "kind"))]  # noqa: SIM118 - a method
        for key in tables:
            if key in outputs:
                raise wrong(key, f"{key} is outside its table", remedy=f"Write it under [output]: {key} = ...")
            if key not in known:
                raise invalid(key, "describe.unknown-key-of", key=key, called=cls.called, remedy=nearest(key, known))
        misplaced = next((key for key in outputs if key in _table(tables, "let")), None)
        if misplaced:
            raise invalid(f"let.{misplaced}", "describe.output-under-let", misplaced=misplaced)
        for key in output:
            if key not in outputs:
                rule = f"[output] needs {needed}, in {unit}"
                what = f"output.{key} is not a known key"
                raise wrong(f"output.{key}", what, rule=rule, remedy=nearest(key, outputs))
        if needed not in output:
            raise invalid(f"output.{needed}", "describe.no-output", needed=needed, unit=unit)
        return {key: value for key, value in tables.items() if key != "output"} | output

    @cached_property
    def entry(self) -> Plain:
        """Entry in the core's form: name, title, parameters."""
        raise NotImplementedError

    def core(self) -> Plain:
        """Return the formulas in the core's form, in SI."""
        return {
            "name": self.name,
            "title": self.title,
            "source": self.source if self.source in entries() else "",
            "parameters": [core_of("parameters", key, about) for key, about in self.parameters.items()],
            "lets": [[key, formula] for key, formula in self.let.items()],
        }

    def to_dict(self) -> Plain:
        """Return the tables of the file except [output]."""
        out: Plain = {"name": self.name}
        out |= {key: value for key in ("title", "source") if (value := getattr(self, key))}
        return out | {key: dict(value) for key in self.plain_tables if (value := getattr(self, key))}

    def __hash__(self) -> int:
        """Return the hash of the formulas in the core's form."""
        return hash(json.dumps(self.core()))


def _table(tables: Keyed, key: str) -> Plain:
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise wrong(key, f"{key} = {table!r} is not a table", remedy=f"Write [{key}].")
    return table


def load(of: Callable[[Plain], Made], path: str | Path, guide: str) -> Made:
    """Read formulas from a TOML file; `of` makes the object from its tables.

    Raises
    ------
    DescriptionError
        The file is not valid; the message gives file, line, formula and column.
    """
    return toml.load(of, path, start=f"docs/guide/{guide} shows an example.")


def written_as(given: object, slot: str, of: Callable[[Plain], Made], guide: str) -> Made | None:
    """Return formulas given as tables or as ``file:NAME.toml``; None for other values.

    Raises
    ------
    DescriptionError
        The formulas are not valid.
    """
    if isinstance(given, dict):
        try:
            return of(given)
        except DescriptionError as error:
            error.key = f"{slot}.{error.key}" if error.key else slot
            raise
    if isinstance(given, str) and given.startswith(FILE_PREFIX):
        return load(of, given.removeprefix(FILE_PREFIX).strip(), guide)
    return None


def read_file(table: object, slot: str, key: str, make: Callable[[str], Written | None], path: Path) -> None:
    """Replace the name of a formula file by its formulas. The name is relative to the folder of `path`.

    Parameters
    ----------
    table : object
        Table, as read from its file.
    slot : str
        Key of the entry that names the formula file.
    key : str
        Key of the table in its file.
    make : callable
        Returns the formulas from the name of their file.
    path : Path
        File that contains the table.

    Raises
    ------
    DescriptionError
        The file does not exist or is not valid.
    """
    if not isinstance(table, dict) or not str(table.get(slot)).startswith(FILE_PREFIX):
        return
    file = path.parent / table[slot].removeprefix(FILE_PREFIX).strip()
    if not file.is_file():
        raise wrong(f"{key}.{slot}", f"{key}.{slot} names a file that does not exist: {file}", remedy=toml.beside(file))
    table[slot] = make(f"{FILE_PREFIX}{file}")


@lru_cache(maxsize=256)
def core_entry(read: str, outputs: tuple[str, ...], *texts: str) -> Plain:
    """Return the entry that the core makes from formulas.

    `read` names the function of the core that reads the formulas, and `outputs` are the possible keys of [output].

    Raises
    ------
    DescriptionError
        The core rejects the formulas.
    """
    try:
        return getattr(_core, read)(*texts)
    except ValueError as error:
        if len(error.args) != 8:
            raise DescriptionError(str(error)) from None
        what, key, formula, line, column, shown, caret, remedy = error.args
        value = None
        if line:
            place = f"line {line}, column {column}" if "\n" in formula else f"column {column}"
            what = f"{what} ({place})"
            value = f"{shown}\n    {caret}"
        full = f"output.{key}" if key in outputs else key
        refusal = DescriptionError(f"{full}: {what}", value=value, remedy=remedy or None)
        refusal.key = full
        raise refusal from None


# --- Friction laws: formulas with parameters and states.

LEVELS = ("coulomb", "breakaway", "viscous")
OUTPUTS = ("force", "energy", "slip", "steady")
GUIDE = "own-law.md"
#: Units of states whose default names in a trajectory contain the unit.
_NAMED_UNITS = ("m", "m/s", "N", "s")
#: Keys of the friction table that are not allowed as names of parameters.
_TAKEN = ("law", "stribeck_shape", "elements", "evolution", *DEPENDENCES)


class WrittenState(WrittenParameter):
    """State of a friction law: unit, formula of its rate, usual size, name in a trajectory."""

    name: Annotated[str | None, Reads(str)] = None
    scale: Any = None
    rate: str

    def core(self) -> Plain:
        """Return the state in the core's form, without its key."""
        out = super().core()
        if self.scale is None and self.unit != "m":
            raise invalid("scale", "describe.no-scale")
        scale = 1e-3 if self.scale is None else self.number("scale", self.scale)
        return {"unit": out["unit"], "bounds": out["bounds"], "scale": scale, "rate": self.rate}


class FrictionLaw(Written):
    """Friction law written as formulas.

    A law is frozen. Formulas are texts, and all their quantities are in SI. They may contain parameters, states and
    names in `let`. Further names are ``v`` (velocity), ``x`` (position), ``pressure_a`` and ``pressure_b`` (gauge), and
    ``pi``. `docs/guide/own-law.md` has the whole grammar.

    Parameters
    ----------
    name : str
        Name in results; not the name of a built-in law.
    force : str
        Formula of the friction force in N, positive if it opposes v > 0. The rate of state ``z`` is ``z_rate``.
    parameters : dict
        Name -> ``{"unit": "N", "above": 0, "default": ..., "meaning": "..."}``. Bounds are ``above``, ``at_least``,
        ``below`` and ``at_most``. Bounds and default are numbers in the SI unit ``unit``, or quantities with a unit.
    states : dict
        Name -> ``{"unit": "m", "scale": "1 mm", "rate": "v - ..."}``. States start at 0.
    let : dict
        Name -> formula of an intermediate value. The formulas are evaluated in this order.
    levels : dict
        Names of the parameters with the roles ``coulomb``, ``breakaway`` and ``viscous``. Modifiers act on these
        parameters. By default, these are the parameters that have the names of the roles.
    energy, slip, steady : str, optional
        Formulas of the energy stored in the states in J, of the rate of irreversible slip in m/s, and of the force in
        steady sliding in N.
    odd : bool
        Whether the force is an odd function of v and all states. The core checks this.
    title, source : str
        Title, and source: a key of references.bib or free text.

    Raises
    ------
    DescriptionError
        Wrong syntax, unknown names, wrong units or a possible division by zero. The message gives formula and column.

    Examples
    --------
    >>> law = FrictionLaw(
    ...     name="smooth-coulomb",
    ...     parameters={"coulomb": {"unit": "N", "above": 0}, "v0": {"unit": "m/s", "above": 0, "default": "1 mm/s"}},
    ...     force="coulomb*tanh(v/v0)",
    ... )
    >>> law.entry["parameters"][1]["default"]
    0.001
    """

    called: ClassVar[str] = "friction law"
    plain_tables: ClassVar[tuple[str, ...]] = ("parameters", "levels", "states", "let")
    odd: bool = False
    levels: dict[str, str] = Field(default_factory=dict)
    states: dict[str, dict[str, Any]] = Field(default_factory=dict)
    force: str
    energy: str | None = None
    slip: str | None = None
    steady: str | None = None

    @classmethod
    def load(cls, path: str | Path) -> FrictionLaw:
        """Read a law from a TOML file.

        Raises
        ------
        DescriptionError
            The file is not valid; the message gives file, line, formula and column.
        """
        return load(cls.of, path, GUIDE)

    @classmethod
    def of(cls, tables: Plain) -> FrictionLaw:
        """Make the law from the tables of its file.

        Raises
        ------
        DescriptionError
            As for `load`, but the message does not name the file.
        """
        return cls.model_validate(cls.from_tables(tables, OUTPUTS, "N"))

    @cached_property
    def entry(self) -> Plain:
        """Entry of the law in the form of `friction_laws`: name, title, parameters, states, bristles."""
        return core_entry("formula_law", OUTPUTS, json.dumps(self.core()))

    def core(self) -> Plain:
        """Return the law in the core's form, in SI. Names that a friction table does not allow raise an error."""
        for key in _TAKEN:
            if key in self.parameters:
                raise invalid(f"parameters.{key}", "describe.key-of-friction", key=key)
        for key in self.levels:
            if key not in LEVELS:
                raise wrong(f"levels.{key}", f"levels.{key} is not a known level", remedy=nearest(key, LEVELS))
        named = self.levels or {level: level for level in LEVELS if level in self.parameters}
        states = []
        for key, about in self.states.items():
            state = core_of("states", key, about, WrittenState)
            usual = units.column_name(key, state["unit"]) if state["unit"] in _NAMED_UNITS else key
            states.append(state | {"name": str(about.get("name", usual))})
        out = super().core() | {"levels": dict(named), "states": states, "odd": self.odd}
        return out | {key: getattr(self, key) for key in OUTPUTS}

    def to_dict(self) -> Plain:
        """Return the tables of the law's file."""
        odd = {"odd": True} if self.odd else {}
        output = {key: value for key in OUTPUTS if (value := getattr(self, key)) is not None}
        return super().to_dict() | odd | {"output": output}


def law_of(given: object) -> FrictionLaw | None:
    """Return the custom law that ``friction.law`` names, or None for a built-in law.

    Parameters
    ----------
    given : FrictionLaw, dict or str
        A law, its tables, or ``file:NAME.toml``.
    """
    return given if isinstance(given, FrictionLaw) else written_as(given, "friction.law", FrictionLaw.of, GUIDE)


# --- Formula of a component: a mass flow or a force with parameters.

#: Guide to formulas of components, and their outputs.
COMPONENT_GUIDE, COMPONENT_OUTPUTS = "own-component.md", ("mass_flow", "force")


class ComponentFormula(Written):
    """Formula of the mass flow or the force of a component.

    A formula is frozen. It is a text, and all its quantities are in SI. ``pneudrive components KIND`` lists the
    available names, and `docs/guide/own-component.md` has examples.

    Parameters
    ----------
    kind : str
        Kind of component: "restriction/formula" or "force/formula".
    name : str
        Name in messages.
    output : str
        Formula of the kind's output: a mass flow in kg/s, or a force in N.
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
        return core_entry("formula_component", COMPONENT_OUTPUTS, self.kind, json.dumps(self.core()))

    def core(self) -> Plain:
        """Return the formula in the core's form, in SI."""
        return super().core() | {"output": self.output}

    def to_dict(self) -> Plain:
        """Return the tables of the formula's file."""
        return super().to_dict() | {"output": {self.entry["formula"]["output"]: self.output}}

    __hash__ = Written.__hash__


def formula_of(given: object, *, entry: Keyed) -> ComponentFormula:
    """Return the formula of a component, given as a formula, its tables, or ``file:NAME.toml``.

    Raises
    ------
    DescriptionError
        The value has none of these forms, or the formula is not valid.
    """
    if isinstance(given, ComponentFormula) and given.kind == entry["kind"]:
        return given
    found = written_as(given, "formula", partial(ComponentFormula.of, entry=entry), COMPONENT_GUIDE)
    if found is None:
        what = "formula is missing" if given is None else f"formula = {given!r} is not a formula of a {entry['kind']}"
        raise wrong("formula", what, remedy='Write formula = "file:NAME.toml", or a table [components.NAME.formula].')
    return found
