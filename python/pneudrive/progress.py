"""Progress and cancellation of a long call."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TypeAlias, TypeVar

from pneudrive.errors import Cancelled

T = TypeVar("T")

#: Called as ``progress(done, total, task)``; see `Watch`.
Progress: TypeAlias = Callable[[float, float, str], None]

LEAST_PAUSE_S = 0.1  # the callback is called at most this often: no caller can read faster


class Flag(Protocol):
    """Protocol of a cancel flag, such as `threading.Event` or `multiprocessing.Event`."""

    def is_set(self) -> bool:
        """Return whether the call should end."""
        ...


class Watch:
    """Progress callback and cancel flag of one long call, passed to the functions that take time.

    Parameters
    ----------
    progress : callable, optional
        Called as ``progress(done, total, task)``, at most every 0.1 s and at the end of each task. `done` and `total`
        are counts or seconds of simulated time. `total` is 0 if unknown. `task` names the task.
    cancel : object with ``is_set()``, optional
        For example a `threading.Event`. If the flag is set, the call raises `Cancelled` at its next check.

    Examples
    --------
    >>> said = []
    >>> watch = Watch(lambda done, total, task: said.append(f"{task}: {done:g} of {total:g}"))
    >>> list(watch.each([10, 20], "recordings"))
    [10, 20]
    >>> said
    ['recordings: 0 of 2', 'recordings: 2 of 2']
    """

    def __init__(self, progress: Progress | None = None, cancel: Flag | None = None) -> None:
        self._progress, self._cancel = progress, cancel
        self._last = float("-inf")

    def look(self) -> None:
        """Check the flag, and end the call if it is set.

        Raises
        ------
        Cancelled
            The flag is set.
        """
        if self._cancel is not None and self._cancel.is_set():
            raise Cancelled("the call was cancelled", remedy="Finished parts are kept; repeat the call to continue.")

    def tell(self, done: float, total: float, task: str) -> None:
        """Report progress to the callback, and end the call if the flag is set.

        Raises
        ------
        Cancelled
            The flag is set.
        """
        self.look()
        if self._progress is None:
            return
        now = time.monotonic()
        if now - self._last >= LEAST_PAUSE_S or done >= total > 0:
            self._last = now
            self._progress(done, total, task)

    def each(self, items: Iterable[T], task: str) -> Iterator[T]:
        """Yield the items one by one, and report the number of finished items."""
        known = list(items)
        for i, item in enumerate(known):
            self.tell(i, len(known), task)
            yield item
        self.tell(len(known), len(known), task)


UNWATCHED = Watch()
