"""Custom friction laws: formulas with parameters and states, from a file or from Python."""

from __future__ import annotations

import json
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field

from pneudrive.arrays import Plain
from pneudrive.describe.formulas import written
from pneudrive.describe.marks import Reads
from pneudrive.describe.tables.dependences import DEPENDENCES
from pneudrive.errors import invalid, nearest, wrong

LEVELS = ("coulomb", "breakaway", "viscous")
OUTPUTS = ("force", "energy", "slip", "steady")
GUIDE = "own-law.md"
# unit of a state -> suffix of its name in a trajectory, and a usual scale
_STATE_UNITS = {"m/s": ("_m_s", None), "N": ("_n", None), "s": ("_s", None), "": ("", None)}
_STATE_UNITS |= {"m": ("_m", "1e-3 m")}
#: Keys of the friction table that are not allowed as names of parameters.
_TAKEN = ("law", "stribeck_shape", "elements", "evolution", *DEPENDENCES)


class WrittenState(written.WrittenParameter):
    """State of a friction law: unit, formula of its rate, usual size, name in a trajectory."""

    name: Annotated[str | None, Reads(str)] = None
    scale: Any = None
    rate: str

    def core(self) -> Plain:
        """Return the state in the core's form, without its key."""
        out = super().core()
        usual = _STATE_UNITS.get(self.unit, ("", None))[1]
        if self.scale is None and usual is None:
            raise invalid("scale", "describe.no-scale")
        scale = 1e-3 if self.scale is None else self.number("scale", self.scale)
        return {"unit": out["unit"], "bounds": out["bounds"], "scale": scale, "rate": self.rate}


class FrictionLaw(written.Written):
    """Friction law written as formulas.

    A law is frozen. Formulas are texts, and all their quantities are in SI. They may contain parameters, states and
    names of `let`. Further names are ``v`` (velocity), ``x`` (position), ``pressure_a`` and ``pressure_b`` (gauge), and
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
        return written.load(cls.of, path, GUIDE)

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
        return written.core_entry("formula_law", OUTPUTS, json.dumps(self.core()))

    def core(self) -> Plain:
        """Return the law in the core's form, in SI. Names that a friction table does not allow raise an error."""
        for key in _TAKEN:
            if key in self.parameters:
                raise invalid(f"parameters.{key}", "describe.key-of-friction", key=key)
        for key in self.levels:
            if key not in LEVELS:
                raise wrong(f"levels.{key}", f"levels.{key} is not a known level", remedy=nearest(key, LEVELS))
        named = {level: level for level in LEVELS if level in self.parameters} if not self.levels else self.levels
        states = []
        for key, about in self.states.items():
            state = written.core_of("states", key, about, WrittenState)
            suffix = _STATE_UNITS.get(state["unit"].removeprefix("-"), ("", None))[0]
            states.append(state | {"name": str(about.get("name", f"{key}{suffix}"))})
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
    return given if isinstance(given, FrictionLaw) else written.written_as(given, "friction.law", FrictionLaw.of, GUIDE)
