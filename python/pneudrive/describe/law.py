"""A friction law of one's own: formulas with parameters and states, from a file or from Python.

Formulas are read, checked and run by the core; nothing here looks into them.
"""

from __future__ import annotations

import json
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from pydantic import Field, field_serializer, model_validator

from pneudrive import units
from pneudrive.describe import toml
from pneudrive.describe.base import Described, wrong
from pneudrive.describe.dependences import DEPENDENCES
from pneudrive.errors import DescriptionError, nearest, warn
from pneudrive.references import entries

#: How a drive file names a law in a file of its own, relative to the drive file.
FILE_PREFIX = "file:"
LEVELS = ("coulomb", "breakaway", "viscous")
OUTPUTS = ("force", "energy", "slip", "steady")
_SIDES = ("above", "at_least", "below", "at_most")
_PARAMETER_KEYS = ("unit", *_SIDES, "default", "meaning")
_STATE_KEYS = ("name", "unit", "scale", *_SIDES, "rate", "meaning")
_TABLES = ("schema", "name", "title", "source", "odd", "parameters", "levels", "states", "let", "output")
# what a state's name in a trajectory ends with, and a scale that fits a friction law
_STATE_UNITS = {"m": ("_m", "1e-3 m"), "m/s": ("_m_s", None), "N": ("_n", None), "s": ("_s", None), "": ("", None)}
#: Keys of the friction table that no parameter can have.
_TAKEN = ("law", "stribeck_shape", "elements", "evolution", *DEPENDENCES)


class FrictionLaw(Described):
    """A friction law written as formulas.

    Frozen. Formulas are text in SI; names in them are parameters, states, what `let` gives, and ``v`` (velocity),
    ``x`` (position), ``pressure_a``, ``pressure_b`` (gauge), ``pi``. `docs/guide/own-law.md` has the whole grammar.

    Parameters
    ----------
    name : str
        How results call it; no name of a law that pneudrive has.
    force : str
        Friction force, N, positive where it opposes v > 0; the rate of state ``z`` is ``z_rate``.
    parameters : dict
        Name -> ``{"unit": "N", "above": 0, "default": ..., "meaning": "..."}``; bounds ``above``, ``at_least``,
        ``below``, ``at_most`` and the default in that SI unit, or quantities with a unit.
    states : dict
        Name -> ``{"unit": "m", "scale": "1 mm", "rate": "v - ..."}``; they start at 0.
    let : dict
        Name -> formula, in their order.
    levels : dict
        Which parameters are ``coulomb``, ``breakaway`` and ``viscous``, on which pressure, direction, dwell and so on
        act; parameters of these names where nothing is said.
    energy, slip, steady : str, optional
        Energy stored in the states, J; rate at which the contact slips for good, m/s; force in steady sliding, N.
    odd : bool
        Claims that the force turns its sign with v and all states; checked.
    title, source : str
        What it is, and where it is from: a key of references.bib or free text.

    Raises
    ------
    DescriptionError
        With the place: syntax, unknown names, units, what could divide by zero.

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

    schema_version: int = Field(default=1, alias="schema")
    name: str
    title: str = ""
    source: str = ""
    odd: bool = False
    parameters: dict[str, dict[str, Any]] = Field(default_factory=dict)
    levels: dict[str, str] = Field(default_factory=dict)
    states: dict[str, dict[str, Any]] = Field(default_factory=dict)
    let: dict[str, str] = Field(default_factory=dict)
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
            Something is wrong; the message names file, line, formula and column.
        """
        tables, text = toml.read(path, start="docs/guide/own-law.md shows a law to start from.")
        try:
            return cls.of(tables)
        except DescriptionError as error:
            raise toml.located(error, path, text) from None

    @classmethod
    def of(cls, tables: dict[str, Any]) -> FrictionLaw:
        """Make the law from the tables of its file.

        Raises
        ------
        DescriptionError
            As `load`, without the file.
        """
        for key in tables:
            if key in OUTPUTS:
                raise wrong(key, f"{key} stands outside its table", remedy=f"Write it under [output]: {key} = ...")
            if key not in _TABLES:
                raise wrong(key, f"{key} is not a known key of a law", remedy=nearest(key, _TABLES))
        misplaced = [key for key in OUTPUTS if key in table_of(tables, "let")]
        if misplaced:
            what = f"{misplaced[0]} stands under [let]"
            raise wrong(f"let.{misplaced[0]}", what, remedy="Write [output] above it: a key belongs to the last table.")
        output = table_of(tables, "output")
        for key in output:
            if key not in OUTPUTS:
                raise wrong(f"output.{key}", f"output.{key} is not a known key", remedy=nearest(key, OUTPUTS))
        if "force" not in output:
            raise wrong("output.force", "output.force is missing", remedy='Add [output] with force = "...", in N.')
        return cls.model_validate({key: value for key, value in tables.items() if key != "output"} | output)

    @model_validator(mode="after")
    def _checked(self) -> FrictionLaw:
        if self.schema_version != 1:
            raise wrong("schema", f"schema = {self.schema_version} is not known", rule="schema = 1")
        for key in _TAKEN:
            if key in self.parameters:
                what = f'"{key}" is a key of the friction table of a drive'
                raise wrong(f"parameters.{key}", what, remedy="Choose another name for the parameter.")
        for key in self.levels:
            if key not in LEVELS:
                raise wrong(f"levels.{key}", f"levels.{key} is not a known level", remedy=nearest(key, LEVELS))
        for message in self.entry["warnings"]:
            warn(f'friction law "{self.name}": {message}')
        return self

    @field_serializer("parameters", "levels", "states", "let")
    def _plain(self, value: dict[str, Any]) -> dict[str, Any]:
        return dict(value)

    @cached_property
    def entry(self) -> dict[str, Any]:
        """The law as `friction_laws` lists those of the core: name, title, parameters, states, bristles."""
        return _entry(json.dumps(self.core()))

    def core(self) -> dict[str, Any]:
        """Return the law as the core takes it, SI throughout."""
        named = {level: level for level in LEVELS if level in self.parameters} if not self.levels else self.levels
        return {
            "name": self.name,
            "title": self.title,
            "source": self.source if self.source in entries() else "",
            "parameters": [parameter_core(key, about) for key, about in self.parameters.items()],
            "levels": dict(named),
            "states": [_state(key, about) for key, about in self.states.items()],
            "lets": [[key, formula] for key, formula in self.let.items()],
            **{key: getattr(self, key) for key in OUTPUTS},
            "odd": self.odd,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the law's file."""
        out: dict[str, Any] = {"name": self.name}
        out |= {key: value for key in ("title", "source", "odd") if (value := getattr(self, key))}
        out |= {key: dict(value) for key in ("parameters", "levels", "states", "let") if (value := getattr(self, key))}
        return out | {"output": {key: value for key in OUTPUTS if (value := getattr(self, key)) is not None}}

    def to_toml(self) -> str:
        """Write the law as a file that `load` reads back."""
        return toml.write({"schema": self.schema_version} | self.to_dict())

    def __hash__(self) -> int:
        """Laws of the same text are equal."""
        return hash(json.dumps(self.core()))


def law_of(given: object, folder: Path | None = None) -> FrictionLaw | None:
    """Return the law that ``friction.law`` means where it is one's own, or None where it is a name of the core's.

    Parameters
    ----------
    given : FrictionLaw, dict or str
        A law, its tables, or ``file:NAME.toml``.
    folder : Path, optional
        What the file's name counts from: the drive file's folder; here where nothing is said.
    """
    if isinstance(given, FrictionLaw):
        return given
    if isinstance(given, dict):
        try:
            return FrictionLaw.of(given)
        except DescriptionError as error:
            error.key = f"friction.law.{error.key}" if error.key else "friction.law"
            raise
    if isinstance(given, str) and given.startswith(FILE_PREFIX):
        return FrictionLaw.load((folder or Path()) / given.removeprefix(FILE_PREFIX).strip())
    return None


def read_law_file(friction: object, key: str, path: Path, text: str) -> None:
    """Put the law in place of the name of its file in a friction table; the name counts from the folder of `path`.

    Parameters
    ----------
    friction : object
        The table as it was read.
    key : str
        Where the table stands in the file.
    path, text : Path, str
        The file and its text, for messages.

    Raises
    ------
    DescriptionError
        There is no such file, or it holds no law.
    """
    name = friction.get("law") if isinstance(friction, dict) else None
    if not (isinstance(friction, dict) and isinstance(name, str) and name.startswith(FILE_PREFIX)):
        return
    file = path.parent / name.removeprefix(FILE_PREFIX).strip()
    if not file.is_file():
        what = f"{key}.law names a file that is not there: {file}"
        raise toml.located(wrong(f"{key}.law", what, remedy=toml.beside(file)), path, text)
    friction["law"] = FrictionLaw.load(file)


def table_of(tables: dict[str, Any], key: str) -> dict[str, Any]:
    """Return a table of a file, empty where it has none."""
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise wrong(key, f"{key} = {table!r} is not a table", remedy=f"Write [{key}].")
    return table


def parameter_core(key: str, about: dict[str, Any]) -> dict[str, Any]:
    """Return a parameter of a formula as the core takes it."""
    full = f"parameters.{key}"
    unit = _unit(full, about, _PARAMETER_KEYS)
    default = None if "default" not in about else _number(f"{full}.default", about["default"], unit)
    bounds = _bounds(full, about, unit)
    out = {"key": key, "unit": unit or "-", "bounds": bounds, "meaning": str(about.get("meaning", ""))}
    return out | {"default": default}


def _state(key: str, about: dict[str, Any]) -> dict[str, Any]:
    full = f"states.{key}"
    unit = _unit(full, about, _STATE_KEYS)
    if not isinstance(about.get("rate"), str):
        raise wrong(f"{full}.rate", f"{full}.rate is missing", remedy='Add rate = "...", a formula.')
    suffix, usual = _STATE_UNITS.get(unit, ("", None))
    scale = about.get("scale", usual)
    if scale is None:
        remedy = "Give its usual size: an error of rtol times this does not matter."
        raise wrong(f"{full}.scale", f"{full}.scale is missing", remedy=remedy)
    return {
        "key": key,
        "name": str(about.get("name", f"{key}{suffix}")),
        "unit": unit or "-",
        "scale": _number(f"{full}.scale", scale, unit),
        "bounds": _bounds(full, about, unit),
        "rate": about["rate"],
    }


def _unit(full: str, about: object, known: tuple[str, ...]) -> str:
    """Check the keys of an entry; return its unit as the package writes it, empty for a pure number."""
    if not isinstance(about, dict):
        remedy = f'Write {full.rpartition(".")[2]} = {{ unit = "N", above = 0, meaning = "..." }}.'
        raise wrong(full, f"{full} = {about!r} is not a table", remedy=remedy)
    for key in about:
        if key not in known:
            raise wrong(f"{full}.{key}", f"{full}.{key} is not a known key", remedy=nearest(str(key), known))
    unit = about.get("unit")
    if not isinstance(unit, str):
        remedy = 'Add unit = "N", an SI unit, or unit = "-" for a pure number.'
        raise wrong(f"{full}.unit", f"{full}.unit is missing", remedy=remedy)
    return units.si_name(unit)


def _bounds(full: str, about: dict[str, Any], unit: str) -> dict[str, float]:
    for sides in (_SIDES[:2], _SIDES[2:]):
        if all(side in about for side in sides):
            raise wrong(f"{full}.{sides[1]}", f"{full} has both {sides[0]} and {sides[1]}", rule="one for each side")
    return {side: _number(f"{full}.{side}", about[side], unit) for side in _SIDES if side in about}


def _number(full: str, given: object, unit: str) -> float:
    """Read a number in SI, or a quantity."""
    if isinstance(given, bool) or not isinstance(given, (int, float, str)):
        raise wrong(full, f"{full} = {given!r} is neither a number nor a quantity")
    try:
        return float(given) if not isinstance(given, str) else units.parse(given, unit)
    except DescriptionError as error:
        raise wrong(full, f"{full}: {error.what}", rule=error.rule, remedy=error.remedy) from None


@lru_cache(maxsize=256)
def _entry(text: str) -> dict[str, Any]:
    from pneudrive import _core

    try:
        return _core.formula_law(text)
    except ValueError as error:
        raise refused(error, OUTPUTS) from None


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
