"""Work in worker processes: each reads one part of the files, so no process has all samples in memory."""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from typing import IO, TYPE_CHECKING, TypeVar

from pneudrive.batching import many_objects
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.files import child

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    Result = TypeVar("Result")

MOST_WORKERS = 8  # each takes about 300 MB
EXIT_INTERRUPTED = 130
POLL_S = 0.05


def workers() -> int:
    """Return a useful number of processes: one for each available processor, at most 8."""
    affinity = hasattr(os, "sched_getaffinity")  # not known on every system
    return min(len(os.sched_getaffinity(0)) if affinity else os.cpu_count() or 1, MOST_WORKERS)


def share_out(
    work: Callable[..., list[Result]], items: Sequence, *rest: object, least: int, processes: int | None = None
) -> list[Result]:
    """Call ``work(items, *rest)``, in several processes if there is enough work.

    Parameters
    ----------
    work : callable
        A function of a module that returns a list with one result for each item.
    items : sequence
    *rest
        Further arguments, equal for all.
    least : int
        Items below which starting processes costs more than it saves.
    processes : int, optional
        None: one for each processor.

    Returns
    -------
    list
        One result for each item, in their order.
    """
    number = processes or workers()
    if len(items) < least or number < 2:
        return work(items, *rest)
    places = [place for i in range(number) for place in range(i, len(items), number)]
    found = in_processes(work, [(items[i::number], *rest) for i in range(min(number, len(items)))])
    return [result for _, result in sorted(zip(places, found, strict=True), key=lambda pair: pair[0])]


def in_processes(work: Callable[..., list[Result]], tasks: Sequence[tuple]) -> list[Result]:
    """Call a function once for each task, each call in its own process.

    Parameters
    ----------
    work : callable
        A function of a module that returns a list.
    tasks : sequence of tuple
        Arguments of each call.

    Returns
    -------
    list
        The concatenated results in the order of the tasks.

    Raises
    ------
    RecordingError
        If a process dies.
    PneudriveError
        The error of `work`.
    """
    command = child.command("pneudrive.signals.pool")
    environment = {**os.environ, "POLARS_MAX_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    # Results come by files: a read from a pipe cannot be interrupted if a library's threads take the signal.
    with contextlib.ExitStack() as stack:
        running: list[tuple[subprocess.Popen, IO[bytes]]] = []
        stack.callback(_stop, running)
        for _ in tasks:  # start all of them before waiting for the first
            result = stack.enter_context(tempfile.TemporaryFile())
            running.append((subprocess.Popen(command, stdin=subprocess.PIPE, stdout=result, env=environment), result))
        for (process, _), task in zip(running, tasks, strict=True):
            _send(process, (work, task))
        while None in (ended := [process.poll() for process, _ in running]) and not any(ended):
            time.sleep(POLL_S)  # until all have ended, or one has failed
        return [item for process, result in running for item in _result(process, result)]


def _send(process: subprocess.Popen, task: object) -> None:
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):  # the worker died: its status shows it
        process.stdin.write(pickle.dumps(task))
        process.stdin.close()


def _result(process: subprocess.Popen, written: IO[bytes]) -> list:
    """Take the result of a worker that has ended, or raise the error that ended it."""
    if process.returncode is None:
        return []  # another one failed; its error is raised in its turn
    if process.returncode in (-signal.SIGINT, EXIT_INTERRUPTED):
        raise KeyboardInterrupt
    if process.returncode != 0:
        status = f"a worker process ended with status {process.returncode}"
        raise RecordingError(status, remedy="see the message of that process above")
    written.seek(0)
    with many_objects():
        result = pickle.load(written)
    if isinstance(result, PneudriveError):
        raise result
    return result


def _stop(running: list[tuple[subprocess.Popen, IO[bytes]]]) -> None:
    for process, _ in running:
        if process.poll() is None:
            process.kill()
            process.wait()


def main() -> None:
    """Do the work of a child process: read (function, arguments) from stdin, write the returned list or the error."""
    with many_objects():
        work, task = pickle.load(sys.stdin.buffer)
    try:
        result: object = work(*task)
    except PneudriveError as error:
        result = error
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
    pickle.dump(result, sys.stdout.buffer)
