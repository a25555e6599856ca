"""Proposal of a layout for a foreign recording: roles of columns with their evidence. Every guess is marked."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.files.toml import value_text
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.progress import UNWATCHED
from pneudrive.signals.columns import FAMILY, ROLES, SECONDARY, family_of, role_of, side_of, words_of
from pneudrive.signals.drive_recording import read_drive_recordings, read_volume_recordings
from pneudrive.signals.evidence import (
    FEWEST,
    NAME,
    PHYSICS,
    SECOND_NAME,
    UNIT,
    Candidate,
    Directions,
    FileColumn,
    Times,
    different_signals,
    file_column,
    find_times,
    is_held,
    same_signal,
    unevenness,
    unit_by_size,
)
from pneudrive.signals.importer import read_foreign
from pneudrive.signals.layout import Layout, stem
from pneudrive.signals.load import RecordingFile, find_cycles
from pneudrive.signals.motion import find_strokes
from pneudrive.signals.times import COUNTERS, filled, on_clock, unwrapped
from pneudrive.units import converter

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from pneudrive.arrays import Array
    from pneudrive.progress import Watch
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording
    from pneudrive.signals.text_table import FileForm

CLEAR = 1.0  # least difference of the weights of two candidates
CLEAR_STROKES = 0.5  # the same of two signals, in unevenness
CLEAR_SWING = 2.0  # least ratio of the swings of a force and of the next signal
CLEAR_PRESSURES = 1.6  # least ratio of two pressures, beyond that of the areas of a piston with a rod
FOLLOWS = 0.8  # least correlation of a closed chamber's pressure with the position
#: Chamber -> how its pressure follows the position if it is closed.
CLOSED = {"a": "falls as the position grows", "b": "rises as the position grows"}
CLEAR_SHARE = 0.5  # least correlation of force and pressure within one direction
WHOLE_SPAN = 500  # whole numbers over more than this are counts
HELD = ("constant from step to step, unlike a force",)
ASK_CHAMBER = "neither names nor forces show the chamber: chamber a grows with the position"


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
        names = families(str(choice.column) for choice in self.choices)
        return f"{self.role}: {self.why}" + (f" ({', '.join(names)})" if names else "")


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


@dataclass
class RoleSearch:
    """Columns of a table with guesses and questions about their roles.

    ``taken`` has the numbers of columns whose role is decided, including those without a role.
    """

    form: FileForm
    columns: list[FileColumn]
    times: Times
    taken: set[int]
    guesses: list[Guess] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)
    directions: Directions | None = None
    sign: int = 0

    @classmethod
    def of(cls, form: FileForm, columns: Sequence[Array]) -> RoleSearch:
        """Guess the role and unit of each relevant column by name, unit and signal."""
        read = [file_column(form, index, values) for index, values in enumerate(columns)]
        taken = {*form.words}
        search = cls(form, read, find_times(form, read, taken), taken)
        raw = [column.values for column in read]
        for column in read:
            column.values = search._on_time(column, raw)
        search._position()
        search._command()
        search._force()
        search._pressures()
        search._time()
        search._other_lengths()
        return search

    def guess(self, role: str) -> Guess | None:
        """Return the guess of a role."""
        return next((guess for guess in self.guesses if guess.role == role), None)

    def column(self, role: str) -> FileColumn | None:
        """Return the column of a role."""
        guess = self.guess(role)
        return None if guess is None or guess.index is None else self.columns[guess.index]

    @property
    def unused(self) -> list[FileColumn]:
        """Columns of numbers without a role, which no question lists."""
        listed = [*self.guesses, *(choice for question in self.questions for choice in question.choices)]
        used = {guess.index for guess in listed} | {self.times.index, self.times.date, *self.times.clocks.values()}
        used |= {*self.form.words}
        return [one for one in self.columns if one.index not in used and np.isfinite(one.values).any()]

    def ask_chambers(self) -> None:
        """Ask for the pressures of chambers without a column, if an unused column may be one of them."""
        asked = " ".join(question.role for question in self.questions)
        sides = [f"pressure_{side}" for side in CLOSED if self.guess(f"pressure_{side}") is None]
        used = [self.columns[guess.index].values for guess in self.guesses if guess.index is not None]
        spare = [one for one in self.unused if one.may_be_pressure]
        spare = [one for one in spare if not any(same_signal(values, one.values) for values in used)]
        if sides and spare and "pressure" not in asked:
            why = "no column name shows the chamber, and an unused column may be its pressure"
            self._leave_open(" and ".join(sides), why, [Candidate(one, 0.0, ("not used",)) for one in spare])

    def candidates(self, role: str) -> list[Candidate]:
        """Return the columns that may have a role by name or unit, the best first."""
        quantity = ROLES[role].si
        found = []
        for column in self.columns:
            unit, score, evidence = column.unit, 0.0, ()
            if column.index in self.taken:
                continue
            if column.role == role:
                score, evidence = (SECOND_NAME if SECONDARY.search(words_of(column.bare)) else NAME), ("name",)
            if unit is not None:
                fits = unit.si in ("V", "A") if role == "command" else unit.si == quantity
                is_raw = quantity is not None and column.is_raw
                if not (fits or is_raw or (role == "command" and unit.unit == "-")):
                    continue
                score += UNIT if (fits and quantity) or (fits and score) else 0
                evidence += ("unit",) if fits else ()
            if score:
                found.append(Candidate(column, score, evidence))
        return sorted(found, key=lambda one: -one.score)

    def _without_role(self) -> list[FileColumn]:
        """Return the columns whose headers state no role and no quantity."""
        free = [one for one in self.columns if one.index not in self.taken and one.role is None]
        return [one for one in free if one.unit is None or one.unit.si == "count"]

    def _on_time(self, column: FileColumn, raw: Sequence[Array]) -> Array:
        """Return a column at the times of the table.

        A slow column is filled, and a column with a separate clock or start is aligned.
        """
        times, values = self.times, column.values
        if column.index in self.taken:
            return values
        values, _ = unwrapped(values, COUNTERS)
        if (clock := times.clocks.get(column.index)) is not None:
            return on_clock(times.values, raw[clock], values)
        if late := self._late(column):
            return on_clock(times.values, times.values + late * (times.rate_hz or 0.0), values)
        return filled(times.values, values)

    def _late(self, column: FileColumn) -> float:
        """Return the start of a channel without times, s after the first."""
        return self.form.preamble.starts_s.get(column.index, 0.0) if self.times.index is None else 0.0

    def _position(self) -> None:
        named = self.candidates("position")
        uneven = [unevenness(one.column.values, is_one_of_many=True) for one in named]
        named = [one.with_evidence("strokes") if u < np.inf else one for one, u in zip(named, uneven, strict=True)]
        chosen = self._settle("position", named) if named else self._position_by_strokes()
        if chosen is not None:
            self.directions = Directions.of(chosen.column.values)

    def _position_by_strokes(self) -> Candidate | None:
        """Find the signal that moves evenly between its turning points, with little extra path."""
        signals = different_signals(self._without_role())
        many = len(signals) > 1
        ranked = sorted((unevenness(one.values, is_one_of_many=many), one.index) for one in signals)
        ranked = [(badness, index) for badness, index in ranked if badness < 3.0]
        close = [index for badness, index in ranked if badness < ranked[0][0] + CLEAR_STROKES]
        held = [one for one in signals if is_held(one.values)]
        if len(close) > 1 and held and len(signals) > FEWEST:
            self._accept("command", Candidate(held[0], PHYSICS, HELD), "")
            rest, why = [one.index for one in signals if one is not held[0]], "numbers alone do not distinguish them"
            return self._only_one("position, pressure_a and pressure_b", rest, "a signal", why)
        chosen = self._only_one("position", close, "even strokes", "these columns move alike")
        if chosen is not None:
            self._accept("position", chosen, self._rank(ranked))
        return chosen

    def _only_one(self, role: str, close: Sequence[int], evidence: str, why: str) -> Candidate | None:
        """Return the candidate among columns without names; ask the user if there are several."""
        some = [Candidate(self.columns[index], PHYSICS, (evidence,)) for index in close]
        if len(some) > 1:
            self._leave_open(role, why, some)
            self.taken |= set(close)
        return some[0] if len(some) == 1 else None

    def _rank(self, ranked: Sequence[tuple[float, int]]) -> str:
        return f"next: column {self.columns[ranked[1][1]].place!r}" if len(ranked) > 1 else "no other candidate"

    def _command(self) -> None:
        if named := [candidate for candidate in self.candidates("command") if "name" in candidate.evidence]:
            self._settle("command", named)

    def _force(self) -> None:
        directions, named = self.directions, self.candidates("force")
        if named:
            if directions is not None:
                turns = [directions.sign(one.column.values) for one in named]
                reason = "changes with the direction"
                named = [one.with_evidence(reason) if turn else one for one, turn in zip(named, turns, strict=True)]
            chosen = self._choose("force", named)
            rank = "" if chosen is None else self._next(chosen, named)
        elif directions is not None and self.guess("command") is None:
            chosen, rank = self._force_by_swing(directions)
        else:
            return
        if chosen is None:
            return
        self.sign = 0 if directions is None else directions.sign(chosen.column.values)
        if directions is not None and self.sign == 0:
            why = "the force does not show its sign, as it hardly changes with the direction"
            self._leave_open("force", f'{why}: positive = "+x" or "-x"', [chosen])
            self.taken.add(chosen.column.index)
        else:
            self._accept("force", chosen, rank)

    def _force_by_swing(self, directions: Directions) -> tuple[Candidate | None, str]:
        """Find the signal that changes most with the direction."""
        signals = different_signals(self._without_role())
        ranked = sorted(((directions.swing(one.values), one.index) for one in signals), reverse=True)
        if not ranked or ranked[0][0] == 0.0:
            return None, ""
        best = self.columns[ranked[0][1]]
        if is_held(best.values) and len(signals) >= FEWEST:
            self._accept("command", Candidate(best, PHYSICS, HELD), "")
            return None, ""
        close = [index for swing, index in ranked if swing * CLEAR_SWING > ranked[0][0]]
        most = "changes most with the direction" if len(close) == 1 else "changes with the direction"
        return self._only_one("force", close, most, "these columns change with the direction"), self._rank(ranked)

    def _pressures(self) -> None:
        named = self.candidates("pressure")
        if not named:
            rest, has_position = different_signals(self._without_role()), self.guess("position") is not None
            is_alone = not any(column.name for column in self.columns) and len(rest) == 1
            why = "more constant than the force" if has_position else "the only signal besides the time"
            named = [Candidate(one, PHYSICS, (why,)) for one in rest if has_position or is_alone]
        if not named:
            return
        sides: dict[str, list[Candidate]] = {"": []}
        for one in named:  # 1 and 2 are a and b if these are the only numbers
            side = side_of(one.column.bare) or ""
            sides.setdefault({"1": "a", "2": "b"}.get(side, side), []).append(one)
        has_digits = any(side_of(one.column.bare) in ("1", "2") for one in named)
        best = named[0].score
        if len(sides) == 1 or (has_digits and len(sides) == 2):
            self._without_names([one for some in sides.values() for one in some if one.score > best - CLEAR])
            return
        free = sides.pop("")
        free = [one for one in free if one.score > best - CLEAR] if len(sides) < 2 else []
        for side, some in sides.items():
            self._settle(f"pressure_{side}", some, f"chamber {side} by its name; ")
        if len(sides) == 1 and len(free) == 1:
            side = "b" if "a" in sides else "a"
            self._accept(f"pressure_{side}", free[0], f"chamber {side}: the other pressure is named")
        elif free:
            self._leave_open("the other pressure", "more than one column is possible", free)

    def _without_names(self, free: list[Candidate]) -> None:
        """Distinguish the chambers of pressures by the balance of forces, otherwise ask."""
        if len(free) > 2:
            free = [one._replace(evidence=(*one.evidence, *self._trend(one.column))) for one in free]
            closed = {side: [one for one in free if words in one.evidence] for side, words in CLOSED.items()}
            if all(len(some) == 1 for some in closed.values()):
                for side, (one,) in closed.items():
                    why = f"chamber {side} is closed: its pressure follows the position"
                    self._accept(f"pressure_{side}", one, why)
                return
            why = "more than two columns may be pressures of chambers"
            self._leave_open("pressure_a and pressure_b", why, free)
        elif self.guess("position") is None:
            self._settle("pressure", free)
        else:
            side, why = self._chamber([one.column.values for one in free])
            if not side:
                self._leave_open("pressure_a and pressure_b" if len(free) > 1 else "pressure", why, free)
                return
            for one, chamber in zip(free, (side, "b" if side == "a" else "a"), strict=False):
                self._accept(f"pressure_{chamber}", one, f"chamber {chamber}: {why}; no other candidate")

    def _trend(self, column: FileColumn) -> tuple[str, ...]:
        """Return the text on a pressure that follows the position as in a closed chamber; empty if it does not."""
        position = self.column("position")
        if position is None:
            return ()
        there = np.isfinite(position.values) & np.isfinite(column.values)
        x, p = position.values[there], column.values[there]
        if there.sum() < FEWEST or np.ptp(x) == 0.0 or np.ptp(p) == 0.0:
            return ()
        together = float(np.corrcoef(x, p)[0, 1])
        return () if abs(together) < FOLLOWS else (CLOSED["a" if together < 0 else "b"],)

    def _chamber(self, pressures: list[Array]) -> tuple[str, str]:
        """Return the chamber of the first pressure and the reason; empty if the force does not show it."""
        directions, force = self.directions, self.column("force")
        if force is None or directions is None:
            return "", ASK_CHAMBER
        values = self.sign * force.values
        levels = directions.levels(values)
        means = [abs(float(np.nanmean(p))) for p in pressures]
        if levels is not None and (len(means) == 1 or max(means) > CLEAR_PRESSURES * min(means)):
            mean, half = sum(levels) / 2, abs(levels[0] - levels[1]) / 2
            if abs(mean) > half:
                is_first = len(means) == 1 or means[0] > means[1]
                side = "b" if (mean > 0) == is_first else "a"
                return side, f"the higher pressure balances the mean force towards {'+x' if mean > 0 else '-x'}"
        together = [directions.correlation(values, p) for p in pressures]
        strongest = max(range(len(together)), key=lambda at: abs(together[at]))
        if abs(together[strongest]) > CLEAR_SHARE:
            side = "b" if (together[strongest] > 0) == (strongest == 0) else "a"
            return side, f"the force towards +x {'grows' if together[strongest] > 0 else 'falls'} with this pressure"
        return "", ASK_CHAMBER

    def _time(self) -> None:
        times = self.times
        if times.question:
            self.questions.insert(0, Question("time", times.question))
            return
        if times.rate_hz is not None:
            keys = f'rate = "{times.rate_hz:.6g} Hz"'
            self.guesses.insert(0, Guess("time", "", None, "", times.reason, keys=keys))
            return
        assert times.index is not None
        place, dates = self.columns[times.index].place, self.form.dates
        unit, reason = times.unit, "unit as named"
        if not unit:
            position, guess = self.column("position"), self.guess("position")
            metres = None
            if position is not None and guess is not None and guess.unit:
                metres = position.values * converter(guess.unit, "m")[0]
            unit, reason = unit_by_size(times, metres)
            if not unit:
                choice = Guess("time", place, times.index, "s", reason)
                self.questions.insert(0, Question("time", reason, (choice,)))
                return
        keys = [f'format = "{form}"'] if (form := dates.get(times.index)) else []
        if times.date is not None:
            keys.append(f"date = {value_text(self.columns[times.date].place)}")
            keys += [f'date_format = "{form}"'] if (form := dates[times.date]) else []
        reason = f"{times.reason}, {reason}"
        self.guesses.insert(0, Guess("time", place, times.index, unit, reason, keys=", ".join(keys)))

    def _other_lengths(self) -> None:
        """Ask for channels whose names state an open role, but whose lengths differ from the others."""
        known = [guess.role for guess in self.guesses]
        for name, length in self.form.other_lengths.items():
            role = role_of(name)
            is_open = sum("pressure" in text for text in known) < 2 if role == "pressure" else role not in known
            if role is not None and is_open and length > 1 and not SECONDARY.search(words_of(name)):  # 1: a constant
                usual = self.columns[0].values.size
                why = f"channel {name!r} has {length} values and the others have {usual}: resample it to their times"
                self.questions.append(Question(role, why))

    def _settle(self, role: str, named: list[Candidate], note: str = "") -> Candidate | None:
        """Return the best candidate as the guess of a role, unless the user is asked."""
        chosen = self._choose(role, named)
        if chosen is not None:
            self._accept(role, chosen, note + self._next(chosen, named))
        return chosen

    def _choose(self, role: str, named: list[Candidate]) -> Candidate | None:
        """Return the best candidate.

        If candidates are similarly good, the user is asked, unless they show the same signal.
        """
        named = sorted(named, key=lambda one: -one.score)
        best = named[0]
        close = [one for one in named if one.score > best.score - CLEAR]
        others = [one for one in close[1:] if not same_signal(best.column.values, one.column.values)]
        self.taken |= {one.column.index for one in close}
        if not others:
            return best
        self._leave_open(role, "more than one column is possible", [best, *others])
        return None

    def _next(self, chosen: Candidate, named: list[Candidate]) -> str:
        """Return the rank of a choice relative to the second best one."""
        ranked = sorted(named, key=lambda one: -one.score)
        second = next((one for one in ranked if one.column is not chosen.column), None)
        if second is None:
            return "no other candidate"
        return f"next: column {second.column.place!r} ({', '.join(second.evidence)})"

    def _accept(self, role: str, one: Candidate, rank: str) -> None:
        """Add a guess with its unit. For an unknown unit, a count or volts, the user is asked."""
        column, guess = one.column, self._guess(role, one, rank)
        same = {other.index for other in self._without_role() if same_signal(column.values, other.values)}
        self.taken |= same | {column.index}
        if column.unknown and not column.unit:
            why = f"the unit {column.unknown!r} of this column is not known: state the unit"
            self.questions.append(Question(role, why, (guess,)))
        elif "scale = " in guess.keys:
            raw = column.unit.unit if column.unit is not None else "count"
            content = "counts" if raw == "count" else raw
            why = f"this column contains {content}: state the unit, and the scale (unit per {raw})"
            self.questions.append(Question(role, why, (replace(guess, reason=why),)))
        else:
            self.guesses.append(guess)

    def _guess(self, role: str, one: Candidate, rank: str) -> Guess:
        column = one.column
        unit, gauge, is_named = _unit(column, role)
        keys = [] if is_named or role == "command" else ["guessed = true"]
        if not unit and role != "command":  # volts or counts
            unit, keys = ROLES[role.partition("_")[0]].scaled, ["scale = 1.0"]
            keys += ["offset = 0.0"] if column.unit is not None and column.unit.si != "count" else []
        if (clock := self.times.clocks.get(column.index)) is not None:
            keys.append(f"clock = {value_text(self.columns[clock].place)}")
        if late := self._late(column):
            keys.append(f'delay = "{-late:.9g} s"')
        reason = f"{', '.join(one.evidence)}, unit {'as named' if is_named else 'guessed from its size'}"
        reason = "; ".join(filter(None, [reason, rank]))
        return Guess(role, column.place, column.index, unit, reason, gauge, ", ".join(keys))

    def _leave_open(self, role: str, why: str, candidates: list[Candidate]) -> None:
        kind = "pressure" if " " in role and "pressure" in role else role
        choices = tuple(self._guess(kind, candidate, "") for candidate in candidates)
        self.questions.append(Question(role, why, choices))


def _unit(column: FileColumn, role: str) -> tuple[str, bool | None, bool]:
    """Return the unit in the header, or a guess from the size of the numbers.

    Also return whether the unit is gauge, and whether the file states the unit. Volts and counts need a scale: their
    unit is empty.
    """
    kind, unit = role.partition("_")[0], column.unit
    if kind != "command" and column.is_raw:
        return "", None, False
    if unit is not None and unit.si not in ("", "count"):
        return unit.unit, unit.gauge, True
    finite = column.values[np.isfinite(column.values)]
    size, whole = 0.0, False
    if finite.size:
        span = float(np.ptp(finite))
        size = span if kind == "position" else float(np.abs(finite).max())
        whole = kind == "position" and bool((finite == np.floor(finite)).all()) and span > WHOLE_SPAN
    by_size = ROLES[kind].by_size if kind in ROLES and not whole else ()
    return next((name for most, name in by_size if size < most), ""), None, False


STAGES = 3
MOST_TAGS = 100  # different texts that name the channels of a table with one row for each value
MOST_NAMED = 8  # columns in a message
#: Names of absolute pressures: p_abs, psia, bara.
ABSOLUTE = re.compile(r"abs|(?:psi|bar|pa)a\b", re.IGNORECASE)
MOST_CHOICES = 8  # columns that are listed for a role that is left open
#: Ranges of electrical signals that command a valve, in V or mA.
SIGNALS = {"V": ((0.0, 5.0), (0.0, 10.0), (-5.0, 5.0), (-10.0, 10.0)), "mA": ((0.0, 20.0), (4.0, 20.0))}


@dataclass(frozen=True)
class Proposal:
    """A proposed layout, and the data as read, for a picture.

    ``kind`` is the kind of recording: a ``rig``, a ``drive``, a ``fixed-volume``. ``columns`` has the raw numbers of
    every column. ``recording`` and ``strokes`` are the file as read by the layout. For other kinds and an
    unreadable file, they are None and empty; ``problem`` has the reason. ``unused`` has the columns of numbers
    that the layout does not use.
    """

    path: Path
    text: str
    reading: FileForm
    guesses: tuple[Guess, ...]
    columns: tuple[NDArray[np.float64], ...]
    recording: Recording | None
    strokes: tuple[Stroke, ...]
    problem: str
    kind: str = "rig"
    unused: tuple[str, ...] = ()

    @property
    def asks(self) -> bool:
        """Whether the problem is a question to the user."""
        return self.problem.startswith("the file does not")


def propose_layout(path: str | Path, watch: Watch = UNWATCHED) -> Proposal:
    """Propose how to read a foreign recording.

    Parameters
    ----------
    path
        The file.
    watch
        Receives the present step.

    Returns
    -------
    Proposal
        ``text`` is the layout file, with guesses marked.

    Raises
    ------
    RecordingError
        The file does not exist, is empty or of an unknown format, or does not contain a table of numbers. Or the table
        is not a recording of a rig, a drive or a fixed volume.
    """
    path = Path(path)
    watch.tell(0, STAGES, "reading the file")
    reading, columns = read_foreign(path)
    if max((column.size for column in columns), default=0) < 2:
        raise RecordingError("the file holds no samples", where=str(path), value=f"columns: {', '.join(reading.names)}")
    watch.tell(1, STAGES, "examining the columns")
    roles = RoleSearch.of(reading, columns)
    kind = _kind(path, roles)
    if kind == "fixed-volume":
        roles.guesses = _one_pressure(roles.guesses)
    elif kind == "rig":
        roles.ask_chambers()
    else:
        roles.questions = [question for question in roles.questions if question.role != "force"]
    text = layout_text(path, roles, kind)
    watch.tell(2, STAGES, "reading the file by the proposed layout")
    recording, strokes = None, ()
    problem = "; ".join(question.text for question in roles.questions)
    try:
        if problem:
            raise RecordingError(f"the file does not contain all information. {problem}")
        layout = Layout.loads(text, origin="proposed layout")
        if kind == "fixed-volume":
            read_volume_recordings([path], layout)
        elif kind == "drive":
            record = read_drive_recordings([path], layout)[0]
            strokes = tuple(find_strokes(record.name, record.time_s, record["position_m"]))
        else:
            recording = _first_recording(path, layout)
            strokes = tuple(find_strokes(recording.name, recording.time_s, recording.position_m))
    except PneudriveError as error:
        problem = error.what
    watch.tell(STAGES, STAGES, "reading the file by the proposed layout")
    unused = tuple(str(column.place) for column in roles.unused)
    return Proposal(
        path, text, reading, tuple(roles.guesses), tuple(columns), recording, strokes, problem, kind, unused
    )


def _kind(path: Path, roles: RoleSearch) -> str:
    """Return the kind of recording, by the roles that were found or are open questions.

    Raises
    ------
    RecordingError
        If the kind is unknown: a layout would be meaningless.
    """
    found = {guess.role for guess in roles.guesses}
    found |= {role for question in roles.questions for role in re.findall(r"\w+", question.role)}
    has_pressure = any("pressure" in role for role in found)
    if {"position", "command"} <= found and has_pressure:
        return "drive"
    if "position" in found and ("force" in found or has_pressure or roles.questions):
        return "rig"
    if "position" not in found and "force" not in found and has_pressure:
        return "fixed-volume"
    reading, headers = roles.form, roles.columns
    tags = [at for at, count in reading.words.items() if 1 < count <= MOST_TAGS]
    values = [one.index for one in headers if one.index not in reading.words and one.role != "time"]
    if tags and len(values) == 1 and reading.names:
        time = next((header.name for header in headers if header.role == "time"), "TIME")
        index = f'index="{time}", columns="{headers[tags[0]].name}", values="{headers[values[0]].name}"'
        raise RecordingError.of("signals.long-table", where=str(path), name=path.name, index=index)
    shown = ", ".join(f"{g.role}: column {g.column!r}" for g in roles.guesses)
    named = f"columns: {', '.join(reading.names)}" if reading.names else ""
    remedy = "if it is a recording, write the layout by hand: see the guide, Your own recordings"
    if raw := [header.name for header in headers if header.is_raw and header.name]:
        example = f'position = {{ column = "{raw[0]}", unit = "mm", scale = 20.0 }}'
        remedy += f"; {', '.join(raw[:MOST_NAMED])} need a role, a unit and a scale, as in {example}"
    raise RecordingError.of(
        "signals.not-a-recording",
        where=str(path),
        value="; ".join(text for text in (shown, named) if text)[:300],
        remedy=remedy,
    )


def _one_pressure(guesses: list[Guess]) -> list[Guess]:
    """Keep time, command and one pressure, because the pressure of a volume does not belong to a chamber."""
    first = next((g for g in guesses if g.role.startswith("pressure")), None)
    kept = [g for g in guesses if g.role in ("time", "command")]
    return kept if first is None else [*kept, replace(first, role="pressure", reason=first.reason.partition(";")[0])]


def _first_recording(path: Path, layout: Layout) -> Recording:
    file = RecordingFile(path, layout, stem(path))
    return next(find_cycles(file).recordings()) if file.has_cycles else file.read()


def layout_text(path: Path, roles: RoleSearch, kind: str) -> str:
    """Return the text of the layout file."""
    reading, columns, guesses = roles.form, roles.columns, roles.guesses
    lines = _file_lines(path, reading, kind)
    lines += ["", "[columns]"]
    sign, bore, why = _sign_and_bore(roles)
    lines += [
        _column_line(guess, columns, sign) for guess in guesses if not (kind == "drive" and guess.role == "force")
    ]
    for question in roles.questions:
        lines.append(f"# open: {question.text}")
        lines += [f"# {_column_line(choice, columns, sign)}" for choice in question.choices[:MOST_CHOICES]]
    if unused := families(str(column.place) for column in roles.unused):
        lines.append(f"# not used: {', '.join(unused)}")
    found = {guess.role for guess in guesses}
    cycle = [name for name in reading.names if re.search(ROLES["cycle"].words, name.strip().lower())]
    if cycle and reading.format == "parquet":
        lines.append(f"cycle = {{ column = {value_text(cycle[0])} }}  # guess: numbers the cycles of a campaign")
    if kind != "rig":
        return "\n".join([*lines, ""])
    open_roles = " ".join(question.role for question in roles.questions)
    missing = [role for role in ("time", "position", "force") if role not in found and role not in open_roles]
    lines += [f"# not found: {role}" for role in missing]
    lines += ["", "[geometry]", 'kind = "rodless"  # guess', f'bore = "{bore * 1e3:.3g} mm"  # guess: {why}']
    for side in ("a", "b"):
        if f"pressure_{side}" not in found:
            sign = "# " if "pressure" in open_roles else ""
            why = "if it is" if sign else "guess: no pressure column for this chamber"
            lines += ["", f"{sign}[chamber_{side}]", f"{sign}open_to_ambient = true  # {why}"]
    if "pressure_a" in found:
        lines += _parallel_lines(roles)
    lines += ["", "# [window]", '# position = "5 mm .. 30 mm"  # absent: the middle 60 % of the stroke', ""]
    return "\n".join(lines)


def _parallel_lines(roles: RoleSearch) -> list[str]:
    """Return a parallel force as a comment, if two further columns are pressures, which may belong to a ram."""
    spare = [(one.column.place, unit) for one in roles.candidates("pressure") if (unit := one.column.unit)]
    if len(spare) != 2:
        return []
    lines = ["", "# Two more pressures: if they drive a ram in parallel with the force, state its area and direction."]
    lines += ["# [[force]]", '# name = "ram"', '# area = "10 cm2"', '# area_accuracy = "5 %"', '# positive = "+x"']
    for key, (place, unit) in zip(("pressure", "against"), spare, strict=True):
        form = f"{unit.unit} {'abs' if unit.gauge is False else 'gauge'}"
        lines.append(f'# {key} = {{ column = {value_text(place)}, unit = "{form}" }}')
    return lines


def _file_lines(path: Path, reading: FileForm, kind: str) -> list[str]:
    """Return the lines on the format of the file."""
    form = reading.form
    lines = [f"# Proposed for {path.name}. Check every line that says guess, in particular units and signs.", ""]
    if kind == "fixed-volume":
        lines.append('kind = "fixed-volume"  # guess: pressures, and no position')
    lines.append(f'format = "{reading.format}"')
    if reading.format == "csv":
        names = {None: "whitespace", "\t": "tab"}
        lines.append(f'delimiter = "{names.get(form.delimiter, form.delimiter)}"')
        if form.of_header != form.delimiter:
            lines.append(f'header_delimiter = "{names.get(form.of_header, form.of_header)}"')
        if form.comment != "#":
            lines.append(f'comment = "{form.comment}"')
        if form.delimiter == form.decimal:
            lines.append("quoted = true  # numbers are in quotation marks")
        lines.append(f"header = {'true' if form.header else 'false'}")
        lines.append(f'decimal = "{form.decimal}"')
        if form.thousands:
            lines.append(f'thousands = "{form.thousands}"')
        if form.skip_lines:
            lines.append(f"skip_lines = {form.skip_lines}")
    return lines


def _column_line(guess: Guess, columns: list[FileColumn], sign: str) -> str:
    """Return the line of a column."""
    place = value_text(guess.column)
    if guess.index is None:
        return f"{guess.role} = {{ {guess.keys} }}  # guess: {guess.reason}"
    keys = f", {guess.keys}" if guess.keys else ""
    if guess.role == "command":
        signal = _signal(guess, columns[guess.index].values)
        return f"command = {{ column = {place}{signal}{keys} }}  # guess: {guess.reason}"
    unit, note = guess.unit, ""
    if guess.role.startswith("pressure"):
        is_gauge = guess.gauge
        if is_gauge is None:
            is_gauge, note = not (unit == "Pa" or ABSOLUTE.search(str(guess.column))), "; gauge or abs is a guess"
        unit += " gauge" if is_gauge else " abs"
    extra = f', positive = "{sign}"' if guess.role == "force" else ""
    return f'{guess.role} = {{ column = {place}, unit = "{unit}"{extra}{keys} }}  # guess: {guess.reason}{note}'


def _signal(guess: Guess, values: NDArray[np.float64]) -> str:
    """Return unit and range of a command that is not an opening fraction: the narrowest usual signal around it."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    unit = guess.unit or "V"
    if low >= -1.0 and high <= 1.0 and guess.unit == "":
        return ""
    scale = 1e-3 if unit == "mV" else 1.0
    margin = 0.02 * (high - low)
    for a, b in SIGNALS["mA" if unit == "mA" else "V"]:
        if low * scale >= a - margin * scale and high * scale <= b + margin * scale:
            written = "mA" if unit == "mA" else "V"
            return f', unit = "{unit}", range = "{a:g} {written} .. {b:g} {written}"'
    return f', unit = "{unit}", range = "{low:.4g} {unit} .. {high:.4g} {unit}"'


def _sign_and_bore(roles: RoleSearch) -> tuple[str, float, str]:
    """Return the sign of the force, by which friction opposes motion, and the bore that closes the balance."""
    sign = "-x" if roles.sign < 0 else "+x"
    force = next((guess for guess in roles.guesses if guess.role == "force"), None)
    pressures = [guess for guess in roles.guesses if guess.role.startswith("pressure")]
    is_open = any("pressure" in question.role for question in roles.questions)
    if roles.directions is None or force is None or force.index is None or len(pressures) != 1 or is_open:
        return sign, 0.025, "write the real bore"
    levels = roles.directions.levels(roles.columns[force.index].values)
    if levels is None or pressures[0].index is None:
        return sign, 0.025, "write the real bore"
    mean = float(np.nanmean(roles.columns[pressures[0].index].values)) * converter(pressures[0].unit, "Pa")[0]
    area = abs(sum(levels) / 2 * converter(force.unit, "N")[0] / mean) if mean else 0.0
    if not 1e-6 < area < 1.0:
        return sign, 0.025, "write the real bore"
    return sign, math.sqrt(4 * area / math.pi), "force over pressure, mean of both directions; write the real bore"
