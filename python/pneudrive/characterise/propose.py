"""A layout proposed for a foreign recording: what each column seems to be, every guess marked as one."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.campaign import find_cycles, read_cycles
from pneudrive.characterise.date_times import UNIT
from pneudrive.characterise.formats import read_all
from pneudrive.characterise.layout import Layout
from pneudrive.characterise.load import load_recording
from pneudrive.characterise.motion import find_strokes, local_slope, noise_level, turning_points
from pneudrive.characterise.sniff import Reading, sniff_format, sniff_text
from pneudrive.characterise.text_table import TextForm, read_bytes, read_text
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.units import converter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.characterise.motion import Stroke
    from pneudrive.characterise.recording import Recording

WORDS = {
    "time": r"^(t|time|zeit|temps|tijd)\b|time|zeit|stamp|stempel",
    "position": r"^(x|s|pos)\b|posi|weg\b|displ|stroke|laser|travel",
    "force": r"^(f|fx)\b|force|kraft|load",
    "pressure": r"^p\d?\b|^p_|press|druck",
    "cycle": r"^cycle|zyklus",
}
UNIT_IN_NAME = re.compile(r"[\[(/]\s*([A-Za-zµ°]+)\s*[\])]?\s*$")
KNOWN_UNITS = {
    "time": {"s", "ms", "us", "µs", "min"},
    "position": {"m", "mm", "cm", "um", "µm"},
    "force": {"N", "kN", "mN"},
    "pressure": {"bar", "mbar", "Pa", "kPa", "MPa", "psi"},
}
SAME_SIGNAL = 0.98  # columns that correlate at least like this may be one signal in two units
SIDE_IN_NAME = re.compile(r"(?:^|[\W_]|p)(a|b|1|2)(?=$|[\W_])")


@dataclass(frozen=True)
class Guess:
    """What a column seems to be: ``role`` time, position, force, pressure_a or pressure_b."""

    role: str
    column: int | str
    index: int
    unit: str
    reason: str


@dataclass(frozen=True)
class Proposal:
    """A proposed layout and what was understood, for the eye.

    ``columns`` holds the raw numbers of every column; ``recording`` and ``strokes`` are what the layout makes
    of the file, None and empty where it cannot be read that way, ``problem`` saying why.
    """

    path: Path
    text: str
    reading: Reading
    guesses: tuple[Guess, ...]
    columns: tuple[NDArray[np.float64], ...]
    recording: Recording | None
    strokes: tuple[Stroke, ...]
    problem: str


def propose_layout(path: str | Path) -> Proposal:
    """Propose how to read a foreign recording.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Proposal
        ``text`` is the layout file; what was guessed is marked as such in it.

    Raises
    ------
    RecordingError
        No such file, empty, binary of an unknown kind, or no table of numbers.
    """
    path = Path(path)
    form = sniff_format(path)
    if form == "csv":
        reading = sniff_text(path)
        wanted: list[int | str] = list(range(reading.columns))
        columns = read_text(path, read_bytes(path), reading.form, wanted, {**reading.dates}).columns
    else:
        names, columns, dates = read_all(form, path)
        reading = Reading(form, TextForm(), names, [], len(names), dates)
    guesses = guess_columns(path, reading, columns)
    text = _layout_text(path, reading, guesses, columns)
    recording, strokes, problem = None, (), ""
    try:
        recording = _first_recording(path, Layout.loads(text, origin="proposed layout"))
        strokes = tuple(find_strokes(recording.name, recording.time_s, recording.position_m))
    except PneudriveError as error:
        problem = error.what
    return Proposal(path, text, reading, tuple(guesses), tuple(columns), recording, strokes, problem)


def _first_recording(path: Path, layout: Layout) -> Recording:
    if layout.for_file(path).cycle is None:
        return load_recording(path, layout)
    return next(read_cycles(find_cycles(path, layout).part(0, 1)))


def guess_columns(path: Path, reading: Reading, columns: list[NDArray[np.float64]]) -> list[Guess]:
    """Guess the role and unit of each column that matters, by name where there is one, else by its course."""
    roles: dict[str, tuple[int, str]] = {}
    for index, name in enumerate(reading.names):
        for role, pattern in WORDS.items():
            if re.search(pattern, name.strip().lower()):
                key = role if role != "pressure" else f"pressure {sum(r.startswith('pressure') for r in roles)}"
                roles.setdefault(key, (index, f"named '{name}'"))
                break
    taken = {index for index, _ in roles.values()}
    if "time" not in roles and (found := _time_column(columns, taken)) is not None:
        roles["time"] = (found, "grows in even steps")
    if "time" not in roles:
        raise RecordingError("no column grows like a time", where=str(path), remedy="write the layout by hand")
    time = columns[roles["time"][0]]
    taken.add(roles["time"][0])
    groups = _signals(columns, taken | {roles["time"][0]})
    if "position" not in roles and (found := _position_column(columns, groups, taken)) is not None:
        roles["position"] = (found, "goes forth and back in even strokes")
    if "position" in roles:
        taken.add(roles["position"][0])
        taken |= next((set(g) for g in groups if roles["position"][0] in g), set())
    rest = [g[-1] for g in groups if not set(g) & taken]
    rest.sort(key=lambda index: _relative_swing(columns[index]))
    if "force" not in roles and rest and "position" in roles:
        roles["force"] = (rest.pop(), "changes most with direction")
    if not any(role.startswith("pressure") for role in roles):
        roles |= {f"pressure {n}": (index, "held more evenly than the force") for n, index in enumerate(rest[:2])}
    return _with_units(reading, columns, roles, time)


def _time_column(columns: list[NDArray[np.float64]], taken: set[int]) -> int | None:
    for index, values in enumerate(columns):
        steps = np.diff(values[np.isfinite(values)])
        if index not in taken and steps.size and (steps >= 0).mean() > 0.999 and np.median(steps) > 0:
            return index
    return None


def _signals(columns: list[NDArray[np.float64]], taken: set[int]) -> list[list[int]]:
    """Group columns that hold one signal, such as volts and newtons of one sensor."""
    groups: list[list[int]] = []
    for index, values in enumerate(columns):
        if index in taken or not np.isfinite(values).all() or np.ptp(values) == 0:
            continue
        for group in groups:
            if _same_signal(columns[group[0]], values):
                group.append(index)
                break
        else:
            groups.append([index])
    return groups


def _same_signal(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    """Whether two columns are one signal in two units: a straight line apart, but for the steps of their numbers."""
    if abs(np.corrcoef(first, second)[0, 1]) < SAME_SIGNAL:
        return False
    slope, intercept = np.polyfit(first, second, 1)
    rest = float(np.std(second - slope * first - intercept))
    steps = [float(np.min(s[s > 0], initial=np.inf)) for s in (np.diff(np.unique(v)) for v in (first, second))]
    return rest <= max(abs(slope) * steps[0], steps[1])


def _position_column(columns: list[NDArray[np.float64]], groups: list[list[int]], taken: set[int]) -> int | None:
    """Find the signal that moves evenly between its turning points: little more path than strokes need."""
    best, found = 3.0, None
    for group in groups:
        if set(group) & taken:
            continue
        values = columns[group[-1]]
        span = float(np.ptp(values))
        points = turning_points(values, 0.3 * span)
        if points.size < 2 or noise_level(values) > 0.02 * span:
            continue
        needed = float(np.abs(np.diff(values[points])).sum())
        middle = ((values > values.min() + 0.2 * span) & (values < values.min() + 0.8 * span)).mean()
        # An even stroke spends 60 % of its time in the middle 60 % of its travel; a switched signal almost none.
        badness = float(np.abs(np.diff(values)).sum()) / needed + 5 * abs(middle - 0.6)
        if badness < best:
            best, found = badness, group[-1]
    return found


def _relative_swing(values: NDArray[np.float64]) -> float:
    low, high = np.quantile(values, [0.05, 0.95])
    return float((high - low) / max(abs(high + low) / 2, 1e-12 * max(abs(high), 1e-300)))


def _with_units(
    reading: Reading, columns: list[NDArray[np.float64]], roles: dict[str, tuple[int, str]], time: NDArray[np.float64]
) -> list[Guess]:
    guesses = []
    roles.pop("cycle", None)
    for role in ("time", "position", *sorted(r for r in roles if r.startswith("pressure")), "force"):
        if role not in roles:
            continue
        index, reason = roles[role]
        kind = role.split()[0]
        unit, from_name = _unit(reading, index, kind, columns[index])
        name = reading.names[index] if reading.names else ""
        place: int | str = name if reading.names.count(name) == 1 and name else index
        reason += f", unit {'as named' if from_name else 'guessed from its size'}"
        guesses.append(Guess(role, place, index, unit, reason))
    return _sides(guesses, columns, time)


def _unit(reading: Reading, index: int, kind: str, values: NDArray[np.float64]) -> tuple[str, bool]:
    """Give the unit that the header says, otherwise guess it from the size of the numbers."""
    if index in reading.dates:
        return UNIT, True
    words = [reading.units[index].strip("[]() ")] if index < len(reading.units) else []
    if index < len(reading.names) and (match := UNIT_IN_NAME.search(reading.names[index])):
        words.append(match.group(1))
    if index < len(reading.names):
        words.append(reading.names[index].rpartition("_")[2])
    for word in words:
        known = {unit.lower(): unit for unit in KNOWN_UNITS[kind]}
        if word in KNOWN_UNITS[kind] or word.lower() in known:
            return (word if word in KNOWN_UNITS[kind] else known[word.lower()]), True
    finite = values[np.isfinite(values)]
    largest = float(np.abs(finite).max()) if finite.size else 0.0
    if kind == "time":
        step = float(np.median(np.diff(finite)))
        return ("ms" if step >= 0.5 else "s"), False
    if kind == "position":
        return ("mm" if np.ptp(finite) > 2 else "m"), False
    if kind == "pressure":
        return ("bar" if largest < 30 else "kPa" if largest < 3000 else "Pa"), False
    return "N", False


def _sides(guesses: list[Guess], columns: list[NDArray[np.float64]], time: NDArray[np.float64]) -> list[Guess]:
    """Say which chamber a pressure belongs to: where the rig must push towards +x against it, it is chamber b."""
    by_role = {g.role: g for g in guesses}
    force = by_role.get("force")
    sign = -1.0 if _force_levels(guesses, columns)[0] == "-x" else 1.0
    named = []
    for guess in guesses:
        if not guess.role.startswith("pressure"):
            named.append(guess)
            continue
        side, why = "b", "taken for the chamber that shrinks as position grows"
        in_name = SIDE_IN_NAME.search(_without_unit(guess.column)) if isinstance(guess.column, str) else None
        if in_name:
            side = {"1": "a", "2": "b"}.get(in_name.group(1), in_name.group(1))
            why = f"chamber {side} by its name"
        elif force is not None:
            f, p = sign * columns[force.index], columns[guess.index]
            together = float(np.corrcoef(f, p)[0, 1]) if np.ptp(f) > 0 and np.ptp(p) > 0 else 0.0
            mean = float(np.nanmean(f)) if abs(np.nanmean(f)) > 0.2 * np.nanstd(f) else together
            if "pressure 1" in by_role:
                mean = together
            side = "b" if mean >= 0 else "a"
            why = f"chamber {side}: the force towards +x {'grows' if side == 'b' else 'falls'} with it"
        if any(g.role == f"pressure_{side}" for g in named):
            side = "a" if side == "b" else "b"
        named.append(Guess(f"pressure_{side}", guess.column, guess.index, guess.unit, f"{guess.reason}; {why}"))
    return named


def _layout_text(path: Path, reading: Reading, guesses: list[Guess], columns: list[NDArray[np.float64]]) -> str:
    """Write the layout file."""
    form = reading.form
    lines = [f"# Proposed for {path.name}. Check every line that says guess, above all units and signs.", ""]
    lines.append(f'format = "{reading.format}"')
    if reading.format == "csv":
        names = {None: "whitespace", "\t": "tab"}
        lines.append(f'delimiter = "{names.get(form.delimiter, form.delimiter)}"')
        lines.append(f"header = {'true' if form.header else 'false'}")
        lines.append(f'decimal = "{form.decimal}"')
        if form.thousands:
            lines.append(f'thousands = "{form.thousands}"')
        if form.skip_lines:
            lines.append(f"skip_lines = {form.skip_lines}")
    lines += ["", "[columns]"]
    sign, bore, why = _sign_and_bore(guesses, columns)
    for guess in guesses:
        place = f'"{guess.column}"' if isinstance(guess.column, str) else str(guess.column)
        unit = guess.unit
        if guess.role.startswith("pressure"):
            unit += " abs" if unit == "Pa" or "abs" in str(guess.column).lower() else " gauge"
        extra = f', positive = "{sign}"' if guess.role == "force" else ""
        if reading.dates.get(guess.index):
            extra += f', format = "{reading.dates[guess.index]}"'
        lines.append(f'{guess.role} = {{ column = {place}, unit = "{unit}"{extra} }}  # guess: {guess.reason}')
        if guess.role.startswith("pressure"):
            lines[-1] += "; gauge or abs is a guess"
    roles = {guess.role for guess in guesses}
    cycle = [name for name in reading.names if re.search(WORDS["cycle"], name.strip().lower())]
    if cycle and reading.format == "parquet":
        lines.append(f'cycle = {{ column = "{cycle[0]}" }}  # guess: numbers the cycles of a campaign')
    lines += [f"# not found: {needed}" for needed in ("time", "position", "force") if needed not in roles]
    lines += ["", "[geometry]", 'kind = "rodless"  # guess', f'bore = "{bore * 1e3:.3g} mm"  # guess: {why}']
    for side in ("a", "b"):
        if f"pressure_{side}" not in roles:
            lines += ["", f"[chamber_{side}]", "open_to_ambient = true  # guess: no pressure column for this chamber"]
    lines += ["", "# [window]", '# position = "5 mm .. 30 mm"  # absent: the middle 60 % of the stroke', ""]
    return "\n".join(lines)


def _without_unit(name: str) -> str:
    """Name of a pressure column in lower case, without the unit: the a of kPa names no chamber."""
    bare = UNIT_IN_NAME.sub("", name).strip()
    head, _, tail = bare.replace(" ", "_").rpartition("_")
    return (head if tail in KNOWN_UNITS["pressure"] else bare).lower()


def _force_levels(guesses: list[Guess], columns: list[NDArray[np.float64]]) -> tuple[str, float] | tuple[None, None]:
    """Sign of the force (friction opposes motion) and half the sum of both directions' levels towards +x, raw unit."""
    by_role = {g.role: g for g in guesses}
    if not {"time", "position", "force"} <= set(by_role):
        return None, None
    time, position, force = (columns[by_role[r].index] for r in ("time", "position", "force"))
    good = np.isfinite(time) & np.isfinite(position) & np.isfinite(force)
    good[1:] &= np.diff(time) > 0
    velocity = local_slope(time[good], position[good])
    fast = np.abs(velocity) > 0.5 * np.median(np.abs(velocity))
    up, down = (force[good][fast & (velocity * d > 0)] for d in (1, -1))
    if not up.size or not down.size:
        return None, None
    half_sum = float(np.median(up) + np.median(down)) / 2
    return ("+x", half_sum) if np.median(up) >= np.median(down) else ("-x", -half_sum)


def _sign_and_bore(guesses: list[Guess], columns: list[NDArray[np.float64]]) -> tuple[str, float, str]:
    """Sign of the force and the bore that closes the balance on the mean."""
    sign, half_sum = _force_levels(guesses, columns)
    if sign is None or half_sum is None:
        return "+x", 0.025, "no force and position to take it from; write the real bore"
    by_role = {g.role: g for g in guesses}
    pressures = [g for g in guesses if g.role.startswith("pressure")]
    if len(pressures) != 1:
        return sign, 0.025, "write the real bore"
    mean = float(np.nanmean(columns[pressures[0].index])) * converter(pressures[0].unit, "Pa")[0]
    area = abs(half_sum * converter(by_role["force"].unit, "N")[0] / mean) if mean else 0.0
    if not 1e-6 < area < 1.0:
        return sign, 0.025, "write the real bore"
    return sign, math.sqrt(4 * area / math.pi), "force over pressure, mean of both directions; write the real bore"
