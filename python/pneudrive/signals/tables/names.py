"""Roles of columns in foreign files: their names, quantities and usual numbers; the chamber that a name states."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Role:
    """Role that a column may have.

    Attributes
    ----------
    words : str
        Expression of its names, in words of small letters, without the unit.
    si : str
        SI unit of its quantity; a column with the unit of another quantity is not a candidate.
    by_size : tuple of (float, str)
        Units of numbers without a unit, each up to a size: of the span for a position, of the numbers for a pressure.
    scaled : str
        Unit of a layout for volts and counts, which need a scale.
    """

    words: str
    si: str | None = None
    by_size: tuple[tuple[float, str], ...] = ()
    scaled: str = ""


#: Names are in English and German.
ROLES = {
    "time": Role(
        r"^(t\b|x value$)|\btime|zeit|temps|tijd|tiempo|stamp|stempel|elapsed|uhrzeit|clock|micros|millis", "s"
    ),
    "position": Role(
        r"\b(x|s|pos)\b|posi|weg\b|displ|stroke|laser|travel|\bhub|encoder|\benc\b|lvdt",
        "m",
        ((2.0, "m"), (math.inf, "mm")),
        "mm",
    ),
    "force": Role(r"\b(f|fx)\b|force|kraft|\bload|fuerza", "N", ((math.inf, "N"),), "N"),
    "pressure": Role(r"\bp\b|\bp[ab]\b|press|druck", "Pa", ((30.0, "bar"), (3000.0, "kPa"), (math.inf, "Pa")), "bar"),
    "command": Role(r"\b(u|cmd)\b|command|valve|ventil|voltage|spannung"),
    "cycle": Role(r"^cycle|^episode|zyklus"),
}
#: Words that make another column of a role the likelier one: a set value, a limit, an error, another place.
SECONDARY = re.compile(
    r"set ?p|set\b|soll|target|\bref|demand|\bdes\b|limit|\bmin\b|\bmax\b|err|dev|filter|raw|peak|status|state|"
    r"suppl|tank|source|ambient|\batm|versorg|netz|line|reserv|regul|inlet|speed|veloc|geschw|\bvel\b|rate|accel|temp\b"
)
INDEX = re.compile(
    r"^(index|idx|samples?|no|nr|n|row|point|num|number|count|record|lfd|zeile|i|k|id)( (no|nr|number|index))?$"
)
NUMBERING = re.compile(r"\b(index|idx|number|id|nr|no|count)$")
#: Least number of columns that are called alike but for their number.
FAMILY = 3


def words_of(name: str) -> str:
    """Return the words of a name in lower case.

    Examples
    --------
    >>> words_of("TestMachineForce"), words_of("pA_raw"), words_of("P-101")
    ('test machine force', 'p a raw', 'p 101')
    """
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_])", " ", name)
    return re.sub(r"[\W_]+", " ", apart).strip().lower()


def role_of(name: str) -> str | None:
    """Return the role that a name states, None for no role."""
    words = words_of(name)
    return next((name for name, role in ROLES.items() if re.search(role.words, words)), None)


def side_of(name: str) -> str | None:
    """Return the chamber that the name of a pressure states: a, b, 1 or 2."""
    found = set(re.findall(r"(?<![^ ])p?([ab12])(?![^ ])", words_of(name)))
    return found.pop() if len(found) == 1 else None


def family_of(name: str) -> str:
    """Return a name without its last number.

    Examples
    --------
    >>> family_of("pa12")
    'pa'
    """
    return re.sub(r"(?<!\d)\d++(?=\D*$)", "", name, count=1)
