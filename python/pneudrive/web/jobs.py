"""Jobs: each runs a command line in one process, shows its last lines, and can be cancelled like by Ctrl-C."""

from __future__ import annotations

import json
import os
import re
import secrets
import shlex
import signal
import subprocess
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError
from pneudrive.files import child
from pneudrive.web.cache import log_folder
from pneudrive.web.workspace import DESCRIPTIONS, safe

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pneudrive.web.workspace import Workspace

RESULTS, CAMPAIGNS = "results", "campaigns"
READY = ("quick-look", "stops-pressure", "paper-speed", "paper-pressure", "paper-stops", "asymmetric-pressures")
RIG = "default"  # simulated: a real rig can only be started from a terminal
FASTEST = 1e6
LAST_LINES, LAST_BYTES = 40, 1 << 16
REPORT = '{"done": '  # beginning of a line of progress
NOTHING_BEGUN = "Interrupted before any result was finished: nothing was written."
MOST_BYTES = 243  # longest name: the system allows 255 with the suffix
_NAME = re.compile(r"[\w][\w .-]{0,80}")


@dataclass(frozen=True)
class JobRequest:
    """A command that makes a folder, or continues in an existing one.

    Attributes
    ----------
    arguments : tuple of str
        Arguments of ``pneudrive``.
    out : str
        The folder.
    is_new : bool
        Whether the folder must not exist yet.
    python : str
        Python lines that give the same numbers. Empty if there are none.
    """

    arguments: tuple[str, ...]
    out: str
    is_new: bool = True
    python: str = ""

    @property
    def command(self) -> str:
        """Shell lines that do the same in the folder of the workspace."""
        line = shlex.join(["pneudrive", *self.arguments])
        folder = self.out.rpartition("/")[0]
        return f"{shlex.join(['mkdir', '-p', folder])}\n{line}" if self.is_new and folder else line


def campaign_job(given: Mapping[str, Any], workspace: Workspace) -> JobRequest:
    """Return the job that runs a protocol on the simulated rig into a new folder, or continues in a folder.

    Raises
    ------
    CommandError
        The protocol or the folder is not in the workspace, or the speed is not a number.
    """
    folder, pace = given.get("resume"), given.get("pace")
    if not (pace is None or (isinstance(pace, int | float) and 1.0 <= pace <= FASTEST)):
        raise CommandError(f"pace = {pace} is out of bounds", rule=f"1 to {FASTEST:.0e}, or none")
    options = ("--yes", *(() if pace is None else ("--speed", f"{pace:g}")))
    if isinstance(folder, str):
        if not workspace.folder(folder).is_dir():
            raise CommandError(f"there is no folder {folder}")
        return JobRequest(("campaign", "resume", safe(folder), *options), folder, is_new=False)
    protocol, out = protocol_named(given, workspace), f"{CAMPAIGNS}/{folder_name(given.get('name'))}"
    return JobRequest(("campaign", "run", safe(protocol), "--rig", RIG, "--out", out, *options), out)


def protocol_named(given: Mapping[str, Any], workspace: Workspace) -> str:
    """Return the named protocol: one of `READY`, or a file of the workspace."""
    protocol = given.get("protocol")
    if not isinstance(protocol, str) or not (protocol in READY or workspace.path(protocol, DESCRIPTIONS).is_file()):
        raise CommandError(f"there is no protocol {str(protocol)[:80]}", rule=f"a file, or {', '.join(READY)}")
    return protocol


def folder_name(given: object) -> str:
    """Check a folder name and return it."""
    if not isinstance(given, str) or not _NAME.fullmatch(given) or len(given.encode()) > MOST_BYTES:
        rule = f"letters, digits, spaces, -, _ and .; at most 81 of them and {MOST_BYTES} bytes"
        raise CommandError(f"{str(given)[:80]!r} is not a valid folder name", rule=rule)
    return given


@dataclass
class PageJob:
    """A running or finished job."""

    number: int
    kind: str
    command: str
    out: str
    process: subprocess.Popen[bytes]
    log: Path
    place: Path
    cancelled: bool = field(default=False)

    @property
    def state(self) -> str:
        """State: ``"running"``, ``"done"``, ``"failed"`` or ``"cancelled"``."""
        status = self.process.poll()
        if status is None:
            return "running"
        return "done" if status == 0 else "cancelled" if self.cancelled else "failed"

    def about(self) -> dict[str, Any]:
        """Return the displayed data."""
        about = {
            "number": self.number,
            "kind": self.kind,
            "command": self.command,
            "out": self.out,
            "state": self.state,
            "ends": self.cancelled,
        }
        said = _said(self.log)
        if self.state == "cancelled" and not self.place.exists():
            said["tail"] = NOTHING_BEGUN
        return {**about, **said}


def _said(log: Path) -> dict[str, Any]:
    """Return the last lines of a job's output, and its last reported progress."""
    try:
        with log.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(size - LAST_BYTES, 0))
            lines = file.read().decode("utf-8", "replace").splitlines()[size > LAST_BYTES :]  # the first is cut
    except OSError:
        lines = []
    reports = [line for line in lines if line.startswith(REPORT)]
    progress = None
    for line in reports[-2:]:  # the last line may be incomplete
        with suppress(ValueError):
            progress = json.loads(line)
    return {"tail": "\n".join([line for line in lines if line not in reports][-LAST_LINES:]), "progress": progress}


class PageJobs:
    """Jobs of this server: at most one for each processor."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = threading.Lock()
        self._numbers = count(1)
        self.all: list[PageJob] = []

    def start(self, work: JobRequest) -> PageJob:
        """Start a job.

        Raises
        ------
        CommandError
            The folder exists, leads out of the workspace or cannot be made, or all processors are busy.
        """
        with self._lock:
            running = [one.out for one in self.all if one.state == "running"]
            if len(running) >= (os.cpu_count() or 1):
                raise CommandError(f"{len(running)} jobs are running", remedy="Wait until a job ends, or cancel one.")
            out = self.workspace.folder(work.out)
            if (work.is_new and out.exists()) or work.out in running:
                raise CommandError(f"{work.out} is there already", remedy="Choose another name.")
            try:
                out.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise CommandError(f"the folder of {work.out} cannot be made", value=error.strerror) from None
            number = next(self._numbers)
            log = log_folder() / f"{number}-{secrets.token_hex(8)}.log"
            with log.open("xb") as file:
                process = subprocess.Popen(
                    child.command("pneudrive.cli.main", *work.arguments),
                    cwd=self.workspace.root,
                    env={**os.environ, "PNEUDRIVE_PROGRESS": "json"},
                    stdin=subprocess.DEVNULL,
                    stdout=file,
                    stderr=subprocess.STDOUT,
                )
            job = PageJob(number, work.arguments[0], work.command, work.out, process, log, out)
            self.all.append(job)
            return job

    def cancel(self, number: object) -> None:
        """Cancel a job, like Ctrl-C. Finished parts are kept."""
        for one in self.all:
            if one.number == number and one.state == "running":
                one.cancelled = True
                one.process.send_signal(signal.SIGINT)

    def about(self) -> Sequence[dict[str, Any]]:
        """Return all jobs, the newest first."""
        return [one.about() for one in reversed(self.all)]
