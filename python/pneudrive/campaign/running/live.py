"""Displays of a running campaign: one table or plain lines in the terminal, and a file in ``control/``."""

from __future__ import annotations

import json
import sys
import threading
import zlib
from collections.abc import Collection
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from time import monotonic
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from pneudrive.arrays import Columns, Plain
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.planning.preflight import Plan
from pneudrive.campaign.storage.control import FOLDER, LIVE, write_whole
from pneudrive.errors import CampaignError
from pneudrive.files.content import read_bytes
from pneudrive.numbers import duration
from pneudrive.rig.interface import Samples

Points = NDArray[np.float32]

REFRESHED_HZ = 5.0


def counted(flags: dict[str, int]) -> str:
    """Return flags with their counts as text."""
    return ", ".join(f"{flag} {count}" for flag, count in flags.items())


class Display:
    """Base class of displays of a running campaign. It holds the state; subclasses show the state.

    Attributes
    ----------
    title : str
        Name of the protocol.
    total : int
        Number of cycles, finished ones included.
    key, samples : str, int
        Key of the current cycle, and number of its samples so far.
    """

    title, key, samples = "", "", 0

    def began(self, plan: Plan, done: Collection[str]) -> None:
        """Show that the campaign begins; `done` contains the keys of the cycles that are already finished."""
        times = {p.cycle.key: p.time_s for p in plan.planned}
        self.title, self.total = plan.protocol.name, len(times.keys() | done)
        self._left = {key: time_s for key, time_s in times.items() if key not in done}
        self._began, self._passed = monotonic(), 0.0

    @property
    def count(self) -> int:
        """Number of finished cycles."""
        return self.total - len(self._left)

    @property
    def left(self) -> str:
        """Remaining wall-clock time at the pace so far, in words. Before the first cycle ends, the planned time."""
        took = monotonic() - self._began
        return duration(sum(self._left.values()) * (took / self._passed if self._passed > 0.0 else 1.0))

    def cycle(self, cycle: Cycle) -> None:
        """Show that a cycle begins, or another attempt at it."""
        self.key, self.samples = cycle.key, 0

    def part(self, samples: Samples) -> None:
        """Show samples that have arrived; this is called on the thread of the rig."""
        self.samples += len(samples)

    def finished(self, cycle: Cycle, flags: dict[str, int]) -> None:
        """Show that a cycle is stored."""
        self._passed += self._left.pop(cycle.key, 0.0)

    def say(self, text: str) -> None:
        """Show a line."""

    def suspend(self) -> None:
        """Release the terminal for a prompt."""

    def go_on(self) -> None:
        """Use the terminal again after a prompt."""

    def ended(self) -> None:
        """Show that the campaign ends."""


class TerminalDisplay(Display):
    """A live table on a terminal: finished cycles, remaining time and the current cycle. Messages are printed above it.

    In a file or pipe, a line is written for each finished cycle and message.

    Parameters
    ----------
    console : rich.console.Console, optional
        Default: standard output.
    """

    def __init__(self, console: Any = None) -> None:  # noqa: ANN401 - rich is imported on use
        from rich.console import Console

        self._is_screen = sys.stdout.isatty() if console is None else console.is_terminal
        self._console = console or Console(file=sys.stdout, highlight=False)  # even if redirected later
        self._live: Any = None

    def began(self, plan: Plan, done: Collection[str]) -> None:
        """Show that the campaign begins."""
        super().began(plan, done)
        self.go_on()
        if not self._is_screen:
            to_do = f"{self.total - self.count} of {self.total} cycles to do" if done else f"{self.total} cycles"
            self.say(f"{self.title}: {to_do}, {self.left} on the rig")

    def finished(self, cycle: Cycle, flags: dict[str, int]) -> None:
        """Show that a cycle is stored."""
        super().finished(cycle, flags)
        flagged = counted(flags)
        if not self._is_screen:
            end = f"  flags: {flagged}" if flagged else ""
            self.say(f"{self.count}/{self.total} {cycle.key}  {self.left} left{end}")
        elif flagged:
            self.say(f"{cycle.key}: {flagged}")

    def say(self, text: str) -> None:
        """Show a line."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)

    def suspend(self) -> None:
        """Release the terminal for a prompt."""
        if self._live is not None:
            self._live.transient = True
        self.ended()

    def go_on(self) -> None:
        """Use the terminal again after a prompt."""
        from rich.live import Live

        if self._is_screen and self._live is None:
            options = {"refresh_per_second": REFRESHED_HZ, "redirect_stdout": False, "redirect_stderr": False}
            self._live = Live(get_renderable=self._table, console=self._console, **options)
            self._live.start()

    def ended(self) -> None:
        """End the display; its last state stays visible."""
        if self._live is not None:
            live, self._live = self._live, None
            live.stop()

    def _table(self) -> Any:  # noqa: ANN401 - of rich
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        table = Table.grid(padding=(0, 2))
        table.add_row(Text(self.title), ProgressBar(total=self.total, completed=self.count, width=40))
        table.add_row("cycles", f"{self.count}/{self.total}, {self.left} left")
        table.add_row("now", Text(f"{self.key}, {self.samples} samples" if self.key else ""))
        return table


COLUMNS = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
_FORCE = COLUMNS.index("force_n")
EVERY_S = 0.2
#: Largest number of points of the current cycle that are kept for its curve.
SHOWN = 4000


class LiveFiles(Display):
    """Display of a running campaign that writes its progress to a file.

    Parameters
    ----------
    folder : Path
        Folder of the campaign, which contains the folder ``control``.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._write_on, daemon=True)
        self._points = np.zeros((0, len(COLUMNS)), dtype=np.float32)

    def began(self, plan: Plan, done: Collection[str]) -> None:
        """Begin to write."""
        super().began(plan, done)
        self._thread.start()

    def cycle(self, cycle: Cycle) -> None:
        """Begin the data of a new cycle."""
        super().cycle(cycle)
        self._points = self._points[:0]

    def part(self, samples: Samples) -> None:
        """Add samples that arrived."""
        rows = np.column_stack([getattr(samples, name) for name in COLUMNS]).astype(np.float32)
        points = np.concatenate([self._points, rows])
        self._points = thinned(points, SHOWN) if len(points) > 2 * SHOWN else points
        super().part(samples)

    def ended(self) -> None:
        """End the writing, and remove the file."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()
        with suppress(OSError):
            (self._folder / LIVE).unlink()

    def _write_on(self) -> None:
        written: Plain = {}
        while not self._end.wait(EVERY_S):
            about = {"cycle": self.key, "samples": self.samples}
            if self.key and about != written:
                written, file = about, BytesIO()
                np.savez(file, about=json.dumps(about | {"left": self.left}), points=thinned(self._points, SHOWN))
                with suppress(CampaignError):  # a disk that is full tells the campaign itself
                    write_whole(self._folder / LIVE, file.getvalue(), flush=False)


def thinned(points: Points, most: int) -> Points:
    """Return at most `most` rows in order: those of lowest and highest force in intervals of equal length.

    Parameters
    ----------
    points : ndarray, shape (n, len(COLUMNS))
    most : int
        Largest number of rows, even.
    """
    count = len(points)
    if count <= most:
        return points
    stretch, force = -(-count // (most // 2)), points[:, _FORCE]
    # The first row of each interval in the order of the force; missing forces come last.
    interval = np.arange(count) // stretch
    chosen = [np.lexsort((way * force, interval))[::stretch] for way in (1, -1)]
    return points[np.unique(chosen)]


def read_live(folder: Path) -> tuple[Plain, Columns] | None:
    """Read the file of the running cycle of a campaign. Return None if it is missing or damaged.

    Returns
    -------
    dict, dict of ndarray
        Key of the ``cycle``, remaining wall-clock time ``left`` in words, and number of ``samples`` so far. Then an
        array of shape (n,) for each of `COLUMNS`.
    """
    damaged = (EOFError, KeyError, NotImplementedError, TypeError, ValueError, BadZipFile, zlib.error)
    with suppress(CampaignError, *damaged), np.load(BytesIO(read_bytes(folder / FOLDER / LIVE, CampaignError))) as file:
        about = json.loads(str(file["about"]))
        points: Columns = dict(zip(COLUMNS, file["points"].T, strict=True))
        return {key: about[key] for key in ("cycle", "left", "samples")}, points
    return None
