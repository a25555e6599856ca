"""``pneudrive rig``: serve a rig over OPC UA, and what its protection needs."""

from __future__ import annotations

import signal
import sys
import threading
from pathlib import Path
from typing import Annotated

import typer

from pneudrive.cli.groups import group
from pneudrive.cli.options import option

rig = group(dict.fromkeys(("serve", "certificate", "user"), "pneudrive.cli.rig"))
LOOPBACK = ("127.0.0.1", "localhost", "::1")


@rig.callback()
def _rig() -> None:
    """Rigs behind OPC UA: serve one, make certificates, keep users."""


def serve(
    rig: Annotated[str, typer.Argument(help="Ready rig, rig file, or own code as own_rig.py:make_rig.")] = "default",
    port: Annotated[int, typer.Option(help="Port; 0 takes a free one.", min=0, max=65535)] = 4840,
    bind: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    pace: Annotated[float, typer.Option(help="1: in real time; 10: ten times faster; 0: as fast as it goes.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Seed of all noise of a simulated rig.")] = 0,
    map: Annotated[Path | None, typer.Option(help="Node map; default: the one that is shipped.")] = None,  # noqa: A002
    heartbeat: Annotated[
        str, typer.Option(help="The axis stops where the client is silent for longer; default: as the map says.")
    ] = "",
    certificate: Annotated[
        Path | None, typer.Option(help="Certificate of this server; everything is then signed and encrypted.")
    ] = None,
    key: Annotated[
        Path | None, typer.Option(help="Private key of the certificate; default: the same name with .key.")
    ] = None,
    trust: Annotated[
        list[Path] | None, typer.Option(help="Certificate of a client that may connect; repeatable.")
    ] = None,
    user_file: Annotated[Path | None, typer.Option(help="Users that may log in; made by `pneudrive rig user`.")] = None,
    trust_user: Annotated[list[Path] | None, typer.Option(help="Certificate of a user; repeatable.")] = None,
    unprotected: Annotated[
        bool, typer.Option("--unprotected", help="Let anyone on the network command the axis.")
    ] = False,
) -> None:
    """Serve a rig over OPC UA, behind the nodes of a map, until Ctrl-C."""
    from pneudrive.errors import CommandError
    from pneudrive.rig.loading import load_rig
    from pneudrive.rig.opcua.access import Protection
    from pneudrive.rig.opcua.nodes import load_map
    from pneudrive.rig.opcua.server import RigServer
    from pneudrive.units import parse

    protection = Protection.of(certificate, key, trust, user_file, trust_user)
    if bind not in LOOPBACK and certificate is None and not unprotected:
        raise CommandError(
            f"--bind {bind} without --certificate",
            rule="whoever reaches this address could move the axis",
            remedy="name certificates (pneudrive rig certificate), or say --unprotected",
        )
    if pace < 0.0 or 0.0 < pace < 1.0:
        raise CommandError(f"--pace {pace:g}", rule="0, or at least 1")
    with option("--heartbeat"):
        heartbeat_s = parse(heartbeat, "s") if heartbeat else None
    if heartbeat_s is not None and heartbeat_s <= 0.0:
        raise CommandError(f"--heartbeat {heartbeat}", rule="greater than zero")
    bench = load_rig(rig, seed, pace or None)
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    with RigServer(bench, load_map(map), bind, port, protection, heartbeat_s) as server:
        name = bench.identity().name
        typer.echo(f"{name} at {server.url} with seed {seed}; heartbeat {server.heartbeat_s:g} s. Ctrl-C ends it.")
        sys.stdout.flush()
        while not ended.wait(0.5):  # a wait without end would not let Ctrl-C through everywhere
            pass


def certificate(
    name: Annotated[str, typer.Argument(help="Names the files and the application: NAME.pem, NAME.key.")],
    out: Annotated[Path, typer.Option(help="Folder for both files.")] = Path(),
    host: Annotated[list[str] | None, typer.Option(help="Name of the computer; repeatable; default: this one.")] = None,
    days: Annotated[int, typer.Option(help="How long it is valid.", min=1)] = 365,
) -> None:
    """Make a self-signed certificate of an OPC UA client or server, and its key."""
    from pneudrive.rig.opcua.access import make_certificate

    for path in make_certificate(out, name, host, days):
        typer.echo(str(path))


def user(
    name: Annotated[str, typer.Argument(help="Name to log in with.")],
    user_file: Annotated[Path, typer.Option(help="File of users; it keeps salted hashes, no passwords.")],
) -> None:
    """Add a user who may log in, or change the password of one. It is asked for, or read from standard input."""
    from pneudrive.rig.opcua.access import add_user

    if sys.stdin.isatty():
        password = typer.prompt("Password", hide_input=True, confirmation_prompt=True)
    else:
        password = sys.stdin.readline().rstrip("\r\n")
    add_user(user_file, name, password)
    typer.echo(str(user_file))
