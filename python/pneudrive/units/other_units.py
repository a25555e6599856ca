"""Units that are not in the table, converted by pint.

pint is imported only when needed, because its import takes longer than a whole simulation.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING

from pneudrive.errors import DescriptionError
from pneudrive.units.table import canonical, needed, wrong_dimension

if TYPE_CHECKING:
    import pint

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
    if unit.endswith((" abs", " gauge")):
        raise wrong_dimension(unit, si_unit, "a pressure, not a difference" if si_unit == "Pa" else "a pressure")
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
        raise wrong_dimension(unit, si_unit, is_a) from None
    return one - zero, zero


def _pint_unit(registry: pint.UnitRegistry, unit: str, si_unit: str) -> pint.Unit:
    try:
        return registry.Unit(_pint_form(unit))
    except Exception:  # pint raises many kinds of errors for text that it cannot read, down to tokenizer errors
        raise DescriptionError(f'unit "{unit}" is not known', rule=needed(si_unit)) from None


def _pint_form(unit: str) -> str:
    """Rewrite powers and products in pint's notation: ``N s/m2`` -> ``N*s/m**2``."""
    powers = re.sub(r"(?<=[A-Za-zµ])\^?(\d)", r"**\1", canonical(unit).replace("°C", "degC").replace("°", "deg"))
    return re.sub(r"(?<=[\w)])\s+(?=[A-Za-z(])", "*", powers.strip())
