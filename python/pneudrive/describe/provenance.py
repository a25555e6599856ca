"""Where values of a drive come from: the interval of each identified one and the recordings behind it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

from pneudrive import units
from pneudrive.describe.base import (
    Bounds,
    Described,
    EachChamber,
    PerChamber,
    Quantity,
    StatedPressure,
    WrongValueError,
    wrong,
)
from pneudrive.describe.friction import Friction
from pneudrive.describe.parameters import parameter_quantities
from pneudrive.errors import DescriptionError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

#: Of a value that is written with all its digits and read again.
ROUNDING = 1e-9


class Interval(NamedTuple):
    """Lower and upper bound as written: quantities, or ``-inf`` and ``inf`` where nothing bounds them."""

    low: str
    high: str


class _Ends(Quantity):
    """Annotation of a field that takes two texts."""

    def read(self, given: object) -> Interval:  # type: ignore[override]
        """Check the form alone: the unit is that of the value."""
        pair = isinstance(given, list | tuple) and len(given) == 2
        if not pair or not all(isinstance(end, str | int | float) and not isinstance(end, bool) for end in given):  # type: ignore[union-attr]
            raise WrongValueError(f"{given!r} is not an interval", remedy='Write interval = ["29.1 N", "31.2 N"].')
        return Interval(*(str(end) for end in given))  # type: ignore[union-attr]

    def show(self, value: Interval) -> list[str]:  # type: ignore[override]
        """Write both."""
        return list(value)

    def schema(self) -> dict[str, Any]:
        """Describe the form."""
        return {"type": "array", "items": {"type": ["string", "number"]}, "minItems": 2, "maxItems": 2}


class Origin(Described):
    """Where one value comes from.

    `interval` holds two quantities, `confidence` the probability that it is meant to cover the truth with, `source` the
    recordings, `fit` the hash of what was fitted, `model_error` the floor for model error where one is known.
    """

    table_name: ClassVar[str] = "provenance"
    interval: Annotated[Interval, _Ends("")]
    confidence: Annotated[float, Quantity("", bounds=Bounds(above=0.0, below=1.0))] = 0.95
    source: str
    fit: str = ""
    model_error: str | float = ""

    def bounds_si(self, mark: Quantity | StatedPressure | None) -> tuple[float, float]:
        """Return the interval in SI, pressures as they are written."""
        return _end(self.interval.low, mark), _end(self.interval.high, mark)


def _end(text: str, mark: Quantity | StatedPressure | None) -> float:
    if text in ("inf", "-inf"):
        return float(text)
    if isinstance(mark, StatedPressure):
        return units.parse_pressure(text).value_pa
    si_unit = mark.si_unit if mark is not None else ""
    if not si_unit:
        return float(text)
    return units.parse(text, si_unit)


class GivenNumber(NamedTuple):
    """A number of a description: its annotation and the number in SI."""

    mark: Quantity | StatedPressure | None
    si: float


def values(drive: Described) -> dict[str, GivenNumber]:
    """Every number that a drive gives, by its dotted name in the drive file.

    Examples
    --------
    >>> from pneudrive.describe import Drive
    >>> values(Drive.load("catalogue:reference"))["cylinder.dead_volume.a"].si
    1e-05
    """
    return dict(_walk(drive, ""))


def marks(drive: Described) -> dict[str, Quantity | StatedPressure | None]:
    """How every number is written that a drive gives, or could give: another size of its valve, a wall temperature."""
    out: dict[str, Quantity | StatedPressure | None] = {}
    for table, field in type(drive).model_fields.items():
        part = getattr(drive, table)
        if isinstance(part, Described) and not isinstance(part, Friction):
            for name, own in type(part).model_fields.items():
                mark = next((m for m in own.metadata if isinstance(m, Quantity | StatedPressure)), None)
                if mark is not None:
                    out[f"{field.alias or table}.{own.alias or name}"] = mark
    return out | {name: value.mark for name, value in values(drive).items()}


def _walk(part: Described, path: str) -> Iterator[tuple[str, GivenNumber]]:
    if isinstance(part, Friction):
        for key, mark in parameter_quantities(part.entry).items():
            if key in part.parameters:
                yield f"{path}{key}", GivenNumber(mark, part.parameters[key])
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        here = f"{path}{field.alias or name}"
        if isinstance(value, Described):
            yield from _walk(value, f"{here}.")
            continue
        mark = next((m for m in field.metadata if isinstance(m, Quantity | StatedPressure)), None)
        if isinstance(value, PerChamber) and isinstance(mark, EachChamber):
            one = Quantity(mark.si_unit, mark.written)
            yield from ((f"{here}.{c}", GivenNumber(one, getattr(value, c))) for c in "ab")
        elif isinstance(value, units.Pressure):
            yield here, GivenNumber(mark, value.value_pa)
        elif isinstance(value, float) and mark is not None:
            yield here, GivenNumber(mark, value)


def check(drive: Described, origins: Mapping[str, Origin]) -> None:
    """Refuse the origin of a value that there is not, or that lies outside its interval: it was changed by hand.

    Raises
    ------
    DescriptionError
    """
    if not origins:
        return
    known = values(drive)
    for key, origin in origins.items():
        full = f"provenance.{key}"
        if key not in known:
            raise wrong(full, f'[provenance."{key}"] is not a value of this drive', remedy=nearest(key, known))
        try:
            low, high = origin.bounds_si(known[key].mark)
        except (DescriptionError, ValueError) as error:
            what = error.what if isinstance(error, DescriptionError) else str(error)
            raise wrong(full, f'[provenance."{key}"].interval: {what}') from None
        value = known[key].si
        slack = ROUNDING * max(abs(value), abs(low) if math.isfinite(low) else 0.0, 1e-300)
        if not low - slack <= value <= high + slack:
            raise wrong(
                full,
                f"{key} lies outside its interval {origin.interval.low} .. {origin.interval.high}",
                rule="an interval holds the value that it is of",
                remedy=f'If {key} was changed by hand, take [provenance."{key}"] out.',
            )


def kept(before: Described, after: Described, origins: Mapping[str, Origin]) -> dict[str, Any]:
    """Return those of the origins whose values are the same in both drives, as plain tables."""
    old, new = values(before), values(after)
    return {
        key: origin.to_dict()
        for key, origin in origins.items()
        if key in old and key in new and old[key].si == new[key].si
    }
