"""Displays of a running campaign: one live table, or plain lines."""

from __future__ import annotations

import sys
import threading
import time
from typing import TYPE_CHECKING, Any, TextIO, cast

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Collection

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.plan import Plan
    from pneudrive.campaign.storage.journal import Journal
    from pneudrive.rig.interface import Samples

REFRESHED_HZ = 5.0
LINES = 6  # of the latest messages


class Display:
    """The display of a running campaign; this base class shows nothing."""

    def began(self, plan: Plan, done: Collection[str]) -> None:
        """Show that the campaign begins; `done` has the keys of the cycles that are finished already."""

    def cycle(self, cycle: Cycle) -> None:
        """Show that a cycle begins."""

    def part(self, samples: Samples) -> None:
        """Show samples that have arrived; this is called on the thread of the rig."""

    def finished(self, cycle: Cycle, flags: dict[str, int]) -> None:
        """Show that a cycle is stored."""

    def say(self, text: str) -> None:
        """Show a line."""

    def suspend(self) -> None:
        """Release the terminal for a prompt."""

    def go_on(self) -> None:
        """Use the terminal again after a prompt."""

    def ended(self) -> None:
        """Show that the campaign ends."""


class CampaignProgress:
    """Number of finished cycles, and remaining time at the pace so far.

    A real rig needs the planned time. For a simulated rig without a pace, the time depends on the number of samples.

    Parameters
    ----------
    plan : Plan
    done : collection of str
        Keys of the cycles that were finished before this run.
    """

    def __init__(self, plan: Plan, done: Collection[str]) -> None:
        self._done = set(done)
        self._planned = {p.cycle.key: (p.time_s, float(p.samples)) for p in plan.planned}
        self.total = len(self._done | self._planned.keys())
        self._began, self._passed = time.monotonic(), np.zeros(2)

    @property
    def count(self) -> int:
        """Number of finished cycles."""
        return len(self._done)

    def finished(self, key: str) -> None:
        """Count a cycle as done."""
        self._passed += self._planned.get(key, (0.0, 0.0))
        self._done.add(key)

    @property
    def left(self) -> str:
        """Remaining wall-clock time, in words."""
        left = np.sum([size for key, size in self._planned.items() if key not in self._done] or [(0.0, 0.0)], axis=0)
        took = time.monotonic() - self._began
        if self._passed[0] <= 0.0:
            return duration(float(left[0]))
        in_virtual_time = took < 0.5 * self._passed[0] and self._passed[1] > 0.0
        return duration(
            float(left[1] * took / self._passed[1] if in_virtual_time else left[0] * took / self._passed[0])
        )


def guarded(journal: Journal, *displays: Display) -> Display:
    """Return several displays as one. Their errors are logged in the journal and do not end the campaign."""

    def show(each: Any, *arguments: Any) -> None:  # noqa: ANN401
        try:
            each(*arguments)
        except Exception as error:  # the terminal is gone, or a user's display is wrong
            journal.write(f"the display failed: {type(error).__name__}: {error}")

    class Guarded:
        def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever a display has
            found = [getattr(display, name) for display in displays]

            def call(*arguments: Any) -> None:  # noqa: ANN401
                for each in found:
                    show(each, *arguments)

            return call

    return cast("Display", Guarded())


class LineDisplay(Display):
    """One line per finished cycle, for files and pipes.

    Parameters
    ----------
    out : text stream, optional
        Default: standard output.
    """

    def __init__(self, out: TextIO | None = None) -> None:
        self._out = out or sys.stdout

    def began(self, plan: Plan, done: Collection[str]) -> None:
        """Show that the campaign begins."""
        self._progress = progress = CampaignProgress(plan, done)
        to_do = f"{progress.total - progress.count} of {progress.total} cycles to do"
        count = to_do if done else f"{progress.total} cycles"
        self.say(f"{plan.protocol.name}: {count}, {progress.left} on the rig")

    def finished(self, cycle: Cycle, flags: dict[str, int]) -> None:
        """Show that a cycle is stored."""
        progress = self._progress
        progress.finished(cycle.key)
        flagged = f"  flags: {', '.join(flags)}" if flags else ""
        self.say(f"{progress.count}/{progress.total} {cycle.key}  {progress.left} left{flagged}")

    def say(self, text: str) -> None:
        """Write a line."""
        self._out.write(text + "\n")
        self._out.flush()


class ScreenDisplay(Display):
    """A live table on a terminal: finished cycles, remaining time, the current cycle, the latest messages.

    Parameters
    ----------
    console : rich.console.Console, optional
        Default: the terminal.
    """

    def __init__(self, console: Any = None) -> None:  # noqa: ANN401 - rich is imported on use
        from rich.console import Console

        self._console = console or Console(file=sys.stdout, highlight=False)  # even if redirected later
        self._lock = threading.Lock()
        self._live: Any = None
        self._title = self._cycle = ""
        self._messages: list[str] = []
        self._samples = 0

    def began(self, plan: Plan, done: Collection[str]) -> None:
        """Show that the campaign begins."""
        self._progress, self._title = CampaignProgress(plan, done), plan.protocol.name
        self.go_on()

    def cycle(self, cycle: Cycle) -> None:
        """Show that a cycle begins."""
        with self._lock:
            self._cycle, self._samples = cycle.key, 0

    def part(self, samples: Samples) -> None:
        """Count samples that arrived."""
        with self._lock:
            self._samples += len(samples)

    def finished(self, cycle: Cycle, flags: dict[str, int]) -> None:
        """Show that a cycle is stored."""
        self._progress.finished(cycle.key)
        if flags:
            self.say(f"{cycle.key}: {', '.join(f'{flag} {count}' for flag, count in flags.items())}")

    def say(self, text: str) -> None:
        """Show a line."""
        with self._lock:
            self._messages = [*self._messages, text][-LINES:]
        if self._live is None:
            self._console.print(text, markup=False)

    def suspend(self) -> None:
        """Release the terminal for a prompt."""
        self._stop(keep=False)

    def _stop(self, *, keep: bool) -> None:
        if self._live is not None:
            live, self._live = self._live, None
            live.transient = not keep
            live.stop()

    def go_on(self) -> None:
        """Use the terminal again after a prompt."""
        from rich.live import Live

        with self._lock:
            self._messages = []
        if self._live is None:
            self._live = Live(
                get_renderable=self._table,
                console=self._console,
                refresh_per_second=REFRESHED_HZ,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            self._live.start()

    def ended(self) -> None:
        """End the display; its last state stays visible."""
        self._stop(keep=True)

    def _table(self) -> Any:  # noqa: ANN401 - of rich
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        progress = self._progress
        table = Table.grid(padding=(0, 2))
        with self._lock:
            table.add_row(Text(self._title), ProgressBar(total=progress.total, completed=progress.count, width=40))
            table.add_row("cycles", f"{progress.count}/{progress.total}, {progress.left} left")
            table.add_row("now", Text(f"{self._cycle}, {self._samples} samples" if self._cycle else ""))
            for message in self._messages:
                table.add_row("", Text(message))
        return table


def duration(seconds: float) -> str:
    """Return a duration in everyday words.

    Examples
    --------
    >>> duration(4.2), duration(190), duration(7300), duration(200_000)
    ('4 s', '3 min 10 s', '2 h 1 min', '2 d 7 h')
    """
    whole = round(seconds)
    for name, size, below, part in (("d", 86400, "h", 3600), ("h", 3600, "min", 60), ("min", 60, "s", 1)):
        if whole >= size:
            return f"{whole // size} {name} {whole % size // part} {below}"
    return f"{whole} s"
