"""Progress of a campaign and preliminary friction of its finished cycles, both read from the campaign folder."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from pneudrive.campaign.storage.control import Holder, holder
from pneudrive.campaign.storage.folder import CYCLES, Campaign, CycleFile, Problem, plan_of, read_samples, recording_of
from pneudrive.errors import CampaignError, ProtocolError, RecordingError
from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import Identity


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
    with suppress(CampaignError, ProtocolError):  # written by another program: no plan is known
        plan = plan_of(campaign, checked=False)  # it was before the first cycle
        keys = {cycle.key for cycle in plan.cycles}
        planned, remaining, extra = len(keys), plan.remaining_s(done), len(done - keys)
    flags = Counter(flag for file in files for flag, count in file.head.flags.items() if count)
    return Status(
        campaign, tuple(files), planned, extra, remaining, dict(flags), tuple(problems), holder(campaign.path)
    )


def preliminary_frictions(sweeps: Sequence[CycleFile], identity: Identity) -> list[float]:
    """Return the mean friction of each sweep, in N; NaN if its samples do not suffice.

    Raises
    ------
    CampaignError
        If a file is damaged.
    """
    from pneudrive.friction.level import extract
    from pneudrive.friction.strokes import Settled

    frictions = []
    for file, samples in zip(sweeps, read_samples(sweeps), strict=True):
        if isinstance(samples, CampaignError):
            raise samples
        speed = file.cycle.speed_m_s or 0.0
        try:
            recording, _ = recording_of(file, identity, samples)
            levels = extract(recording, Settled()).levels
            frictions.append(min(levels, key=lambda level: abs(level.speed_m_s - speed)).friction_n)
        except RecordingError:
            frictions.append(math.nan)
    return frictions
