"""Campaigns for the page, read only from their folders. Any local or remote process may run them."""

from __future__ import annotations

import math
import threading
from contextlib import suppress
from functools import cache
from pathlib import Path

from pneudrive.arrays import Pair, Plain, attributes_of, by_name
from pneudrive.campaign.cycle import Head
from pneudrive.campaign.running.live import read_live
from pneudrive.campaign.status import Status, preliminary_frictions, status_of
from pneudrive.campaign.storage.control import REQUESTS, ask, holder, user
from pneudrive.campaign.storage.folder import CYCLES, LOG
from pneudrive.errors import CommandError
from pneudrive.web.jobs import READY, RIG, protocol_named
from pneudrive.web.messages import pack, python, shell
from pneudrive.web.workspace import DESCRIPTIONS, Workspace, last_lines

LAST_LINES, LAST_BYTES = 30, 1 << 15  # of the journal
MOST_POINTS = 10_000
CONTROL = "Start the server with --control to send requests to a campaign."


def planned(workspace: Workspace, protocol: object = None) -> Plain:
    """Return the plan of a protocol on the simulated rig in words, with its command and its Python lines.

    Raises
    ------
    CommandError, ProtocolError
        As for `campaign_job`, or a cycle of the plan breaks a limit of the rig.
    """
    from pneudrive.campaign.planning.plan import show
    from pneudrive.cli.campaign import plan_of

    name = protocol_named(protocol, workspace)
    plan = plan_of(name if name in READY else workspace.path(name, DESCRIPTIONS), RIG)
    lines = {"command": shell("campaign plan", name, rig=RIG), "python": python("plan", rig=RIG, protocol=name)}
    return {"text": show(plan), "time_s": plan.time_s, "cycles": len(plan.planned), **lines}


class WatchedCampaign:
    """One campaign folder. Its data are cached until they are out of date."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.Lock()
        self._points: dict[tuple[Path, int], tuple[Head, float]] = {}  # keyed by file and time of writing
        self._status: Status | None = None
        self._seen: int | None = None  # time of writing of the last cycle

    def about(self) -> Plain:
        """Return the state of the campaign.

        Raises
        ------
        CampaignError
            The folder is not a campaign.
        """
        with self._lock:
            changed = None
            with suppress(OSError):  # the file of a cycle gets its final name when it is complete
                changed = (self.folder / CYCLES).stat().st_mtime_ns
            if self._status is None or changed != self._seen:
                self._status, self._seen = self._look(), changed
            status, points = self._status, list(self._points.values())
        running = holder(self.folder)
        return {
            **attributes_of(status, "extra", "planned", "remaining_s", "flags"),
            "name": status.campaign.about.get("name") or self.folder.name,
            "synthetic": status.campaign.synthetic,
            "done": len(status.files) - status.extra,
            "state": None if running is None else running.state,
            "text": "" if running is None else str(running),
            "cycle": "" if running is None else running.cycle,
            "problems": [str(problem) for problem in status.problems],
            "log": last_lines(self.folder / LOG, LAST_BYTES)[-LAST_LINES:],
            "groups": _groups(points, status.campaign.identity.ambient_pressure_pa),
        }

    def _look(self) -> Status:
        status = status_of(self.folder)
        damaged = {problem.where for problem in status.problems}
        sweeps = (file for file in status.files if file.cycle.kind == "sweep")
        files = {(file.path, file.path.stat().st_mtime_ns): file for file in sweeps}
        known = {key: one for key, one in self._points.items() if key in files}  # the folder may have been replaced
        sound = {
            key: file for key, file in files.items() if key not in known and f"{CYCLES}/{file.path.name}" not in damaged
        }
        found = preliminary_frictions(list(sound.values()), status.campaign.identity)
        heads = (file.head for file in sound.values())
        self._points = known | by_name(sound, zip(heads, found, strict=True))
        return status


#: The campaign of each folder that the page has shown.
_watched = cache(WatchedCampaign)


def shown_campaign(workspace: Workspace, path: str) -> Plain:
    """Return the state of a campaign."""
    return _watched(workspace.folder(path)).about()


def running_cycle(workspace: Workspace, path: str) -> bytes:
    """Return the running cycle as a frame. Without a running cycle, the head does not contain a cycle."""
    folder = workspace.folder(path)
    found = read_live(folder) if holder(folder) is not None else None
    return pack(*(found or ({"cycle": ""}, {})))


def ask_campaign(workspace: Workspace, path: str, control: bool, word: object = None) -> None:
    """Send one of the four requests of a campaign to the process that runs it.

    Raises
    ------
    CommandError
        The server was started without ``--control``, or the request is unknown.
    CampaignError
        No process runs the campaign.
    """
    folder = workspace.folder(path)
    if not control:
        raise CommandError("this server shows campaigns but does not control them", remedy=CONTROL)
    if word not in REQUESTS:
        raise CommandError(f"{word!r} is not a request", rule=", ".join(REQUESTS))
    ask(folder, str(word), f"{user()}, from the page")


def _groups(points: list[tuple[Head, float]], ambient_pa: float) -> list[Plain]:
    """Return the preliminary estimates of friction over speed, grouped by pair of chamber pressures."""
    groups: dict[Pair, list[Plain]] = {}
    for head, friction in points[:MOST_POINTS]:
        cycle = head.cycle
        if cycle.speed_m_s and math.isfinite(friction):
            point = {"x": cycle.speed_m_s, "y": friction, "spread": None}
            groups.setdefault((cycle.pressure_a_pa, cycle.pressure_b_pa), []).append(point)
    out = []
    for pair, points_of_pair in sorted(groups.items()):
        a, b = ((one - ambient_pa) / 1e5 for one in pair)
        out.append({"label": f"a {a:.3g}, b {b:.3g} bar gauge", "points": points_of_pair})
    return out
