"""Campaigns for the page, read only from their folders. Any local or remote process may run them."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal

from pydantic import StrictFloat

from pneudrive.arrays import Pair, Plain, attributes_of, by_name
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.running.live import read_live
from pneudrive.campaign.storage.control import ask, holder, user
from pneudrive.campaign.storage.folder import CYCLES, LOG, Status, preliminary_frictions, status_of
from pneudrive.errors import CommandError
from pneudrive.web.jobs import READY, RIG, JobRequest, check_folder, folder_name
from pneudrive.web.messages import bounded, pack, python, shell, words
from pneudrive.web.workspace import DESCRIPTIONS, Workspace, last_lines

LAST_LINES, LAST_BYTES = 30, 1 << 15  # of the journal
MOST_POINTS = 10_000
CAMPAIGNS, FASTEST = "campaigns", 1e6  # folder of new campaigns, highest speed
MOST_CAMPAIGNS = 4  # number of kept states
CampaignRequest = Literal["pause", "stop", "resume", "abort"]
CONTROL = "Start the server with --control to send requests to a campaign."


def protocol_named(protocol: object, workspace: Workspace) -> str:
    """Return the named protocol: one of `READY`, or a file of the workspace."""
    if not isinstance(protocol, str) or not (protocol in READY or workspace.path(protocol, DESCRIPTIONS).is_file()):
        raise CommandError(f"there is no protocol {str(protocol)[:80]}", rule=f"a file, or {', '.join(READY)}")
    return protocol


def requested_campaign(
    workspace: Workspace,
    pace: Annotated[StrictFloat | None, bounded(1.0, FASTEST, f"1 to {FASTEST:.0e}, or none")] = None,
    resume: str | None = None,
    protocol: object = None,
    name: object = None,
) -> JobRequest:
    """Return the job that runs a protocol on the simulated rig into a new folder, or continues in a folder.

    Raises
    ------
    CommandError
        The protocol or the folder is not in the workspace, or the speed is not a number.
    """
    speed = None if pace is None else f"{pace:g}"
    if resume is not None:
        check_folder(workspace, resume)
        return JobRequest(words("campaign resume", resume, yes=True, speed=speed), resume, is_new=False)
    source, out = protocol_named(protocol, workspace), f"{CAMPAIGNS}/{folder_name(name)}"
    return JobRequest(words("campaign run", source, rig=RIG, out=out, yes=True, speed=speed), out)


def planned(workspace: Workspace, protocol: object = None) -> Plain:
    """Return the plan of a protocol on the simulated rig in words, with its command and its Python lines.

    Raises
    ------
    CommandError, ProtocolError
        As for `requested_campaign`, or a cycle of the plan breaks a limit of the rig.
    """
    from pneudrive.campaign.planning.plan import show
    from pneudrive.cli.campaign import plan_of

    name = protocol_named(protocol, workspace)
    plan = plan_of(name if name in READY else workspace.path(name, DESCRIPTIONS), RIG)
    lines = {"command": shell("campaign plan", name, rig=RIG), "python": python("plan", rig=RIG, protocol=name)}
    return {"text": show(plan), "time_s": plan.time_s, "cycles": len(plan.planned), **lines}


#: File of a cycle and its time of writing -> the cycle and its preliminary friction, N.
_points: dict[tuple[Path, int], tuple[Cycle, float]] = {}


@lru_cache(maxsize=MOST_CAMPAIGNS)
def _status(folder: Path, _changed_ns: int | None) -> tuple[Status, list[Plain]]:
    """Return the status of a campaign and its friction over speed, cached until another cycle is complete."""
    status = status_of(folder)
    damaged = {problem.where for problem in status.problems}
    sweeps = {
        (file.path, file.path.stat().st_mtime_ns): file
        for file in status.files
        if file.cycle.kind == "sweep" and f"{CYCLES}/{file.path.name}" not in damaged
    }
    new = {key: file for key, file in sweeps.items() if key not in _points}
    frictions = preliminary_frictions(list(new.values()), status.campaign.identity)
    for gone in [key for key in _points if key[0].parent == folder / CYCLES and key not in sweeps]:
        _points.pop(gone, None)
    _points.update(by_name(new, zip((file.cycle for file in new.values()), frictions, strict=True)))
    return status, _groups([_points[key] for key in sweeps], status.campaign.identity.ambient_pressure_pa)


def shown_campaign(workspace: Workspace, path: str) -> Plain:
    """Return the state of a campaign.

    Raises
    ------
    CampaignError
        The folder is not a campaign.
    """
    folder, changed = workspace.folder(path), None
    with suppress(OSError):  # the file of a cycle gets its final name when it is complete
        changed = (folder / CYCLES).stat().st_mtime_ns
    status, groups = _status(folder, changed)
    running = holder(folder)
    return {
        **attributes_of(status, "extra", "planned", "remaining_s", "flags"),
        "name": status.campaign.about.get("name") or folder.name,
        "synthetic": status.campaign.synthetic,
        "done": len(status.files) - status.extra,
        "state": None if running is None else running.state,
        "text": "" if running is None else str(running),
        "cycle": "" if running is None else running.cycle,
        "problems": [str(problem) for problem in status.problems],
        "log": last_lines(folder / LOG, LAST_BYTES)[-LAST_LINES:],
        "groups": groups,
    }


def running_cycle(workspace: Workspace, path: str) -> bytes:
    """Return the running cycle as a frame. Without a running cycle, the head does not contain a cycle."""
    folder = workspace.folder(path)
    found = read_live(folder) if holder(folder) is not None else None
    return pack(*(found or ({"cycle": ""}, {})))


def ask_campaign(workspace: Workspace, path: str, control: bool, word: CampaignRequest) -> None:
    """Send one of the four requests of a campaign to the process that runs it.

    Raises
    ------
    CommandError
        The server was started without ``--control``.
    CampaignError
        No process runs the campaign.
    """
    folder = workspace.folder(path)
    if not control:
        raise CommandError("this server shows campaigns but does not control them", remedy=CONTROL)
    ask(folder, word, f"{user()}, from the page")


def _groups(points: list[tuple[Cycle, float]], ambient_pa: float) -> list[Plain]:
    """Return the preliminary estimates of friction over speed, grouped by pair of chamber pressures."""
    groups: dict[Pair, list[Plain]] = {}
    for cycle, friction in points[:MOST_POINTS]:
        if cycle.speed_m_s and math.isfinite(friction):
            point = {"x": cycle.speed_m_s, "y": friction, "spread": None}
            groups.setdefault((cycle.pressure_a_pa, cycle.pressure_b_pa), []).append(point)
    out = []
    for pair, points_of_pair in sorted(groups.items()):
        a, b = ((one - ambient_pa) / 1e5 for one in pair)
        out.append({"label": f"a {a:.3g}, b {b:.3g} bar gauge", "points": points_of_pair})
    return out
