"""Notes on recordings: measured values, doubtful values and assumptions."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.estimates import changed
from pneudrive.friction.budget import CLOCKS, COVERAGE_FACTOR
from pneudrive.friction.pressure import CONFOUNDED, MINIMUM_RANGE_PA
from pneudrive.friction.sentences import sentence

if TYPE_CHECKING:
    from pneudrive.friction.friction_map import Row
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.friction.pressure import ClosureFit, LevelPoint, PressureLine


def _speed_with_pressure(points: tuple[LevelPoint, ...], rows: list[Row]) -> float:
    """Return the correlation of speed and pressure within seals, in the direction in which it is stronger."""
    of_recording = {point.recording: point for point in points}
    strongest = 0.0
    for direction in (1, -1):
        mine = [row for row in rows if row["direction"] == direction]
        seals = [of_recording[row["recording"]].seal for row in mine]
        scatter = [of_recording[row["recording"]].speed_stderr_m_s for row in mine]
        values = np.array([[abs(row["velocity_m_s"]), of_recording[row["recording"]].pressure_pa] for row in mine])
        has_changed = False
        for seal in set(seals):
            members = np.array([s == seal for s in seals])
            has_changed |= changed(values[members, 0], float(np.median(scatter)))
            values[members] -= values[members].mean(axis=0)
        if len(mine) >= 3 and has_changed and np.ptp(values[:, 1]) > MINIMUM_RANGE_PA:
            found = float(np.corrcoef(values.T)[0, 1])
            strongest = max(strongest, found, key=abs)
    return strongest


def _stick_slip_note(level: Level) -> str:
    found = [s for s in level.stick_slip if s.found]

    def usual(name: str) -> float:
        return float(np.median([getattr(s, name) for s in found]))

    return sentence(
        "note.stick_slip",
        name=level.recording,
        period_s=usual("period_s"),
        step_mm=usual("step_m") * 1e3,
        peak_mm_s=usual("peak_speed_m_s") * 1e3,
        stuck=100 * usual("stuck_share"),
        mean_mm_s=usual("mean_speed_m_s") * 1e3,
    )


def _doubts(levels: list[Level]) -> list[str]:
    """Return each kind of doubtful value once, with the sentence for the first recording that has it."""
    found: dict[str, list[tuple[str, str]]] = {}
    for level in levels:
        for flag, doubt in level.doubts.items():
            found.setdefault(flag, []).append((level.recording, doubt))
    notes = []
    for members in found.values():
        names = list(dict.fromkeys(name for name, _ in members))
        also = f" (and of {len(names) - 1} more: {', '.join(names[1:4])})" if len(names) > 1 else ""
        notes.append(sentence("note.check_layout", name=names[0], also=also, doubt=members[0][1]))
    return notes


LEAST_SPEEDS = 3  # speed levels of a direction that make its friction a curve over speed
NEAR = 0.1  # speeds within this ratio are compared


def _differences(results: tuple[RecordingResult, ...]) -> list[str]:
    """Return the recordings of one assembly, each with several speeds, that differ in friction."""
    notes = []
    for first, second in combinations(results, 2):
        if first.levels[0].seal != second.levels[0].seal:
            continue
        found = [_difference(*pair, way) for way in (1, -1) for pair in _near(first.levels, second.levels, way)]
        off, values = max(found, key=lambda one: one[0], default=(0.0, {}))
        if off > 1.0:
            names = {"first": first.recording.name, "second": second.recording.name}
            notes.append(sentence("note.differ", **names, **values))
    return notes


def _near(first: tuple[Level, ...], second: tuple[Level, ...], way: int) -> list[tuple[Level, Level]]:
    """Return the pairs of levels with about the same speed in a direction; none without curves over speed."""
    ours, others = ([level for level in levels if way in level.sides] for levels in (first, second))
    if min(len(ours), len(others)) < LEAST_SPEEDS:
        return []
    pairs = [(one, min(others, key=lambda other: abs(other.speed_m_s - one.speed_m_s))) for one in ours]
    return [(a, b) for a, b in pairs if abs(a.speed_m_s - b.speed_m_s) < NEAR * a.speed_m_s]


def _difference(one: Level, other: Level, way: int) -> tuple[float, dict[str, float | str]]:
    """Return the difference divided by its U, and its values.

    A source of error that both levels share has the same error in both, but clocks of loggers.
    """
    shares = [
        {e.source: e.friction_n if len(level.sides) == 2 else e.offset_n for e in level.budget}
        for level in (one, other)
    ]
    apart = [
        shares[0].get(source, 0.0) - shares[1].get(source, 0.0) for source in shares[0] | shares[1] if source != CLOCKS
    ]
    clocks = [share.get(CLOCKS, 0.0) for share in shares]
    half = COVERAGE_FACTOR * float(np.linalg.norm([one.stderr_n, other.stderr_n, *apart, *clocks]))
    values = {"first_n": one.friction_n, "second_n": other.friction_n, "speed_mm_s": 1e3 * one.speed_m_s}
    return abs(one.friction_n - other.friction_n) / half, {**values, "way": "+x" if way > 0 else "-x", "half_n": half}


def notes_of(
    results: tuple[RecordingResult, ...],
    points: tuple[LevelPoint, ...],
    lines: list[PressureLine],
    rows: list[Row],
    closures: list[ClosureFit],
) -> list[str]:
    """Return the notes on all recordings together."""
    levels = [level for result in results for level in result.levels]
    speeds = np.array([abs(row["velocity_m_s"]) for row in rows]) * 1e3
    notes = [sentence("note.measured", low=speeds.min(), high=speeds.max())]
    notes += [
        sentence("note.delay", name=result.recording.name, delay=result.delay)
        for result in results
        if result.delay is not None and result.delay.is_clear
    ]
    together = _speed_with_pressure(points, rows)
    if abs(together) > CONFOUNDED:
        notes.append(sentence("note.confounded", word="falls" if together < 0 else "rises", together=together))
    gauges = [item for level in levels for item in level.gauge_pa.items()]
    under_pressure = {side for side, gauge in gauges if abs(gauge) > MINIMUM_RANGE_PA}
    notes += [sentence("note.one_side")] if len(under_pressure) == 1 else []
    notes += _doubts(levels)
    assumed = {e.source for level in levels for e in level.budget if e.basis == "assumed" and e.friction_n + e.offset_n}
    doubts = {
        "negative": [level.recording for level in levels if "negative_friction" in level.flags],
        "assumed": sorted(assumed),
        "larger_offset": [level.recording for level in levels if abs(level.offset_n) > level.friction_n],
    }
    notes += [sentence(f"note.{key}", names=", ".join(dict.fromkeys(found))) for key, found in doubts.items() if found]
    notes += _differences(results)
    notes += [line.statement for line in lines]
    notes += [_stick_slip_note(level) for level in levels if "stick_slip" in level.flags]
    return [*notes, *([] if closures else [sentence("note.no_closure")])]
