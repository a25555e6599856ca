"""Common units with their sizes in SI, and the quantities that they measure."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING

from pneudrive.errors import DescriptionError, package_table

if TYPE_CHECKING:
    import pint


_UNITS = package_table(__file__, "table.toml")
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
    """Name the quantity of a unit, with an example: ``a length, e.g. "25 mm"``."""
    name, example = KINDS.get(si_unit, (f"a quantity in {si_unit}", f"1 {si_unit}"))
    return f'{name}, e.g. "{example}"'


def needed(si_unit: str) -> str:
    """Return the rule of a message, such as ``a length is needed, e.g. "25 mm"``. Pa means a pressure difference."""
    return DIFFERENCE_NEEDED if si_unit == "Pa" else kind(si_unit).replace(", e.g.", " is needed, e.g.", 1)


#: Pattern of a pressure unit followed by a mark for gauge or absolute: barg, psia, kPa(a), bar gauge.
MARKED = re.compile(r"(.*[^\s_.(-])[\s_.-]*+\(?(g|gauge|gage|rel|relative?|ü|a|abs|absolute?)\.?\)?\.?")
_NUMBER = re.compile(r"[\s\d.+-]*(?:[eE][+-]?\d+\s*)?")


def split_mark(text: str) -> tuple[str, str]:
    """Split the mark from a pressure or its unit: ``"6 barg"`` and ``"6 bar gauge"`` into ``"6 bar"`` and ``" gauge"``.

    The mark is empty for other units.
    """
    if (last := text.split()[-1:]) in (["abs"], ["gauge"]):
        return text.rstrip().removesuffix(last[0]).rstrip(), f" {last[0]}"
    match = MARKED.fullmatch(text.strip())
    if match is None or TABLE.get(_NUMBER.sub("", match[1], count=1), ("",))[0] != "Pa":
        return text, ""
    return match[1], " abs" if match[2].startswith("a") else " gauge"


@lru_cache(maxsize=1024)
def canonical(unit: str) -> str:
    """Return a unit without signs for powers and products."""
    return unit.strip().replace("²", "2").replace("³", "3").replace("^", "").replace("*", " ").replace("·", " ")


def wrong_dimension(unit: str, si_unit: str, is_a: str) -> DescriptionError:
    """Return the error for a unit of another quantity."""
    return DescriptionError(f'unit "{unit}" is {is_a}', rule=needed(si_unit))


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
    """Return factor and offset of a unit, see `pneudrive.units.converter`.

    Raises
    ------
    DescriptionError
        The unit is not known, or is of another quantity.
    """
    if split_mark(unit)[1]:
        raise wrong_dimension(unit, si_unit, "a pressure, not a difference" if si_unit == "Pa" else "a pressure")
    if _ZERO_CELSIUS_LITRE.search(unit) or (si_unit == "m^3/s ANR" and not unit.endswith("ANR")):
        raise DescriptionError.of("units.no-reference-state", unit=unit, needed=needed("m^3/s ANR"))
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
        raise wrong_dimension(unit, si_unit, is_a) from None
    return one - zero, zero


def _pint_unit(registry: pint.UnitRegistry, unit: str, si_unit: str) -> pint.Unit:
    """Return a unit of pint, whose notation has other powers and products: ``N s/m2`` -> ``N*s/m**2``."""
    powers = re.sub(r"(?<=[A-Za-zµ])\^?(\d)", r"**\1", canonical(unit).replace("°C", "degC").replace("°", "deg"))
    try:
        return registry.Unit(re.sub(r"(?<=[\w)])\s+(?=[A-Za-z(])", "*", powers.strip()))
    except Exception:  # pint raises many kinds of errors for text that it cannot read, down to tokenizer errors
        raise DescriptionError(f'unit "{unit}" is not known', rule=needed(si_unit)) from None
