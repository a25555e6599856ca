"""Jobs. A job runs a command line in one process and shows its last lines. Cancelling acts like Ctrl-C."""

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
from dataclasses import dataclass
from pathlib import Path

from pneudrive.arrays import Plain, attributes_of
from pneudrive.batching import child_command, processors
from pneudrive.errors import CommandError
from pneudrive.web.workspace import Workspace, last_lines, log_folder

RESULTS = "results"
READY = ("quick-look", "stops-pressure", "paper-speed", "paper-pressure", "paper-stops", "asymmetric-pressures")
RIG = "default"  # simulated: a real rig can only be started from a terminal
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
    arguments : list of str
        Arguments of ``pneudrive``.
    out : str
        The folder.
    is_new : bool
        Whether the folder must not exist yet.
    python : str
        Python lines that give the same numbers; may be empty.
    """

    arguments: list[str]
    out: str
    is_new: bool = True
    python: str = ""

    @property
    def command(self) -> str:
        """Shell lines of the job, for the folder of the workspace."""
        line = shlex.join(["pneudrive", *self.arguments])
        folder = self.out.rpartition("/")[0]
        return f"{shlex.join(['mkdir', '-p', folder])}\n{line}" if self.is_new and folder else line


def check_folder(workspace: Workspace, name: str, kind: str = "folder") -> None:
    """Reject a folder that does not exist."""
    if not workspace.folder(name).is_dir():
        raise CommandError(f"there is no {kind} {name}")


def folder_name(given: object) -> str:
    """Check a folder name and return it."""
    if not isinstance(given, str) or not _NAME.fullmatch(given) or len(given.encode()) > MOST_BYTES:
        raise CommandError.of("web.folder-name", name=str(given)[:80], bytes=MOST_BYTES)
    return given


@dataclass
class PageJob:
    """A running or finished job."""

    number: int
    request: JobRequest
    process: subprocess.Popen[bytes]
    log: Path
    folder: Path
    cancelled: bool = False

    @property
    def state(self) -> str:
        """State: ``"running"``, ``"done"``, ``"failed"`` or ``"cancelled"``."""
        status = self.process.poll()
        if status is None:
            return "running"
        return "done" if status == 0 else "cancelled" if self.cancelled else "failed"

    def about(self) -> Plain:
        """Return the displayed data, with the last lines of the output and the last reported progress."""
        state, lines = self.state, last_lines(self.log, LAST_BYTES)
        reports = [line for line in lines if line.startswith(REPORT)]
        progress = None
        for line in reports[-2:]:  # the last line may be incomplete
            with suppress(ValueError):
                progress = json.loads(line)
        tail = "\n".join([line for line in lines if line not in reports][-LAST_LINES:])
        return {
            "number": self.number,
            "kind": self.request.arguments[0],
            **attributes_of(self.request, "command", "out"),
            "state": state,
            "ends": self.cancelled,
            "tail": NOTHING_BEGUN if state == "cancelled" and not self.folder.exists() else tail,
            "progress": progress,
        }


class PageJobs:
    """Jobs of a workspace: at most one for each processor."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = threading.Lock()
        self.all: list[PageJob] = []

    def start(self, request: JobRequest) -> Plain:
        """Start a job and return its displayed data.

        Raises
        ------
        CommandError
            The folder exists, is outside the workspace or cannot be made, or all processors are busy.
        """
        with self._lock:
            running = [job.request.out for job in self.all if job.state == "running"]
            if len(running) >= processors():
                raise CommandError(f"{len(running)} jobs are running", remedy="Wait until a job ends, or cancel one.")
            out = self.workspace.folder(request.out)
            if (request.is_new and out.exists()) or request.out in running:
                raise CommandError(f"{request.out} already exists", remedy="Choose another name.")
            try:
                out.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise CommandError(f"the folder of {request.out} cannot be made", value=error.strerror) from None
            number = len(self.all) + 1
            log = log_folder() / f"{number}-{secrets.token_hex(8)}.log"
            with log.open("xb") as file:
                process = subprocess.Popen(
                    child_command("pneudrive.cli.main", *request.arguments),
                    cwd=self.workspace.root,
                    env={**os.environ, "PNEUDRIVE_PROGRESS": "json"},
                    stdin=subprocess.DEVNULL,
                    stdout=file,
                    stderr=subprocess.STDOUT,
                )
            self.all.append(PageJob(number, request, process, log, out))
            return self.all[-1].about()


def cancelled_job(workspace: Workspace, number: object = None) -> Plain:
    """Cancel a job, like Ctrl-C. The finished parts of its result remain in the folder."""
    for job in workspace.state(PageJobs).all:
        if job.number == number and job.state == "running":
            job.cancelled = True
            job.process.send_signal(signal.SIGINT)
    return listed_jobs(workspace)


def listed_jobs(workspace: Workspace) -> Plain:
    """Return all jobs, the newest first."""
    return {"jobs": [job.about() for job in reversed(workspace.state(PageJobs).all)]}
