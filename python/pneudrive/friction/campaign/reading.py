"""Reader of all cycles of a campaign folder, in several processes; unreadable cycles are named and left out."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.batching import many_objects
from pneudrive.campaign.storage.folder import CycleFile, read_samples
from pneudrive.errors import CampaignError, PneudriveError
from pneudrive.friction.campaign.samples import plan_of, read_or_skip, read_standing, recording_of
from pneudrive.friction.campaign.sensors import (
    Gain,
    PressureZero,
    corrected,
    pressure_zeros,
    sensor_gain,
    without_zeros,
)
from pneudrive.friction.conditions import Skipped
from pneudrive.friction.cycle import CycleData, CyclePlan, check_speed, reduce_cycle
from pneudrive.friction.loop import Loop, chosen_loops, reversal_loop
from pneudrive.friction.motion import Motion
from pneudrive.rig.interface import Identity, Move
from pneudrive.signals.pool import share_out

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.campaign.storage.folder import Campaign
    from pneudrive.friction.motion import SampleChoice
    from pneudrive.rig.interface import Samples

    Array = NDArray[np.float64]

BINS = 60  # bins over the way of a campaign
SLIDING = ("sweep", "sentinel")  # kinds of cycles that are points of a characteristic over speed
STANDING = ("tare", "weight")
WORTH_WORKERS = 100  # cycles below which starting processes costs more than it saves
LOOKED_AT = 8  # cycles that determine the way of the campaign
SAMPLES_OF_WAY = 2000  # samples of a cycle that determine its way if it has no steps
ENDS = (0.001, 0.999)  # quantiles of position, without single damaged samples


@dataclass(frozen=True, eq=False)
class CampaignData:
    """The cycles of a campaign, or of recordings, reduced.

    Attributes
    ----------
    name : str
    source : Path
        Folder of the campaign, or of the recordings.
    identity : Identity
    files : tuple of CycleFile
        All usable files in running order; empty for recordings.
    sliding, tares : tuple of CycleData
        Use the corrected gain of the force sensor (known weights) and zeros of the pressures (zero runs).
    gain : Gain
    pressure_zeros : dict
        Chamber -> zero of its transducer, if zero runs show it.
    skipped : tuple of Skipped
    notes : tuple of str
    edges_m : ndarray, shape (bins + 1,)
        Bins of position.
    loops : dict
        Key -> friction around the first reversal of the chosen cycles.
    several : bool
        Whether the campaign has several blocks or days.
    """

    name: str
    source: Path
    identity: Identity
    files: tuple[CycleFile, ...]
    sliding: tuple[CycleData, ...]
    tares: tuple[CycleData, ...]
    gain: Gain
    pressure_zeros: dict[str, PressureZero]
    skipped: tuple[Skipped, ...]
    notes: tuple[str, ...]
    edges_m: Array
    loops: dict[str, Loop]
    several: bool


def _date(started: str) -> str:
    try:
        return datetime.fromisoformat(started).date().isoformat()
    except ValueError:
        return ""


@many_objects()
def read_campaign(campaign: Campaign, choice: SampleChoice, processes: int | None = None) -> CampaignData:
    """Read all cycles of a campaign.

    Parameters
    ----------
    campaign : Campaign
    choice : SampleChoice
        Whether each sample counts.
    processes : int, optional
        None: one for each processor, for 100 cycles or more.

    Raises
    ------
    CampaignError
        If no cycle can be used.
    """
    files, problems = campaign.scan()
    skipped = [Skipped("", p.where, p.what) for p in problems if p.lost]
    notes = [str(p) for p in problems if not p.lost]
    if not files:
        raise CampaignError(
            "the campaign has no cycle that can be used",
            where=str(campaign.path),
            value="; ".join(f"{s.file}: {s.reason}" for s in skipped[:3]) or "no file in cycles/",
            remedy="run it, or see docs/reference/campaign-folder.md for the files of cycles",
        )
    plans = _plans(files)
    wanted = [_light(f) for f in files if f.head.cycle.kind in (*SLIDING, *STANDING) or not f.head.cycle.steps]
    edges = _edges([f for f in wanted if f.head.cycle.kind in SLIDING])
    shown = chosen_loops([plan for plan in plans.values() if plan.kind in SLIDING])
    options = (plans, campaign.identity, choice, edges, shown)
    found = share_out(read_part, wanted, *options, least=WORTH_WORKERS, processes=processes)
    travel = _travel(files, {r.key: r.way_m for r in found})
    rests = _rests(files, {d.plan.key: d.duration_s for d in _data(found) if d.plan.kind != "weight"})
    data = [
        replace(d, plan=replace(d.plan, travel_m=travel[d.plan.key], rest_s=rests[d.plan.key]))
        for d in sorted(_data(found), key=lambda d: d.plan.index)
    ]
    skipped += [r.data for r in found if isinstance(r.data, Skipped)]
    tares = [d for d in data if d.plan.kind == "tare"]
    gain = sensor_gain(campaign.identity, [d for d in data if d.plan.kind == "weight"], tares)
    zeros = pressure_zeros(campaign.identity, tares)
    sliding = corrected([d for d in data if d.plan.kind in SLIDING], gain)
    return CampaignData(
        name=str(campaign.about.get("name", campaign.path.name)),
        source=campaign.path,
        identity=campaign.identity,
        files=tuple(files),
        sliding=without_zeros(sliding, zeros, campaign.identity),
        tares=without_zeros(corrected(tares, gain), zeros, campaign.identity),
        gain=gain,
        pressure_zeros=zeros,
        skipped=tuple(sorted(skipped, key=lambda s: s.file)),
        notes=tuple(notes),
        edges_m=edges,
        loops={r.key: r.loop for r in found if r.loop is not None},
        several=len({plan.day for plan in plans.values()}) > 1 or len({plan.block for plan in plans.values()}) > 1,
    )


def _plans(files: Sequence[CycleFile]) -> dict[str, CyclePlan]:
    """Return the plan of each cycle by its key."""
    heads = [file.head for file in files]
    first, last = min(heads, key=lambda h: h.index), max(heads, key=lambda h: h.index)
    began = min(head.began_s for head in heads)
    dates = {head.cycle.key: _date(head.started) for head in heads}
    known = sorted({date for date in dates.values() if date})
    days = {key: known.index(date) + 1 if date else 1 for key, date in dates.items()}
    return {head.cycle.key: plan_of(head, first, last, days[head.cycle.key], began) for head in heads}


def _data(found: Sequence[Read]) -> list[CycleData]:
    return [r.data for r in found if isinstance(r.data, CycleData)]


def _rests(files: Sequence[CycleFile], durations: dict[str, float]) -> dict[str, float]:
    """Return the time at rest before each cycle, s: its stop, or the time since the end of the previous cycle."""
    rests = {file.head.cycle.key: float("nan") for file in files}
    for last, head in pairwise(file.head for file in files):
        if last.cycle.kind == "stop":
            rests[head.cycle.key] = last.cycle.stop_s or 0.0
        elif last.cycle.key in durations:
            rests[head.cycle.key] = head.began_s - last.began_s - durations[last.cycle.key]
    return rests


@dataclass(frozen=True, eq=False)
class Read:
    """A cycle that was read: the path length of its moves, and its data or the reason for missing data.

    The path length is zero if the samples cannot be read. The data are missing if the cycle is not a point of a
    characteristic.
    """

    key: str
    way_m: float
    data: CycleData | Skipped | None
    loop: Loop | None = None


@many_objects()
def read_part(
    files: Sequence[CycleFile],
    plans: dict[str, CyclePlan],
    identity: Identity,
    choice: SampleChoice,
    edges_m: Array,
    shown: frozenset[str],
) -> list[Read]:
    """Read some cycles one after the other; an unusable cycle gives its reason."""

    def read(file: CycleFile, samples: Samples) -> tuple[CycleData, Loop | None]:
        recording, flags = recording_of(file, identity, samples)
        plan, loop = plans[file.head.cycle.key], None
        if plan.kind in STANDING:
            data = read_standing(file, recording, samples, plan, identity)
        else:
            # In the settled part the piston accelerates only by ripple, whose mean is zero: acceleration from
            # positions would only add their noise. The source paper's protocol keeps the ramp at the end.
            motion = Motion.of(recording, choice, inertia=not choice.uses_window)
            check_speed(motion)
            data = reduce_cycle(motion, plan, edges_m, uses_window=choice.uses_window)
            loop = reversal_loop(motion, plan) if plan.key in shown else None
        return replace(data, flags=flags, temperature_k=_temperature(samples)), loop

    found = []
    for file, samples in zip(files, read_samples(files, STANDING), strict=True):
        cycle = file.head.cycle
        way = 0.0 if cycle.steps or isinstance(samples, CampaignError) else _way(samples)
        if cycle.kind not in (*SLIDING, *STANDING):
            found.append(Read(cycle.key, way, None))
            continue
        result = read_or_skip(read, file, samples)
        data, loop = (result, None) if isinstance(result, Skipped) else result
        found.append(Read(cycle.key, way, data, loop))
    return found


def _temperature(samples: Samples) -> float:
    known = samples.temperature_k[np.isfinite(samples.temperature_k)]
    return float(known.mean()) if known.size else float("nan")


def _light(file: CycleFile) -> CycleFile:
    """Drop the snapshot of the rig, which is not needed and would be sent to every process."""
    return CycleFile(file.path, replace(file.head, memory={}))


def _travel(files: Sequence[CycleFile], ways: dict[str, float]) -> dict[str, float]:
    """Return the travel up to the middle of each cycle, from the plan, or without a plan from the samples."""
    travel: dict[str, float] = {}
    total, at = 0.0, None
    for file in files:
        cycle, here = file.head.cycle, 0.0
        for step in cycle.steps:
            if isinstance(step, Move):
                here += abs(step.to_m - at) if at is not None else 0.0
                at = step.to_m
        if not cycle.steps:
            here = ways[cycle.key]
        travel[cycle.key] = total + here / 2.0
        total += here
    return travel


def _way(samples: Samples) -> float:
    """Return the path length of a cycle from few of its samples, so that their noise is negligible."""
    position = samples.position_m[np.isfinite(samples.position_m)]
    return float(np.abs(np.diff(position[:: max(position.size // SAMPLES_OF_WAY, 1)])).sum())


def _edges(files: Sequence[CycleFile]) -> Array:
    """Return the bins over the travel of sliding cycles, from the positions of some of them."""
    positions: list[Array] = []
    for i in np.unique(np.linspace(0, len(files) - 1, LOOKED_AT).astype(int)) if files else ():
        with suppress(PneudriveError):
            positions.append(files[i].samples().position_m)
    return common_edges(positions)


def common_edges(positions: Sequence[Array]) -> Array:
    """Return the bins over the travel of several motions, shape (bins + 1,).

    A motion far from the others (millimetres for metres) does not affect the bins.
    """
    finite = [position[np.isfinite(position)] for position in positions]
    ends = [np.quantile(position, ENDS) for position in finite if position.size]
    low, high = 0.0, 1.0  # nothing moves: the cycles report this
    if ends:
        known = np.array(ends)
        usual = np.median(known, axis=0)
        known = known[np.all(np.abs(known - usual) <= usual[1] - usual[0], axis=1)]
        if known.size and known[:, 1].max() > known[:, 0].min():
            low, high = float(known[:, 0].min()), float(known[:, 1].max())
    return np.linspace(low, high, BINS + 1)
