"""A laboratory's own code as a rig; `pneudrive.own_code` says when it may run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive import own_code
from pneudrive.errors import RigError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.rig.interface import Rig

VERBS = ("identity", "limits", "state", "home", "set_pressure", "move", "hold", "acquire", "stop")


def own_rig(source: str, make: Callable[[], Any]) -> Rig:
    """Call what makes a rig, and check that it is one.

    Parameters
    ----------
    source : str
        What a message calls it: ``own_rig.py:make_rig``.
    make : callable
        A function or class that takes no arguments.

    Raises
    ------
    RigError
        The code fails, or what it gives lacks a verb of `pneudrive.rig.interface.Rig`.
    """
    rig: Rig = own_code.guarded(source, RigError, make)
    missing = [verb for verb in VERBS if not callable(getattr(rig, verb, None))]
    if missing:
        what = f"{source} gives {type(rig).__name__}, which is no rig"
        raise RigError(what, value=f"it lacks {', '.join(missing)}", rule="the verbs of pneudrive.rig.Rig")
    return rig
