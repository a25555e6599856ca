"""What is done on a served rig: its verbs in one thread, stopping it in another, so that neither keeps the other."""

from __future__ import annotations

import contextlib
import json
import logging
import queue
import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from pneudrive.errors import PneudriveError, RigError
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Hold, Move, Samples
from pneudrive.rig.opcua.nodes import NodeMap, Verb
from pneudrive.rig.opcua.program import check_size, first_step, program_of, sampling_of, simulated_argument
from pneudrive.rig.opcua.space import SIMULATED

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.rig.interface import Rig
    from pneudrive.rig.opcua.session import Client

log = logging.getLogger(__name__)
STOPPING_S = 10.0  # how long a rig that runs on is told to stop again
AGAIN_S = 0.1
GENTLE_S = 0.2  # how long an acquisition that is halted has to end by itself
CLOSING_S = 2.0
SAMPLE_FIELDS = {
    "time": "time_s",
    "position": "position_m",
    "force": "force_n",
    "pressure_a": "pressure_a_pa",
    "pressure_b": "pressure_b_pa",
    "temperature": "temperature_k",
    "step": "step",
}


@dataclass(frozen=True)
class Command:
    """What a client asks for."""

    client: Client
    identity: int
    verb: int
    arguments: dict[str, Any]


class Interrupted(Exception):  # noqa: N818 - no error: halt, stop or a silent client
    """What runs is to end now."""


class Told(Protocol):
    """Who is told what has become of commands; each call waits until it is taken note of."""

    def show(self, values: dict[str, Any], slot: int = 0, client: Client | None = None) -> None:
        """Show values, to all or to one client."""
        ...

    def ended(self, command: Command, fault: str) -> None:
        """Take note that a verb has ended."""
        ...

    def stopped(self, gently: bool, fault: str) -> None:
        """Take note that the axis is at rest."""
        ...


class Worker:
    """Two threads that call the rig.

    Parameters
    ----------
    rig : Rig
    nodes : NodeMap
    told : Told
    heartbeat_s : float
        How long it sleeps at most while nobody takes samples.
    """

    def __init__(self, rig: Rig, nodes: NodeMap, told: Told, heartbeat_s: float) -> None:
        self.rig, self._nodes, self._told, self._heartbeat_s = rig, nodes, told, heartbeat_s
        low, high = rig.limits().position_m
        self._longest_m = high - low
        self.interrupted = ""  # why what was taken is to end
        self._commands: queue.SimpleQueue[Command | None] = queue.SimpleQueue()
        self._stops: queue.SimpleQueue[bool | None] = queue.SimpleQueue()
        self._threads = [
            threading.Thread(target=work, name=name, daemon=True)
            for work, name in ((self._work, "rig"), (self._stop_when_asked, "stop"))
        ]
        self._turn = 0  # of the verb that runs
        self._idle = threading.Event()  # no verb of the rig runs
        self._idle.set()
        self._taken = threading.Condition()  # tells that the ring has room, or that what runs is to end
        self._written = self._acknowledged = 0

    def start(self) -> None:
        """Begin to do what is asked."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Bring the axis to rest and end, as far as the rig lets us."""
        self.interrupt("the server ends")
        self._stops.put(False)
        self._stops.put(None)
        self._commands.put(None)
        for thread in self._threads:
            thread.join(CLOSING_S)

    def begin(self, command: Command) -> None:
        """Do this next."""
        with self._taken:
            self.interrupted = ""
        self._commands.put(command)

    def interrupt(self, why: str) -> None:
        """End what runs, or is about to."""
        with self._taken:
            self.interrupted = why
            self._taken.notify_all()

    def stop(self, gently: bool) -> None:
        """Bring the axis to rest; gently: what runs ends by itself, if it does so soon, and the pressures stay."""
        self._stops.put(gently)

    def acknowledge(self, count: int) -> None:
        """Take note of how many chunks of samples were read."""
        with self._taken:
            self._acknowledged = min(count, self._written)
            self._taken.notify_all()

    # --- the thread that stops ---------------------------------------------------------------

    def _stop_when_asked(self) -> None:
        """Stop the rig, which may block; again where a verb had been about to begin, or runs on."""
        turn, until = 0, 0.0
        while True:
            watches = not self._idle.is_set() and turn == self._turn and time.monotonic() < until
            try:
                gently = self._stops.get(timeout=AGAIN_S if watches else None)
            except queue.Empty:
                with contextlib.suppress(Exception):  # which was told when it was stopped first
                    if not self._idle.is_set() and turn == self._turn:
                        self.rig.stop()
                continue
            if gently is None:
                return
            turn, until = self._turn, time.monotonic() + STOPPING_S
            fault = self._bring_to_rest(gently)
            with contextlib.suppress(RuntimeError):  # the server is closed
                self._told.stopped(gently, fault)

    def _bring_to_rest(self, gently: bool) -> str:
        try:
            if not (gently and self._idle.wait(GENTLE_S)):
                self.rig.stop()
                if not self._idle.wait(AGAIN_S):
                    self.rig.stop()
        except Exception as error:
            log.exception("the rig does not stop")
            return f"the rig does not stop: {error}"
        return ""

    # --- the thread of verbs -----------------------------------------------------------------

    def _work(self) -> None:
        """Run commands one after the other."""
        while (command := self._commands.get()) is not None:
            with self._taken:
                self._turn += 1
                self._idle.clear()
                fault = self.interrupted  # by a stop that came before we did
            if not fault:
                fault = self._run(command)
            self._idle.set()
            with contextlib.suppress(RuntimeError):  # the server is closed
                self._told.ended(command, fault)

    def _run(self, command: Command) -> str:
        """Run one command; give its fault, empty where there is none."""
        try:
            self._verbs().get(command.verb, self._unknown)(command)
        except Interrupted:
            return self.interrupted
        except Exception as error:
            if self.interrupted:  # which is why the rig has ended it
                return self.interrupted
            if isinstance(error, PneudriveError):
                return str(error)
            log.exception("a verb of the rig failed")
            return f"{type(error).__name__}: {error}"
        return ""

    def _verbs(self) -> dict[int, Callable[[Command], object]]:
        rig: Any = self.rig
        known: dict[int, Callable[[Command], object]] = {
            Verb.HOME: lambda _: rig.home(),
            Verb.MOVE: lambda c: rig.move(*_move(first_step(c.arguments, Move, self._longest_m))),
            Verb.HOLD: lambda c: rig.hold(*_hold(first_step(c.arguments, Hold, self._longest_m))),
            Verb.SET_PRESSURE: lambda c: rig.set_pressure(
                c.arguments["command.pressure_a"], c.arguments["command.pressure_b"]
            ),
            Verb.ACQUIRE: self._acquire,
        }
        for verb, ability in SIMULATED.items():
            if isinstance(rig, ability) and "simulation.answer" in self._nodes:
                known[verb] = lambda c, verb=verb: self._simulate(verb, c)
        return known

    def _unknown(self, command: Command) -> None:
        raise RigError(f"verb {command.verb} is not known to this rig")

    def _simulate(self, verb: Verb, command: Command) -> None:
        method = getattr(self.rig, verb.name.lower())
        text = command.arguments["simulation.text"]
        answer = method(*simulated_argument(verb, parse_json(text or "null", "simulation.text", RigError)))
        self._told.show({"simulation.answer": json.dumps(answer)}, client=command.client)

    def _acquire(self, command: Command) -> None:
        """Run the program and put its samples into the ring."""
        steps, sampling = program_of(command.arguments, self._longest_m), sampling_of(command.arguments)
        check_size(steps, sampling)
        parts = self.rig.acquire(steps, sampling)
        try:
            for given in parts:
                part = Samples.of(given)
                for start in range(0, len(part), self._nodes.chunk):
                    self._put(part.rows(slice(start, start + self._nodes.chunk)))
        finally:
            close = getattr(parts, "close", None)  # of a generator: come to rest now
            if close is not None:
                close()

    def _put(self, chunk: Samples) -> None:
        """Wait for a free slot and write it."""
        with self._taken:
            while self._written - self._acknowledged >= self._nodes.slots and not self.interrupted:
                self._taken.wait(self._heartbeat_s)
        if self.interrupted:
            raise Interrupted
        self._written += 1
        values = {f"samples.{name}": getattr(chunk, field) for name, field in SAMPLE_FIELDS.items()}
        slot = self._nodes.slot_of(self._written)
        self._told.show({**values, "samples.count": len(chunk), "samples.sequence": self._written}, slot)
        self._told.show({"samples.written": self._written})


def _move(step: Move) -> tuple[float, float]:
    return step.to_m, step.speed_m_s


def _hold(step: Hold) -> tuple[float, bool]:
    return step.duration_s, step.released
