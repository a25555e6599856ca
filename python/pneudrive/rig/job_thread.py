"""Thread for calls of a rig: one job after the other, each with its result."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

Answer = TypeVar("Answer")


class JobThread:
    """Thread that runs one job after the other. A job that never returns does not prevent the process from ending.

    Parameters
    ----------
    name : str
        Name of the thread.
    """

    def __init__(self, name: str) -> None:
        self._jobs: queue.SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def _work(self) -> None:
        while (given := self._jobs.get()) is not None:
            future, job = given
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(job())
            except BaseException as error:  # any exception of a lab's code goes to the caller
                future.set_exception(error)

    def start(self, job: Callable[[], Answer]) -> Future[Answer]:
        """Run a job after the previous one."""
        future: Future[Answer] = Future()
        self._jobs.put((future, job))
        return future

    def close(self, wait_s: float = 0.0) -> None:
        """End the thread after its last job, and wait for the end up to a given time."""
        self._jobs.put(None)
        self._thread.join(wait_s)
