"""Speed classes: strokes of one recording grouped by their speed, if it was controlled."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.signals.motion import Stroke

CONTROLLED_TOLERANCE = 0.03  # largest difference between a stroke and its return with controlled speed
LEVEL_WIDTH = 0.02  # speeds closer than this are one class
DRIFT_RANGE = 1.10  # all speeds within this ratio: one drifting class, not several
PAIRED_SHARE = 0.8  # least share of strokes with a stroke of the other direction in their class
LEAST_STEPS = 4  # least number of set speeds of a direction whose return is not controlled,
LEAST_RANGE = 2.0  # and least ratio of the fastest to the slowest: a single speed does not drift that far (assumed)
ONE_WAY = 0.8  # of the changes from stroke to stroke: least surplus of one sign in steps
APART = 3.0  # classes are this many times their width apart,
LEAST_GAP = 0.05  # and at least this share of their speed: smaller changes from stroke to stroke are drift


def speed_was_controlled(strokes: list[Stroke]) -> bool:
    """Return whether the speed was controlled: neighbouring strokes in both directions have equal speeds."""
    if len(strokes) < 2:
        return True
    speeds = np.array([abs(s.speed_m_s) for s in strokes])
    pairs = [
        abs(speeds[i] - speeds[i + 1]) / max(speeds[i], speeds[i + 1])
        for i in range(len(strokes) - 1)
        if strokes[i].direction != strokes[i + 1].direction
    ]
    # A pair differs if the class changes between neighbours: at most every second pair does.
    agree = np.sort(pairs)[: max(len(pairs) // 2, 1)] if pairs else np.array([1.0])
    return bool(agree[-1] <= CONTROLLED_TOLERANCE)


def speed_levels(strokes: list[Stroke]) -> list[list[Stroke]]:
    """Group strokes into speed classes, slowest first. There is one class if no speeds were set.

    If the returns do not have the speed of the strokes before them, the classes have strokes of one direction.
    """
    if not speeds_differ(strokes):
        return [list(strokes)]
    groups = _groups(sorted(strokes, key=lambda s: abs(s.speed_m_s)), 1.0 + LEVEL_WIDTH)
    if speed_was_controlled(strokes) and _are_levels(groups):
        return [sorted(group, key=lambda s: s.index) for group in groups]
    return _one_way_levels(strokes) or [list(strokes)]


def speeds_differ(strokes: Sequence[Stroke]) -> bool:
    """Return whether the speeds differ by more than a drift explains. Such strokes are not one level."""
    speeds = [abs(stroke.speed_m_s) for stroke in strokes]
    return max(speeds) > DRIFT_RANGE * min(speeds)


def _one_way_levels(strokes: list[Stroke]) -> list[list[Stroke]]:
    """Return the classes of each direction if the speed of one direction was set in steps.

    A return at the speed of the stroke before it belongs to the class of that stroke, if several do. None if neither
    direction has steps.
    """
    ways = {d: sorted((s for s in strokes if s.direction == d), key=lambda s: abs(s.speed_m_s)) for d in (1, -1)}
    steps = {d: _groups(members, 1.0 + LEVEL_WIDTH) for d, members in ways.items()}
    set_ways = [d for d in (1, -1) if _are_steps(steps[d])]
    if not set_ways:
        return []
    way = max(set_ways, key=lambda d: len(steps[d]))
    before = {stroke.index + 1: (i, abs(stroke.speed_m_s)) for i, group in enumerate(steps[way]) for stroke in group}
    returns = {
        stroke.index: before[stroke.index][0]
        for stroke in ways[-way]
        if stroke.index in before and abs(abs(stroke.speed_m_s) / before[stroke.index][1] - 1.0) <= CONTROLLED_TOLERANCE
    }
    if len(set(returns.values())) < LEAST_STEPS:
        returns = {}
    classes = [[*group, *(s for s in ways[-way] if returns.get(s.index) == i)] for i, group in enumerate(steps[way])]
    rest = _groups([stroke for stroke in ways[-way] if stroke.index not in returns], DRIFT_RANGE)
    return [sorted(members, key=lambda s: s.index) for members in (*classes, *rest)]


def _groups(ordered: list[Stroke], width: float) -> list[list[Stroke]]:
    """Return strokes in groups whose speeds differ at most by the factor ``width``; slowest first."""
    groups: list[list[Stroke]] = []
    for stroke in ordered:
        if groups and abs(stroke.speed_m_s) <= abs(groups[-1][0].speed_m_s) * width:
            groups[-1].append(stroke)
        else:
            groups.append([stroke])
    return groups


def _are_steps(groups: list[list[Stroke]]) -> bool:
    """Return whether groups of one direction are set speeds: clearly apart, and changed step by step one way.

    A few steps back are allowed, such as a first stroke at a usual speed.
    """
    speeds = [abs(group[0].speed_m_s) for group in groups]
    apart = all(b > a * (1.0 + CONTROLLED_TOLERANCE) for a, b in pairwise(speeds))
    number = {stroke.index: i for i, group in enumerate(groups) for stroke in group}
    changes = np.sign(np.diff([number[index] for index in sorted(number)]))
    one_way = abs(changes.sum()) >= ONE_WAY * np.count_nonzero(changes)
    return len(groups) >= LEAST_STEPS and speeds[-1] > LEAST_RANGE * speeds[0] and apart and bool(one_way)


def _are_levels(groups: list[list[Stroke]]) -> bool:
    """Return whether groups are speeds that were set.

    Drift or scatter also makes groups, but of one direction only or without gaps between them.
    """
    paired = sum(len(group) for group in groups if len({stroke.direction for stroke in group}) == 2)
    if paired < PAIRED_SHARE * sum(map(len, groups)):
        return False
    speeds = [[abs(stroke.speed_m_s) for stroke in group] for group in groups]
    widths = [max(group) / min(group) - 1 for group in speeds]
    gaps = [min(upper) / max(lower) - 1 for lower, upper in pairwise(speeds)]
    return not gaps or float(np.median(gaps)) > max(APART * float(np.median(widths)), LEAST_GAP)
