"""Displays of a running campaign: remaining time, current cycle and growing map; or plain lines."""

from __future__ import annotations

import sys
import threading
import time
from typing import TYPE_CHECKING, Any, TextIO, cast

import numpy as np

from pneudrive.campaign.running.textplot import text_plot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.planning.adaptive import Finished
    from pneudrive.campaign.planning.plan import Plan
    from pneudrive.campaign.storage.journal import Journal
    from pneudrive.rig.interface import Samples

#: Points of the current cycle that are kept for its curve.
SHOWN = 4000
REFRESHED_HZ = 5.0
LINES = 6  # of the latest messages


class Display:
    """The display of a running campaign; this base class shows nothing.

    Attributes
    ----------
    wants_points : bool
        Whether preliminary estimates of the friction are requested.
    """

    wants_points = False

    def began(self, plan: Plan, finished: Sequence[Finished]) -> None:
        """Show that the campaign begins."""

    def cycle(self, cycle: Cycle, reason: str, done: int, planned: int) -> None:
        """Show that a cycle begins."""

    def part(self, samples: Samples) -> None:
        """Show samples that have arrived; this is called on the thread of the rig."""

    def finished(self, one: Finished) -> None:
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
    finished : sequence of Finished
        Finished before this run.
    """

    def __init__(self, plan: Plan, finished: Sequence[Finished]) -> None:
        self.count = len(finished)
        self._done = {one.cycle.key for one in finished}
        self._planned = {p.cycle.key: (p.time_s, float(p.samples)) for p in plan.planned}
        self._began, self._passed = time.monotonic(), np.zeros(2)

    def finished(self, one: Finished) -> None:
        """Count a cycle as done."""
        self.count += 1
        self._passed += self._planned.get(one.cycle.key, (0.0, 0.0))
        self._done.add(one.cycle.key)

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

            return call if callable(found[0]) else any(found)

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
        self._progress: CampaignProgress | None = None
        self._planned = 0

    def began(self, plan: Plan, finished: Sequence[Finished]) -> None:
        """Show that the campaign begins."""
        self._progress, self._planned = CampaignProgress(plan, finished), len(plan.planned)
        to_do = f"{self._planned - len(finished)} of {self._planned} cycles to do"
        left = to_do if finished else f"{self._planned} cycles"
        self.say(f"{plan.protocol.name}: {left}, {self._progress.left} on the rig")

    def cycle(self, cycle: Cycle, reason: str, done: int, planned: int) -> None:
        """Update the number of cycles."""
        self._planned = planned

    def finished(self, one: Finished) -> None:
        """Show that a cycle is stored."""
        assert self._progress is not None
        self._progress.finished(one)
        flags = f"  flags: {', '.join(one.flags)}" if one.flags else ""
        self.say(f"{self._progress.count}/{self._planned} {one.cycle.key}  {self._progress.left} left{flags}")

    def say(self, text: str) -> None:
        """Write a line."""
        self._out.write(text + "\n")
        self._out.flush()


class ScreenDisplay(Display):
    """A live display on a terminal.

    Parameters
    ----------
    console : rich.console.Console, optional
        Default: the terminal.
    """

    wants_points = True

    def __init__(self, console: Any = None) -> None:  # noqa: ANN401 - rich is imported on use
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
        from rich.progress import Progress as Bar

        self._console = console or Console(file=sys.stdout, highlight=False)  # even if redirected later
        self._bar = Bar(
            TextColumn("{task.description}", markup=False),  # a name may hold brackets
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[left]}"),
        )
        self._task = self._bar.add_task("campaign", total=None, left="")
        self._lock = threading.Lock()
        self._live: Any = None
        self._progress: CampaignProgress | None = None
        self._said: list[str] = []
        self._parts: list[Samples] = []
        self._map: dict[tuple[float, float], list[tuple[float, float]]] = {}
        self._cycle: Cycle | None = None

    def began(self, plan: Plan, finished: Sequence[Finished]) -> None:
        """Show that the campaign begins."""
        self._progress = CampaignProgress(plan, finished)
        self._range = plan.envelope.position_m
        self._bar.update(self._task, total=len(plan.planned), completed=len(finished), description=plan.protocol.name)
        for one in finished:
            self._add(one)
        self.go_on()

    def cycle(self, cycle: Cycle, reason: str, done: int, planned: int) -> None:
        """Show that a cycle begins."""
        with self._lock:
            self._cycle, self._parts = cycle, []
        self._bar.update(self._task, total=planned)
        if reason:
            self.say(f"{cycle.key} {reason}")

    def part(self, samples: Samples) -> None:
        """Add samples that arrived."""
        with self._lock:
            self._parts.append(samples)

    def finished(self, one: Finished) -> None:
        """Show that a cycle is stored."""
        assert self._progress is not None
        self._progress.finished(one)
        self._bar.update(self._task, completed=self._progress.count, left=f"{self._progress.left} left")
        self._add(one)
        if one.flags:
            self.say(f"{one.cycle.key}: {', '.join(f'{flag} {count}' for flag, count in one.flags.items())}")

    def _add(self, one: Finished) -> None:
        if one.cycle.kind == "sweep" and one.cycle.speed_m_s and np.isfinite(one.point.friction_n):
            pressures = (one.cycle.pressure_a_pa, one.cycle.pressure_b_pa)
            with self._lock:
                self._map.setdefault(pressures, []).append((1e3 * one.cycle.speed_m_s, one.point.friction_n))

    def say(self, text: str) -> None:
        """Show a line."""
        with self._lock:
            self._said = [*self._said, text][-LINES:]
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
            self._said = []
        if self._live is None:
            self._live = Live(
                get_renderable=self._picture,
                console=self._console,
                refresh_per_second=REFRESHED_HZ,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            self._live.start()

    def ended(self) -> None:
        """End the display; its last state stays visible."""
        self._stop(keep=True)

    def _picture(self) -> Any:  # noqa: ANN401 - of rich
        from rich.console import Group
        from rich.text import Text

        with self._lock:
            parts, cycle, said = list(self._parts), self._cycle, list(self._said)
            points = {pressures: list(values) for pressures, values in self._map.items()}
        width = max((self._console.width - 3) // 2, 24)
        height = max(min(14, self._console.height - LINES - 5), 5)
        left = [f"{'now: ' + cycle.key if cycle else '':<{width}}"[:width], *self._curve(parts, width, height)]
        right = [f"{len(points)} pair(s) of pressures so far", *self._speeds(points, width, height)]
        both = [f"{a:<{width}}   {b}" for a, b in zip(left, right, strict=True)]
        return Group(self._bar, Text("\n".join(both)), Text("\n".join(said)))

    def _curve(self, parts: list[Samples], width: int, height: int) -> list[str]:
        total = sum(map(len, parts))
        stride = max(total // SHOWN, 1)
        series = [(1e3 * part.position_m[::stride], part.force_n[::stride]) for part in parts]
        low, high = self._range
        return text_plot(series, width, height, x_label="mm", y_label="force, N,", x_range=(1e3 * low, 1e3 * high))

    @staticmethod
    def _speeds(points: dict[tuple[float, float], list[tuple[float, float]]], width: int, height: int) -> list[str]:
        series = [tuple(zip(*values, strict=True)) for values in points.values() if values]
        return text_plot(series, width, height, x_label="mm/s", y_label="friction, N,", log_x=True, joined=True)  # type: ignore[arg-type]


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
