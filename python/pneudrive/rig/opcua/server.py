"""Server of any rig through the nodes of a map, for `pneudrive rig serve` and for tests."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import time
from concurrent.futures import Future, wait
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pneudrive.batching import many_objects
from pneudrive.errors import RigError
from pneudrive.rig.job_thread import JobThread
from pneudrive.rig.opcua.access import Protection, opcua, protect
from pneudrive.rig.opcua.link import COUNTER, LoopThread, quieten
from pneudrive.rig.opcua.nodes import NodeMap, Verb
from pneudrive.rig.opcua.program import SAMPLES, STATE
from pneudrive.rig.opcua.space import FAULT, STOPS, Space
from pneudrive.rig.opcua.verbs import Command, Interrupted, Verbs

if TYPE_CHECKING:
    from pneudrive.rig.interface import Rig, Samples
    from pneudrive.rig.opcua.front import Front
    from pneudrive.rig.opcua.session import Client

log = logging.getLogger(__name__)
SILENT_SHARE = 0.75  # share of the heartbeat time after which the axis is stopped, so that it is at rest at its end
WATCH_SHARE = 0.02
STATE_S = 0.05  # s; interval of the displayed state while something may change
STATE_PATIENCE_S = 0.2
STOPPING_S = 10.0  # s; time in which a rig that still moves is stopped again
AGAIN_S = 0.1
GENTLE_S = 0.2  # s; time for a halted acquisition to end by itself
CLOSING_S = 2.0


class RigServer:
    """Server of a rig in a separate thread; a context manager.

    A client becomes the commander by a command if there is no commander and its heartbeat runs. It remains the
    commander until its heartbeat stops, its session ends, or another client stops the axis. Any client may read, halt
    and stop.

    Parameters
    ----------
    rig : Rig
        Rig; its verbs are called from one worker thread, `stop` from any.
    nodes : NodeMap
    host, port : str, int
        Address to listen on; port 0 takes a free one, which `url` gives.
    protection : Protection, optional
        Admitted clients and users; default: anyone.
    heartbeat_s : float, optional
        Heartbeat time; default: that of the map.

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
        heartbeat_s: float | None = None,
    ) -> None:
        opcua()
        quieten()
        self.rig, self.nodes, self.host, self.port = rig, nodes, host, port
        self.protection = protection or Protection()
        self.heartbeat_s = heartbeat_s or nodes.heartbeat_s
        self.url = ""
        self._loop = LoopThread()
        self._front: Front | None = None
        self._space: Any = None
        self._verbs = Verbs(
            rig,
            simulated="simulation.answer" in nodes,
            chunk=nodes.chunk,
            put=lambda chunk: self._loop.run(self._put(chunk)),
            answer=lambda command, text: self._loop.run(
                self._write({"simulation.answer": text}, client=command.client)
            ),
        )
        # Verbs run on one thread and stops on another, so that neither blocks the other.
        self._verb_thread, self._stop_thread = JobThread("rig"), JobThread("stop")
        self._verb: Future[str] = Future()  # running or last command
        self._verb.set_result("")
        self._interrupted = ""  # why the accepted command must end
        # On the loop's thread:
        self._room = asyncio.Event()  # the ring may have room, or the running verb must end
        self._samples_written = self._samples_taken = 0  # chunks
        self._commander: Client | None = None
        self._since = ""
        self._open: Command | None = None  # accepted command with a verb that has not ended
        self._held: Command | None = None  # accepted while the axis is stopped
        self._stops_asked: list[Command] | None = (
            None  # commands that wait for the axis to be at rest; None: no stop in progress
        )
        self._stops = 0
        self._fault, self._fault_at = "", 0.0
        self._rig_fault: Any = None
        self._shown: asyncio.Task[Any] | None = None

    def __enter__(self) -> RigServer:
        """Start to serve."""
        try:
            self._loop.run(self._start())
        except OSError as error:
            self._loop.close()
            what = f"the server cannot listen on {self.host}:{self.port}: {error.strerror or error}"
            raise RigError(what, remedy="Choose another --port (0: a free one) or --bind.") from None
        except BaseException:
            self._loop.close()
            raise
        gc.freeze()  # the standard nodes are many small objects: garbage collection would take 0.25 s
        return self

    def __exit__(self, *_: object) -> None:
        """Bring the axis to rest, release the pressure and end."""
        self._loop.loop.call_soon_threadsafe(self._interrupt, "the server ends")
        self._stop_thread.start(self._stop_rig)
        self._stop_thread.close(CLOSING_S)
        self._verb_thread.close(CLOSING_S)
        if self._front is not None:
            with contextlib.suppress(Exception):  # of the library, when connections break
                self._loop.run(self._front.stop(), CLOSING_S)
        self._loop.close()
        gc.unfreeze()

    async def _start(self) -> None:
        from pneudrive.rig.opcua.front import Front

        asyncua = opcua()
        server = asyncua.Server()
        with many_objects():  # otherwise half of the time of the start
            await server.init()
        server.set_server_name("pneudrive rig")
        server.set_endpoint(f"opc.tcp://{self.host}:{self.port}")
        server.set_match_discovery_client_ip(False)
        await protect(server, self.protection)
        self._space = Space(server, self.rig, self.nodes)
        await self._space.fill()
        await self._show_state()
        self._front = Front(server, self, self.protection)
        self.port = await self._front.start(self.host, self.port)
        self.url = f"opc.tcp://{self.host}:{self.port}"
        for task in (self._beat(), self._watch(), self._keep_state()):
            self._front.background(task)

    # --- what the front asks -----------------------------------------------------------------

    def name_of(self, node_id: Any) -> str | None:  # noqa: ANN401 - asyncua's node id
        """Return the name of a node with a separate value for each client: commands and answers."""
        return self._space.names.get(node_id)

    def read(self, client: Client, name: str, value: Any) -> Any:  # noqa: ANN401 - asyncua's value
        """Return the value of a node for one client. Answers to other clients are hidden."""
        if name == FAULT:
            return value if client.began <= self._fault_at else self._rig_fault or value
        if name == STOPS:
            return client.values.setdefault(name, value)
        return client.values.get(name, value)

    def commands(self, client: Client) -> bool:
        """Return whether a client is the commander."""
        return client is self._commander

    async def written(self, client: Client, name: str, value: Any) -> Any:  # noqa: ANN401 - asyncua's value and status
        """Handle a value that a client has written."""
        ua, node = opcua("asyncua.ua"), self.nodes.nodes[name]
        if not node.kind.client:
            return ua.StatusCode(ua.StatusCodes.BadUserAccessDenied)
        if wrong := self._space.wrong(node, value):
            return ua.StatusCode(wrong)
        before = client.values.get(name)
        client.values[name] = value
        if self._commander in (None, client):  # others may observe
            await self._space.show(name, value)
        if name == "heartbeat.client" and (before is None or before.Value.Value != value.Value.Value):
            client.beat_at = time.monotonic()
        elif name == "samples.acknowledged" and client is self._commander:
            self._samples_taken = min(int(value.Value.Value), self._samples_written)
            self._room.set()
        elif name == "command.id":
            await self._command(client, int(value.Value.Value))
        return ua.StatusCode()

    def left(self, client: Client) -> None:
        """Stop the axis if the session of the commander has ended."""
        if client is self._commander and self._open is None:
            self._commander = None
            self._stop(None)
        elif client is self._commander:
            self._lost(f"the connection of {client} ended: the server stopped the axis and released the pressure")

    # --- who commands ------------------------------------------------------------------------

    async def _command(self, client: Client, identity: int) -> None:
        """Accept a command: halt and stop from any client, other verbs only from the commander."""
        arguments = {name: self._value(client, name) for name, node in self.nodes.nodes.items() if node.kind.client}
        command = Command(client, identity, arguments["command.verb"], arguments)
        client.identity = identity
        if command.verb in (Verb.HALT, Verb.STOP):
            await self._answer(client, _another(identity), "")  # not done yet
            self._stop(command)
        elif refused := self._refusal(client):
            await self._answer(client, identity, refused)
        else:
            if self._commander is None:
                self._commander, self._since = client, time.strftime("%H:%M:%S")
                self._told("")
            await self._answer(client, _another(identity), "")
            if self._stops_asked is None and self._open is None:
                self._begin(command)
            else:
                self._held = command

    def _refusal(self, client: Client) -> str:
        """Return the reason why a client may not send commands now; empty if it may."""
        if client.dismissed:
            return client.dismissed
        if self._commander not in (None, client):
            return f"{self._commander} commands this rig since {self._since}; others may observe and stop it"
        if client.beat_at is None or time.monotonic() - client.beat_at > self.heartbeat_s:
            return "the client has no heartbeat: it must increment heartbeat.client first"
        if self._held is not None or (self._open is not None and not self._interrupted):
            return "another command is running; halt or stop it first"
        return ""

    def _begin(self, command: Command) -> None:
        self._open, self._interrupted = command, ""
        self._verb = self._verb_thread.start(lambda: self._run(command))
        self._soon(self._end(command, self._verb))

    def _run(self, command: Command) -> str:
        """Run a command on the thread of verbs; return its fault."""
        try:
            fault = "" if self._interrupted else self._verbs.run(command)
        except Interrupted:
            fault = ""
        return self._interrupted or fault  # an interruption may have ended it

    async def _end(self, command: Command, verb: Future[str]) -> None:
        """Answer a command when its verb has ended."""
        fault = await asyncio.wrap_future(verb)
        await self._show_state()
        self._open = None
        await self._finish(command, fault)
        if self._stops_asked is None:
            self._next()

    async def _put(self, chunk: Samples) -> None:
        """Wait for a free slot of the ring and write samples there."""
        while self._samples_written - self._samples_taken >= self.nodes.slots and not self._interrupted:
            self._room.clear()
            await self._room.wait()
        if self._interrupted:
            raise Interrupted
        self._samples_written += 1
        values = {name: getattr(chunk, field) for name, field in SAMPLES.items()}
        slot = self.nodes.slot_of(self._samples_written)
        await self._write({**values, "samples.count": len(chunk), "samples.sequence": self._samples_written}, slot)
        await self._write({"samples.written": self._samples_written})

    def _interrupt(self, why: str) -> None:
        """Interrupt the running or accepted command."""
        self._interrupted = why
        self._room.set()

    def _stop(self, command: Command | None, why: str = "halt or stop ended the command") -> None:
        """Stop the axis; answer the client when the axis is at rest."""
        client = command.client if command is not None else None
        if self._commander is not None and client not in (None, self._commander):
            why = f"{client} stopped the axis at {time.strftime('%H:%M:%S')}"
            self._commander.dismissed = f"{why}; connect again to command"
            self._commander = None
            self._told(why)
        self._interrupt(why)
        if self._held is not None:
            self._end_soon(self._held, why)
            self._held = None
        on = self._stops_asked is not None
        self._stops_asked = [*(self._stops_asked or []), *([command] if command is not None else [])]
        if not on:
            self._start_stopping()

    def _start_stopping(self) -> None:
        # An acquisition can be halted, any other verb only stopped. Without a running verb, halting does nothing.
        asked, open_ = self._stops_asked or [], self._open
        gently = bool(asked) and all(one.verb == Verb.HALT for one in asked)
        self._soon(self._bring_to_rest(gently and (open_ is None or open_.verb == Verb.ACQUIRE), self._verb))

    async def _bring_to_rest(self, gently: bool, verb: Future[str]) -> None:
        """Stop the rig, which may block, and answer the waiting clients; then continue with held commands.

        With `gently`, the running verb may end normally within a short time, and the pressures stay.
        """
        fault = ""
        try:
            if not (gently and await _ends_within(GENTLE_S, verb)):
                await asyncio.wrap_future(self._stop_thread.start(self._stop_rig))
        except Exception as error:
            log.exception("the rig does not stop")
            fault = f"the rig does not stop: {error}"
            self._told(fault)
        asked = self._stops_asked or []
        left = [one for one in asked if gently and one.verb != Verb.HALT]
        self._stops_asked = left or None
        await self._show_state()
        for one in asked:
            if one not in left:
                await self._finish(one, fault)
        if left:
            self._start_stopping()
        elif self._open is None:
            self._next()
        await self._stop_again(verb)

    def _stop_rig(self) -> None:
        """Stop the rig on the thread of stops; repeat it if a verb was about to start."""
        self.rig.stop()
        if wait([self._verb], AGAIN_S).not_done:
            self.rig.stop()

    async def _stop_again(self, verb: Future[str]) -> None:
        """Repeat the stop while a verb was about to start or still runs."""
        until = time.monotonic() + STOPPING_S
        while time.monotonic() < until and not await _ends_within(AGAIN_S, verb):
            with contextlib.suppress(Exception):  # already reported at the first stop
                await asyncio.wrap_future(self._stop_thread.start(self.rig.stop))

    def _next(self) -> None:
        held, self._held = self._held, None
        if held is not None and held.client is self._commander:
            self._begin(held)

    def _lost(self, text: str) -> None:
        """Stop the axis of a lost commander."""
        commander = self._commander
        if commander is not None:
            commander.beat_at = None
        self._commander = None
        self._told(text)
        self._stops += 1
        self._stop(None, text)
        self._soon(self._write({STOPS: self._stops}, client=commander))

    def _told(self, fault: str) -> None:
        self._fault, self._fault_at = fault, time.monotonic()

    def _end_soon(self, command: Command, fault: str) -> None:
        self._soon(self._finish(command, fault))

    def _soon(self, work: Any) -> None:  # noqa: ANN401 - a coroutine
        assert self._front is not None
        self._front.background(work)

    async def _watch(self) -> None:
        """Stop the axis if the commander's heartbeat stops."""
        tick, limit = WATCH_SHARE * self.heartbeat_s, SILENT_SHARE * self.heartbeat_s
        seen_late = None
        while True:
            looked = time.monotonic()
            await asyncio.sleep(tick)
            now, last = time.monotonic(), self._commander.beat_at if self._commander is not None else None
            if last is None or now - last < limit:
                continue
            if now - looked > 2.0 * tick and last != seen_late:
                seen_late = last  # this process was suspended: first read, once, what was sent meanwhile
                continue
            self._lost(
                f"no heartbeat of the client for {limit:g} s: the server stopped the axis and released the pressure"
            )

    async def _beat(self) -> None:
        beat = 0
        while True:
            beat = (beat + 1) % COUNTER
            await self._write({"heartbeat.server": beat})
            await asyncio.sleep(self.heartbeat_s / 4.0)

    async def _keep_state(self) -> None:
        while True:
            await asyncio.sleep(STATE_S)
            await self._show_state()

    async def _show_state(self) -> None:
        """Publish the state of the rig; a slow rig publishes it later."""
        if self._shown is None or self._shown.done():
            self._shown = asyncio.create_task(self._show())
        await asyncio.wait([self._shown], timeout=STATE_PATIENCE_S)

    async def _show(self) -> None:
        try:
            state = asdict(await asyncio.to_thread(self.rig.state))
        except Exception as error:  # any exception of a lab's code
            state = {"fault": f"the rig returns no state: {error}"}
        own = state.pop("fault") or ""
        self._rig_fault = self._space.data(FAULT, own)
        values = {name: state[field] for name, field in STATE.items() if field in state}
        await self._write({**values, FAULT: " ".join(text for text in (own, self._fault) if text)})

    # --- answers ------------------------------------------------------------------------------

    async def _finish(self, command: Command, fault: str) -> None:
        """Answer a command, unless the client has sent another one meanwhile."""
        if command.client.identity == command.identity:
            await self._answer(command.client, command.identity, fault)

    async def _answer(self, client: Client, identity: int, fault: str) -> None:
        await self._write({"answer.fault": fault}, client=client)
        await self._write({"answer.done": identity}, client=client)

    def _value(self, client: Client, name: str) -> Any:  # noqa: ANN401 - a value in SI
        """Return the value that a client has written, or the initial value."""
        raw = client.values[name].Value.Value if name in client.values else self._space.first(name)
        return self._space.to_si(name, raw)

    async def _write(self, values: dict[str, Any], slot: int = 0, client: Client | None = None) -> None:
        """Publish values to all clients, or to one client; values of the commander are also sent to observers."""
        for name, value in values.items():
            if name not in self._space.places:
                continue  # a constant
            data = self._space.data(name, value)
            if client is not None:
                client.values[name] = data
            if client is None or self._commander in (None, client):
                await self._space.show(name, data, slot)


async def _ends_within(seconds: float, verb: Future[str]) -> bool:
    """Wait for a verb up to a time; return whether it ended."""
    if not verb.done():
        await asyncio.wait([asyncio.wrap_future(verb)], timeout=seconds)
    return verb.done()


def _another(identity: int) -> int:
    """Return an id that differs from this id, so that the command with this id does not appear as done."""
    return identity - 1 if identity > 0 else 1
