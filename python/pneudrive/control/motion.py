"""Motion of a reference: wanted position over time, as moves, a sine or polynomials."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import _core, units
from pneudrive.repr_tables import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.control.paths import Row

    Array = NDArray[np.float64]

#: How long a reference is run where nothing is said: a sine at least so, and what follows the last move.
SINE_S, SINE_PERIODS, REST_S = 16.0, 4.0, 2.0
_TOGETHER_S = 1e-9  # between pieces of one move
_EVERY, _PERIODS = 400, 2.0  # samples of a move or a period of a sine, to find the highest speed
_EVERY_PIECE, _EVERY_PATH = 24, 4000  # the same for a polynomial; only the fastest ones are refined
TURN_M = 1e-4  # a shorter way back does not count as a reversal (assumed)
_REAL = 1e-6  # a root with a smaller imaginary part counts as real


class ReferenceMove(NamedTuple):
    """A move to a position from the end of the previous move, blended with continuous jerk.

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
    """Range and highest speed of a reference.

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
    """Reference of a drive over time: successive moves, a sine, or polynomials.

    Attributes
    ----------
    text : str
        As it was given.
    start_m : float
        First position; of a sine its centre.
    moves : tuple of ReferenceMove
        Empty for a sine and for polynomials.
    amplitude_m, frequency_hz : float
        Of a sine, whose amplitude grows from nothing within its first period; 0 for moves.
    rest_s : float
        Behind the last move, where no duration of a run is said.
    pieces : tuple
        Polynomials, as of `pneudrive.control.paths`.
    points_missed_m : float or None
        Largest distance from the points that it was made of; None: it was made of none.
    """

    text: str
    start_m: float
    moves: tuple[ReferenceMove, ...] = ()
    amplitude_m: float = 0.0
    frequency_hz: float = 0.0
    rest_s: float = REST_S
    pieces: tuple[Row, ...] = ()
    points_missed_m: float | None = None

    @property
    def is_sine(self) -> bool:
        """Whether it is a sine, which never rests."""
        return self.frequency_hz > 0.0

    @property
    def duration_s(self) -> float:
        """Default duration of a run: 16 s or four periods of a sine, and 2 s of rest after moves."""
        if self.is_sine:
            return max(SINE_S, SINE_PERIODS / self.frequency_hz)
        ends = [move.end_s for move in self.moves[-1:]] + [begin + lasts for begin, lasts, *_ in self.pieces[-1:]]
        return max(ends, default=0.0) + self.rest_s

    def core(self) -> dict[str, Any]:
        """Return it in the core's form, SI."""
        if self.is_sine:
            sizes = {"amplitude_m": self.amplitude_m, "frequency_hz": self.frequency_hz}
            return {"kind": "sine", "centre_m": self.start_m, **sizes}
        if self.pieces:
            return {"kind": "pieces", "start_m": self.start_m, "pieces": [list(one) for one in self.pieces]}
        return {"kind": "moves", "start_m": self.start_m, "moves": [list(move) for move in self.moves]}

    def at(self, times_s: Sequence[float] | Array) -> Array:
        """Return position, velocity, acceleration and jerk at times, shape (n, 4), SI."""
        return _core.reference_at(json.dumps(self.core()), np.ascontiguousarray(times_s, dtype=np.float64))

    def reach(self) -> Reach:
        """Return range and highest speed."""
        if self.is_sine:
            times = np.linspace(0.0, _PERIODS / self.frequency_hz, int(_PERIODS) * _EVERY + 1)
        else:
            each = [np.linspace(move.begin_s, move.end_s, _EVERY + 1) for move in self.moves]
            every = max(_EVERY_PIECE, _EVERY_PATH // max(len(self.pieces), 1))
            each += [np.linspace(begin, begin + lasts, every + 1) for begin, lasts, *_ in self.pieces]
            times = np.concatenate([np.zeros(1), *each])
        position, velocity, *_ = self.at(times).T
        fastest = int(np.argmax(np.abs(velocity)))
        lowest, highest = float(position.min()), float(position.max())
        return Reach(lowest, highest, float(abs(velocity[fastest])), float(times[fastest]))

    def stretched(self, factor: float) -> Reference:
        """Return the motion slowed by a factor in time, rounded up to a thousandth; unchanged for a factor up to 1."""
        if factor <= 1.0:
            return self
        factor = rounded_up(factor)
        if self.is_sine:
            return sine(self.amplitude_m, round(self.frequency_hz / factor, 9), self.start_m)
        if self.pieces:
            slower = tuple([factor * begin, factor * lasts, *rest] for begin, lasts, *rest in self.pieces)
            return replace(self, text=f"{self.text}, slowed by {factor:g}", pieces=slower)
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
        if self.points_missed_m is not None:
            rows.append(("points missed by", f"{1e6 * self.points_missed_m:.3g} um at most"))
        return Card(self.text, rows=rows)


def rounded_up(factor: float) -> float:
    """Return a factor in time, rounded up to a thousandth."""
    return float(np.ceil(1e3 * factor) / 1e3)


def moves_of(motion: Mapping[str, Any]) -> list[ReferenceMove]:
    """Return the moves of a motion in the core's form: from one rest to the next. A sine has no moves."""
    if motion["kind"] == "moves":
        return [ReferenceMove(*one) for one in motion["moves"]]
    found: list[ReferenceMove] = []
    for begin_s, duration_s, *numbers in motion.get("pieces", ()):
        if not any(numbers[1:]):
            continue
        end_s, to_m = begin_s + duration_s, float(sum(numbers))
        goes_on = found and begin_s <= found[-1].end_s + _TOGETHER_S
        from_s = found.pop().begin_s if goes_on else begin_s
        found.append(ReferenceMove(from_s, end_s - from_s, to_m))
    return found


def ways_of(motion: Mapping[str, Any]) -> list[ReferenceMove]:
    """Return the moves of a motion in the core's form, divided at their reversals."""
    moves = moves_of(motion)
    if motion["kind"] != "pieces":
        return moves
    found, before = [], (0.0, float(motion["start_m"]))
    for move in moves:
        begin = before = (move.begin_s, before[1])
        parts = [one for one in motion["pieces"] if move.begin_s <= one[0] < move.end_s]
        for at_s, to_m in _turns([begin, *(point for one in parts for point in _extremes(one))]):
            found.append(ReferenceMove(before[0], at_s - before[0], to_m))
            before = (at_s, to_m)
    return found


def _extremes(piece: Row) -> list[tuple[float, float]]:
    """Return times and positions at which a piece may turn around, and its end."""
    begin_s, duration_s, *numbers = piece
    path = np.polynomial.Polynomial(numbers)
    roots = path.deriv().roots()
    real = roots[np.abs(roots.imag) < _REAL].real
    shares = [*np.sort(real[(real > 0.0) & (real < 1.0)]), 1.0]
    return [(begin_s + duration_s * float(share), float(path(share))) for share in shares]


def _turns(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the reversals of a path by more than `TURN_M`, and its last extreme position."""
    found, far, way = [], points[0], 0.0
    for point in points[1:]:
        ahead = point[1] - far[1]
        if way == 0.0:
            if abs(ahead) > TURN_M:
                far, way = point, float(np.sign(ahead))
        elif way * ahead >= 0.0:
            far = point
        elif abs(ahead) > TURN_M:
            found.append(far)
            far, way = point, -way
    return [*found, far if way else points[-1]]


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


def polynomials(
    text: str, start_m: float, pieces: Sequence[Row], *, rest_s: float = REST_S, points_missed_m: float | None = None
) -> Reference:
    """Return polynomials, one after the other."""
    return Reference(text, start_m, rest_s=rest_s, pieces=tuple(pieces), points_missed_m=points_missed_m)
