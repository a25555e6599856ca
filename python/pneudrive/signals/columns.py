"""Find the unit, role and chamber of each column in a foreign file, from its header and typical values."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pneudrive.arrays import Array
from pneudrive.errors import DescriptionError, package_table
from pneudrive.units import MARKED, converter, parse, split_mark

#: Units in headers, roles of columns, and words that exclude a role.
_TABLES = package_table(__file__, "columns.toml")
LONGEST_NAME = 200  # characters of a column's name in which a unit is looked for: each bracket is tried in turn
_BRACKETS = re.compile(r"[\[(<{]([^\[\](){}<>]+)[\])>}]")
_MICRO = str.maketrans({"µ": "u", "μ": "u", "²": "2", "^": ""})


@dataclass(frozen=True)
class ColumnUnit:
    """Conversion of a column to SI: SI value = number * factor + shift.

    ``gauge`` is True or False for pressures, None otherwise. ``text`` is the unit as written in the file.
    """

    factor: float
    gauge: bool | None = None
    shift: float = 0.0
    text: str = ""


@dataclass(frozen=True)
class HeaderUnit:
    """Unit in the header of a foreign file.

    ``si`` is the SI unit of the quantity, or ``count``; it is empty for other quantities. ``unit`` is the unit as
    written in layouts. ``gauge`` stays None where a unit of pressure does not state gauge or absolute.
    """

    si: str
    unit: str
    gauge: bool | None = None


_UNITS = ((si, unit, text) for si, own in _TABLES["units"].items() for unit, text in own.items())
#: Spelling in lower case -> unit.
_KNOWN = {spelling: HeaderUnit(si, unit) for si, unit, text in _UNITS for spelling in text.split()}


def header_unit(text: str) -> HeaderUnit | None:
    """Return the unit in a field of a header; None if the field is not a unit.

    Examples
    --------
    >>> header_unit("MPa(G)")
    HeaderUnit(si='Pa', unit='MPa', gauge=True)
    >>> header_unit("[psia]").gauge, header_unit("Reibung")
    (False, None)
    """
    bare = text.strip()
    while len(bare) > 1 and bare[0] in "[(<{" and bare[-1] in "])>}":
        bare = bare[1:-1].strip()
    bare = bare.translate(_MICRO)
    if bare == "MN":
        return HeaderUnit("N", "MN")
    if bare.lower() in _KNOWN:
        return _KNOWN[bare.lower()]
    match = MARKED.fullmatch(bare.lower().replace("[", "(").replace("]", ")"))
    unit = _KNOWN.get(match.group(1).strip()) if match else None
    if match is None or unit is None or unit.si != "Pa":
        return None
    return HeaderUnit("Pa", unit.unit, not match.group(2).startswith("a"))


def split_name(name: str) -> tuple[str, HeaderUnit | None]:
    """Return the name of a column without its unit, and the unit; None if the name states no unit.

    Examples
    --------
    >>> split_name("LowerSpringPressure(psia)")
    ('LowerSpringPressure', HeaderUnit(si='Pa', unit='psi', gauge=False))
    >>> split_name("pressure_A"), split_name("pA")
    (('pressure_A', None), ('pA', None))
    """
    if len(name) > LONGEST_NAME:
        return name, None
    for group in reversed(list(_BRACKETS.finditer(name))):
        before = re.search(r"[^\s_,;:\[\](){}<>]*[\])>}]?\s*$", name[: group.start()])
        word = before.group().strip() if before else ""
        joined = header_unit(f"{word.strip('[](){}<>')}({group.group(1).strip()})") if word else None
        if joined is not None and before is not None:
            return name[: before.start()].strip(" [({<"), joined
        unit = header_unit(group.group(1))
        before_it = name[: group.start()].lower()  # "Pressure (A)" has the letter of a chamber, not the unit ampere
        if unit is not None and not (unit.si == "A" and re.search(r"press|druck|\bp\b", before_it)):
            return (name[: group.start()] + name[group.end() :]).strip(), unit
    for word in (r"[^\s_]+", r"[^\s_/,:]+"):
        words = list(re.finditer(word, name))
        for count in (2, 1):
            last = [match.group().strip("[](){}<>") for match in words[-count:]]
            unit = header_unit(" ".join(last)) if len(last) == count else None
            is_letter = bool(last) and last[-1] in ("aA" if count == 2 else "aAcCfFgG")  # of a chamber, of a force
            is_letter |= len(name.strip()) == 1  # the symbol of a quantity: s, m, N
            is_letter |= last == ["pA"] or name.strip() == "pa"  # the pressure in chamber a
            if unit is not None and not is_letter:
                return re.sub(r"\s+in$", "", name[: words[-count].start()].strip(" /,:_")), unit
    return name, None


def column_unit(text: str, si_unit: str) -> ColumnUnit:
    """Parse the unit of a column.

    Parameters
    ----------
    text
        Unit such as ``"mm"``, ``"bar gauge"`` or ``"psia"``.
    si_unit
        Unit of the column's quantity: ``"s"``, ``"m"``, ``"m/s"``, ``"N"``, ``"Pa"``, ``"K"``.

    Raises
    ------
    DescriptionError
        The unit is unknown, has the wrong dimension, or does not state gauge or absolute.

    Examples
    --------
    >>> column_unit("bar gauge", "Pa")
    ColumnUnit(factor=100000.0, gauge=True, shift=0.0, text='bar gauge')
    """
    if not isinstance(text, str):
        raise DescriptionError(f"{text!r} is not a unit")
    if si_unit != "Pa":
        factor, shift = converter(text, si_unit)
        return ColumnUnit(factor, shift=shift, text=text)
    short = header_unit(text)
    if short is not None and short.gauge is not None:
        return ColumnUnit(converter(short.unit, "Pa")[0], short.gauge, text=text)
    unit, mark = split_mark(text)
    factor, _ = converter(unit, si_unit)  # a wrong dimension is the greater mistake: it is reported first
    if not mark:
        raise DescriptionError.of("signals.gauge-or-abs", text=text)
    return ColumnUnit(factor, mark == " gauge", text=text)


def uncertainty(text: str, si_unit: str) -> float:
    """Read a standard uncertainty. For a pressure, the unit is stated without "gauge" or "abs"."""
    if si_unit == "Pa" and isinstance(text, str) and split_mark(text)[1]:
        raise DescriptionError(f'uncertainty "{text}": an uncertainty cannot be gauge or abs')
    value = parse(text, si_unit)
    if value < 0:
        raise DescriptionError(f'uncertainty "{text}" is negative', rule="an uncertainty must not be negative")
    return value


SIGNALS, SAMPLES = _TABLES["signals"], _TABLES["samples"]
#: Role -> ``words``: regular expression of its names in lower-case words, without the unit; ``si``: unit of its
#: quantity. A column with the unit of another quantity is not a candidate. ``by_size``: units to assume for numbers
#: without a unit, as pairs (limit, unit). The limit applies to the span of a position, or to the largest value of a
#: pressure. ``scaled``: unit in a layout for volts and counts, which need a scale.
ROLES = _TABLES["roles"]
_WORDS = {name: re.compile(text) for name, text in _TABLES["words"].items()}
SECONDARY, INDEX, NUMBERING = _WORDS["secondary"], _WORDS["index"], _WORDS["numbering"]
RATE, STEP = _WORDS["rate"], _WORDS["step"]
#: Smallest number of columns in a family. The names of a family differ only in a number.
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
    """Return the role of a column (such as ``force``) from its name; None if the name does not state a role."""
    words = words_of(name)
    return next((name for name, role in ROLES.items() if re.search(role["words"], words)), None)


def side_of(name: str) -> str | None:
    """Return the chamber in the name of a pressure: a, b, 1 or 2. None if the name does not state one chamber."""
    found = set(re.findall(r"(?<![^ ])p?([ab12])(?![^ ])", words_of(name)))
    return found.pop() if len(found) == 1 else None


def chamber_of(name: str) -> str:
    """Return the chamber a or b in the name of a pressure, as a letter or a number; empty without a chamber."""
    side = side_of(name) or ""
    return {"1": "a", "2": "b"}.get(side, side)


def family_of(name: str) -> str:
    """Return a name without its last number.

    Examples
    --------
    >>> family_of("pa12")
    'pa'
    """
    return re.sub(r"(?<!\d)\d++(?=\D*$)", "", name, count=1)


def families(names: Iterable[str]) -> list[str]:
    """Return the names. Names that differ only in a number are combined in one entry.

    Examples
    --------
    >>> families(["pa0", "pa1", "pa2", "t"])
    ['pa0 .. pa2', 't']
    """
    out: dict[str, list[str]] = {}
    for name in names:
        out.setdefault(family_of(name), []).append(name)
    return [text for some in out.values() for text in ([f"{some[0]} .. {some[-1]}"] if len(some) >= FAMILY else some)]


# --- Columns of a file with their headers and numbers.

RAW = ("V", "mV", "mA", "count")  # units of sensors whose scale the file does not state
NAME, SECOND_NAME, UNIT, PHYSICS = 2, 1, 2, 1  # weights of the evidence (assumed): any two beat one


@dataclass
class FileColumn:
    """A column of a foreign table.

    Attributes
    ----------
    index : int
        Number in the file.
    place : int or str
        Name or number of the column in a layout.
    name, bare : str
        Name in the header, with and without its unit.
    unit : HeaderUnit or None
        Stated unit.
    unknown : str
        Stated unit that pneudrive does not know.
    values : ndarray
        Numbers at the times of the table, after filling slow channels and removing wraps of counters.
    """

    index: int
    place: int | str
    name: str
    bare: str
    unit: HeaderUnit | None
    unknown: str
    values: Array

    @property
    def role(self) -> str | None:
        """The role stated by the name. A name that is only a unit of time also states the role ``time``."""
        return role_of(self.bare) or role_of(self.name)

    @property
    def is_raw(self) -> bool:
        """Whether the numbers are volts, milliamperes or counts of a sensor."""
        return self.unit is not None and self.unit.unit in RAW

    @property
    def may_be_pressure(self) -> bool:
        """Whether the column may be a pressure: name and unit allow a pressure, and the numbers change."""
        fits = self.unit is None or self.unit.si == "Pa" or self.is_raw
        is_signal = np.nanmax(self.values) > np.nanmin(self.values) and not NUMBERING.search(words_of(self.name))
        return fits and self.role in (None, "pressure") and bool(is_signal)


class Candidate(NamedTuple):
    """Column that may have a role: weight and texts of the evidence; for a chosen column, a text on its rival."""

    column: FileColumn
    score: float
    evidence: tuple[str, ...]
    rank: str = ""
