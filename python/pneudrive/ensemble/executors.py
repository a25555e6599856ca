"""Execution of chunks: in this process by default, or on the workers of a Dask cluster.

Any object that maps a function over items is an executor. Results may come in any order, each exactly once. An item
that is lost with its worker is run again.
"""

from __future__ import annotations

import time
from itertools import islice
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from pneudrive.errors import SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Items on the way for each thread of the workers: one runs, the others wait there.
AHEAD = 3
#: How often it is looked whether workers are there, and for how long none may be, s.
LOOK_S, NO_WORKER_S = 5.0, 300.0


class Executor(Protocol):
    """Executor of the chunks of a study."""

    def map(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield the result of `work` for each item, in any order.

        Parameters
        ----------
        work : callable
            Function that can be pickled, has no side effects, and returns the same for an item on any machine.
        items : iterable
            Items that can be pickled. They are taken when needed.
        """
        ...


class InProcess:
    """One item after the other. The members of each item run on all processors."""

    def map(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield the results in order."""
        return map(work, items)


class DaskExecutor:
    """Items on the workers of a Dask cluster (``pip install pneudrive[dask]``).

    Parameters
    ----------
    client : distributed.Client
        Connected to a cluster whose workers have this version of pneudrive.

    Examples
    --------
    On this machine::

        from dask.distributed import Client
        with Client(n_workers=2, threads_per_worker=1) as client:
            pn.simulate_many(drive, ..., executor=pn.ensemble.DaskExecutor(client))
    """

    def __init__(self, client: Any) -> None:  # noqa: ANN401 - distributed is not imported to name its class
        self.client = client

    def map(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield the results as they arrive. Dask repeats an item of a lost worker on another one.

        Raises
        ------
        SimulationError
            An item lost its worker repeatedly, or no worker is left.
        """
        from distributed import wait  # pyright: ignore[reportMissingImports]
        from distributed.scheduler import KilledWorker  # pyright: ignore[reportMissingImports]

        waiting = iter(items)
        ahead = AHEAD * max(1, sum(self.client.nthreads().values()))
        on_the_way = {self.client.submit(work, item, pure=False) for item in islice(waiting, ahead)}
        seen = time.monotonic()
        try:
            while on_the_way:
                try:
                    done = wait(on_the_way, timeout=LOOK_S, return_when="FIRST_COMPLETED").done
                    future = next(iter(done))
                    result = future.result(timeout=LOOK_S)
                except KilledWorker as error:
                    raise SimulationError(
                        "a chunk of the study lost its worker again and again",
                        value=error,
                        remedy="Check the memory of the workers, use smaller chunks, or let Dask try more often: its "
                        "setting distributed.scheduler.allowed-failures.",
                    ) from None
                except TimeoutError:  # chunks take long, or the lost chunk of a worker is repeated
                    seen = self._still_there(seen)
                    continue
                seen = time.monotonic()
                on_the_way.discard(future)
                on_the_way |= {self.client.submit(work, item, pure=False) for item in islice(waiting, 1)}
                yield result
        finally:
            self.client.cancel(list(on_the_way))

    def _still_there(self, seen: float) -> float:
        """Return the time at which a worker was last seen. Raise an error if this is long ago."""
        if self.client.nthreads():
            return time.monotonic()
        if time.monotonic() - seen > NO_WORKER_S:
            raise SimulationError(f"the cluster has had no worker for {NO_WORKER_S:g} s", remedy="Start workers.")
        return seen
