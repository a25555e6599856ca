"""Hysteresis loops: friction over position and speed around a reversal, from the raw samples of some cycles."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import PneudriveError
from pneudrive.friction.campaign.cycles.cycle import condition_of
from pneudrive.friction.campaign.cycles.raw import recording_of
from pneudrive.friction.campaign.effects.effect import Loop
from pneudrive.friction.reduction.sliding import find_motion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.campaign.folder import CycleFile
    from pneudrive.friction.campaign.curves.curves import Points
    from pneudrive.rig.interface import Identity
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

SHOWN_CONDITIONS = 2
SHOWN_SPEEDS = 3
SHOWN_SAMPLES = 400
BEFORE, AFTER = 0.05, 0.1  # of the stroke, shown before and after the reversal
SPEED_BINS = 8  # between 20 % and 80 % of the speed, range for comparing speeding up and slowing down
PRESLIDINGS = 5.0  # least travel after the reversal: before it, the difference is presliding


def loops(points: Points, files: dict[str, CycleFile], identity: Identity) -> tuple[Loop, ...]:
    """Read the reversals of the slowest, a middle and the fastest cycle of the first conditions."""
    found = []
    for index, condition in enumerate(points.conditions[:SHOWN_CONDITIONS]):
        levels = np.unique(points.level[points.condition == index])
        for level in levels[np.unique(np.linspace(0, levels.size - 1, SHOWN_SPEEDS).astype(int))]:
            place = int(np.flatnonzero((points.condition == index) & (points.level == level))[0])
            data = points.reduced.data[place]
            file = files.get(data.head.cycle.key)
            if file is None:
                continue
            try:
                loop = reversal_loop(file, identity, float(points.reduced.offset_n[place]))
            except PneudriveError:
                continue  # it was readable before; a missing loop does not change a result
            if loop is not None:
                assert loop.condition == condition
                found.append(loop)
    return tuple(found)


def reversal_loop(file: CycleFile, identity: Identity, offset_n: float) -> Loop | None:
    """Return friction around the first reversal of a cycle.

    Parameters
    ----------
    file : CycleFile
    identity : Identity
        Of the rig.
    offset_n : float
        Half the sum of both directions, which is subtracted.

    Returns
    -------
    Loop or None
        None if the cycle has no reversal.
    """
    recording, _ = recording_of(file, identity, file.samples())
    motion = find_motion(recording)
    turns = [(a, b) for a, b in pairwise(motion.strokes) if a.direction != b.direction]
    if not turns:
        return None
    before, after = turns[0]
    velocity, friction = motion.velocity_m_s, motion.balance_n - offset_n
    turn = after.from_m
    travel = abs(after.to_m - after.from_m)
    away = np.abs(recording.position_m - turn)
    index = np.arange(before.start, after.stop)
    near = np.where(index < after.start, away[index] <= BEFORE * travel, away[index] <= AFTER * travel)
    index = index[near]
    if index.size < 10:
        return None
    presliding = _presliding(recording, friction, before, after)
    shown = index[np.unique(np.linspace(0, index.size - 1, SHOWN_SAMPLES).astype(int))]
    return Loop(
        key=file.head.cycle.key,
        condition=condition_of(file.head),
        speed_m_s=abs(after.speed_m_s),
        time_s=recording.time_s[shown],
        position_m=recording.position_m[shown],
        velocity_m_s=velocity[shown],
        friction_n=friction[shown],
        presliding_m=presliding,
        width_n=_width(recording, friction, velocity, after, presliding),
    )


def _presliding(recording: Recording, friction: Array, before: Stroke, after: Stroke) -> float:
    """Return the travel after the reversal in which friction goes from 10 % to 90 % of its way."""
    part = slice(before.stop - 1, after.stop)
    start = float(np.median(friction[max(before.stop - 20, before.start) : before.stop]))
    middle = slice(after.start + (after.stop - after.start) // 3, after.start + 2 * (after.stop - after.start) // 3)
    end = float(np.median(friction[middle]))
    if start == end:
        return float("nan")
    share = (friction[part] - start) / (end - start)
    low, high = int(np.argmax(share >= 0.1)), int(np.argmax(share >= 0.9))
    if high <= low:
        return float("nan")
    return float(abs(recording.position_m[part][high] - recording.position_m[part][low]))


def _width(recording: Recording, friction: Array, velocity: Array, stroke: Stroke, presliding: float) -> float:
    """Return the mean difference of friction between slowing down and speeding up, at equal speeds of one stroke."""
    part = stroke.samples
    speed = np.abs(velocity[part]) / abs(stroke.speed_m_s)
    travel = np.abs(recording.position_m[part] - stroke.from_m)
    fast = np.flatnonzero(speed >= 0.9)
    if not fast.size or not np.isfinite(presliding):
        return float("nan")
    number = np.arange(speed.size)
    rising = (number < fast[0]) & (travel > PRESLIDINGS * presliding)
    falling = number > fast[-1]
    edges = np.linspace(0.2, 0.8, SPEED_BINS + 1)
    differences = []
    for low, high in pairwise(edges):
        inside = (speed >= low) & (speed < high)
        if (inside & rising).any() and (inside & falling).any():
            own = stroke.direction * friction[part]
            differences.append(float(own[inside & falling].mean() - own[inside & rising].mean()))
    return float(np.mean(differences)) if len(differences) >= SPEED_BINS // 2 else float("nan")
