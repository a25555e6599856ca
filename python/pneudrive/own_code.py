"""Code of users, and the rule that decides whether it may run.

Code runs only if the user names it in the command or call. A file (a campaign folder, a description) may name the code
that was used, but pneudrive does not run code only because a file names it. The user must name the code again, or
allow it by the SHA-256 of its file.
"""

from __future__ import annotations

import hashlib
import sys
import traceback
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from pneudrive.errors import ErrorKind, PneudriveError, nearest


def split(source: str) -> tuple[str, str] | None:
    """Split ``own.py:make`` or ``package.module:Class`` into module and name. None if the text has another form."""
    module, _, name = source.rpartition(":")
    return (module, name) if module and name.isidentifier() else None


def sha256(source: str) -> str:
    """Return the SHA-256 of the file that holds the code. Empty for a module name or an unreadable file."""
    module, _ = split(source) or ("", "")
    try:
        return hashlib.sha256(Path(module).read_bytes()).hexdigest() if module.endswith(".py") else ""
    except OSError:
        return ""


def load(source: str, kind: ErrorKind, expected: str | None = None) -> Callable[..., Any]:
    """Import code that the user of this run has named.

    Parameters
    ----------
    source : str
        ``own.py:make`` or ``package.module:Class``.
    kind : type
        Class of the errors.
    expected : str, optional
        SHA-256 that the file must have. Default: any.

    Raises
    ------
    PneudriveError
        An error of `kind`: the file, module or name does not exist, or the code fails. The message gives file and line.
    """
    module, name = split(source) or (source, "")
    is_file = module.endswith(".py")
    found = guarded(source, kind, lambda: _from_file(module, expected, kind) if is_file else import_module(module))
    made = getattr(found, name, None)
    if not callable(made):
        known = [key for key, value in vars(found).items() if callable(value) and not key.startswith("_")]
        raise kind(f"{source}: the module has no function or class of this name", remedy=nearest(name, known))
    return made


def load_allowed(
    source: str,
    allowed: str | None,
    found_in: str,
    option: str,
    kind: ErrorKind,
) -> Callable[..., Any]:
    """Import code that a file has named, if the user of this run has allowed it by its hash.

    Parameters
    ----------
    source : str
        As for `load`.
    allowed : str or None
        SHA-256 that the user gave in this run.
    found_in : str
        File that names the code.
    option : str
        Option by which a user names code: ``--rig``.
    kind : type
        Class of the errors.

    Raises
    ------
    PneudriveError
        As for `load`; also if the code is not allowed, has changed, or is not in a file. Modules next to the file are
        not imported, because their hash is not checked.
    """
    module, _ = split(source) or (source, "")
    there = sha256(source)
    remedy = f"Check the code, then name it: {option} {source}"
    if allowed is None or not there:
        raise kind(
            "the file names custom code that this command or call does not allow",
            where=found_in,
            value=f"{source}{f', SHA-256 {there}' if there else ''}",
            rule="only the user decides which code runs",
            remedy=f"{remedy}{f', or allow it: --allow-code {there}' if there else ''}",
        )
    if allowed.strip().lower() != there:
        raise kind(
            "the code differs from the allowed code",
            where=module,
            value=f"SHA-256 {there}",
            rule=f"--allow-code {allowed}",
            remedy=f"The file has changed. {remedy}",
        )
    return load(source, kind, there)


def guarded(source: str, kind: ErrorKind, work: Callable[[], Any]) -> Any:  # noqa: ANN401 - result of `work`
    """Call a user's code. Turn an exception into one message with file and line."""
    try:
        return work()
    except PneudriveError:
        raise
    except (Exception, SystemExit) as error:
        raise kind(f"{source} fails: {type(error).__name__}: {error}", where=place_of(error)) from error


def _from_file(file: str, expected: str | None, kind: ErrorKind) -> ModuleType:
    """Run a file as a module, always from its source. A compiled copy could come from other code."""
    path = Path(file)
    if not path.is_file():
        raise kind(f"there is no file {path}")
    data = path.read_bytes()
    if expected is not None and hashlib.sha256(data).hexdigest() != expected:
        raise kind(f"{path} changed while it was read")
    module = ModuleType(path.stem)
    module.__file__ = str(path)
    sys.modules[path.stem] = module  # dataclasses look up their module there
    folder = str(path.resolve().parent)
    if expected is None and folder not in sys.path:  # as for a script: modules in its folder can be imported
        sys.path.insert(0, folder)
    exec(compile(data, str(path), "exec", dont_inherit=True), vars(module))
    return module


def place_of(error: BaseException) -> str | None:
    """Return file and line at which an exception was raised."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}:{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename}:{frames[-1].lineno}" if frames else None
