"""A rig as devices of bluesky: thin wrappers around its verbs, each of which runs on the rig's own thread."""

from __future__ import annotations

import asyncio
import json
import queue
import threading
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from pneudrive.campaign.head import plain
from pneudrive.campaign.lock import now
from pneudrive.errors import PneudriveError, RigError
from pneudrive.rig.interface import CHANNELS, Changeable, Reproducible, Samples

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.rig.interface import Rig

P = TypeVar("P")

#: How long a rig may take to come to rest before the campaign ends without it, s.
STOP_S = 30.0
#: The axis counts as standing at the start of a cycle within this distance; nearer moves would disturb the seal.
AT_START_M = 1e-4
#: Speed to the start of a cycle where the axis is not there yet, m/s; less where the rig is slower.
TO_START_M_S = 0.05


class Finished:
    """A status of bluesky that always succeeds: what went wrong stands in the device's `outcome`."""

    def __init__(self) -> None:
        self._done = threading.Event()
        self._callbacks: list[Callable[[Finished], None]] = []
        self._lock = threading.Lock()

    def finish(self) -> None:
        """Mark it as done."""
        with self._lock:
            self._done.set()
            callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)

    def add_callback(self, callback: Callable[[Finished], None]) -> None:
        """Call back when it is done, or now."""
        with self._lock:
            if not self._done.is_set():
                self._callbacks.append(callback)
                return
        callback(self)

    def exception(self, timeout: float | None = 0.0) -> BaseException | None:
        """Give no exception, ever."""
        self._done.wait(timeout)
        return None

    @property
    def done(self) -> bool:
        """Whether it is done."""
        return self._done.is_set()

    @property
    def success(self) -> bool:
        """Whether it is done; it cannot fail."""
        return self.done


@dataclass
class Outcome:
    """What became of one attempt at a cycle.

    Attributes
    ----------
    samples : Samples or None
        None where the cycle was not finished.
    began_s : float
        The rig's clock at time zero.
    started : str
        Date and time of the computer.
    memory, truth : dict
        Of a reproducible rig, after the cycle.
    error : Exception or None
        What the rig raised.
    out_of_bounds : str
        Why the cycle was given up, in words.
    """

    samples: Samples | None = None
    began_s: float = 0.0
    started: str = ""
    memory: dict[str, Any] = field(default_factory=dict)
    truth: dict[str, Any] = field(default_factory=dict)
    error: Exception | None = None
    out_of_bounds: str = ""


class _InterruptedError(Exception):
    """The cycle was given up on request."""


class RigThread:
    """The one thread that a rig is used from, so that a lab's own code need not be safe for several.

    Only `Rig.stop` is called from others too: at any time.

    Parameters
    ----------
    rig : Rig
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.interrupt = threading.Event()
        self.idle = threading.Event()
        self.idle.set()
        self.at_rest = False
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._rest_lock = threading.Lock()
        threading.Thread(target=self._work, name="pneudrive-rig", daemon=True).start()

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()

    def start(self, job: Callable[[], None], *, moves: bool = True) -> Finished:
        """Run a job, which keeps its own troubles, and give a status that ends with it.

        Parameters
        ----------
        job : callable
        moves : bool
            Whether the rig may not be at rest after it.
        """
        status = Finished()
        self.interrupt.clear()
        self.idle.clear()
        self.at_rest = self.at_rest and not moves

        def run() -> None:
            try:
                job()
            finally:
                self.idle.set()
                status.finish()

        self._jobs.put(run)
        return status

    def close(self) -> None:
        """End the thread when its work is done."""
        self._jobs.put(None)

    def rest(self) -> str:
        """Bring the axis to rest and release the pressure, whatever the thread is doing.

        Returns
        -------
        str
            Why the rig may not be at rest, in words; empty where it is.
        """
        with self._rest_lock:
            if self.at_rest:
                return ""
            self.interrupt.set()
            trouble = _within(STOP_S, self.rig.stop)
            if not self.idle.is_set():
                if not self.idle.wait(STOP_S):
                    return trouble or f"the rig has not come back within {STOP_S:g} s"
                trouble = _within(STOP_S, self.rig.stop)  # what was on its way may have started the axis again
            self.at_rest = not trouble
            return trouble


def _within(seconds: float, call: Callable[[], None]) -> str:
    """Call, but do not wait for ever; say what went wrong."""
    trouble = [f"the rig has not answered within {seconds:g} s"]

    def run() -> None:
        try:
            call()
            trouble[0] = ""
        except Exception as error:  # whatever a lab's own code raises: it must not keep us from going on
            trouble[0] = str(error) or type(error).__name__

    thread = threading.Thread(target=run, name="pneudrive-stop", daemon=True)
    thread.start()
    thread.join(seconds)
    return trouble[0]


class Chambers:
    """The pressures of both chambers."""

    name, parent = "chambers", None

    def __init__(self, thread: RigThread, axis: Axis) -> None:
        self._thread, self._axis = thread, axis

    def set(self, cycle: Cycle, settling_s: float) -> Finished:
        """Bring the rig to where a cycle begins: axis, noise, pressures; settle where the pressures are new."""
        return self._thread.start(lambda: self._axis.keep(lambda: self._set(cycle, settling_s)))

    def _set(self, cycle: Cycle, settling_s: float) -> None:
        rig, axis = self._thread.rig, self._axis
        axis.begin(cycle)
        wanted = (cycle.pressure_a_pa, cycle.pressure_b_pa)
        rig.set_pressure(*wanted)
        if settling_s > 0.0 and wanted != axis.pressures_pa:
            rig.hold(settling_s)
        axis.pressures_pa = wanted

    async def stop(self, *, success: bool = True) -> None:
        """Come to rest: what bluesky calls on every pause and at every end."""
        await self._axis.stop(success=success)


class Conditions:
    """Whether measuring can go on.

    Parameters
    ----------
    thread : RigThread
    look : callable
        Rig -> what is wrong, in words, or an empty text.
    """

    name, parent = "conditions", None

    def __init__(self, thread: RigThread, look: Callable[[Rig], str]) -> None:
        self._thread, self._look = thread, look
        self.wrong = ""

    def trigger(self) -> Finished:
        """Look; what is found stands in `wrong`."""

        def job() -> None:
            self.wrong = self._look(self._thread.rig)

        self.wrong = "the rig has not said"
        return self._thread.start(job, moves=False)


class Axis:
    """The servo axis with all that is recorded while it moves.

    Parameters
    ----------
    thread : RigThread
    watch : callable
        Samples, rig -> why the cycle must be given up, in words, or an empty text.
    show : callable
        Takes each part of the samples as it comes.
    """

    name, parent = "axis", None

    def __init__(
        self, thread: RigThread, watch: Callable[[Samples, Rig], str], show: Callable[[Samples], None]
    ) -> None:
        self._thread, self._watch, self._show = thread, watch, show
        self.outcome = Outcome()
        self.attempts: dict[str, int] = {}
        self.past: dict[str, Any] = {}  # memory of the last finished cycle
        self.past_pressures_pa: tuple[float, float] | None = None
        self.pressures_pa: tuple[float, float] | None = None  # in the chambers now, where that is known
        self.trouble = ""  # why the rig may not be at rest
        self._initial: dict[str, Any] | None = None
        self._homed = self._whole = False  # whether the axis knows where it is; whether the last cycle came to its end

    @property
    def rig(self) -> Rig:
        """The rig."""
        return self._thread.rig

    def keep(self, job: Callable[[], None]) -> None:
        """Run a job and keep what it raises as the outcome; later jobs of an attempt that failed do nothing."""
        try:
            job()
        except _InterruptedError:
            pass
        except Exception as error:  # whatever a lab's own code raises
            self.outcome.error = error

    def begin(self, cycle: Cycle) -> None:
        """Bring axis and memory to where a cycle begins."""
        self.outcome, self._whole = Outcome(started=now()), False
        self.attempts[cycle.key] = self.attempts.get(cycle.key, 0) + 1
        rig = self.rig
        if not self._homed:
            rig.home()
            self._homed = True
        remembering = _as(rig, Reproducible)
        if remembering is not None:
            if self._initial is None:
                self._initial = as_plain(remembering.memory())
            remembering.restore(as_plain(self.past or self._initial))
            self.pressures_pa = self.past_pressures_pa
            remembering.begin_cycle(cycle.key)
        if cycle.start_m is not None and abs(rig.state().position_m - cycle.start_m) > AT_START_M:
            rig.move(cycle.start_m, min(TO_START_M_S, rig.limits().speed_m_s))

    def set(self, cycle: Cycle) -> Finished:
        """Run the steps of a cycle and keep its samples; without steps, tell the rig what the operator has changed."""

        def job() -> None:
            if not cycle.steps:
                self.begin(cycle)
                changeable = _as(self.rig, Changeable)
                factor = cycle.key.rpartition("/")[2]  # b2/operator/seal: the others stay as they are
                if changeable is not None and factor in cycle.levels:
                    changeable.change({factor: cycle.levels[factor]})
                self._finish(_empty(), self.rig.state().time_s)
            elif self.outcome.error is None:
                self._acquire(cycle)

        return self._thread.start(lambda: self.keep(job))

    def _acquire(self, cycle: Cycle) -> None:
        began_s = self.rig.state().time_s
        parts: list[Samples] = []
        iterator = self.rig.acquire(cycle.steps, cycle.sampling)
        try:
            for given in iterator:
                part = as_samples(given)
                parts.append(part)
                if self._thread.interrupt.is_set():
                    raise _InterruptedError
                self.outcome.out_of_bounds = self._watch(part, self.rig)
                if self.outcome.out_of_bounds:
                    raise _InterruptedError
                self._show(part)
            if self._thread.interrupt.is_set():  # the rig has ended early because it was told to
                raise _InterruptedError
        finally:
            close = getattr(iterator, "close", None)
            if close is not None:
                close()
        self._finish(Samples.join(parts) if parts else _empty(), began_s)

    def _finish(self, samples: Samples, began_s: float) -> None:
        outcome = self.outcome
        remembering = _as(self.rig, Reproducible)
        if remembering is not None:
            outcome.memory, outcome.truth = as_plain(remembering.memory()), remembering.truth()
        outcome.began_s, outcome.samples, self._whole = began_s, samples, True

    def finished(self, cycle: Cycle) -> None:
        """Take the cycle as done: the next one goes on from here."""
        self.past, self.past_pressures_pa = self.outcome.memory, (cycle.pressure_a_pa, cycle.pressure_b_pa)

    async def stop(self, *, success: bool = True) -> None:
        """Come to rest: what bluesky calls on every pause and at every end."""
        del success
        await asyncio.get_running_loop().run_in_executor(None, self.rest)

    def rest(self) -> str:
        """Come to rest; give what stands in the way, in words."""
        self.trouble = self._thread.rest()
        self.pressures_pa = None
        if not self._whole:
            self.go_home_first()
        return self.trouble

    def go_home_first(self) -> None:
        """Begin the next cycle at home: the axis may not know where it is."""
        self._homed = False


def _as(rig: object, protocol: type[P]) -> P | None:
    """Give the rig where it has all verbs of the protocol; a wrapper that passes them on has them too."""
    verbs = [name for name in vars(protocol) if not name.startswith("_")]
    return cast("P", rig) if all(hasattr(rig, name) for name in verbs) else None


def as_plain(memory: dict[str, Any]) -> dict[str, Any]:
    """Give the memory as a file gives it back, so that going on at once and going on later are the same.

    Raises
    ------
    RigError
        If JSON cannot hold it.
    """
    try:
        return json.loads(json.dumps(memory, default=plain))
    except (TypeError, ValueError) as error:
        raise RigError(
            "the rig's memory cannot be kept", value=str(error), rule="plain data that JSON can hold"
        ) from None


def as_samples(given: Any) -> Samples:  # noqa: ANN401 - whatever a lab's own code yields
    """Bring samples to float64 and refuse what are none.

    Raises
    ------
    RigError
        A channel is missing or of another length.
    """
    try:
        channels = {name: np.array(getattr(given, name), dtype=np.float64) for name in CHANNELS}
        step = np.array(given.step, dtype=np.int64)
    except (AttributeError, TypeError, ValueError) as error:
        raise RigError("the rig gave something else than samples", value=str(error), rule="see Samples") from None
    lengths = {name: values.shape for name, values in (channels | {"step": step}).items()}
    if len(set(lengths.values())) != 1 or step.ndim != 1:
        raise RigError("the rig gave channels of different lengths", value=str(lengths), rule="one length for all")
    return Samples(**channels, step=step)


def _empty() -> Samples:
    return Samples(**dict.fromkeys(CHANNELS, np.zeros(0)), step=np.zeros(0, dtype=np.int64))


def whats_wrong(error: Exception) -> PneudriveError:
    """Give an error of ours; what a lab's own code raised is wrapped."""
    if isinstance(error, PneudriveError):
        return error
    frame, trace = "", error.__traceback__
    while trace is not None:
        frame, trace = f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}", trace.tb_next
    wrapped = RigError(f"the rig's own code failed: {type(error).__name__}: {error}", where=frame)
    wrapped.__cause__ = error
    return wrapped
