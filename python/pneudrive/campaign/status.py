"""Progress of a campaign, read only from its folder."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pneudrive.campaign.storage.folder import CYCLES, Campaign, Problem
from pneudrive.campaign.storage.folder_plan import plan_of
from pneudrive.campaign.storage.lock import Holder, holder
from pneudrive.errors import CampaignError, ProtocolError
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
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
        Cycles of the plan; None if the folder holds no plan.
    extra : int
        Finished cycles that the plan does not list, from an adaptive campaign of an earlier version.
    remaining_s : float or None
        Remaining time on the rig's clock.
    flags : dict
        Flag -> number of cycles with it.
    problems : tuple of Problem
    holder : Holder or None
        The process that works on it now.
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
    """Return the status of a campaign folder, even while it runs; check every file by its checksum.

    Files from other programs have no checksum. Their samples are checked when they are read, and a note reports this.

    Raises
    ------
    CampaignError
        If it is not a campaign.
    """
    campaign = Campaign.open(folder)
    files, problems = campaign.scan()
    foreign = sum(not file.sealed for file in files)
    if foreign:
        note = f"{foreign} of {len(files)} have no checksum: their samples are checked by `pneudrive characterise`"
        problems.append(Problem(CYCLES, note, lost=False))
    done = {file.head.cycle.key for file in files}
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
