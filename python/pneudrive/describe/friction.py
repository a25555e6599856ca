"""The friction table. Which laws there are and what parameters they take is known to the core alone."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

from pydantic import field_serializer, model_validator

from pneudrive import units
from pneudrive.describe.base import Bounds, Described, EachChamber, PerChamber, Quantity, WrongValueError, wrong
from pneudrive.errors import nearest


@lru_cache(maxsize=1)
def friction_laws() -> MappingProxyType[str, dict[str, Any]]:
    """Return the core's friction laws by name.

    Each is a dict with title, source, states and parameters (key, unit, bounds, default, meaning).
    """
    from pneudrive import _core

    return MappingProxyType({law["name"]: law for law in _core.friction_laws()})


# how the core writes units -> (unit of pneudrive.units, unit preferred for reading)
_UNITS = {
    "N": ("N", "N"),
    "m/s": ("m/s", "mm/s"),
    "N s/m": ("N s/m", "N s/m"),
    "N/m": ("N/m", "N/m"),
    "-": ("", None),
}


def _parameter_quantity(parameter: dict[str, Any]) -> Quantity:
    """Make the checked quantity of one parameter of a law."""
    si_unit, written = _UNITS.get(parameter["unit"], (parameter["unit"], None))
    low, high = parameter["lower"], parameter["upper"]
    low = None if low is None or math.isinf(low) else low
    high = None if high is None or math.isinf(high) else high
    if parameter.get("open", False):
        return Quantity(si_unit, written, Bounds(above=low, below=high))
    return Quantity(si_unit, written, Bounds(at_least=low, at_most=high))


class SealPressure(Described):
    """Seal lips: friction added per gauge pressure in each chamber, with any law; stored in N/Pa."""

    table: ClassVar[str] = "friction.pressure"
    coulomb: Annotated[PerChamber, EachChamber("N/Pa", "N/bar")] = PerChamber(0.0, 0.0)
    breakaway: Annotated[PerChamber, EachChamber("N/Pa", "N/bar")] = PerChamber(0.0, 0.0)


@dataclass(frozen=True)
class Parameters(Mapping[str, float]):
    """Name -> SI value, frozen as the description that holds it."""

    pairs: tuple[tuple[str, float], ...] = ()

    def __getitem__(self, key: str) -> float:
        for name, value in self.pairs:
            if name == key:
                return value
        raise KeyError(key)

    def __iter__(self) -> Iterator[str]:
        return (name for name, _ in self.pairs)

    def __len__(self) -> int:
        return len(self.pairs)


class Friction(Described):
    """A friction law with its parameters.

    They are given as keys of their own, ``Friction(law="stribeck", coulomb="30 N", ...)``; `parameters` holds
    their SI values, defaults of the law included.
    """

    table: ClassVar[str] = "friction"
    law: str
    parameters: Parameters = Parameters()
    given: frozenset[str] = frozenset()
    pressure: SealPressure | None = None

    @field_serializer("parameters")
    def _plain(self, parameters: Parameters) -> dict[str, float]:
        return dict(parameters)

    @model_validator(mode="before")
    @classmethod
    def _by_law(cls, data: Any) -> Any:  # noqa: ANN401
        if not isinstance(data, dict):
            return data
        laws = friction_laws()
        name = data.get("law")
        if name is None:
            raise wrong("friction.law", "friction.law is missing", remedy=f"Known: {', '.join(sorted(laws))}.")
        if name not in laws:
            raise wrong("friction.law", f'friction.law = "{name}" is not known', remedy=nearest(str(name), laws))
        parameters = {p["key"]: p for p in laws[name]["parameters"]}
        rest = {key: value for key, value in data.items() if key not in {"law", "pressure"}}
        values: dict[str, float] = {}
        for key, given in rest.items():
            full = f"friction.{key}"
            if key not in parameters:
                remedy = nearest(key, [*parameters, "law", "pressure"])
                raise wrong(full, f'{full} is not a known key of law "{name}"', remedy=remedy)
            try:
                values[key] = _parameter_quantity(parameters[key]).read(given)
            except WrongValueError as error:
                raise wrong(full, f"{full}: {error.what}", rule=error.rule, remedy=error.remedy) from None
        for key, parameter in parameters.items():
            default = parameter["default"]
            if key in values or (default is not None and math.isinf(default)):
                continue  # an infinite default means that the effect is absent, and so is the value
            if default is None:
                si_unit, _ = _UNITS.get(parameter["unit"], (parameter["unit"], None))
                remedy = f"{parameter['meaning']}: {units.needed(si_unit) if si_unit else 'a number'}."
                raise wrong(f"friction.{key}", f'friction.{key} is missing; law "{name}" needs it', remedy=remedy)
            values[key] = default
        out = {"law": name, "parameters": Parameters(tuple(values.items())), "given": frozenset(rest)}
        return out | ({"pressure": data["pressure"]} if data.get("pressure") is not None else {})

    @model_validator(mode="after")
    def _levels(self) -> Friction:
        coulomb, breakaway = self.parameters.get("coulomb"), self.parameters.get("breakaway")
        if coulomb is not None and breakaway is not None and breakaway < coulomb:
            what = (
                f"friction.breakaway = {units.write(breakaway, 'N', 'N')} must not be below "
                f"friction.coulomb = {units.write(coulomb, 'N', 'N')}"
            )
            raise wrong("friction.breakaway", what, remedy="Were the two swapped?")
        return self

    def to_dict(self) -> dict[str, Any]:
        """Write the table as users would."""
        by_key = {p["key"]: p for p in friction_laws()[self.law]["parameters"]}
        out: dict[str, Any] = {"law": self.law}
        out |= {key: _parameter_quantity(by_key[key]).show(self.parameters[key]) for key in by_key if key in self.given}
        return out | ({"pressure": self.pressure.to_dict()} if self.pressure is not None else {})

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:  # noqa: ANN401 - pydantic's own
        """One alternative for each law of the core."""
        pressure = SealPressure.model_json_schema(by_alias=True)
        alternatives = []
        for name, law in friction_laws().items():
            properties: dict[str, Any] = {"law": {"const": name}, "pressure": pressure}
            for p in law["parameters"]:
                one = _parameter_quantity(p).__get_pydantic_json_schema__(None, None)
                properties[p["key"]] = one | {"title": p["meaning"]}
            required = ["law", *(p["key"] for p in law["parameters"] if p["default"] is None)]
            alternatives.append(
                {
                    "type": "object",
                    "title": law["title"],
                    "properties": properties,
                    "required": required,
                    "additionalProperties": False,
                }
            )
        return {"oneOf": alternatives}
