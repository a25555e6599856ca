"""Roles of the columns of a foreign table, each with its evidence and its rank. Close candidates are left open."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.signals.proposal.evidence import (
    FEWEST,
    PHYSICS,
    Candidate,
    Directions,
    TableSignals,
    groups_of,
    is_held,
    same_signal,
    unevenness,
)
from pneudrive.signals.proposal.times import Times, find_times, unit_by_size
from pneudrive.signals.tables.names import FAMILY, SECONDARY, family_of, role_of, side_of, words_of
from pneudrive.signals.tables.timing import COUNTERS, filled, on_clock, unwrapped
from pneudrive.units import converter

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from pneudrive.signals.tables.sniff import FileForm

    Array = NDArray[np.float64]

CLEAR = 1.0  # least difference of the weights of two candidates
CLEAR_STROKES = 0.5  # the same of two signals, in unevenness
CLEAR_SWING = 2.0  # least ratio of the swings of a force and of the next signal
CLEAR_PRESSURES = 1.6  # least ratio of two pressures, beyond that of the areas of a piston with a rod
FOLLOWS = 0.8  # least correlation of a closed chamber's pressure with the position
#: Chamber -> how its pressure follows the position if it is closed.
CLOSED = {"a": "falls as the position grows", "b": "rises as the position grows"}
CLEAR_SHARE = 0.5  # least correlation of force and pressure within one direction
#: Role -> unit to scale volts and counts to.
RAW_UNITS = {"position": "mm", "force": "N", "pressure": "bar"}
WHOLE_SPAN = 500  # whole numbers over more than this are counts


@dataclass(frozen=True)
class Guess:
    """A guess of a column: ``role`` time, position, force, command, pressure, pressure_a or pressure_b.

    A time at a rate has no ``index``. ``gauge`` has the value None if a pressure is not marked as gauge or absolute.
    ``keys`` are further keys of the column in the layout.
    """

    role: str
    column: int | str
    index: int | None
    unit: str
    reason: str
    gauge: bool | None = None
    keys: str = ""


@dataclass(frozen=True)
class Question:
    """An open role: the reason, and the candidate columns."""

    role: str
    why: str
    choices: tuple[Guess, ...] = ()

    @property
    def text(self) -> str:
        """The question as one sentence."""
        names = families([str(choice.column) for choice in self.choices])
        return f"{self.role}: {self.why}" + (f" ({', '.join(names)})" if names else "")


@dataclass
class Roles:
    """The guesses and the questions of one table."""

    signals: TableSignals
    times: Times
    guesses: list[Guess] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)
    directions: Directions | None = None
    sign: int = 0

    def index(self, role: str) -> int | None:
        """Return the column of a role."""
        return next((guess.index for guess in self.guesses if guess.role == role), None)

    @property
    def unused(self) -> list[int]:
        """Columns of numbers without a role, which no question lists."""
        times = self.times
        listed = [*self.guesses, *(choice for question in self.questions for choice in question.choices)]
        used = {guess.index for guess in listed} | {times.index, times.date, *times.clocks.values()}
        numbers = [at for at, values in enumerate(self.signals.columns) if np.isfinite(values).any()]
        return [at for at in numbers if at not in used and at not in self.signals.reading.words]

    def ask_chambers(self) -> None:
        """Ask for the pressures of chambers without a column, if an unused column may be one of them."""
        asked = " ".join(question.role for question in self.questions)
        sides = [f"pressure_{side}" for side in CLOSED if self.index(f"pressure_{side}") is None]
        columns = self.signals.columns
        used = [columns[guess.index] for guess in self.guesses if guess.index is not None]
        spare = [at for at in self.unused if self.signals.may_be_pressure(at)]
        spare = [at for at in spare if not any(same_signal(values, columns[at]) for values in used)]
        if sides and spare and "pressure" not in asked:
            why = "no column has its name, and a column that the layout does not use may be its pressure"
            _leave_open(self, " and ".join(sides), why, [Candidate(at, 0.0, ("not used",)) for at in spare])


def families(names: Iterable[str]) -> list[str]:
    """Return names, with one entry for names that differ only by their number.

    Examples
    --------
    >>> families(["pa0", "pa1", "pa2", "t"])
    ['pa0 .. pa2', 't']
    """
    out: dict[str, list[str]] = {}
    for name in names:
        out.setdefault(family_of(name), []).append(name)
    return [text for some in out.values() for text in ([f"{some[0]} .. {some[-1]}"] if len(some) >= FAMILY else some)]


def guess_columns(reading: FileForm, columns: list[Array]) -> Roles:
    """Guess the role and unit of each relevant column by name, unit and signal."""
    signals = TableSignals.of(reading, columns)
    times = find_times(signals)
    signals.columns = [_on_time(signals, times, at) for at in range(len(columns))]
    roles = Roles(signals, times)
    _position(roles)
    _command(roles)
    _force(roles)
    _pressures(roles)
    _time(roles)
    _other_lengths(roles)
    return roles


def _other_lengths(roles: Roles) -> None:
    """Ask for channels whose names state an open role, but whose lengths differ from the others."""
    known = [guess.role for guess in roles.guesses]
    for name, length in roles.signals.reading.other_lengths.items():
        role = role_of(name)
        is_open = sum("pressure" in text for text in known) < len(CLOSED) if role == "pressure" else role not in known
        if role is not None and is_open and length > 1 and not SECONDARY.search(words_of(name)):  # 1: a constant
            usual = roles.signals.columns[0].size
            why = f"channel {name!r} has {length} values and the others have {usual}: resample it to their times"
            roles.questions.append(Question(role, why))


def _on_time(signals: TableSignals, times: Times, at: int) -> Array:
    """Return a column at the times of the table.

    A slow column is filled, and a column with a separate clock or start is aligned.
    """
    values = signals.columns[at]
    if at in signals.taken:
        return values
    values, _ = unwrapped(values, COUNTERS)
    if (clock := times.clocks.get(at)) is not None:
        return on_clock(times.values, signals.columns[clock], values)
    if late := _late(signals, times).get(at, 0.0):
        begin = late * (times.rate_hz or 0.0)
        return on_clock(times.values, times.values + begin, values)
    return filled(times.values, values)


def _late(signals: TableSignals, times: Times) -> dict[int, float]:
    """Return the starts of channels without times, s after the first, by column."""
    return signals.reading.preamble.starts_s if times.index is None else {}


def _position(roles: Roles) -> None:
    signals = roles.signals
    named = signals.candidates("position")
    evenness = {one.index: unevenness(signals.columns[one.index], is_one_of_many=True) for one in named}
    named = [
        Candidate(one.index, one.score + PHYSICS, (*one.evidence, "strokes")) if evenness[one.index] < np.inf else one
        for one in named
    ]
    chosen = _choose(roles, "position", named) if named else _position_by_strokes(roles)
    if chosen is None:
        return
    roles.directions = Directions.of(signals.columns[chosen.index])
    if not named:
        return
    _accept(roles, "position", chosen, _next(signals, chosen, named))


def _position_by_strokes(roles: Roles) -> Candidate | None:
    """Find the signal that moves evenly between its turning points, with little extra path."""
    signals = roles.signals
    groups = groups_of(signals, signals.without_role())
    ranked = sorted(
        (unevenness(signals.columns[group[-1]], is_one_of_many=len(groups) > 1), group[-1]) for group in groups
    )
    ranked = [pair for pair in ranked if pair[0] < 3.0]
    if not ranked:
        return None
    close = [
        Candidate(index, PHYSICS, ("even strokes",))
        for badness, index in ranked
        if badness < ranked[0][0] + CLEAR_STROKES
    ]
    held = [group[-1] for group in groups if is_held(signals.columns[group[-1]])]
    if len(close) > 1 and held and len(groups) > FEWEST:
        _accept(roles, "command", Candidate(held[0], PHYSICS, ("constant from step to step, unlike a force",)), "")
        close = [Candidate(group[-1], PHYSICS, ("a signal",)) for group in groups if group[-1] != held[0]]
        _leave_open(roles, "position, pressure_a and pressure_b", "numbers alone do not distinguish them", close)
    elif len(close) > 1:
        _leave_open(roles, "position", "these columns move alike", close)
    if len(close) > 1:
        signals.taken |= {one.index for one in close}
        return None
    chosen = Candidate(ranked[0][1], PHYSICS, ("even strokes",))
    rank = f"next: column {signals.place(ranked[1][1])!r}" if len(ranked) > 1 else "no other candidate"
    _accept(roles, "position", chosen, rank)
    return chosen


def _command(roles: Roles) -> None:
    signals = roles.signals
    named = [candidate for candidate in signals.candidates("command") if "name" in candidate.evidence]
    if named and (chosen := _choose(roles, "command", named)):
        _accept(roles, "command", chosen, _next(signals, chosen, named))


def _force(roles: Roles) -> None:
    signals, directions = roles.signals, roles.directions
    named = signals.candidates("force")
    if directions is not None:
        named = [
            Candidate(one.index, one.score + PHYSICS, (*one.evidence, "changes with the direction"))
            if directions.sign(signals.columns[one.index])
            else one
            for one in named
        ]
    if named:
        chosen = _choose(roles, "force", named)
        rank = "" if chosen is None else _next(signals, chosen, named)
    elif directions is not None and roles.index("command") is None:
        chosen, rank = _force_by_swing(roles)
    else:
        return
    if chosen is None:
        return
    if directions is not None:
        roles.sign = directions.sign(signals.columns[chosen.index])
        if roles.sign == 0:
            why = 'the force does not show its sign, as it hardly changes with the direction: positive = "+x" or "-x"'
            _leave_open(roles, "force", why, [chosen])
            signals.taken.add(chosen.index)
            return
    _accept(roles, "force", chosen, rank)


def _force_by_swing(roles: Roles) -> tuple[Candidate | None, str]:
    """Find the signal that changes most with the direction."""
    signals, directions = roles.signals, roles.directions
    assert directions is not None
    rest = [group[-1] for group in groups_of(signals, signals.without_role())]
    ranked = sorted(((directions.swing(signals.columns[at]), at) for at in rest), reverse=True)
    if not ranked:
        return None, ""
    if ranked[0][0] == 0.0:
        return None, ""
    if is_held(signals.columns[ranked[0][1]]) and len(rest) >= FEWEST:
        _accept(roles, "command", Candidate(ranked[0][1], PHYSICS, ("constant from step to step, unlike a force",)), "")
        return None, ""
    close = [at for swing, at in ranked if swing * CLEAR_SWING > ranked[0][0]]
    if len(close) > 1:
        some = [Candidate(at, PHYSICS, ("changes with the direction",)) for at in close]
        _leave_open(roles, "force", "these columns change with the direction", some)
        signals.taken |= set(close)
        return None, ""
    rank = f"next: column {signals.place(ranked[1][1])!r}" if len(ranked) > 1 else "no other candidate"
    return Candidate(ranked[0][1], PHYSICS, ("changes most with the direction",)), rank


def _pressures(roles: Roles) -> None:
    signals = roles.signals
    named = signals.candidates("pressure")
    if not named:
        rest = [group[-1] for group in groups_of(signals, signals.without_role())]
        is_alone = not any(header.name for header in signals.headers) and len(rest) == 1
        if roles.index("position") is None and not is_alone:
            return
        why = "the only signal besides the time" if roles.index("position") is None else "more constant than the force"
        named = [Candidate(at, PHYSICS, (why,)) for at in rest]
    if not named:
        return
    sides: dict[str, list[Candidate]] = {}
    for one in named:
        sides.setdefault(_side(signals, one) or "", []).append(one)
    free = sides.pop("", [])
    digits = {side_of(signals.headers[one.index].bare) for one in named} & {"1", "2"}
    best = named[0].score
    if sides and not (digits and len(sides) < 2):
        free = [one for one in free if one.score > best - CLEAR] if len(sides) < 2 else []
        for side, some in sides.items():
            chosen = _choose(roles, f"pressure_{side}", some)
            if chosen is not None:
                rank = _next(signals, chosen, some)
                _accept(roles, f"pressure_{side}", chosen, f"chamber {side} by its name; {rank}")
        if len(sides) == 1 and len(free) == 1:
            side = "b" if "a" in sides else "a"
            _accept(roles, f"pressure_{side}", free[0], f"chamber {side}: the other pressure is named")
        elif free:
            _leave_open(roles, "the other pressure", "more than one column is possible", free)
        return
    free = [one for one in [*free, *(one for some in sides.values() for one in some)] if one.score > best - CLEAR]
    _without_names(roles, free)


def _side(signals: TableSignals, one: Candidate) -> str | None:
    """Return the chamber by the name of a pressure. 1 and 2 are a and b if these are the only numbers."""
    side = side_of(signals.headers[one.index].bare)
    return {"1": "a", "2": "b"}.get(side or "", side)


def _without_names(roles: Roles, free: list[Candidate]) -> None:
    """Distinguish the chambers of pressures by the balance of forces, otherwise ask."""
    signals = roles.signals
    if len(free) > 2:
        free = [replace(one, evidence=(*one.evidence, *_trend(roles, one))) for one in free]
        closed = {side: [one for one in free if words in one.evidence] for side, words in CLOSED.items()}
        if all(len(some) == 1 for some in closed.values()):
            for side, (one,) in closed.items():
                _accept(roles, f"pressure_{side}", one, f"chamber {side} is closed: its pressure follows the position")
            return
        _leave_open(roles, "pressure_a and pressure_b", "more than two columns may be pressures of chambers", free)
        return
    if roles.index("position") is None:
        if chosen := _choose(roles, "pressure", free):
            _accept(roles, "pressure", chosen, _next(signals, chosen, free))
        return
    side, why = _chamber(roles, [signals.columns[one.index] for one in free])
    if not side:
        _leave_open(roles, "pressure_a and pressure_b" if len(free) > 1 else "pressure", why, free)
        return
    for one, chamber in zip(free, (side, "b" if side == "a" else "a"), strict=False):
        _accept(roles, f"pressure_{chamber}", one, f"chamber {chamber}: {why}; no other candidate")


def _trend(roles: Roles, one: Candidate) -> tuple[str, ...]:
    """Return the text on a pressure that follows the position as in a closed chamber; empty if it does not."""
    position = roles.index("position")
    if position is None:
        return ()
    x, p = (roles.signals.columns[at] for at in (position, one.index))
    there = np.isfinite(x) & np.isfinite(p)
    if there.sum() < FEWEST or np.ptp(x[there]) == 0.0 or np.ptp(p[there]) == 0.0:
        return ()
    together = float(np.corrcoef(x[there], p[there])[0, 1])
    return () if abs(together) < FOLLOWS else (CLOSED["a" if together < 0 else "b"],)


def _chamber(roles: Roles, pressures: list[Array]) -> tuple[str, str]:
    """Return the chamber of the first pressure and the reason; empty if the force does not show it."""
    directions, force = roles.directions, roles.index("force")
    ask = "neither names nor forces show the chamber: chamber a grows with the position"
    if force is None or directions is None:
        return "", ask
    values = roles.sign * roles.signals.columns[force]
    levels = directions.levels(values)
    means = [abs(float(np.nanmean(p))) for p in pressures]
    if levels is not None and (len(means) == 1 or max(means) > CLEAR_PRESSURES * min(means)):
        mean, half = sum(levels) / 2, abs(levels[0] - levels[1]) / 2
        if abs(mean) > half:
            is_first = len(means) == 1 or means[0] > means[1]
            side = "b" if (mean > 0) == is_first else "a"
            return side, f"the higher pressure balances the mean force towards {'+x' if mean > 0 else '-x'}"
    together = [_within_directions(directions, values, p) for p in pressures]
    strongest = max(range(len(together)), key=lambda at: abs(together[at]))
    if abs(together[strongest]) > CLEAR_SHARE:
        side = "b" if (together[strongest] > 0) == (strongest == 0) else "a"
        return side, f"the force towards +x {'grows' if together[strongest] > 0 else 'falls'} with this pressure"
    return "", ask


def _within_directions(directions: Directions, force: Array, pressure: Array) -> float:
    """Return the correlation of force and pressure within one direction, where friction does not change sign."""
    parts: list[tuple[Array, Array]] = []
    for moving in (directions.up, directions.down):
        there = moving & np.isfinite(force) & np.isfinite(pressure)
        if there.sum() >= FEWEST:
            parts.append((force[there] - force[there].mean(), pressure[there] - pressure[there].mean()))
    if not parts:
        return 0.0
    first, second = (np.concatenate([part[at] for part in parts]) for at in (0, 1))
    return float(np.corrcoef(first, second)[0, 1]) if np.ptp(first) > 0 and np.ptp(second) > 0 else 0.0


def _time(roles: Roles) -> None:
    signals, times = roles.signals, roles.times
    if times.question:
        roles.questions.insert(0, Question("time", times.question))
        return
    if times.rate_hz is not None:
        guess = Guess("time", "", None, "", times.reason, keys=f'rate = "{times.rate_hz:.6g} Hz"')
        roles.guesses.insert(0, guess)
        return
    assert times.index is not None
    unit, reason = times.unit, f"{times.reason}, unit as named"
    place = signals.place(times.index)
    if not unit:
        position = next((guess for guess in roles.guesses if guess.role == "position"), None)
        metres = None
        if position is not None and position.index is not None and position.unit:
            metres = signals.columns[position.index] * converter(position.unit, "m")[0]
        unit, why = unit_by_size(times, metres)
        if not unit:
            roles.questions.insert(0, Question("time", why, (Guess("time", place, times.index, "s", why),)))
            return
        reason = f"{times.reason}, {why}"
    keys = f'format = "{form}"' if (form := signals.reading.dates.get(times.index)) else ""
    if times.date is not None:
        form = signals.reading.dates[times.date]
        more = f', date_format = "{form}"' if form else ""
        keys = ", ".join(filter(None, [keys, f"date = {_toml(signals.place(times.date))}{more}"]))
    roles.guesses.insert(0, Guess("time", place, times.index, unit, reason, keys=keys))


def _toml(place: int | str) -> str:
    from pneudrive.describe.files.toml import value_text

    return value_text(place)


def _choose(roles: Roles, role: str, named: list[Candidate]) -> Candidate | None:
    """Return the best candidate.

    If candidates are similarly good, the user is asked, unless they show the same signal.
    """
    signals = roles.signals
    named = sorted(named, key=lambda one: -one.score)
    best = named[0]
    close = [one for one in named if one.score > best.score - CLEAR]
    others = [one for one in close[1:] if not same_signal(signals.columns[best.index], signals.columns[one.index])]
    signals.taken |= {one.index for one in close}
    if not others:
        return best
    _leave_open(roles, role, "more than one column is possible", [best, *others])
    return None


def _next(signals: TableSignals, chosen: Candidate, named: list[Candidate]) -> str:
    """Return the rank of a choice relative to the second best one."""
    second = next((one for one in sorted(named, key=lambda one: -one.score) if one.index != chosen.index), None)
    if second is None:
        return "no other candidate"
    return f"next: column {signals.place(second.index)!r} ({', '.join(second.evidence)})"


def _accept(roles: Roles, role: str, one: Candidate, rank: str) -> None:
    """Add a guess with its unit. For an unknown unit or a count, the user is asked."""
    signals = roles.signals
    guess = _guess(roles, role, one, rank)
    header, values = signals.headers[one.index], signals.columns[one.index]
    signals.taken |= {at for at in signals.without_role() if same_signal(values, signals.columns[at])} | {one.index}
    if header.unknown and not header.unit:
        why = f"the unit {header.unknown!r} of this column is not known: state the unit"
        roles.questions.append(Question(role, why, (guess,)))
        return
    if "scale = " in guess.keys:
        raw = header.unit.unit if header.unit is not None else "count"
        content = "counts" if raw == "count" else raw
        why = f"this column contains {content}: state the unit, and the scale (unit per {raw})"
        roles.questions.append(Question(role, why, (replace(guess, reason=why),)))
        return
    roles.guesses.append(guess)


def _guess(roles: Roles, role: str, one: Candidate, rank: str) -> Guess:
    signals = roles.signals
    unit, gauge, is_named = _unit(signals, one.index, role)
    keys = [] if is_named or role == "command" else ["guessed = true"]
    if not unit and role != "command":  # volts or counts
        unit, keys = RAW_UNITS[role.partition("_")[0]], ["scale = 1.0"]
        header = signals.headers[one.index]
        keys += ["offset = 0.0"] if header.unit is not None and header.unit.si != "count" else []
    if (clock := roles.times.clocks.get(one.index)) is not None:
        keys.append(f"clock = {_toml(signals.place(clock))}")
    if late := _late(signals, roles.times).get(one.index, 0.0):
        keys.append(f'delay = "{-late:.9g} s"')
    reason = f"{', '.join(one.evidence)}, unit {'as named' if is_named else 'guessed from its size'}"
    return Guess(
        role, signals.place(one.index), one.index, unit, "; ".join(filter(None, [reason, rank])), gauge, ", ".join(keys)
    )


def _leave_open(roles: Roles, role: str, why: str, candidates: list[Candidate]) -> None:
    kind = "pressure" if " " in role and "pressure" in role else role
    choices = tuple(_guess(roles, kind, candidate, "") for candidate in candidates)
    roles.questions.append(Question(role, why, choices))


def _unit(signals: TableSignals, index: int, role: str) -> tuple[str, bool | None, bool]:
    """Return the unit in the header, or a guess from the size of the numbers.

    Also return whether the unit is gauge, and whether the file states the unit. Volts and counts need a scale: their
    unit is empty.
    """
    unit = signals.headers[index].unit
    kind = role.partition("_")[0]
    is_raw = signals.headers[index].is_raw
    if is_raw and kind != "command":
        return "", None, False
    if unit is not None and unit.si not in ("", "count"):
        return unit.unit, unit.gauge, True
    values = signals.columns[index]
    finite = values[np.isfinite(values)]
    largest, span = (float(np.abs(finite).max()), float(np.ptp(finite))) if finite.size else (0.0, 0.0)
    if kind == "position":
        is_count = bool((finite == np.floor(finite)).all()) and span > WHOLE_SPAN
        return "" if is_count else "mm" if span > 2 else "m", None, False
    if kind == "pressure":
        return "bar" if largest < 30 else "kPa" if largest < 3000 else "Pa", None, False
    return "" if kind == "command" else "N", None, False
