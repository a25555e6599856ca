"""Friction around the reversal of a cycle: hysteresis over position, with presliding and frictional memory."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.levels import levels
from pneudrive.friction.motion import balance_of
from pneudrive.repr_tables import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.campaign.cycles import Row
    from pneudrive.friction.conditions import Condition
    from pneudrive.friction.motion import RecordedMotion
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording

    Array = NDArray[np.float64]

SHOWN_CONDITIONS = 2
SHOWN_SPEEDS = 3
SHOWN_SAMPLES = 400
BEFORE, AFTER = 0.05, 0.1  # of the stroke, shown before and after the reversal
SPEED_BINS = 8  # between 20 % and 80 % of the speed, range for comparing speeding up and slowing down
PRESLIDINGS = 5.0  # least travel after the reversal: before it, the difference is presliding
SAME_LEVEL = 0.05  # set speeds closer than this are one level
CANDIDATES = 3  # cycles of each shown condition and speed, as one may be unreadable


@dataclass(frozen=True, eq=False, repr=False)
class Loop(Shown):
    """Friction around one reversal, raw samples (thinned).

    Attributes
    ----------
    key : str
        Index of the cycle.
    condition : Condition
    speed_m_s : float
    time_s, position_m, velocity_m_s, friction_n : ndarray, shape (m,)
        friction_n has the sign of the balance, positive if it opposes +x, without the offset.
    presliding_m : float
        Travel in which it goes from 10 % to 90 % of its swing.
    width_n : float
        Mean difference between deceleration and acceleration at equal speeds: frictional memory. NaN if the ramps have
        too few samples.
    """

    key: str
    condition: Condition
    speed_m_s: float
    time_s: Array
    position_m: Array
    velocity_m_s: Array
    friction_n: Array
    presliding_m: float
    width_n: float

    def _card(self) -> Card:
        rows = [
            ("speed", f"{1e3 * self.speed_m_s:.3g} mm/s"),
            ("presliding", f"{1e3 * self.presliding_m:.3g} mm"),
            ("width", f"{self.width_n:.3g} N"),
        ]
        return Card(f"loop of cycle {self.key}", ("quantity", "value"), rows)


def chosen_loops(plans: Sequence[Row]) -> frozenset[str]:
    """Return the keys of the slowest, middle and fastest cycles of the first conditions."""
    keys: list[str] = []
    for condition in sorted({plan["condition"] for plan in plans})[:SHOWN_CONDITIONS]:
        members = [plan for plan in plans if plan["condition"] == condition and plan["set_speed_m_s"] > 0]
        level = levels(np.log([plan["set_speed_m_s"] for plan in members]), float(np.log1p(SAME_LEVEL)))
        known = np.unique(level)
        for one in known[np.unique(np.linspace(0, known.size - 1, SHOWN_SPEEDS).astype(int))] if known.size else ():
            keys += [members[i]["key"] for i in np.flatnonzero(level == one)[:CANDIDATES].tolist()]
    return frozenset(keys)


def reversal_loop(motion: RecordedMotion, key: str, condition: Condition) -> Loop | None:
    """Return the force balance around the first reversal of a cycle; None if it has no reversal.

    `Loop.friction_n` still contains the offset (half the sum of both directions).
    """
    recording = motion.recording
    turns = [(a, b) for a, b in pairwise(motion.strokes) if a.direction != b.direction]
    if not turns:
        return None
    before, after = turns[0]
    velocity, friction = motion.velocity_m_s, balance_of(recording)
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
        key=key,
        condition=condition,
        speed_m_s=abs(after.speed_m_s),
        time_s=recording.time_s[shown],
        position_m=recording.position_m[shown],
        velocity_m_s=velocity[shown],
        friction_n=friction[shown],
        presliding_m=presliding,
        width_n=_width(recording, friction, velocity, after, presliding),
    )


def _presliding(recording: Recording, friction: Array, before: Stroke, after: Stroke) -> float:
    """Return the travel after the reversal in which friction goes from 10 % to 90 % of its change."""
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
