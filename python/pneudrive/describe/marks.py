"""Annotations of fields: quantities, whole numbers, fractions, ranges and other forms."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

from pydantic_core import core_schema

from pneudrive import units
from pneudrive.errors import CommandError, DescriptionError, naming, nearest, wrong
from pneudrive.files.bounds import within
from pneudrive.units import Pressure, UnitFloat

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pneudrive.arrays import Interval, Keyed, Plain


# --- Quantities of a description: their bounds, how they are read and shown, and the types of the usual ones.


@dataclass(frozen=True)
class Bounds:
    """Open or closed bounds of an SI value."""

    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    bound: str | None = None  # bound of `pneudrive.files.bounds`, which users can raise

    def broken(self, value: float, show: Callable[[float], str] = "{:g}".format) -> str | None:
        """Return the violated rule in words, or None for a valid value. `show` formats a bound."""
        if self.above is not None and not value > self.above:
            return f"greater than {show(self.above)}"
        if self.at_least is not None and not value >= self.at_least:
            return f"not less than {show(self.at_least)}"
        if self.below is not None and not value < self.below:
            return f"less than {show(self.below)}"
        if self.at_most is not None and not value <= self.at_most:
            return f"not more than {show(self.at_most)}"
        return None if math.isfinite(value) else "finite"

    def beyond(self, given: object, value: float) -> None:
        """Raise `DescriptionError` if a value exceeds the bound named `bound` in `pneudrive.files.bounds`."""
        assert self.bound is not None
        within(self.bound, value, f'"{given}" is out of bounds', DescriptionError)


class PerChamber(NamedTuple):
    """One SI value for each chamber."""

    a: float
    b: float


def table_schema(properties: Plain, required: list[str] | None = None) -> Plain:
    """Return the JSON schema of a table that may have only these keys."""
    needed = {} if required is None else {"required": required}
    return {"type": "object", "properties": properties, **needed, "additionalProperties": False}


@dataclass(frozen=True)
class Mark:
    """Base of the annotations of fields: reader, writer and schema of a value."""

    def read(self, given: Any) -> Any:  # noqa: ANN401 - any type of the field
        """Convert and check a value that a user wrote, or raise `DescriptionError`."""
        raise NotImplementedError

    def show(self, value: Any) -> Any:  # noqa: ANN401
        """Return the value in the form that users write."""
        return value

    def named(self, value: Any) -> Any:  # noqa: ANN401
        """Return the stored value in its displayed form: a quantity with its unit."""
        return value

    def schema(self) -> Plain:
        """Return the JSON schema of the form that users write."""
        return {}

    def read_at(self, key: str, given: object, above: str = "") -> Any:  # noqa: ANN401
        """Convert and check the value of a dotted key; errors name the key. Messages leave out the prefix `above`."""
        try:
            return self.read(given)
        except DescriptionError as error:
            raise wrong(f"{above}{key}", f"{key}: {error.what}", rule=error.rule, remedy=error.remedy) from None

    def __get_pydantic_core_schema__(self, source: object, handler: object) -> core_schema.CoreSchema:
        """Use `read` as the only validation."""
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(self, schema: object, handler: object) -> Plain:
        """Return the JSON schema of the form that users write."""
        return self.schema()


@dataclass(frozen=True)
class Quantity(Mark):
    """Annotation of a field that takes a quantity and stores an SI float.

    Parameters
    ----------
    si_unit : str
        Unit of the stored value, as in `pneudrive.units.parse`; empty for a number without a unit.
    written : str, optional
        Preferred unit for output.
    bounds : Bounds
        Bounds in SI.
    """

    si_unit: str
    written: str | None = None
    bounds: Bounds = Bounds()

    @property
    def rule(self) -> str:
        """Rule for a message about a missing value."""
        return units.needed(self.si_unit) if self.si_unit else "a number is needed"

    @property
    def ends(self) -> Interval:
        """Lower and upper bound of the value in SI, whether open or closed; infinite without a bound."""
        low, *_ = (end for end in (self.bounds.at_least, self.bounds.above, -math.inf) if end is not None)
        high, *_ = (end for end in (self.bounds.at_most, self.bounds.below, math.inf) if end is not None)
        return low, high

    def read(self, given: object) -> float:
        """Convert and check a quantity, or a number without a unit. A message gives bounds in the unit `written`."""
        if not self.si_unit:
            if isinstance(given, bool | UnitFloat) or not isinstance(given, (int, float)):
                raise DescriptionError(f"{given!r} is not a number", rule="a number without unit and quotes")
            try:
                value = float(given)
            except OverflowError:  # a whole number larger than any float
                value = math.inf
            rule = "finite" if not math.isfinite(value) else self.bounds.broken(value)
            if rule:
                raise DescriptionError(f"{given!r} is out of bounds", rule=rule)
            return value
        if not isinstance(given, str | UnitFloat):
            raise DescriptionError(f"{given!r} has no unit", rule=self.rule)
        value = units.parse(given, self.si_unit) if isinstance(given, str) else given.si_as(self.si_unit)
        rule = self.bounds.broken(value, lambda end: f"{UnitFloat(end, self.si_unit, self.written if end else None):g}")
        if rule:
            raise DescriptionError(f'"{given}" is out of bounds', rule=rule)
        if self.bounds.bound:
            self.bounds.beyond(given, value)
        return value

    def show(self, value: float) -> str | float:
        """Return the value in the form that users write."""
        return units.write(value, self.si_unit, self.written) if self.si_unit else value

    def named(self, value: Any) -> Any:  # noqa: ANN401 - any type of the field
        """Return the stored value as a quantity that shows its unit. A number without a unit stays unchanged."""
        if isinstance(value, float) and self.si_unit:
            return UnitFloat(value, self.si_unit, self.written)
        if isinstance(value, tuple):
            made = [self.named(one) for one in value]
            return type(value)(*made) if hasattr(value, "_fields") else tuple(made)
        return value

    def schema(self) -> Plain:
        """Return the JSON schema of the form that users write."""
        if self.si_unit:
            return {"type": "string", "description": units.kind(self.si_unit), "x-unit": self.si_unit}
        out: Plain = {"type": "number"}
        names = {"above": "exclusiveMinimum", "at_least": "minimum", "below": "exclusiveMaximum", "at_most": "maximum"}
        out |= {word: getattr(self.bounds, key) for key, word in names.items() if getattr(self.bounds, key) is not None}
        return out


class EachChamber(Quantity):
    """Annotation of a field that takes ``{ a = ..., b = ... }`` and stores a `PerChamber`."""

    @property
    def each(self) -> Quantity:
        """Annotation of the value of one chamber."""
        return Quantity(self.si_unit, self.written, self.bounds)

    def read(self, given: object) -> PerChamber:  # type: ignore[override]
        """Convert and check both values."""
        if isinstance(given, PerChamber):
            given = self.show(given)
        if not isinstance(given, dict) or given.keys() != {"a", "b"}:
            raise DescriptionError(f"{given!r} needs a value for each chamber", remedy="Write { a = ..., b = ... }.")
        return PerChamber(*(self.each.read_at(chamber, given[chamber]) for chamber in "ab"))

    def show(self, value: PerChamber) -> dict[str, str]:  # type: ignore[override]
        """Return both values in the form that users write."""
        return {chamber: str(self.each.show(one)) for chamber, one in value._asdict().items()}

    def schema(self) -> Plain:
        """Return the JSON schema of a table with two quantities."""
        return table_schema(dict.fromkeys("ab", self.each.schema()), ["a", "b"])


@dataclass(frozen=True)
class StatedPressure(Mark):
    """Annotation of a field that takes a pressure with ``abs`` or ``gauge`` and stores a `pneudrive.units.Pressure`."""

    gauge_allowed: bool = True

    ends: ClassVar[Interval] = (0.0, math.inf)
    rule: ClassVar[str] = units.PRESSURE_NEEDED

    def read(self, given: object) -> Pressure:
        """Convert and check a pressure. An absolute pressure must be above zero."""
        if isinstance(given, Pressure):
            return given
        if not isinstance(given, str):
            raise DescriptionError(f"{given!r} has no unit", rule=self.rule)
        pressure = units.parse_pressure(given, gauge_allowed=self.gauge_allowed)
        if pressure.gauge and not self.gauge_allowed:
            raise DescriptionError(f'the ambient pressure "{given}" must be absolute', remedy='Write "... abs".')
        if not pressure.gauge and not pressure.value_pa > 0.0:
            raise DescriptionError(f'"{given}" is out of bounds', rule="an absolute pressure is greater than 0")
        return pressure

    def show(self, value: Pressure) -> str:
        """Write the pressure in its given form, absolute or gauge."""
        return str(value)

    def schema(self) -> Plain:
        """Return the JSON schema of the form that users write."""
        long, short = ("(abs|gauge)", "[ag]") if self.gauge_allowed else ("abs", "a")
        pattern = f"^.+( {long}|(bar|psi|Pa){short})$"
        return {"type": "string", "pattern": pattern, "description": units.kind("Pa"), "x-unit": "Pa"}


POSITIVE, NOT_NEGATIVE = Bounds(above=0.0), Bounds(at_least=0.0)
Length = Annotated[float, Quantity("m", "mm", POSITIVE)]
MaybeLength = Annotated[float | None, Quantity("m", "mm", POSITIVE)]
Position = Annotated[float, Quantity("m", "mm")]
Velocity = Annotated[float, Quantity("m/s", "mm/s")]
Mass = Annotated[float, Quantity("kg", "kg", POSITIVE)]
Force = Annotated[float, Quantity("N", "N")]
Temperature = Annotated[float, Quantity("K", "K", POSITIVE)]
MaybeTemperature = Annotated[float | None, Quantity("K", "K", POSITIVE)]
MaybePressure = Annotated[Pressure | None, StatedPressure()]
Angle = Annotated[float, Quantity("rad", "deg", Bounds(at_least=-math.pi / 2, at_most=math.pi / 2))]
Stiffness = Annotated[float, Quantity("N/m", "N/m", POSITIVE)]
Fraction = Annotated[float, Quantity("", bounds=Bounds(above=0.0, below=1.0))]


# --- Annotations of fields that are not plain quantities: whole numbers, fractions, ranges and other forms.

#: Largest coordinate of a position in a drawing, in modules.
MOST_MODULES = 1000.0


@dataclass(frozen=True)
class Reads(Mark):
    """Annotation of a field with a reader function.

    Parameters
    ----------
    read : callable
        Function that converts and checks a value.
    show : callable, optional
        Function that returns the value in the form that users write. Default: the value has this form.
    form : dict
        JSON schema of the form that users write.
    """

    read: Callable[[Any], Any] = field()  # type: ignore[assignment]
    show: Callable[[Any], Any] = field(default=lambda value: value)  # type: ignore[assignment]
    form: Plain = field(default_factory=dict, hash=False)

    def schema(self) -> Plain:
        """Return the JSON schema of the form that users write."""
        return dict(self.form)


Text = Annotated[str, Reads(str)]


@dataclass(frozen=True)
class Choice(Mark):
    """Annotation of a field that accepts one of several words."""

    choices: tuple[str, ...]

    def read(self, given: object) -> str:
        """Check that the value is one of the words."""
        if given not in self.choices:
            raise DescriptionError(f"{given!r} is not known", remedy=nearest(str(given), self.choices))
        return str(given)


@dataclass(frozen=True)
class Whole(Quantity):
    """Annotation of a field for a whole number."""

    si_unit: str = ""
    at_least: int = 1
    bound: str | None = "count"

    def read(self, given: object) -> int:
        """Check that the value is a whole number within its bounds."""
        if isinstance(given, bool) or not isinstance(given, int):
            raise DescriptionError(f"{given!r} is not a whole number")
        if given < self.at_least:
            raise DescriptionError(f"{given} is out of bounds", rule=f"at least {self.at_least}")
        if self.bound:
            Bounds(bound=self.bound).beyond(given, given)
        return given

    def schema(self) -> Plain:
        """Return the JSON schema of the form that users write."""
        return {"type": "integer", "minimum": self.at_least}


@dataclass(frozen=True)
class Percent(Quantity):
    """Annotation of a field for a fraction, written ``"5 %"`` and stored as 0.05. Bounds are in per cent."""

    si_unit: str = "%"

    def read(self, given: object) -> float:
        """Convert and check a percentage."""
        share = units.share_of(given)
        if share is None:
            raise DescriptionError(f"{given!r} is not a percentage", remedy='Write "5 %".')
        rule = self.bounds.broken(100.0 * share)
        if rule:
            raise DescriptionError(f'"{given}" is out of bounds', rule=f"{rule} %")
        return share

    def show(self, value: float) -> str:
        """Return the value in the form that users write."""
        return units.write_share(value)

    def schema(self) -> Plain:
        """Return the JSON schema of the form that users write."""
        return {"type": "string", "pattern": "^.+ %$", "x-unit": "%"}


#: A relative uncertainty, or a tolerance.
Accuracy = Annotated[float, Percent(bounds=Bounds(at_least=0.0, below=100.0))]


class Between(Quantity):
    """Annotation of a field for a range, ``"15 degC .. 30 degC"``, stored as (low, high)."""

    def read(self, given: object) -> Interval:  # type: ignore[override]
        """Convert and check a range."""
        return units.parse_range(given, self.si_unit)

    def show(self, value: Interval) -> str:  # type: ignore[override]
        """Return the value in the form that users write."""
        return " .. ".join(units.write(end, self.si_unit, self.written) for end in value)

    def schema(self) -> Plain:
        """Return the JSON schema of the form that users write."""
        return {"type": "string", "pattern": r"^.+ \.\. .+$", "x-unit": self.si_unit}


class PressureBetween(StatedPressure):
    """Annotation of a field for a range of pressures, ``"0 bar gauge .. 10 bar gauge"``, stored as both ends."""

    def read(self, given: object) -> tuple[Pressure, Pressure]:  # type: ignore[override]
        """Convert and check a range of pressures."""
        ends = units.split_range(given, "0 bar gauge .. 10 bar gauge")
        low, high = map(super().read, ends)
        if low.gauge == high.gauge and not low.value_pa < high.value_pa:
            raise DescriptionError(f'range "{given}" is empty', rule="the first end must be below the second")
        return low, high

    def show(self, value: tuple[Pressure, Pressure]) -> str:  # type: ignore[override]
        """Return the value in the form that users write."""
        return f"{value[0]} .. {value[1]}"


def absolute_above_vacuum(pressure: Pressure, ambient_pa: float, key: str, what: str | None = None) -> float:
    """Convert a pressure to absolute pressure in Pa, and reject a pressure that is not above vacuum.

    The error has the key `key`, and `what` names the value in the message.
    """
    absolute_pa = pressure.absolute_pa(ambient_pa)
    if not absolute_pa > 0.0:
        raise wrong(key, f"{what or key} is below vacuum", rule="gauge pressure + ambient pressure > 0")
    return absolute_pa


def absolute(ends: tuple[Pressure, Pressure], ambient_pa: float) -> Interval:
    """Return both ends of a range of pressures as absolute pressures in Pa."""
    return ends[0].absolute_pa(ambient_pa), ends[1].absolute_pa(ambient_pa)


def _on_paper(given: object) -> Interval | None:
    if given is None:
        return None
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise DescriptionError(f"{given!r} is not a place in a drawing", remedy="Write at = [12, 0].")
    x, y = map(Quantity("", bounds=Bounds(at_least=-MOST_MODULES, at_most=MOST_MODULES)).read, given)
    return x, y


#: Annotation of a field for a position in a drawing.
ON_PAPER = Reads(_on_paper, list, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2})


@dataclass(frozen=True)
class PureNumber(Quantity):
    """Annotation of a field for a number without a unit, or for a text with one of `words`: "0.4 %", "0.9 Cv"."""

    words: tuple[str, ...] = ("%",)

    def read(self, given: object) -> float:
        """Convert and check a number, a percentage or a flow coefficient."""
        number, word = units.split_number(given)
        return super().read(given if word not in self.words else number / 100.0 if word == "%" else number)

    def schema(self) -> Plain:
        """Return the JSON schema: a number, or a text that ends in one of `words`."""
        return {"anyOf": [super().schema(), {"type": "string", "pattern": rf"^\S+\s*({'|'.join(self.words)})$"}]}


#: Sizes of a flow path.
CONDUCTANCE = Quantity("m^3/(s Pa)", "dm3/(s bar)", POSITIVE)
NOMINAL_FLOW = Quantity("m^3/s ANR", "l/min ANR", POSITIVE)
KV, CV = PureNumber("", "Kv", POSITIVE, ("Kv", "m3/h")), PureNumber("", "Cv", POSITIVE, ("Cv",))
SIZES = {"conductance": CONDUCTANCE, "nominal_flow": NOMINAL_FLOW, "kv": KV, "cv": CV}


@dataclass(frozen=True)
class PointRows(Quantity):
    """Annotation of a field for points: a list of tables, stored as rows in SI.

    Parameters
    ----------
    columns : tuple
        Key, annotation and default of each column. The default is None for a required column. Values of the first
        column must increase.
    most : int
        Largest number of points.
    """

    columns: tuple[tuple[str, Quantity, float | None], ...] = ()
    most: int = 0

    @property
    def needed(self) -> list[str]:
        """Columns that each point must have."""
        return [key for key, _, default in self.columns if default is None]

    def read(self, given: object) -> tuple[tuple[float, ...], ...]:  # type: ignore[override]
        """Convert and check all points."""
        example = "{ " + ", ".join(f"{key} = ..." for key, *_ in self.columns) + " }"
        if not isinstance(given, list | tuple) or not all(isinstance(one, dict) for one in given):
            raise DescriptionError(f"{given!r} is not a list of points", remedy=f"Write [{example}, {example}].")
        if not 2 <= len(given) <= self.most:
            raise DescriptionError(f"the number of points is {len(given)}", rule=f"2 to {self.most} points")
        rows: list[tuple[float, ...]] = []
        known = {key for key, *_ in self.columns}
        for number, table in enumerate(given, start=1):
            if not set(self.needed) <= set(table) <= known:
                free = len(self.needed) < len(self.columns)
                rest = f"; only {' and '.join(self.needed)} must be given" if free else ""
                raise DescriptionError(f"point {number} = {dict(table)!r}", rule=f"form of a point: {example}{rest}")
            row: list[Any] = []
            for key, mark, default in self.columns:
                with naming(f"{key} of point {number}", kind=DescriptionError):
                    row.append(mark.read(table[key]) if key in table else default)
            rows.append(tuple(row))
        key, first, _ = self.columns[0]
        for before, after in pairwise(rows):
            if after[0] <= before[0]:
                what = f"{key} = {first.show(after[0])} follows {first.show(before[0])}"
                raise DescriptionError(what, rule=f"{key} must increase from point to point")
        return tuple(rows)

    def show(self, value: Sequence[Sequence[float]]) -> list[dict[str, str | float]]:  # type: ignore[override]
        """Return the points in the form that users write."""
        return [
            {key: mark.show(one) for (key, mark, default), one in zip(self.columns, row, strict=True) if one != default}
            for row in value
        ]

    def schema(self) -> Plain:
        """Return the JSON schema of the list."""
        columns = {key: mark.schema() for key, mark, _ in self.columns}
        return {"type": "array", "items": table_schema(columns, self.needed), "minItems": 2, "maxItems": self.most}


# --- Parameters that the core lists.


def parameter_quantity(parameter: Keyed) -> Quantity:
    """Return the annotation of one parameter: SI unit, preferred unit, bounds."""
    si_unit = units.si_name(parameter["unit"])
    written = units.USUAL.get(si_unit, si_unit.replace("^", ""))
    ends = (parameter["lower"], parameter["upper"])
    low, high = (None if end is None or math.isinf(end) else end for end in ends)
    lower = {"above" if parameter["open"] else "at_least": low}
    upper = {"below" if parameter["open_above"] else "at_most": high}
    return Quantity(si_unit, written if written in units.TABLE else None, Bounds(**lower, **upper))


def parameter_quantities(entry: Keyed) -> dict[str, Quantity]:
    """Return the annotation of each parameter of a law or a component by its key."""
    return {p["key"]: parameter_quantity(p) for p in entry["parameters"]}


# --- Electrical input of a valve: conversion of a voltage or current to an opening.

# SI unit -> preferred unit
_WRITTEN = {"V": "V", "A": "mA"}
_FORM = '"0 V .. 10 V" or "4 mA .. 20 mA"'


class Signal(NamedTuple):
    """Range of a valve's electrical input in V or A.

    The lower end (u = -1) opens supply -> b fully, and the upper end (u = 1) opens supply -> a fully. The valve is
    closed in the middle of the range.
    """

    low: float
    high: float
    si_unit: str

    def __str__(self) -> str:
        unit = _WRITTEN[self.si_unit]
        return " .. ".join(units.write(end, self.si_unit, unit) for end in self[:2])

    def opening(self, text: str) -> float:
        """Convert a voltage or current to the command u in [-1, 1].

        Raises
        ------
        CommandError
            If the text is not a voltage or current of this range.

        Examples
        --------
        >>> Signal(0.0, 10.0, "V").opening("7.5 V"), Signal(4e-3, 20e-3, "A").opening("20 mA")
        (0.5, 1.0)
        """
        with naming("command"):
            value = units.parse(text, self.si_unit)
        if not self.low <= value <= self.high:
            raise CommandError(f"command = {text} is outside the valve's range", rule=f"valve.command = {self}")
        opening = (2.0 * value - self.low - self.high) / (self.high - self.low)
        return min(max(opening, -1.0), 1.0)  # rounding


class Positions(NamedTuple):
    """Commands of a switching component, and its electrical input if one is described."""

    values: tuple[float, ...]
    signal: Signal | None = None

    def check(self, value: float, what: str, where: str | None = None) -> None:
        """Reject a command between the positions.

        Raises
        ------
        CommandError
            The command is not one of the positions.
        """
        if value not in self.values:
            *first, last = (f"{one:g}" for one in self.values)
            raise CommandError.of("describe.switches", where=where, what=what, first=", ".join(first), last=last)


def _signal(given: object) -> Signal:
    if isinstance(given, Signal):
        return given
    si_unit = "A" if str(given).rstrip().endswith("A") else "V"
    try:
        return Signal(*units.parse_range(given, si_unit), si_unit)
    except DescriptionError as error:
        what = f'"{given}" is not a range of voltage or current'
        raise DescriptionError(what, rule=error.rule, remedy=f"Write {_FORM}.") from None


#: Annotation of a field for a range of voltage or current, ``"0 V .. 10 V"``, stored as a `Signal`.
SIGNAL_RANGE = Reads(
    _signal,
    str,
    {"type": "string", "pattern": r"^.+\.\..+$", "description": f"a range of voltage or current, e.g. {_FORM}"},
)
