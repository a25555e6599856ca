"""Progress of a campaign and preliminary friction of its finished cycles, both read from the campaign folder."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.storage.control import Holder, holder
from pneudrive.campaign.storage.folder import CYCLES, Campaign, Problem, plan_of, read_samples, recording_of, steps_of
from pneudrive.errors import CampaignError, ProtocolError, RecordingError
from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import Hold, Identity, Samples

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pneudrive.campaign.storage.folder import CycleFile


@dataclass(frozen=True, repr=False)
class Status(Shown):
    """Progress of a campaign.

    Attributes
    ----------
    campaign : Campaign
    files : tuple of CycleFile
        Finished cycles.
    planned : int or None
        Number of cycles in the plan; None if the folder holds no plan.
    extra : int
        Number of finished cycles that the plan does not list, from an adaptive campaign of an earlier version.
    remaining_s : float or None
        Remaining time on the rig's clock.
    flags : dict
        Flag -> number of cycles with it.
    problems : tuple of Problem
    holder : Holder or None
        Process that works on the campaign now.
    """

    campaign: Campaign
    files: tuple[CycleFile, ...]
    planned: int | None
    extra: int
    remaining_s: float | None
    flags: dict[str, int]
    problems: tuple[Problem, ...]
    holder: Holder | None

    @property
    def to_do(self) -> int | None:
        """Planned cycles that are not finished."""
        return None if self.planned is None else self.planned - (len(self.files) - self.extra)


def status_of(folder: str | Path) -> Status:
    """Return the status of a campaign folder. The campaign may be running. Every file is checked by its checksum.

    Files from other programs have no checksum. A note in `problems` counts them. `pneudrive characterise` checks them.

    Raises
    ------
    CampaignError
        If the folder is not a campaign.
    """
    campaign = Campaign.open(folder)
    files, problems = campaign.scan()
    foreign = sum(not file.sealed for file in files)
    if foreign:
        note = f"{foreign} of {len(files)} files have no checksum; `pneudrive characterise` checks their samples"
        problems.append(Problem(CYCLES, note, lost=False))
    done = {file.cycle.key for file in files}
    planned, remaining, extra = None, None, 0
    try:
        plan = plan_of(campaign, checked=False)  # it was before the first cycle
    except (CampaignError, ProtocolError):
        pass  # written by another program: no plan is known
    else:
        keys = {cycle.key for cycle in plan.cycles}
        planned, remaining, extra = len(keys), plan.remaining_s(done), len(done - keys)
    flags = Counter(flag for file in files for flag, count in file.head.flags.items() if count)
    return Status(
        campaign, tuple(files), planned, extra, remaining, dict(flags), tuple(problems), holder(campaign.path)
    )


#: Kinds of cycles that have a preliminary estimate.
MEASURED = ("sweep", "sentinel", "stop")


def preliminary_frictions(files: Sequence[CycleFile], identity: Identity) -> list[float]:
    """Return the friction of each cycle, in N: mean of a sweep or control run, maximum after a stop, otherwise NaN.

    Raises
    ------
    CampaignError
        If a file is damaged.
    """
    wanted = [file for file in files if file.cycle.kind in MEASURED]
    frictions = {}
    for file, samples in zip(wanted, read_samples(wanted), strict=True):
        if isinstance(samples, CampaignError):
            raise samples
        frictions[file.path] = preliminary_friction(file, samples, identity)
    return [frictions.get(file.path, np.nan) for file in files]


def preliminary_friction(file: CycleFile, samples: Samples, identity: Identity) -> float:
    """Return the friction of a sweep, a control run or a stop, in N; NaN if the samples do not suffice."""
    from pneudrive.friction.level import extract
    from pneudrive.friction.strokes import Settled

    cycle = file.cycle
    try:
        recording, _ = recording_of(file, identity, samples)
        if cycle.kind == "stop":
            # The largest force against the motion in the move after the longest hold.
            holds = [(step.duration_s, number) for number, step in enumerate(cycle.steps) if isinstance(step, Hold)]
            after = max(holds)[1] + 1 if holds else len(cycle.steps) - 2
            part = np.flatnonzero(steps_of(recording, samples) == after)
            if part.size < 2:
                return np.nan
            way = recording.position_m[part[-1]] - recording.position_m[part[0]]
            return float(np.max(np.sign(way) * recording.balance_n()[part]))
        levels = extract(recording, Settled()).levels
    except RecordingError:
        return np.nan
    return min(levels, key=lambda level: abs(level.speed_m_s - (cycle.speed_m_s or 0.0))).friction_n
