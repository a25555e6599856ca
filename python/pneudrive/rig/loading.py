"""From a name, a file or an address to a rig: one registry for every kind."""

from __future__ import annotations

from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import RigError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pneudrive.rig.interface import Rig

RIGS = Path(__file__).with_name("rigs")

#: kind -> ``module:function`` that makes such a rig, called as function(source, seed, pace). A kind is the scheme of
#: an address, ``kind = "..."`` at the top of a TOML file, or ``folder``. Imported on first use.
LOADERS: dict[str, str] = {
    "simulated": "pneudrive.rig.session:load_session",
    "opc-ua": "pneudrive.rig.opcua_client:load_opcua",
    "opc.tcp": "pneudrive.rig.opcua_client:load_opcua",
    "replay": "pneudrive.campaign.replay_sources:load_replay",
    "folder": "pneudrive.campaign.replay_sources:load_replay",
}


def shipped_rigs() -> dict[str, Path]:
    """Return the files of the simulated rigs that come with the package, by name."""
    default = {"default": RIGS.with_name("default.toml")}
    return default | {path.stem: path for path in sorted(RIGS.glob("*.toml"))}


def load_rig(source: str | Path = "default", seed: int = 0, pace: float | None = None) -> Rig:
    """Make a rig.

    Parameters
    ----------
    source : str or Path
        Name of a shipped rig (`shipped_rigs`), a rig file (TOML, its ``kind`` says which), a folder of recordings, an
        address such as ``opc.tcp://127.0.0.1:4840``, or a laboratory's own code as ``own_rig.py:make_rig`` or
        ``package.module:Class``: called without arguments, it gives a rig.
    seed : int
        Of everything that is random on a simulated rig; others ignore it.
    pace : float, optional
        Seconds of the rig per second of the clock on the wall, for a simulated rig or a replay: 1 is real time; None
        is as fast as it goes.

    Returns
    -------
    Rig

    Raises
    ------
    RigError
        If there is no such rig.
    DescriptionError
        If its file is wrong.
    """
    text = str(source)
    scheme, separator, rest = text.partition(":")
    if separator and rest.startswith("//"):
        return _loader(scheme, text)(text, seed, pace)
    known = shipped_rigs()
    path = known.get(text, Path(text))
    if path.is_dir():
        return _loader("folder", text)(str(path), seed, pace)
    if path.is_file() and path.suffix == ".toml":
        return _loader(_kind(path), text)(str(path), seed, pace)
    own, _, name = text.rpartition(":")
    if own and name.isidentifier():
        from pneudrive.rig.own import own_rig

        return own_rig(own, name)
    raise RigError(
        f"{text!r} is no rig", rule="a name, a TOML file, a folder or an address", remedy=nearest(text, known)
    )


@contextmanager
def opened(rig: Rig) -> Iterator[Rig]:
    """Close the connection to a rig that has one, whatever happens."""
    try:
        yield rig
    finally:
        close = getattr(rig, "close", None)
        if close is not None:
            close()


def _kind(path: Path) -> str:
    from pneudrive.describe import toml

    try:
        return str(toml.tomllib.loads(path.read_text(encoding="utf-8")).get("kind", "simulated"))
    except (OSError, UnicodeDecodeError, toml.tomllib.TOMLDecodeError) as error:
        raise RigError("the rig file cannot be read", where=str(path), value=str(error)) from error


def _loader(kind: str, source: str) -> Callable[[str, int, float | None], Rig]:
    if kind not in LOADERS:
        raise RigError(f"rigs of kind {kind!r} are not known", where=source, remedy=nearest(kind, LOADERS))
    module, _, name = LOADERS[kind].partition(":")
    return getattr(import_module(module), name)
