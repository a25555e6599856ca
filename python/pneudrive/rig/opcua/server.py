"""Server of a rig for one client, through the nodes of a map: for `pneudrive rig serve` and for tests."""

from __future__ import annotations

import asyncio
import gc
import json
import logging
from collections.abc import Coroutine
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import asdict
from time import monotonic
from typing import Any

import numpy as np
from asyncua.common.connection import TransportLimits
from asyncua.common.utils import ServiceError
from asyncua.server.internal_session import InternalSession
from asyncua.server.server import Server

from pneudrive.arrays import Plain
from pneudrive.batching import many_objects
from pneudrive.errors import PneudriveError, RigError
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Hold, JobThread, Move, Rig, Samples, Sampling, Step, closed_after
from pneudrive.rig.opcua.access import Protection, ua
from pneudrive.rig.opcua.link import COUNTER, LoopThread, quieten
from pneudrive.rig.opcua.nodes import HOLD, IN_RING, RELEASED, SAMPLES, SAMPLING, SHUT, STATE, STEPS, NodeMap, Verb

log = logging.getLogger(__name__)
SILENT_SHARE = 0.75  # share of the heartbeat time after which the axis is stopped, so that it is at rest at its end
TICK_SHARE = 0.02  # share of the heartbeat time between two checks of the heartbeat
TICKS_A_BEAT = 12  # checks for each heartbeat of the server
STATE_S = 0.05  # s; interval of the displayed state
STATE_PATIENCE_S = 0.2  # s; a slow rig shows its state later
STOPPING_S = 10.0  # s; time in which a rig that still moves is stopped again
AGAIN_S = 0.1  # s; wait before a stop is repeated
GENTLE_S = 0.2  # s; time for a halted acquisition to end by itself
CLOSING_S = 2.0
MOST_CONNECTIONS, SESSION_S = 64, 5.0  # connections; s in which a connection must get a session
MOST_REQUESTS = 64  # of one connection, read ahead
UNREAD = 1 << 22  # bytes of unread answers, above which a connection is closed
LONGEST_TEXT = 1 << 15
BUFFER = 65535  # bytes of a chunk, in both directions
LARGEST_MESSAGE = 1 << 22  # bytes of a request or an answer
LONGEST_STEP_S = 86400.0
#: Verbs of simulated rigs that take an argument -> its type, and the rule in words.
ARGUMENTS = {
    Verb.BEGIN_CYCLE: (str, "a text: the key of a cycle"),
    Verb.RESTORE: (dict, "a saved state from `memory`"),
    Verb.CHANGE: (dict, "factors with their levels as texts"),
}


class ServedSession(InternalSession):
    """Session on a served rig. Only one is active at a time. It may read all nodes and write the nodes of commands."""

    def __init__(self, internal: Any, served: RigServer, name: Any) -> None:  # noqa: ANN401
        super().__init__(internal, internal.aspace, internal.subscription_service, name, external=True)
        self.served = served

    def activate_session(self, params: Any, peer_certificate: Any) -> Any:  # noqa: ANN401
        """Admit the client unless another client is served."""
        if self.is_activated() or not self.served.is_free:
            raise ServiceError(ua.StatusCodes.BadTooManySessions)
        result = super().activate_session(params, peer_certificate)
        self.served.enter(self)
        return result

    async def write(self, params: Any) -> list[Any]:  # noqa: ANN401
        """Write the nodes that a client may write, and deny access to other nodes."""
        return [
            await self.served.write(request.NodeId, request.Value)
            if request.AttributeId == ua.AttributeIds.Value and self.served.session is self
            else ua.StatusCode(ua.StatusCodes.BadUserAccessDenied)
            for request in params.NodesToWrite
        ]

    async def create_subscription(self, *_: Any, **__: Any) -> Any:  # noqa: ANN401
        """Reject subscriptions, because a session with a subscription would outlive its connection."""
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)

    async def close_session(self, delete_subs: bool = True) -> None:
        """Close the session."""
        await super().close_session(delete_subs)
        self.served.leave(self)


class ServerLimits(TransportLimits):
    """Limits of messages, the same for all clients. asyncua would apply the limits of the last client to all."""

    def create_acknowledge_and_set_limits(self, msg: Any) -> Any:  # noqa: ANN401
        """Answer the hello message of a client. A client with smaller buffers is rejected."""
        if msg.ReceiveBufferSize < BUFFER:
            raise ua.UaStatusCodeError(ua.StatusCodes.BadConnectionRejected)
        return TransportLimits(**vars(self)).create_acknowledge_and_set_limits(msg)


class RigServer:
    """Server of a rig in a separate thread, for one client; a context manager.

    A second client is rejected while the heartbeat of the first one runs. The rig is brought to rest if this heartbeat
    stops or the session ends. Halt and stop are answered at any time.

    Parameters
    ----------
    rig : Rig
        Rig to serve. One worker thread calls its methods, except `stop`, which another thread calls.
    nodes : NodeMap
    host, port : str, int
        Address to listen on. Port 0 means any free port; `url` then contains the chosen number.
    protection : Protection, optional
        Admitted clients. Default: any client.

    Raises
    ------
    RigError
        The server cannot listen on the address.
    """

    def __init__(
        self,
        rig: Rig,
        nodes: NodeMap,
        host: str = "127.0.0.1",
        port: int = 4840,
        protection: Protection | None = None,
    ) -> None:
        quieten()
        self.rig, self.nodes, self.host, self.port = rig, nodes, host, port
        self.protection = protection or Protection()
        self.heartbeat_s = nodes.handshake.heartbeat_s
        self.url = ""
        #: Reason why the server has brought the rig to rest; empty for a new client and after an accepted command.
        self.fault = ""
        self.session: Any = None
        self._ambient_pa = rig.identity().ambient_pressure_pa
        self._loop = LoopThread()
        self._server: Any = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._ids: dict[str, list[Any]] = {}  # of each node: one, or one for each slot
        self._writable: dict[Any, str] = {}
        self._values: Plain = {}  # written by the client, SI
        self._beat_at: float | None = None  # time of the client's last heartbeat
        self._stops = 0
        # Commands run on one thread and stops on another, so that neither blocks the other.
        self._command_thread, self._stop_thread = JobThread("rig"), JobThread("stop")
        self._stopping = asyncio.Lock()
        self._verb, self._identity = 0, 0  # of the last accepted command; id of the last command
        self._running: Future[str] = Future()
        self._running.set_result("")
        self._interrupted = ""  # why the running command must end
        self._room = asyncio.Event()  # the ring may have room, or the running command must end
        self._samples_written = self._samples_taken = 0  # chunks
        self._shown: asyncio.Task[Any] | None = None

    def __enter__(self) -> RigServer:
        """Start the server."""
        try:
            self._loop.run(self._start())
        except BaseException as error:
            for thread in (self._stop_thread, self._command_thread, self._loop):
                thread.close()
            if not isinstance(error, OSError):
                raise
            reason = error.strerror or error
            raise RigError.of("rig.port", host=self.host, port=self.port, reason=reason) from None
        gc.freeze()  # the standard nodes are many small objects: garbage collection would take 0.25 s
        return self

    def __exit__(self, *_: object) -> None:
        """Bring the axis to rest, release the pressure and end."""
        with suppress(TimeoutError, asyncio.TimeoutError):
            self._loop.run(self._stop("the server ends"), CLOSING_S)
        self._stop_thread.close(CLOSING_S)
        self._command_thread.close(CLOSING_S)
        with suppress(Exception):  # of the library, when connections break
            self._loop.run(self._server.stop(), CLOSING_S)
        self._loop.close()
        gc.unfreeze()

    async def _start(self) -> None:
        server: Any = Server()
        self._server = server
        with many_objects():  # otherwise half of the time of the start
            await server.init()
        server.set_server_name("pneudrive rig")
        server.set_endpoint(f"opc.tcp://{self.host}:{self.port}")
        server.set_match_discovery_client_ip(False)
        server.limits = ServerLimits(BUFFER, BUFFER, LARGEST_MESSAGE // BUFFER + 1, LARGEST_MESSAGE)
        await self.protection.protect(server)
        internal = server.iserver
        internal.max_connections = MOST_CONNECTIONS
        internal.max_pending_activation_seconds = SESSION_S
        internal.max_pending_messages_per_connection = MOST_REQUESTS
        internal.create_session = lambda name, **_: ServedSession(internal, self, name)
        internal.lookup_external_session = lambda _: None  # a session does not continue on another connection
        await self._add_nodes()
        await self._show_state()
        await server.start()
        self.port = server.bserver.port
        self.url = f"opc.tcp://{self.host}:{self.port}"
        self._soon(self._keep_time())
        self._soon(self._keep_state())

    def _soon(self, work: Coroutine[Any, Any, Any]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # --- nodes -------------------------------------------------------------------------------

    async def _add_nodes(self) -> None:
        """Add every node of the map with its initial value."""
        server = self._server
        space = await server.register_namespace(self.nodes.namespace) if self.nodes.namespace else 0
        folder = await server.nodes.objects.add_object(max(space, 1), "Rig")
        for name, node in self.nodes.nodes.items():
            self._values[name] = initial = self._initial(name)
            for text in self.nodes.node_ids(name):
                node_id = ua.NodeId.from_string(text if text.startswith("ns=") else f"ns={space};{text}")
                while len(await server.get_namespace_array()) <= node_id.NamespaceIndex:
                    await server.register_namespace(f"urn:pneudrive:rig:{len(await server.get_namespace_array())}")
                kind, label = ua.VariantType[node.type], text.rpartition("=")[2]
                await folder.add_variable(node_id, label, ua.Variant(initial, kind), kind)
                self._ids.setdefault(name, []).append(node_id)
                if node.kind.client:
                    self._writable[node_id] = name

    def _initial(self, name: str) -> Any:  # noqa: ANN401 - a value of the node's type
        if name in ("rig.identity", "rig.limits"):
            return json.dumps(asdict(getattr(self.rig, name.removeprefix("rig."))()))
        if name == "simulation.abilities":
            return " ".join(verb.name.lower() for verb in Verb if self._can_simulate(verb))
        kind, ring = self.nodes.nodes[name].kind, self.nodes.handshake
        first = {"Double": 0.0, "Boolean": False, "String": ""}.get(kind.type, 0)
        return [first] * (ring.chunk if name in IN_RING else ring.steps) if kind.array else first

    async def _show(self, values: Plain, slot: int = 0) -> None:
        """Publish values in SI on their nodes."""
        for name, value in values.items():
            if name not in self._ids:
                continue  # a constant
            node = self.nodes.nodes[name]
            node_id = self._ids[name][slot if name in IN_RING else 0]
            data = ua.DataValue(ua.Variant(node.from_si(value, self._ambient_pa), ua.VariantType[node.type]))
            await self._server.iserver.write_attribute_value(node_id, data)

    async def write(self, node_id: Any, value: Any) -> Any:  # noqa: ANN401 - asyncua's types
        """Store a value that the client writes; return the status."""
        name, variant = self._writable.get(node_id), value.Value
        if name is None:
            return ua.StatusCode(ua.StatusCodes.BadUserAccessDenied)
        node = self.nodes.nodes[name]
        if variant is None or variant.Value is None or variant.VariantType is not ua.VariantType[node.type]:
            return ua.StatusCode(ua.StatusCodes.BadTypeMismatch)
        raw, is_text = variant.Value, isinstance(variant.Value, str)
        if isinstance(raw, list) != node.kind.array:
            return ua.StatusCode(ua.StatusCodes.BadTypeMismatch)
        too_long = np.size(raw) > self.nodes.handshake.steps or (is_text and len(raw) > LONGEST_TEXT)
        if too_long or not (is_text or np.isfinite(raw).all()):
            return ua.StatusCode(ua.StatusCodes.BadOutOfRange)
        before, self._values[name] = self._values[name], node.to_si(raw, self._ambient_pa)
        await self._server.iserver.write_attribute_value(node_id, value)
        if name == "heartbeat.client" and raw != before:
            self._beat_at = monotonic()
        elif name == "samples.acknowledged":
            self._samples_taken = min(raw, self._samples_written)
            self._room.set()
        elif name == "command.id":
            await self._command(raw)
        return ua.StatusCode()

    # --- the client --------------------------------------------------------------------------

    @property
    def is_free(self) -> bool:
        """Whether a new client may be served: no client is connected, or the present client has no heartbeat."""
        return self.session is None or self._beat_at is None

    def enter(self, session: Any) -> None:  # noqa: ANN401 - a ServedSession
        """Serve a new client, which replaces a client without a heartbeat."""
        before, self.session, self.fault = self.session, session, ""
        self._values |= {name: self._initial(name) for name in self._writable.values()}
        self._soon(self._show({"state.fault": ""}))
        if before is not None:
            self._soon(before.close_session())

    def leave(self, session: Any) -> None:  # noqa: ANN401 - a ServedSession
        """Bring the rig to rest if the session of a client that commands has ended."""
        if session is self.session:
            self.session = None
            if self._beat_at is not None:
                self._lose("the connection of the client ended")

    def _lose(self, reason: str) -> None:
        """Bring the rig of a lost client to rest."""
        self._beat_at, self._stops = None, self._stops + 1
        self.fault = f"{reason}: the server stopped the axis and released the pressure"
        self._soon(self._stop(self.fault))
        self._soon(self._show({"heartbeat.stops": self._stops}))

    async def _keep_time(self) -> None:
        """Publish a heartbeat, monitor the heartbeat of the client, and check for unread answers."""
        tick, limit = TICK_SHARE * self.heartbeat_s, SILENT_SHARE * self.heartbeat_s
        seen_late, ticks = None, 0
        while True:
            began, ticks = monotonic(), ticks + 1
            if ticks % TICKS_A_BEAT == 0:
                await self._show({"heartbeat.server": ticks // TICKS_A_BEAT % COUNTER})
            for connection in list(self._server.bserver.clients):
                if connection.transport is not None and connection.transport.get_write_buffer_size() > UNREAD:
                    connection.transport.abort()
            await asyncio.sleep(tick)
            now, last = monotonic(), self._beat_at
            if last is None or now - last < limit:
                continue
            if now - began > 2.0 * tick and last != seen_late:
                seen_late = last  # this process was suspended: first read, once, what was sent meanwhile
                continue
            self._lose(f"no heartbeat of the client for {limit:g} s")

    async def _keep_state(self) -> None:
        while True:
            await asyncio.sleep(STATE_S)
            await self._show_state()

    async def _show_state(self) -> None:
        """Publish the state of the rig. Do not wait long for a slow rig: its state is published later."""
        if self._shown is None or self._shown.done():
            self._shown = asyncio.create_task(self._read_state())
        await asyncio.wait([self._shown], timeout=STATE_PATIENCE_S)

    async def _read_state(self) -> None:
        try:
            state = asdict(await asyncio.to_thread(self.rig.state))
        except Exception as error:  # any exception of a lab's code
            state = {"fault": f"the rig returns no state: {error}"}
        values = {name: state[field] for name, field in STATE.items() if field in state}
        await self._show({**values, "state.fault": " ".join(filter(None, (state["fault"], self.fault)))})

    # --- commands ----------------------------------------------------------------------------

    async def _command(self, identity: int) -> None:
        """Start a command, or reject it. Halt and stop are accepted at any time."""
        self._identity, verb = identity, self._values["command.verb"]
        if verb in (Verb.HALT, Verb.STOP):
            self._soon(self._stop("halt or stop ended the command", verb, identity))
        elif self._beat_at is None:
            await self._answer(identity, "the client has no heartbeat: it must increment heartbeat.client first")
        elif self._stopping.locked() or not self._running.done():
            await self._answer(identity, "another command is running; halt or stop it first")
        else:
            self._verb, self._interrupted, self.fault = verb, "", ""
            arguments = dict(self._values)
            self._running = self._command_thread.start(lambda: self._run(verb, arguments))
            self._soon(self._finish(identity, self._running))

    async def _finish(self, identity: int, running: Future[str]) -> None:
        """Answer a command when it has ended."""
        fault = await asyncio.wrap_future(running)
        await self._show_state()
        await self._answer(identity, fault)

    async def _answer(self, identity: int, fault: str) -> None:
        if identity == self._identity:  # otherwise the client has sent another command meanwhile
            await self._show({"answer.fault": fault})
            await self._show({"answer.done": identity})

    async def _stop(self, reason: str, verb: int = Verb.STOP, identity: int | None = None) -> None:
        """Bring the rig to rest, and answer the client.

        A halted acquisition ends by itself within a short time, and keeps the pressures. Any other command is stopped
        repeatedly until it has ended, because it may begin only after the first stop.
        """
        self._interrupted, fault, running = reason, "", self._running
        self._room.set()
        async with self._stopping:
            gently = verb == Verb.HALT and (running.done() or self._verb == Verb.ACQUIRE)
            until = monotonic() + STOPPING_S
            try:
                rests = gently and await _ends_within(GENTLE_S, running)
                while not rests and monotonic() < until:
                    await asyncio.wrap_future(self._stop_thread.start(self.rig.stop))
                    rests = await _ends_within(AGAIN_S, running)
                fault = "" if rests else "the running command does not end"
            except Exception as error:  # any exception of a lab's code
                log.exception("the rig does not stop")
                fault = f"the rig does not stop: {error}"
            self.fault = fault or self.fault
            await self._show_state()
        if identity is not None:
            await self._answer(identity, fault)

    def _run(self, verb: int, arguments: Plain) -> str:
        """Run a command on the thread of commands; return its fault."""
        try:
            if not self._interrupted:
                self._do(verb, arguments)
        except PneudriveError as error:
            return self._interrupted or str(error)
        except Exception as error:
            log.exception("a verb of the rig failed")
            return self._interrupted or f"{type(error).__name__}: {error}"
        return self._interrupted

    def _do(self, verb: int, arguments: Plain) -> None:
        rig = self.rig
        if verb == Verb.HOME:
            rig.home()
        elif verb == Verb.SET_PRESSURE:
            rig.set_pressure(arguments["command.pressure_a"], arguments["command.pressure_b"])
        elif verb == Verb.ACQUIRE:
            self._acquire(arguments)
        elif verb in (Verb.MOVE, Verb.HOLD):
            (step,) = self._steps({**arguments, "step.count": 1})
            if isinstance(step, Move) != (verb == Verb.MOVE):
                raise RigError.of("rig.first-step", verb=Verb(verb).name.lower())
            if isinstance(step, Move):
                rig.move(step.to_m, step.speed_m_s)
            else:
                rig.hold(step.duration_s, step.released)
        elif self._can_simulate(verb):
            self._simulate(Verb(verb), arguments["simulation.text"])
        else:
            raise RigError(f"verb {verb} is not known to this rig")

    def _can_simulate(self, verb: int) -> bool:
        is_simulated = verb >= Verb.BEGIN_CYCLE and verb in list(Verb) and "simulation.answer" in self.nodes
        return is_simulated and callable(getattr(self.rig, Verb(verb).name.lower(), None))

    def _simulate(self, verb: Verb, text: str) -> None:
        """Call a method of simulated rigs with its argument as JSON, and publish the result."""
        name = verb.name.lower()
        argument = parse_json(text or "null", "simulation.text", RigError)
        kind, rule = ARGUMENTS.get(verb, (object, ""))
        levels = argument.values() if verb is Verb.CHANGE and isinstance(argument, dict) else ()
        if not isinstance(argument, kind) or not all(isinstance(level, str) for level in levels):
            raise RigError(f"simulation.text = {argument!r} is not an argument of {name}", rule=rule)
        answer = getattr(self.rig, name)(*([argument] if rule else []))
        self._loop.run(self._show({"simulation.answer": json.dumps(answer)}))

    def _steps(self, arguments: Plain) -> list[Step]:
        """Read the steps from the arrays of a command. Each step may take at most a day."""
        count, (low_m, high_m) = arguments["step.count"], self.rig.limits().position_m
        slowest_m_s = (high_m - low_m) / LONGEST_STEP_S
        columns = [arguments[name] for name in ("step.kind", *STEPS) if name in arguments]
        most = min(map(len, columns))
        if not 0 <= count <= most:
            raise RigError(f"a program of {count} steps is out of bounds", rule=f"0 to {most} steps")
        steps: list[Step] = []
        rows = zip(*(values[:count].tolist() for values in columns), strict=True)
        for kind, position_m, speed_m_s, duration_s, *weight_n in rows:
            if kind & HOLD:
                if not 0.0 <= duration_s <= LONGEST_STEP_S:
                    raise RigError(f"a hold of {duration_s:g} s is out of bounds", rule=f"0 to {LONGEST_STEP_S:g} s")
                steps.append(Hold(duration_s, bool(kind & RELEASED), bool(kind & SHUT), *weight_n))
            else:
                if speed_m_s < slowest_m_s:
                    raise RigError.of("rig.slow", speed=1e3 * speed_m_s, slowest=1e3 * slowest_m_s)
                steps.append(Move(position_m, speed_m_s))
        return steps

    def _acquire(self, arguments: Plain) -> None:
        """Run the steps and put their samples into the ring."""
        sampling = Sampling(**{field: arguments[name] for name, field in SAMPLING.items() if name in arguments})
        with closed_after(self.rig.acquire(self._steps(arguments), sampling)) as parts:
            for part in map(Samples.of, parts):
                for start in range(0, len(part), self.nodes.handshake.chunk):
                    self._loop.run(self._put(part.rows(slice(start, start + self.nodes.handshake.chunk))))

    async def _put(self, chunk: Samples) -> None:
        """Wait for a free slot of the ring and write samples there."""
        while self._samples_written - self._samples_taken >= self.nodes.handshake.slots and not self._interrupted:
            self._room.clear()
            await self._room.wait()
        if self._interrupted:
            raise RigError(self._interrupted)
        self._samples_written += 1
        values = {name: getattr(chunk, field) for name, field in SAMPLES.items()}
        slot = self.nodes.slot_of(self._samples_written)
        await self._show({**values, "samples.count": len(chunk), "samples.sequence": self._samples_written}, slot)
        await self._show({"samples.written": self._samples_written})


async def _ends_within(seconds: float, running: Future[str]) -> bool:
    """Wait for a command up to a given time; return whether it ended."""
    if not running.done():
        await asyncio.wait([asyncio.wrap_future(running)], timeout=seconds)
    return running.done()
