"""Electrical input of a valve: conversion of a voltage or current to an opening."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from pneudrive import units
from pneudrive.describe.keys import WrongValueError
from pneudrive.describe.marks import Quantity
from pneudrive.errors import CommandError, DescriptionError, naming

# SI unit -> preferred unit
_WRITTEN = {"V": "V", "A": "mA"}
_FORM = '"0 V .. 10 V" or "4 mA .. 20 mA"'


class Signal(NamedTuple):
    """Range of a valve's electrical input, V or A.

    The lower end opens b fully to the supply (u = -1), the upper end a (u = 1); the valve is shut in the middle.
    """

    low: float
    high: float
    si_unit: str

    def __str__(self) -> str:
        unit = _WRITTEN[self.si_unit]
        return " .. ".join(units.write(end, self.si_unit, unit) for end in self[:2])

    def opening(self, text: str) -> float:
        """Convert a voltage or current to the command u in [-1, 1].

        Raises
        ------
        CommandError
            The text is another quantity, or outside the range.

        Examples
        --------
        >>> Signal(0.0, 10.0, "V").opening("7.5 V")
        0.5
        """
        with naming("command"):
            value = units.parse(text, self.si_unit)
        if not self.low <= value <= self.high:
            raise CommandError(f"command = {text} is outside the valve's range", rule=f"valve.command = {self}")
        return (2.0 * value - self.low - self.high) / (self.high - self.low)


class Positions(NamedTuple):
    """Commands of a component that switches, and its electrical input if one is described."""

    values: tuple[float, ...]
    signal: Signal | None = None

    def check(self, value: float, what: str, where: str | None = None) -> None:
        """Refuse a command between the positions.

        Raises
        ------
        CommandError
            The command is not one of the positions.
        """
        if value not in self.values:
            *first, last = (f"{one:g}" for one in self.values)
            raise CommandError(
                what,
                where=where,
                rule=f"{', '.join(first)} or {last}, because it switches",
                remedy="Take a proportional valve for fractions, or 2/2 or 3/2 valves with pwm_frequency.",
            )


@dataclass(frozen=True)
class SignalRange(Quantity):
    """Annotation of a field for a range of voltage or current, stored as a `Signal`."""

    def read(self, given: object) -> Signal:  # type: ignore[override]
        """Read ``"0 V .. 10 V"``."""
        if isinstance(given, Signal):
            return given
        if not isinstance(given, str):
            raise WrongValueError(f"{given!r} is not a range", remedy=f"Write {_FORM}.")
        si_unit = "A" if given.rstrip().endswith("A") else "V"
        try:
            return Signal(*units.parse_range(given, si_unit), si_unit)
        except DescriptionError as error:
            what = f'"{given}" is not a range of voltage or current'
            raise WrongValueError(what, error.rule, f"Write {_FORM}.") from None

    def show(self, value: Signal) -> str:  # type: ignore[override]
        """Write the range as users would."""
        return str(value)

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the form that users write."""
        return {
            "type": "string",
            "pattern": r"^.+\.\..+$",
            "description": f"a range of voltage or current, e.g. {_FORM}",
        }
