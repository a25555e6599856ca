"""Strokes without a stop, with which an interrupted one is compared."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.folder import read_samples
from pneudrive.characteristics.cycle import condition_of
from pneudrive.characteristics.raw import recording_of, steps_of
from pneudrive.characteristics.stops.phases import FEWEST, steady_part
from pneudrive.errors import CampaignError, PneudriveError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from pneudrive.campaign.folder import CycleFile
    from pneudrive.characterise.recording import Recording
    from pneudrive.characteristics.basics import Condition
    from pneudrive.rig.interface import Identity, Samples

    Array = NDArray[np.float64]

SAME_SPEED = 0.05  # speeds that differ by less than this share are the same
POINTS = 400  # over a stroke: means of neighbouring samples
MOST_CYCLES = 24  # of one condition and speed that are read for comparison


@dataclass(frozen=True, eq=False)
class Stroke:
    """One uninterrupted stroke at constant speed: balance over position, as means of neighbours; shape (m,) each."""

    condition: Condition
    direction: int
    speed_m_s: float
    began_s: float
    position_m: Array
    balance_n: Array
    noise_n: Array


def strokes_of(
    file: CycleFile, recording: Recording, step: NDArray[np.int64], *, leave: int | None = None
) -> list[Stroke]:
    """Strokes of a cycle at the speed that it is for.

    Parameters
    ----------
    file : CycleFile
    recording : Recording
        Its samples.
    step : ndarray of int, shape (n,)
    leave : int or None
        Step that is a stop: the moves before and after it are none.
    """
    cycle, out = file.head.cycle, []
    balance = recording.balance_n()
    edges = np.flatnonzero(np.diff(np.r_[step[:1] - 1, step]) != 0) if step.size else []
    bounds = [*edges, step.size]
    for begin, end in pairwise(bounds):
        if (leave is not None and abs(int(step[begin]) - leave) <= 1) or end - begin < 4 * FEWEST:
            continue
        part = slice(int(begin), int(end))
        steady = steady_part(recording.time_s[part], recording.position_m[part])
        part = slice(part.start + steady.start, part.start + steady.stop)
        time, position = recording.time_s[part], recording.position_m[part]
        if time.size < 4 * FEWEST or time[-1] <= time[0]:
            continue
        speed = float(position[-1] - position[0]) / float(time[-1] - time[0])
        if cycle.speed_m_s is not None and abs(abs(speed) - cycle.speed_m_s) > SAME_SPEED * cycle.speed_m_s:
            continue
        if speed != 0.0:
            condition = condition_of(file.head)
            out.append(_stroke(condition, file.head.began_s, position, balance[part], speed))
    return out


def read_strokes(files: Iterable[CycleFile], identity: Identity) -> list[Stroke]:
    """Uninterrupted strokes of whole cycles; cycles that cannot be read have none."""
    found = list(files)
    every = zip(found, read_samples(found), strict=True)
    return [stroke for file, samples in every for stroke in _read(file, samples, identity)]


def _read(file: CycleFile, samples: Samples | CampaignError, identity: Identity) -> list[Stroke]:
    try:
        if isinstance(samples, CampaignError):
            raise samples
        recording, _ = recording_of(file, identity, samples)
        return strokes_of(file, recording, steps_of(recording, samples))
    except (PneudriveError, ValueError, IndexError, ArithmeticError):
        return []  # named where the cycle itself is characterised


def _stroke(condition: Condition, began_s: float, position: Array, balance: Array, speed: float) -> Stroke:
    groups = min(POINTS, position.size)
    edges = np.linspace(0, position.size, groups + 1).astype(int)
    count = np.diff(edges)
    mean = np.add.reduceat(balance, edges[:-1]) / count
    noise = float(np.median(np.abs(np.diff(mean)))) / 0.954 if groups > 3 else 0.0  # of a mean, from neighbours
    return Stroke(
        condition=condition,
        direction=1 if speed > 0 else -1,
        speed_m_s=abs(speed),
        began_s=began_s,
        position_m=np.add.reduceat(position, edges[:-1]) / count,
        balance_n=mean,
        noise_n=np.full(groups, noise),
    )
