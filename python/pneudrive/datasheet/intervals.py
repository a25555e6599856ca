"""Intervals of identified values of a drive, carried through to what is computed of it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.describe.provenance import values

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.watch import Watch

SAID = "each identified value moved to both ends of its interval, the effects added as those of independent values"


class Ends(NamedTuple):
    """A value with an interval, and the drive with the value at both of its ends."""

    name: str
    confidence: float
    low: Drive
    high: Drive


def ends_of(drive: Any) -> tuple[list[Ends], list[str]]:  # noqa: ANN401 - a drive, or a circuit, which has none
    """Return the drives at the ends of each identified value, and the names of values with an open interval."""
    origins: dict[str, Any] = getattr(drive, "provenance", None) or {}
    if not origins:
        return [], []
    known = values(drive)
    found, left_out = [], []
    for name, origin in origins.items():
        mark = known[name].mark
        low, high = origin.bounds_si(mark)
        unit = getattr(mark, "si_unit", None)
        if unit is None or not (math.isfinite(low) and math.isfinite(high)):
            left_out.append(name)
            continue
        low_end, high_end = (
            drive.replace({name: units.UnitFloat(end, unit, mark.written) if unit else end})  # type: ignore[union-attr]
            for end in (low, high)
        )
        found.append(Ends(name, origin.confidence, low_end, high_end))  # type: ignore[arg-type]
    return found, left_out


def with_intervals(
    drive: Drive | Circuit, plain: xr.Dataset, compute: Callable[[Drive], xr.Dataset], watch: Watch
) -> xr.Dataset:
    """Add the lower and upper end of each result, as variables ``NAME_low`` and ``NAME_high``.

    A result at the ends of a value's interval differs from the plain one by some amount to each side; amounts of
    several values are added in quadrature. A drive without identified values is returned as it is.
    """
    ends, left_out = ends_of(drive)
    if left_out:
        plain.attrs["interval_left_out"] = left_out
    if not ends:
        plain.attrs["interval"] = "none: no value of the drive has an interval"
        return plain
    below = {name: np.zeros(one.shape) for name, one in plain.data_vars.items()}
    above = {name: np.zeros(one.shape) for name, one in plain.data_vars.items()}
    for one in watch.each(ends, "values"):
        moved = [compute(other) for other in (one.low, one.high)]
        for name, value in plain.data_vars.items():
            away = np.stack([np.zeros(value.shape), *(np.asarray(m[name]) - np.asarray(value) for m in moved)])
            below[name] += np.nan_to_num(away.min(axis=0)) ** 2
            above[name] += np.nan_to_num(away.max(axis=0)) ** 2
    confidence = min(one.confidence for one in ends)
    plain.attrs |= {
        "interval": SAID,
        "confidence": confidence,
        "interval_of": [one.name for one in ends],
    }
    for name, value in list(plain.data_vars.items()):
        said = {"units": value.attrs["units"], "long_name": f"{value.attrs['long_name']}, {{}} end of the interval"}
        low, high = np.asarray(value) - np.sqrt(below[name]), np.asarray(value) + np.sqrt(above[name])
        for end, bound, word in (("low", low, "lower"), ("high", high, "upper")):
            plain[f"{name}_{end}"] = (value.dims, bound, said | {"long_name": said["long_name"].format(word)})
        plain[name].attrs |= {"interval": f"{name}_low, {name}_high", "confidence": confidence}
    return plain
