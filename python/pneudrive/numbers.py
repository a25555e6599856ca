"""Numbers with units and uncertainty as text, for sentences and tables."""

from __future__ import annotations

import math
from typing import Any


def with_interval(e: Any, factor: float = 1.0, unit: str | None = None) -> str:  # noqa: ANN401
    """Write a value with its 95 % interval. An unbounded upper end is "…".

    Examples
    --------
    >>> from pneudrive.characteristics import Estimate
    >>> with_interval(Estimate(1.2345e-5, 1.1e-5, 1.4e-5, 1e-6, "N/Pa"), 1e5, "N/bar")
    '1.23 (1.10 … 1.40) N/bar'
    """
    if e is None or not math.isfinite(e.value):
        return "not determined"
    value, low, high = (factor * float(v) for v in (e.value, e.low, e.high))
    reach = max(abs(high - value) if math.isfinite(high) else 0.0, abs(value - low), 1e-12)
    digits = min(places(reach), 6) if math.isfinite(reach) else 0
    top = fixed(high, digits) if math.isfinite(high) else "…"
    return f"{fixed(value, digits)} ({fixed(low, digits)} … {top}) {e.unit if unit is None else unit}".strip()


def with_u(value: float, expanded: float, unit: str = "N") -> str:
    """Write a value with its expanded uncertainty. Both are rounded to two digits of the uncertainty.

    Examples
    --------
    >>> with_u(9.7862, 0.4873)
    '9.79 ± 0.49 N'
    >>> with_u(98.2, 11.4, "")
    '98 ± 11'
    >>> with_u(-0.0001, 0.064)  # no "-0.000"
    '0.000 ± 0.064 N'
    """
    if not (math.isfinite(value) and math.isfinite(expanded)):
        return f"{value:.3g} {unit}".strip() if math.isfinite(value) else "not determined"
    digits = places(expanded)
    return f"{fixed(value, digits)} ± {expanded:.{digits}f} {unit}".strip()


def places(uncertainty: float) -> int:
    """Return the number of decimal places with which an uncertainty has two significant digits."""
    if not uncertainty > 0.0:
        return 2
    return min(max(1 - math.floor(math.log10(uncertainty)), 0), 9)


def plain(value: float, digits: int = 3) -> str:
    """Write a number with `digits` significant digits, without an exponent if possible, and never as "-0".

    Examples
    --------
    >>> plain(312.4, 2), plain(-0.0), plain(0.0123456), plain(2.5e7)
    ('310', '0', '0.0123', '2.5e+07')
    """
    if not math.isfinite(value):
        return str(value)
    rounded = float(f"{value:.{digits}g}") + 0.0
    if rounded and not 1e-4 <= abs(rounded) < 1e6:
        return f"{rounded:.{digits}g}"
    decimals = digits - 1 - math.floor(math.log10(abs(rounded))) if rounded % 1.0 else 0
    return f"{rounded:.{max(0, decimals)}f}"


def fixed(value: float, decimals: int) -> str:
    """Write a number with a fixed number of decimals, never as "-0.0".

    Examples
    --------
    >>> fixed(-0.04, 1), fixed(-0.06, 1)
    ('0.0', '-0.1')
    """
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def duration(seconds: float) -> str:
    """Write a duration in days, hours, minutes or seconds, with at most two of these units.

    Examples
    --------
    >>> duration(4.2), duration(190), duration(7300), duration(200_000)
    ('4 s', '3 min 10 s', '2 h 1 min', '2 d 7 h')
    """
    whole = round(seconds)
    words = ("d", 86400, "h", 3600), ("h", 3600, "min", 60), ("min", 60, "s", 1)
    for name, size, below, part in words:
        if whole >= size:
            return f"{whole // size} {name} {whole % size // part} {below}"
    return f"{whole} s"
