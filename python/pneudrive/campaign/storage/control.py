"""Requests to pause, resume and abort: from the keyboard, by a signal, or from another process by files in the folder.

A request is a file in ``control/`` of the campaign folder. The process that runs the campaign checks for requests five
times a second, and removes each one. Files work on every file system, even over the network.
"""

from __future__ import annotations

import errno
import getpass
import json
import os
import queue
import signal
import socket
import stat
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from itertools import chain
from pathlib import Path
from time import monotonic, sleep, time_ns

from pneudrive.campaign.cycle import WORDS
from pneudrive.errors import CampaignError, CommandError
from pneudrive.files.content import read_json
from pneudrive.files.writing import is_held, open_to_append, take

# --- Whole files, the lock and the log of a campaign folder.

#: Ending of a file while it is written. A killed process leaves at most one such file, which is ignored.
PART = ".part"
#: Errors of file systems that do not support flushing a folder.
NO_SUCH_THING = (errno.EINVAL, errno.ENOTSUP, errno.EBADF)

REMEDIES = {getattr(errno, name): text for name, text in WORDS["remedies"].items()}


@contextmanager
def clear_errors(what: str, path: Path) -> Iterator[None]:
    """Convert an error of the operating system to a message with path, reason and remedy.

    Raises
    ------
    CampaignError
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        remedy = REMEDIES.get(error.errno or 0, "Check the disk, then resume: finished cycles are kept.")
        raise CampaignError(what, where=path, value=reason, remedy=remedy) from error


def write_whole(path: Path, data: bytes, *, flush: bool = True) -> None:
    """Write a file under a temporary name, flush it to the disk and rename it; flush the folder, too.

    Readers find the old file or the new one, even if the process is killed at any moment.

    Parameters
    ----------
    path : Path
    data : bytes
    flush : bool
        Whether the file must survive a power cut.

    Raises
    ------
    CampaignError
        If the file cannot be written: disk full, read-only, no permission. No partial file is left.
    """
    temporary = path.with_name(path.name + PART)
    with clear_errors("a file of the campaign cannot be written", path):
        try:
            with temporary.open("wb") as file:
                file.write(data)
                file.flush()
                if flush:
                    os.fsync(file.fileno())
            temporary.replace(path)
        except OSError:
            with suppress(OSError):
                temporary.unlink()
            raise
        if flush:
            flush_folder(path.parent)


def make_folder(path: Path) -> None:
    """Create a folder and its parents so that they survive a power cut.

    Raises
    ------
    CampaignError
        The folder cannot be created.
    """
    with clear_errors("a folder of the campaign cannot be created", path):
        missing = [p for p in (path, *path.parents) if not p.exists()]
        path.mkdir(parents=True, exist_ok=True)
        for made in missing:
            flush_folder(made.parent)


def no_links(folder: Path) -> None:
    """Reject a folder that contains links, pipes or devices, because writing to them would change other files or block.

    Raises
    ------
    CampaignError
        If the folder or one of its subfolders contains a link, a pipe or a device.
    """
    for path in chain(folder.glob("*"), folder.glob("*/*")):  # a link in the folder raises before its content is read
        try:
            mode = path.lstat().st_mode
        except FileNotFoundError:  # another process removed or renamed it
            continue
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            kind = f"a link to {path.readlink()}" if stat.S_ISLNK(mode) else "a pipe or a device"
            raise CampaignError.of("campaign.link", where=path, value=kind)


def flush_folder(path: Path) -> None:
    """Flush a folder's list of names to the disk, if the file system supports it."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in NO_SUCH_THING:
            raise


NAME = "campaign.lock"


def now() -> str:
    """Return date and time of the computer in ISO 8601 with time zone."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


@dataclass(frozen=True)
class Holder:
    """Process that works in a folder, and its current activity.

    Attributes
    ----------
    pid, host, user : int, str, str
    since : str
        Start of the process, ISO 8601.
    state : str
        ``starting``, ``running``, ``pausing``, ``paused``, ``waiting``, ``operator`` or ``stopping``.
    text : str
        Reason for waiting, in words.
    cycle : str
        Key of the running cycle.
    """

    pid: int
    host: str
    user: str
    since: str
    state: str = "starting"
    text: str = ""
    cycle: str = ""

    def __str__(self) -> str:
        """Return a description in words."""
        what = f"{self.state}: {self.text}" if self.text else self.state
        return f"process {self.pid} of {self.user} on {self.host} since {self.since}, {what}"


class FolderLock:
    """Kernel lock (`flock`) of a campaign folder. It is released when the process ends.

    Parameters
    ----------
    folder : Path
        Must exist.

    Raises
    ------
    CampaignError
        If another process holds the lock, or the folder contains links.
    """

    def __init__(self, folder: Path) -> None:
        path = folder / NAME
        no_links(folder)
        with clear_errors("the campaign folder cannot be locked", path):
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            taken = take(self._file)
        except OSError as error:
            os.close(self._file)
            raise CampaignError.of("campaign.no-locks", where=path, value=error.strerror) from error
        if not taken:
            os.close(self._file)
            other = str(_read(path) or "a process without a name")
            raise CampaignError.of("campaign.locked", where=folder, value=other, folder=folder)
        self._holder = Holder(os.getpid(), socket.gethostname(), user(), now())
        self.tell()

    def tell(self, **what: str) -> None:
        """Write the ``state``, ``text`` and ``cycle`` of this process for other processes."""
        self._holder = replace(self._holder, **what)
        text = json.dumps(asdict(self._holder)).encode()
        with suppress(OSError):  # a full disk must not end the campaign here: readers wait
            os.pwrite(self._file, text, 0)
            os.ftruncate(self._file, len(text))

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):
            os.ftruncate(self._file, 0)
        os.close(self._file)


def holder(folder: Path) -> Holder | None:
    """Return the process that works in a folder, or None. The lock is not touched."""
    path = folder / NAME
    return (_read(path) or Holder(0, "?", "?", "?")) if is_held(path) else None


def _read(path: Path) -> Holder | None:
    with suppress(CampaignError, TypeError):
        return Holder(**read_json(path, CampaignError))
    return None


def user() -> str:
    """Return the user name of this process."""
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # no such user: in a container
        return str(os.getuid())


def append_line(path: Path, text: str) -> None:
    """Append a line with date and time to a log. A failure of the log, such as a full disk, never ends a campaign."""
    line = " | ".join(part for part in text.splitlines() if part.strip())
    with suppress(OSError, CommandError), open_to_append(path) as file:
        file.write(f"{now()} {line}\n")


# --- Pause, resume and abort: from the keyboard, by a signal, and from another process by files in the folder.
#
# A request is a complete file in ``control/`` of the campaign folder. The process that runs the campaign looks for a
# request five times a second, takes it and removes it. This works on any file system, also over the network, and costs
# one system call each time.

FOLDER = "control"
#: File in ``control/`` with the progress of the campaign; it is not a request.
LIVE = "live.npz"
#: Requests: pause after the cycle, stop the axis now and pause, resume, end.
PAUSE, STOP, RESUME, ABORT = "pause", "stop", "resume", "abort"
REQUESTS = (PAUSE, STOP, RESUME, ABORT)
LOOK_S = 0.2
#: Presses of Ctrl-C within this time count as one, s.
BOUNCE_S = 0.2
CTRL_C = "Ctrl-C"


@dataclass(frozen=True)
class Request:
    """A request to a running campaign.

    Attributes
    ----------
    word : str
        One of `REQUESTS`.
    by : str
        Source of the request in words: a person, a key or a signal.
    """

    word: str
    by: str


class Requests:
    """Requests to one campaign, from all sources.

    Parameters
    ----------
    folder : Path
        Folder of the campaign.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self._queue: deque[Request] = deque()
        self.presses, self._last_press = 0, 0.0
        # Not a threading.Event: its lock is not re-entrant, and a signal handler may run while its thread holds it.
        self._arrived: queue.SimpleQueue[None] = queue.SimpleQueue()
        with suppress(OSError):
            make_folder(self._folder)
        for path in self._waiting():  # left for a process that is gone
            self._take_file(path)

    def put(self, request: Request) -> None:
        """Add a request."""
        self._queue.append(request)
        self.wake()

    def take(self) -> Request | None:
        """Remove and return the oldest request, or return None."""
        if self._queue:
            return self._queue.popleft()
        return next(filter(None, map(self._take_file, self._waiting())), None)

    def wait(self, seconds: float = LOOK_S) -> None:
        """Wait until a request arrives or `wake` is called, but at most `seconds`."""
        with suppress(queue.Empty):
            self._arrived.get(timeout=seconds)

    def wake(self) -> None:
        """End a running `wait`."""
        self._arrived.put(None)

    def _waiting(self) -> list[Path]:
        names: list[str] = []
        with suppress(OSError):
            names = sorted(os.listdir(self._folder))  # noqa: PTH208 - one system call, five times a second
        return [self._folder / name for name in names if not name.endswith((PART, ".taken", LIVE))]

    @staticmethod
    def _take_file(path: Path) -> Request | None:
        taken = path.with_name(path.name + ".taken")
        request = None
        with suppress(OSError, CampaignError, KeyError, TypeError):
            path.rename(taken)
            data = read_json(taken, CampaignError)
            request = Request(str(data["word"]), str(data["by"]))
        with suppress(OSError):
            taken.unlink()
        return request if request is not None and request.word in REQUESTS else None

    @contextmanager
    def signals(self) -> Iterator[None]:
        """Turn signals into requests.

        Ctrl-C pauses after the cycle, and a second Ctrl-C stops the axis now. SIGTERM and SIGHUP end the campaign.
        Ctrl-Z pauses too, because a stopped process cannot control its axis. Ignored signals stay ignored (nohup).
        """
        if threading.current_thread() is not threading.main_thread():
            yield  # only the main thread may set handlers
            return
        before = {
            number: signal.signal(number, self._signalled)
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)
            if signal.getsignal(number) != signal.SIG_IGN
        }
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _signalled(self, number: int, _: object) -> None:
        if number == signal.SIGTSTP:
            self.put(Request(PAUSE, "Ctrl-Z"))
        elif number != signal.SIGINT:
            self.put(Request(ABORT, signal.Signals(number).name))
        else:
            since, self._last_press = monotonic() - self._last_press, monotonic()
            if since >= BOUNCE_S:
                self.presses += 1
                self.put(Request({1: PAUSE, 2: STOP}.get(self.presses, ABORT), CTRL_C))


def ask(folder: Path, word: str, by: str) -> Holder:
    """Send a request to the process that runs a campaign.

    Returns
    -------
    Holder
        Process and its state before the request.

    Raises
    ------
    CampaignError
        If no process runs the campaign, or the request cannot be written.
    """
    running = holder(folder)
    if running is None:
        raise CampaignError.of("campaign.no-process", where=folder, folder=folder)
    no_links(folder)
    make_folder(folder / FOLDER)
    write_whole(folder / FOLDER / f"{time_ns()}-{word}", json.dumps({"word": word, "by": by, "at": now()}).encode())
    return running


def wait_for(folder: Path, states: tuple[str, ...], seconds: float) -> Holder | None:
    """Wait up to `seconds` for one of these states of the process that runs a campaign.

    Return the process; None if it has ended.
    """
    until = monotonic() + seconds
    while (running := holder(folder)) is not None and running.state not in states and monotonic() < until:
        sleep(LOOK_S)
    return running
