"""A rig behind OPC UA, as a campaign drives it: a PLC with servo drive, or a simulated rig that is served."""

from __future__ import annotations

import contextlib
import json
import secrets
import threading
import time
import weakref
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

import numpy as np

from pneudrive.describe.base import Bounds, Quantity, WrongValueError
from pneudrive.describe.marks import Reads
from pneudrive.errors import ConnectionLostError, RigError
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Envelope, Hold, Identity, Move, RigState, Samples, Sampling, Step
from pneudrive.rig.opcua.access import Access, AccessFile
from pneudrive.rig.opcua.link import COUNTER, HungUpError, Link, LinkError
from pneudrive.rig.opcua.nodes import NodeMap, Verb, load_map
from pneudrive.rig.opcua.program import SAMPLES, SAMPLING, STATE, steps_as_arrays
from pneudrive.rig.plain_data import envelope_of, identity_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

SCHEME = "opc.tcp"
RECONNECT_S = 60.0
STOP_S = 10.0  # how long stopping tries to reach a server that is gone
FIRST_WAIT_S, LONGEST_WAIT_S = 0.1, 1.0
AGAIN_S = (0.02, 0.1, 0.3)  # after which a server that has hung up on a first connection is asked again
FIRST_LOOK_S = 0.0005
SLACK = 1.5  # a command may take this many times as long as its steps, and the patience of the map


class _EndedError(RigError):
    """Another thread of this program has stopped the axis."""


class OpcUaRig:
    """The verbs of `Rig` over the nodes of a map; `open_rig` makes one.

    Parameters
    ----------
    link : Link
        Connected.
    identity, limits : Identity, Envelope, optional
        Where the server does not say them itself, or says them wrong.
    reconnect_s : float
        How long a lost connection is tried again.

    Notes
    -----
    From the first command on a heartbeat goes to the server. When it ends, for whatever reason, the server brings the
    axis to rest. A lost connection raises `ConnectionLostError` once it is back, `RigError` if it does not come back.
    """

    def __init__(
        self,
        link: Link,
        identity: Identity | None = None,
        limits: Envelope | None = None,
        reconnect_s: float = RECONNECT_S,
    ) -> None:
        self.reconnect_s = reconnect_s
        self._link = link
        self._finalizer = weakref.finalize(self, link.close)
        self._gone = False
        self._starting = threading.RLock()
        self._told = self._told_name()
        self._identity = identity or identity_of(self._described("rig.identity"), link.url)[0]
        link.ambient_pa = self._identity.ambient_pressure_pa
        self._limits = limits or envelope_of(self._described("rig.limits"), link.url)
        self._id = secrets.randbelow(COUNTER)  # no other client's, where a server has one place for all

    def close(self) -> None:
        """End the connection; the server finds the heartbeat silent and brings the axis to rest."""
        self._finalizer()

    def identity(self) -> Identity:
        """Tell which rig this is."""
        return self._identity

    def limits(self) -> Envelope:
        """Tell what it may be asked to do."""
        return self._limits

    def state(self) -> RigState:
        """Tell where it stands; a lost connection is waited for."""
        try:
            *values, fault = self._link.read(*STATE, "state.fault")
        except LinkError as error:
            self._reconnect(str(error))
            self._gone = True  # the next verb says so
            return self.state()
        said: dict[str, Any] = dict(zip(STATE.values(), values, strict=True))
        return RigState(**{**said, "moving": bool(said["moving"])}, fault=fault or None)

    def home(self) -> None:
        """Bring the axis to its home position."""
        self._do(Verb.HOME)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Bring the chambers to these absolute pressures, Pa."""
        self._do(Verb.SET_PRESSURE, {"command.pressure_a": a_pa, "command.pressure_b": b_pa})

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move from rest to rest without recording."""
        self._do(Verb.MOVE, self._program([Move(to_m, speed_m_s)]), self._expected_s([Move(to_m, speed_m_s)]))

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Stand still without recording."""
        self._do(Verb.HOLD, self._program([Hold(duration_s, released)]), duration_s)

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Run the steps one after the other and yield the samples in parts, as they come."""
        self._check_back()
        patience = SLACK * self._expected_s(steps) + self._link.nodes.patience_s
        running = True
        try:
            with self._one_connection("the acquisition") as same:
                (taken,) = self._link.read("samples.written")
                arguments = {**self._program(steps), **self._sampling(sampling), "samples.acknowledged": taken}
                identity = self._start(Verb.ACQUIRE, arguments)
                deadline, look = time.monotonic() + patience, FIRST_LOOK_S
                while running:
                    running = not self._ended(identity)
                    (written,) = self._link.read("samples.written")
                    look = FIRST_LOOK_S if written != taken else min(2.0 * look, self._link.nodes.poll_s)
                    while taken < written:
                        same()
                        taken += 1
                        part = self._chunk(taken)
                        self._link.write({"samples.acknowledged": taken})
                        yield part
                        deadline = time.monotonic() + patience
                    if running:
                        self._wait(look, deadline, Verb.ACQUIRE)
                same()
                self._check_fault(Verb.ACQUIRE)
        except (_EndedError, ConnectionLostError):
            running = False  # somebody else has ended it, or nobody is there who could
            raise
        finally:
            if running:
                self._halt()

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""
        try:
            with self._starting:
                if self._link.lost is None:
                    self._await(self._start(Verb.STOP, {}), 0.0, Verb.STOP)
                    self._gone = False  # whoever stops begins anew anyway
                    return
        except LinkError:
            pass
        if not self._back_within(min(STOP_S, self.reconnect_s)):  # which stops it
            beat = self._link.nodes.heartbeat_s
            what = f"the rig cannot be told to stop: {self._link.lost}"
            rule = f"a server whose client is silent brings the axis to rest by itself, within {beat:g} s"
            raise RigError(what, where=self._link.url, rule=rule, remedy="go and look at the rig") from None
        self._gone = False

    def _do(self, verb: Verb, arguments: dict[str, Any] | None = None, expected_s: float = 0.0) -> None:
        """Run one command to its end."""
        self._check_back()
        with self._one_connection(_words(verb)):
            self._await(self._start(verb, arguments or {}), expected_s, verb)

    def _start(self, verb: Verb, arguments: dict[str, Any]) -> int:
        """Write arguments, then the id that starts the command; not before a stop that is on its way is answered."""
        with self._starting:
            if verb not in (Verb.HALT, Verb.STOP):  # anybody may
                self._link.beat()
            self._id = self._id % COUNTER + 1
            self._link.write({**arguments, "command.verb": int(verb)})
            self._link.write({"command.id": self._id})
            return self._id

    def _await(self, identity: int, expected_s: float, verb: Verb) -> None:
        nodes, look = self._link.nodes, FIRST_LOOK_S
        deadline = time.monotonic() + SLACK * expected_s + nodes.patience_s
        while not self._ended(identity):
            self._wait(look, deadline, verb)
            look = min(2.0 * look, nodes.poll_s)
        self._check_fault(verb)

    def _ended(self, identity: int) -> bool:
        done, current, stops = self._link.read("answer.done", "command.id", "heartbeat.stops")
        self._link.check_stops(stops)
        if current != identity and current == self._id:
            raise _EndedError("it was ended by another command of this program", where=self._link.url)
        if current != identity:
            what = "another client commands this rig"
            raise RigError(what, where=self._link.url, rule="one client at a time", remedy="end the other one")
        return done == identity

    def _wait(self, look: float, deadline: float, verb: Verb) -> None:
        if time.monotonic() > deadline:
            what = f"the rig does not come to an end of {_words(verb)}"
            rule = "handshake.patience of the node map beyond the duration of the steps"
            raise RigError(what, where=self._link.url, rule=rule, remedy="look at the rig")
        time.sleep(look)

    def _check_fault(self, verb: Verb) -> None:
        (fault,) = self._link.read("answer.fault")
        if fault:
            what, *rest = fault.splitlines()
            raise RigError(
                f"{_words(verb)} failed: {what}", where=self._link.url, value="\n".join(rest).strip() or None
            )

    def _chunk(self, number: int) -> Samples:
        slot = self._link.nodes.slot_of(number)
        sequence, count, *read = self._link.read("samples.sequence", "samples.count", *SAMPLES, slot=slot)
        if sequence != number:
            what = f"samples were lost: slot {slot} holds chunk {sequence} where {number} belongs"
            raise RigError(what, where=self._link.url, remedy="more or larger slots in the PLC and the node map")
        columns = [np.full(count, c) if np.ndim(c) == 0 else c[:count] for c in read]
        if any(column.size != count for column in columns):
            sizes = ", ".join(f"{name} {column.size}" for name, column in zip(SAMPLES, columns, strict=True))
            raise RigError(f"chunk {number} of {count} samples has columns of other lengths", value=sizes)
        return Samples(**dict(zip(SAMPLES.values(), columns, strict=True)))

    def _program(self, steps: Sequence[Step]) -> dict[str, Any]:
        """Write steps as arrays, as far as the rig takes them."""
        nodes = self._link.nodes
        most = self._link.places["step.kind"].length or nodes.steps
        arrays = steps_as_arrays(steps)
        if len(steps) > most:
            raise RigError(f"{len(steps)} steps are more than the rig takes", rule=f"at most {most} steps a program")
        if any(arrays["step.weight"]) and "step.weight" not in nodes:
            raise RigError("the rig cannot be told of a known weight", rule="the node map has no step.weight")
        return {name: values for name, values in arrays.items() if name in nodes}

    def _sampling(self, sampling: Sampling) -> dict[str, Any]:
        return {name: getattr(sampling, field) for name, field in SAMPLING.items() if name in self._link.nodes}

    def _expected_s(self, steps: Sequence[Step]) -> float:
        low, high = self._limits.position_m
        return sum(
            step.duration_s if isinstance(step, Hold) else (high - low) / max(step.speed_m_s, 1e-9) for step in steps
        )

    def _described(self, name: str) -> Any:  # noqa: ANN401 - JSON
        table = name.partition(".")[2]
        if name not in self._link.nodes:
            what = f"neither the rig file nor the node map says the rig's {table}"
            raise RigError(what, where=self._link.url, remedy=f"write a table [{table}] in the rig file")
        (text,) = self._link.read(name)
        return parse_json(text, self._link.url, RigError)

    def _check_back(self) -> None:
        """Say once that the connection was lost and came back while something else was done."""
        if self._gone:
            self._gone = False
            raise _back("waiting", "the server was gone meanwhile", self._link.url)

    @contextlib.contextmanager
    def _one_connection(self, doing: str) -> Iterator[Callable[[], None]]:
        """Have what runs within one connection; it is given a function that makes sure of it.

        Raises
        ------
        ConnectionLostError
            The connection was lost; it is back, maybe because another call has found it lost and made a new one.
        RigError
            It did not come back; or whatever was raised within one connection.
        """
        number = self._link.number

        def same() -> None:
            if self._link.number != number:
                raise RigError("what was asked of another connection cannot be told")

        try:
            yield same
        except LinkError as error:
            if self._link.number == number:
                self._reconnect(str(error))
            self._gone = False
            raise _back(doing, str(error), self._link.url) from None
        except RigError as error:
            if self._link.number == number:
                raise
            self._gone = False
            raise _back(doing, error.what, self._link.url) from None

    def _reconnect(self, reason: str) -> None:
        """Connect again, within the time that was allowed."""
        if self._back_within(self.reconnect_s):
            return
        what = f"the connection to the rig was lost and did not come back within {self.reconnect_s:g} s"
        beat = self._link.nodes.heartbeat_s
        raise RigError(
            f"{what}: {reason}",
            where=self._link.url,
            rule=f"the server brings the axis to rest {beat:g} s after it last heard from us",
            remedy="start the server and resume the campaign; `reconnect` in the rig file allows more time",
        )

    def _back_within(self, limit_s: float) -> bool:
        """Connect again with growing waits and stop the rig; tell whether that could be done."""
        deadline, wait = time.monotonic() + limit_s, FIRST_WAIT_S
        while True:
            with contextlib.suppress(LinkError):
                self._connect()
                return True
            if time.monotonic() + wait > deadline:
                return False
            time.sleep(wait)
            wait = min(2.0 * wait, LONGEST_WAIT_S)

    def _connect(self) -> None:
        """Connect again, to the same rig, and make sure that it is at rest, unless another thread has done so."""
        with self._starting:
            if self._link.lost is None:
                return
            self._link.connect()
            self._await(self._start(Verb.STOP, {}), 0.0, Verb.STOP)
            if (name := self._told_name()) != self._told:
                raise RigError(f"another rig answers: {name!r} instead of {self._told!r}", where=self._link.url)

    def _told_name(self) -> str:
        """Name that the server gives to the rig, empty where it gives none."""
        if "rig.identity" not in self._link.nodes:
            return ""
        return identity_of(self._described("rig.identity"), self._link.url)[0].name

    def _halt(self) -> None:
        """Come to rest now; the pressures stay."""
        with contextlib.suppress(LinkError, RigError):  # on the way out of something else, which is told
            self._await(self._start(Verb.HALT, {}), 0.0, Verb.HALT)


class SimulatedOpcUaRig(OpcUaRig):
    """A rig whose server can set its past and change what is mounted: `Reproducible` and `Changeable`."""

    def begin_cycle(self, key: str) -> None:
        """Let the noise of the next cycle depend on the rig's seed and this key alone."""
        self._ask(Verb.BEGIN_CYCLE, key)

    def memory(self) -> dict[str, Any]:
        """Give all that the past has left behind."""
        return self._ask(Verb.MEMORY)

    def restore(self, memory: dict[str, Any]) -> None:
        """Take a past back that `memory` gave."""
        self._ask(Verb.RESTORE, memory)

    def truth(self) -> dict[str, Any]:
        """Give what was true of the last cycle."""
        return self._ask(Verb.TRUTH)

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Give the factors that can be changed and the levels that each can take."""
        return {factor: tuple(levels) for factor, levels in self._ask(Verb.LEVELS).items()}

    def change(self, levels: dict[str, str]) -> None:
        """Take what has been mounted."""
        self._ask(Verb.CHANGE, levels)

    def _ask(self, verb: Verb, question: object = None) -> Any:  # noqa: ANN401 - plain data
        self._check_back()
        with self._one_connection(_words(verb)) as same:
            self._await(self._start(verb, {"simulation.text": json.dumps(question)}), 0.0, verb)
            (answer,) = self._link.read("simulation.answer")
            same()
            return parse_json(answer or "null", self._link.url, RigError)


def open_rig(
    url: str,
    nodes: NodeMap | None = None,
    access: Access | None = None,
    identity: Identity | None = None,
    limits: Envelope | None = None,
    reconnect_s: float = RECONNECT_S,
) -> OpcUaRig:
    """Connect to a rig; what its server can do decides the class.

    Parameters
    ----------
    url : str
    nodes : NodeMap, optional
        The default one where absent.
    access : Access, optional
    identity, limits, reconnect_s
        As for `OpcUaRig`.

    Raises
    ------
    RigError
        There is no such server, it refuses us, or lacks a node.
    """
    try:
        _ = urlsplit(url).port
    except ValueError as error:
        raise RigError(
            f"this is no address: {error}", where=url, rule="it is opc.tcp://HOST:PORT", remedy="check the address"
        ) from None
    asked = url, nodes or load_map(), access or Access(), identity, limits, reconnect_s
    try:
        for wait_s in AGAIN_S:
            with contextlib.suppress(HungUpError):
                return _opened(*asked)
            time.sleep(wait_s)
        return _opened(*asked)
    except LinkError as error:
        remedy = "check that the server runs and the address; pneudrive rig serve starts one"
        raise RigError(f"there is no connection to the rig: {error}", where=url, remedy=remedy) from None


def _opened(
    url: str, nodes: NodeMap, access: Access, identity: Identity | None, limits: Envelope | None, reconnect_s: float
) -> OpcUaRig:
    link = Link(url, nodes, access)
    try:
        link.connect()
        simulated = "simulation.abilities" in link.nodes and link.read("simulation.abilities")[0]
        return (SimulatedOpcUaRig if simulated else OpcUaRig)(link, identity, limits, reconnect_s)
    except BaseException:
        link.close()
        raise


def _address(given: object) -> str:
    if not isinstance(given, str) or not given.startswith(f"{SCHEME}://") or "@" in given:
        raise WrongValueError(f"{given!r} is no address", rule=f"{SCHEME}://HOST:PORT, without user and password")
    return given


class OpcUaFile(AccessFile):
    """The rig file of a rig behind OPC UA."""

    url: Annotated[str, Reads(_address)]
    map: str | None = None
    reconnect_s: Annotated[float, Quantity("s", bounds=Bounds(at_least=0.0))] = RECONNECT_S


def load_opcua(source: str | Path, seed: int = 0, pace: float | None = None) -> OpcUaRig:
    """Connect to the rig at an address (default node map), or to the one that a rig file describes.

    Raises
    ------
    RigError
        With file, line, value, rule and remedy.
    """
    if str(source).startswith(f"{SCHEME}://"):
        return open_rig(str(source))
    file = OpcUaFile.load(source)
    return open_rig(file.url, load_map(file.beside(file.map)), file.access, *file.described(), file.reconnect_s)


def _back(doing: str, reason: str, url: str) -> ConnectionLostError:
    return ConnectionLostError(
        f"the connection was lost during {doing} and is back: {reason}",
        where=url,
        rule="the rig stands still without pressure; what ran is lost",
        remedy="run the cycle again",
    )


def _words(verb: Verb) -> str:
    return f"'{verb.name.lower().replace('_', ' ')}'"
