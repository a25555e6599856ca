"""Loading of rigs by name, file or address: one registry for every kind."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive import own_code
from pneudrive.errors import RigError, nearest
from pneudrive.rig.interface import Rig, closed_after, has_verbs

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager

RIGS = Path(__file__).with_name("rigs")

#: kind -> ``module:function`` that makes such a rig, called as function(source, seed, pace). A kind is the scheme of
#: an address, ``kind = "..."`` at the top of a TOML file, or ``folder``. Imported on first use.
LOADERS: dict[str, str] = {
    "simulated": "pneudrive.rig.simulated:load_session",
    "opc-ua": "pneudrive.rig.opcua.client:load_opcua",
    "opc.tcp": "pneudrive.rig.opcua.client:load_opcua",
    "replay": "pneudrive.campaign.replay:load_replay",
    "folder": "pneudrive.campaign.replay:load_replay",
}
CODE = "code"
#: Kinds that a file may name, as they only read data. Others run code, or move an axis and log in.
ONLY_DATA = ("simulated", "replay", "folder")


def shipped_rigs() -> dict[str, Path]:
    """Return the files of the simulated rigs that come with the package, by name."""
    default = {"default": RIGS.with_name("default.toml")}
    return default | {path.stem: path for path in sorted(RIGS.glob("*.toml"))}


def load_rig(
    source: str | Path = "default",
    seed: int = 0,
    pace: float | None = None,
    *,
    found_in: str | None = None,
    allow_code: str | None = None,
) -> Rig:
    """Return a rig.

    Parameters
    ----------
    source : str or Path
        Name of a shipped rig (`shipped_rigs`), a rig file (TOML with its ``kind``), a folder of recordings, or an
        address such as ``opc.tcp://127.0.0.1:4840``. A laboratory's own code is ``own_rig.py:make_rig`` or
        ``package.module:Class``, called without arguments.
    seed : int
        Seed of all random numbers of a simulated rig; other rigs ignore it.
    pace : float, optional
        Speed of a simulated rig or a replay relative to real time: 1 is real time; None is as fast as possible.
    found_in : str, optional
        File that names `source`, if the user has not named it in this run. Then only a simulated rig or a replay is
        allowed: the user names a rig that runs code, moves an axis or logs in.
    allow_code : str, optional
        SHA-256 of a file of custom code that may run although only a file names it.

    Returns
    -------
    Rig

    Raises
    ------
    RigError
        The rig does not exist, or a file must not name it.
    DescriptionError
        The rig file is not valid.
    """
    text = str(source)
    kind, name = _kind(text)
    if kind == CODE:
        if found_in is None:
            return _own_rig(name, own_code.load(name, RigError))
        return _own_rig(name, own_code.load_allowed(name, allow_code, found_in, "--rig", RigError))
    if found_in is not None and kind not in ONLY_DATA:
        raise RigError(
            f"only a file names the rig {text}, not this run",
            where=found_in,
            rule="only the user decides which axis moves and where to log in",
            remedy=f"If this is your rig, name it: --rig {text}",
        )
    if kind not in LOADERS:
        raise RigError(f"rigs of kind {kind!r} are not known", where=text, remedy=nearest(kind, LOADERS))
    module, _, function = LOADERS[kind].partition(":")
    return getattr(import_module(module), function)(name, seed, pace)


def _own_rig(source: str, make: Callable[[], Any]) -> Rig:
    """Call a laboratory's code, a function or class without arguments, and check that it returns a rig."""
    rig: Rig = own_code.guarded(source, RigError, make)
    if not has_verbs(rig, Rig):
        missing = [verb for verb in vars(Rig) if not verb.startswith("_") and not callable(getattr(rig, verb, None))]
        what = f"{source} returns {type(rig).__name__}, not a rig"
        raise RigError(what, value=f"it lacks {', '.join(missing)}", rule="the verbs of pneudrive.rig.Rig")
    return rig


def must_be_named(source: str) -> bool:
    """Return whether only the user of a run may name a rig, not a file."""
    try:
        return _kind(source)[0] not in ONLY_DATA
    except RigError:
        return False


def opened(rig: Rig) -> AbstractContextManager[Rig]:
    """Close the connection of a rig at the end of the block, also after an error."""
    return closed_after(rig)


def _kind(text: str) -> tuple[str, str]:
    """Return the kind of a rig, and its full name, address, file or folder."""
    scheme, separator, rest = text.partition(":")
    if separator and rest.startswith("//"):
        return scheme, text
    known = shipped_rigs()
    path = known.get(text, Path(text))
    if path.is_dir():
        return "folder", str(path)
    if path.is_file() and path.suffix == ".toml":
        return _said(path), str(path)
    if own_code.split(text) is not None:
        return CODE, text
    raise RigError(
        f"{text!r} is not a rig", rule="a name, a TOML file, a folder or an address", remedy=nearest(text, known)
    )


def _said(path: Path) -> str:
    from pneudrive.describe.files import toml

    return str(toml.read(path, RigError, "The guides on rigs show examples of rig files.")[0].get("kind", "simulated"))
