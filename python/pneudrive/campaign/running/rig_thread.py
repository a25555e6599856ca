"""The one thread that uses a rig: a laboratory's code need not be thread-safe."""

from __future__ import annotations

import threading
from concurrent.futures import Future, wait
from typing import TYPE_CHECKING, Any

from pneudrive.rig.job_thread import JobThread

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.rig.interface import Rig

#: Longest time for a rig to come to rest before the campaign ends without it, s.
STOP_S = 30.0


class RigThread:
    """A thread that runs one job after the other; other threads may call `Rig.stop` only, at any time.

    Parameters
    ----------
    rig : Rig

    Attributes
    ----------
    interrupted : threading.Event
        Set while the present job must end as soon as possible.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.interrupted = threading.Event()
        self._at_rest = False
        self._thread = JobThread("pneudrive-rig")
        self._last: Future[Any] = self._thread.start(lambda: None)

    def start(self, job: Callable[[Rig], Any], *, moves: bool = True) -> Future[Any]:
        """Run a job after the previous one.

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
        """Bring the axis to rest and release the pressure immediately.

        Returns
        -------
        str
            Why the rig may not be at rest, in words; empty if it is at rest.
        """
        if self._at_rest:
            return ""
        self.interrupted.set()
        trouble = _call_within(STOP_S, self.rig.stop)
        if not self._last.done():
            wait([self._last], STOP_S)
            if not self._last.done():
                return trouble or f"the rig did not return within {STOP_S:g} s"
            trouble = _call_within(STOP_S, self.rig.stop)  # a verb under way may have started the axis again
        self._at_rest = not trouble
        return trouble

    def close(self) -> None:
        """End the thread after its work."""
        self._thread.close()


def _call_within(seconds: float, call: Callable[[], None]) -> str:
    """Call a function with a time limit; return its error, if any."""
    thread = JobThread("pneudrive-stop")
    answer = thread.start(call)
    thread.close()
    try:
        answer.result(seconds)
    except Exception as error:  # no error of a laboratory's code may stop this
        silent = f"the rig did not answer within {seconds:g} s"
        return (str(error) or type(error).__name__) if answer.done() else silent
    return ""
