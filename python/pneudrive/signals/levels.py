"""Speed levels: strokes of one recording grouped by their speed, where the speed was controlled."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pneudrive.signals.motion import Stroke

CONTROLLED_TOLERANCE = 0.03  # a stroke and its return agree this well where speed is controlled
LEVEL_WIDTH = 0.02  # speeds closer than this are one level
DRIFT_RANGE = 1.10  # all speeds within this ratio: one level that drifts, not several
PAIRED_SHARE = 0.8  # so many strokes at least have a stroke of the other direction in their level
APART = 3.0  # levels lie this many times their own width apart,
LEAST_GAP = 0.05  # and at least this share of their speed: what changes by less from stroke to stroke drifts


def speed_was_controlled(strokes: list[Stroke]) -> bool:
    """Whether the speed was controlled: neighbouring strokes in both directions have equal speeds."""
    if len(strokes) < 2:
        return True
    speeds = np.array([abs(s.speed_m_s) for s in strokes])
    pairs = [
        abs(speeds[i] - speeds[i + 1]) / max(speeds[i], speeds[i + 1])
        for i in range(len(strokes) - 1)
        if strokes[i].direction != strokes[i + 1].direction
    ]
    # Where the level changes between neighbours the pair differs: at most every second pair does.
    agree = np.sort(pairs)[: max(len(pairs) // 2, 1)] if pairs else np.array([1.0])
    return bool(agree[-1] <= CONTROLLED_TOLERANCE)


def speed_levels(strokes: list[Stroke]) -> list[list[Stroke]]:
    """Group strokes into speed levels, slowest first; one level where the speed was not controlled."""
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
    """Whether speeds were set: one that drifts or scatters falls into groups too, of one direction or side by side."""
    paired = sum(len(group) for group in groups if len({stroke.direction for stroke in group}) == 2)
    if paired < PAIRED_SHARE * sum(map(len, groups)):
        return False
    speeds = [[abs(stroke.speed_m_s) for stroke in group] for group in groups]
    widths = [max(group) / min(group) - 1 for group in speeds]
    gaps = [min(upper) / max(lower) - 1 for lower, upper in pairwise(speeds)]
    return not gaps or float(np.median(gaps)) > max(APART * float(np.median(widths)), LEAST_GAP)
