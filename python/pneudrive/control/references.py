"""References (desired position over time) from text or file, and checks of their range and speed for a drive."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from pneudrive import units
from pneudrive.arrays import Pair
from pneudrive.control import motion
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.marks import Bounds, Position, Quantity
from pneudrive.errors import CommandError, DescriptionError, invalid, wrong
from pneudrive.simulation.trajectory import column_names, read_columns

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
ReferenceOrFile: TypeAlias = motion.Reference | str | Path
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


def reference(given: ReferenceOrFile) -> motion.Reference:
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
    if isinstance(given, motion.Reference):
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
        return motion.Reference(text, centre, amplitude_m=amplitude, frequency_hz=frequency)
    if _STANDARD.fullmatch(text):
        raise CommandError.of("control.standard", text=text)
    if text.isidentifier():
        raise CommandError(f'there is no reference "{text}"', remedy=f"Give a standard one, R1 to R6, or {FORMS}.")
    return moves_of_text(text, "m")


def moves_of_text(text: str, si_unit: str) -> motion.Reference:
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
        moves.append(motion.ReferenceMove(begin_s, duration_s, _quantity(to.strip(), si_unit, text)))
    return _checked(text, start, moves)


def _quantity(given: str, si_unit: str, text: str) -> float:
    try:
        return units.parse(given, si_unit)
    except DescriptionError as error:
        remedy = error.remedy or f"Give {FORMS}."
        raise CommandError(f"reference: {error.what}", value=text, rule=error.rule, remedy=remedy) from None


def _from_file(path: Path) -> motion.Reference:
    start = 'For instance: start = "220 mm", then [[moves]] with at, to and duration.'
    read: Any = toml.load(ReferenceFile.model_validate, path, start=start)
    if read.points:
        times, points = [one.at_s for one in read.points], [one.to_m for one in read.points]
        pieces = tuple(motion.through(times, points))
        return _missing(motion.Reference(str(path), points[0], pieces=pieces), times, points)
    if all(one.duration_s is not None for one in read.moves):
        moves = [motion.ReferenceMove(one.at_s, one.duration_s, one.to_m) for one in read.moves]
        return _checked(str(path), read.start_m, moves)
    limits = tuple(read.limits.stored().values())
    rows, free_s, at = [], 0.0, read.start_m
    for one in read.moves:
        _after(free_s, one.at_s, str(path))
        made = (
            motion.within_limits(one.at_s, at, one.to_m, limits)
            if one.duration_s is None
            else motion.blended(one.at_s, one.duration_s, at, one.to_m)
        )
        rows += made
        begin_s, lasts_s, *_ = made[-1] if made else (one.at_s, 0.0)
        free_s, at = begin_s + lasts_s, one.to_m
    return motion.Reference(str(path), read.start_m, pieces=tuple(rows))


def _missing(made: motion.Reference, times: Any, points: Any) -> motion.Reference:  # noqa: ANN401 - arrays or lists
    missed = np.abs(made.at(times)[:, 0] - np.asarray(points))
    return replace(made, points_missed_m=float(missed.max()))


def _of_record(path: Path) -> motion.Reference:
    names, there = ["time_s", "position_m"], column_names(path)
    if not set(names) <= set(there):
        raise CommandError.of("control.record_columns", path=path, columns=", ".join(there))
    time, position = read_columns(path, names).values()
    if len(time) <= motion.REST:
        raise CommandError.of("control.record_short", path=path, count=len(time), least=motion.REST)
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
    pieces = motion.near(time, position, max(KNOT_S, 2.0 * sparse))
    made = motion.Reference(str(path), float(position[0]), pieces=tuple(pieces))
    low, high = float(position.min()), float(position.max())
    within = max(BEYOND_SHARE * (high - low), BEYOND_M)
    nowhere = motion.Reach(-np.inf, *[np.inf] * 4)
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


def _checked(text: str, start_m: float, moves: list[motion.ReferenceMove]) -> motion.Reference:
    free_s = 0.0
    for move in moves:
        if not move.duration_s > 0.0:
            raise CommandError(f"reference: a move takes {move.duration_s:g} s", value=text, rule="greater than 0")
        _after(free_s, move.begin_s, text)
        free_s = move.end_s
    return motion.Reference(text, start_m, tuple(moves))


def beyond_stroke(of: motion.Reference, stroke_m: float) -> tuple[str, str] | None:
    """Return, as text, the position of a reference beyond the stroke, and the rule that it breaks.

    Return None if the reference stays within the stroke.
    """
    reach = of.reach()
    for end in (reach.lowest_m, reach.highest_m):
        if not -ROUNDING_M <= end <= stroke_m + ROUNDING_M:
            return f"the reference leads to {1e3 * end:g} mm", f"within the stroke, 0 mm to {1e3 * stroke_m:g} mm"
    return None


def check_reach(of: motion.Reference, stroke_m: float, speeds_m_s: Pair) -> None:
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
        raise CommandError(f"reference: {beyond[0]}", value=of.text, rule=beyond[1])
    if reach.share > 1.0:
        if reach.share > motion.NEVER:
            raise CommandError.of("control.no_motion", at_s=reach.at_s, value=of.text)
        by, slower = f"Stretch it in time by {motion.rounded_up(reach.share):g}", of.stretched(reach.share).text
        remedy = f"{by}." if of.pieces or len(slower) >= LONGEST_REMEDY else f"{by}: {slower}"
        limit_m_s = reach.fastest_m_s / reach.share
        raise CommandError.of("control.too_fast", reach=reach, limit_m_s=limit_m_s, value=of.text, remedy=remedy)


# --- Standard references, by which laws are compared.

#: Largest fraction of a drive's speed in a standard reference, and fraction of a short stroke for a sine (assumed).
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


def named_or_read(given: ReferenceOrFile, stroke_m: float, speeds_m_s: Pair) -> motion.Reference:
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
    stairs = (1.0, 0.3, high), (3.0, 0.3, low), (5.0, 0.5, right), (7.0, 0.6, left)
    moves = {
        "R3": (low, stairs, motion.REST_S),
        "R5": (low, ((1.0, 0.3, high),), 40.0),
        "R6": (left, ((1.0, 0.25, right),), motion.REST_S),
    }
    if name in sines:
        made = motion.sine(step, sines[name], middle)
    elif name in moves:
        start_m, each, rest_s = moves[name]
        made = motion.stairs(start_m, [motion.ReferenceMove(*one) for one in each], rest_s)
    else:
        rows, at, time = [], middle, _PAUSE_S
        size = stroke_m / RAMPS_STROKE_M
        for velocity, way in _RAMPS:  # at constant velocity, each forth and back
            for sign in (1.0, -1.0):
                to, lasts = at + sign * size * way, size * way / velocity
                rows += motion.along_line(time, at, to, lasts, _RUN_UP_S)
                at, time = to, time + lasts + _RUN_UP_S + _PAUSE_S
        made = motion.Reference("ramps of 1, 10 and 100 mm/s", middle, pieces=tuple(rows))
    share = made.reach(speeds_m_s).share
    return made.stretched(share / _SPEED_SHARE if share < motion.NEVER else 1.0)
