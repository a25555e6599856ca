"""Quantities with units, converted to SI once, at the boundary.

A quantity is written as a number and a unit, ``"25 mm"``. A pressure is also marked as absolute or gauge, ``"3 bar
abs"`` or ``"2 bar gauge"``. The table below converts common units, pint all others. pint is imported
only when needed, because its import takes longer than a whole simulation. A test compares the table with pint.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from typing import TYPE_CHECKING

from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.errors import DescriptionError

if TYPE_CHECKING:
    import pint

_BAR, _PSI, _L_MIN = 1.0e5, 6894.757293168361, 1.0e-3 / 60.0  # psi: 0.45359237 kg * 9.80665 m/s2 / (25.4 mm)2

# unit as written -> (SI unit, factor, offset): SI value = number * factor + offset
_TABLE: dict[str, tuple[str, float, float]] = {
    **{u: ("m", f, 0.0) for u, f in {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254}.items()},
    "km": ("m", 1e3, 0.0),
    **{u: ("kg m^2", f, 0.0) for u, f in {"kg m2": 1.0, "kg cm2": 1e-4, "kg mm2": 1e-6, "g cm2": 1e-7}.items()},
    **{u: ("m^2", f, 0.0) for u, f in {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6}.items()},
    **{
        u: ("m^3", f, 0.0) for u, f in {"m3": 1.0, "dm3": 1e-3, "l": 1e-3, "cm3": 1e-6, "ml": 1e-6, "mm3": 1e-9}.items()
    },
    **{u: ("kg", f, 0.0) for u, f in {"kg": 1.0, "g": 1e-3}.items()},
    **{u: ("s", f, 0.0) for u, f in {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}.items()},
    **{u: ("1/s", f, 0.0) for u, f in {"Hz": 1.0, "kHz": 1e3, "1/s": 1.0}.items()},
    **{u: ("N", f, 0.0) for u, f in {"N": 1.0, "mN": 1e-3, "kN": 1e3}.items()},
    **{u: ("m/s", f, 0.0) for u, f in {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "um/s": 1e-6}.items()},
    **{u: ("m/s^2", f, 0.0) for u, f in {"m/s2": 1.0, "mm/s2": 1e-3}.items()},
    **{u: ("m/s^3", f, 0.0) for u, f in {"m/s3": 1.0, "mm/s3": 1e-3}.items()},
    **{u: ("m/s^4", f, 0.0) for u, f in {"m/s4": 1.0, "mm/s4": 1e-3}.items()},
    **{u: ("rad", f, 0.0) for u, f in {"rad": 1.0, "deg": math.pi / 180.0, "°": math.pi / 180.0}.items()},
    **{u: ("K", 1.0, o) for u, o in {"K": 0.0, "degC": ZERO_CELSIUS_K, "°C": ZERO_CELSIUS_K}.items()},
    **{
        u: ("Pa", f, 0.0) for u, f in {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "bar": _BAR, "psi": _PSI}.items()
    },
    **{u: ("N/m", f, 0.0) for u, f in {"N/m": 1.0, "N/mm": 1e3, "kN/m": 1e3}.items()},
    **{u: ("N s/m", f, 0.0) for u, f in {"N s/m": 1.0, "N s/mm": 1e3, "kg/s": 1.0}.items()},
    **{u: ("kg/m", f, 0.0) for u, f in {"kg/m": 1.0, "kg/mm": 1e3, "N s2/m2": 1.0}.items()},
    **{u: ("N/Pa", f, 0.0) for u, f in {"N/Pa": 1.0, "N/bar": 1e-5, "N/kPa": 1e-3, "N/MPa": 1e-6}.items()},
    **{u: ("N/s", f, 0.0) for u, f in {"N/s": 1.0, "N/h": 1.0 / 3600.0}.items()},
    **{u: ("m/(s Pa)", f, 0.0) for u, f in {"m/(s Pa)": 1.0, "mm/(s bar)": 1e-8}.items()},
    **{u: ("V", f, 0.0) for u, f in {"V": 1.0, "mV": 1e-3}.items()},
    **{u: ("A", f, 0.0) for u, f in {"A": 1.0, "mA": 1e-3}.items()},
    "N/K": ("N/K", 1.0, 0.0),
    "K/W": ("K/W", 1.0, 0.0),
    "W/K": ("W/K", 1.0, 0.0),
    **{u: ("1/K", f, 0.0) for u, f in {"1/K": 1.0, "%/K": 1e-2}.items()},
    **{u: ("1/Pa", f, 0.0) for u, f in {"1/Pa": 1.0, "1/bar": 1e-5, "%/bar": 1e-7}.items()},
    **{u: ("1/m", f, 0.0) for u, f in {"1/m": 1.0, "%/m": 1e-2, "%/km": 1e-5}.items()},
    "W/(m2 K)": ("W/(m^2 K)", 1.0, 0.0),
    **{u: ("J", f, 0.0) for u, f in {"J": 1.0, "mJ": 1e-3, "kJ": 1e3}.items()},
    "J/(kg K)": ("J/(kg K)", 1.0, 0.0),
    **{u: ("J/K", f, 0.0) for u, f in {"J/K": 1.0, "kJ/K": 1e3}.items()},
    "dm3/(s bar)": ("m^3/(s Pa)", 1e-8, 0.0),
    "l/(s bar)": ("m^3/(s Pa)", 1e-8, 0.0),
    "m3/(s Pa)": ("m^3/(s Pa)", 1.0, 0.0),
    # volume flow at the standard reference atmosphere: not a plain volume flow, and therefore a separate dimension
    **{f"{u} ANR": ("m^3/s ANR", f, 0.0) for u, f in {"l/min": _L_MIN, "l/s": 1e-3, "dm3/min": _L_MIN}.items()},
    **{f"{u} ANR": ("m^3/s ANR", f, 0.0) for u, f in {"dm3/s": 1e-3, "m3/h": 1 / 3600.0, "m3/s": 1.0}.items()},
}

# SI unit -> its quantity in messages, with an example that a user can copy
KINDS: dict[str, tuple[str, str]] = {
    "m": ("a length", "25 mm"),
    "m^2": ("an area", "4.9 cm2"),
    "m^3": ("a volume", "10 cm3"),
    "kg": ("a mass", "2 kg"),
    "s": ("a time", "2 s"),
    "1/s": ("a frequency", "1 kHz"),
    "N": ("a force", "30 N"),
    "m/s": ("a velocity", "20 mm/s"),
    "m/(s Pa)": ("a velocity per pressure", "2 mm/(s bar)"),
    "m/s^2": ("an acceleration", "1 m/s2"),
    "m/s^3": ("a jerk", "500 m/s3"),
    "m/s^4": ("a snap", "5e4 m/s4"),
    "rad": ("an angle", "30 deg"),
    "K": ("a temperature", "20 degC"),
    "Pa": ("a pressure", "7 bar abs"),
    "V": ("a voltage", "5 V"),
    "A": ("a current", "12 mA"),
    "N/m": ("a stiffness", "1e6 N/m"),
    "N s/m": ("a viscous coefficient", "40 N s/m"),
    "kg m^2": ("a moment of inertia", "0.02 kg m2"),
    "kg/m": ("a damping proportional to the square of speed", "100 kg/m"),
    "N/Pa": ("a force per pressure", "1.0 N/bar"),
    "1/Pa": ("a share per pressure", "10 %/bar"),
    "1/m": ("a share per length", "5 %/m"),
    "N/s": ("a force per time", "0.05 N/h"),
    "N/K": ("a force per temperature", "0.02 N/K"),
    "K/W": ("a thermal resistance", "0.5 K/W"),
    "W/K": ("a thermal conductance", "2 W/K"),
    "1/K": ("a share per temperature", "0.02 1/K"),
    "W/(m^2 K)": ("a heat transfer coefficient", "30 W/(m2 K)"),
    "J": ("an energy", "0.5 J"),
    "J/(kg K)": ("a specific gas constant", "287.05 J/(kg K)"),
    "J/K": ("a heat capacity", "500 J/K"),
    "m^3/(s Pa)": ("a sonic conductance", "2 dm3/(s bar)"),
    "m^3/s ANR": ("a flow of normal litres", "700 l/min ANR"),
}

#: Rules of messages for a pressure, and for a difference of two, which has neither abs nor gauge.
PRESSURE_NEEDED = 'a pressure is needed, e.g. "7 bar abs"'
_DIFFERENCE_NEEDED = 'a difference of pressures is needed, without abs or gauge, e.g. "0.3 bar"'

_NUMBER = re.compile(
    r"\s*([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:infinity|inf|nan)\b)(?![\d.,])(.*)$",
    re.IGNORECASE | re.DOTALL,
)
LARGEST = 1e30  # in SI: squares and products of quantities of a drive or a rig stay finite
LONGEST_UNIT = 40
_ZERO_CELSIUS_LITRE = re.compile(r"\b(Nl|NL|Nm3|sl|slm|slpm|scfm|SCFM|NLPM|nl)\b")


@dataclass(frozen=True)
class Pressure:
    """Pressure, absolute or gauge.

    Parameters
    ----------
    value_pa : float
        Value as stated, Pa.
    gauge : bool
        Whether the value is above ambient pressure rather than above vacuum.
    """

    value_pa: float
    gauge: bool

    def absolute_pa(self, ambient_pa: float) -> float:
        """Return Pa above vacuum, given the ambient pressure in Pa above vacuum.

        Examples
        --------
        >>> parse_pressure("6 bar gauge").absolute_pa(1.0e5)
        700000.0
        """
        return self.value_pa + ambient_pa if self.gauge else self.value_pa

    def to(self, unit: str) -> float:
        """Return the value in another unit, absolute or gauge as stated.

        Examples
        --------
        >>> parse_pressure("6 bar gauge").to("kPa")
        600.0
        """
        return _in_unit(self.value_pa, "Pa", unit)

    def __str__(self) -> str:
        """Return a text that `parse_pressure` reads back exactly."""
        return f"{write(self.value_pa, 'Pa', 'bar')} {'gauge' if self.gauge else 'abs'}"

    __repr__ = __str__


class UnitFloat(float):
    """Number in SI that is displayed in its common unit.

    Arithmetic uses the plain SI number; only the displayed text has the common unit.

    Attributes
    ----------
    si_unit : str
        SI unit of the plain number ``si``.
    unit : str
        Unit of the displayed text.

    Examples
    --------
    >>> bore = UnitFloat(0.025, "m", "mm")
    >>> bore, f"bore {bore:.1f}", 2.0 * bore, bore.si, bore.to("cm")
    (25 mm, 'bore 25.0 mm', 0.05, 0.025, 2.5)
    """

    si_unit: str
    unit: str

    def __new__(cls, si: float, si_unit: str, unit: str | None = None) -> UnitFloat:
        """Make a number from its SI value."""
        made = super().__new__(cls, si)
        made.si_unit = si_unit
        made.unit = unit or si_unit.replace("^", "")
        return made

    @property
    def si(self) -> float:
        """The plain number, in `si_unit`."""
        return float(self)

    def to(self, unit: str) -> float:
        """Return the number in another unit of the same dimension.

        Raises
        ------
        DescriptionError
            Unknown unit, or one of another dimension.
        """
        return _in_unit(self, self.si_unit, unit)

    def si_as(self, si_unit: str) -> float:
        """Return the plain number if a quantity of this unit is requested.

        Raises
        ------
        DescriptionError
            The quantity has another dimension.
        """
        if self.si_unit != si_unit:
            raise _wrong_dimension(self.si_unit, si_unit, kind(self.si_unit).partition(",")[0])
        return self.si

    def __str__(self) -> str:
        return f"{self:.7g}"

    __repr__ = __str__

    def __format__(self, spec: str) -> str:
        """Format the number by `spec`, followed by its unit."""
        return f"{self.to(self.unit):{spec or '.7g'}} {self.unit}"

    def __reduce__(self) -> tuple[object, ...]:
        """Keep the unit in copies and pickles."""
        return type(self), (float(self), self.si_unit, self.unit)


def _in_unit(si: float, si_unit: str, unit: str) -> float:
    factor, offset = converter(unit, si_unit)
    return float((Decimal(repr(float(si))) - Decimal(repr(offset))) / Decimal(repr(factor)))


def kind(si_unit: str) -> str:
    """Name the quantity of a unit, with an example: ``a length, e.g. "25 mm"``."""
    name, example = KINDS.get(si_unit, (f"a quantity in {si_unit}", f"1 {si_unit}"))
    return f'{name}, e.g. "{example}"'


def is_unit(text: str) -> bool:
    """Return whether a text is a common unit; a pressure may have ``abs`` or ``gauge``.

    Examples
    --------
    >>> is_unit("bar gauge"), is_unit("Reibung")
    (True, False)
    """
    return text.removesuffix(" gauge").removesuffix(" abs") in _TABLE


def suffix(si_unit: str) -> str:
    """Return the suffix of names of numbers in an SI unit; empty for a pure number.

    Examples
    --------
    >>> suffix("m^3/(s Pa)")
    'm3_s_pa'
    """
    return re.sub(r"[^a-z0-9]+", "_", si_unit.lower().replace("^", "")).strip("_")


def column_name(name: str, unit: str) -> str:
    """Return the name of a column that carries its unit.

    Examples
    --------
    >>> column_name("cylinder.bore", "m"), column_name("friction.stribeck_exponent", "1")
    ('cylinder.bore_m', 'friction.stribeck_exponent')
    """
    return name if unit in ("", "1") else f"{name}_{suffix(unit)}"


def needed(si_unit: str) -> str:
    """Return the rule of a message: ``a length is needed, e.g. "25 mm"``; in Pa, a difference of two pressures."""
    return _DIFFERENCE_NEEDED if si_unit == "Pa" else kind(si_unit).replace(", e.g.", " is needed, e.g.", 1)


def parse(text: str, si_unit: str) -> float:
    """Convert a quantity to SI.

    Parameters
    ----------
    text : str
        Number and unit.
    si_unit : str
        Wanted SI unit: ``"m"``, ``"N s/m"``, ``"m^3/(s Pa)"``, ...

    Returns
    -------
    float
        The value in `si_unit`.

    Raises
    ------
    DescriptionError
        The text has no number, no unit or a unit of another dimension, or the value is not finite.

    Examples
    --------
    >>> parse("25 mm", "m")
    0.025
    >>> parse("20 degC", "K")
    293.15
    """
    if not isinstance(text, str):
        raise DescriptionError(f"{text!r} has no unit", rule=needed(si_unit))
    return _parsed(text, si_unit)


@lru_cache(maxsize=4096)
def _parsed(text: str, si_unit: str) -> float:
    number, unit = _split(text, si_unit)
    value = _apply(number, *converter(unit, si_unit))
    if not abs(value) <= LARGEST:
        raise DescriptionError(f'"{text}" is out of bounds', rule=f"quantities are at most {LARGEST:g} {si_unit}")
    return value


def parse_pressure(text: str) -> Pressure:
    """Read a pressure with ``abs`` or ``gauge``.

    Raises
    ------
    DescriptionError
        The text has neither of them, or is not a pressure.

    Examples
    --------
    >>> parse_pressure("3 bar abs")
    3 bar abs
    """
    words = text.split()
    try:
        if words and words[-1] in {"abs", "gauge"}:
            return Pressure(parse(" ".join(words[:-1]), "Pa"), gauge=words[-1] == "gauge")
        number, unit = _split(text, "Pa")
        converter(unit, "Pa")  # a wrong dimension is the greater mistake: report that first
    except DescriptionError as error:
        rule = PRESSURE_NEEDED if error.rule == _DIFFERENCE_NEEDED else error.rule
        raise DescriptionError(error.what, rule=rule, remedy=error.remedy) from None
    raise DescriptionError(
        f'pressure "{text}" does not state abs or gauge',
        rule="a pressure is absolute (abs) or above ambient (gauge)",
        remedy=f'Write "{number} {unit} abs" or "{number} {unit} gauge".',
    )


def parse_range(text: str, si_unit: str) -> tuple[float, float]:
    """Read ``"5 mm .. 30 mm"`` as two SI values, the lower one first.

    Raises
    ------
    DescriptionError
        The text is not two quantities, or the first is not below the second.
    """
    ends = text.split("..")
    if len(ends) != 2:
        raise DescriptionError(f'"{text}" is not a range', remedy='Write two quantities, e.g. "5 mm .. 30 mm".')
    low, high = (parse(end.strip(), si_unit) for end in ends)
    if not low < high:
        raise DescriptionError(f'range "{text}" is empty', rule="the first end lies below the second")
    return low, high


def share_of(given: object) -> float | None:
    """Read ``"5 %"`` as 0.05; None if the text is not a percentage."""
    if not isinstance(given, str) or not given.rstrip().endswith("%"):
        return None
    try:
        value = float(given.rstrip()[:-1])
    except ValueError:
        return None
    return value / 100.0 if math.isfinite(value) else None


def write_share(value: float) -> str:
    """Write a fraction in per cent that reads back to the same number.

    Examples
    --------
    >>> write_share(0.05)
    '5 %'
    """
    for digits in (6, 12, 17):
        text = f"{100.0 * value:.{digits}g}"
        if float(text) / 100.0 == value:
            break
    return f"{text} %"


def si_name(unit: str) -> str:
    """Return an SI unit in the package's notation (``m2`` -> ``m^2``, ``kg/s`` -> ``N s/m``), others unchanged.

    Examples
    --------
    >>> si_name("m2"), si_name("N s2/m2"), si_name("N s3/m3"), si_name("-")
    ('m^2', 'kg/m', 'N s3/m3', '')
    """
    plain = _canonical(unit)
    if plain in {"-", "1"}:
        return ""
    si, factor, offset = _TABLE.get(plain, (unit.strip(), 1.0, 0.0))
    return si if (factor, offset) == (1.0, 0.0) else unit.strip()


@lru_cache(maxsize=1024)
def converter(unit: str, si_unit: str) -> tuple[float, float]:
    """Return (factor, offset) with SI value = number * factor + offset.

    Parameters
    ----------
    unit : str
        A unit as users write it, without ``abs`` or ``gauge``.
    si_unit : str
        Wanted SI unit.

    Raises
    ------
    DescriptionError
        Unknown unit, or one of another dimension.
    """
    known = _TABLE.get(_canonical(unit))
    if known is None or (known[0] != si_unit and si_unit not in KINDS):
        return _converter_pint(unit, si_unit)
    si, factor, offset = known
    if si != si_unit:
        raise _wrong_dimension(unit, si_unit, KINDS[si][0])
    return factor, offset


def write(value: float, si_unit: str, unit: str | None = None) -> str:
    """Write an SI value as a quantity that `parse` reads back exactly.

    Parameters
    ----------
    value : float
        In `si_unit`.
    si_unit : str
        Unit of `value`, as in `parse`.
    unit : str, optional
        Preferred unit of the text; SI if the conversion would not be exact.

    Examples
    --------
    >>> write(0.025, "m", "mm")
    '25 mm'
    """
    value = float(value)
    if unit is not None:
        _, factor, offset = _TABLE[unit]
        for digits in (12, 15, 17):
            number = f"{(value - offset) / factor:.{digits}g}"
            if _apply(number, factor, offset) == value:
                return f"{number} {unit}"
        exact = (Decimal(repr(value)) - Decimal(repr(offset))) / Decimal(repr(factor))
        if len(exact.as_tuple().digits) <= 17 and 1e-4 <= abs(exact) < 1e15:
            return f"{exact:f} {unit}"
    plain = {"m^3/s ANR": "m3/s ANR"}.get(si_unit, si_unit.replace("^", ""))
    return f"{value!r} {plain}"


def like(unit: str) -> list[str]:
    """Return the common units for the quantity of a unit; for a pressure, absolute or gauge like the given unit.

    Examples
    --------
    >>> like("mm"), like("bar gauge")[:2], like("furlong")
    (['m', 'cm', 'mm', 'um', 'in', 'km'], ['Pa gauge', 'kPa gauge'], [])
    """
    plain, said = _said(unit)
    known = _TABLE.get(_canonical(plain))
    if known is None:
        return []
    sizes: dict[tuple[str, float, float], str] = {}
    for name, size in _TABLE.items():
        if size[0] == known[0]:
            sizes.setdefault(size, name)
    return [f"{plain if size == known else name}{said}" for size, name in sizes.items()]


def in_unit(text: str, unit: str) -> str:
    """Write a quantity in another unit, so that it is read back exactly.

    Parameters
    ----------
    text : str
        Number and unit; of a pressure with ``abs`` or ``gauge``, or without.
    unit : str
        One of `like` its unit.

    Raises
    ------
    DescriptionError
        The text is not a quantity, or the unit one of another quantity.

    Examples
    --------
    >>> in_unit("25.4 mm", "in"), in_unit("7 bar abs", "kPa abs"), in_unit("20 degC", "K")
    ('1 in', '700 kPa abs', '293.15 K')
    """
    plain, said = _said(text)
    wanted, wanted_said = _said(unit)
    known = _TABLE.get(_canonical(wanted))
    if known is None or said != wanted_said:
        raise DescriptionError(f'"{text}" cannot be written in "{unit}"', rule="a common unit of the same quantity")
    return f"{write(parse(plain, known[0]), known[0], _canonical(wanted))}{said}"


def _said(text: str) -> tuple[str, str]:
    """Split ``abs`` or ``gauge`` from a unit or a quantity."""
    end = next((one for one in (" abs", " gauge") if text.rstrip().endswith(one)), "")
    return text.rstrip().removesuffix(end), end


#: SI unit -> common unit, if they differ.
_READABLE = {
    "m": "mm",
    "m^3": "cm3",
    "m/s": "mm/s",
    "rad": "deg",
    "Pa": "bar",
    "N/Pa": "N/bar",
    "1/Pa": "%/bar",
    "m/(s Pa)": "mm/(s bar)",
    "m^3/(s Pa)": "dm3/(s bar)",
    "s": "s",
}


def readable(si_unit: str) -> tuple[float, str]:
    """Return the common unit for an SI unit, with its size in SI.

    Examples
    --------
    >>> readable("m^3/(s Pa)")
    (1e-08, 'dm3/(s bar)')
    >>> readable("1")
    (1.0, '')
    """
    unit = _READABLE.get(si_unit)
    if unit is not None:
        return _TABLE[unit][1], unit
    return 1.0, "" if si_unit == "1" else si_unit.replace("^", "")


def _apply(number: str, factor: float, offset: float) -> float:
    """Convert in decimal arithmetic and round once.

    "1.013 bar" is exactly 101300.0; a product of floats is not.
    """
    return float(Decimal(number) * Decimal(repr(factor)) + Decimal(repr(offset)))


def _canonical(unit: str) -> str:
    return unit.strip().replace("²", "2").replace("³", "3").replace("^", "").replace("*", " ").replace("·", " ")


def _split(text: str, si_unit: str) -> tuple[str, str]:
    """Split a quantity into the number, as written, and the unit."""
    match = _NUMBER.match(text)
    if match is None:
        comma = re.match(r"\s*[+-]?\d+,\d", text)
        remedy = "Use a decimal point, not a comma." if comma else "Write a number, a space and a unit."
        raise DescriptionError(f'"{text}" is not a quantity', rule=needed(si_unit), remedy=remedy)
    number, unit = match[1], match[2].strip()
    if not math.isfinite(float(number)):
        raise DescriptionError(f'"{text}" is not finite', rule=needed(si_unit))
    if not unit:
        raise DescriptionError(f'"{text}" has no unit', rule=needed(si_unit))
    return number, unit


def _wrong_dimension(unit: str, si_unit: str, is_a: str) -> DescriptionError:
    return DescriptionError(f'unit "{unit}" is {is_a}', rule=needed(si_unit))


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    import pint

    return pint.UnitRegistry()


def _converter_pint(unit: str, si_unit: str) -> tuple[float, float]:
    if unit.endswith((" abs", " gauge")):
        raise _wrong_dimension(unit, si_unit, "a pressure, not a difference" if si_unit == "Pa" else "a pressure")
    if _ZERO_CELSIUS_LITRE.search(unit) or (si_unit == "m^3/s ANR" and not unit.endswith("ANR")):
        raise DescriptionError(
            f'"{unit}" lacks the reference pressure and temperature of the volume',
            rule=f"{needed('m^3/s ANR')} (ISO 8778: 100 kPa, 20 degC)",
            remedy='Write "l/min ANR" for ISO 8778; multiply litres at 0 degC and 1.01325 bar by 1.0874 first.',
        )
    # pint would compute 9**9**9**9, and is not loaded only to reject a sentence as a unit
    if len(unit) > LONGEST_UNIT or re.search(r"\d\s*(\*\*|\^)|[,;:]", unit):
        raise DescriptionError(f'unit "{unit}" is not known', rule=needed(si_unit))

    import pint

    registry = _registry()
    wanted = si_unit.removesuffix(" ANR")
    target, parsed = (_pint_unit(registry, one, si_unit) for one in (wanted, unit.removesuffix(" ANR")))
    if si_unit == "rad/s" and "hertz" in str(parsed):
        remedy = "Write the frequency times 2 pi: 62.8 rad/s for 10 Hz."
        raise DescriptionError(f'unit "{unit}" counts cycles', rule="an angular rate in rad/s is needed", remedy=remedy)
    if si_unit == "1/s" and "radian" in str(registry.get_base_units(parsed)[1]):
        remedy = "Divide the angular rate by 2 pi: 10 Hz for 62.8 rad/s."
        raise DescriptionError(f'unit "{unit}" is an angle per time', rule=needed(si_unit), remedy=remedy)
    try:
        zero = registry.Quantity(0.0, parsed).to(target).magnitude
        one = registry.Quantity(1.0, parsed).to(target).magnitude
    except pint.DimensionalityError:
        is_a = f"of dimension {parsed.dimensionality}"
        raise _wrong_dimension(unit, si_unit, is_a) from None
    return one - zero, zero


def _pint_unit(registry: pint.UnitRegistry, unit: str, si_unit: str) -> pint.Unit:
    try:
        return registry.Unit(_pint_form(unit))
    except Exception:  # pint raises many kinds of errors for text that it cannot read, down to tokenizer errors
        raise DescriptionError(f'unit "{unit}" is not known', rule=needed(si_unit)) from None


def _pint_form(unit: str) -> str:
    """Rewrite powers and products in pint's notation: ``N s/m2`` -> ``N*s/m**2``."""
    powers = re.sub(r"(?<=[A-Za-zµ])\^?(\d)", r"**\1", _canonical(unit).replace("°C", "degC").replace("°", "deg"))
    return re.sub(r"(?<=[\w)])\s+(?=[A-Za-z(])", "*", powers.strip())
