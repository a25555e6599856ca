"""Guesses of the columns of a foreign table: by name if there is one, else by the signal."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.signals.motion import local_slope, noise_level, turning_points
from pneudrive.signals.tables.date_times import UNIT

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.signals.tables.sniff import FileForm

WORDS = {
    "time": r"^(t|time|zeit|temps|tijd)\b|time|zeit|stamp|stempel",
    "position": r"^(x|s|pos)\b|posi|weg\b|displ|stroke|laser|travel",
    "force": r"^(f|fx)\b|force|kraft|load",
    "pressure": r"^p\d?\b|^p_|press|druck",
    "command": r"^(u|cmd)\b|^u_|command|valve|ventil|voltage|spannung",
    "cycle": r"^cycle|zyklus",
}
UNIT_IN_NAME = re.compile(r"[\[(/]\s*([A-Za-zµ°]+)\s*[\])]?\s*$")
KNOWN_UNITS = {
    "time": {"s", "ms", "us", "µs", "min"},
    "position": {"m", "mm", "cm", "um", "µm", "in", "inch", "ft"},
    "force": {"N", "kN", "mN", "lbf", "kgf"},
    "pressure": {"bar", "mbar", "Pa", "kPa", "MPa", "psi"},
    "command": {"V", "mV", "mA"},
}
GROUPED = ("tdms", "mf4")  # formats with names group/channel
HELD_SHARE = 0.9  # share of samples equal to the previous one: a held command, not a measured force
FEWEST = 3  # least number of values for a guess
SAME_SIGNAL = 0.98  # least correlation of columns that may be one signal in two units
SIDE_IN_NAME = re.compile(r"(?:^|[\W_]|p)(a|b|1|2)(?=$|[\W_])")


@dataclass(frozen=True)
class Guess:
    """A guess of a column: ``role`` time, position, force, command, pressure, pressure_a or pressure_b."""

    role: str
    column: int | str
    index: int
    unit: str
    reason: str


def _roles_by_name(reading: FileForm) -> dict[str, tuple[int, str]]:
    """Return role -> column and reason for columns identified by name; of several the first."""
    roles: dict[str, tuple[int, str]] = {}
    for index, name in enumerate(reading.names):
        if index in reading.words:
            continue
        bare = name.rpartition("/")[2] if reading.format in GROUPED else name
        for role, pattern in WORDS.items():
            if re.search(pattern, bare.strip().lower()):
                key = role if role != "pressure" else f"pressure {sum(r.startswith('pressure') for r in roles)}"
                roles.setdefault(key, (index, f"named '{name}'"))
                break
    return roles


def guess_columns(path: Path, reading: FileForm, columns: list[NDArray[np.float64]]) -> list[Guess]:
    """Guess the role and unit of each relevant column, by name if there is one, else by its signal."""
    roles = _roles_by_name(reading)
    taken = {index for index, _ in roles.values()}
    if "time" not in roles and (found := _time_column(columns, taken)) is not None:
        roles["time"] = (found, "grows in even steps")
    if "time" not in roles:
        raise RecordingError("no column rises like a time", where=str(path), remedy="write the layout by hand")
    time = columns[roles["time"][0]]
    taken.add(roles["time"][0])
    groups = _signals(columns, taken | {roles["time"][0]})
    if "position" not in roles and (found := _position_column(columns, groups, taken)) is not None:
        roles["position"] = (found, "moves back and forth in even strokes")
    if "position" in roles:
        taken.add(roles["position"][0])
        taken |= next((set(g) for g in groups if roles["position"][0] in g), set())
    rest = [g[-1] for g in groups if not set(g) & taken]
    rest.sort(key=lambda index: _relative_swing(columns[index]))
    if "force" not in roles and "command" not in roles and rest and "position" in roles:
        swings = rest.pop()
        if len(rest) >= 2 and _is_held(columns[swings]):
            roles["command"] = (swings, "held from step to step, unlike a force")
        else:
            roles["force"] = (swings, "changes most with direction")
    if not any(role.startswith("pressure") for role in roles):
        if "position" in roles:
            most_even = sorted(rest[:2]) if "command" in roles else rest[:2]
            roles |= {f"pressure {n}": (index, "held more evenly than the force") for n, index in enumerate(most_even)}
        elif len(rest) == 1 and not reading.names:
            roles["pressure 0"] = (rest[0], "the only signal beside the time")
    return _with_units(reading, columns, roles, time)


def _time_column(columns: list[NDArray[np.float64]], taken: set[int]) -> int | None:
    for index, values in enumerate(columns):
        steps = np.diff(values[np.isfinite(values)])
        if index not in taken and steps.size and (steps >= 0).mean() > 0.999 and np.median(steps) > 0:
            return index
    return None


def _is_held(values: NDArray[np.float64]) -> bool:
    """Return whether a column is constant from sample to sample, with occasional steps."""
    steps = np.diff(values[np.isfinite(values)])
    return bool(steps.size and steps.any() and (steps == 0).mean() > HELD_SHARE)


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
    """Return whether two columns are one signal in two units: related by a straight line, except for rounding."""
    if abs(np.corrcoef(first, second)[0, 1]) < SAME_SIGNAL:
        return False
    slope, intercept = np.polyfit(first, second, 1)
    rest = float(np.std(second - slope * first - intercept))
    steps = [float(np.min(s[s > 0], initial=np.inf)) for s in (np.diff(np.unique(v)) for v in (first, second))]
    return rest <= max(abs(slope) * steps[0], steps[1])


def _position_column(columns: list[NDArray[np.float64]], groups: list[list[int]], taken: set[int]) -> int | None:
    """Find the signal that moves evenly between its turning points, with little extra path."""
    best, found = 3.0, None
    for group in groups:
        if set(group) & taken:
            continue
        values = columns[group[-1]]
        span = float(np.ptp(values))
        points = turning_points(values, 0.3 * span)
        if points.size < (2 if len(groups) > 1 else 3) or noise_level(values) > 0.02 * span:
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
    reading: FileForm, columns: list[NDArray[np.float64]], roles: dict[str, tuple[int, str]], time: NDArray[np.float64]
) -> list[Guess]:
    guesses = []
    roles.pop("cycle", None)
    for role in ("time", "position", *sorted(r for r in roles if r.startswith("pressure")), "force", "command"):
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


def _unit(reading: FileForm, index: int, kind: str, values: NDArray[np.float64]) -> tuple[str, bool]:
    """Return the unit in the header, else guess it from the size of the numbers."""
    if index in reading.dates:
        return UNIT, True
    words = [reading.units[index].strip("[]() ")] if index < len(reading.units) else []
    if index < len(reading.names) and (match := UNIT_IN_NAME.search(reading.names[index])):
        words.append(match.group(1))
    if index < len(reading.names):
        words.append(reading.names[index].rpartition("_")[2])
    for word in words:
        known = {unit.lower(): unit for unit in KNOWN_UNITS[kind]}
        if kind == "pressure" and word.lower().endswith(("a", "g")) and word[:-1].lower() in known:
            word = word[:-1]  # noqa: PLW2901 - psia, barg
        if word in KNOWN_UNITS[kind] or word.lower() in known:
            return (word if word in KNOWN_UNITS[kind] else known[word.lower()]), True
    finite = values[np.isfinite(values)]
    if finite.size < FEWEST:
        finite = np.zeros(FEWEST)  # no values for a guess
    largest = float(np.abs(finite).max())
    if kind == "time":
        step = float(np.median(np.diff(finite)))
        return ("ms" if step >= 0.5 else "s"), False
    if kind == "position":
        return ("mm" if np.ptp(finite) > 2 else "m"), False
    if kind == "pressure":
        return ("bar" if largest < 30 else "kPa" if largest < 3000 else "Pa"), False
    return ("" if kind == "command" else "N"), False


def _sides(guesses: list[Guess], columns: list[NDArray[np.float64]], time: NDArray[np.float64]) -> list[Guess]:
    """Return the chamber of a pressure: if the rig must push towards +x against it, it is chamber b."""
    by_role = {g.role: g for g in guesses}
    force, command = by_role.get("force"), by_role.get("command")
    sign = -1.0 if force_levels(guesses, columns)[0] == "-x" else 1.0
    named = []
    for guess in guesses:
        if not guess.role.startswith("pressure"):
            named.append(guess)
            continue
        side, why = "b", "assumed to be the chamber that shrinks as position grows"
        in_name = SIDE_IN_NAME.search(_without_unit(guess.column)) if isinstance(guess.column, str) else None
        if in_name:
            side = {"1": "a", "2": "b"}.get(in_name.group(1), in_name.group(1))
            why = f"chamber {side} by its name"
        elif command is not None:
            side, why = "a", "which chamber is a guess, by the order of the columns"
        elif force is not None:
            both = np.isfinite(columns[force.index]) & np.isfinite(columns[guess.index])
            f, p = (columns[i][both] if both.any() else np.zeros(1) for i in (force.index, guess.index))
            f = sign * f
            together = float(np.corrcoef(f, p)[0, 1]) if np.ptp(f) > 0 and np.ptp(p) > 0 else 0.0
            mean = float(np.mean(f)) if abs(np.mean(f)) > 0.2 * np.std(f) else together
            if "pressure 1" in by_role:
                mean = together
            side = "b" if mean >= 0 else "a"
            why = f"chamber {side}: the force towards +x {'grows' if side == 'b' else 'falls'} with it"
        if any(g.role == f"pressure_{side}" for g in named):
            side = "a" if side == "b" else "b"
        named.append(Guess(f"pressure_{side}", guess.column, guess.index, guess.unit, f"{guess.reason}; {why}"))
    return named


def _without_unit(name: str) -> str:
    """Return the name of a pressure column in lower case, without the unit: the a of kPa is not a chamber."""
    bare = UNIT_IN_NAME.sub("", name).strip()
    head, _, tail = bare.replace(" ", "_").rpartition("_")
    return (head if tail in KNOWN_UNITS["pressure"] else bare).lower()


def force_levels(guesses: list[Guess], columns: list[NDArray[np.float64]]) -> tuple[str, float] | tuple[None, None]:
    """Return the sign of the force (friction opposes motion) and half the sum of both levels towards +x, raw unit."""
    by_role = {g.role: g for g in guesses}
    if not {"time", "position", "force"} <= set(by_role):
        return None, None
    time, position, force = (columns[by_role[r].index] for r in ("time", "position", "force"))
    good = np.isfinite(time) & np.isfinite(position) & np.isfinite(force)
    good[1:] &= np.diff(time) > 0
    if good.sum() < FEWEST:
        return None, None  # a column with this name holds no numbers
    velocity = local_slope(time[good], position[good])
    fast = np.abs(velocity) > 0.5 * np.median(np.abs(velocity))
    up, down = (force[good][fast & (velocity * d > 0)] for d in (1, -1))
    if not up.size or not down.size:
        return None, None
    half_sum = float(np.median(up) + np.median(down)) / 2
    return ("+x", half_sum) if np.median(up) >= np.median(down) else ("-x", -half_sum)
