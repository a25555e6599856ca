"""Common units with their sizes in SI, and the quantities that they measure."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import TYPE_CHECKING

from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.errors import DescriptionError

if TYPE_CHECKING:
    import pint


_BAR, _PSI, _L_MIN = 1.0e5, 6894.757293168361, 1.0e-3 / 60.0  # psi: 0.45359237 kg * 9.80665 m/s2 / (25.4 mm)2

# unit as written -> (SI unit, factor, offset): SI value = number * factor + offset
TABLE: dict[str, tuple[str, float, float]] = {
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
    "N/bar2": ("N/Pa2", 1e-10, 0.0),
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
    "m3/s": ("a volume flow", "120 l/min"),
    "m^3/s ANR": ("a volume flow in normal litres", "700 l/min ANR"),
}

#: Rules of messages for a pressure, and for a difference of two, which has neither abs nor gauge.
PRESSURE_NEEDED = 'a pressure is needed, e.g. "7 bar abs"'
DIFFERENCE_NEEDED = 'a difference of pressures is needed, without abs or gauge, e.g. "0.3 bar"'


def kind(si_unit: str) -> str:
    """Name the quantity of a unit, with an example: ``a length, e.g. "25 mm"``."""
    name, example = KINDS.get(si_unit, (f"a quantity in {si_unit}", f"1 {si_unit}"))
    return f'{name}, e.g. "{example}"'


def needed(si_unit: str) -> str:
    """Return the rule of a message, such as ``a length is needed, e.g. "25 mm"``. Pa means a pressure difference."""
    return DIFFERENCE_NEEDED if si_unit == "Pa" else kind(si_unit).replace(", e.g.", " is needed, e.g.", 1)


@lru_cache(maxsize=1024)
def canonical(unit: str) -> str:
    """Return a unit without signs for powers and products."""
    return unit.strip().replace("²", "2").replace("³", "3").replace("^", "").replace("*", " ").replace("·", " ")


def wrong_dimension(unit: str, si_unit: str, is_a: str) -> DescriptionError:
    """Return the error on a unit of another quantity."""
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
    if unit.endswith((" abs", " gauge")):
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
    try:
        return registry.Unit(_pint_form(unit))
    except Exception:  # pint raises many kinds of errors for text that it cannot read, down to tokenizer errors
        raise DescriptionError(f'unit "{unit}" is not known', rule=needed(si_unit)) from None


def _pint_form(unit: str) -> str:
    """Rewrite powers and products in pint's notation: ``N s/m2`` -> ``N*s/m**2``."""
    powers = re.sub(r"(?<=[A-Za-zµ])\^?(\d)", r"**\1", canonical(unit).replace("°C", "degC").replace("°", "deg"))
    return re.sub(r"(?<=[\w)])\s+(?=[A-Za-z(])", "*", powers.strip())
