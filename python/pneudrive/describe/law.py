"""A friction law of one's own: formulas with parameters and states, from a file or from Python."""

from __future__ import annotations

import json
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field, field_serializer

from pneudrive.describe import toml, written
from pneudrive.describe.base import wrong
from pneudrive.describe.dependences import DEPENDENCES
from pneudrive.describe.marks import Reads
from pneudrive.errors import nearest

if TYPE_CHECKING:
    from pathlib import Path

LEVELS = ("coulomb", "breakaway", "viscous")
OUTPUTS = ("force", "energy", "slip", "steady")
GUIDE = "own-law.md"
# what a state's name in a trajectory ends with, and a scale that fits a friction law
_STATE_UNITS = {"m": ("_m", "1e-3 m"), "m/s": ("_m_s", None), "N": ("_n", None), "s": ("_s", None), "": ("", None)}
#: Keys of the friction table that no parameter can have.
_TAKEN = ("law", "stribeck_shape", "elements", "evolution", *DEPENDENCES)


class WrittenState(written.WrittenParameter):
    """A state of a friction law: beside its unit the formula of its rate, its usual size, its name in a trajectory."""

    name: Annotated[str | None, Reads(str)] = None
    scale: Any = None
    rate: str

    def core(self) -> dict[str, Any]:
        """Return it as the core takes it, without its key."""
        out = super().core()
        usual = _STATE_UNITS.get(self.unit, ("", None))[1]
        if self.scale is None and usual is None:
            remedy = "Give its usual size: an error of rtol times this does not matter."
            raise wrong("scale", "scale is missing", remedy=remedy)
        scale = 1e-3 if self.scale is None else self.number("scale", self.scale)
        return {"unit": out["unit"], "bounds": out["bounds"], "scale": scale, "rate": self.rate}


class FrictionLaw(written.Written):
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
            Something is wrong; the message names file, line, formula and column.
        """
        return written.load(cls.of, path, GUIDE)

    @classmethod
    def of(cls, tables: dict[str, Any]) -> FrictionLaw:
        """Make the law from the tables of its file.

        Raises
        ------
        DescriptionError
            As `load`, without the file.
        """
        return cls.model_validate(cls.from_tables(tables, OUTPUTS, "N"))

    def check_names(self) -> None:
        """Refuse parameters and levels that a friction table could not have."""
        for key in _TAKEN:
            if key in self.parameters:
                what = f'"{key}" is a key of the friction table of a drive'
                raise wrong(f"parameters.{key}", what, remedy="Choose another name for the parameter.")
        for key in self.levels:
            if key not in LEVELS:
                raise wrong(f"levels.{key}", f"levels.{key} is not a known level", remedy=nearest(key, LEVELS))

    @field_serializer("levels", "states")
    def _plain_tables(self, value: dict[str, Any]) -> dict[str, Any]:
        return dict(value)

    @cached_property
    def entry(self) -> dict[str, Any]:
        """The law as `friction_laws` lists those of the core: name, title, parameters, states, bristles."""
        return _entry(json.dumps(self.core()))

    def core(self) -> dict[str, Any]:
        """Return the law as the core takes it, SI throughout."""
        named = {level: level for level in LEVELS if level in self.parameters} if not self.levels else self.levels
        states = []
        for key, about in self.states.items():
            state = written.core_of("states", key, about, WrittenState)
            suffix = _STATE_UNITS.get(state["unit"].removeprefix("-"), ("", None))[0]
            states.append(state | {"name": str(about.get("name", f"{key}{suffix}"))})
        out = super().core() | {"levels": dict(named), "states": states, "odd": self.odd}
        return out | {key: getattr(self, key) for key in OUTPUTS}

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the law's file."""
        odd = {"odd": True} if self.odd else {}
        output = {key: value for key in OUTPUTS if (value := getattr(self, key)) is not None}
        return super().to_dict() | odd | {"output": output}

    def to_toml(self) -> str:
        """Write the law as a file that `load` reads back."""
        return toml.write({"schema": self.schema_version} | self.to_dict())

    __hash__ = written.Written.__hash__


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
    return written.written_as(given, "friction.law", FrictionLaw.of, GUIDE, folder)


@lru_cache(maxsize=256)
def _entry(text: str) -> dict[str, Any]:
    from pneudrive import _core

    try:
        return _core.formula_law(text)
    except ValueError as error:
        raise written.refused(error, OUTPUTS) from None
