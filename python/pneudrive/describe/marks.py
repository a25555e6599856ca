"""Annotations of fields that are not plain quantities: whole numbers, fractions, ranges and other forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.describe.base import Bounds, Mark, Quantity, StatedPressure, WrongValueError
from pneudrive.errors import nearest

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True)
class Reads(Mark):
    """Annotation of a field with a reader function."""

    how: Callable[[Any], Any]

    def read(self, given: Any) -> Any:  # noqa: ANN401 - result of the function
        """Convert and check."""
        return self.how(given)


@dataclass(frozen=True)
class Choice(Mark):
    """Annotation of a field that accepts one of several words."""

    choices: tuple[str, ...]

    def read(self, given: object) -> str:
        """Check the word."""
        if given not in self.choices:
            raise WrongValueError(f"{given!r} is not known", remedy=nearest(str(given), self.choices))
        return str(given)


@dataclass(frozen=True)
class Whole(Quantity):
    """Annotation of a field for a whole number."""

    si_unit: str = ""
    at_least: int = 1
    bound: str | None = "count"

    def read(self, given: object) -> int:
        """Check."""
        if isinstance(given, bool) or not isinstance(given, int):
            raise WrongValueError(f"{given!r} is not a whole number")
        if given < self.at_least:
            raise WrongValueError(f"{given} is out of bounds", rule=f"at least {self.at_least}")
        Bounds(bound=self.bound).beyond(given, given)
        return given

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        return {"type": "integer", "minimum": self.at_least}


@dataclass(frozen=True)
class Percent(Quantity):
    """Annotation of a field for a fraction, written ``"5 %"`` and stored as 0.05. Bounds are in per cent."""

    si_unit: str = "%"

    def read(self, given: object) -> float:
        """Convert and check."""
        share = units.share_of(given)
        if share is None:
            raise WrongValueError(f"{given!r} is not a share", remedy='Write "5 %".')
        rule = self.bounds.broken(100.0 * share)
        if rule:
            raise WrongValueError(f'"{given}" is out of bounds', rule=f"{rule} %")
        return share

    def show(self, value: float) -> str:
        """Write the value as users would."""
        return units.write_share(value)

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        return {"type": "string", "pattern": "^.+ %$", "x-unit": "%"}


@dataclass(frozen=True)
class Between(Quantity):
    """Annotation of a field for a range, ``"15 degC .. 30 degC"``, stored as (low, high)."""

    def read(self, given: object) -> tuple[float, float]:  # type: ignore[override]
        """Convert and check."""
        if not isinstance(given, str):
            raise WrongValueError(f"{given!r} is not a range", rule=units.needed(self.si_unit))
        return units.parse_range(given, self.si_unit)

    def show(self, value: tuple[float, float]) -> str:  # type: ignore[override]
        """Write the value as users would."""
        return " .. ".join(units.write(end, self.si_unit, self.written) for end in value)

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        return {"type": "string", "pattern": r"^.+ \.\. .+$", "x-unit": self.si_unit}


@dataclass(frozen=True)
class PressureBetween(StatedPressure):
    """Annotation of a field for a range of pressures, ``"0 bar gauge .. 10 bar gauge"``, stored as both ends."""

    def read(self, given: object) -> tuple[units.Pressure, units.Pressure]:  # type: ignore[override]
        """Convert and check."""
        ends = given.split("..") if isinstance(given, str) else []
        if len(ends) != 2:
            raise WrongValueError(f'"{given}" is not a range', remedy='Write "0 bar gauge .. 10 bar gauge".')
        low, high = (super(PressureBetween, self).read(end.strip()) for end in ends)
        if low.gauge == high.gauge and not low.value_pa < high.value_pa:
            raise WrongValueError(f'range "{given}" is empty', rule="the first end lies below the second")
        return low, high

    def show(self, value: tuple[units.Pressure, units.Pressure]) -> str:  # type: ignore[override]
        """Write the value as users would."""
        return f"{value[0]} .. {value[1]}"


def absolute(ends: tuple[units.Pressure, units.Pressure], ambient_pa: float) -> tuple[float, float]:
    """Return both ends of a range of pressures, absolute, Pa."""
    return ends[0].absolute_pa(ambient_pa), ends[1].absolute_pa(ambient_pa)
