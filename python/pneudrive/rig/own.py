"""A laboratory's own code as a rig: Python that runs because the user names it."""

from __future__ import annotations

import sys
import traceback
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.errors import PneudriveError, RigError, nearest
from pneudrive.rig.interface import Rig

if TYPE_CHECKING:
    from types import ModuleType

VERBS = ("identity", "limits", "state", "home", "set_pressure", "move", "hold", "acquire", "stop")


def own_rig(module: str, name: str) -> Rig:
    """Import a module and call what makes a rig in it.

    Parameters
    ----------
    module : str
        A file (``own_rig.py``), or the name of an importable module.
    name : str
        A function or class that takes no arguments.

    Raises
    ------
    RigError
        There is no such file, module or name; its code fails, which the message says with file and line; or what it
        gives lacks a verb of `pneudrive.rig.interface.Rig`.
    """
    source = f"{module}:{name}"
    try:
        found = _from_file(Path(module)) if module.endswith(".py") else import_module(module)
        make: Any = getattr(found, name, None)
        rig = make() if callable(make) else None
    except PneudriveError:
        raise
    except Exception as error:
        raise RigError(f"{source} fails: {type(error).__name__}: {error}", where=_place(error)) from error
    if not callable(make):
        known = [key for key, value in vars(found).items() if callable(value) and not key.startswith("_")]
        raise RigError(f"{source}: there is no function or class of that name", remedy=nearest(name, known))
    missing = [verb for verb in VERBS if not callable(getattr(rig, verb, None))]
    if missing:
        what = f"{source} gives {type(rig).__name__}, which is no rig"
        raise RigError(what, value=f"it lacks {', '.join(missing)}", rule="the verbs of pneudrive.rig.Rig")
    return rig  # type: ignore[return-value] - checked above


def _from_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise RigError(f"there is no file {path}")
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None, "a file that ends in .py has a loader"
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look their module up
    folder = str(path.resolve().parent)
    if folder not in sys.path:  # as when Python runs the file: modules beside it can be imported
        sys.path.insert(0, folder)
    spec.loader.exec_module(module)
    return module


def _place(error: Exception) -> str | None:
    if isinstance(error, SyntaxError):
        return f"{error.filename}:{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename}:{frames[-1].lineno}" if frames else None
