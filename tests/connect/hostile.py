"""Clients that mean harm, each a function of the server's address that goes on until it is killed."""

from __future__ import annotations

import asyncio
import contextlib
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


def deaf(url: str) -> None:
    """Ask for much before there is a session, and never read the answers."""

    async def work() -> None:
        while True:
            client = Client(url, timeout=10)
            with contextlib.suppress(Exception):  # thrown out: come again
                await client.connect_socket()
                await client.send_hello()
                await client.open_secure_channel()
                protocol = client.uaclient.protocol
                protocol.transport.pause_reading()
                body = struct_to_binary(ua.GetEndpointsRequest())
                number = 1000
                while not protocol.transport.is_closing():
                    number += 1
                    protocol.transport.write(protocol._connection.message_to_binary(body, request_id=number))
                    await asyncio.sleep(0.0001)
            await asyncio.sleep(0.01)

    asyncio.run(work())


def newcomers(url: str) -> None:
    """Log in again and again, on many connections at once, to command the axis."""

    async def one() -> None:
        while True:
            with contextlib.suppress(Exception):  # thrown out: come again
                async with Client(url, timeout=10) as client:
                    index = await client.get_namespace_index(SPACE)
                    await client.get_node(f"ns={index};s=Heartbeat.Client").write_value(1, ua.VariantType.UInt32)
            await asyncio.sleep(0.01)

    async def all_of_them() -> None:
        await asyncio.gather(*(one() for _ in range(8)))

    asyncio.run(all_of_them())


ALL = [silent, garbage, deaf, newcomers]


def run(name: str, url: str) -> None:
    """Run one, by name."""
    sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115 - asyncua tells of what it is thrown out for
    next(one for one in ALL if one.__name__ == name)(url)
