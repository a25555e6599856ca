"""Speed classes: strokes of one recording grouped by their speed, if it was controlled."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pneudrive.signals.motion import Stroke

CONTROLLED_TOLERANCE = 0.03  # largest difference between a stroke and its return with controlled speed
LEVEL_WIDTH = 0.02  # speeds closer than this are one class
DRIFT_RANGE = 1.10  # all speeds within this ratio: one drifting class, not several
PAIRED_SHARE = 0.8  # least share of strokes with a stroke of the other direction in their class
LEAST_STEPS = 4  # least number of set speeds of a direction whose return is not controlled
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
    """Group strokes into speed classes, slowest first. There is one class if the speed was not controlled.

    If the speed was set in one direction only, the classes have strokes of one direction.
    """
    if not speed_was_controlled(strokes):
        return _one_way_levels(strokes) or [list(strokes)]
    ordered = sorted(strokes, key=lambda s: abs(s.speed_m_s))
    if abs(ordered[-1].speed_m_s) <= DRIFT_RANGE * abs(ordered[0].speed_m_s):
        return [list(strokes)]
    groups = _groups(ordered, 1.0 + LEVEL_WIDTH)
    if not _are_levels(groups):
        return [list(strokes)]
    return [sorted(group, key=lambda s: s.index) for group in groups]


def _one_way_levels(strokes: list[Stroke]) -> list[list[Stroke]]:
    """Return the classes of each direction if the speed of one direction was set in steps.

    None if neither has steps.
    """
    ways = {d: sorted((s for s in strokes if s.direction == d), key=lambda s: abs(s.speed_m_s)) for d in (1, -1)}
    steps = {d: _groups(members, 1.0 + LEVEL_WIDTH) for d, members in ways.items()}
    set_ways = [d for d in (1, -1) if _are_steps(steps[d])]
    if not set_ways:
        return []
    way = max(set_ways, key=lambda d: len(steps[d]))
    return [*steps[way], *_groups(ways[-way], DRIFT_RANGE)]


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
    """Return whether groups of one direction are set speeds: clearly apart, and changed step by step one way."""
    speeds = [abs(group[0].speed_m_s) for group in groups]
    apart = all(b > a * (1.0 + CONTROLLED_TOLERANCE) for a, b in pairwise(speeds))
    order = [stroke.index for group in groups for stroke in group]
    return len(groups) >= LEAST_STEPS and apart and order in (sorted(order), sorted(order, reverse=True))


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
