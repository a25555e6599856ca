"""Annotations for the parameters that the core lists, with unit and bounds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.describe.marks import Bounds, Quantity

if TYPE_CHECKING:
    from collections.abc import Mapping


def parameter_quantity(parameter: Mapping[str, Any]) -> Quantity:
    """Return the annotation of one parameter: SI unit, preferred unit, bounds."""
    si_unit = units.si_name(parameter["unit"])
    written = units.readable(si_unit)[1]
    low, high = parameter["lower"], parameter["upper"]
    low = None if low is None or math.isinf(low) else low
    high = None if high is None or math.isinf(high) else high
    lower = {"above" if parameter["open"] else "at_least": low}
    upper = {"below" if parameter["open_above"] else "at_most": high}
    return Quantity(si_unit, written if units.is_unit(written) else None, Bounds(**lower, **upper))


def parameter_quantities(entry: Mapping[str, Any]) -> dict[str, Quantity]:
    """Return the annotation of each parameter of a law or a component by its key."""
    return {p["key"]: parameter_quantity(p) for p in entry["parameters"]}
