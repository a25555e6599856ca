"""Run of the chunks of a study, and a folder of finished chunks: a sealed Parquet file each, and the study."""

from __future__ import annotations

import json
import os
import time
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from pneudrive.ensemble.engine import DONE
from pneudrive.ensemble.study import Chunk
from pneudrive.errors import CommandError, SimulationError
from pneudrive.files.seal import damage
from pneudrive.simulation.trajectory import whole, write_frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    import polars as pl

    from pneudrive.ensemble.study import EnsembleStudy
    from pneudrive.progress import Watch


# --- Execution of chunks: in this process by default, or on the workers of a Dask cluster.
#
# Any object that maps a function over items is an executor. Results may come in any order, each exactly once. An item
# that is lost with its worker is run again.

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


# --- Run of the chunks of a study, and a folder of finished chunks: a sealed Parquet file each, and the study.

STUDY = "study.json"


class ChunkStore:
    """Chunks of one study, by their members. Existing chunks are not run again.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    study : EnsembleStudy
    members : int, optional
        Members of a chunk. A folder with chunks keeps its chunk size.

    Raises
    ------
    CommandError
        The folder contains another study or other files, or it is not writable.
    """

    def __init__(self, folder: Path, study: EnsembleStudy, members: int | None = None) -> None:
        self.folder, self.study = folder, study
        about = {"study": study.study_hash, "about": study.about()}
        path = folder / STUDY
        begun = self._begun(path)
        if begun is None:
            chunks = study.chunks(members)
            about["chunk_members"] = chunks[0].last
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                why = os.strerror(error.errno) if error.errno else str(error)
                raise CommandError(f"the folder {folder} cannot be made: {why}") from None
            with whole(path) as temporary:
                temporary.write_text(json.dumps(about, indent=1), encoding="utf-8")
        elif begun.get("study") != about["study"]:
            raise CommandError(
                f"{folder} holds results of another study",
                where=str(path),
                rule=f"the same {_different(begun.get('about', {}), about['about'])} as at the beginning of the folder",
                remedy="Choose another folder, or remove this one.",
            )
        self.chunks = study.chunks(members if begun is None else begun["chunk_members"])

    def _begun(self, path: Path) -> dict[str, Any] | None:
        try:
            begun = json.loads(path.read_text("utf-8"))
        except FileNotFoundError:
            if self.folder.is_dir() and any(self.folder.iterdir()):
                raise CommandError(
                    f"{self.folder} is not empty and holds no study", remedy="Choose a new folder."
                ) from None
            return None
        except (OSError, ValueError) as error:
            raise CommandError(f"{path} cannot be read: {error}") from None
        if not isinstance(begun, dict) or not isinstance(begun.get("chunk_members"), int):
            raise CommandError(f"{path} is not a folder of a study", remedy="Choose another folder.")
        return begun

    def path(self, chunk: Chunk) -> Path:
        """Return the file of a chunk."""
        return self.folder / f"members-{chunk.first:012d}.parquet"

    def missing(self) -> list[Chunk]:
        """Return the chunks to run: those without a file, or with a damaged file."""
        return [chunk for chunk in self.chunks if not self._is_whole(self.path(chunk))]

    @staticmethod
    def _is_whole(path: Path) -> bool:
        try:
            return damage(path.read_bytes()) is None
        except FileNotFoundError:
            return False

    def write(self, frame: pl.DataFrame) -> None:
        """Store a finished chunk.

        Raises
        ------
        CommandError
            The chunk cannot be written, for example on a full disk. Earlier chunks are kept.
        """
        first = frame["member"][0]
        write_frame(
            frame,
            self.path(Chunk(first, first + frame.height)),
            {"pneudrive": json.dumps({"study": self.study.study_hash})},
        )

    def frames(self) -> Iterator[pl.DataFrame]:
        """Yield the chunks in order."""
        import polars as pl

        for chunk in self.chunks:
            yield pl.read_parquet(self.path(chunk))

    def failed(self) -> int:
        """Return the number of failed members."""
        import polars as pl

        frames = (pl.read_parquet(self.path(chunk), columns=["status"]) for chunk in self.chunks)
        return sum(int((frame["status"] != DONE).sum()) for frame in frames)

    def remove(self) -> None:
        """Remove the folder with all chunks."""
        for chunk in self.chunks:
            self.path(chunk).unlink(missing_ok=True)
        (self.folder / STUDY).unlink(missing_ok=True)
        self.folder.rmdir()


def _different(before: dict[str, Any], now: dict[str, Any]) -> str:
    """Name the differences between two studies."""
    names = {"description_hash": "drive", "duration_s": "duration"}
    differ = [names.get(key, key) for key in now if before.get(key) != now[key]]
    return ", ".join(differ) or "study"


def results(
    study: EnsembleStudy, store: ChunkStore | None, members: int | None, executor: Executor | None, watch: Watch
) -> Iterator[pl.DataFrame]:
    """Run the missing chunks of a study, store each, and yield it.

    Raises
    ------
    Cancelled
        The flag of `watch` is set.
    """
    chunks = study.chunks(members) if store is None else store.missing()
    total = study.rows.size
    done = total - sum(chunk.last - chunk.first for chunk in chunks)
    # A cluster runs one chunk in each of its threads at a time.
    here = executor is None or isinstance(executor, InProcess)
    source = study if here else replace(study, threads=study.threads or 1)
    items = ((source.part(chunk), chunk) for chunk in chunks)

    def look(count: float) -> None:
        watch.tell(done + count, total, "members simulated")

    look(0)
    for frame in (executor or InProcess()).map((lambda item: item[0].run(item[1], look)) if here else run_part, items):
        if store is not None:
            store.write(frame)
        done += frame.height
        look(0)
        yield frame


def run_part(item: tuple[EnsembleStudy, Chunk]) -> pl.DataFrame:
    """Run one chunk, in any process."""
    study, chunk = item
    return study.run(chunk)
