"""Reader of all cycles of a campaign folder, in several processes; unreadable cycles are named and left out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.bulk import many_objects
from pneudrive.campaign.folder import CycleFile, read_samples
from pneudrive.errors import CampaignError, PneudriveError
from pneudrive.friction.campaign.basics import Skipped
from pneudrive.friction.campaign.cycles.cycle import BINS, CycleData, read_sliding, read_standing
from pneudrive.friction.campaign.cycles.raw import read_or_skip
from pneudrive.friction.campaign.cycles.sensors import (
    Gain,
    PressureZero,
    corrected,
    pressure_zeros,
    sensor_gain,
    without_zeros,
)
from pneudrive.rig.interface import Identity, Move
from pneudrive.signals.pool import share_out

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.campaign.folder import Campaign
    from pneudrive.campaign.head import Head
    from pneudrive.friction.reduction.settling import SampleChoice
    from pneudrive.rig.interface import Samples

    Array = NDArray[np.float64]

SLIDING = ("sweep", "sentinel")  # kinds of cycles that are points of a characteristic over speed
STANDING = ("tare", "weight")
WORTH_WORKERS = 100  # cycles below which starting processes costs more than it saves
LOOKED_AT = 8  # cycles that determine the way of the campaign
SAMPLES_OF_WAY = 2000  # samples of a cycle that determine its way if it has no steps
ENDS = (0.001, 0.999)  # quantiles of position, without single damaged samples


@dataclass(frozen=True, eq=False)
class CampaignData:
    """The data of a campaign.

    Attributes
    ----------
    identity : Identity
    files : tuple of CycleFile
        All usable files in running order.
    heads : tuple of Head
        Headers of all usable files of any kind, in running order.
    sliding, tares : tuple of CycleData
        With corrected gain of the force sensor (known weights) and zeros of the pressures (tares).
    gain : Gain
    pressure_zeros : dict
        Chamber -> zero of its transducer, if tares show it.
    skipped : tuple of Skipped
    notes : tuple of str
    edges_m : ndarray, shape (bins + 1,)
        Bins of position.
    travel_m : dict
        Key -> travel of the seal up to the middle of the cycle.
    """

    identity: Identity
    files: tuple[CycleFile, ...]
    heads: tuple[Head, ...]
    sliding: tuple[CycleData, ...]
    tares: tuple[CycleData, ...]
    gain: Gain
    pressure_zeros: dict[str, PressureZero]
    skipped: tuple[Skipped, ...]
    notes: tuple[str, ...]
    edges_m: Array
    travel_m: dict[str, float]

    @cached_property
    def _span(self) -> tuple[int, int]:
        return min(h.index for h in self.heads), max(h.index for h in self.heads)

    def order(self, head: Head) -> float:
        """Return the place of a cycle in the campaign, 0 to 1."""
        first, last = self._span
        return (head.index - first) / max(last - first, 1)

    def days(self) -> dict[str, int]:
        """Return key -> day of the cycle, from 1; all 1 without dates."""
        dates = {head.cycle.key: _date(head.started) for head in self.heads}
        known = sorted({date for date in dates.values() if date})
        return {key: known.index(date) + 1 if date else 1 for key, date in dates.items()}


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
        Which samples count.
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
    wanted = [_light(f) for f in files if f.head.cycle.kind in (*SLIDING, *STANDING) or not f.head.cycle.steps]
    edges = _edges([f for f in wanted if f.head.cycle.kind in SLIDING])
    found = share_out(read_part, wanted, campaign.identity, choice, edges, least=WORTH_WORKERS, processes=processes)
    data = sorted((r.data for r in found if isinstance(r.data, CycleData)), key=lambda d: d.head.index)
    skipped += [r.data for r in found if isinstance(r.data, Skipped)]
    tares = [d for d in data if d.head.cycle.kind == "tare"]
    gain = sensor_gain(campaign.identity, [d for d in data if d.head.cycle.kind == "weight"], tares)
    zeros = pressure_zeros(campaign.identity, tares)
    sliding = corrected([d for d in data if d.head.cycle.kind in SLIDING], gain)
    return CampaignData(
        identity=campaign.identity,
        files=tuple(files),
        heads=tuple(file.head for file in files),
        sliding=without_zeros(sliding, zeros, campaign.identity),
        tares=without_zeros(corrected(tares, gain), zeros, campaign.identity),
        gain=gain,
        pressure_zeros=zeros,
        skipped=tuple(sorted(skipped, key=lambda s: s.file)),
        notes=tuple(notes),
        edges_m=edges,
        travel_m=_travel(files, {r.key: r.way_m for r in found}),
    )


@dataclass(frozen=True, eq=False)
class Read:
    """A cycle that was read: the way of its moves, and its data or the reason why there are none.

    The way is zero if the samples cannot be read; there are no data if the cycle is not a point of a characteristic.
    """

    key: str
    way_m: float
    data: CycleData | Skipped | None


@many_objects()
def read_part(files: Sequence[CycleFile], identity: Identity, choice: SampleChoice, edges_m: Array) -> list[Read]:
    """Read some cycles in turn; an unusable one gives its reason."""
    found = []
    for file, samples in zip(files, read_samples(files, STANDING), strict=True):
        cycle = file.head.cycle
        way = 0.0 if cycle.steps or isinstance(samples, CampaignError) else _way(samples)
        wanted = cycle.kind in (*SLIDING, *STANDING)
        found.append(Read(cycle.key, way, _read(file, samples, identity, choice, edges_m) if wanted else None))
    return found


def _read(
    file: CycleFile, samples: Samples | CampaignError, identity: Identity, choice: SampleChoice, edges_m: Array
) -> CycleData | Skipped:
    def read(file: CycleFile, samples: Samples) -> CycleData:
        if file.head.cycle.kind in STANDING:
            return read_standing(file, samples, identity)
        return read_sliding(file, samples, identity, choice, edges_m)

    return read_or_skip(read, file, samples)


def _light(file: CycleFile) -> CycleFile:
    """Drop the rig's snapshot: it is not needed here, and would go to every process."""
    return CycleFile(file.path, replace(file.head, memory={}))


def _travel(files: Sequence[CycleFile], ways: dict[str, float]) -> dict[str, float]:
    """Return the travel up to the middle of each cycle: as planned, or by its samples without a plan."""
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
    """Return the way of a cycle by few of its samples, so that their noise is negligible."""
    position = samples.position_m[np.isfinite(samples.position_m)]
    return float(np.abs(np.diff(position[:: max(position.size // SAMPLES_OF_WAY, 1)])).sum())


def _edges(files: Sequence[CycleFile]) -> Array:
    """Return the bins over the way that sliding cycles move along, from the positions of some of them.

    A cycle far beside the others (millimetres for metres) does not affect the bins.
    """
    ends: list[Array] = []
    for i in np.unique(np.linspace(0, len(files) - 1, LOOKED_AT).astype(int)) if files else ():
        try:
            position = files[i].samples().position_m
        except PneudriveError:
            continue
        position = position[np.isfinite(position)]
        if position.size:
            ends.append(np.quantile(position, ENDS))
    low, high = 0.0, 1.0  # nothing moves: the cycles report this
    if ends:
        known = np.array(ends)
        usual = np.median(known, axis=0)
        known = known[np.all(np.abs(known - usual) <= usual[1] - usual[0], axis=1)]
        if known.size and known[:, 1].max() > known[:, 0].min():
            low, high = float(known[:, 0].min()), float(known[:, 1].max())
    return np.linspace(low, high, BINS + 1)
