"""``pneudrive rig``: serve a rig over OPC UA; make certificates."""

from __future__ import annotations

import signal
import sys
import threading
from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli import terminal
from pneudrive.cli.options import Port
from pneudrive.errors import CommandError
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive.rig import rig_file
    from pneudrive.rig.opcua import access, nodes, server

LOOPBACK = ("127.0.0.1", "localhost", "::1")


def serve(
    rig: str = "default",
    *,
    port: Port = 4840,
    bind: str = "127.0.0.1",
    speed: float = 1.0,
    seed: int = 0,
    map: Path | None = None,  # noqa: A002 - the name of the option
    certificate: Path | None = None,
    trust: list[Path] | None = None,
    unprotected: bool = False,
) -> None:
    """Serve a rig over OPC UA, with the nodes of a map, until Ctrl-C.

    Options
    -------
    rig
        Ready rig, rig file, or own code as own_rig.py:make_rig.
    port
        Port; 0: a free one.
    bind
        Address to listen on.
    speed
        1: real time; 10: ten times faster; 0: as fast as possible.
    seed
        Seed of all noise of a simulated rig.
    map
        Node map; default: the one of the package.
    certificate
        Certificate of this server, with its private key next to it (.key); all messages are signed and encrypted.
    trust
        Certificate of a client that may connect; repeatable.
    unprotected
        Allow anyone on the network to command the axis.

    Examples
    --------
    pneudrive rig serve default
    """
    protection = access.Protection.of(certificate, trust)
    if bind not in LOOPBACK and certificate is None and not unprotected:
        raise CommandError.of("cli.bind", address=bind)
    if speed < 0.0 or 0.0 < speed < 1.0:
        raise CommandError(f"--speed {speed:g} is out of bounds", rule="0, or at least 1")
    bench = rig_file.load_rig(rig, seed, speed or None)
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    with server.RigServer(bench, nodes.load_map(map), bind, port, protection) as running:
        about = f"{bench.identity().name} at {running.url} with seed {seed}"
        typer.echo(f"{about}; heartbeat {running.heartbeat_s:g} s. Ctrl-C ends the server.")
        sys.stdout.flush()
        while not ended.wait(0.5):  # an endless wait would block Ctrl-C on some systems
            pass


def certificate(
    name: str,
    *,
    out: Path = Path(),
    host: list[str] | None = None,
    days: Annotated[int, typer.Option(min=1)] = 365,
) -> None:
    """Make a self-signed certificate and its key for an OPC UA client or server.

    Options
    -------
    name
        Name of the files and of the application: NAME.pem, NAME.key.
    out
        Folder for both files.
    host
        Name of the computer; repeatable; default: this computer.
    days
        Days of validity.

    Examples
    --------
    pneudrive rig certificate server --out certificates
    """
    terminal.show_paths(*access.make_certificate(out, name, host, days))
