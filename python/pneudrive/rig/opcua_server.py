"""Any rig behind the nodes of a map: what `pneudrive rig serve` runs, and how the whole path is tested."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import queue
import threading
import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from pneudrive.errors import PneudriveError, RigError
from pneudrive.files.content import parse_json
from pneudrive.rig.interface import Changeable, Hold, Move, Reproducible, Samples, Sampling
from pneudrive.rig.opcua_access import Protection, opcua, protect
from pneudrive.rig.opcua_link import COUNTER, Loop, quieten
from pneudrive.rig.opcua_nodes import HOLD, IN_RING, RELEASED, SHUT, Node, NodeMap, Verb

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pneudrive.rig.interface import Rig, Step

log = logging.getLogger(__name__)
SILENT_SHARE = 0.75  # of the heartbeat time: the axis is stopped then, so that it is at rest when the time is over
WATCH_SHARE = 0.02
STATE_S = 0.05  # how often the state is shown while something may change
STOPPING_S = 10.0  # how long a rig that runs on is told to stop again
AGAIN_S = 0.1
CLOSING_S = 5.0
STATE_FIELDS = {
    "position": "position_m",
    "force": "force_n",
    "pressure_a": "pressure_a_pa",
    "pressure_b": "pressure_b_pa",
    "supply_pressure": "supply_pressure_pa",
    "temperature": "temperature_k",
    "time": "time_s",
    "moving": "moving",
}
SAMPLE_FIELDS = {
    "time": "time_s",
    "position": "position_m",
    "force": "force_n",
    "pressure_a": "pressure_a_pa",
    "pressure_b": "pressure_b_pa",
    "temperature": "temperature_k",
    "step": "step",
}
SIMULATED = {
    Verb.BEGIN_CYCLE: Reproducible,
    Verb.MEMORY: Reproducible,
    Verb.RESTORE: Reproducible,
    Verb.TRUTH: Reproducible,
    Verb.LEVELS: Changeable,
    Verb.CHANGE: Changeable,
}


class Interrupted(Exception):  # noqa: N818 - no error: halt, stop or a silent client
    """What runs is to end now."""


class RigServer:
    """Serves a rig in a thread of its own; a context manager.

    Parameters
    ----------
    rig : Rig
        Its verbs are called from one worker thread, `stop` from any.
    nodes : NodeMap
    host, port : str, int
        Where it listens; port 0 takes a free one, which `url` then says.
    protection : Protection, optional
        Whom it lets in; anyone where absent.
    heartbeat_s : float, optional
        Instead of that of the map.

    Raises
    ------
    RigError
        It cannot listen there.
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
        self.ambient_pa = rig.identity().ambient_pressure_pa
        self._loop = Loop()
        self._server: Any = None
        self._places: dict[str, list[Any]] = {}
        self._commands: queue.Queue[tuple[int, dict[str, Any]] | None] = queue.Queue()
        self._worker = threading.Thread(target=self._work, name="rig", daemon=True)
        self._busy = False
        self._running = 0  # verb
        self._idle = threading.Event()  # no verb of the rig runs
        self._idle.set()
        self._stopper: threading.Thread | None = None
        self._interrupt = threading.Event()
        self._beat_at: float | None = None  # None: no client, or a silent one, so no command is taken
        self._silent = ""
        self._stops = 0
        self._written = 0
        self._acknowledged = 0
        self._taken = threading.Condition()  # guards what is above, and tells that the ring has room
        self._showing = asyncio.Lock()

    def __enter__(self) -> RigServer:
        """Start to serve."""
        try:
            self._loop.run(self._start())
        except OSError as error:
            self._loop.close()
            what = f"nothing can listen on {self.host}:{self.port}: {error.strerror or error}"
            raise RigError(what, remedy="take another --port (0 takes a free one) or --bind") from None
        except BaseException:
            self._loop.close()
            raise
        self._worker.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Bring the axis to rest, release the pressure and end."""
        self._end_what_runs()
        self._commands.put(None)
        self._worker.join(CLOSING_S)
        with contextlib.suppress(Exception):  # of the library, while connections break
            self._loop.run(self._server.stop(), CLOSING_S)
        self._loop.close()

    async def _start(self) -> None:
        asyncua, ua = opcua(), opcua("asyncua.ua")
        server = self._server = asyncua.Server()
        with _without_collector():  # half of the start otherwise: the standard nodes are many small objects
            await server.init()
        server.set_server_name("pneudrive rig")
        server.set_endpoint(f"opc.tcp://{self.host}:{self.port}")
        server.set_match_discovery_client_ip(False)
        await protect(server, self.protection)
        await self._add_nodes()
        await self._show_state()
        await server.start()
        self.port = server.bserver._server.sockets[0].getsockname()[1]
        self.url = f"opc.tcp://{self.host}:{self.port}"
        for name, seen in (
            ("command.id", self._on_command),
            ("heartbeat.client", self._on_beat),
            ("samples.acknowledged", self._on_acknowledged),
        ):
            place = self._places[name][0]
            server.iserver.aspace.add_datachange_callback(place, ua.AttributeIds.Value, seen)
        self._tasks = [asyncio.create_task(task()) for task in (self._beat, self._watch, self._keep_state)]

    async def _add_nodes(self) -> None:
        """Add every node of the map, those that the client writes writable."""
        ua, server = opcua("asyncua.ua"), self._server
        space = await server.register_namespace(self.nodes.namespace) if self.nodes.namespace else 0
        folder = await server.nodes.objects.add_object(max(space, 1), "Rig")
        for name, node in self.nodes.nodes.items():
            self._places[name] = []
            for text in self.nodes.node_ids(name):
                node_id = ua.NodeId.from_string(text if text.startswith("ns=") else f"ns={space};{text}")
                while len(await server.get_namespace_array()) <= node_id.NamespaceIndex:
                    await server.register_namespace(f"urn:pneudrive:rig:{len(await server.get_namespace_array())}")
                kind, first = ua.VariantType[node.type], self._first(name, node)
                label = text.rpartition("=")[2]
                variable = await folder.add_variable(node_id, label, ua.Variant(first, kind), kind)
                if node.kind.client:
                    await variable.set_writable()
                self._places[name].append(node_id)

    def _first(self, name: str, node: Node) -> Any:  # noqa: ANN401 - a value of the node's type
        texts = {
            "rig.identity": lambda: json.dumps(asdict(self.rig.identity())),
            "rig.limits": lambda: json.dumps(asdict(self.rig.limits())),
            "simulation.abilities": lambda: " ".join(
                verb.name.lower() for verb, ability in SIMULATED.items() if isinstance(self.rig, ability)
            ),
        }
        if name in texts:
            return texts[name]()
        if node.kind.array:
            size = self.nodes.chunk if name in IN_RING else self.nodes.steps
            return [0.0 if node.kind.type == "Double" else 0] * size
        return {"Double": 0.0, "Boolean": False, "String": ""}.get(node.kind.type, 0)

    async def _on_beat(self, _: int, __: Any) -> None:  # noqa: ANN401 - asyncua's value
        self._beat_at, self._silent = time.monotonic(), ""

    async def _on_acknowledged(self, _: int, value: Any) -> None:  # noqa: ANN401
        with self._taken:
            self._acknowledged = int(value.Value.Value)
            self._taken.notify_all()

    async def _on_command(self, _: int, value: Any) -> None:  # noqa: ANN401
        """Take a command: halt and stop end what runs, any other one waits for its turn or is refused."""
        identity, verb = int(value.Value.Value), int(self._value("command.verb"))
        arguments = {name: self._value(name) for name, node in self.nodes.nodes.items() if node.kind.client}
        if verb in (Verb.HALT, Verb.STOP):
            # An acquisition can be left; any other verb can only be stopped. Where nothing runs, the worker does it.
            self._end_what_runs(stop=self._busy and (verb == Verb.STOP or self._running != Verb.ACQUIRE))
        elif self._beat_at is None:
            await self._answer(identity, "there is no heartbeat: heartbeat.client must count up first")
            return
        elif self._busy:
            await self._answer(identity, "another command is running; halt or stop it first")
            return
        self._busy = True
        self._commands.put((identity, arguments))

    def _end_what_runs(self, stop: bool = True) -> None:
        with self._taken:
            self._interrupt.set()
            self._taken.notify_all()
        if stop and (self._stopper is None or not self._stopper.is_alive()):
            stopper = threading.Thread(target=self._stop_rig, name="stop", daemon=True)  # it may block
            stopper.start()
            self._stopper = stopper

    def _stop_rig(self) -> None:
        """Stop until no verb runs: one may have been about to begin."""
        deadline = time.monotonic() + STOPPING_S
        try:
            self.rig.stop()
            while not self._idle.wait(AGAIN_S) and time.monotonic() < deadline:
                self.rig.stop()
        except Exception as error:
            log.exception("the rig does not stop")
            self._silent = f"{self._silent} the rig does not stop: {error}".strip()

    async def _watch(self) -> None:
        """Stop the axis of a client that fell silent."""
        tick, limit = WATCH_SHARE * self.heartbeat_s, SILENT_SHARE * self.heartbeat_s
        seen_late = None
        while True:
            looked = time.monotonic()
            await asyncio.sleep(tick)
            now, last = time.monotonic(), self._beat_at
            if last is None or now - last < limit:
                continue
            if now - looked > 2.0 * tick and last != seen_late:
                seen_late = last  # we slept ourselves: what was sent meanwhile is read first, once
                continue
            with self._taken:
                self._beat_at = None
                self._stops += 1
                self._silent = (
                    f"the client's heartbeat was silent for {limit:g} s: "
                    "the axis was brought to rest, the pressure released"
                )
            self._end_what_runs()
            await self._write({"heartbeat.stops": self._stops})
            await self._show_state()

    async def _beat(self) -> None:
        beat = 0
        while True:
            beat = (beat + 1) % COUNTER
            await self._write({"heartbeat.server": beat})
            await asyncio.sleep(self.heartbeat_s / 4.0)

    async def _keep_state(self) -> None:
        while True:
            await asyncio.sleep(STATE_S)
            try:
                await self._show_state()
            except Exception as error:  # of a lab's own code
                await self._write({"state.fault": f"the rig does not tell its state: {error}"})

    async def _show_state(self) -> None:
        async with self._showing:  # what was asked earlier is shown earlier
            state = asdict(await asyncio.to_thread(self.rig.state))
            fault = " ".join(text for text in (state.pop("fault"), self._silent) if text)
            values = {f"state.{name}": state[field] for name, field in STATE_FIELDS.items()}
            await self._write({**values, "state.fault": fault})

    def _work(self) -> None:
        """Run commands one after the other: the worker thread."""
        while (command := self._commands.get()) is not None:
            identity, arguments = command
            verb = arguments["command.verb"]
            with self._taken:
                allowed = self._beat_at is not None or verb in (Verb.HALT, Verb.STOP)
                if allowed:
                    self._running = verb
                    self._interrupt.clear()
                    self._idle.clear()
            fault = self._run(verb, arguments) if allowed else self._silent
            self._idle.set()
            if self._stopper is not None:
                self._stopper.join()
            self._busy = not self._commands.empty()
            self._loop.run(self._finish(identity, fault))

    def _run(self, verb: int, arguments: dict[str, Any]) -> str:
        """Run one command; give its fault, empty where there is none."""
        try:
            self._verbs().get(verb, self._unknown)(arguments)
        except Interrupted:
            return self._silent or "it was ended by halt or stop"
        except PneudriveError as error:
            return str(error)
        except Exception as error:
            log.exception("a verb of the rig failed")
            return f"{type(error).__name__}: {error}"
        return ""

    def _verbs(self) -> dict[int, Callable[[dict[str, Any]], object]]:
        rig: Any = self.rig
        known: dict[int, Callable[[dict[str, Any]], object]] = {
            Verb.HOME: lambda _: rig.home(),
            Verb.MOVE: lambda a: rig.move(*_move(_first_step(a, Move))),
            Verb.HOLD: lambda a: rig.hold(*_hold(_first_step(a, Hold))),
            Verb.SET_PRESSURE: lambda a: rig.set_pressure(a["command.pressure_a"], a["command.pressure_b"]),
            Verb.ACQUIRE: self._acquire,
            Verb.HALT: lambda _: None,  # what ran has been interrupted
            Verb.STOP: lambda _: rig.stop(),
        }
        for verb, ability in SIMULATED.items():
            if isinstance(rig, ability) and "simulation.answer" in self.nodes:
                known[verb] = lambda a, verb=verb: self._simulate(verb, a)
        return known

    def _unknown(self, arguments: dict[str, Any]) -> None:
        raise RigError(f"verb {arguments['command.verb']} is not known to this rig")

    def _simulate(self, verb: Verb, arguments: dict[str, Any]) -> None:
        asks_nothing = verb in (Verb.MEMORY, Verb.TRUTH, Verb.LEVELS)
        method = getattr(self.rig, verb.name.lower())
        answer = (
            method() if asks_nothing else method(parse_json(arguments["simulation.text"], "simulation.text", RigError))
        )
        self._loop.run(self._write({"simulation.answer": json.dumps(answer)}))

    def _acquire(self, arguments: dict[str, Any]) -> None:
        """Run the program and put its samples into the ring."""
        parts = self.rig.acquire(_steps(arguments), _sampling(arguments))
        try:
            for part in parts:
                for start in range(0, len(part), self.nodes.chunk):
                    self._put(_rows(part, start, start + self.nodes.chunk))
        finally:
            close = getattr(parts, "close", None)  # of a generator: come to rest now
            if close is not None:
                close()

    def _put(self, chunk: Samples) -> None:
        """Wait for a free slot and write it."""
        with self._taken:
            while self._written - self._acknowledged >= self.nodes.slots and not self._interrupt.is_set():
                self._taken.wait(self.heartbeat_s)
        if self._interrupt.is_set():
            raise Interrupted
        self._written += 1
        values = {f"samples.{name}": getattr(chunk, field) for name, field in SAMPLE_FIELDS.items()}
        slot = self.nodes.slot_of(self._written)
        self._loop.run(self._write({**values, "samples.count": len(chunk), "samples.sequence": self._written}, slot))
        self._loop.run(self._write({"samples.written": self._written}))

    async def _finish(self, identity: int, fault: str) -> None:
        with contextlib.suppress(Exception):  # the state is shown again soon; the answer must come
            await self._show_state()
        await self._answer(identity, fault)

    async def _answer(self, identity: int, fault: str) -> None:
        await self._write({"answer.fault": fault})
        await self._write({"answer.done": identity})

    def _value(self, name: str) -> Any:  # noqa: ANN401 - a value in SI
        ua = opcua("asyncua.ua")
        raw = self._server.iserver.aspace.read_attribute_value(self._places[name][0], ua.AttributeIds.Value).Value.Value
        node = self.nodes.nodes[name]
        if node.kind.type != "Double":
            return raw
        if node.kind.array:
            return [node.scale.to_si(value, self.ambient_pa) for value in raw]
        return node.scale.to_si(raw, self.ambient_pa)

    async def _write(self, values: dict[str, Any], slot: int = 0) -> None:
        ua = opcua("asyncua.ua")
        for name, value in values.items():
            node, places = self.nodes.nodes[name], self._places[name]
            if not places:
                continue  # a constant
            raw = node.scale.from_si(value, self.ambient_pa) if node.kind.type == "Double" else value
            raw = raw.tolist() if hasattr(raw, "tolist") else raw
            data = ua.DataValue(ua.Variant(raw, ua.VariantType[node.type]))
            place = places[slot if name in IN_RING else 0]
            await self._server.iserver.aspace.write_attribute_value(place, ua.AttributeIds.Value, data)


@contextlib.contextmanager
def _without_collector() -> Iterator[None]:
    import gc

    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def _steps(arguments: dict[str, Any]) -> list[Step]:
    count = arguments["step.count"]
    weights = arguments.get("step.weight") or [0.0] * count
    names = ("step.kind", "step.position", "step.speed", "step.duration")
    rows = list(zip(*(arguments[name] for name in names), weights, strict=False))
    if not 0 <= count <= len(rows):
        raise RigError(f"a program of {count} steps", rule=f"0 to {len(rows)} steps")
    steps: list[Step] = []
    for kind, position, speed, duration, weight in rows[:count]:
        if kind & HOLD:
            steps.append(Hold(duration, bool(kind & RELEASED), bool(kind & SHUT), weight))
        else:
            steps.append(Move(position, speed))
    return steps


def _first_step(arguments: dict[str, Any], kind: type[Step]) -> Any:  # noqa: ANN401 - a step of that kind
    steps = _steps({**arguments, "step.count": 1})
    if not isinstance(steps[0], kind):
        raise RigError(f"the first step is no {kind.__name__.lower()}", rule="step.kind: 0 move, 1 hold")
    return steps[0]


def _move(step: Move) -> tuple[float, float]:
    return step.to_m, step.speed_m_s


def _hold(step: Hold) -> tuple[float, bool]:
    return step.duration_s, step.released


def _sampling(arguments: dict[str, Any]) -> Sampling:
    default = Sampling()
    return Sampling(
        int(arguments.get("sampling.samples_per_stroke", default.samples_per_stroke)),
        arguments.get("sampling.burst_rate", default.burst_rate_hz),
        arguments.get("sampling.burst_before", default.burst_before_s),
        arguments.get("sampling.burst_after", default.burst_after_s),
        arguments.get("sampling.hold_rate", default.hold_rate_hz),
    )


def _rows(samples: Samples, start: int, stop: int) -> Samples:
    return Samples(**{name: getattr(samples, name)[start:stop] for name in SAMPLE_FIELDS.values()})
