"""References: where a drive is to go over time, as text or file, and whether the drive can follow."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from pneudrive import _core, units
from pneudrive.describe import toml
from pneudrive.describe.base import Bounds, Described, Position, Quantity
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.show import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: How long a reference is run where nothing is said: a sine at least so, and what follows the last move.
SINE_S, SINE_PERIODS, REST_S = 16.0, 4.0, 2.0
LONGEST_S = 1e6
LONGEST_REMEDY = 200  # characters of a slower reference in a message
_EVERY, _PERIODS = 400, 2.0  # samples of a move or a period of a sine in which the fastest moment is looked for
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*[A-Za-zµ]+"
_SINE = re.compile(rf"sine\s+({_NUMBER})\s+({_NUMBER})\s+around\s+({_NUMBER})", re.IGNORECASE)
FORMS = '"sine 60 mm 0.5 Hz around 250 mm", "220 mm; 1 s: 280 mm in 0.3 s; 3 s: 220 mm in 0.3 s", or a TOML file'


class ReferenceMove(NamedTuple):
    """A move to a position, from where the one before it ends; blended with continuous jerk.

    Attributes
    ----------
    begin_s, duration_s, to_m : float
    """

    begin_s: float
    duration_s: float
    to_m: float

    @property
    def end_s(self) -> float:
        """Time at which it ends."""
        return self.begin_s + self.duration_s


class Reach(NamedTuple):
    """Where a reference goes, and how fast.

    Attributes
    ----------
    lowest_m, highest_m, fastest_m_s : float
    at_s : float
        Time of the largest speed.
    """

    lowest_m: float
    highest_m: float
    fastest_m_s: float
    at_s: float


@dataclass(frozen=True, repr=False)
class Reference(Shown):
    """Where a drive is to go over time: moves one after the other, or a sine.

    Attributes
    ----------
    text : str
        As it was given.
    start_m : float
        First position; of a sine its centre.
    moves : tuple of ReferenceMove
        Empty for a sine.
    amplitude_m, frequency_hz : float
        Of a sine, whose amplitude grows from nothing within its first period; 0 for moves.
    rest_s : float
        Behind the last move, where no duration of a run is said.
    """

    text: str
    start_m: float
    moves: tuple[ReferenceMove, ...] = ()
    amplitude_m: float = 0.0
    frequency_hz: float = 0.0
    rest_s: float = REST_S

    @property
    def is_sine(self) -> bool:
        """Whether it is a sine, which never stands."""
        return self.frequency_hz > 0.0

    @property
    def duration_s(self) -> float:
        """Duration of a run where nothing is said: 16 s or four periods of a sine, 2 s of rest behind moves."""
        if self.is_sine:
            return max(SINE_S, SINE_PERIODS / self.frequency_hz)
        return (self.moves[-1].end_s if self.moves else 0.0) + self.rest_s

    def core(self) -> dict[str, Any]:
        """Return it in the core's form, SI."""
        if self.is_sine:
            sizes = {"amplitude_m": self.amplitude_m, "frequency_hz": self.frequency_hz}
            return {"kind": "sine", "centre_m": self.start_m, **sizes}
        return {"kind": "moves", "start_m": self.start_m, "moves": [list(move) for move in self.moves]}

    def at(self, times_s: Sequence[float] | Array) -> Array:
        """Return position, velocity, acceleration and jerk at times, shape (n, 4), SI."""
        return _core.reference_at(json.dumps(self.core()), np.ascontiguousarray(times_s, dtype=np.float64))

    def reach(self) -> Reach:
        """Return where it goes and how fast."""
        if self.is_sine:
            times = np.linspace(0.0, _PERIODS / self.frequency_hz, int(_PERIODS) * _EVERY + 1)
        else:
            each = [np.linspace(move.begin_s, move.end_s, _EVERY + 1) for move in self.moves]
            times = np.concatenate([np.zeros(1), *each])
        position, velocity, *_ = self.at(times).T
        fastest = int(np.argmax(np.abs(velocity)))
        lowest, highest = float(position.min()), float(position.max())
        return Reach(lowest, highest, float(abs(velocity[fastest])), float(times[fastest]))

    def stretched(self, factor: float) -> Reference:
        """Return it slower by a factor in time, rounded up to a thousandth; unchanged for a factor of up to 1."""
        if factor <= 1.0:
            return self
        factor = np.ceil(1e3 * factor) / 1e3
        if self.is_sine:
            return sine(self.amplitude_m, round(self.frequency_hz / factor, 9), self.start_m)
        moves: list[ReferenceMove] = []
        for move in self.moves:
            free_s = moves[-1].end_s if moves else 0.0
            begin_s = max(free_s, round(factor * move.begin_s, 6))
            moves.append(ReferenceMove(begin_s, round(factor * move.duration_s, 6), move.to_m))
        return stairs(self.start_m, moves, self.rest_s)

    def _card(self) -> Card:
        reach = self.reach()
        rows = [
            ("positions", f"{1e3 * reach.lowest_m:g} .. {1e3 * reach.highest_m:g} mm"),
            ("largest speed", f"{reach.fastest_m_s:.4g} m/s at {reach.at_s:.4g} s"),
        ]
        return Card(self.text, rows=rows)


def sine(amplitude_m: float, frequency_hz: float, centre_m: float) -> Reference:
    """Return a sine."""
    sizes = f"{units.write(amplitude_m, 'm', 'mm')} {units.write(frequency_hz, '1/s', 'Hz')}"
    text = f"sine {sizes} around {units.write(centre_m, 'm', 'mm')}"
    return Reference(text, centre_m, amplitude_m=amplitude_m, frequency_hz=frequency_hz)


def stairs(start_m: float, moves: Sequence[ReferenceMove], rest_s: float = REST_S) -> Reference:
    """Return moves, one after the other."""
    each = (f"{move.begin_s:.9g} s: {units.write(move.to_m, 'm', 'mm')} in {move.duration_s:.9g} s" for move in moves)
    text = "; ".join([units.write(start_m, "m", "mm"), *each])
    return Reference(text, start_m, tuple(moves), rest_s=rest_s)


class MoveTable(Described):
    """A move of a reference file."""

    at_s: Annotated[float, Quantity("s", "s", Bounds(at_least=0.0, at_most=LONGEST_S))]
    to_m: Position
    duration_s: Annotated[float, Quantity("s", "s", Bounds(above=0.0, at_most=LONGEST_S))]


class ReferenceFile(Described):
    """Reference as a file: ``start``, and a table ``[[moves]]`` with ``at``, ``to`` and ``duration`` for each move."""

    schema_version: Literal[1] = Field(default=1, alias="schema")
    start_m: Position
    moves: tuple[MoveTable, ...] = ()


def reference(given: Reference | str | Path) -> Reference:
    """Read a reference.

    Parameters
    ----------
    given : Reference, str or path-like
        ``"sine 60 mm 0.5 Hz around 250 mm"``; a position and moves with their durations, ``"220 mm; 1 s: 280 mm in
        0.3 s; 3 s: 220 mm in 0.3 s"``; or a TOML file with ``start`` and tables ``[[moves]]``. A reference is returned
        unchanged.

    Raises
    ------
    CommandError
        The text is none of them, or a move begins before the one before it ends.
    DescriptionError
        The file is not valid.

    Examples
    --------
    >>> round(reference("220 mm; 1 s: 280 mm in 0.3 s").reach().fastest_m_s, 6)
    0.4375
    """
    if isinstance(given, Reference):
        return given
    text = str(given).strip()
    if text.endswith(".toml"):
        return _from_file(Path(text))
    if not text:
        raise CommandError("the reference is empty", remedy=f"Give {FORMS}.")
    if text.lower().startswith("sine"):
        return _sine_of(text)
    first, *rest = (entry.strip() for entry in text.split(";"))
    start = _quantity(first, "m", text)
    return _checked(text, start, [_move_of(entry, text) for entry in rest if entry])


def _sine_of(text: str) -> Reference:
    found = _SINE.fullmatch(text)
    if found is None:
        rule = "sine AMPLITUDE FREQUENCY around CENTRE"
        raise CommandError(f'reference "{text}" is not a sine', rule=rule, remedy="For instance " + FORMS.split(",")[0])
    amplitude, frequency, centre = (
        _quantity(one, unit, text) for one, unit in zip(found.groups(), ("m", "1/s", "m"), strict=True)
    )
    for name, value in (("amplitude", amplitude), ("frequency", frequency)):
        if not value > 0.0:
            raise CommandError(f"reference: the {name} of the sine is {value:g}", value=text, rule="greater than 0")
    return Reference(text, centre, amplitude_m=amplitude, frequency_hz=frequency)


def _move_of(entry: str, text: str) -> ReferenceMove:
    begin, colon, rest = entry.partition(":")
    to, within, duration = rest.partition(" in ")
    if not colon or not within:
        rule = "TIME: POSITION in DURATION for each move"
        raise CommandError(
            f'reference: "{entry}" is not a move', rule=rule, remedy='For instance "1 s: 280 mm in 0.3 s".'
        )
    times = (_quantity(one.strip(), "s", text) for one in (begin, duration))
    begin_s, duration_s = times
    return ReferenceMove(begin_s, duration_s, _quantity(to.strip(), "m", text))


def _quantity(given: str, si_unit: str, text: str) -> float:
    try:
        return units.parse(given, si_unit)
    except DescriptionError as error:
        remedy = error.remedy or f"Give {FORMS}."
        raise CommandError(f"reference: {error.what}", value=text, rule=error.rule, remedy=remedy) from None


def _from_file(path: Path) -> Reference:
    tables, text = toml.read(path, start='For instance: start = "220 mm", then [[moves]] with at, to and duration.')
    with toml.locating(path, text):
        read: Any = ReferenceFile.model_validate(tables)
    moves = [ReferenceMove(one.at_s, one.duration_s, one.to_m) for one in read.moves]
    return _checked(str(path), read.start_m, moves)


def _checked(text: str, start_m: float, moves: list[ReferenceMove]) -> Reference:
    free_s = 0.0
    for move in moves:
        if not move.duration_s > 0.0:
            raise CommandError(f"reference: a move takes {move.duration_s:g} s", value=text, rule="greater than 0")
        if not free_s <= move.begin_s <= LONGEST_S:
            what = f"reference: a move begins at {move.begin_s:g} s"
            rule = f"after the one before it has ended, here from {free_s:g} s to {LONGEST_S:g} s"
            raise CommandError(what, value=text, rule=rule)
        free_s = move.end_s
    return Reference(text, start_m, tuple(moves))


def check_reach(of: Reference, stroke_m: float, speed_m_s: float) -> None:
    """Raise an error for a reference that a drive cannot follow.

    Parameters
    ----------
    of : Reference
    stroke_m : float
    speed_m_s : float
        Of the drive at full opening.

    Raises
    ------
    CommandError
        It leaves the stroke, or is faster than the drive.
    """
    reach = of.reach()
    for end in (reach.lowest_m, reach.highest_m):
        if not 0.0 <= end <= stroke_m:
            rule = f"within the stroke, 0 mm to {1e3 * stroke_m:g} mm"
            raise CommandError(f"reference: it leads to {1e3 * end:g} mm", value=of.text, rule=rule)
    if reach.fastest_m_s > speed_m_s:
        factor = reach.fastest_m_s / speed_m_s
        slower = of.stretched(factor).text
        by = f"Stretch it in time by {factor:.3g}"
        raise CommandError(
            f"reference: {reach.fastest_m_s:.3g} m/s at {reach.at_s:.3g} s is faster than the drive",
            value=of.text,
            rule=f"at most {speed_m_s:.3g} m/s, the steady speed at full opening",
            remedy=f"{by}: {slower}" if len(slower) < LONGEST_REMEDY else f"{by}.",
        )


#: Share of a drive's speed that a standard reference takes at most, and of its stroke that a sine takes (assumed).
_SPEED_SHARE, _STROKE_SHARE = 0.85, 0.3


def standard_references(stroke_m: float, speed_m_s: float) -> dict[str, Reference]:
    """Return the standard references for a drive, slowed where it could not follow.

    R1 and R2: sines of 60 mm, 0.5 and 1 Hz, about mid stroke. R3: stairs, 60 mm forth and back in 0.3 s, then to 0.8
    and to 0.2 of the stroke. R5: 60 mm in 0.3 s and 40 s of rest. R6: 0.6 of the stroke in 0.25 s. In a stroke below
    200 mm, 0.3 of it takes the place of 60 mm.

    Parameters
    ----------
    stroke_m, speed_m_s : float
        Stroke, and steady speed at full opening.

    Returns
    -------
    dict
        Name -> reference.
    """
    step = min(0.06, _STROKE_SHARE * stroke_m)
    low, middle, right, left = (round(share * stroke_m, 6) for share in (0.46, 0.5, 0.8, 0.2))
    high = round(low + step, 6)
    made = {
        "R1": sine(step, 0.5, middle),
        "R2": sine(step, 1.0, middle),
        "R3": _moves(low, (1.0, 0.3, high), (3.0, 0.3, low), (5.0, 0.5, right), (7.0, 0.6, left)),
        "R5": _moves(low, (1.0, 0.3, high), rest_s=40.0),
        "R6": _moves(left, (1.0, 0.25, right)),
    }
    return {name: one.stretched(one.reach().fastest_m_s / (_SPEED_SHARE * speed_m_s)) for name, one in made.items()}


def _moves(start_m: float, *moves: tuple[float, float, float], rest_s: float = REST_S) -> Reference:
    return stairs(start_m, [ReferenceMove(*one) for one in moves], rest_s)
