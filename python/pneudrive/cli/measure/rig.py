"""``pneudrive rig``: serve a rig over OPC UA; make certificates and users."""

from __future__ import annotations

import signal
import sys
import threading
from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.groups import group
from pneudrive.cli.options import quantity

rig = group(dict.fromkeys(("serve", "certificate", "user"), "pneudrive.cli.measure.rig"))
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@rig.callback()
def _rig() -> None:
    """Serve a rig over OPC UA, with certificates and users."""


def serve(
    rig: Annotated[str, typer.Argument()] = "default",
    port: Annotated[int, typer.Option(min=0, max=65535)] = 4840,
    bind: str = "127.0.0.1",
    pace: Annotated[float, typer.Option("--speed")] = 1.0,
    seed: int = 0,
    map: Path | None = None,  # noqa: A002
    heartbeat: str = "",
    certificate: Path | None = None,
    key: Path | None = None,
    trust: list[Path] | None = None,
    user_file: Path | None = None,
    unprotected: Annotated[bool, typer.Option("--unprotected")] = False,
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
    pace
        1: real time; 10: ten times faster; 0: as fast as possible.
    seed
        Seed of all noise of a simulated rig.
    map
        Node map; default: the one of the package.
    heartbeat
        The axis stops if the client is silent for longer; default: from the node map.
    certificate
        Certificate of this server; all messages are then signed and encrypted.
    key
        Private key of the certificate; default: the same name with .key.
    trust
        Certificate of a client that may connect; repeatable.
    user_file
        File of users that may log in; made by `pneudrive rig user`.
    unprotected
        Allow anyone on the network to command the axis.
    """
    from pneudrive.errors import CommandError
    from pneudrive.rig.loading import load_rig
    from pneudrive.rig.opcua.access import Protection
    from pneudrive.rig.opcua.nodes import load_map
    from pneudrive.rig.opcua.server import RigServer

    protection = Protection.of(certificate, key, trust, user_file)
    if bind not in LOOPBACK and certificate is None and not unprotected:
        raise CommandError(
            f"--bind {bind} needs --certificate",
            rule="anyone who reaches this address could move the axis",
            remedy="Give certificates (pneudrive rig certificate), or add --unprotected.",
        )
    if pace < 0.0 or 0.0 < pace < 1.0:
        raise CommandError(f"--speed {pace:g} is out of bounds", rule="0, or at least 1")
    heartbeat_s = quantity("--heartbeat", heartbeat, "s") if heartbeat else None
    if heartbeat_s is not None and heartbeat_s <= 0.0:
        raise CommandError(f"--heartbeat {heartbeat} is out of bounds", rule="greater than zero")
    bench = load_rig(rig, seed, pace or None)
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    with RigServer(bench, load_map(map), bind, port, protection, heartbeat_s) as server:
        name = bench.identity().name
        typer.echo(
            f"{name} at {server.url} with seed {seed}; heartbeat {server.heartbeat_s:g} s. Ctrl-C ends the server."
        )
        sys.stdout.flush()
        while not ended.wait(0.5):  # an endless wait would block Ctrl-C on some systems
            pass


def certificate(
    name: str,
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
    """
    from pneudrive.rig.opcua.access import make_certificate

    for path in make_certificate(out, name, host, days):
        typer.echo(str(path))


def user(
    name: str,
    user_file: Annotated[Path, typer.Option()],
) -> None:
    """Add a user, or change a password. The command asks for the password, or reads it from standard input.

    Options
    -------
    name
        Name of the user.
    user_file
        File of users; it keeps salted hashes, no passwords.
    """
    from pneudrive.rig.opcua.access import add_user

    if sys.stdin.isatty():
        password = typer.prompt("Password", hide_input=True, confirmation_prompt=True)
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    add_user(user_file, name, password)
    typer.echo(str(user_file))
