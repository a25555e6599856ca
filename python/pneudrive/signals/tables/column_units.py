"""Units of recorded columns: a factor to SI, and for pressures gauge or absolute."""

from __future__ import annotations

from dataclasses import dataclass

from pneudrive.errors import DescriptionError
from pneudrive.units import converter, parse


@dataclass(frozen=True)
class ColumnUnit:
    """SI value = number * factor + shift; ``gauge`` is True or False for pressures, None otherwise.

    ``text`` is the unit as written.
    """

    factor: float
    gauge: bool | None = None
    shift: float = 0.0
    text: str = ""


def column_unit(text: str, si_unit: str) -> ColumnUnit:
    """Read a column's unit.

    Parameters
    ----------
    text
        Such as ``"mm"`` or ``"bar gauge"``.
    si_unit
        Unit of the column's quantity: ``"s"``, ``"m"``, ``"m/s"``, ``"N"``, ``"Pa"``, ``"K"``.

    Raises
    ------
    DescriptionError
        If the unit is unknown, has the wrong dimension, or lacks gauge or absolute.

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
    words = text.split()
    if not words or words[-1] not in ("gauge", "abs"):
        converter(text, si_unit)  # a wrong dimension is the greater mistake: report it first
        raise DescriptionError(
            f'unit "{text}" does not say gauge or abs',
            rule="a pressure is absolute (abs) or above ambient (gauge)",
            remedy=f'Write "{text} gauge" or "{text} abs".',
        )
    return ColumnUnit(converter(" ".join(words[:-1]), "Pa")[0], words[-1] == "gauge", text=text)


def uncertainty(text: str, si_unit: str) -> float:
    """Read a standard uncertainty; that of a pressure is neither gauge nor absolute."""
    if si_unit == "Pa" and isinstance(text, str) and text.split()[-1:] in (["gauge"], ["abs"]):
        raise DescriptionError(f'uncertainty "{text}": gauge and abs do not apply to a difference')
    value = parse(text, si_unit)
    if value < 0:
        raise DescriptionError(f'uncertainty "{text}" is negative', rule="an uncertainty must not be negative")
    return value
