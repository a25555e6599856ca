"""Annotations of fields that are not plain quantities: whole numbers, fractions, ranges and other forms."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.describe.keys import WrongValueError
from pneudrive.describe.quantities import Bounds, Mark, Quantity, StatedPressure, number
from pneudrive.errors import DescriptionError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

#: Largest coordinate of a place in a drawing, in modules.
MOST_MODULES = 1000.0


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


@dataclass(frozen=True)
class OnPaper(Quantity):
    """Annotation of a field for a place in a drawing."""

    def read(self, given: object) -> tuple[float, float] | None:  # type: ignore[override]
        """Check the form."""
        if given is None:
            return None
        if not isinstance(given, list | tuple) or len(given) != 2:
            raise WrongValueError(f"{given!r} is not a place in a drawing", remedy="Write at = [12, 0].")
        x, y = (number(one, Bounds(at_least=-MOST_MODULES, at_most=MOST_MODULES)) for one in given)
        return x, y

    def show(self, value: tuple[float, float]) -> list[float]:  # type: ignore[override]
        """Write the place."""
        return list(value)

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema."""
        return {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}


@dataclass(frozen=True)
class PureNumber(Quantity):
    """Annotation of a field for a pure number, or a fraction in per cent, "0.4 %"."""

    def read(self, given: object) -> float:
        """Convert and check."""
        if isinstance(given, str) and given.endswith("%"):
            try:
                given = float(given.removesuffix("%")) / 100.0
            except ValueError:
                raise WrongValueError(f'"{given}" is not a number') from None
        return super().read(given)

    def schema(self) -> dict[str, Any]:
        """Describe both forms."""
        number = super().schema()
        return {"anyOf": [number, {"type": "string", "pattern": r"^\S+\s*%$"}]}


@dataclass(frozen=True)
class PointRows(Quantity):
    """Annotation of a field for points: a list of tables, stored as rows in SI.

    Parameters
    ----------
    columns : tuple
        Key and annotation of each column; values of the first column rise.
    defaults : tuple
        Default of each column; None if a point has to give it.
    most : int
        Largest number of points.
    """

    columns: tuple[tuple[str, Quantity], ...] = ()
    defaults: tuple[float | None, ...] = ()
    most: int = 0

    @property
    def needed(self) -> list[str]:
        """Columns that each point must have."""
        return [key for (key, _), default in zip(self.columns, self.defaults, strict=True) if default is None]

    def read(self, given: object) -> tuple[tuple[float, ...], ...]:  # type: ignore[override]
        """Convert and check all points."""
        example = "{ " + ", ".join(f"{key} = ..." for key, _ in self.columns) + " }"
        if not isinstance(given, list | tuple) or not all(isinstance(one, dict) for one in given):
            raise WrongValueError(f"{given!r} is not a list of points", remedy=f"Write [{example}, {example}].")
        if not 2 <= len(given) <= self.most:
            raise WrongValueError(f"{len(given)} points", rule=f"2 to {self.most} points")
        rows = tuple(self._row(dict(one), number, example) for number, one in enumerate(given, start=1))
        key, first = self.columns[0]
        for before, after in pairwise(rows):
            if after[0] <= before[0]:
                what = f"{key} = {first.show(after[0])} follows {first.show(before[0])}"
                raise WrongValueError(what, rule=f"{key} rises from point to point")
        return rows

    def _row(self, table: dict[str, Any], number: int, example: str) -> tuple[float, ...]:
        if not set(self.needed) <= set(table) <= {key for key, _ in self.columns}:
            rest = f"; only {' and '.join(self.needed)} needed" if len(self.needed) < len(self.columns) else ""
            raise WrongValueError(f"point {number} = {table!r}", rule=f"a point is {example}{rest}")
        return tuple(
            default if default is not None and key not in table else _read(mark, table[key], f"{key} of point {number}")
            for (key, mark), default in zip(self.columns, self.defaults, strict=True)
        )

    def show(self, value: Sequence[Sequence[float]]) -> list[dict[str, str | float]]:  # type: ignore[override]
        """Write the points as users would."""
        columns = list(zip(self.columns, self.defaults, strict=True))
        return [
            {key: mark.show(one) for ((key, mark), default), one in zip(columns, row, strict=True) if one != default}
            for row in value
        ]

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the list."""
        columns = {key: mark.schema() for key, mark in self.columns}
        point = {"type": "object", "properties": columns, "required": self.needed, "additionalProperties": False}
        return {"type": "array", "items": point, "minItems": 2, "maxItems": self.most}


def _read(mark: Quantity, given: object, name: str) -> float:
    try:
        return mark.read(given)
    except DescriptionError as error:
        raise WrongValueError(f"{name}: {error.what}", error.rule, error.remedy) from None
