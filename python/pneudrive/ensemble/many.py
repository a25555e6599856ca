"""One drive in many variants: simulated, reduced and labelled."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__
from pneudrive import command as commands
from pneudrive.ensemble.design import design_of
from pneudrive.ensemble.engine import DONE
from pneudrive.ensemble.executors import InProcess
from pneudrive.ensemble.outputs import SignalNames, reductions
from pneudrive.ensemble.store import ChunkStore
from pneudrive.ensemble.study import Chunk, ChunkResult, EnsembleStudy
from pneudrive.ensemble.variation import Variation
from pneudrive.errors import CommandError, DescriptionError, SimulationError, warn
from pneudrive.simulate import SOLVER, positive, require
from pneudrive.start import check_tolerance, is_circuit, ready, start
from pneudrive.trajectory import save, write_frame
from pneudrive.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.describe.parts import Initial
    from pneudrive.ensemble.design import EnsembleDesign
    from pneudrive.ensemble.executors import Executor
    from pneudrive.ensemble.outputs import Output, Reduction
    from pneudrive.watch import Flag

    Array = NDArray[np.float64]

#: Members whose results one data set holds where nothing is said.
IN_MEMORY = 5_000_000


def simulate_many(
    drive: Drive,
    command: commands.Command,
    duration: str | float,
    *,
    vary: Mapping[str, Any] | EnsembleDesign,
    n: int | None = None,
    outputs: Sequence[str | Output] | None = None,
    initial: Initial | Mapping[str, object] | str | None = None,
    rtol: float = 1e-6,
    seed: int | None = None,
    executor: Executor | None = None,
    out: str | Path | None = None,
    chunk: int | None = None,
    errors: str = "keep",
    max_members_in_memory: int = IN_MEMORY,
    threads: int | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate a drive in many variants, its members, and keep a few numbers of each run.

    A member is to the last bit what `pneudrive.simulate` gives of the drive with its numbers; it depends on the
    description and its row of the design alone, not on the other members, the chunks or the executor.

    Parameters
    ----------
    drive : Drive
    command, duration, rtol
        As for `pneudrive.simulate`, for all members; the command is no function.
    vary : mapping or Design
        Names, as `pneudrive.identify` takes them as free, or ``initial.position`` and the like, with one of

        - a value for each member: quantities (``["20 mm", "25 mm"]``) or an array in SI, pressures absolute;
        - a distribution: ``"normal(30 N, 10 %)"``, ``uniform``, ``triangular``, ``lognormal``, or the objects of those
          names in `pneudrive.ensemble`: `n` points of a scrambled Sobol sequence;
        - ``pn.grid("20 mm .. 32 mm", 7)``: all combinations.

        Or a `pn.Design`: Latin hypercube, correlation, the posterior of a fit. Values that follow from one that varies
        move with it.
    n : int, optional
        Members, where `vary` has distributions.
    outputs : sequence of str or Output, optional
        What is kept: ``"final(position)"``, ``"max(velocity)"``, ``"min(pressure_b)"``, ``"mean(...)"``,
        ``"integral(mass_flow_a)"``, ``"time_when(position > 0.45 m)"``, ``"settling(position, 0.5 mm)"``,
        ``"stroke_time"``, ``"samples(position, 100 Hz)"``, with a name of yours in front (``"top = max(velocity)"``),
        or objects of `pneudrive.ensemble`, among them `pneudrive.ensemble.own`. The state at the end and the stroke
        time where nothing is said.
    initial : Initial, dict or str, optional
        Start state of all members; what it does not say follows from each member's own stroke and ambient air.
    seed : int, optional
        Of the design; 0 where nothing is said.
    executor : Executor, optional
        Where chunks run; this process where nothing is said. See `pneudrive.ensemble.DaskExecutor`.
    out : path-like, optional
        Folder into which finished chunks are written as Parquet. A study that was interrupted goes on there: chunks
        that are there are not run again.
    chunk : int, optional
        Members that run, and are written, together.
    errors : str
        ``"keep"``: a member that fails has NaN, a status and a reason. ``"raise"``: it ends the study.
    max_members_in_memory : int
        With more members than that `out` is needed, and the data set returned has none of them.
    threads : int, optional
        All processors where nothing is said; with an executor one for each chunk.
    progress, cancel : optional
        See `pneudrive.watch.Watch`.

    Returns
    -------
    xarray.Dataset
        Dimension member, and time where there are samples. A variable for each output, ``status`` (0: done) and
        ``reason``; what varies as coordinates. Each with ``units`` and ``long_name``, SI, absolute pressure.

    Warns
    -----
    PneudriveWarning
        Members failed.

    Raises
    ------
    CommandError
        A name, a quantity, a row of the design, an output or `out` is not valid, or the folder holds another study.
    DescriptionError
        The start state does not fit the drive.
    SimulationError
        With ``errors="raise"``, a member failed.
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
    if errors not in ("keep", "raise"):
        raise CommandError(f'errors = "{errors}"', rule='"keep" or "raise"')
    study = study_of(
        drive,
        command,
        duration,
        vary=vary,
        n=n,
        outputs=outputs,
        initial=initial,
        rtol=rtol,
        seed=seed,
        threads=threads,
    )
    size, store = study.rows.size, None
    if out is not None:
        store = ChunkStore(Path(out), study, chunk)
    elif size > max_members_in_memory:
        what = f"{size} members are more than max_members_in_memory = {max_members_in_memory}"
        raise CommandError(what, remedy="Give a folder for their results: out=...")
    watch = Watch(progress, cancel)
    gathered = Gathered(study) if size <= max_members_in_memory else None
    for result in results(study, store, chunk, executor, watch):
        if errors == "raise" and result.reasons:
            place = min(result.reasons)
            raise SimulationError(f"member {result.chunk.first + place}: {result.reasons[place]}")
        if gathered is not None and store is None:
            gathered.take(result)
    if gathered is None:
        assert store is not None
        gathered = Gathered(study, empty=True)
        gathered.failed = store.failed()
    elif store is not None:
        gathered.read(store)
    if gathered.failed:
        warn(f"{gathered.failed} of {size} members failed: see status and reason")
    return gathered.dataset()


def study_of(
    drive: Drive,
    command: commands.Command,
    duration: str | float,
    *,
    vary: Mapping[str, Any] | EnsembleDesign,
    n: int | None = None,
    outputs: Sequence[str | Output] | None = None,
    initial: Initial | Mapping[str, object] | str | None = None,
    rtol: float = 1e-6,
    seed: int | None = None,
    threads: int | None = None,
) -> EnsembleStudy:
    """Read and check all that a study is, before anything runs. Arguments and errors are those of `simulate_many`."""
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    if is_circuit(drive):
        remedy = "Describe it as a drive; tubes and flow controls have tables there."
        raise DescriptionError("a study of many members takes a drive, and a circuit is given", remedy=remedy)
    seconds = positive(duration, "s", "duration")
    check_tolerance(rtol)
    if callable(command):
        remedy = "Give its steps, (time, command)."
        raise CommandError("the command of many members is a function", rule="one command for all", remedy=remedy)
    plan = commands.steps(command, None, drive.valve.command)
    design = design_of(vary, n, seed)
    variation = Variation(drive, design.names, initial)
    rows = design.rows(variation)
    moving = next((value for value in plan[1] if value), None)
    columns = [one.name for one in start(drive, variation.initial).variables if one.kind == "output"]
    signals = SignalNames(columns, None if moving is None else moving > 0.0)
    kept = reductions(outputs, signals)
    for first, last in _blocks(rows.size):
        variation.check(rows.take(first, last), first)
    return EnsembleStudy(variation, rows, plan, seconds, rtol, kept, threads)


def _blocks(size: int) -> Iterator[Chunk]:
    step = 65536
    return (Chunk(first, min(first + step, size)) for first in range(0, size, step))


def results(
    study: EnsembleStudy, store: ChunkStore | None, members: int | None, executor: Executor | None, watch: Watch
) -> Iterator[ChunkResult]:
    """Run the chunks of a study that are not in the store yet, keep each there, and yield it.

    Raises
    ------
    Cancelled
        The flag of `watch` is set.
    """
    chunks = study.chunks(members) if store is None else store.missing()
    total = study.rows.size
    done = total - sum(chunk.last - chunk.first for chunk in chunks)
    # A cluster runs as many chunks at a time as it has threads: each takes one.
    here = executor is None or isinstance(executor, InProcess)
    each = study if here else replace(study, threads=study.threads or 1)
    items = ((each.part(chunk), chunk) for chunk in chunks)

    def look(count: float) -> None:
        watch.tell(done + count, total, "members simulated")

    look(0)
    work = (lambda item: item[0].run(item[1], look)) if here else run_part
    for result in (executor or InProcess()).map(work, items):
        if store is not None:
            store.write(result.chunk, study.frame(result))
        done += result.chunk.last - result.chunk.first
        look(0)
        yield result


def run_part(item: tuple[EnsembleStudy, Chunk]) -> ChunkResult:
    """Run one chunk, in whatever process this is."""
    study, chunk = item
    return study.run(chunk)


class Gathered:
    """The results of all members, as arrays and as a data set.

    Parameters
    ----------
    study : EnsembleStudy
    empty : bool
        Whether to leave all members out.
    """

    def __init__(self, study: EnsembleStudy, *, empty: bool = False) -> None:
        self.study, self.size = study, 0 if empty else study.rows.size
        self.failed = 0
        self.status = np.zeros(self.size, np.uint8)
        self.reason = np.full(self.size, "", dtype=object)
        self.varied = np.empty((len(study.variation.numbers), self.size))
        self.values = [np.empty((self.size, *self._samples(one))) for one in study.outputs]

    def _samples(self, output: Reduction) -> tuple[int, ...]:
        return (len(self.study.sample_times(output.rate_hz)),) if output.word == "samples" else ()

    def take(self, result: ChunkResult) -> None:
        """Take in a chunk."""
        own = slice(*result.chunk)
        self.status[own], self.varied[:, own] = result.status, result.varied.T
        self.failed += int((result.status != DONE).sum())
        for place, why in result.reasons.items():
            self.reason[result.chunk.first + place] = why
        for target, values in zip(self.values, result.values, strict=True):
            target[own] = values

    def read(self, store: ChunkStore) -> None:
        """Take in what a store holds."""
        for chunk, frame in zip(store.chunks, store.frames(), strict=True):
            reasons = {place: why for place, why in enumerate(frame["reason"].to_list()) if why}
            varied = frame[[number.file_name for number in self.study.variation.numbers]].to_numpy()
            values = [np.asarray(frame[one.file_name].to_numpy()) for one in self.study.outputs]
            self.take(ChunkResult(chunk, varied, values, frame["status"].to_numpy(), reasons))

    def save(self, path: Path) -> None:
        """Write all members as .parquet, .csv or .nc.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        if path.suffix.lower() == ".nc":
            save(self.dataset(), path)
            return
        reasons = {int(place): self.reason[place] for place in np.flatnonzero(self.status)}
        every = ChunkResult(Chunk(0, self.size), self.varied.T, self.values, self.status, reasons)
        write_frame(self.study.frame(every), path, {"pneudrive": json.dumps(self.provenance(), default=str)})

    def dataset(self) -> xr.Dataset:
        """Label the arrays: dimension member, a unit and a long name for each variable."""
        import xarray as xr

        outputs = zip(self.study.outputs, self.values, strict=True)
        variables: dict[str, Any] = {}
        coordinates: dict[str, Any] = {"member": ("member", np.arange(self.size), {"long_name": "member"})}
        for number, values in zip(self.study.variation.numbers, self.varied, strict=True):
            coordinates[number.name] = ("member", values, {"units": number.unit, "long_name": number.name})
        for output, values in outputs:
            dims = ("member", "time")[: values.ndim]
            variables[output.name] = (dims, values, {"units": output.unit, "long_name": output.long_name})
            if output.word == "samples":
                times = self.study.sample_times(output.rate_hz)
                coordinates["time"] = ("time", times, {"units": "s", "long_name": "time"})
        variables["status"] = ("member", self.status, {"units": "1", "long_name": "0: done, else failed"})
        variables["reason"] = ("member", self.reason, {"units": "1", "long_name": "why a member failed"})
        return xr.Dataset(variables, coordinates, self.provenance())

    def provenance(self) -> dict[str, Any]:
        """Say where the results come from."""
        study, drive = self.study, self.study.variation.drive
        core, _ = ready(drive, study.variation.initial)
        return {
            "title": drive.name,
            **study.about(),
            "study_hash": study.study_hash,
            "version": __version__,
            "solver": SOLVER,
            "statistics": {"members": study.rows.size, "failed": self.failed},
            "warnings": [*drive.notes, *core.warnings],
            "citations": list(dict.fromkeys([*core.citations, *drive.cited])),
            "assumed": drive.assumed(),
            "labels": dict(drive.labels),
        }
