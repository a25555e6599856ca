"""Clients that mean harm, each a function of the server's address that goes on until it is killed."""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import random
import socket
import struct
import sys
import time
from urllib.parse import urlsplit

from asyncua import Client, ua
from asyncua.ua.ua_binary import struct_to_binary

SPACE = "urn:pneudrive:rig"
HELLO = struct.pack("<IIIII", 0, 65535, 65535, 0, 0) + struct.pack("<i", 4) + b"opc:"


def _chunk(kind: bytes, body: bytes) -> bytes:
    return kind + b"F" + struct.pack("<I", 8 + len(body)) + body


def _gone(one: socket.socket) -> bool:
    try:
        return one.recv(4096) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def _keep_open(url: str, count: int, send: list[bytes]) -> None:
    """Hold so many connections, each of which has sent one of these; make another one for each that is closed."""
    place = (urlsplit(url).hostname, urlsplit(url).port)
    held: list[socket.socket] = []
    while True:
        for one in [one for one in held if _gone(one)]:
            one.close()
            held.remove(one)
        while len(held) < count:
            try:
                one = socket.create_connection(place, timeout=1.0)
                one.setblocking(False)
                one.send(random.choice(send))
                held.append(one)
            except OSError:  # noqa: PERF203
                break
        time.sleep(0.001)


def silent(url: str) -> None:
    """Connect and say nothing."""
    _keep_open(url, 900, [b""])


def garbage(url: str) -> None:
    """Send bytes that mean nothing, bare and in chunks of every kind, whole and cut into crumbs."""
    rng = random.Random(1)
    kinds = [b"HEL", b"OPN", b"MSG", b"CLO", b"ACK", b"ERR", b"XYZ"]
    bodies = [rng.randbytes(rng.choice((0, 1, 30, 3000, 60000))) for _ in range(200)]
    sizes = [b"MSGF\xff\xff\xff\xff", b"MSGF\0\0\0\0", b"OPNF\x08\0\0\0", b"MSGC" + struct.pack("<I", 65535)]
    crumbs = (_chunk(b"HEL", HELLO) + b"MSGC\x20\0\0\0" + b"\0" * 24) * 500
    _keep_open(url, 60, [*bodies, *(_chunk(rng.choice(kinds), body) for body in bodies), *sizes, crumbs])


async def _many(url: str, count: int, work) -> None:
    async def one() -> None:
        while True:
            with contextlib.suppress(Exception):  # thrown out: come again
                async with Client(url, timeout=10) as client:
                    index = await client.get_namespace_index(SPACE)
                    await work(client, lambda name, i=index, c=client: c.get_node(f"ns={i};s={name}"))
            await asyncio.sleep(0.01)

    await asyncio.gather(*(one() for _ in range(count)))


async def _flood(client, requests) -> None:
    """Send these over and over, as fast as the server takes them; throw the answers away."""
    protocol = client.uaclient.protocol
    for request in requests:
        request.RequestHeader.AuthenticationToken = protocol.authentication_token
    bodies = [struct_to_binary(one) for one in requests]
    protocol.data_received = lambda data: None
    number = 1000
    while not protocol.transport.is_closing():
        for body in bodies:
            number += 1
            protocol.transport.write(protocol._connection.message_to_binary(body, request_id=number))
            while protocol.transport.get_write_buffer_size() > 1 << 17:
                await asyncio.sleep(0.001)
        await asyncio.sleep(0)


def _read(nodes) -> ua.ReadRequest:
    request = ua.ReadRequest()
    request.Parameters.NodesToRead = [ua.ReadValueId(NodeId=node, AttributeId=ua.AttributeIds.Value) for node in nodes]
    return request


def reads(url: str) -> None:
    """Read as much as can be had, on many sessions at once, more than one request ahead."""

    async def work(client, node) -> None:
        large = [node(f"Samples.{slot}.Time").nodeid for slot in range(8)] * 12
        small = [ua.NodeId(ua.ObjectIds.Server_ServerStatus)] * 500
        await _flood(client, [_read(large), _read(small), _read(small[:1]), _read(small * 5)])

    asyncio.run(_many(url, 12, work))


def deaf(url: str) -> None:
    """Ask for much and never read the answers."""

    async def work(client, node) -> None:
        large = [node(f"Samples.{slot}.Time").nodeid for slot in range(8)] * 12
        client.uaclient.protocol.transport.pause_reading()
        for _ in range(10_000):
            asking = client.uaclient.read_attributes(large, ua.AttributeIds.Value)
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(asking, 0.005)

    asyncio.run(_many(url, 12, work))


VALUES = {
    "Double": [0.0, -1.0, math.nan, math.inf, -math.inf, 1e308, 5e-324],
    "Int32": [0, -1, 2**31 - 1, -(2**31), 1, 5, 99, 101, 103],
    "UInt32": [0, 1, 2**32 - 1, 7],
    "String": ["", "{", "[" * 20_000, "null", '{"clock_s": NaN}', "x" * 60_000],
}
SCALARS = {
    "Command.Verb": "Int32", "Command.PressureA": "Double", "Command.PressureB": "Double", "Command.Id": "UInt32",
    "Step.Count": "Int32", "Sampling.SamplesPerStroke": "Int32", "Sampling.BurstRate": "Double",
    "Sampling.BurstBefore": "Double", "Sampling.BurstAfter": "Double", "Sampling.HoldRate": "Double",
    "Samples.Acknowledged": "UInt32", "Heartbeat.Client": "UInt32", "Simulation.Text": "String",
    "State.Position": "Double", "Answer.Done": "UInt32",
}  # fmt: skip
ARRAYS = {"Step.Kind": "Int32", "Step.Position": "Double", "Step.Speed": "Double", "Step.Duration": "Double"}


def writes(url: str) -> None:
    """Write every value to every node, of right and wrong type, one after the other and many at once: moves too."""
    rng = random.Random(os.getpid())

    def value() -> tuple[str, ua.DataValue]:
        array = rng.random() < 0.3
        name, kind = rng.choice(list((ARRAYS if array else SCALARS).items()))
        kind = rng.choice(list(VALUES)) if rng.random() < 0.1 else kind
        content = (
            [rng.choice(VALUES[kind]) for _ in range(rng.choice((0, 1, 256, 5000)) if kind != "String" else 1)]
            if array
            else None
        )
        variant = ua.Variant(content if array else rng.choice(VALUES[kind]), ua.VariantType[kind])
        return name, ua.DataValue(variant)

    requests: list[ua.WriteRequest] = []
    begin = [("Heartbeat.Client", 1, "UInt32"), ("Command.Verb", 1, "Int32"), ("Command.Id", 1, "UInt32")]

    async def work(client, node) -> None:
        if not requests:  # a command that is one, so that the others have something to spoil
            requests.append(ua.WriteRequest())
            requests[0].Parameters.NodesToWrite = [
                ua.WriteValue(
                    NodeId=node(name).nodeid,
                    AttributeId=ua.AttributeIds.Value,
                    Value=ua.DataValue(ua.Variant(number, ua.VariantType[kind])),
                )
                for name, number, kind in begin
            ]
        while len(requests) < 40:
            request = ua.WriteRequest()
            pairs = [value() for _ in range(300 if len(requests) == 39 else rng.choice((1, 3)))]
            request.Parameters.NodesToWrite = [
                ua.WriteValue(NodeId=node(name).nodeid, AttributeId=ua.AttributeIds.Value, Value=v) for name, v in pairs
            ]
            with contextlib.suppress(struct.error, TypeError, ua.UaError, AttributeError):
                struct_to_binary(request)
                requests.append(request)
        await _flood(client, requests)

    asyncio.run(_many(url, 8, work))


async def _command(node, verb: int, number: int, beat: int | None = None, **arguments: tuple[object, str]) -> None:
    for name, (content, kind) in arguments.items():
        await node(name.replace("_", ".")).write_value(content, ua.VariantType[kind])
    if beat is not None:
        await node("Heartbeat.Client").write_value(beat, ua.VariantType.UInt32)
    await node("Command.Verb").write_value(verb, ua.VariantType.Int32)
    await node("Command.Id").write_value(number, ua.VariantType.UInt32)


def second_commander(url: str) -> None:
    """Count a heartbeat up, and tell the axis to move, all the time."""

    async def work(_, node) -> None:
        for number in range(1, 10**6):
            await _command(node, 2, number, number, Step_Position=([0.2], "Double"), Step_Speed=([0.1], "Double"))

    asyncio.run(_many(url, 4, work))


def giant_acquires(url: str) -> None:
    """Command, and ask for more samples and longer steps than there are; also for as many as just go."""
    plans = [
        {"Sampling_SamplesPerStroke": (2**31 - 1, "Int32")},
        {"Sampling_SamplesPerStroke": (1_000_000, "Int32"), "Step_Count": (8, "Int32")},
        {"Step_Speed": ([4e-6] * 8, "Double"), "Sampling_SamplesPerStroke": (5000, "Int32")},
        {"Step_Kind": ([1] * 256, "Int32"), "Step_Duration": ([86400.0] * 256, "Double"), "Step_Count": (256, "Int32")},
        {"Step_Kind": ([1] * 8, "Int32"), "Sampling_HoldRate": (1e300, "Double")},
    ]

    async def work(_, node) -> None:
        number = 0
        while True:
            for plan in plans:
                number += 1
                usual = {
                    "Step_Kind": ([0] * 8, "Int32"),
                    "Step_Position": ([0.28, 0.02] * 4, "Double"),
                    "Step_Speed": ([0.3] * 8, "Double"),
                    "Step_Duration": ([60.0] * 8, "Double"),
                    "Step_Count": (8, "Int32"),
                    "Sampling_HoldRate": (20.0, "Double"),
                    "Samples_Acknowledged": (2**31 - 1, "UInt32"),
                }
                await _command(node, 5, number, number, **{**usual, **plan})
                if "connect again" in await node("Answer.Fault").read_value():
                    return
                for beat in range(5):
                    await asyncio.sleep(0.2)
                    await node("Heartbeat.Client").write_value(1000 * number + beat, ua.VariantType.UInt32)

    asyncio.run(_many(url, 2, work))


def stops(url: str) -> None:
    """Halt and stop all the time."""

    async def work(_, node) -> None:
        for number in range(1, 10**6):
            await _command(node, 6 + number % 2, number)

    asyncio.run(_many(url, 12, work))


ALL = [silent, garbage, reads, deaf, writes, second_commander, giant_acquires, stops]


def run(name: str, url: str) -> None:
    """Run one, by name."""
    sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115 - asyncua tells of what it is thrown out for
    next(one for one in ALL if one.__name__ == name)(url)
