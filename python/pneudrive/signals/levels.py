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
    """Group strokes into speed classes, slowest first; one class if the speed was not controlled."""
    if not speed_was_controlled(strokes):
        return [list(strokes)]
    ordered = sorted(strokes, key=lambda s: abs(s.speed_m_s))
    if abs(ordered[-1].speed_m_s) <= DRIFT_RANGE * abs(ordered[0].speed_m_s):
        return [list(strokes)]
    groups: list[list[Stroke]] = []
    for stroke in ordered:
        if groups and abs(stroke.speed_m_s) <= abs(groups[-1][0].speed_m_s) * (1 + LEVEL_WIDTH):
            groups[-1].append(stroke)
        else:
            groups.append([stroke])
    if not _are_levels(groups):
        return [list(strokes)]
    return [sorted(group, key=lambda s: s.index) for group in groups]


def _are_levels(groups: list[list[Stroke]]) -> bool:
    """Return whether groups are set speeds: drift or scatter makes groups too, of one direction or adjacent."""
    paired = sum(len(group) for group in groups if len({stroke.direction for stroke in group}) == 2)
    if paired < PAIRED_SHARE * sum(map(len, groups)):
        return False
    speeds = [[abs(stroke.speed_m_s) for stroke in group] for group in groups]
    widths = [max(group) / min(group) - 1 for group in speeds]
    gaps = [min(upper) / max(lower) - 1 for lower, upper in pairwise(speeds)]
    return not gaps or float(np.median(gaps)) > max(APART * float(np.median(widths)), LEAST_GAP)
