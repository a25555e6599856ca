"""Client for rigs over OPC UA: a PLC with a servo drive, or a served simulated rig."""

from __future__ import annotations

import json
import secrets
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from pneudrive.arrays import Plain
from pneudrive.errors import ConnectionLostError, RigError, warn
from pneudrive.files.content import parse_json
from pneudrive.rig import Envelope, Hold, Identity, Move, RigState, Samples, Sampling
from pneudrive.rig.interface import Step, envelope_of, identity_of
from pneudrive.rig.opcua.access import SCHEME, OpcUaFile
from pneudrive.rig.opcua.link import COUNTER, Link, LinkError
from pneudrive.rig.opcua.nodes import HOLD, RELEASED, SAMPLES, SAMPLING, SHUT, STATE, STEPS, Verb, load_map

STOP_S = 10.0  # s; time in which stopping tries to reach a lost server
FIRST_WAIT_S, LONGEST_WAIT_S = 0.1, 1.0
FIRST_S = 0.5  # s; time for the first connection, as a server may have too many connections
FIRST_LOOK_S = 0.0005
SLACK = 1.5  # time limit of a command: this factor on the duration of its steps, plus the patience of the map


class _EndedError(RigError):
    """Another thread of this program stopped the axis."""


class OpcUaRig:
    """Rig over OPC UA, with the nodes of a map. Use `open_rig` to connect.

    Parameters
    ----------
    link : Link
        Open connection. Identity and limits in its rig file replace missing or wrong values of the server.

    Notes
    -----
    From the first command on, the client sends a heartbeat. If the heartbeat ends for any reason, the server brings the
    axis to rest. After a lost connection, the client reconnects and raises `ConnectionLostError`. If it cannot
    reconnect, it raises `RigError`.
    """

    def __init__(self, link: Link) -> None:
        self._link, self._nodes, self._url = link, link.nodes, link.url
        identity, limits = link.file.described()
        self._finalizer = weakref.finalize(self, link.close)
        self._known = link.number  # the connection that the caller knows
        self._starting = threading.RLock()
        self._told = self._told_name()
        self._identity = identity or identity_of(self._described("identity"), link.url)[0]
        link.ambient_pa = self._identity.ambient_pressure_pa
        self._limits = limits or envelope_of(self._described("limits"), link.url)
        self._id = secrets.randbelow(COUNTER)  # not the id of another client, as some servers share the node

    def close(self) -> None:
        """Close the connection; the server then receives no heartbeat and brings the axis to rest."""
        self._finalizer()

    def identity(self) -> Identity:
        """Return the identity of the rig."""
        return self._identity

    def limits(self) -> Envelope:
        """Return the limits of the rig."""
        return self._limits

    def state(self) -> RigState:
        """Return the state of the rig. A lost connection is reopened first, and the next command reports the loss."""
        try:
            *values, fault = self._link.read(*STATE, "state.fault")
        except LinkError as error:
            self._reconnect(str(error))
            return self.state()
        said: Plain = dict(zip(STATE.values(), values, strict=True))
        return RigState(**{**said, "moving": bool(said["moving"])}, fault=fault or None)

    def home(self) -> None:
        """Bring the axis to its home position."""
        self._do(Verb.HOME)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        """Bring the chambers to these absolute pressures in Pa."""
        self._do(Verb.SET_PRESSURE, arguments={"command.pressure_a": a_pa, "command.pressure_b": b_pa})

    def move(self, to_m: float, speed_m_s: float) -> None:
        """Move from rest to rest without recording."""
        self._do(Verb.MOVE, [Move(to_m, speed_m_s)])

    def hold(self, duration_s: float, released: bool = False) -> None:
        """Rest for a time without recording."""
        self._do(Verb.HOLD, [Hold(duration_s, released)])

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        """Run the steps in their order, and yield the samples in parts as they arrive."""
        patience = SLACK * self._expected_s(steps) + self._nodes.handshake.patience_s
        running = True
        try:
            with self._one_connection("the acquisition"):
                (taken,) = self._link.read("samples.written")
                known = {name: field for name, field in SAMPLING.items() if name in self._nodes}
                rates = {name: getattr(sampling, field) for name, field in known.items()}
                arguments = {**self._program(steps), **rates, "samples.acknowledged": taken}
                identity = self._start(Verb.ACQUIRE, arguments)
                deadline, look = monotonic() + patience, FIRST_LOOK_S
                while running:
                    running = not self._ended(identity)
                    (written,) = self._link.read("samples.written")
                    look = FIRST_LOOK_S if written != taken else min(2.0 * look, self._nodes.handshake.poll_s)
                    while taken < written:
                        taken += 1
                        part = self._chunk(taken)
                        self._link.write({"samples.acknowledged": taken})
                        yield part
                        deadline = monotonic() + patience
                    if running:
                        self._wait(look, deadline, Verb.ACQUIRE)
                self._check_fault(Verb.ACQUIRE)
        except (_EndedError, ConnectionLostError):
            running = False  # another client has ended it, or the server is gone
            raise
        finally:
            if running:  # at rest now, with the same pressures; another error is already being raised
                with suppress(LinkError, RigError):
                    self._run(Verb.HALT)

    def stop(self) -> None:
        """Bring the axis to rest and release the pressure; safe to call at any time, also twice."""
        with suppress(LinkError), self._starting:
            if self._link.lost is None:
                self._run(Verb.STOP)
        if (reason := self._link.lost) is not None:
            try:  # connecting again stops the axis, too
                _within(min(STOP_S, self._link.file.reconnect_s), self._connect)
            except LinkError:
                beat = self._nodes.handshake.heartbeat_s
                raise RigError.of("rig.stop-lost", where=self._url, reason=reason, beat=beat) from None
        self._known = self._link.number

    def _do(self, verb: Verb, steps: Sequence[Step] = (), arguments: Plain | None = None) -> None:
        """Run a command and wait until it is done."""
        with self._one_connection(_words(verb)):
            self._run(verb, self._program(steps) if steps else arguments, self._expected_s(steps))

    def _start(self, verb: Verb, arguments: Plain | None) -> int:
        """Wait for the answer to a pending stop, then write the arguments, then the id that starts the command."""
        with self._starting:
            if verb not in (Verb.HALT, Verb.STOP):  # any client may
                self._link.beat()
            self._id = self._id % COUNTER + 1
            self._link.write({**(arguments or {}), "command.verb": int(verb)})
            self._link.write({"command.id": self._id})
            return self._id

    def _run(self, verb: Verb, arguments: Plain | None = None, expected_s: float = 0.0) -> None:
        """Start a command and wait for its answer."""
        identity = self._start(verb, arguments)
        look, handshake = FIRST_LOOK_S, self._nodes.handshake
        deadline = monotonic() + SLACK * expected_s + handshake.patience_s
        while not self._ended(identity):
            self._wait(look, deadline, verb)
            look = min(2.0 * look, handshake.poll_s)
        self._check_fault(verb)

    def _ended(self, identity: int) -> bool:
        done, current, stops = self._link.read("answer.done", "command.id", "heartbeat.stops")
        self._link.check_stops(stops)
        if current != identity:
            if current == self._id:
                raise _EndedError("another command of this program ended this command", where=self._url)
            raise RigError.of("rig.other-client", where=self._url)
        return done == identity

    def _wait(self, look: float, deadline: float, verb: Verb) -> None:
        if monotonic() > deadline:
            raise RigError.of("rig.unfinished", where=self._url, verb=_words(verb))
        sleep(look)

    def _check_fault(self, verb: Verb) -> None:
        (fault,) = self._link.read("answer.fault")
        if fault:
            what, *rest = fault.splitlines()
            raise RigError(f"{_words(verb)} failed: {what}", where=self._url, value="\n".join(rest).strip() or None)

    def _chunk(self, number: int) -> Samples:
        slot = self._nodes.slot_of(number)
        sequence, count, *read = self._link.read("samples.sequence", "samples.count", *SAMPLES, slot=slot)
        if sequence != number:
            raise RigError.of("rig.lost-samples", where=self._url, slot=slot, sequence=sequence, number=number)
        columns = [np.full(count, c) if np.ndim(c) == 0 else c[:count] for c in read]
        if any(column.size != count for column in columns):
            sizes = ", ".join(f"{name} {column.size}" for name, column in zip(SAMPLES, columns, strict=True))
            raise RigError(f"chunk {number} of {count} samples has columns of different lengths", value=sizes)
        return Samples(**dict(zip(SAMPLES.values(), columns, strict=True)))

    def _program(self, steps: Sequence[Step]) -> Plain:
        """Return the steps as arrays for the nodes. Reject too many steps, and a weight that has no node."""
        most = self._link.served["step.kind"].length or self._nodes.handshake.steps
        arrays = {name: [getattr(step, field, 0.0) for step in steps] for name, field in STEPS.items()}
        kinds = [HOLD | RELEASED * step.released | SHUT * step.shut if isinstance(step, Hold) else 0 for step in steps]
        if len(steps) > most:
            raise RigError(f"{len(steps)} steps are too many for the rig", rule=f"at most {most} steps in a program")
        if any(arrays["step.weight"]) and "step.weight" not in self._nodes:
            raise RigError.of("rig.no-weight")
        known = {name: values for name, values in arrays.items() if name in self._nodes}
        return {"step.count": len(steps), "step.kind": kinds, **known}

    def _expected_s(self, steps: Sequence[Step]) -> float:
        low, high = self._limits.position_m
        return sum(
            step.duration_s if isinstance(step, Hold) else (high - low) / max(step.speed_m_s, 1e-9) for step in steps
        )

    def _described(self, table: str) -> Any:  # noqa: ANN401 - JSON
        if f"rig.{table}" not in self._nodes:
            raise RigError.of("rig.undescribed", where=self._url, table=table)
        (text,) = self._link.read(f"rig.{table}")
        return parse_json(text, self._url, RigError)

    @contextmanager
    def _one_connection(self, doing: str) -> Iterator[None]:
        """Run a block on one connection. If the connection was lost since the last call, raise an error.

        Raises
        ------
        ConnectionLostError
            The connection was lost and has been reopened, before or in the block, possibly by another call.
        RigError
            The connection could not be reopened; or an error of the block.
        """
        before, number, self._known = self._known, self._link.number, self._link.number
        if number != before:
            raise self._back("waiting", "the server was unreachable in the meantime")
        try:
            yield
            if self._link.number != number:
                raise RigError("the result of a request on an earlier connection is unknown")
        except (LinkError, RigError) as error:
            if self._link.number == number and isinstance(error, RigError):
                raise
            reason = error.what if isinstance(error, RigError) else str(error)
            if self._link.number == number:
                self._reconnect(reason)
            self._known = self._link.number
            raise self._back(doing, reason) from None

    def _back(self, doing: str, reason: str) -> ConnectionLostError:
        return ConnectionLostError.of("rig.back", where=self._url, verb=doing, reason=reason)

    def _reconnect(self, reason: str) -> None:
        """Connect again within the allowed time."""
        seconds, beat_s = self._link.file.reconnect_s, self._nodes.handshake.heartbeat_s
        try:
            _within(seconds, self._connect)
        except LinkError:
            raise RigError.of("rig.lost", where=self._url, reason=reason, seconds=seconds, beat=beat_s) from None

    def _connect(self) -> None:
        """Connect again to the same rig and bring it to rest, unless another thread has done so."""
        with self._starting:
            if self._link.lost is None:
                return
            self._link.connect()
            self._run(Verb.STOP)
            if (name := self._told_name()) != self._told:
                raise RigError(f"another rig is served: {name!r} instead of {self._told!r}", where=self._url)

    def _told_name(self) -> str:
        """Return the name of the rig as stated by the server; empty without a name."""
        if "rig.identity" not in self._nodes:
            return ""
        return identity_of(self._described("identity"), self._url)[0].name


class SimulatedOpcUaRig(OpcUaRig):
    """Simulated rig over OPC UA, also `Reproducible` and `Changeable`."""

    def begin_cycle(self, key: str) -> None:
        """Seed the noise of the next cycle from the rig's seed and this key."""
        self._ask(Verb.BEGIN_CYCLE, key)

    def memory(self) -> Plain:
        """Return the saved state of the rig."""
        return self._ask(Verb.MEMORY)

    def restore(self, memory: Plain) -> None:
        """Restore a saved state from `memory`."""
        self._ask(Verb.RESTORE, memory)

    def levels(self) -> dict[str, tuple[str, ...]]:
        """Return the factors that can be changed, with their possible levels."""
        return {factor: tuple(levels) for factor, levels in self._ask(Verb.LEVELS).items()}

    def change(self, levels: dict[str, str]) -> None:
        """Set the levels of mounted factors."""
        self._ask(Verb.CHANGE, levels)

    def _ask(self, verb: Verb, question: object = None) -> Any:  # noqa: ANN401 - plain data
        with self._one_connection(_words(verb)):
            self._run(verb, {"simulation.text": json.dumps(question)})
            (answer,) = self._link.read("simulation.answer")
        return parse_json(answer or "null", self._url, RigError)


def load_opcua(source: str | Path, seed: int = 0, pace: float | None = None) -> OpcUaRig:
    """Connect to the rig at an address (default node map), or to the rig of a rig file.

    Raises
    ------
    RigError
        The file is not valid (the message gives file, line, value, rule and remedy). The server does not exist, rejects
        the client, or does not have a node.
    """
    if str(source).startswith(f"{SCHEME}://"):
        return open_rig(OpcUaFile(url=str(source)))
    file = OpcUaFile.load(source)
    sent = file.password_env or file.password_file
    if file.user is not None and sent is not None:
        warn(f"the password in {sent} is sent to {urlsplit(file.url).netloc}, as {Path(source).name} states")
    return open_rig(file)


def open_rig(file: OpcUaFile) -> OpcUaRig:
    """Connect to the rig of a file. Its class depends on the nodes of the server. Errors are those of `load_opcua`."""
    try:
        _ = urlsplit(file.url).port
    except ValueError as error:
        raise RigError.of("rig.address", where=file.url, error=error) from None
    link = Link(file, load_map(file.map and file.beside(file.map)))
    try:
        _within(FIRST_S, link.connect)
        simulated = "simulation.abilities" in link.nodes and link.read("simulation.abilities")[0]
        return (SimulatedOpcUaRig if simulated else OpcUaRig)(link)
    except BaseException as error:
        link.close()
        if not isinstance(error, LinkError):
            raise
        raise RigError.of("rig.unreachable", where=file.url, error=error) from None


def _within(limit_s: float, connect: Callable[[], None]) -> None:
    """Connect, with growing waits between attempts. If the time does not suffice, raise the last LinkError."""
    deadline, wait = monotonic() + limit_s, FIRST_WAIT_S
    while True:
        try:
            connect()
        except LinkError:
            if monotonic() + wait > deadline:
                raise
        else:
            return
        sleep(wait)
        wait = min(2.0 * wait, LONGEST_WAIT_S)


def _words(verb: Verb) -> str:
    return f"'{verb.name.lower().replace('_', ' ')}'"
