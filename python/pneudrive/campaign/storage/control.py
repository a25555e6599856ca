"""Pause, resume and abort: from the keyboard, by a signal, and from another process by files in the folder.

A request is a complete file in ``control/`` of the campaign folder. The process that runs the campaign looks for a
request five times a second, takes it and removes it. This works on any file system, also over the network, and costs
one system call each time.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pneudrive.campaign.storage.files import PART, Holder, holder, make_folder, no_links, now, write_whole
from pneudrive.errors import CampaignError
from pneudrive.files.content import read_json

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from types import FrameType

    from pneudrive.progress import Flag

FOLDER = "control"
#: Files there that are no requests: what the campaign does now, written by itself.
LIVE, LIVE_POINTS = "live.json", "live.f4"
#: Requests: pause after the cycle, stop the axis now and pause, go on, end.
PAUSE, STOP, RESUME, ABORT = "pause", "stop", "resume", "abort"
WORDS = (PAUSE, STOP, RESUME, ABORT)
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
        One of `WORDS`.
    by : str
        Person who made the request, in words.
    leave : bool
        Nobody can resume: a pause ends the campaign.
    """

    word: str
    by: str
    leave: bool = False


class Requests:
    """Requests to one campaign, from all sources.

    Parameters
    ----------
    folder : Path
        Folder of the campaign.
    someone_there : bool
        Whether somebody answers prompts.
    cancel : object with ``is_set()``, optional
        Once set, a request to end.
    """

    def __init__(self, folder: Path, *, someone_there: bool, cancel: Flag | None = None) -> None:
        self._folder = folder / FOLDER
        self._someone_there, self._cancel = someone_there, cancel
        self._queue: deque[Request] = deque()
        self._presses, self._last_press = 0, 0.0
        # Not a threading.Event: its lock is not re-entrant, and a signal handler may run while its thread holds it.
        self._arrived: queue.SimpleQueue[None] = queue.SimpleQueue()
        with contextlib.suppress(OSError):
            make_folder(self._folder)
        for path in self._waiting():  # left for a process that is gone
            with contextlib.suppress(OSError):
                path.unlink()

    def put(self, request: Request) -> None:
        """Add a request."""
        self._queue.append(request)
        self.wake()

    def take(self) -> Request | None:
        """Remove and return the oldest request, or return None."""
        if self._cancel is not None and self._cancel.is_set():
            self._cancel = None
            return Request(ABORT, "the caller")
        if self._queue:
            return self._queue.popleft()
        for path in self._waiting():
            request = self._take_file(path)
            if request is not None:
                return request
        return None

    def wait(self, seconds: float = LOOK_S) -> None:
        """Wait for a request or a call of `wake`, up to a time."""
        with contextlib.suppress(queue.Empty):
            self._arrived.get(timeout=seconds)

    def wake(self) -> None:
        """End a wait."""
        self._arrived.put(None)

    def began_again(self) -> None:
        """Reset the count of Ctrl-C."""
        self._presses = 0

    def _waiting(self) -> list[Path]:
        try:
            names = sorted(os.listdir(self._folder))  # noqa: PTH208 - one system call, five times a second
        except OSError:
            return []
        return [self._folder / name for name in names if not name.endswith((PART, ".taken", LIVE, LIVE_POINTS))]

    @staticmethod
    def _take_file(path: Path) -> Request | None:
        taken = path.with_name(path.name + ".taken")
        try:
            path.rename(taken)
            data = read_json(taken, CampaignError)
            request = Request(str(data["word"]), str(data["by"]))
        except (OSError, CampaignError, KeyError, TypeError):
            request = None
        with contextlib.suppress(OSError):
            taken.unlink()
        return request if request is not None and request.word in WORDS else None

    @contextlib.contextmanager
    def signals(self) -> Iterator[None]:
        """Turn signals into requests: Ctrl-C pauses after the cycle, twice stops now; SIGTERM and SIGHUP end.

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

    def _signalled(self, number: int, frame: FrameType | None) -> None:
        del frame
        if number == signal.SIGTSTP:
            self.put(Request(PAUSE, "Ctrl-Z"))
        elif number != signal.SIGINT:
            self.put(Request(ABORT, signal.Signals(number).name))
        else:
            since, self._last_press = time.monotonic() - self._last_press, time.monotonic()
            if since >= BOUNCE_S:
                self._presses += 1
                word = {1: PAUSE, 2: STOP}.get(self._presses, ABORT)
                self.put(Request(word, CTRL_C, leave=not self._someone_there))


def ask(folder: Path, word: str, by: str) -> Holder:
    """Send a request to the process that runs a campaign.

    Returns
    -------
    Holder
        The process as it was before.

    Raises
    ------
    CampaignError
        If no process runs it, or the request cannot be written.
    """
    running = holder(folder)
    if running is None:
        raise CampaignError(
            "no process works in this campaign folder",
            where=str(folder),
            remedy=f"Resume it: pneudrive campaign resume {folder}",
        )
    no_links(folder)
    make_folder(folder / FOLDER)
    write_whole(
        folder / FOLDER / f"{time.time_ns()}-{word}", json.dumps({"word": word, "by": by, "at": now()}).encode()
    )
    return running


def wait_for(folder: Path, states: tuple[str, ...], seconds: float) -> Holder | None:
    """Wait until the process that runs a campaign is in one of these states or gone; return its state."""
    until = time.monotonic() + seconds
    while (running := holder(folder)) is not None and running.state not in states and time.monotonic() < until:
        time.sleep(LOOK_S)
    return running
