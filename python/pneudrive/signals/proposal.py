"""Proposal of a layout for a foreign recording. Every guess is marked.

The roles of the columns follow from names, units and numbers. Doubtful roles become questions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pneudrive.arrays import Array
from pneudrive.describe.files.toml import value_text
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.files.content import rendered
from pneudrive.signals import columns as headers
from pneudrive.signals import motion
from pneudrive.signals.columns import PHYSICS, ROLES, SECONDARY, Candidate, FileColumn, families, words_of
from pneudrive.signals.drive_recording import read_drive_recordings, read_volume_recordings
from pneudrive.signals.layout import Layout, stem
from pneudrive.signals.load import WITH_CLOCKS, RecordingFile, find_cycles, read_foreign
from pneudrive.signals.recording import Recording
from pneudrive.signals.text_table import ForeignFile
from pneudrive.signals.times import COUNTERS, DATE_TIME, clocks_of, filled, on_clock, samples_of_a_stamp, unwrapped
from pneudrive.units import converter

CLEAR = 1.0  # least difference of the weights of two candidates; swings with the direction weigh by their logarithm
CLEAR_STROKES = 0.5  # the same of two signals, in unevenness
LEAST_EVEN = 3.0  # largest unevenness of a position without a name
CLEAR_PRESSURES = 1.6  # least ratio of two pressures, beyond that of the areas of a piston with a rod
WHOLE_SPAN = 500  # whole numbers over more than this are counts
HELD = ("constant from step to step, unlike a force",)
ASK_RATE = 'state the rate of the samples, time = { rate = "50 Hz" }'
SEVERAL = "more than one column is possible"
ASK_CHAMBER = "neither names nor forces show the chamber (chamber a grows with the position)"


@dataclass(frozen=True)
class Guess:
    """Guessed column of a role: time, position, force, command, pressure, pressure_a or pressure_b.

    A time that follows from a sample rate has the ``source`` None. A pressure without the word gauge or absolute has
    the ``gauge`` None. ``keys`` are further keys of the column in the layout.
    """

    role: str
    source: FileColumn | None
    unit: str
    reason: str
    gauge: bool | None = None
    keys: str = ""

    @property
    def column(self) -> int | str:
        """Name or number of the column in a layout; empty for a sample rate."""
        return "" if self.source is None else self.source.place

    @property
    def index(self) -> int | None:
        """Number of the column in the file."""
        return None if self.source is None else self.source.index


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


NO_OTHER = "no other candidate"


@dataclass
class RoleSearch:
    """Columns of a table with guesses and questions about their roles.

    ``taken`` has the numbers of columns whose role is decided, or that certainly have no role. ``time`` has the times
    of the samples, or their numbers without a time column. ``of_time`` has the columns of the time, and ``rate_hz`` the
    rate that the file states instead. ``clocks`` maps a column with its own time to the column of this time.
    """

    form: ForeignFile
    columns: list[FileColumn]
    taken: set[int]
    time: Array
    of_time: tuple[int, ...] = ()
    rate_hz: float = 0.0
    clocks: dict[int, int] = field(default_factory=dict)
    guesses: dict[str, Guess] = field(default_factory=dict)
    questions: list[Question] = field(default_factory=list)
    directions: motion.Directions | None = None
    sign: int = 0

    @classmethod
    def of(cls, form: ForeignFile) -> RoleSearch:
        """Guess the role and unit of each relevant column by name, unit and signal."""
        read = [file_column(form, index) for index in range(form.columns)]
        raw = [column.values for column in read]
        search = cls(form, read, {*form.words}, np.arange(raw[0].size, dtype=float))
        search._find_time()
        for column in read:  # a slow column is filled, and one with a separate clock or start is aligned
            if column.index in search.taken:
                continue
            values, _ = unwrapped(column.values, COUNTERS)
            if (clock := search.clocks.get(column.index)) is not None:
                column.values = on_clock(search.time, raw[clock], values)
            elif late := search._late(column):
                column.values = on_clock(search.time, search.time + late * search.rate_hz, values)
            else:
                column.values = filled(search.time, values)
        search._position()
        if named := [candidate for candidate in search.candidates("command") if "name" in candidate.evidence]:
            search._settle("command", named)
        search._force()
        search._pressures()
        search._unit_of_time()
        search._other_lengths()
        return search

    @property
    def open_roles(self) -> str:
        """Roles of all questions, as text."""
        return " ".join(question.role for question in self.questions)

    @property
    def unused(self) -> list[FileColumn]:
        """Columns of numbers that have no role and are in no question."""
        listed = [*self.guesses.values(), *(choice for question in self.questions for choice in question.choices)]
        used = {guess.index for guess in listed} | {*self.of_time, *self.clocks.values(), *self.form.words}
        return [one for one in self.columns if one.index not in used and np.isfinite(one.values).any()]

    def ask_chambers(self) -> None:
        """Ask for each missing chamber pressure, if an unused column may contain it."""
        sides = [role for role in ("pressure_a", "pressure_b") if role not in self.guesses]
        used = [guess.source.values for guess in self.guesses.values() if guess.source is not None]
        free = [one for one in self.unused if one.may_be_pressure]
        spare = [one for one in free if not any(motion.same_signal(values, one.values) for values in used)]
        if sides and spare and "pressure" not in self.open_roles:
            why = "no column name shows the chamber, and an unused column may be its pressure"
            self._ask(" and ".join(sides), why, [Candidate(one, 0.0, ("not used",)) for one in spare])

    def candidates(self, role: str) -> list[Candidate]:
        """Return the columns that may have a role by name or unit, best first."""
        quantity, found = ROLES[role].get("si"), []
        for column in self.columns:
            unit, score, evidence = column.unit, 0.0, ()
            if column.index in self.taken:
                continue
            if column.role == role:
                score = headers.SECOND_NAME if SECONDARY.search(words_of(column.bare)) else headers.NAME
                evidence = ("name",)
            if unit is not None:
                fits = unit.si in ("V", "A") if role == "command" else unit.si == quantity
                is_raw = quantity is not None and column.is_raw
                if not (fits or is_raw or (role == "command" and unit.unit == "-")):
                    continue
                score += headers.UNIT if fits and (quantity or score) else 0
                evidence += ("unit",) if fits else ()
            if score:
                found.append(Candidate(column, score, evidence))
        return sorted(found, key=lambda one: -one.score)

    def _without_role(self) -> list[FileColumn]:
        """Return the columns whose headers state no role and no quantity."""
        free = [one for one in self.columns if one.index not in self.taken and one.role is None]
        return [one for one in free if one.unit is None or one.unit.si == "count"]

    def _signals(self) -> list[FileColumn]:
        """Return the last column of each signal without a role. A signal may have columns in volts and in newtons."""
        last: dict[int, FileColumn] = {}  # by the number of the first column
        for column in self._without_role():
            if np.isfinite(column.values).all() and np.ptp(column.values) > 0:
                alike = (first for first in last if motion.same_signal(self.columns[first].values, column.values))
                last[next(alike, column.index)] = column
        return [*last.values()]

    def _late(self, column: FileColumn) -> float:
        """For a channel without times, return its start in s after the start of the first channel."""
        return 0.0 if self.of_time else self.form.starts_s.get(column.index, 0.0)

    def _find_time(self) -> None:
        """Find the time column or the sample rate. Other dates and row counters are then also treated as used."""
        dates_of = self.form.dates
        found: list[Candidate] = []
        dates, numbered = list[FileColumn](), list[FileColumn]()
        for column in self.columns:
            some, unit = column.values[np.isfinite(column.values)], column.unit
            is_other = unit is not None and unit.si != "s"
            if column.index in self.taken or is_other or some.size < motion.FEWEST:
                continue
            is_date = column.index in dates_of
            if is_date and len(dates_of) > 1 and (some % 86400.0 == 0).all():
                dates.append(column)
                continue
            is_named, has_unit = column.role == "time", is_date or unit is not None
            score = headers.NAME * is_named + headers.UNIT * has_unit
            evidence = ("name",) * is_named + ("unit",) * has_unit
            if _rises(some, clocks_of(dates_of[column.index]) if is_date else COUNTERS):
                steps = np.diff(some)
                usual = np.median(steps)
                if score == 0 and ((steps == 1.0).mean() >= INDEX_SHARE or headers.INDEX.match(words_of(column.name))):
                    numbered.append(column)
                    continue
                if score == 0 and (np.abs(steps - usual) <= EVEN * usual).mean() <= EVEN_STEPS:  # a signal that drifts
                    continue
                score, evidence = score + PHYSICS, (*evidence, "equal time steps")
            elif not is_named:
                continue
            if column.role not in (None, "time") and not has_unit:
                continue
            # Among equal candidates, the finer one is better: fewer samples share a stamp.
            found.append(Candidate(column, score - 0.5 * (samples_of_a_stamp(some) > 1.0), evidence))
        self.taken |= {one.column.index for one in found if one.score >= headers.NAME}
        self.taken |= {one.index for one in (*dates, *numbered)}
        if not found:
            self._time_without_column(numbered)
            return
        # A column that only rises is the time if nothing has its name; without names the first one.
        best, *rest = sorted(found, key=lambda one: -one.score)
        self._time_of(best, dates, f"next: column {rest[0].column.place!r}" if rest else NO_OTHER)
        column = best.column
        if best.score > PHYSICS:
            clocks = [one.column for one in (best, *rest) if one.score >= best.score]
            other = {one.index for one in clocks if one is not column and not self._is_same_clock(column, one)}
            # The clock of a column is the nearest one to its left.
            left = ([one.index for one in clocks if one.index < at] for at in range(len(self.columns)))
            nearest = (max(indices, default=-1) for indices in left)
            self.clocks |= {at: index for at, index in enumerate(nearest) if index in other}
        self.taken.add(column.index)

    def _time_of(self, best: Candidate, dates: Sequence[FileColumn], rank: str) -> None:
        """Add the guess of a time column; its date may be in another column."""
        column, dates_of = best.column, self.form.dates
        unit, moduli = "", COUNTERS
        if column.index in dates_of:
            unit, moduli = DATE_TIME, clocks_of(dates_of[column.index])
        elif column.unit is not None:
            unit = column.unit.unit
        values, used = unwrapped(column.values, moduli, forward=True)[0], (column.index,)
        keys = [f'format = "{written}"'] if (written := dates_of.get(column.index)) else []
        if unit == DATE_TIME and dates:
            date = dates[0]
            values, used = column.values + date.values, (column.index, date.index)
            keys.append(f"date = {value_text(date.place)}")
            keys += [f'date_format = "{written}"'] if (written := dates_of[date.index]) else []
        count = samples_of_a_stamp(values)
        if count != 1.0:
            self._ask("time", f"{count:g} samples share each stamp of column {column.place!r}: {ASK_RATE}", [])
            return
        self.time, self.of_time = values, used
        reason = f"{', '.join(best.evidence)}; {rank}{', unit as named' if unit else ''}"
        self.guesses["time"] = Guess("time", column, unit, reason, keys=", ".join(keys))

    def _time_without_column(self, numbered: Sequence[FileColumn]) -> None:
        """Add the guess of a time from the rate in the file, otherwise a question."""
        steps_s = sorted(set(self.form.steps_s))
        if len(steps_s) > 1:
            shown = ", ".join(f"{step:g} s" for step in steps_s)
            self._ask("time", f"the channels have different rates ({shown}): resample them, or export one rate", [])
        elif any(steps_s):
            self.rate_hz = 1.0 / steps_s[0]
            reason = f"the file states the rate: {' '.join(self.form.source.split())[:40]}"
            self.guesses["time"] = Guess("time", None, "", reason, keys=f'rate = "{self.rate_hz:.6g} Hz"')
        else:
            only = f", column {numbered[0].place!r} numbers the rows" if numbered else ""
            self._ask("time", f"no column increases like a time{only}: {ASK_RATE}", [])

    def _is_same_clock(self, first: FileColumn, second: FileColumn) -> bool:
        """Return whether two columns show the same clock, possibly in different units or resolutions."""
        units = (1.0 if one.unit is None else converter(one.unit.unit, "s")[0] for one in (first, second))
        a, b = (one.values * unit for one, unit in zip((first, second), units, strict=True))
        known_a, known_b = np.isfinite(a), np.isfinite(b)
        both = known_a & known_b
        if both.sum() < max(motion.FEWEST, 0.9 * min(known_a.sum(), known_b.sum())):
            return False
        a, b = a[both], b[both]
        if {first.index, second.index} & set(self.form.dates):  # dates count from the first one
            a, b = a - a[0], b - b[0]
        return bool(np.abs(b - a).max() <= 1.01 * max(motion.resolution(a), motion.resolution(b)))

    def _position(self) -> None:
        """Find the position by name. Otherwise, take the signal with strokes at constant speed and few reversals."""
        candidates = self.candidates("position")
        named = _backed(candidates, "strokes", lambda values: motion.unevenness(values, is_one_of_many=True) < np.inf)
        why = SEVERAL
        if not named:
            signals, why = self._signals(), "these columns move alike"
            rated = [(motion.unevenness(one.values, is_one_of_many=len(signals) > 1), one) for one in signals]
            even = [(badness, one) for badness, one in rated if badness < LEAST_EVEN]
            named = [Candidate(one, -badness / CLEAR_STROKES, ("strokes at constant speed",)) for badness, one in even]
        if chosen := self._choose("position", named, why):
            self._accept("position", chosen)
            self.directions = motion.Directions.of(chosen.column.values)

    def _force(self) -> None:
        directions, named, why = self.directions, self.candidates("force"), SEVERAL
        if directions is not None:
            named = _backed(named, "changes with the direction", lambda values: directions.sign(values) != 0)
            if not named and "command" not in self.guesses:
                named, why = self._swinging(directions), "these columns change with the direction"
        chosen = self._choose("force", named, why)
        if chosen is None:
            return
        self.sign = 0 if directions is None else directions.sign(chosen.column.values)
        if directions is not None and self.sign == 0:
            why = "the force does not show its sign, as it hardly changes with the direction"
            self._ask("force", f'{why}: positive = "+x" or "-x"', [chosen._replace(rank="")])
            self.taken.add(chosen.column.index)
        else:
            self._accept("force", chosen)

    def _swinging(self, directions: motion.Directions) -> list[Candidate]:
        """Return the signals that change with the direction of motion.

        If the strongest one is constant between steps, it is accepted as the command, and the result is empty.
        """
        signals = self._signals()
        swings = [(directions.swing(one.values), one) for one in signals]
        found = [Candidate(one, np.log2(swing), ("changes with the direction",)) for swing, one in swings if swing]
        best = max(found, key=lambda one: one.score, default=None)
        if best is not None and motion.is_held(best.column.values) and len(signals) >= motion.FEWEST:
            self._accept("command", best._replace(evidence=HELD))
            return []
        return found

    def _pressures(self) -> None:
        named = self.candidates("pressure")
        if not named:
            rest = self._signals()
            has_position = "position" in self.guesses
            is_alone = not any(column.name for column in self.columns) and len(rest) == 1
            why = "more constant than the force" if has_position else "the only signal besides the time"
            named = [Candidate(one, PHYSICS, (why,)) for one in rest if has_position or is_alone]
        if not named:
            return
        sides: dict[str, list[Candidate]] = {"": []}
        for one in named:
            sides.setdefault(headers.chamber_of(one.column.bare), []).append(one)
        has_digits = any(headers.side_of(one.column.bare) in ("1", "2") for one in named)
        if len(sides) == 1 or (has_digits and len(sides) == 2):  # 1 and 2 are a and b if these are the only numbers
            least = named[0].score - CLEAR
            self._without_names([one for some in sides.values() for one in some if one.score > least])
            return
        for side in filter(None, sides):
            self._settle(f"pressure_{side}", sides[side], f"chamber {side} by its name; ")

    def _without_names(self, free: list[Candidate]) -> None:
        """Assign pressures to chambers by the force balance, or ask the user."""
        if len(free) > 2:
            self._ask("pressure_a and pressure_b", "more than two columns may be pressures of chambers", free)
        elif "position" not in self.guesses:
            self._settle("pressure", free)
        else:
            side, why = self._chamber([one.column.values for one in free])
            if not side:
                self._ask("pressure_a and pressure_b" if len(free) > 1 else "pressure", why, free)
                return
            for one, chamber in zip(free, (side, "b" if side == "a" else "a"), strict=False):
                self._accept(f"pressure_{chamber}", one._replace(rank=f"chamber {chamber}: {why}; {NO_OTHER}"))

    def _chamber(self, pressures: list[Array]) -> tuple[str, str]:
        """Return the chamber of the first pressure, and the evidence; empty if the force balance does not show it."""
        directions, force = self.directions, self.guesses["force"].source if "force" in self.guesses else None
        if force is None or directions is None:
            return "", ASK_CHAMBER
        values = self.sign * force.values
        levels = directions.levels(values)
        means = [abs(np.nanmean(p)) for p in pressures]
        if levels is not None and (len(means) == 1 or max(means) > CLEAR_PRESSURES * min(means)):
            mean, half = sum(levels) / 2, abs(levels[0] - levels[1]) / 2
            if abs(mean) > half:
                is_first = len(means) == 1 or means[0] > means[1]
                side = "b" if (mean > 0) == is_first else "a"
                return side, f"the higher pressure balances the mean force towards {'+x' if mean > 0 else '-x'}"
        return "", ASK_CHAMBER

    def _unit_of_time(self) -> None:
        """Find the unit of the time if the file does not state it; if that fails, ask.

        The unit follows from the step of the samples and the speed of the piston.
        """
        time, position, speed = self.guesses.get("time"), self.guesses.get("position"), None
        if time is None or time.source is None or time.unit:
            return
        steps = np.diff(self.time[np.isfinite(self.time)])
        step = np.median(steps) if steps.size else 0.0
        longest = SLOWEST_S
        if position is not None and position.source is not None and position.unit:
            metres = position.source.values * converter(position.unit, "m")[0]
            good = np.isfinite(self.time) & np.isfinite(metres)
            path, span = np.abs(np.diff(metres[good])), np.diff(self.time[good])
            moving = path > 0.2 * (np.quantile(path, 0.9) if path.size else 0.0)
            if moving.any() and span[moving].sum() > 0:
                speed, longest = path[moving].sum() / span[moving].sum(), STEPS_S[1]  # m per unit of the time
        fits = [unit for unit, factor in UNITS_S.items() if STEPS_S[0] <= step * factor <= longest]
        if speed is not None:
            fits = [unit for unit in fits if SPEEDS_M_S[0] <= speed / UNITS_S[unit] <= SPEEDS_M_S[1]]
        if len(fits) == 1:
            shown = "" if speed is None else f" and {speed / UNITS_S[fits[0]] * 1e3:.3g} mm/s"
            reason = f"unit from the size of the steps: {step * UNITS_S[fits[0]]:.3g} s{shown}"
            self.guesses["time"] = replace(time, unit=fits[0], reason=f"{time.reason}, {reason}")
            return
        which = " or ".join(fits) if fits else "none of s, ms and us fits usual steps and speeds"
        why = f"the unit of the time is not stated ({which}): state it"
        del self.guesses["time"]
        self.questions.insert(0, Question("time", why, (replace(time, unit="s", reason=why),)))

    def _other_lengths(self) -> None:
        """Ask about channels whose names state an open role, but whose lengths differ from the others."""
        for name, length in self.form.other_lengths.items():
            role = headers.role_of(name)
            is_open = role not in self.guesses
            if role == "pressure":
                is_open = sum("pressure" in known for known in self.guesses) < 2
            if role is not None and is_open and length > 1 and not SECONDARY.search(words_of(name)):  # 1: a constant
                usual = self.columns[0].values.size
                why = f"channel {name!r} has {length} values, the others have {usual}: resample it to their time column"
                self.questions.append(Question(role, why))

    def _settle(self, role: str, named: list[Candidate], note: str = "") -> None:
        """Add the best candidate as the guess of a role, unless the user has to choose."""
        if chosen := self._choose(role, named):
            self._accept(role, chosen._replace(rank=note + chosen.rank))

    def _choose(self, role: str, named: list[Candidate], why: str = SEVERAL) -> Candidate | None:
        """Return the best candidate, if any. If others are similarly good and show other signals, the user chooses."""
        if not named:
            return None
        best, *rest = sorted(named, key=lambda one: -one.score)
        close = [one for one in rest if one.score > best.score - CLEAR]
        others = [one for one in close if not motion.same_signal(best.column.values, one.column.values)]
        self.taken |= {one.column.index for one in (best, *close)}
        if others:
            self._ask(role, why, [best, *others])
            return None
        rank = f"next: column {rest[0].column.place!r} ({', '.join(rest[0].evidence)})" if rest else NO_OTHER
        return best._replace(rank=rank)

    def _accept(self, role: str, one: Candidate) -> None:
        """Add a guess with its unit, or a question if the unit is unknown or needs a scale (volts, counts)."""
        column, guess = one.column, self._guess(role, one)
        same = {other.index for other in self._without_role() if motion.same_signal(column.values, other.values)}
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
            self.guesses[role] = guess

    def _guess(self, role: str, one: Candidate) -> Guess:
        column = one.column
        unit, gauge, is_named = _unit(column, role)
        keys = [] if is_named or role == "command" else ["guessed = true"]
        if not unit and role != "command":  # volts or counts
            unit, keys = ROLES[role.partition("_")[0]].get("scaled", ""), ["scale = 1.0"]
            keys += ["offset = 0.0"] if column.unit is not None and column.unit.si != "count" else []
        if (clock := self.clocks.get(column.index)) is not None:
            keys.append(f"clock = {value_text(self.columns[clock].place)}")
        if late := self._late(column):
            keys.append(f'delay = "{-late:.9g} s"')
        reason = f"{', '.join(one.evidence)}, unit {'as named' if is_named else 'guessed from its size'}"
        reason = "; ".join(filter(None, [reason, one.rank]))
        return Guess(role, column, unit, reason, gauge, ", ".join(keys))

    def _ask(self, role: str, why: str, candidates: list[Candidate]) -> None:
        kind = "pressure" if " " in role and "pressure" in role else role
        self.questions.append(Question(role, why, tuple(self._guess(kind, one) for one in candidates)))


def _backed(named: list[Candidate], text: str, shows: Callable[[Array], bool]) -> list[Candidate]:
    """Return the candidates; those whose numbers pass the test `shows` get `text` as further evidence."""
    return [
        one._replace(score=one.score + PHYSICS, evidence=(*one.evidence, text)) if shows(one.column.values) else one
        for one in named
    ]


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
        span = np.ptp(finite)
        size = span if kind == "position" else np.abs(finite).max()
        whole = kind == "position" and (finite == np.floor(finite)).all() and span > WHOLE_SPAN
    by_size = ROLES.get(kind, {}).get("by_size", ()) if not whole else ()
    return next((name for most, name in by_size if size < most), ""), None, False


def file_column(form: ForeignFile, index: int) -> FileColumn:
    """Read the header of a column."""
    names = form.names
    name = names[index] if index < len(names) else ""
    short = name.rpartition("/")[2] if form.format in WITH_CLOCKS else name
    bare, unit = headers.split_name(short)
    cell = form.units[index].strip() if index < len(form.units) else ""
    opened = short.rpartition("[")[2].partition("]")
    is_unit = opened[1] and not opened[2].strip() and not opened[0].isdigit()
    unknown = opened[0] if unit is None and is_unit else ""
    if cell.strip("[]()- "):
        bare, unit = (short if unit is None else bare), headers.header_unit(cell)
        unknown = "" if unit else cell
    elif unit is None and form.format in WITH_CLOCKS and short == "time":
        unit = headers.HeaderUnit("s", "s")
    is_unique = bool(name) and names.count(name) == 1 and (form.form.header or form.format != "csv")
    return FileColumn(index, name if is_unique else index, name, bare, unit, unknown, form.values[index])


# --- The time of a foreign table: usual steps and speeds, and the unit that follows from them.

#: Candidate units of a time without a unit, s. A unit is assumed if it is the only one within the bounds below.
UNITS_S = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "day": 86400.0}
STEPS_S = (50e-6, 0.5)  # usual steps of samples of a motion (assumed)
SLOWEST_S = 3600.0  # the same without a motion: the longest step
SPEEDS_M_S = (5e-5, 5.0)  # usual speeds of pistons (assumed)
RISING = 0.999  # least share of steps of a time that do not fall
EVEN, EVEN_STEPS = 0.2, 0.9  # largest deviation of an even step; least share of even steps
INDEX_SHARE = 0.99  # least share of steps of exactly 1 of an index


def _rises(some: Array, moduli: Iterable[float]) -> bool:
    """Return whether finite values increase like a time, after unwrapping by a modulus."""
    some, _ = unwrapped(some, moduli, forward=True)
    steps = np.diff(some)
    if steps.size < 2 or not steps.any():
        return False
    is_coarse = samples_of_a_stamp(some) > 1.0
    return bool((steps >= 0).mean() > RISING and (np.median(steps) > 0 or is_coarse))


MOST_TAGS = 100  # different texts that name the channels of a table with one row for each value
MOST_NAMED = 8  # columns in a message
#: Names of absolute pressures: p_abs, psia, bara.
ABSOLUTE = re.compile(r"abs|(?:psi|bar|pa)a\b", re.IGNORECASE)
#: Names of gauge pressures: p_rel, Druck relativ, Überdruck.
GAUGE = re.compile(r"(?<![a-z])rel(?![a-z])|relativ|gau?ge|[uü]e?berdruck", re.IGNORECASE)
TEMPLATE = Path(__file__).with_name("layout.toml.j2")


@dataclass(frozen=True)
class Proposal:
    """A proposed layout, and the data read with it, for a figure.

    ``kind`` is the kind of recording: a ``rig``, a ``drive``, a ``fixed-volume``. ``file`` has the raw numbers of every
    column. ``recording`` and ``strokes`` are the file as read by the layout. Other kinds and unreadable files have
    neither; ``problem`` then states the reason. ``unused`` has the columns of numbers that the layout
    does not use.
    """

    path: Path
    text: str
    file: ForeignFile
    guesses: list[Guess]
    recording: Recording | None
    strokes: list[motion.Stroke]
    problem: str
    kind: str
    unused: tuple[str, ...]

    @property
    def asks(self) -> bool:
        """Whether the problem is a question to the user."""
        return self.problem.startswith("the file does not")


def propose_layout(path: str | Path) -> Proposal:
    """Propose how to read a foreign recording.

    Parameters
    ----------
    path
        The file.

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
    file = read_foreign(path)
    if max((column.size for column in file.values), default=0) < 2:
        raise RecordingError("the file holds no samples", where=str(path), value=f"columns: {', '.join(file.names)}")
    roles = RoleSearch.of(file)
    kind = _kind(path, roles)
    if kind == "fixed-volume":  # time, command and one pressure, which does not belong to a chamber
        pressures = [guess for role, guess in roles.guesses.items() if role.startswith("pressure")][:1]
        roles.guesses = {role: roles.guesses[role] for role in ("time", "command") if role in roles.guesses}
        for guess in pressures:
            roles.guesses["pressure"] = replace(guess, role="pressure", reason=guess.reason.partition(";")[0])
    elif kind == "rig":
        roles.ask_chambers()
    else:
        roles.questions = [question for question in roles.questions if question.role != "force"]
    text = layout_text(path, roles, kind)
    recording, strokes = None, list[motion.Stroke]()
    problem = "; ".join(question.text for question in roles.questions)
    try:
        if problem:
            raise RecordingError(f"the file does not contain all information. {problem}")
        layout = Layout.loads(text, origin="proposed layout")
        if kind == "fixed-volume":
            read_volume_recordings([path], layout)
        elif kind == "drive":
            record = read_drive_recordings([path], layout)[0]
            strokes = motion.find_strokes(record.name, record.time_s, record["position_m"])
        else:
            source = RecordingFile(path, layout, stem(path))
            recording = next(find_cycles(source)[1]) if source.has_cycles else source.read()
            strokes = motion.find_strokes(recording.name, recording.time_s, recording.position_m)
    except PneudriveError as error:
        problem = error.what
    guesses, unused = [*roles.guesses.values()], tuple(str(column.place) for column in roles.unused)
    return Proposal(path, text, file, guesses, recording, strokes, problem, kind, unused)


def _kind(path: Path, roles: RoleSearch) -> str:
    """Return the kind of recording, from the roles that were guessed or are in a question.

    Raises
    ------
    RecordingError
        The kind is unknown, so that a layout would be meaningless.
    """
    found = {*roles.guesses, *roles.open_roles.split()}
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
    shown = ", ".join(f"{g.role}: column {g.column!r}" for g in roles.guesses.values())
    named = f"columns: {', '.join(reading.names)}" if reading.names else ""
    remedy = "if it is a recording, write the layout by hand: see the guide, Your own recordings"
    if raw := [header.name for header in headers if header.is_raw and header.name]:
        example = f'position = {{ column = "{raw[0]}", unit = "mm", scale = 20.0 }}'
        remedy += f"; {', '.join(raw[:MOST_NAMED])} need a role, a unit and a scale, as in {example}"
    known = "; ".join(text for text in (shown, named) if text)[:300]
    raise RecordingError.of("signals.not-a-recording", where=str(path), value=known, remedy=remedy)


def layout_text(path: Path, roles: RoleSearch, kind: str) -> str:
    """Return the text of the layout file."""
    reading, form, signs = roles.form, roles.form.form, {None: "whitespace", "\t": "tab"}
    keys = {
        "delimiter": signs.get(form.delimiter, form.delimiter),
        "header_delimiter": None if form.of_header == form.delimiter else signs.get(form.of_header, form.of_header),
        "comment": None if form.comment == "#" else form.comment,
        "quoted": True if form.delimiter == form.decimal else None,
        "header": form.header,
        "decimal": form.decimal,
        "thousands": form.thousands,
        "skip_lines": form.skip_lines or None,
    }
    sign, bore, why = _sign_and_bore(roles)
    known = {*roles.guesses, *roles.open_roles.split()}
    cycle = [name for name in reading.names if re.search(ROLES["cycle"]["words"], name.strip().lower())]
    return rendered(
        TEMPLATE,
        {"toml": value_text},
        name=path.name,
        kind=kind,
        format=reading.format,
        keys=keys if reading.format == "csv" else {},
        guesses=[guess for role, guess in roles.guesses.items() if not (kind == "drive" and role == "force")],
        questions=roles.questions,
        line=lambda guess: _column_line(guess, sign),
        unused=families(str(column.place) for column in roles.unused),
        cycle=cycle[:1] if reading.format == "parquet" else (),
        missing=[role for role in ("time", "position", "force") if role not in known],
        bore=f"{bore * 1e3:.3g}",
        why=why,
        sides=[side for side in "ab" if f"pressure_{side}" not in roles.guesses],
        is_open="pressure" in roles.open_roles,
    )


def _column_line(guess: Guess, sign: str) -> str:
    """Return the line of a column in the layout."""
    place = value_text(guess.column)
    if guess.source is None:
        return f"{guess.role} = {{ {guess.keys} }}  # guess: {guess.reason}"
    keys = f", {guess.keys}" if guess.keys else ""
    if guess.role == "command":
        signal = _signal(guess.unit, guess.source.values)
        return f"command = {{ column = {place}{signal}{keys} }}  # guess: {guess.reason}"
    unit, note = guess.unit, ""
    if guess.role.startswith("pressure"):
        is_gauge = guess.gauge
        if is_gauge is None:
            is_gauge, note = GAUGE.search(str(guess.column)) is not None, "; gauge or abs is a guess"
            is_gauge |= unit != "Pa" and not ABSOLUTE.search(str(guess.column))
        unit += " gauge" if is_gauge else " abs"
    extra = f', positive = "{sign}"' if guess.role == "force" else ""
    return f'{guess.role} = {{ column = {place}, unit = "{unit}"{extra}{keys} }}  # guess: {guess.reason}{note}'


def _signal(unit: str, values: Array) -> str:
    """Return unit and range of a command that is not an opening fraction: the narrowest usual range for its values."""
    low, high = np.nanmin(values), np.nanmax(values)
    if low >= -1.0 and high <= 1.0 and not unit:
        return ""
    unit = unit or "V"
    scale = 1e-3 if unit == "mV" else 1.0
    margin = 0.02 * (high - low)
    for a, b in headers.SIGNALS["mA" if unit == "mA" else "V"]:
        if low * scale >= a - margin * scale and high * scale <= b + margin * scale:
            written = "mA" if unit == "mA" else "V"
            return f', unit = "{unit}", range = "{a:g} {written} .. {b:g} {written}"'
    return f', unit = "{unit}", range = "{low:.4g} {unit} .. {high:.4g} {unit}"'


def _sign_and_bore(roles: RoleSearch) -> tuple[str, float, str]:
    """Return the sign of the force for which friction opposes motion, a bore, and the reason for this bore.

    The bore is the one for which pressure times area equals the mean force of both directions.
    """
    sign, unknown = "-x" if roles.sign < 0 else "+x", 0.025
    force, directions = roles.guesses.get("force"), roles.directions
    pressures = [guess for role, guess in roles.guesses.items() if role.startswith("pressure")]
    pressure = pressures[0].source if len(pressures) == 1 and "pressure" not in roles.open_roles else None
    if directions is None or force is None or force.source is None or pressure is None:
        return sign, unknown, "write the real bore"
    levels = directions.levels(force.source.values)
    mean_pa = np.nanmean(pressure.values) * converter(pressures[0].unit, "Pa")[0]
    area = abs(sum(levels) / 2 * converter(force.unit, "N")[0] / mean_pa) if levels is not None and mean_pa else 0.0
    if not 1e-6 < area < 1.0:
        return sign, unknown, "write the real bore"
    return sign, math.sqrt(4 * area / math.pi), "force over pressure, mean of both directions; write the real bore"
