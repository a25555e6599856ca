"""Motion of a reference: wanted position over time as moves, a sine or polynomials."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive import _core, units
from pneudrive.repr_tables import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pneudrive.arrays import Array, Keyed, Pair, Plain

    Row = list[float]  # begin, s, duration, s, and ten coefficients, m, of the elapsed fraction of the duration

POWERS = 10
ORDER = 7  # of splines
REST = 4  # coefficients of a spline that are equal at an end where it is at rest with continuous jerk
#: Polynomial blend from 0 to 1 with three continuous derivatives.
BLEND = (0, 0, 0, 0, 35, -84, 70, -20)
#: Ratio of the largest to the mean speed of the blend.
PEAK = 2.1875
#: Velocity that grows from 0 to 1 by the blend of degree 7, integrated.
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

    At constant velocity, the whole distance would take `duration_s`. The blends add `run_up_s`, at most `duration_s`.
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
