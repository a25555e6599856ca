"""Units and names of results in readable form."""

from __future__ import annotations

import math

from pneudrive.numbers import plain

NARROWEST = 1e-6  # relative width of an interval that is not shown: rounding
#: Unit in SI -> factor and unit in which it is shown.
SHOWN_UNITS = {
    "Pa": (1e-5, "bar"),
    "m": (1e3, "mm"),
    "m3/(s Pa)": (1e8, "dm3/(s bar)"),
}


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor to the unit in which a result is shown, and that unit."""
    return SHOWN_UNITS.get(unit, (1.0, unit))


def in_words(name: str) -> str:
    """Return the name of a variable as words."""
    return name.replace("_", " ")


def written_value(value: float, unit: str, low: float | None = None, high: float | None = None) -> str:
    """Write a value with its unit, and its interval if it has one.

    Examples
    --------
    >>> written_value(5.3005e5, "Pa"), written_value(0.209, "s", 0.2, 0.215), written_value(math.nan, "s")
    ('5.30 bar', '0.209 s (0.200 .. 0.215)', 'none')
    """
    factor, shown = shown_unit(unit)
    if not math.isfinite(value):
        return "none" if math.isnan(value) else "infinite"
    text = f"{plain(factor * value)}{'' if shown == '1' else f' {shown}'}"
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return text
    ends = [plain(factor * end) for end in (low, high)]
    narrow = ends[0] == ends[1] or high - low <= NARROWEST * max(abs(value), 1e-6)
    return text if narrow else f"{text} ({ends[0]} .. {ends[1]})"
