"""Python of the user's own: who may have it run. One rule, for everything that can be written in Python.

Code runs because the command or call of this run names it. A file that is read (a campaign folder, a description) may
say which code was used, but that alone never runs anything: whoever goes on names the code again, or allows it by the
SHA-256 of its file, which no other file has.
"""

from __future__ import annotations

import hashlib
import sys
import traceback
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from pneudrive.errors import PneudriveError, nearest

if TYPE_CHECKING:
    from collections.abc import Callable


def split(source: str) -> tuple[str, str] | None:
    """Split ``own.py:make`` or ``package.module:Class`` into module and name; None where it names no code."""
    module, _, name = source.rpartition(":")
    return (module, name) if module and name.isidentifier() else None


def sha256(source: str) -> str:
    """Give the SHA-256 of the file in which code stands; empty where it is named as a module or cannot be read."""
    module, _ = split(source) or ("", "")
    try:
        return hashlib.sha256(Path(module).read_bytes()).hexdigest() if module.endswith(".py") else ""
    except OSError:
        return ""


def load(source: str, kind: type[PneudriveError]) -> Callable[..., Any]:
    """Import code that the user of this run has named.

    Parameters
    ----------
    source : str
        ``own.py:make`` or ``package.module:Class``.
    kind : type
        Of the errors.

    Raises
    ------
    PneudriveError
        Of that kind: there is no such file, module or name, or its code fails, which the message says with file and
        line.
    """
    module, name = split(source) or (source, "")
    is_file = module.endswith(".py")
    found = guarded(source, kind, lambda: _from_file(module, None, kind) if is_file else import_module(module))
    return _named(found, source, name, kind)


def load_allowed(
    source: str, allowed: str | None, found_in: str, option: str, kind: type[PneudriveError]
) -> Callable[..., Any]:
    """Import code that a file has named, if the user of this run has allowed it by its hash.

    Parameters
    ----------
    source : str
        As for `load`.
    allowed : str or None
        SHA-256 that the user has given in this run.
    found_in : str
        The file that names it.
    option : str
        By which a user names code: ``--rig``.
    kind : type
        Of the errors.

    Raises
    ------
    PneudriveError
        As for `load`; or the code is not allowed, has changed, or is no file. Modules beside the file are not found:
        their hash was not given.
    """
    module, name = split(source) or (source, "")
    there = sha256(source)
    remedy = f"Look at the code. Then name it: {option} {source}"
    if allowed is None or not there:
        raise kind(
            "the code that this file names was not named in this run, so it does not run",
            where=found_in,
            value=f"{source}{f', SHA-256 {there}' if there else ''}",
            rule="a file does not decide what is imported",
            remedy=f"{remedy}{f', or allow it: --allow-code {there}' if there else ''}",
        )
    if allowed.strip().lower() != there:
        raise kind(
            "the code is not the one that was allowed",
            where=module,
            value=f"SHA-256 {there}",
            rule=f"--allow-code {allowed}",
            remedy=f"It has changed. {remedy}",
        )
    found = guarded(source, kind, lambda: _from_file(module, there, kind))
    return _named(found, source, name, kind)


def guarded(source: str, kind: type[PneudriveError], work: Callable[[], Any]) -> Any:  # noqa: ANN401 - what `work` gives
    """Call foreign code; what it raises becomes one message with file and line."""
    try:
        return work()
    except PneudriveError:
        raise
    except Exception as error:
        raise kind(f"{source} fails: {type(error).__name__}: {error}", where=_place(error)) from error


def _named(found: ModuleType, source: str, name: str, kind: type[PneudriveError]) -> Callable[..., Any]:
    made = getattr(found, name, None)
    if not callable(made):
        known = [key for key, value in vars(found).items() if callable(value) and not key.startswith("_")]
        raise kind(f"{source}: there is no function or class of that name", remedy=nearest(name, known))
    return made


def _from_file(file: str, expected: str | None, kind: type[PneudriveError]) -> ModuleType:
    """Run a file as a module: its own bytes, never a compiled copy beside it, which could be of something else."""
    path = Path(file)
    if not path.is_file():
        raise kind(f"there is no file {path}")
    data = path.read_bytes()
    if expected is not None and hashlib.sha256(data).hexdigest() != expected:
        raise kind(f"{path} has just changed")
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    sys.modules[path.stem] = module  # dataclasses look their module up
    folder = str(path.resolve().parent)
    if expected is None and folder not in sys.path:  # as when Python runs it: modules beside it can be imported
        sys.path.insert(0, folder)
    exec(compile(data, str(path), "exec", dont_inherit=True), vars(module))
    return module


def _place(error: Exception) -> str | None:
    if isinstance(error, SyntaxError):
        return f"{error.filename}:{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename}:{frames[-1].lineno}" if frames else None
