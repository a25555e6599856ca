"""One attempt at a cycle, from the present position of the axis to the samples, on the rig's thread."""

from __future__ import annotations

import json
import threading
from concurrent.futures import Future, wait
from typing import TYPE_CHECKING, Any, cast

from pneudrive.campaign.cycle import Head
from pneudrive.campaign.storage.control import now
from pneudrive.errors import PneudriveError, RigError
from pneudrive.rig.interface import Changeable, Reproducible, Samples, closed_after, has_verbs, plain
from pneudrive.rig.job_thread import JobThread

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.rig.interface import Rig


#: Longest time for a rig to come to rest before the campaign ends without it, s.
STOP_S = 30.0


def _call_within(seconds: float, call: Callable[[], None]) -> str:
    """Call a function with a time limit; return its error, if any."""
    thread = JobThread("pneudrive-stop")
    answer = thread.start(call)
    thread.close()
    try:
        answer.result(seconds)
    except Exception as error:  # no error of a laboratory's code may stop this
        silent = f"the rig did not answer within {seconds:g} s"
        return (str(error) or type(error).__name__) if answer.done() else silent
    return ""


#: Distance from the start of a cycle within which the axis stays: a shorter move would disturb the seal.
AT_START_M = 1e-4
#: Highest speed to the start of a cycle, m/s; lower on a slower rig.
TO_START_M_S = 0.05


class GivenUpError(Exception):
    """Error: the cycle was abandoned, with the reason in the message."""


class Attempts:
    """Attempts at cycles, and the state of the rig between two cycles.

    The rig's verbs run on one thread, one job after the other. Other threads may call `Rig.stop` only, at any time.

    Parameters
    ----------
    rig : Rig
    watch : callable
        Called with samples and rig; returns why the cycle must be given up, or an empty text.
    show : callable
        Called with each part of the samples.
    """

    def __init__(self, rig: Rig, watch: Callable[[Samples, Rig], str], show: Callable[[Samples], None]) -> None:
        self.rig, self._watch, self._show = rig, watch, show
        self._interrupted, self._at_rest = threading.Event(), False  # whether the present job must end soon
        self._thread = JobThread("pneudrive-rig")
        self._last: Future[Any] = self._thread.start(lambda: None)
        self._begun: dict[str, int] = {}
        self._memory: dict[str, Any] = {}  # snapshot after the last finished cycle, or before the first one
        self._pressures_after: tuple[float, float] | None = None  # after the last finished cycle
        self._pressures: tuple[float, float] | None = None  # in the chambers now, if known
        self._homed = self._whole = False  # whether the axis is homed; whether the last cycle was completed

    def start(self, job: Callable[[Rig], Any], *, moves: bool = True) -> Future[Any]:
        """Run a job on the rig's thread after the previous one.

        Parameters
        ----------
        job : callable
            Takes the rig.
        moves : bool
            Whether the axis may move, or the pressure change.
        """
        self._interrupted.clear()
        self._at_rest = self._at_rest and not moves
        self._last = self._thread.start(lambda: job(self.rig))
        return self._last

    def rest(self) -> str:
        """Bring the axis to rest and release the pressure immediately.

        Returns
        -------
        str
            Why the rig may not be at rest, in words; empty if it is at rest.
        """
        trouble = "" if self._at_rest else self._stop()
        self._at_rest = not trouble
        self._pressures = None
        self._homed = self._homed and self._whole
        return trouble

    def _stop(self) -> str:
        self._interrupted.set()
        trouble = _call_within(STOP_S, self.rig.stop)
        if self._last.done():
            return trouble
        wait([self._last], STOP_S)
        if not self._last.done():
            return trouble or f"the rig did not return within {STOP_S:g} s"
        return _call_within(STOP_S, self.rig.stop)  # a verb under way may have started the axis again

    def close(self) -> None:
        """End the rig's thread after its work."""
        self._thread.close()

    def run(self, rig: Rig, cycle: Cycle, settling_s: float) -> tuple[Head, Samples, dict[str, Any]]:
        """Bring the rig to the start of a cycle, run its steps and return head, samples, and truth of a simulated rig.

        For an operator's step, inform the rig about the change. Index and flags of the head are filled in later.

        Raises
        ------
        GivenUpError
            If samples or the state of the rig are out of bounds, or the axis was stopped.
        """
        self._whole, started = False, now()
        self._begun[cycle.key] = self._begun.get(cycle.key, 0) + 1
        self._go_to_start(rig, cycle)
        if cycle.steps:
            self._set_pressures(rig, cycle, settling_s)
            began_s = rig.state().time_s
            samples = self._acquire(rig, cycle)
        else:
            factor = cycle.key.rpartition("/")[2]  # b2/operator/seal: other factors stay unchanged
            if has_verbs(rig, Changeable) and factor in cycle.levels:
                cast("Changeable", rig).change({factor: cycle.levels[factor]})
            began_s, samples = rig.state().time_s, Samples.join([])
        memory, truth = {}, {}
        if has_verbs(rig, Reproducible):
            remembering = cast("Reproducible", rig)
            memory, truth = as_plain(remembering.memory()), remembering.truth()
        self._whole = True
        return Head(0, cycle, began_s, started, memory=memory, attempts=self._begun[cycle.key]), samples, truth

    def _go_to_start(self, rig: Rig, cycle: Cycle) -> None:
        if not self._homed:
            rig.home()
            self._homed = True
        if has_verbs(rig, Reproducible):
            remembering = cast("Reproducible", rig)
            self._memory = self._memory or as_plain(remembering.memory())
            remembering.restore(as_plain(self._memory))
            self._pressures = self._pressures_after
            remembering.begin_cycle(cycle.key)
        if cycle.start_m is not None and abs(rig.state().position_m - cycle.start_m) > AT_START_M:
            rig.move(cycle.start_m, min(TO_START_M_S, rig.limits().speed_m_s))

    def _set_pressures(self, rig: Rig, cycle: Cycle, settling_s: float) -> None:
        """Set the chambers to the pressures of a cycle; let them settle after a change."""
        wanted = (cycle.pressure_a_pa, cycle.pressure_b_pa)
        rig.set_pressure(*wanted)
        if settling_s > 0.0 and wanted != self._pressures:
            rig.hold(settling_s)
        self._pressures = wanted

    def _acquire(self, rig: Rig, cycle: Cycle) -> Samples:
        parts: list[Samples] = []
        with closed_after(rig.acquire(cycle.steps, cycle.sampling)) as acquired:
            for given in acquired:
                parts.append(Samples.of(given))
                self._go_on()
                if wrong := self._watch(parts[-1], rig):
                    raise GivenUpError(wrong)
                self._show(parts[-1])
            self._go_on()  # the rig may have ended early on a request
        return Samples.join(parts)

    def _go_on(self) -> None:
        if self._interrupted.is_set():
            raise GivenUpError("the axis was stopped")

    def finished(self, head: Head) -> None:
        """Record a cycle as done, now or in an earlier run; the next cycle starts from its end."""
        self._memory = dict(head.memory)
        self._pressures_after = (head.cycle.pressure_a_pa, head.cycle.pressure_b_pa)

    def go_home_first(self) -> None:
        """Home the axis before the next cycle: its position may be lost."""
        self._homed = False


def as_plain(memory: dict[str, Any]) -> dict[str, Any]:
    """Return the snapshot after a conversion to JSON and back, so that a resumed campaign equals an uninterrupted one.

    Raises
    ------
    RigError
        If JSON cannot hold it.
    """
    try:
        return json.loads(json.dumps(memory, default=plain))
    except (TypeError, ValueError) as error:
        raise RigError(
            "the rig's memory cannot be stored", value=str(error), rule="plain data that JSON can hold"
        ) from None


def as_own_error(error: BaseException) -> PneudriveError:
    """Return an error of pneudrive unchanged. Wrap an error of a laboratory's code."""
    if isinstance(error, PneudriveError):
        return error
    frame, trace = "", error.__traceback__
    while trace is not None:
        frame, trace = f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}", trace.tb_next
    wrapped = RigError(f"the rig's own code failed: {type(error).__name__}: {error}", where=frame)
    wrapped.__cause__ = error
    return wrapped
