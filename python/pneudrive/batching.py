"""Faster work on many items: pause garbage collection, read ahead in threads, or use worker processes."""

from __future__ import annotations

import gc
import json
import os
import pickle
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from typing import TypeVar

from pneudrive.errors import PneudriveError, RecordingError

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_WORKERS = 8  # each takes about 300 MB
THREADS = ("POLARS_MAX_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")  # variables: each worker has one thread
EXIT_INTERRUPTED = 130
#: Program of a child process: it has the import path of this process, and calls `main` of a module.
_START = (
    "import json,signal,sys;signal.signal(signal.SIGINT,signal.default_int_handler);"
    "sys.path[:]=json.loads(sys.argv.pop(1));"
    "from importlib import import_module;import_module(sys.argv.pop(1)).main()"
)


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def many_objects() -> Iterator[None]:
    """Suspend the cyclic garbage collector, which otherwise takes a third of the time when many objects are created."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def in_advance(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    threads: int,
    ahead: int = 2,
) -> Iterator[Result]:
    """Yield the result of each item in order, while threads work on the next ``ahead * threads`` items.

    Use this for work that releases the interpreter lock, such as reading and hashing files.
    """
    with ThreadPoolExecutor(threads) as pool:
        waiting = deque()
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                if len(waiting) > ahead * threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for left in waiting:
                left.cancel()


def share_out(
    work: Callable[..., list[Result]], items: Sequence, *rest: object, least: int, processes: int | None
) -> list[Result]:
    """Call ``work(items, *rest)``, in several processes if there is enough work.

    Parameters
    ----------
    work : callable
        A function of a module that returns a list with one result for each item.
    items : sequence
    *rest
        Further arguments, the same in each call.
    least : int
        Smallest number of items for which processes save more time than their start takes.
    processes : int, optional
        Number of processes. Default: one for each available processor, at most 8.

    Returns
    -------
    list
        One result for each item, in the order of the items.
    """
    number = min(processes or min(processors(), MOST_WORKERS), len(items))
    if len(items) < least or number < 2:
        return work(items, *rest)
    parts = in_processes(work, [(items[first::number], *rest) for first in range(number)])
    return [parts[place % number][place // number] for place in range(len(items))]


def in_processes(work: Callable[..., Result], tasks: Sequence[tuple]) -> list[Result]:
    """Call a function once for each task, each call in its own process. Return the results in the order of the tasks.

    Parameters
    ----------
    work : callable
        A function of a module.
    tasks : sequence of tuple
        Arguments of each call.

    Raises
    ------
    RecordingError
        If a process ends without a result.
    PneudriveError
        If `work` raises it.
    """
    command, environment = child_command(__name__), {**os.environ, **dict.fromkeys(THREADS, "1")}
    pipe = subprocess.PIPE
    processes = [subprocess.Popen(command, stdin=pipe, stdout=pipe, env=environment) for _ in tasks]

    def call(process: subprocess.Popen[bytes], task: tuple) -> Result:
        answer, _ = process.communicate(pickle.dumps((work, task)))
        if process.returncode in (-signal.SIGINT, EXIT_INTERRUPTED):
            raise KeyboardInterrupt
        if process.returncode != 0:
            status = f"a worker process ended with status {process.returncode}"
            raise RecordingError(status, remedy="see the message of that process above")
        with many_objects():
            result = pickle.loads(answer)
        if isinstance(result, PneudriveError):
            raise result
        return result

    with ThreadPoolExecutor(len(tasks)) as threads:  # each waits for one process
        futures = [threads.submit(call, *pair) for pair in zip(processes, tasks, strict=True)]
        try:
            for future in as_completed(futures):
                future.result()  # the first error ends the other processes
        finally:
            for process in processes:
                process.kill()
    return [future.result() for future in futures]


def child_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs ``main`` of a module of pneudrive in a child process.

    ``python -m`` would search the current folder first, and could run a file numpy.py there. Ctrl-C ends the child even
    if this process ignores Ctrl-C, for example a server started by a script.
    """
    return [sys.executable, "-I", "-c", _START, json.dumps([p for p in sys.path if p]), module, *arguments]


def main() -> None:
    """Do the work of a child process: read (function, arguments) from stdin, write the result or the error."""
    with many_objects():
        work, task = pickle.load(sys.stdin.buffer)
    try:
        result: object = work(*task)
    except PneudriveError as error:
        result = error
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
    pickle.dump(result, sys.stdout.buffer)
