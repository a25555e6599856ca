"""Types of values that only protocols have: lists of levels, ranges, fractions, positions along the stroke."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from pneudrive import units
from pneudrive.describe.keys import WrongValueError
from pneudrive.describe.marks import Whole
from pneudrive.describe.quantities import Bounds, Mark, Quantity, StatedPressure
from pneudrive.errors import DescriptionError, nearest

#: Significant digits of the levels between the ends of a range, so that its name states a level exactly.
DIGITS = 4
SPACINGS = ("log", "linear")
AMBIENT = units.Pressure(0.0, gauge=True)


@dataclass(frozen=True)
class MovingAverage(Quantity):
    """Annotation of a field that takes a number of samples, or ``"none"`` for 1."""

    si_unit: str = ""

    def read(self, given: object) -> int:
        """Convert and check."""
        if given == "none":
            return 1
        if isinstance(given, bool) or not isinstance(given, int) or given < 1:
            raise WrongValueError(f"{given!r} is not a number of samples", remedy='Write 5, or "none".')
        Bounds(bound="samples").beyond(given, given)
        return given

    def show(self, value: float) -> str | float:
        """Return it as users write it."""
        return "none" if value == 1 else int(value)

    def schema(self) -> dict[str, Any]:
        """Return the schema of its written form."""
        return {"anyOf": [{"type": "integer", "minimum": 1}, {"const": "none"}]}


@dataclass(frozen=True, order=True)
class Place:
    """A position: absolute, m, or as a fraction of the range that the campaign uses."""

    value: float
    share: bool

    def at(self, low_m: float, high_m: float) -> float:
        """Return the position within a range, m."""
        return low_m + self.value * (high_m - low_m) if self.share else self.value

    def __str__(self) -> str:
        """Return it as users write it."""
        return units.write_share(self.value) if self.share else units.write(self.value, "m", "mm")

    @property
    def name(self) -> str:
        """Part of a key: ``x50pc`` or ``x120mm``."""
        return "x" + str(self).replace(" %", "pc").replace(" ", "")


@dataclass(frozen=True)
class PlaceMark(Mark):
    """Annotation of a field for a position: a length or a fraction, ``"120 mm"``, ``"50 %"``."""

    def read(self, given: object) -> Place:
        """Convert and check."""
        return place(given)

    def show(self, value: Place) -> str:
        """Return it as users write it."""
        return str(value)

    def schema(self) -> dict[str, Any]:
        """Return the schema of its written form."""
        return {"type": "string", "x-unit": "m or %"}


@dataclass(frozen=True)
class PressurePair(StatedPressure):
    """Annotation of a field that takes ``{ a = ..., b = ... }``, a pressure in each chamber."""

    def read(self, given: object) -> tuple[units.Pressure, units.Pressure]:  # type: ignore[override]
        """Convert and check both pressures."""
        if not isinstance(given, dict) or set(given) != {"a", "b"}:
            raise WrongValueError(f"{given!r} is not a pair of pressures", remedy="Write { a = ..., b = ... }.")
        return super().read(given["a"]), super().read(given["b"])

    def show(self, value: tuple[units.Pressure, units.Pressure]) -> dict[str, str]:  # type: ignore[override]
        """Return both pressures in the form that users write."""
        return {"a": str(value[0]), "b": str(value[1])}

    def schema(self) -> dict[str, Any]:
        """Return the schema of its written form."""
        both = {"a": super().schema(), "b": super().schema()}
        return {"type": "object", "properties": both, "required": ["a", "b"], "additionalProperties": False}


@dataclass(frozen=True)
class ListOf(Mark):
    """Annotation of a field that takes one value, a list, or a range with a count; stores them all.

    Parameters
    ----------
    one : Mark
        Annotation of each value.
    spacing : str
        Default of a range, ``log`` or ``linear``; empty: no ranges.
    sorts : bool
        Store the values in ascending order, otherwise in the given order.
    only_list : bool
        A single value needs a list, too.
    """

    one: Mark
    spacing: str = ""
    sorts: bool = True
    only_list: bool = False

    def read(self, given: object) -> tuple[Any, ...]:
        """Convert and check."""
        if self.spacing and isinstance(given, dict):
            return self._range(given)
        if self.only_list and (not isinstance(given, list) or not given):
            raise WrongValueError(f"{given!r} is not a list of pairs", remedy="Write [{ a = ..., b = ... }, ...].")
        values = [self.one.read(one) for one in listed(given)]
        values = sorted(values) if self.sorts else values
        return distinct(values, [str(self.one.show(value)) for value in values])

    def _range(self, given: dict[str, Any]) -> tuple[Any, ...]:
        low, high, count, spacing = spacing_of(given, self.spacing)
        ends = self.one.read(low), self.one.read(high)
        if isinstance(self.one, Quantity):
            return spaced(*ends, count, spacing, self.one)
        if ends[0].gauge != ends[1].gauge:
            raise WrongValueError(f"the range {low!r} to {high!r} mixes abs and gauge")
        values = spaced(ends[0].value_pa, ends[1].value_pa, count, spacing, Quantity("Pa", "bar"))
        return tuple(units.Pressure(value, ends[0].gauge) for value in values)

    def show(self, value: tuple[Any, ...]) -> list[Any]:
        """Return all levels in the form that users write."""
        return [self.one.show(one) for one in value]

    def named(self, value: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return each level as a quantity with its unit."""
        return tuple(map(self.one.named, value))

    def schema(self) -> dict[str, Any]:
        """Return the schema of its written forms."""
        one = self.one.schema()
        if isinstance(self.one, Quantity):
            one.pop("description")
        several = {"type": "array", "items": one, "minItems": 1}
        if self.only_list:
            return several | {"x-unit": "Pa"}
        return {"anyOf": [one, several, *([range_schema(one)] if self.spacing else [])], "x-unit": one["x-unit"]}


@dataclass(frozen=True)
class BetweenPlaces(Quantity):
    """Annotation of a field that takes a range of positions, ``"10 mm .. 290 mm"`` or ``"5 % .. 95 %"``."""

    si_unit: str = "m"

    def read(self, given: object) -> tuple[Place, Place]:  # type: ignore[override]
        """Convert and check."""
        ends = given.split("..") if isinstance(given, str) else []
        if len(ends) != 2:
            raise WrongValueError(f"{given!r} is not a range", remedy='Write "10 mm .. 290 mm" or "5 % .. 95 %".')
        low, high = place(ends[0].strip()), place(ends[1].strip())
        if low.share == high.share and not low.value < high.value:
            raise WrongValueError(f'range "{given}" is empty', rule="the first end must lie below the second")
        return low, high

    def show(self, value: tuple[Place, Place]) -> str:  # type: ignore[override]
        """Return it as users write it."""
        return f"{value[0]} .. {value[1]}"

    def schema(self) -> dict[str, Any]:
        """Return the schema of its written form."""
        return {"type": "string", "pattern": r"^.+ \.\. .+$", "x-unit": "m or %"}


def listed(given: object) -> list[object]:
    """Return a list unchanged, and one value as a list."""
    if isinstance(given, list):
        if not given:
            raise WrongValueError("the list is empty")
        Bounds(bound="count").beyond(f"{len(given)} entries", len(given))
        return given
    return [given]


def distinct(values: Any, shown: list[str]) -> Any:  # noqa: ANN401 - any sequence
    """Return the values as a tuple; refuse a value that occurs twice."""
    seen = set()
    for index, one in enumerate(values):
        if one in seen:
            raise WrongValueError(f"{shown[index]} occurs twice", remedy="Use `repeats` for repetitions.")
        seen.add(one)
    return tuple(values)


def spacing_of(given: dict[str, Any], spacing: str) -> tuple[object, object, int, str]:
    """Read ``{ from, to, count, spacing }``."""
    for key in given:
        if key not in {"from", "to", "count", "spacing"}:
            raise WrongValueError(f"'{key}' is not known here", remedy=nearest(key, ["from", "to", "count", "spacing"]))
    for key in ("from", "to", "count"):
        if key not in given:
            raise WrongValueError(f"'{key}' is missing", remedy="Write { from = ..., to = ..., count = ... }.")
    kind = given.get("spacing", spacing)
    if kind not in SPACINGS:
        raise WrongValueError(f"spacing = {kind!r} is not known", remedy=nearest(str(kind), SPACINGS))
    return given["from"], given["to"], Whole(at_least=2).read(given["count"]), kind


def spaced(low: float, high: float, count: int, spacing: str, mark: Quantity) -> tuple[float, ...]:
    """Return `count` levels from end to end; the ends are exact, levels between have `DIGITS` significant digits.

    Examples
    --------
    >>> spaced(1e-3, 0.1, 3, "log", Quantity("m/s", "mm/s"))
    (0.001, 0.01, 0.1)
    """
    if not low < high:
        raise WrongValueError("the range is empty", rule="`from` must lie below `to`")
    if spacing == "log" and not low > 0.0:
        raise WrongValueError("a logarithmic range must start above zero", remedy='Write spacing = "linear".')
    unit = mark.written or mark.si_unit
    factor, offset = units.converter(unit, mark.si_unit)
    inner = []
    for index in range(1, count - 1):
        share = index / (count - 1)
        value = math.exp((1.0 - share) * math.log(low) + share * math.log(high)) if spacing == "log" else None
        value = (1.0 - share) * low + share * high if value is None else value
        inner.append(units.parse(f"{(value - offset) / factor:.{DIGITS}g} {unit}", mark.si_unit))
    out = (low, *inner, high)
    if any(not a < b for a, b in pairwise(out)):
        raise WrongValueError(
            f"{count} levels do not differ within {DIGITS} significant digits", remedy="Lower the count."
        )
    return out


def range_schema(one: dict[str, Any]) -> dict[str, Any]:
    """Describe ``{ from, to, count, spacing }``."""
    count = {"type": "integer", "minimum": 2}
    keys = {"from": one, "to": one, "count": count, "spacing": {"enum": list(SPACINGS)}}
    return {"type": "object", "properties": keys, "required": ["from", "to", "count"], "additionalProperties": False}


def place(given: object) -> Place:
    """Read one position."""
    share = units.share_of(given)
    if share is not None:
        if not 0.0 <= share <= 1.0:
            raise WrongValueError(f'"{given}" lies outside the range', rule="0 % to 100 %")
        return Place(share, share=True)
    if not isinstance(given, str):
        raise WrongValueError(f"{given!r} has no unit", remedy='Write "50 %" or "120 mm".')
    try:
        return Place(units.parse(given, "m"), share=False)
    except DescriptionError as error:
        raise WrongValueError(error.what, error.rule, 'Write "50 %" or "120 mm".') from None
