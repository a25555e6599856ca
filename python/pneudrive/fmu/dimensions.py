"""Units in the form of FMI: exponents of base units, and the display unit."""

from __future__ import annotations

import re

from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.errors import DescriptionError

#: Unit -> exponents of base units.
_KNOWN: dict[str, dict[str, int]] = {
    **{unit: {unit: 1} for unit in ("m", "kg", "s", "K", "A", "rad")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Hz": {"s": -1},
}
#: SI unit -> name of the displayed unit, and factor and offset from the SI unit to it.
DISPLAYED: dict[str, tuple[str, float, float]] = {
    "Pa": ("bar", 1e-5, 0.0),
    "m": ("mm", 1e3, 0.0),
    "m/s": ("mm/s", 1e3, 0.0),
    "kg/s": ("g/s", 1e3, 0.0),
    "K": ("degC", 1.0, -ZERO_CELSIUS_K),
    "rad": ("deg", 57.29577951308232, 0.0),
    "m^3": ("cm3", 1e6, 0.0),
    "m^3/(s Pa)": ("l/(s bar)", 1e8, 0.0),
    "N/Pa": ("N/bar", 1e5, 0.0),
}
_ONE = re.compile(r"(?P<unit>[A-Za-z]+)(?:\^?(?P<power>-?\d+))?")


def exponents(unit: str) -> dict[str, int]:
    """Return the exponents of base units of an SI unit.

    Raises
    ------
    DescriptionError
        A part of the unit is unknown.

    Examples
    --------
    >>> exponents("m^3/(s Pa)")
    {'m': 4, 's': 1, 'kg': -1}
    >>> exponents("1")
    {}
    """
    out: dict[str, int] = {}
    above, *below = unit.replace(" ANR", "").split("/")
    for sign, part in ((1, above), *((-1, one) for one in below)):
        for word in part.strip("() ").split():
            if word == "1":
                continue
            found = _ONE.fullmatch(word)
            if found is None or found["unit"] not in _KNOWN:
                raise DescriptionError(f"the unit {unit} cannot be expressed in an FMU")
            for base, power in _KNOWN[found["unit"]].items():
                out[base] = out.get(base, 0) + sign * power * int(found["power"] or 1)
    return {base: power for base, power in out.items() if power}
