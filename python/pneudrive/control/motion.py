"""References: desired position over time as moves, a sine or polynomials; reading from text or file, and checks."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from pneudrive import _core, units
from pneudrive.arrays import Array, Keyed, Pair, Plain
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.marks import Bounds, Position, Quantity
from pneudrive.errors import CommandError, DescriptionError, invalid, wrong
from pneudrive.repr_tables import Card, Shown
from pneudrive.simulation.trajectory import column_names, read_columns

Row = list[float]  # begin, s, duration, s, and ten coefficients, m, of the elapsed fraction of the duration

POWERS = 10
ORDER = 7  # of splines
REST = 4  # coefficients of a spline that are equal at an end where it is at rest with continuous jerk
#: Polynomial blend from 0 to 1 with three continuous derivatives.
BLEND = (0, 0, 0, 0, 35, -84, 70, -20)
#: Ratio of the largest to the mean speed of the blend.
PEAK = 2.1875
#: Integral of a velocity that grows from 0 to 1 by the blend of degree 7.
_RUN_UP = (0, 0, 0, 0, 0, 7, -14, 10, -2.5)
_ROUNDS = 200  # steps of a bisection: to the last bit


def piece(begin_s: float, duration_s: float, start_m: float, way_m: float, shape: Sequence[float]) -> Row:
    """Return a piece: a start position plus a distance times a polynomial."""
    numbers = [way_m * own for own in (*shape, *[0.0] * (POWERS - len(shape)))]
    return [begin_s, duration_s, start_m + numbers[0], *numbers[1:]]


def blended(begin_s: float, duration_s: float, start_m: float, to_m: float) -> list[Row]:
    """Return a move as a single polynomial, at rest at both ends."""
    return [piece(begin_s, duration_s, start_m, to_m - start_m, BLEND)]


def within_limits(begin_s: float, start_m: float, to_m: float, limits: tuple[float, ...]) -> list[Row]:
    """Return the fastest move of 15 pieces of constant snap within limits of velocity, acceleration, jerk and snap.

    Values are in SI. The snap is applied for t_s; the jerk is then held for t_j, the acceleration for t_a, and the
    velocity for t_v. In this order, each time is made as long as the limits and the distance allow.

    Examples
    --------
    >>> rows = within_limits(0.0, 0.0, 0.3, (1.0, 10.0, 500.0, 5e4))
    >>> len(rows), round(sum(row[1] for row in rows), 6)
    (15, 0.43)
    """
    way = abs(to_m - start_m)
    if way == 0.0:
        return []
    v, a, j, s = limits

    def fits(t_s: float, t_j: float = 0.0, t_a: float = 0.0) -> bool:
        jerk = s * t_s
        acceleration = jerk * (t_s + t_j)
        velocity = acceleration * (2.0 * t_s + t_j + t_a)
        return jerk <= j and acceleration <= a and velocity <= v and velocity * (2.0 * (2.0 * t_s + t_j) + t_a) <= way

    t_s = _longest(fits)
    t_j = _longest(lambda t: fits(t_s, t))
    t_a = _longest(lambda t: fits(t_s, t_j, t))
    top = s * t_s * (t_s + t_j) * (2.0 * t_s + t_j + t_a)
    t_v = max(0.0, way / top - 2.0 * (2.0 * t_s + t_j) - t_a)
    up = [(t_s, s), (t_j, 0.0), (t_s, -s)]
    down = [(t, -snap) for t, snap in up]
    faster, slower = [*up, (t_a, 0.0), *down], [*down, (t_a, 0.0), *up]
    rows, (x, v, a, j) = [], (start_m, 0.0, 0.0, 0.0)
    for t, size in [*faster, (t_v, 0.0), *slower]:  # intervals of constant snap
        s = math.copysign(1.0, to_m - start_m) * size
        numbers = [x, v * t, a * t**2 / 2.0, j * t**3 / 6.0, s * t**4 / 24.0]
        if t > 0.0:
            rows.append([begin_s, t, *numbers, *[0.0] * (POWERS - len(numbers))])
        x = sum(numbers)
        v = v + a * t + j * t**2 / 2 + s * t**3 / 6
        a = a + j * t + s * t**2 / 2
        j = j + s * t
        begin_s += t
    return rows


def _longest(fits: Callable[[float], bool]) -> float:
    """Return the longest time that `fits` accepts, or 0 if it accepts no time."""
    low, high = 0.0, 1e-6
    while fits(high):
        low, high = high, 2.0 * high
    for _ in range(_ROUNDS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def along_line(begin_s: float, start_m: float, to_m: float, duration_s: float, run_up_s: float) -> list[Row]:
    """Return a move at constant velocity, with blends at its start and end.

    At constant velocity, the whole distance would take `duration_s`. The blends add `run_up_s` to this time, but at
    most `duration_s`.
    """
    way = to_m - start_m
    run_up = min(run_up_s, duration_s)
    velocity, at = way / duration_s, run_up
    first = piece(begin_s, run_up, start_m, velocity * run_up, _RUN_UP)
    half = 0.5 * velocity * run_up
    straight = duration_s - run_up
    rows = [first]
    if straight > 0.0:
        rows.append(piece(begin_s + at, straight, start_m + half, velocity * straight, (0.0, 1.0)))
    # Backwards: the rest of the way is the mirrored run-up.
    last = np.polynomial.Polynomial([1.0, -1.0])
    mirrored = -np.polynomial.Polynomial(_RUN_UP)(last)
    rows.append(piece(begin_s + at + straight, run_up, to_m, velocity * run_up, mirrored.coef.tolist()))
    return rows


def through(times_s: Sequence[float], points_m: Sequence[float]) -> list[Row]:
    """Return a spline of degree 7 that passes through points at their times and is at rest at both ends."""
    from scipy.interpolate import PPoly, make_interp_spline

    rest = [(order, 0.0) for order in (1, 2, 3)]
    return _of_spline(PPoly.from_spline(make_interp_spline(times_s, points_m, k=ORDER, bc_type=(rest, rest))))


def near(times_s: Array, points_m: Array, knot_s: float) -> list[Row]:
    """Return the least-squares spline of degree 7 through the samples of a record, with knots every `knot_s`.

    The spline starts and ends at rest, at the first and last position of the record.
    """
    from scipy.interpolate import BSpline, PPoly
    from scipy.sparse.linalg import spsolve

    begin, end = float(times_s[0]), float(times_s[-1])
    count = max(REST, math.ceil((end - begin) / knot_s))
    breaks = np.linspace(begin, end, count + 1)
    knots = np.concatenate([[begin] * ORDER, breaks, [end] * ORDER])
    basis: Any = BSpline.design_matrix(times_s, knots, ORDER).tocsc()
    # The four coefficients at an end determine the value and three derivatives there.
    numbers = np.empty(len(knots) - ORDER - 1)
    numbers[:REST], numbers[-REST:] = points_m[0], points_m[-1]
    inner = basis[:, REST:-REST]
    rest = points_m - basis[:, :REST] @ numbers[:REST] - basis[:, -REST:] @ numbers[-REST:]
    solved: Any = spsolve((inner.T @ inner).tocsc(), inner.T @ rest)
    numbers[REST:-REST] = solved
    return _of_spline(PPoly.from_spline(BSpline(knots, numbers, ORDER)))


def _of_spline(spline: Any) -> list[Row]:  # noqa: ANN401 - scipy's own
    lasts = np.diff(spline.x)
    scaled = spline.c[::-1] * lasts ** np.arange(ORDER + 1)[:, None]
    missing = np.zeros((len(lasts), POWERS - len(scaled)))
    return np.column_stack([spline.x[:-1], lasts, scaled.T, missing])[lasts > 0.0].tolist()


#: Default durations: shortest run of a sine, s, its least number of periods, and rest after the last move, s.
SINE_S, SINE_PERIODS, REST_S = 16.0, 4.0, 2.0
_TOGETHER_S = 1e-9  # between pieces of one move
LEAST_M_S, NEVER = 1e-15, 1e9  # speed that replaces 0; fraction above which no stretching in time helps
_EVERY, _PERIODS = 400, 2.0  # samples of a move or a period of a sine, to find the highest speed
_EVERY_PIECE, _EVERY_PATH = 24, 4000  # the same for a polynomial; only the fastest ones are refined
TURN_M = 1e-4  # a shorter way back does not count as a reversal (assumed)
_REAL = 1e-6  # a root with a smaller imaginary part counts as real


class ReferenceMove(NamedTuple):
    """A move from the end of the previous move to a position, with continuous jerk.

    Attributes
    ----------
    begin_s, duration_s, to_m : float
    """

    begin_s: float
    duration_s: float
    to_m: float

    @property
    def end_s(self) -> float:
        """Time at which the move ends."""
        return self.begin_s + self.duration_s


class Reach(NamedTuple):
    """Range of a reference, and its highest speed relative to the speed of a drive in the same direction.

    Attributes
    ----------
    lowest_m, highest_m, fastest_m_s : float
    share : float
        Highest speed relative to the speed of the drive; above `NEVER` if the drive does not move in this direction.
    at_s : float
        Time of the highest relative speed.
    """

    lowest_m: float
    highest_m: float
    fastest_m_s: float
    share: float
    at_s: float


@dataclass(frozen=True, repr=False)
class Reference(Shown):
    """Reference of a drive over time: successive moves, a sine, or polynomials.

    Attributes
    ----------
    text : str
        Text of the reference as given.
    start_m : float
        First position; for a sine, its centre.
    moves : tuple of ReferenceMove
        Empty for a sine and for polynomials.
    amplitude_m, frequency_hz : float
        Amplitude and frequency of a sine, which grows from zero within its first period; 0 for moves.
    rest_s : float
        Time of rest after the last move in a run without a stated duration.
    pieces : tuple
        Polynomials.
    points_missed_m : float or None
        Largest distance of the curve from its given points; None without points.
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
        """Whether the reference is a sine, which never comes to rest."""
        return self.frequency_hz > 0.0

    @property
    def duration_s(self) -> float:
        """Default duration of a run: the longer of 16 s and four periods of a sine, or 2 s more than the moves."""
        if self.is_sine:
            return max(SINE_S, SINE_PERIODS / self.frequency_hz)
        ends = [move.end_s for move in self.moves[-1:]]
        ends += [begin + lasts for begin, lasts, *_ in self.pieces[-1:]]
        return max(ends, default=0.0) + self.rest_s

    def core(self) -> Plain:
        """Return the reference in the core's form, in SI."""
        if self.is_sine:
            sizes = {"amplitude_m": self.amplitude_m, "frequency_hz": self.frequency_hz}
            return {"kind": "sine", "centre_m": self.start_m, **sizes}
        if self.pieces:
            return {"kind": "pieces", "start_m": self.start_m, "pieces": [list(one) for one in self.pieces]}
        return {"kind": "moves", "start_m": self.start_m, "moves": [list(move) for move in self.moves]}

    def at(self, times_s: Sequence[float] | Array) -> Array:
        """Return position, velocity, acceleration and jerk at given times, in SI units, with the shape (n, 4)."""
        return _core.reference_at(json.dumps(self.core()), np.ascontiguousarray(times_s, dtype=float))

    def reach(self, speeds_m_s: Pair = (1.0, 1.0)) -> Reach:
        """Return range and highest relative speed, see `Reach`, for a drive with these speeds (m/s) in +x and in -x."""
        if self.is_sine:
            times = np.linspace(0.0, _PERIODS / self.frequency_hz, int(_PERIODS) * _EVERY + 1)
        else:
            each = [np.linspace(move.begin_s, move.end_s, _EVERY + 1) for move in self.moves]
            every = max(_EVERY_PIECE, _EVERY_PATH // max(len(self.pieces), 1))
            each += [np.linspace(begin, begin + lasts, every + 1) for begin, lasts, *_ in self.pieces]
            times = np.concatenate([np.zeros(1), *each])
        position, velocity, *_ = self.at(times).T
        shares = speed_shares(velocity, speeds_m_s)
        at = int(np.argmax(shares))
        fastest = abs(velocity[at]), shares[at], times[at]
        return Reach(*map(float, (position.min(), position.max(), *fastest)))

    def stretched(self, factor: float) -> Reference:
        """Return the motion stretched in time by a factor, rounded up to 0.001. Factors up to 1 have no effect."""
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


def speed_shares(velocity_m_s: Array, speeds_m_s: Pair) -> Array:
    """Return velocities as fractions of a drive's speed in the same direction, from its speeds in +x and -x (m/s)."""
    return np.abs(velocity_m_s) / np.where(velocity_m_s > 0.0, *np.maximum(speeds_m_s, LEAST_M_S))


def rounded_up(factor: float) -> float:
    """Return a factor of time stretching, rounded up to 0.001."""
    return float(np.ceil(1e3 * factor) / 1e3)


def moves_of(motion: Keyed) -> list[ReferenceMove]:
    """Return the moves of a motion in the core's form. A move lasts from one rest to the next. A sine has no moves."""
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


def ways_of(motion: Keyed) -> list[ReferenceMove]:
    """Return the moves of a motion in the core's form, divided at their reversals."""
    moves = moves_of(motion)
    if motion["kind"] != "pieces":
        return moves
    found, before = [], (0.0, float(motion["start_m"]))
    for move in moves:
        begin = before = (move.begin_s, before[1])
        points = [begin]  # where a piece may reverse, and the end of each piece
        for begin_s, duration_s, *numbers in motion["pieces"]:
            if move.begin_s <= begin_s < move.end_s:
                path = np.polynomial.Polynomial(numbers)
                roots = path.deriv().roots()
                real = roots[np.abs(roots.imag) < _REAL].real
                shares = [*np.sort(real[(real > 0.0) & (real < 1.0)]), 1.0]
                points += [(begin_s + duration_s * float(share), float(path(share))) for share in shares]
        for at_s, to_m in _turns(points):
            found.append(ReferenceMove(before[0], at_s - before[0], to_m))
            before = (at_s, to_m)
    return found


def _turns(points: Sequence[Pair]) -> list[Pair]:
    """Return the points at which a path reverses by more than `TURN_M`, and its last extreme position."""
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
    """Return a sinusoidal reference."""
    sizes = f"{units.write(amplitude_m, 'm', 'mm')} {units.write(frequency_hz, '1/s', 'Hz')}"
    text = f"sine {sizes} around {units.write(centre_m, 'm', 'mm')}"
    return Reference(text, centre_m, amplitude_m=amplitude_m, frequency_hz=frequency_hz)


def stairs(start_m: float, moves: Sequence[ReferenceMove], rest_s: float) -> Reference:
    """Return a reference that consists of successive moves."""
    each = (f"{move.begin_s:.9g} s: {units.write(move.to_m, 'm', 'mm')} in {move.duration_s:.9g} s" for move in moves)
    text = "; ".join([units.write(start_m, "m", "mm"), *each])
    return Reference(text, start_m, tuple(moves), rest_s=rest_s)


# --- References from text or file, and checks of their range and speed for a drive.

LONGEST_S = 1e6  # of a reference
LONGEST_REMEDY = 200  # characters of a slower reference in a message
KNOT_S = 0.05  # distance of the knots of the spline through a record (assumed)
ROUNDING_M = 1e-9  # allowed excess of a path's end over the stroke
BEYOND_SHARE, BEYOND_M = 0.5, 1e-3  # allowed excess of the curve over a record: fraction of its range, and m (assumed)
NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s*[A-Za-zµ]+"
_SINE = re.compile(rf"sine\s+({NUMBER})\s+({NUMBER})\s+around\s+({NUMBER})", re.IGNORECASE)
_STANDARD = re.compile(r"R[1-8]")
FORMS = (
    '"sine 60 mm 0.5 Hz around 250 mm", "220 mm; 1 s: 280 mm in 0.3 s; 3 s: 220 mm in 0.3 s", a TOML file, or a record '
    "(.csv or .parquet with time_s and position_m)"
)
RECORDS = (".csv", ".parquet")
#: A reference, its text, or a file.
ReferenceOrFile: TypeAlias = Reference | str | Path
PROGRAM = re.compile(r"\.(gcode|nc|ngc)(:\w*)?$")


_Time = Annotated[float, Quantity("s", "s", Bounds(at_least=0.0, at_most=LONGEST_S))]
_Over = Bounds(above=0.0)


class PointTable(Described):
    """A point of a reference file."""

    at_s: _Time
    to_m: Position


class MoveTable(PointTable):
    """A move of a reference file."""

    duration_s: Annotated[float | None, Quantity("s", "s", Bounds(above=0.0, at_most=LONGEST_S))] = Field(
        default=None, description="absent: as short as the limits of the file allow"
    )


class LimitTable(Described):
    """Limits of moves without a duration. Such a move has 15 segments of constant snap."""

    table_name = "limits"
    velocity_m_s: Annotated[float, Quantity("m/s", "m/s", _Over)]
    acceleration_m_s2: Annotated[float, Quantity("m/s^2", "m/s2", _Over)]
    jerk_m_s3: Annotated[float, Quantity("m/s^3", "m/s3", _Over)]
    snap_m_s4: Annotated[float, Quantity("m/s^4", "m/s4", _Over)]


class ReferenceFile(Described):
    """Reference as a file: ``start`` and a table ``[[moves]]`` for each move, or tables ``[[points]]`` of a spline."""

    schema_version: Literal[1] = Field(default=1, alias="schema")
    start_m: Position | None = None
    moves: tuple[MoveTable, ...] = ()
    limits: LimitTable | None = None
    points: tuple[PointTable, ...] = ()

    @model_validator(mode="after")
    def _one_kind(self) -> ReferenceFile:
        if self.points and (self.moves or self.start_m is not None):
            raise wrong("points", "points, start and moves are given", remedy="Give either points, or start and moves.")
        if not self.points and self.start_m is None:
            raise wrong("start", "start is missing", remedy='For instance start = "220 mm".')
        if len(self.points) == 1:
            raise wrong("points", "there is only one point", rule="a reference needs at least two points")
        for number, (before, after) in enumerate(pairwise(self.points), start=1):
            if not after.at_s > before.at_s:
                raise wrong(f"points.{number}.at", f"{after.at_s:g} s follows {before.at_s:g} s", rule="times increase")
        for number, move in enumerate(self.moves):
            if move.duration_s is None and self.limits is None:
                raise wrong(f"moves.{number}.duration", "duration is missing", remedy="Give duration or [limits].")
        if self.limits is not None and all(move.duration_s is not None for move in self.moves):
            raise invalid("limits", "control.limits")
        return self


def reference(given: ReferenceOrFile) -> Reference:
    """Read a reference for a drive under control.

    Parameters
    ----------
    given : Reference, str or path-like
        ``"sine 60 mm 0.5 Hz around 250 mm"``; a position and moves with their durations, ``"220 mm; 1 s: 280 mm in
        0.3 s; 3 s: 220 mm in 0.3 s"``; a TOML file with ``start`` and tables ``[[moves]]``, or with tables
        ``[[points]]``; a record, .csv or .parquet with the columns ``time_s`` and ``position_m``. A reference is
        returned unchanged.

    Raises
    ------
    CommandError
        The text has none of these forms, or a move begins before the previous one ends.
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
    lower = text.lower()
    if lower.endswith(".toml"):
        return _from_file(Path(text))
    if lower.endswith(RECORDS):
        return _of_record(Path(text))
    if PROGRAM.search(lower):
        raise CommandError.of("control.program", text=text)
    if not text:
        raise CommandError("the reference is empty", remedy=f"Give {FORMS}.")
    if text.lower().startswith("sine"):
        found = _SINE.fullmatch(text)
        if found is None:
            raise CommandError.of("control.sine", text=text, example=FORMS.split(",")[0])
        amplitude, frequency, centre = map(_quantity, found.groups(), ("m", "1/s", "m"), (text,) * 3)
        for name, value in (("amplitude", amplitude), ("frequency", frequency)):
            if not value > 0.0:
                raise CommandError(f"reference: the {name} of the sine is {value:g}", value=text, rule="greater than 0")
        return Reference(text, centre, amplitude_m=amplitude, frequency_hz=frequency)
    if _STANDARD.fullmatch(text):
        raise CommandError.of("control.standard", text=text)
    if text.isidentifier():
        raise CommandError(f'there is no reference "{text}"', remedy=f"Give a standard one, R1 to R6, or {FORMS}.")
    return moves_of_text(text, "m")


def moves_of_text(text: str, si_unit: str) -> Reference:
    """Read a start and moves, ``"220 mm; 1 s: 280 mm in 0.3 s"``, of a coordinate with a given unit.

    Raises
    ------
    CommandError
        The text is not valid, or a move begins before the previous one ends.
    """
    if re.search(r"[a-z]\s*,", text):
        raise CommandError.of("control.comma", text=text, written=text.replace(",", ";"))
    first, *rest = (entry.strip() for entry in text.split(";"))
    start, moves = _quantity(first, si_unit, text), []
    for entry in filter(None, rest):
        begin, colon, way = entry.partition(":")
        to, within, duration = way.rpartition(" in ")  # the last one: "12 in in 0.3 s"
        if not colon or not within:
            raise CommandError.of("control.move", entry=entry)
        begin_s, duration_s = (_quantity(one.strip(), "s", text) for one in (begin, duration))
        moves.append(ReferenceMove(begin_s, duration_s, _quantity(to.strip(), si_unit, text)))
    return _checked(text, start, moves)


def _quantity(given: str, si_unit: str, text: str) -> float:
    try:
        return units.parse(given, si_unit)
    except DescriptionError as error:
        remedy = error.remedy or f"Give {FORMS}."
        raise CommandError(f"reference: {error.what}", value=text, rule=error.rule, remedy=remedy) from None


def _from_file(path: Path) -> Reference:
    start = 'For instance: start = "220 mm", then [[moves]] with at, to and duration.'
    read: Any = toml.load(ReferenceFile.model_validate, path, start=start)
    if read.points:
        times, points = [one.at_s for one in read.points], [one.to_m for one in read.points]
        pieces = tuple(through(times, points))
        return _missing(Reference(str(path), points[0], pieces=pieces), times, points)
    if all(one.duration_s is not None for one in read.moves):
        moves = [ReferenceMove(one.at_s, one.duration_s, one.to_m) for one in read.moves]
        return _checked(str(path), read.start_m, moves)
    limits = tuple(read.limits.stored().values())
    rows, free_s, at = [], 0.0, read.start_m
    for one in read.moves:
        _after(free_s, one.at_s, str(path))
        made = (
            within_limits(one.at_s, at, one.to_m, limits)
            if one.duration_s is None
            else blended(one.at_s, one.duration_s, at, one.to_m)
        )
        rows += made
        begin_s, lasts_s, *_ = made[-1] if made else (one.at_s, 0.0)
        free_s, at = begin_s + lasts_s, one.to_m
    return Reference(str(path), read.start_m, pieces=tuple(rows))


def _missing(made: Reference, times: Any, points: Any) -> Reference:  # noqa: ANN401 - arrays or lists
    missed = np.abs(made.at(times)[:, 0] - np.asarray(points))
    return replace(made, points_missed_m=float(missed.max()))


def _of_record(path: Path) -> Reference:
    names, there = ["time_s", "position_m"], column_names(path)
    if not set(names) <= set(there):
        raise CommandError.of("control.record_columns", path=path, columns=", ".join(there))
    time, position = read_columns(path, names).values()
    if len(time) <= REST:
        raise CommandError.of("control.record_short", path=path, count=len(time), least=REST)
    rises = np.diff(time, prepend=-1.0) > 0.0
    for bad, rule in (
        (~(np.isfinite(time) & np.isfinite(position)), "a finite time and a finite position in each sample"),
        (~rises | (time < 0.0) | (time > LONGEST_S), f"times must rise, from 0 to {LONGEST_S:g} s"),
    ):
        if bad.any():
            first = int(np.argmax(bad))
            value = f"time_s = {time[first]:g}, position_m = {position[first]:g}"
            raise CommandError(f"the record {path}: sample {first + 1} is not valid", value=value, rule=rule)
    sparse = float(np.diff(time).max())
    pieces = near(time, position, max(KNOT_S, 2.0 * sparse))
    made = Reference(str(path), float(position[0]), pieces=tuple(pieces))
    low, high = float(position.min()), float(position.max())
    within = max(BEYOND_SHARE * (high - low), BEYOND_M)
    nowhere = Reach(-np.inf, *[np.inf] * 4)
    reach = made.reach() if np.isfinite(made.pieces).all() else nowhere
    if low - within <= reach.lowest_m and reach.highest_m <= high + within:
        return _missing(made, time, position)
    # The fitted curve leaves the range of the samples, for example in a long gap.
    gap = int(np.argmax(np.diff(time)))
    end = reach.lowest_m if low - reach.lowest_m > reach.highest_m - high else reach.highest_m
    to = f"leads to {1e3 * end:.4g} mm" if np.isfinite(end) else "is not determined"
    begin_s, end_s = time[gap : gap + 2]
    value = f"no sample from {begin_s:g} s to {end_s:g} s, a gap of {end_s - begin_s:.4g} s"
    raise CommandError.of("control.beyond_record", record=made.text, to=to, low=1e3 * low, high=1e3 * high, value=value)


def _after(free_s: float, begin_s: float, text: str) -> None:
    if not free_s <= begin_s <= LONGEST_S:
        raise CommandError.of("control.order", value=text, begin=begin_s, free=free_s, longest=LONGEST_S)


def _checked(text: str, start_m: float, moves: list[ReferenceMove]) -> Reference:
    free_s = 0.0
    for move in moves:
        if not move.duration_s > 0.0:
            raise CommandError(f"reference: a move takes {move.duration_s:g} s", value=text, rule="greater than 0")
        _after(free_s, move.begin_s, text)
        free_s = move.end_s
    return Reference(text, start_m, tuple(moves))


def beyond_stroke(of: Reference, stroke_m: float) -> tuple[str, str] | None:
    """Return, as text, the position of a reference beyond the stroke, and the rule that it breaks.

    Return None if the reference stays within the stroke.
    """
    reach = of.reach()
    for end in (reach.lowest_m, reach.highest_m):
        if not -ROUNDING_M <= end <= stroke_m + ROUNDING_M:
            return f"the reference leads to {1e3 * end:g} mm", f"within the stroke, 0 mm to {1e3 * stroke_m:g} mm"
    return None


def check_reach(of: Reference, stroke_m: float, speeds_m_s: Pair) -> None:
    """Raise an error for a reference that a drive cannot follow.

    Parameters
    ----------
    of : Reference
    stroke_m : float
    speeds_m_s : pair of float
        Steady speeds of the drive at full opening in +x and in -x.

    Raises
    ------
    CommandError
        The reference leaves the stroke, or is faster than the drive.
    """
    beyond, reach = beyond_stroke(of, stroke_m), of.reach(speeds_m_s)
    if beyond is not None:
        raise CommandError(beyond[0], value=of.text, rule=beyond[1])
    if reach.share > 1.0:
        if reach.share > NEVER:
            raise CommandError.of("control.no_motion", at_s=reach.at_s, value=of.text)
        by, slower = f"Stretch it in time by {rounded_up(reach.share):g}", of.stretched(reach.share).text
        remedy = f"{by}." if of.pieces or len(slower) >= LONGEST_REMEDY else f"{by}: {slower}"
        limit_m_s = reach.fastest_m_s / reach.share
        raise CommandError.of("control.too_fast", reach=reach, limit_m_s=limit_m_s, value=of.text, remedy=remedy)


# --- Standard references, by which laws are compared.

#: Largest fraction of a drive's speed in a standard reference, and fraction of a short stroke in place of 60 mm
#: (assumed).
_SPEED_SHARE, _STROKE_SHARE = 0.85, 0.3
#: References of a comparison by default.
USUAL = ("R1", "R2", "R3", "R5", "R6")
#: Names of all standard references.
NAMES = tuple(f"R{number}" for number in range(1, 7))
#: Stroke to which the ramp lengths below apply, m.
RAMPS_STROKE_M = 0.5
#: Ramps of R4: (speed, m/s; length, m).
_RAMPS = ((0.001, 0.005), (0.01, 0.03), (0.1, 0.1))
_RUN_UP_S, _PAUSE_S = 0.1, 1.0


def named_or_read(given: ReferenceOrFile, stroke_m: float, speeds_m_s: Pair) -> Reference:
    """Return a standard reference for a drive by its name, or read any other reference.

    Errors are those of `reference`.
    """
    if given not in NAMES:
        return reference(given)
    name = str(given)
    step = min(0.06, _STROKE_SHARE * stroke_m)
    low, middle, right, left = (round(share * stroke_m, 6) for share in (0.46, 0.5, 0.8, 0.2))
    high = round(low + step, 6)
    sines = {"R1": 0.5, "R2": 1.0}
    steps = (1.0, 0.3, high), (3.0, 0.3, low), (5.0, 0.5, right), (7.0, 0.6, left)
    moves = {
        "R3": (low, steps, REST_S),
        "R5": (low, ((1.0, 0.3, high),), 40.0),
        "R6": (left, ((1.0, 0.25, right),), REST_S),
    }
    if name in sines:
        made = sine(step, sines[name], middle)
    elif name in moves:
        start_m, each, rest_s = moves[name]
        made = stairs(start_m, [ReferenceMove(*one) for one in each], rest_s)
    else:
        rows, at, time = [], middle, _PAUSE_S
        size = stroke_m / RAMPS_STROKE_M
        for velocity, way in _RAMPS:  # at constant velocity, each forth and back
            for sign in (1.0, -1.0):
                to, lasts = at + sign * size * way, size * way / velocity
                rows += along_line(time, at, to, lasts, _RUN_UP_S)
                at, time = to, time + lasts + _RUN_UP_S + _PAUSE_S
        made = Reference("ramps of 1, 10 and 100 mm/s", middle, pieces=tuple(rows))
    share = made.reach(speeds_m_s).share
    return made.stretched(share / _SPEED_SHARE if share < NEVER else 1.0)
