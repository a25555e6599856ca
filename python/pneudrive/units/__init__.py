"""Quantities with units, converted to SI once, at the boundary.

A quantity is written as a number and a unit, ``"25 mm"``. A pressure is also marked as absolute or gauge, ``"3 bar
abs"`` or ``"2 bar gauge"``. ``table.toml`` has common units. pint converts all others.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from typing import TYPE_CHECKING

from pneudrive.errors import DescriptionError, package_table

if TYPE_CHECKING:
    import pint

_UNITS = package_table(__file__, "table.toml")
_PLAIN = str.maketrans("²³*·", "23  ", "^")  # powers and products in the notation of the table
_FACTORS = ((si, unit, line) for si, about in _UNITS.items() for unit, line in about.get("units", {}).items())
#: Unit as written -> (SI unit, factor, offset): SI value = number * factor + offset.
TABLE: dict[str, tuple[str, float, float]] = {
    unit: (si, *line) if isinstance(line, list) else (si, line, 0.0) for si, unit, line in _FACTORS
}
#: SI unit -> name of the quantity in messages, with an example that a user can copy.
KINDS = {si: (about["quantity"], about["example"]) for si, about in _UNITS.items() if "quantity" in about}
#: SI unit -> usual unit for display.
USUAL: dict[str, str] = {si: about["usual"] for si, about in _UNITS.items() if "usual" in about}

#: Rules in messages for a pressure, and for a pressure difference, which has neither abs nor gauge.
PRESSURE_NEEDED = 'a pressure is needed, e.g. "7 bar abs" or "95 psi gauge"'
DIFFERENCE_NEEDED = 'a difference of pressures is needed, without abs or gauge, e.g. "0.3 bar"'


def kind(si_unit: str) -> str:
    """Return the quantity of a unit with an example: ``a length, e.g. "25 mm"``."""
    name, example = KINDS.get(si_unit, (f"a quantity in {si_unit}", f"1 {si_unit}"))
    return f'{name}, e.g. "{example}"'


def needed(si_unit: str) -> str:
    """Return the rule for a message, such as ``a length is needed, e.g. "25 mm"``. Pa means a pressure difference."""
    return DIFFERENCE_NEEDED if si_unit == "Pa" else kind(si_unit).replace(", e.g.", " is needed, e.g.", 1)


#: Pattern of a pressure unit followed by a mark for gauge or absolute: barg, psia, kPa(a), bar gauge.
MARKED = re.compile(r"(.*[^\s_.(-])[\s_.-]*+\(?(g|gauge|gage|rel|relative?|ü|a|abs|absolute?)\.?\)?\.?")
_LEADING_NUMBER = re.compile(r"[\s\d.+-]*(?:[eE][+-]?\d+\s*)?")


def split_mark(text: str) -> tuple[str, str]:
    """Separate the mark abs or gauge from a pressure or its unit: ``"6 barg"`` gives ``("6 bar", " gauge")``.

    The mark is empty for other units.
    """
    if (last := text.split()[-1:]) in (["abs"], ["gauge"]):
        return text.rstrip().removesuffix(last[0]).rstrip(), f" {last[0]}"
    match = MARKED.fullmatch(text.strip())
    if match is None or TABLE.get(_LEADING_NUMBER.sub("", match[1], count=1), ("",))[0] != "Pa":
        return text, ""
    return match[1], " abs" if match[2].startswith("a") else " gauge"


@lru_cache(maxsize=1024)
def canonical(unit: str) -> str:
    """Return a unit in the notation of `TABLE`: ``m^2`` and ``m²`` give ``m2``."""
    return unit.strip().translate(_PLAIN)


def wrong_dimension(unit: str, si_unit: str, is_a: str) -> DescriptionError:
    """Return the error for a unit of another quantity."""
    return DescriptionError(f'unit "{unit}" is {is_a}', rule=needed(si_unit))


# --- Pressures, numbers with a unit, and quantities as text.

_NUMBER = re.compile(
    r"\s*([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?(?:infinity|inf|nan)\b)(?![\d.,])(.*)$",
    re.IGNORECASE | re.DOTALL,
)
LARGEST = 1e30  # in SI: squares and products of quantities of a drive or a rig stay finite


@dataclass(frozen=True)
class Pressure:
    """Pressure, absolute or gauge.

    Parameters
    ----------
    value_pa : float
        Value as stated, in Pa.
    gauge : bool
        Whether the value is relative to ambient pressure; otherwise it is relative to vacuum.
    """

    value_pa: float
    gauge: bool

    def absolute_pa(self, ambient_pa: float) -> float:
        """Return the absolute pressure in Pa for an absolute ambient pressure in Pa.

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
    """Number in SI that is displayed in a common unit.

    Arithmetic uses the plain SI number. Only the displayed text has the common unit.

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
            The unit is unknown, or has another dimension.
        """
        return _in_unit(self, self.si_unit, unit)

    def si_as(self, si_unit: str) -> float:
        """Return the plain number, after a check that its SI unit is `si_unit`.

        Raises
        ------
        DescriptionError
            The quantity has another dimension.
        """
        if self.si_unit != si_unit:
            raise wrong_dimension(self.si_unit, si_unit, kind(self.si_unit).partition(",")[0])
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


def is_unit(text: str) -> bool:
    """Return whether a text is a common unit. A unit of pressure may have ``abs`` or ``gauge``.

    Examples
    --------
    >>> is_unit("bar gauge"), is_unit("Reibung")
    (True, False)
    """
    return split_mark(text)[0] in TABLE


def suffix(si_unit: str) -> str:
    """Return the suffix with which names state an SI unit; empty for a number without a unit.

    Examples
    --------
    >>> suffix("m^3/(s Pa)")
    'm3_s_pa'
    """
    return re.sub(r"[^a-z0-9]+", "_", si_unit.lower().replace("^", "")).strip("_")


def column_name(name: str, unit: str) -> str:
    """Return the name of a column, including its unit.

    Examples
    --------
    >>> column_name("cylinder.bore", "m"), column_name("friction.stribeck_exponent", "1")
    ('cylinder.bore_m', 'friction.stribeck_exponent')
    """
    return name if unit in ("", "1") else f"{name}_{suffix(unit)}"


def parse(text: str, si_unit: str) -> float:
    """Convert a quantity to SI.

    Parameters
    ----------
    text : str
        Number and unit.
    si_unit : str
        Requested SI unit: ``"m"``, ``"N s/m"``, ``"m^3/(s Pa)"``, ...

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
    value = _apply(number, *converter(unit, si_unit))
    if not abs(value) <= LARGEST:
        raise DescriptionError(f'"{text}" is out of bounds', rule=f"quantities are at most {LARGEST:g} {si_unit}")
    return value


def parse_pressure(text: str, *, gauge_allowed: bool = True) -> Pressure:
    """Read a pressure with ``abs`` or ``gauge``, or with a unit such as ``barg`` or ``psia``.

    If `gauge_allowed` is False, the message about a missing mark proposes only ``abs``.

    Raises
    ------
    DescriptionError
        The text has neither ``abs`` nor ``gauge``, or is not a pressure.

    Examples
    --------
    >>> parse_pressure("3 bar abs"), parse_pressure("3 barg")
    (3 bar abs, 3 bar gauge)
    """
    plain, mark = split_mark(text)
    try:
        value_pa = parse(plain, "Pa")  # a wrong dimension is the greater mistake: report that first
    except DescriptionError as error:
        rule = PRESSURE_NEEDED if error.rule == DIFFERENCE_NEEDED else error.rule
        raise DescriptionError(error.what, rule=rule, remedy=error.remedy) from None
    if mark:
        return Pressure(value_pa, gauge=mark == " gauge")
    match = _NUMBER.match(text)
    assert match is not None  # the text has just been read
    number, unit = match[1], match[2].strip()
    remedy = None if gauge_allowed else f'Write "{number} {unit} abs".'
    raise DescriptionError.of("units.abs-or-gauge", text=text, number=number, unit=unit, remedy=remedy)


def split_range(given: object, example: str, rule: str | None = None) -> list[str]:
    """Split the text of a range into its two ends.

    Raises
    ------
    DescriptionError
        The value is not a text of two ends; the message gives the rule and the example.
    """
    ends = given.split("..") if isinstance(given, str) else []
    if len(ends) != 2:
        remedy = f'Write two quantities, e.g. "{example}".'
        raise DescriptionError(f'"{given}" is not a range', rule=rule, remedy=remedy)
    return [end.strip() for end in ends]


def parse_range(text: object, si_unit: str) -> tuple[float, float]:
    """Read ``"5 mm .. 30 mm"`` as two SI values, the lower one first.

    Raises
    ------
    DescriptionError
        The text does not have two quantities, or the first is not less than the second.
    """
    low, high = (parse(end, si_unit) for end in split_range(text, "5 mm .. 30 mm", needed(si_unit)))
    if not low < high:
        raise DescriptionError(f'range "{text}" is empty', rule="the first end must be below the second")
    return low, high


def split_number(given: object) -> tuple[float, str]:
    """Split a text into a finite number and the rest. For other values, return NaN and "".

    Examples
    --------
    >>> split_number("0.9 Cv"), split_number("about 5 mm")
    ((0.9, 'Cv'), (nan, ''))
    """
    match = _NUMBER.match(given) if isinstance(given, str) else None
    if match is None or not math.isfinite(float(match[1])):
        return math.nan, ""
    return float(match[1]), match[2].strip()


def share_of(given: object) -> float | None:
    """Read ``"5 %"`` as 0.05; None if the text is not a percentage."""
    number, unit = split_number(given)
    return number / 100.0 if unit == "%" else None


def write_share(value: float) -> str:
    """Write a fraction in per cent so that it is read back to the same number.

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
    """Return an SI unit in the package's notation (``m2`` -> ``m^2``, ``kg/s`` -> ``N s/m``).

    Other units do not change.

    Examples
    --------
    >>> si_name("m2"), si_name("N s2/m2"), si_name("N s3/m3"), si_name("-")
    ('m^2', 'kg/m', 'N s3/m3', '')
    """
    plain = canonical(unit)
    if plain in {"-", "1"}:
        return ""
    si, factor, offset = TABLE.get(plain, (unit.strip(), 1.0, 0.0))
    return si if (factor, offset) == (1.0, 0.0) else unit.strip()


@lru_cache(maxsize=1024)
def converter(unit: str, si_unit: str) -> tuple[float, float]:
    """Return (factor, offset) with SI value = number * factor + offset.

    Parameters
    ----------
    unit : str
        A unit as users write it, without ``abs`` or ``gauge``.
    si_unit : str
        Requested SI unit.

    Raises
    ------
    DescriptionError
        The unit is unknown, or has another dimension.
    """
    unit = unit.replace("(ANR)", "ANR")
    known = TABLE.get(canonical(unit))
    if known is None or (known[0] != si_unit and si_unit not in KINDS):
        return converter_of_pint(unit, si_unit)
    si, factor, offset = known
    if si != si_unit:
        raise wrong_dimension(unit, si_unit, KINDS[si][0])
    return factor, offset


def write(value: float, si_unit: str, unit: str | None = None) -> str:
    """Write an SI value as a quantity that `parse` reads back exactly.

    Parameters
    ----------
    value : float
        Value in `si_unit`.
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
        _, factor, offset = TABLE[unit]
        for digits in (12, 15, 17):
            number = f"{(value - offset) / factor:.{digits}g}"
            if _apply(number, factor, offset) == value:
                return f"{number} {unit}"
        exact = (Decimal(repr(value)) - Decimal(repr(offset))) / Decimal(repr(factor))
        if len(exact.as_tuple().digits) <= 17 and 1e-4 <= abs(exact) < 1e15:
            return f"{exact:f} {unit}"
    return f"{value!r} {si_unit.replace('^', '')}"


def like(unit: str) -> list[str]:
    """Return the common units for the quantity of a unit. Pressure units are absolute or gauge like the given unit.

    Examples
    --------
    >>> like("mm"), like("bar gauge")[:2], like("furlong")
    (['m', 'cm', 'mm', 'um', 'in', 'km'], ['Pa gauge', 'kPa gauge'], [])
    """
    plain, said = split_mark(unit)
    known = TABLE.get(canonical(plain))
    if known is None:
        return []
    sizes: dict[tuple[str, float, float], str] = {}
    for name, size in TABLE.items():
        if size[0] == known[0]:
            sizes.setdefault(size, name)
    return [f"{plain if size == known else name}{said}" for size, name in sizes.items()]


def in_unit(text: str, unit: str) -> str:
    """Write a quantity in another unit, so that it is read back exactly.

    Parameters
    ----------
    text : str
        Number and unit; a pressure may have ``abs`` or ``gauge``.
    unit : str
        One of the units that `like` returns for the unit of the quantity.

    Raises
    ------
    DescriptionError
        The text is not a quantity, or the unit is not one of these units.

    Examples
    --------
    >>> in_unit("25.4 mm", "in"), in_unit("7 bar abs", "kPa abs"), in_unit("20 degC", "K")
    ('1 in', '700 kPa abs', '293.15 K')
    """
    plain, said = split_mark(text)
    wanted, wanted_said = split_mark(unit)
    known = TABLE.get(canonical(wanted))
    if known is None or said != wanted_said:
        raise DescriptionError(
            f'"{text}" cannot be written in "{unit}"', rule="a unit of the same quantity, and the same abs or gauge"
        )
    return f"{write(parse(plain, known[0]), known[0], canonical(wanted))}{said}"


def readable(si_unit: str) -> tuple[float, str]:
    """Return the size in SI and the name of the common unit for an SI unit.

    Examples
    --------
    >>> readable("m^3/(s Pa)")
    (1e-08, 'dm3/(s bar)')
    >>> readable("1")
    (1.0, '')
    """
    unit = USUAL.get(si_unit)
    if unit is not None:
        return TABLE[unit][1], unit
    return 1.0, "" if si_unit in ("1", "-") else si_unit.replace("^", "")


def _apply(number: str, factor: float, offset: float) -> float:
    """Convert in decimal arithmetic and round once.

    "1.013 bar" is then exactly 101300.0. A product of floats would be slightly different.
    """
    return float(Decimal(number) * Decimal(repr(factor)) + Decimal(repr(offset)))


# --- Units that are not in the table, converted by pint.
#
# pint is imported only when needed, because its import takes longer than a whole simulation.

LONGEST_UNIT = 40
_ZERO_CELSIUS_LITRE = re.compile(r"\b(Nl|NL|Nm3|sl|slm|slpm|scfm|SCFM|NLPM|nl)\b")


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    import pint

    return pint.UnitRegistry()


def converter_of_pint(unit: str, si_unit: str) -> tuple[float, float]:
    """Return (factor, offset) of a unit that is not in `TABLE`, as `converter` does.

    Raises
    ------
    DescriptionError
        The unit is not known, or belongs to another quantity.
    """
    if split_mark(unit)[1]:
        raise wrong_dimension(unit, si_unit, "a pressure, not a difference" if si_unit == "Pa" else "a pressure")
    if _ZERO_CELSIUS_LITRE.search(unit) or (si_unit == "m^3/s ANR" and not unit.endswith("ANR")):
        raise DescriptionError.of("units.no-reference-state", unit=unit, needed=needed("m^3/s ANR"))
    # pint would compute 9**9**9**9, and would be loaded only to reject a sentence as a unit
    if len(unit) > LONGEST_UNIT or re.search(r"\d\s*(\*\*|\^)|[,;:]", unit):
        raise DescriptionError(f'unit "{unit}" is not known', rule=needed(si_unit))

    import pint

    registry = _registry()
    wanted = si_unit.removesuffix(" ANR")
    found = []
    for one in (wanted, unit.removesuffix(" ANR")):
        # pint's notation has other powers and products: N s/m2 -> N*s/m**2
        powers = re.sub(r"(?<=[A-Za-zµ])\^?(\d)", r"**\1", canonical(one).replace("°C", "degC").replace("°", "deg"))
        try:
            found.append(registry.Unit(re.sub(r"(?<=[\w)])\s+(?=[A-Za-z(])", "*", powers.strip())))
        except Exception:  # pint raises many kinds of errors for text that it cannot read, down to tokenizer errors
            raise DescriptionError(f'unit "{one}" is not known', rule=needed(si_unit)) from None
    target, parsed = found
    if si_unit == "rad/s" and "hertz" in str(parsed):
        remedy = "Write the frequency times 2 pi: 62.8 rad/s for 10 Hz."
        raise DescriptionError(f'unit "{unit}" counts cycles', rule="an angular rate in rad/s is needed", remedy=remedy)
    if si_unit == "1/s" and "radian" in str(registry.get_base_units(parsed)[1]):
        remedy = "Divide the angular rate by 2 pi: 10 Hz for 62.8 rad/s."
        raise DescriptionError(f'unit "{unit}" is an angle per time', rule=needed(si_unit), remedy=remedy)
    try:
        zero, one = (registry.Quantity(number, parsed).to(target).magnitude for number in (0.0, 1.0))
    except pint.DimensionalityError:
        raise wrong_dimension(unit, si_unit, f"of dimension {parsed.dimensionality}") from None
    return one - zero, zero
