"""Study of many variants of one drive: its chunks, their execution and storage, and the labelled results.

A study holds all inputs that determine the results of its members. The results of a chunk depend only on the study
and the chunk's first and last member.
"""

from __future__ import annotations

import hashlib
import json
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from pneudrive import __version__
from pneudrive.ensemble.design import EnsembleDesign, Rows, design_of
from pneudrive.ensemble.outputs import STATE, SignalNames, member_plans, parted_starts, reductions
from pneudrive.ensemble.variation import DONE, Variation, run_members
from pneudrive.errors import CommandError, SimulationError, warn
from pneudrive.files import seal
from pneudrive.files.content import read_json
from pneudrive.files.writing import make_result_folder
from pneudrive.free.parameters import INITIAL
from pneudrive.lazy_names import upper
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.simulation.simulate import SOLVER, require, whole_number
from pneudrive.simulation.start import check_tolerance, start
from pneudrive.simulation.trajectory import meaning, save, write_frame, write_whole
from pneudrive.views import View

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    import polars as pl
    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.arrays import Array, Keyed, Plain
    from pneudrive.describe import Circuit, Drive
    from pneudrive.describe.tables.parts import Initial
    from pneudrive.ensemble.outputs import MemberPlans, Output, Reduction
    from pneudrive.simulation.command import Commands


# --- A study: everything that determines the results of its members, and the results of members.

#: Default number of members of a chunk.
CHUNK = 16384
#: Largest number of samples in memory at a time, over all signals that a chunk stores or a user function receives.
MOST_SAMPLES = 20_000_000


@dataclass(frozen=True, eq=False)
class EnsembleStudy:
    """Checked inputs of a study, in SI. They can be pickled and sent to another machine.

    Attributes
    ----------
    variation : Variation
        The drive, and the names of the numbers that vary.
    rows : Rows
    plans : MemberPlans
    rtol : float
    outputs : tuple of Reduction
    threads : int, optional
    first : int
        Index of the first member; greater than 0 for a part of a study.
    """

    variation: Variation
    rows: Rows
    plans: MemberPlans
    rtol: float
    outputs: tuple[Reduction, ...]
    threads: int | None = None
    first: int = 0

    def about(self) -> Plain:
        """Return all inputs that determine the results, as plain data. Start values are written as text."""
        drive, start = self.variation.drive, self.variation.initial
        start = drive.core_initial(start) if self.variation.is_circuit else start  # also of a circuit file
        return {
            "description_hash": drive.description_hash,
            "initial": {key: str(value) for key, value in start.items()},
            **self.plans.about(),
            "rtol": self.rtol,
            "vary": self.rows.about,
            "outputs": [output.about() for output in self.outputs],
            "version": __version__,
        }

    @property
    def study_hash(self) -> str:
        """SHA-256 of all inputs that determine the results."""
        return hashlib.sha256(json.dumps(self.about(), sort_keys=True).encode()).hexdigest()

    def chunks(self, members: int | None) -> list[range]:
        """Return the range of members of each chunk. All chunks have the same size, except a smaller last one."""
        sampled = [output for output in self.outputs if output.word in ("samples", "own")]
        samples = sum(len(output.columns) * self.sample_times(output.rate_hz).size for output in sampled)
        size = self.rows.size
        usual = max(1, min(CHUNK, MOST_SAMPLES // max(samples, 1)))
        step = whole_number("chunk", usual if members is None else members)
        return [range(first, min(first + step, size)) for first in range(0, size, step)]

    def part(self, chunk: range) -> EnsembleStudy:
        """Return the study of the members of one chunk, which can be sent to another machine."""
        ends = chunk.start, chunk.stop
        rows = Rows.table(self.rows.names, self.rows.take(*ends))
        return replace(self, rows=rows, plans=self.plans.part(*ends), first=chunk.start)

    def sample_times(self, rate_hz: float) -> Array:
        """Return the times of the samples of the longest run, in s."""
        return np.arange(round(self.plans.duration_s * rate_hz) + 1) / rate_hz

    def run(self, look: Callable[[float], object] | None = None) -> pl.DataFrame:
        """Run all members, usually those of a chunk.

        Parameters
        ----------
        look : callable, optional
            Receives the number of finished members.

        Returns
        -------
        polars.DataFrame
            A row for each member: member, status, reason, varied numbers, outputs. Names of columns contain the unit.

        Raises
        ------
        SimulationError
            A user function fails, or returns something other than a number for each member.
        """
        import polars as pl

        rows = self.rows.take(0, self.rows.size)
        requests = [request for output in self.outputs for request in output.requests]
        members = self.variation.members(rows)
        system = self.variation.drive.system
        seen, status, failed = run_members(system, members, self.plans, self.rtol, requests, self.threads, look)
        values, reasons = iter(seen), [failed.get(k, "") for k in range(len(rows))]
        columns: Plain = {"member": self.first + np.arange(len(rows)), "status": status}
        columns["reason"] = pl.Series(reasons, dtype=pl.String)
        for number, column in zip(self.variation.numbers, rows.T, strict=True):
            columns[number.file_name] = np.ascontiguousarray(column)
        for output in self.outputs:
            own = [next(values) for _ in output.requests]
            columns[output.file_name] = own[0] if output.function is None else self._own(output, own, status)
        return pl.DataFrame(columns)

    def _own(self, output: Reduction, seen: list[Array], status: NDArray[np.uint8]) -> Array:
        """Call a user function for the finished members."""
        assert output.function is not None
        done = status == DONE
        out = np.full(len(status), np.nan)
        if not done.any():
            return out
        signals = {meaning(column)[0]: x[done] for column, x in zip(output.columns, seen, strict=True)}
        try:
            made = output.function(signals, self.sample_times(output.rate_hz))
            out[done] = np.broadcast_to(np.asarray(made, dtype=float), (int(done.sum()),))
        except Exception as error:
            failure = {"name": output.name, "kind": type(error).__name__, "error": error}
            raise SimulationError.of("ensemble.own", **failure) from error
        return out


@dataclass(frozen=True, eq=False)
class Members:
    """Results of members as a frame, see `EnsembleStudy.run`. `failed` is the number of failed members of the study."""

    study: EnsembleStudy
    frame: pl.DataFrame
    failed: int

    @property
    def values(self) -> list[Array]:
        """Array of each output, shape (members,) or (members, samples)."""
        return [self.frame[output.file_name].to_numpy(writable=True) for output in self.study.outputs]

    def view(self) -> View:
        """Return the view of the ensemble, with the spread of each output and with the failures."""
        return upper("ensemble_view")(self.dataset())

    def save(self, path: Path) -> None:
        """Write all members as .parquet, .csv or .nc.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        if path.suffix.lower() == ".nc":
            save(self.dataset(), path)
        else:
            write_frame(self.frame, path, {"pneudrive": json.dumps(self.provenance(), default=str)})

    def dataset(self) -> xr.Dataset:
        """Return a labelled data set: dimension member, a unit and a long name for each variable."""
        import xarray as xr

        upper("Pneu")  # registers `dataset.pneu`

        columns = {name: self.frame[name].to_numpy(writable=True) for name in self.frame.columns}
        variables: Plain = {}
        coordinates: Plain = {"member": ("member", columns["member"], {"long_name": "member"})}
        for number in self.study.variation.numbers:
            attrs = {"units": number.unit, "long_name": number.name}
            coordinates[number.name] = ("member", columns[number.file_name], attrs)
        for output in self.study.outputs:
            values = columns[output.file_name]
            attrs = {"units": output.unit, "long_name": output.long_name}
            variables[output.name] = (("member", "time")[: values.ndim], values, attrs)
            if output.word == "samples":
                times = self.study.sample_times(output.rate_hz)
                coordinates["time"] = ("time", times, {"units": "s", "long_name": "time"})
        variables["status"] = ("member", columns["status"], {"units": "1", "long_name": "0: done, else failed"})
        variables["reason"] = ("member", columns["reason"], {"units": "1", "long_name": "why a member failed"})
        return xr.Dataset(variables, coordinates, self.provenance())

    def provenance(self) -> Plain:
        """Return the origin of the results: inputs, solver, warnings, citations and assumed values."""
        study, drive = self.study, self.study.variation.drive
        core = drive.system.compiled()
        return {
            "title": drive.name,
            **study.about(),
            "study_hash": study.study_hash,
            "solver": SOLVER,
            "statistics": {"members": study.rows.size, "failed": self.failed},
            "warnings": [*drive.notes, *core.warnings],
            "citations": list(dict.fromkeys([*core.citations, *drive.cited])),
            "assumed": drive.assumed(),
            "labels": dict(drive.labels),
        }


# --- Execution of chunks: in this process by default, or on the workers of a Dask cluster.
#
# Any object that maps a function over items is an executor. Results may come in any order, each exactly once. An item
# that is lost with its worker is run again.

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Items sent to the workers per thread: one runs, the others wait on the worker.
AHEAD = 3
#: Interval between checks for workers, and longest time without a worker, s.
LOOK_S, NO_WORKER_S = 5.0, 300.0


class Executor(Protocol):
    """Executor of the chunks of a study."""

    def map(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """Yield the result of `work` for each item, in any order.

        Parameters
        ----------
        work : callable
            Function that can be pickled, has no side effects, and returns the same result on any machine.
        items : iterable
            Items that can be pickled. They are consumed lazily.
        """
        ...


class DaskExecutor:
    """Executor that runs items on the workers of a Dask cluster (``pip install pneudrive[dask]``).

    Parameters
    ----------
    client : distributed.Client
        Client of a cluster whose workers have this version of pneudrive.

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
        """Yield the results as they arrive. Dask repeats an item of a lost worker on another worker.

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
                    raise SimulationError.of("ensemble.workers", error=error) from None
                except TimeoutError:  # chunks take long, or the lost chunk of a worker is repeated
                    if self.client.nthreads():
                        seen = time.monotonic()
                    elif time.monotonic() - seen > NO_WORKER_S:
                        what = f"the cluster has had no worker for {NO_WORKER_S:g} s"
                        raise SimulationError(what, remedy="Start workers.") from None
                    continue
                seen = time.monotonic()
                on_the_way.discard(future)
                on_the_way |= {self.client.submit(work, item, pure=False) for item in islice(waiting, 1)}
                yield result
        finally:
            self.client.cancel(list(on_the_way))


# --- Run of the chunks of a study, and a folder of finished chunks: a sealed Parquet file each, and the study.

STUDY = "study.json"


class ChunkStore:
    """Folder with the chunks of one study. Existing chunks are not run again.

    Parameters
    ----------
    folder : Path
        Folder of the study. A missing folder is made.
    study : EnsembleStudy
    members : int, optional
        Number of members of a chunk. In a folder that already has chunks, their size is used.

    Raises
    ------
    CommandError
        The folder contains another study or other files, or it is not writable.
    """

    def __init__(self, folder: Path, study: EnsembleStudy, members: int | None) -> None:
        self.folder, self.study = folder, study
        size = study.chunks(members)[0].stop
        about: Plain = {"study": study.study_hash, "about": study.about(), "chunk_members": size}
        path = folder / STUDY
        if not path.exists():
            if folder.is_dir() and any(folder.iterdir()):
                raise CommandError.of("ensemble.not_empty", folder=folder)
            make_result_folder(folder)
            write_whole(path, json.dumps(about, indent=1))
        begun = read_json(path, CommandError)
        if not isinstance(begun, dict) or not isinstance(begun.get("chunk_members"), int):
            raise CommandError(f"{path} is not the file of a study", remedy="Choose another folder.")
        if begun.get("study") != about["study"]:
            before, names = begun.get("about", {}), {"description_hash": "drive", "duration_s": "duration"}
            now: Plain = about["about"]
            differ = [names.get(key, key) for key in now if before.get(key) != now[key]]
            shown = ", ".join(differ) or "study"
            raise CommandError.of("ensemble.other_study", where=str(path), folder=folder, differ=shown)
        self.chunks = study.chunks(begun["chunk_members"])
        for unfinished in folder.glob(".pneudrive-*"):  # left by a process that was killed while it wrote a chunk
            unfinished.unlink(missing_ok=True)

    def path(self, first: int) -> Path:
        """Return the file of the chunk that begins with this member."""
        return self.folder / f"members-{first:012d}.parquet"

    def missing(self) -> list[range]:
        """Return the chunks to run: those without a file, or with a damaged file."""
        files = [(chunk, self.path(chunk.start)) for chunk in self.chunks]
        return [chunk for chunk, path in files if not path.exists() or seal.look(path, path.stat().st_size)[0]]

    def write(self, frame: pl.DataFrame) -> None:
        """Store a finished chunk.

        Raises
        ------
        CommandError
            The chunk cannot be written, for example on a full disk. Earlier chunks are kept.
        """
        about = {"pneudrive": json.dumps({"study": self.study.study_hash})}
        write_frame(frame, self.path(frame["member"][0]), about)

    @property
    def table(self) -> pl.LazyFrame:
        """Members of all finished chunks, read when they are needed."""
        import polars as pl

        return pl.scan_parquet([self.path(chunk.start) for chunk in self.chunks])

    def remove(self) -> None:
        """Remove all chunks, and their folder unless it has other files."""
        for chunk in self.chunks:
            self.path(chunk.start).unlink(missing_ok=True)
        (self.folder / STUDY).unlink(missing_ok=True)
        with suppress(OSError):
            self.folder.rmdir()


def run_study(
    study: EnsembleStudy,
    watch: Watch,
    executor: Executor | None = None,
    store: ChunkStore | None = None,
    chunk: int | None = None,
    in_memory: bool = True,
) -> Members:
    """Run the missing chunks of a study, store each of them, and return all members.

    Parameters
    ----------
    study : EnsembleStudy
    watch : Watch
        Progress, in members.
    executor : Executor, optional
    store : ChunkStore, optional
    chunk : int, optional
        Number of members of a chunk, without `store`.
    in_memory : bool
        Whether to return the members. If false, the frame has no rows.

    Raises
    ------
    Cancelled
        The flag of `watch` is set.
    """
    import polars as pl

    chunks = study.chunks(chunk) if store is None else store.missing()
    total = study.rows.size
    done, frames = total - sum(map(len, chunks)), list[pl.DataFrame]()
    # A cluster runs one chunk in each of its threads at a time.
    source = study if executor is None else replace(study, threads=study.threads or 1)
    parts = (source.part(chunk) for chunk in chunks)

    def look(count: float) -> None:
        watch.tell(done + count, total, "members simulated")

    look(0)
    own = (part.run(look) for part in parts)
    for frame in own if executor is None else executor.map(EnsembleStudy.run, parts):
        store.write(frame) if store is not None else frames.append(frame)
        done += frame.height
        look(0)
    table = pl.concat(frames).lazy() if store is None else store.table
    failed = table.select((pl.col("status") != DONE).sum()).collect().item()
    return Members(study, (table.sort("member") if in_memory else table.clear()).collect(), failed)


# --- One drive in many variants: simulated, reduced and labelled.

#: Default limit of the members in one data set.
IN_MEMORY = 5_000_000


def simulate_many(
    drive: Drive | Circuit,
    command: Commands | Sequence[Commands] | Array,
    duration: str | float | Sequence[str | float] | Array,
    *,
    vary: Keyed | EnsembleDesign,
    n: int | None = None,
    outputs: Sequence[str | Output] | None = None,
    initial: Initial | Mapping[str, object] | str | Sequence[Initial | Mapping[str, object] | str] | None = None,
    rtol: float = 1e-6,
    seed: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    chunk: int | None = None,
    max_members_in_memory: int = IN_MEMORY,
    threads: int | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate many variants (members) of a drive or a circuit, and keep selected numbers of each run.

    The result of a member is exactly that of `pneudrive.simulate` for a drive with the member's numbers. The result
    depends only on the description and the row of the design, not on other members, chunks or the executor.

    Parameters
    ----------
    drive : Drive or Circuit
    command
        One command for all members, or a list with one command for each member (``["0 s: 1", "0 s: 1, 0.2 s: -1"]``).
        Forms are those of `pneudrive.simulate`, except functions. An array has shape (n,) for constant commands, or (n,
        entries, 2) for times in s and commands. For a circuit, give a dict from components to these forms, or a list of
        dicts. Members whose commands change at the same times run faster, because they are simulated together.
    duration : str, float, or a list or array of them
        Duration of all members, or one duration for each.
    vary : mapping or Design
        Name of each number that varies -> its values. Names are those that `pneudrive.identify` accepts as free, or
        ``initial.position`` and similar names. The values are one of

        - a value for each member: quantities (``["20 mm", "25 mm"]``) or an array in SI, with absolute pressures;
        - a distribution, ``"normal(30 N, 10 %)"``, ``uniform``, ``triangular`` or ``lognormal``, also as an object of
          `pneudrive.ensemble`. The members are `n` points of a scrambled Sobol sequence;
        - ``pn.grid("20 mm .. 32 mm", 7)``: all combinations.

        For a circuit, a name has a component and a key, such as ``left.bore`` or ``initial.left.position``. The names
        ``ambient.pressure`` and ``ambient.temperature`` vary the surroundings. For a Latin hypercube, correlations, or
        the posterior of a fit, give a `pn.EnsembleDesign` instead of the mapping. Values that depend on a varied number
        change with it.
    n : int, optional
        Number of members, for distributions.
    outputs : sequence of str or Output, optional
        Outputs of each run. Default: the state at the end and the stroke time. An output is one of

        - a number: ``"final(position)"``, or ``max``, ``min``, ``mean`` or ``integral`` of a variable;
        - a time: ``"stroke_time"``, or ``"time_when(position > 0.45 m)"``, NaN if the condition is never true;
        - a settling time: ``"settling(position, 0.5 mm)"``, with the half width of the band around the final value;
        - a series: ``"samples(position, 100 Hz)"``, by default 1 kHz;
        - a function of sampled signals, see `pneudrive.ensemble.own`.

        A name may precede the output: ``"top = max(velocity)"``.
    initial : Initial, dict or str, or a list of them, optional
        Start state of all members, or one for each, with the same keys. Missing values follow from the stroke and the
        ambient air of the member.
    rtol : float
        Relative tolerance of the solver.
    seed : int, optional
        Random seed of the design. Default: 0.
    executor : Executor, optional
        Executor of the chunks. Default: one chunk after the other in this process.
        See `pneudrive.ensemble.DaskExecutor`.
    out : path-like, optional
        Folder of the finished chunks, as Parquet. An interrupted study continues from this folder. Finished chunks do
        not run again.
    chunk : int, optional
        Number of members that run together.
    max_members_in_memory : int
        Larger studies need `out`. The returned data set then does not contain the members.
    threads : int, optional
        Number of threads. Default: all processors, or one for each chunk of an executor.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    xarray.Dataset
        Dimension member, and time if there are samples. It has a variable for each output, ``status`` (0: done) and
        ``reason``. The varied numbers are coordinates. Each variable and coordinate has ``units`` and ``long_name``.
        Values are in SI, pressures are absolute.

    Warns
    -----
    PneudriveWarning
        Members failed.

    Raises
    ------
    CommandError
        A name, a quantity, a row of the design, a command, an output or `out` is not valid; the number of commands,
        durations or start states differs from the number of members; or the folder holds another study.
    DescriptionError
        The start state does not fit the drive.
    Cancelled
        `cancel` was set; finished chunks in `out` are kept.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:parker-osp-p25-sy5000")
    >>> many = pn.simulate_many(drive, 1.0, "0.3 s", vary={"load.mass": ["0 kg", "5 kg"]}, outputs=["max(velocity)"])
    >>> dict(many.sizes), bool(many.max_velocity[0] > many.max_velocity[1])
    ({'member': 2}, True)
    """
    design = design_of(vary, n, seed)
    study = study_of(
        drive, command, duration, vary=design, outputs=outputs, initial=initial, rtol=rtol, threads=threads
    )
    size, fits = study.rows.size, study.rows.size <= max_members_in_memory
    if out is None and not fits:
        what = f"{size} members are more than max_members_in_memory = {max_members_in_memory}"
        raise CommandError(what, remedy="Give a folder for their results: out=...")
    store = None if out is None else ChunkStore(Path(out), study, chunk)
    found = run_study(study, Watch(progress, cancel), executor, store, chunk, in_memory=fits)
    if found.failed:
        warn(f"{found.failed} of {size} members failed: see the columns status and reason")
    return found.dataset()


def study_of(
    drive: Drive | Circuit,
    command: Any,  # noqa: ANN401
    duration: Any,  # noqa: ANN401
    *,
    vary: EnsembleDesign,
    outputs: Sequence[str | Output] | None,
    initial: Any,  # noqa: ANN401
    rtol: float = 1e-6,
    threads: int | None = None,
    refuse: bool = True,
) -> EnsembleStudy:
    """Read and check all inputs of a study before the first run.

    Arguments and errors are those of `simulate_many`. If `refuse` is false, the rows of the design are not checked.
    """
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    check_tolerance(rtol)
    if threads is not None:
        whole_number("threads", threads)
    plans = member_plans(command, duration, drive.commandable)
    for_all, each = parted_starts(initial)
    begun = {f"{INITIAL}{key}": values for key, values in each.items()}
    variation = Variation(drive, [*vary.names, *begun], for_all)
    rows = vary.rows(variation)
    if begun:
        beside = EnsembleDesign.table(begun).rows(variation)
        if beside.size != rows.size:
            raise CommandError(f"initial has {beside.size} start states, but there are {rows.size} members")
        rows = rows.wider(beside)
    plans.check(rows.size)
    columns = [variable.name for variable in start(drive, for_all).variables if variable.kind == "output"]
    states = [meaning(name)[0] for name in drive.system.compiled().start_names] if variation.is_circuit else STATE
    kept = reductions(outputs, SignalNames(columns, None if variation.is_circuit else plans.moves_up, states))
    taken = {*(number.name for number in variation.numbers), "member", "status", "reason"}
    taken |= {"time"} if any(one.word == "samples" for one in kept) else set()
    for name in taken.intersection(one.name for one in kept):
        raise CommandError(f'outputs: the name "{name}" is already used', remedy='Give another name: "NAME = ...".')
    if len(plans.durations) > 1 and any(one.word in ("samples", "own") for one in kept):
        rule = "samples, settling and user functions need one duration for all members"
        raise CommandError("outputs: members of different durations cannot be sampled", rule=rule)
    if refuse:
        rows.check(variation)
    return EnsembleStudy(variation, rows, plans, rtol, kept, threads)
