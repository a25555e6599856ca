"""The one thread that a rig is used from, so that a laboratory's own code need not be safe for several."""

from __future__ import annotations

import threading
from concurrent.futures import Future, wait
from typing import TYPE_CHECKING, Any

from pneudrive.rig.job_thread import JobThread

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.rig.interface import Rig

#: How long a rig may take to come to rest before the campaign ends without it, s.
STOP_S = 30.0


class RigThread:
    """Runs one job after the other on a thread of its own; only `Rig.stop` is called from others too, at any time.

    Parameters
    ----------
    rig : Rig

    Attributes
    ----------
    interrupted : threading.Event
        Set while the present job is to end as soon as it can.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.interrupted = threading.Event()
        self._at_rest = False
        self._thread = JobThread("pneudrive-rig")
        self._last: Future[Any] = self._thread.start(lambda: None)

    def start(self, job: Callable[[Rig], Any], *, moves: bool = True) -> Future[Any]:
        """Run a job after the one before it.

        Parameters
        ----------
        job : callable
            Takes the rig.
        moves : bool
            Whether the axis may move, or the pressure change.
        """
        self.interrupted.clear()
        self._at_rest = self._at_rest and not moves
        self._last = self._thread.start(lambda: job(self.rig))
        return self._last

    def rest(self) -> str:
        """Bring the axis to rest and release the pressure, whatever the thread is doing.

        Returns
        -------
        str
            Why the rig may not be at rest, in words; empty where it is.
        """
        if self._at_rest:
            return ""
        self.interrupted.set()
        trouble = _call_within(STOP_S, self.rig.stop)
        if not self._last.done():
            wait([self._last], STOP_S)
            if not self._last.done():
                return trouble or f"the rig has not come back within {STOP_S:g} s"
            trouble = _call_within(STOP_S, self.rig.stop)  # what was on its way may have started the axis again
        self._at_rest = not trouble
        return trouble

    def close(self) -> None:
        """End the thread when its work is done."""
        self._thread.close()


def _call_within(seconds: float, call: Callable[[], None]) -> str:
    """Call, but do not wait for ever; say what went wrong."""
    thread = JobThread("pneudrive-stop")
    answer = thread.start(call)
    thread.close()
    try:
        answer.result(seconds)
    except Exception as error:  # whatever a lab's own code raises: it must not keep us from going on
        silent = f"the rig has not answered within {seconds:g} s"
        return (str(error) or type(error).__name__) if answer.done() else silent
    return ""
