"""Quantities of a description: their bounds, how they are read and shown, and the types of the usual ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from pydantic_core import core_schema

from pneudrive import units
from pneudrive.describe.keys import WrongValueError, wrong
from pneudrive.errors import DescriptionError, nearest
from pneudrive.files.bounds import beyond


@dataclass(frozen=True)
class Bounds:
    """Open or closed bounds of an SI value."""

    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    bound: str | None = None  # bound of `pneudrive.files.bounds`, which users can raise

    def broken(self, value: float) -> str | None:
        """Return the violated rule in words, or None for a valid value."""
        if self.above is not None and not value > self.above:
            return f"greater than {self.above:g}"
        if self.at_least is not None and not value >= self.at_least:
            return f"not less than {self.at_least:g}"
        if self.below is not None and not value < self.below:
            return f"less than {self.below:g}"
        if self.at_most is not None and not value <= self.at_most:
            return f"not more than {self.at_most:g}"
        if not math.isfinite(value):
            return "finite"
        return None

    def beyond(self, given: object, value: float) -> None:
        """Raise `WrongValueError` for a value beyond the named bound."""
        broken = beyond(self.bound, value) if self.bound else None
        if broken:
            raise WrongValueError(f'"{given}" is out of bounds', *broken)


class PerChamber(NamedTuple):
    """One SI value for each chamber."""

    a: float
    b: float


def quantity(given: object, si_unit: str, bounds: Bounds) -> float:
    """Convert one quantity to a checked SI value, or raise `DescriptionError`."""
    if not isinstance(given, str | units.UnitFloat):
        raise WrongValueError(f"{given!r} has no unit", rule=units.needed(si_unit))
    value = units.parse(given, si_unit) if isinstance(given, str) else given.si_as(si_unit)
    rule = bounds.broken(value)
    if rule:
        raise WrongValueError(f'"{given}" is out of bounds', rule=f"{rule} {si_unit}")
    bounds.beyond(given, value)
    return value


def number(given: object, bounds: Bounds) -> float:
    """Check a pure number, or raise `WrongValueError`."""
    if isinstance(given, bool | units.UnitFloat) or not isinstance(given, (int, float)):
        raise WrongValueError(f"{given!r} is not a number", rule="a pure number, without unit and quotes")
    try:
        value = float(given)
    except OverflowError:  # a whole number beyond all numbers with a fraction
        value = math.inf
    rule = "finite" if not math.isfinite(value) else bounds.broken(value)
    if rule:
        raise WrongValueError(f"{given!r} is out of bounds", rule=rule)
    return value


@dataclass(frozen=True)
class Mark:
    """Annotation of a field with a separate reader and writer."""

    def read(self, given: Any) -> Any:  # noqa: ANN401 - any type of the field
        """Convert and check, or raise `DescriptionError`."""
        raise NotImplementedError

    def show(self, value: Any) -> Any:  # noqa: ANN401
        """Write the value as users would."""
        return value

    def named(self, value: Any) -> Any:  # noqa: ANN401
        """Return the stored value in its displayed form: a quantity with its unit."""
        return value

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        return {}

    def read_at(self, key: str, given: object) -> Any:  # noqa: ANN401
        """Convert and check the value of a dotted key; errors name the key."""
        try:
            return self.read(given)
        except DescriptionError as error:
            raise wrong(key, f"{key}: {error.what}", rule=error.rule, remedy=error.remedy) from None

    def __get_pydantic_core_schema__(self, source: object, handler: object) -> core_schema.CoreSchema:
        """Validate only by `read`."""
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: object, handler: object) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        return self.schema()


@dataclass(frozen=True)
class Quantity(Mark):
    """Annotation of a field that takes a quantity and stores an SI float.

    Parameters
    ----------
    si_unit : str
        Unit of the stored value, as in `pneudrive.units.parse`; empty for a pure number.
    written : str, optional
        Preferred unit when the value is written.
    bounds : Bounds
        Bounds in SI.
    """

    si_unit: str
    written: str | None = None
    bounds: Bounds = Bounds()

    def read(self, given: object) -> float:
        """Convert and check."""
        return quantity(given, self.si_unit, self.bounds) if self.si_unit else number(given, self.bounds)

    def show(self, value: float) -> str | float:
        """Write the value as users would."""
        return units.write(value, self.si_unit, self.written) if self.si_unit else value

    def named(self, value: Any) -> Any:  # noqa: ANN401 - any type of the field
        """Return the stored value as a quantity that shows its unit; a pure number unchanged."""
        if isinstance(value, float) and self.si_unit:
            return units.UnitFloat(value, self.si_unit, self.written)
        if isinstance(value, tuple):
            made = [self.named(one) for one in value]
            return type(value)(*made) if hasattr(value, "_fields") else tuple(made)
        return value

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        if self.si_unit:
            return {"type": "string", "description": units.kind(self.si_unit), "x-unit": self.si_unit}
        out: dict[str, Any] = {"type": "number"}
        names = {"above": "exclusiveMinimum", "at_least": "minimum", "below": "exclusiveMaximum", "at_most": "maximum"}
        out |= {word: getattr(self.bounds, key) for key, word in names.items() if getattr(self.bounds, key) is not None}
        return out


@dataclass(frozen=True)
class EachChamber(Quantity):
    """Annotation of a field that takes ``{ a = ..., b = ... }`` and stores a `PerChamber`."""

    def read(self, given: object) -> PerChamber:  # type: ignore[override]
        """Convert and check both values."""
        if isinstance(given, PerChamber):
            given = {"a": self.show_one(given.a), "b": self.show_one(given.b)}
        if not isinstance(given, dict):
            raise WrongValueError(f"{given!r} is not one value for each chamber", remedy="Write { a = ..., b = ... }.")
        for key in given:
            if key not in {"a", "b"}:
                raise WrongValueError(f"'{key}' is not known here", remedy=nearest(str(key), ["a", "b"]), sub=str(key))
        values = []
        for chamber in ("a", "b"):
            if chamber not in given:
                raise WrongValueError(f"chamber {chamber} is missing", remedy="Write { a = ..., b = ... }.")
            try:
                values.append(super().read(given[chamber]))
            except DescriptionError as error:
                error.key = chamber
                raise
        return PerChamber(*values)

    def show_one(self, value: float) -> str:
        """Write one chamber's value."""
        return units.write(value, self.si_unit, self.written)

    def show(self, value: PerChamber) -> dict[str, str]:  # type: ignore[override]
        """Write both."""
        return {"a": self.show_one(value.a), "b": self.show_one(value.b)}

    def schema(self) -> dict[str, Any]:
        """Describe a table of two quantities."""
        one = super().schema()
        both = {"a": one, "b": one}
        return {"type": "object", "properties": both, "required": ["a", "b"], "additionalProperties": False}


@dataclass(frozen=True)
class StatedPressure(Mark):
    """Annotation of a field that takes a pressure with ``abs`` or ``gauge`` and stores a `pneudrive.units.Pressure`."""

    gauge_allowed: bool = True

    def read(self, given: object) -> units.Pressure:
        """Convert and check; an absolute pressure is above zero."""
        if isinstance(given, units.Pressure):
            return given
        if not isinstance(given, str):
            raise WrongValueError(f"{given!r} has no unit", rule=units.PRESSURE_NEEDED)
        pressure = units.parse_pressure(given)
        if pressure.gauge and not self.gauge_allowed:
            raise WrongValueError(f'"{given}" is gauge, but defines the ambient pressure', remedy='Write "... abs".')
        if not pressure.gauge and not pressure.value_pa > 0.0:
            raise WrongValueError(f'"{given}" is out of bounds', rule="an absolute pressure is greater than 0")
        return pressure

    def show(self, value: units.Pressure) -> str:
        """Write the pressure in its given form, absolute or gauge."""
        return str(value)

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        words = "(abs|gauge)" if self.gauge_allowed else "abs"
        return {"type": "string", "pattern": f"^.+ {words}$", "description": units.kind("Pa"), "x-unit": "Pa"}


Length = Annotated[float, Quantity("m", "mm", Bounds(above=0.0))]
Position = Annotated[float, Quantity("m", "mm")]
Velocity = Annotated[float, Quantity("m/s", "mm/s")]
Mass = Annotated[float, Quantity("kg", "kg", Bounds(above=0.0))]
Force = Annotated[float, Quantity("N", "N")]
Temperature = Annotated[float, Quantity("K", "K", Bounds(above=0.0))]
Angle = Annotated[float, Quantity("rad", "deg", Bounds(at_least=-math.pi / 2, at_most=math.pi / 2))]
Stiffness = Annotated[float, Quantity("N/m", "N/m", Bounds(above=0.0))]
Fraction = Annotated[float, Quantity("", bounds=Bounds(above=0.0, below=1.0))]
