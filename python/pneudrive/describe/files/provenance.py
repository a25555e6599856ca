"""Provenance of values of a drive: the interval of each identified value, and its recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import Field

from pneudrive import units
from pneudrive.describe.base import Described
from pneudrive.describe.marks import Bounds, EachChamber, Fraction, PerChamber, Quantity, Reads, StatedPressure
from pneudrive.describe.tables.friction import Friction
from pneudrive.errors import DescriptionError, invalid, nearest, wrong

#: Relative error of a value that is written with all its digits and read again.
ROUNDING = 1e-9


def _ends(given: object) -> tuple[str, str]:
    """Read both ends of an interval as texts. Ends are quantities, ``-inf`` or ``inf``, in the unit of the value."""
    is_pair = isinstance(given, list | tuple) and len(given) == 2
    if not is_pair or not all(isinstance(end, str | int | float) and not isinstance(end, bool) for end in given):  # type: ignore[union-attr]
        raise DescriptionError(f"{given!r} is not an interval", remedy='Write interval = ["29.1 N", "31.2 N"].')
    return str(given[0]), str(given[1])  # type: ignore[index]


_PAIR = {"type": "array", "items": {"type": ["string", "number"]}, "minItems": 2, "maxItems": 2}


class Origin(Described):
    """Origin of one value.

    `interval` holds both ends of a confidence interval, and `confidence` its coverage probability. `source` names the
    recordings. `fit` is the hash of the fit, and `file` the file of the fit. `model_error` is the lower limit of the
    model error, if known. `correlation` holds, by name of another value, the correlation between the
    errors of both values.
    """

    table_name: ClassVar[str] = "provenance"
    interval: Annotated[tuple[str, str], Reads(_ends, list, _PAIR)]
    confidence: Fraction = 0.95
    source: str
    fit: str = ""
    file: str = ""
    model_error: str | float = ""
    correlation: dict[str, Annotated[float, Quantity("", bounds=Bounds(at_least=-1.0, at_most=1.0))]] = Field(
        default_factory=dict
    )

    def bounds_si(self, mark: Quantity | StatedPressure) -> tuple[float, float]:
        """Return the interval in SI, with absolute or gauge pressures as written."""
        return _end(self.interval[0], mark), _end(self.interval[1], mark)


def _end(text: str, mark: Quantity | StatedPressure) -> float:
    if text in ("inf", "-inf"):
        return float(text)
    if isinstance(mark, StatedPressure):
        return units.parse_pressure(text).value_pa
    return units.parse(text, mark.si_unit) if mark.si_unit else float(text)


class GivenNumber(NamedTuple):
    """Number of a description: its annotation and its value in SI."""

    mark: Quantity | StatedPressure
    si: float


def values(table: Described) -> dict[str, GivenNumber]:
    """Return every given number of a drive or a table, by dotted key in the file.

    Examples
    --------
    >>> from pneudrive.describe import Drive
    >>> values(Drive.load("catalogue:reference"))["cylinder.dead_volume.a"].si
    1e-05
    """
    out: dict[str, GivenNumber] = {}
    for key, value, mark in table.entries():
        if isinstance(value, Described):
            out |= {f"{key}.{name}": number for name, number in values(value).items()}
        elif isinstance(value, PerChamber) and isinstance(mark, EachChamber):
            one = Quantity(mark.si_unit, mark.written)
            out |= {f"{key}.{chamber}": GivenNumber(one, si) for chamber, si in value._asdict().items()}
        elif isinstance(mark, Quantity | StatedPressure) and isinstance(value, float | units.Pressure):
            out[key] = GivenNumber(mark, value if isinstance(value, float) else value.value_pa)
    return out


def marks(drive: Described) -> dict[str, Quantity | StatedPressure]:
    """Return the annotation of every possible number of a drive, given or not."""
    tables = {key: value for key, value, _ in drive.entries() if isinstance(value, Described)}
    out = {
        f"{table}.{key}": mark
        for table, part in tables.items()
        if not isinstance(part, Friction)
        for key, mark in part.marks().items()
    }
    return out | {name: value.mark for name, value in values(drive).items()}


def check(drive: Described, origins: Mapping[str, Origin]) -> None:
    """Reject the origin of an unknown value, or of a value outside its interval (changed by hand).

    Raises
    ------
    DescriptionError
    """
    known = values(drive)
    for key, origin in origins.items():
        full = f"provenance.{key}"
        if key not in known:
            raise wrong(full, f'[provenance."{key}"] does not name a value of this drive', remedy=nearest(key, known))
        try:
            low, high = origin.bounds_si(known[key].mark)
        except (DescriptionError, ValueError) as error:
            what = error.what if isinstance(error, DescriptionError) else str(error)
            raise wrong(full, f'[provenance."{key}"].interval: {what}') from None
        value = known[key].si
        slack = ROUNDING * max(abs(value), abs(low) if math.isfinite(low) else 0.0, 1e-300)
        if not low - slack <= value <= high + slack:
            raise invalid(full, "describe.outside-interval", key=key, origin=origin)


def kept(before: Described, after: Described, origins: Mapping[str, Origin]) -> dict[str, Any]:
    """Return the origins of values that are equal in both drives, as plain tables."""
    old, new = values(before), values(after)
    return {
        key: origin.to_dict()
        for key, origin in origins.items()
        if key in old and key in new and old[key].si == new[key].si
    }
