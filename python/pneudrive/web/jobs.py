"""Long work as the command line does it: a process for each job, its last lines, an end by Ctrl-C."""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import threading
from dataclasses import dataclass, field
from itertools import count
from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError
from pneudrive.files import child
from pneudrive.signals.trajectories import is_trajectory
from pneudrive.trajectory import SUFFIXES
from pneudrive.web.recordings import CACHE, layout_in
from pneudrive.web.workspace import TABLES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pneudrive.web.workspace import Workspace

RESULTS = "results"
LAST_LINES = 40
MOST_RECORDINGS = 500
_NAME = re.compile(r"[\w][\w .-]{0,80}")


@dataclass(frozen=True)
class AskedWork:
    """Work on recordings: the friction of them, into a new folder of results."""

    recordings: tuple[str, ...]
    out: str

    @classmethod
    def of(cls, given: Mapping[str, Any], workspace: Workspace) -> AskedWork:
        """Read the page's request.

        Raises
        ------
        CommandError
            A recording is not in the workspace, or the folder is not a new one of the results.
        """
        names: Any = given.get("recordings")
        folder: Any = given.get("name")
        is_list = isinstance(names, list) and 0 < len(names) <= MOST_RECORDINGS
        if not is_list or not all(isinstance(one, str) for one in names):
            raise CommandError("no recording is named", remedy="Choose at least one.")
        if not isinstance(folder, str) or not _NAME.fullmatch(folder):
            raise CommandError(
                f"{str(folder)[:80]!r} is no name of a folder", rule="letters, digits, spaces, -, _ and ."
            )
        for name in names:
            path = workspace.path(name, TABLES)
            if not path.is_file():
                raise CommandError(f"there is no recording {name}")
            if layout_in(workspace, path) is None and not (path.suffix in SUFFIXES and is_trajectory(path)):
                raise CommandError(f"{name} has no layout in the workspace", remedy="Propose one and accept it.")
        return cls(tuple(names), f"{RESULTS}/{folder}")

    def words(self) -> list[str]:
        """Return the arguments of the command."""
        return ["characterise", *map(_safe, self.recordings), "--out", self.out]

    def as_command(self) -> str:
        """Return the lines of a shell that do the same in the folder of the workspace."""
        return f"mkdir -p {RESULTS}\n{shlex.join(['pneudrive', *self.words()])}"

    def as_python(self) -> str:
        """Return lines of Python that give the same map."""
        return f"import pneudrive as pn\n\ncurves = pn.characterise({list(self.recordings)!r})\n"


def _safe(name: str) -> str:
    """Return a name that no command takes for an option."""
    return f"./{name}" if name.startswith("-") else name


@dataclass
class PageJob:
    """A running or finished job."""

    number: int
    command: str
    out: str
    process: subprocess.Popen[bytes]
    log: Path
    cancelled: bool = field(default=False)

    @property
    def state(self) -> str:
        """How it stands: ``"running"``, ``"done"``, ``"failed"`` or ``"cancelled"``."""
        status = self.process.poll()
        if status is None:
            return "running"
        return "cancelled" if self.cancelled else "failed" if status else "done"

    def about(self) -> dict[str, Any]:
        """Return what the page shows."""
        text = self.log.read_text("utf-8", "replace") if self.log.is_file() else ""
        tail = "\n".join(text.splitlines()[-LAST_LINES:])
        return {"number": self.number, "command": self.command, "out": self.out, "state": self.state, "tail": tail}


class PageJobs:
    """The jobs of this server: as many at a time as there are processors."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = threading.Lock()
        self._numbers = count(1)
        self.all: list[PageJob] = []

    def start(self, work: AskedWork) -> PageJob:
        """Start a job.

        Raises
        ------
        CommandError
            The folder is there already, or all processors are busy.
        """
        with self._lock:
            running = sum(one.state == "running" for one in self.all)
            if running >= (os.cpu_count() or 1):
                raise CommandError(f"{running} jobs are running", remedy="Wait for one, or cancel it.")
            out = self.workspace.root / work.out
            if out.exists() or any(one.out == work.out and one.state == "running" for one in self.all):
                raise CommandError(f"{work.out} is there already", remedy="Choose another name.")
            out.parent.mkdir(exist_ok=True)
            logs = self.workspace.root / CACHE
            logs.mkdir(parents=True, exist_ok=True)
            number = next(self._numbers)
            log = logs / f"job-{os.getpid()}-{number}.log"
            with log.open("wb") as file:
                process = subprocess.Popen(
                    child.command("pneudrive.cli.main", *work.words()),
                    cwd=self.workspace.root,
                    stdin=subprocess.DEVNULL,
                    stdout=file,
                    stderr=subprocess.STDOUT,
                )
            job = PageJob(number, work.as_command(), work.out, process, log)
            self.all.append(job)
            return job

    def cancel(self, number: object) -> None:
        """End a job as Ctrl-C does: what is finished is kept."""
        for one in self.all:
            if one.number == number and one.state == "running":
                one.cancelled = True
                one.process.send_signal(signal.SIGINT)

    def about(self) -> Sequence[dict[str, Any]]:
        """Return all jobs, the newest first."""
        return [one.about() for one in reversed(self.all)]
