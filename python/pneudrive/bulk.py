"""Many at once: small objects, none of which refers back to another, and work that waits for a disk or a process."""

from __future__ import annotations

import gc
from collections import deque
from contextlib import contextmanager
from itertools import chain, islice
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    Item = TypeVar("Item")
    Result = TypeVar("Result")


@contextmanager
def many_objects() -> Iterator[None]:
    """Leave off looking for circles among objects meanwhile: it takes a third of the time in which they are made."""
    looked = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looked:
            gc.enable()


def in_advance(work: Callable[[Item], Result], items: Iterable[Item], threads: int) -> Iterator[Result]:
    """Give the result of each item in turn, while threads work on those that come next: two for each thread.

    It pays for work during which other Python can run: files that are read and hashed, an answer that is waited for.
    """
    rest = iter(items)
    first = list(islice(rest, 2))
    if len(first) < 2:  # nothing comes next
        yield from map(work, first)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(threads) as pool:
        waiting = deque()
        try:
            for item in chain(first, rest):
                waiting.append(pool.submit(work, item))
                if len(waiting) > 2 * threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for left in waiting:
                left.cancel()
