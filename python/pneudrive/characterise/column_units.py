"""Units of recorded columns: a factor to SI, and for pressures gauge or absolute.

Only what a layout file needs, without loading a unit library: a recording has a handful of columns.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

# Unit -> (dimension, factor to SI). Exact by definition, except psi and lbf: their exact definitions through
# the pound (0.45359237 kg), standard gravity (9.80665 m/s2) and the inch (25.4 mm).
_LBF = 0.45359237 * 9.80665
UNITS: dict[str, tuple[str, float]] = {
    "s": ("time", 1.0),
    "ms": ("time", 1e-3),
    "us": ("time", 1e-6),
    "min": ("time", 60.0),
    "h": ("time", 3600.0),
    "m": ("length", 1.0),
    "cm": ("length", 1e-2),
    "mm": ("length", 1e-3),
    "um": ("length", 1e-6),
    "in": ("length", 0.0254),
    "inch": ("length", 0.0254),
    "N": ("force", 1.0),
    "kN": ("force", 1e3),
    "mN": ("force", 1e-3),
    "kgf": ("force", 9.80665),
    "lbf": ("force", _LBF),
    "Pa": ("pressure", 1.0),
    "hPa": ("pressure", 1e2),
    "kPa": ("pressure", 1e3),
    "MPa": ("pressure", 1e6),
    "mbar": ("pressure", 1e2),
    "bar": ("pressure", 1e5),
    "psi": ("pressure", _LBF / 0.0254**2),
    "kg": ("mass", 1.0),
    "g": ("mass", 1e-3),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180.0),
    "m2": ("area", 1.0),
    "cm2": ("area", 1e-4),
    "mm2": ("area", 1e-6),
    "N/m": ("stiffness", 1.0),
    "N/mm": ("stiffness", 1e3),
    "kN/m": ("stiffness", 1e3),
    "N/um": ("stiffness", 1e6),
    "%": ("ratio", 1e-2),
    "": ("ratio", 1.0),
}
_ALIASES = {"µm": "um", "μm": "um", "µs": "us", "μs": "us", "sec": "s", "degree": "deg", "°": "deg", "mm²": "mm2"}
_PRESSURE_KINDS = {"gauge": "gauge", "g": "gauge", "rel": "gauge", "abs": "abs", "absolute": "abs", "a": "abs"}
_QUANTITY = re.compile(r"^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*$")


class UnitProblem(ValueError):  # noqa: N818 - turned into a LayoutError with file and line by its only caller
    """A unit or quantity that cannot be used, with the rule that it breaks."""


@dataclass(frozen=True)
class ColumnUnit:
    """Factor to SI; ``kind`` is "gauge" or "abs" for pressures, "" otherwise."""

    dimension: str
    factor: float
    kind: str = ""


def parse_unit(text: str, dimension: str, *, difference: bool = False) -> ColumnUnit:
    """Read a column's unit.

    Parameters
    ----------
    text
        Such as ``"mm"`` or ``"bar gauge"``.
    dimension
        What the column must be: time, length, force, pressure, ...
    difference
        True for an uncertainty of a pressure, which is neither gauge nor absolute.

    Raises
    ------
    UnitProblem
        Unknown unit, wrong dimension, gauge or absolute not said.

    Examples
    --------
    >>> parse_unit("bar gauge", "pressure")
    ColumnUnit(dimension='pressure', factor=100000.0, kind='gauge')
    """
    words = text.split()
    kind = ""
    if len(words) > 1 and words[-1].lower() in _PRESSURE_KINDS:
        kind = _PRESSURE_KINDS[words.pop().lower()]
    name = "".join(words)
    name = _ALIASES.get(name, name)
    if name not in UNITS:
        choices = ", ".join(u for u, (d, _) in UNITS.items() if d == dimension)
        raise UnitProblem(f"unit '{text}' is not known; for a {dimension}: {choices}")
    found, factor = UNITS[name]
    if found != dimension:
        raise UnitProblem(f"unit '{text}' is a {found} where a {dimension} is needed")
    if dimension == "pressure" and not difference and not kind:
        raise UnitProblem(f"'{text}' does not say gauge or abs: write '{name} gauge' or '{name} abs'")
    if kind and (dimension != "pressure" or difference):
        raise UnitProblem(f"'{text}': gauge or abs has no meaning here")
    return ColumnUnit(dimension, factor, kind)


def parse_quantity(text: object, dimension: str, *, difference: bool = False) -> tuple[float, ColumnUnit]:
    """Read a value with its unit: (value in SI, unit).

    Examples
    --------
    >>> parse_quantity("25 mm", "length")[0]
    0.025
    """
    if not isinstance(text, str):
        raise UnitProblem(f'{text!r} has no unit: write it in quotes with a unit, as in "5 {_example(dimension)}"')
    match = _QUANTITY.match(text)
    if not match:
        raise UnitProblem(f"'{text}' is not a number with a unit, as in \"5 {_example(dimension)}\"")
    number, unit_text = match.groups()
    if not unit_text and dimension != "ratio":
        raise UnitProblem(f"'{text}' has no unit, as in \"{number} {_example(dimension)}\"")
    unit = parse_unit(unit_text, dimension, difference=difference)
    value = float(number) * unit.factor
    if not math.isfinite(value):
        raise UnitProblem(f"'{text}' is not finite")
    return value, unit


def parse_range(text: object, dimension: str, *, difference: bool = False) -> tuple[float, float]:
    """Read ``"5 mm .. 30 mm"`` (or ``"5 .. 30 mm"``) as (low, high) in SI."""
    parts = text.split("..") if isinstance(text, str) else []
    if len(parts) != 2:
        raise UnitProblem(f'{text!r} is not a range: write it as "5 {_example(dimension)} .. 30 {_example(dimension)}"')
    if re.fullmatch(r"\s*[-+\d.eE]+\s*", parts[0]):
        unit = _QUANTITY.match(parts[1])
        parts[0] += f" {unit.group(2)}" if unit else ""
    low, high = (parse_quantity(part, dimension, difference=difference)[0] for part in parts)
    if not low < high:
        raise UnitProblem(f"'{text}': the first value must be the smaller one")
    return low, high


def _example(dimension: str) -> str:
    name = next(u for u, (d, _) in UNITS.items() if d == dimension)
    examples = {"length": "mm", "pressure": "bar gauge", "time": "ms", "area": "cm2", "angle": "deg"}
    return examples.get(dimension, name)
