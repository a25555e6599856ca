"""One drive in many variants: simulated, reduced and labelled."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.ensemble.design import EnsembleDesign, design_of
from pneudrive.ensemble.engine import DONE
from pneudrive.ensemble.outputs import SignalNames, reductions
from pneudrive.ensemble.plans import member_plans, parted_starts
from pneudrive.ensemble.store import ChunkStore, results
from pneudrive.ensemble.study import EnsembleStudy, Members
from pneudrive.ensemble.variation import CHECKED_ROWS, CircuitVariation, Variation
from pneudrive.errors import CommandError, SimulationError, warn
from pneudrive.free.parameters import INITIAL
from pneudrive.progress import Watch
from pneudrive.simulation.simulate import require
from pneudrive.simulation.start import check_tolerance, start
from pneudrive.simulation.trajectory import meaning

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy as np
    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.tables.parts import Initial
    from pneudrive.ensemble.outputs import Output
    from pneudrive.ensemble.plans import MemberPlans
    from pneudrive.ensemble.store import Executor
    from pneudrive.progress import Flag
    from pneudrive.simulation.command import Commands

    Array = NDArray[np.float64]

#: Members whose results one data set holds by default.
IN_MEMORY = 5_000_000


def simulate_many(
    drive: Drive | Circuit,
    command: Commands | Sequence[Commands] | Array,
    duration: str | float | Sequence[str | float] | Array,
    *,
    vary: Mapping[str, Any] | EnsembleDesign,
    n: int | None = None,
    outputs: Sequence[str | Output] | None = None,
    initial: Initial | Mapping[str, object] | str | Sequence[Initial | Mapping[str, object] | str] | None = None,
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
    """Simulate a drive or a circuit in many variants, its members, and keep selected numbers of each run.

    A member has, to the last bit, the result of `pneudrive.simulate` for the drive with its numbers. The result depends
    only on the description and the row of the design, not on other members, chunks or the executor.

    Parameters
    ----------
    drive : Drive or Circuit
    command
        As for `pneudrive.simulate`, for all members, but not a function. It may also be a list with one command for
        each member (``["0 s: 1", "0 s: 1, 0.2 s: -1"]``). An array has shape (n,) for constant commands, or (n,
        entries, 2) for times in s and commands. For a circuit, it is a dict by component with any of these forms, or a
        list of dicts. Members whose commands change at the same times run side by side. Others run one after the other.
    duration : str, float, or a list or array of them
        One for all members, or one for each.
    vary : mapping or Design
        Names that `pneudrive.identify` accepts as free, or ``initial.position`` and similar names. The value is one of

        - a value for each member: quantities (``["20 mm", "25 mm"]``) or an array in SI, with absolute pressures;
        - a distribution: ``"normal(30 N, 10 %)"``, ``uniform``, ``triangular``, ``lognormal``, or the objects of those
          names in `pneudrive.ensemble`: `n` points of a scrambled Sobol sequence;
        - ``pn.grid("20 mm .. 32 mm", 7)``: all combinations.

        For a circuit, names are those of its components and their keys, such as ``left.bore``,
        ``left.friction.coulomb`` and ``initial.left.position``, and also ``ambient.pressure`` and
        ``ambient.temperature``. It may also be a `pn.EnsembleDesign`: Latin hypercube, correlation, or the posterior of
        a fit. Values that depend on a varied number change with it.
    n : int, optional
        Number of members, if `vary` has distributions.
    outputs : sequence of str or Output, optional
        Outputs of each run: ``"final(position)"``, ``"max(velocity)"``, ``"min(pressure_b)"``, ``"mean(...)"``,
        ``"integral(mass_flow_a)"``, ``"time_when(position > 0.45 m)"``, ``"settling(position, 0.5 mm)"``,
        ``"stroke_time"``, ``"samples(position, 100 Hz)"``, with a name of yours in front (``"top = max(velocity)"``),
        or objects of `pneudrive.ensemble`, among them `pneudrive.ensemble.own`. The state at the end and the stroke
        time are kept by default.
    initial : Initial, dict or str, or a list of them, optional
        Start state of all members, or one for each, with the same keys. Missing values follow from each member's own
        stroke and ambient air.
    rtol : float
        Relative tolerance of the solver.
    seed : int, optional
        Random seed of the design. Default: 0.
    executor : Executor, optional
        Executor of the chunks. Default: this process. See `pneudrive.ensemble.DaskExecutor`.
    out : path-like, optional
        Folder into which finished chunks are written as Parquet. An interrupted study continues there: finished chunks
        are not run again.
    chunk : int, optional
        Number of members that run, and are written, together.
    errors : str
        ``"keep"``: a failed member has NaN, a status and a reason. ``"raise"``: a failed member ends the study.
    max_members_in_memory : int
        A study with more members needs `out`, and the returned data set does not contain them.
    threads : int, optional
        Default: all processors, or one for each chunk with an executor.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    xarray.Dataset
        Dimension member, and time if there are samples. It has a variable for each output, ``status`` (0: done) and
        ``reason``. The varied numbers are coordinates. Each has ``units`` and ``long_name``, in SI with absolute
        pressure.

    Warns
    -----
    PneudriveWarning
        Members failed.

    Raises
    ------
    CommandError
        A name, a quantity, a row of the design, a command, an output or `out` is not valid, the numbers of commands,
        durations or start states do not fit the members, or the folder holds another study.
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
    design = design_of(vary, n, seed)
    study = study_of(
        drive, command, duration, vary=design, outputs=outputs, initial=initial, rtol=rtol, threads=threads
    )
    size, fits = study.rows.size, study.rows.size <= max_members_in_memory
    if out is None and not fits:
        what = f"{size} members are more than max_members_in_memory = {max_members_in_memory}"
        raise CommandError(what, remedy="Give a folder for their results: out=...")
    store = None if out is None else ChunkStore(Path(out), study, chunk)
    frames = []
    for frame in results(study, store, chunk, executor, Watch(progress, cancel)):
        lost = frame.filter(frame["status"] != DONE)
        if errors == "raise" and lost.height:
            raise SimulationError(f"member {lost['member'][0]}: {lost['reason'][0]}")
        frames += [frame] if store is None else []
    if store is not None and not fits:
        found = Members(study, next(store.frames()).clear(), store.failed())
    else:
        found = Members.of(study, frames if store is None else store.frames())
    if found.failed:
        warn(f"{found.failed} of {size} members failed: see status and reason")
    return found.dataset()


def study_of(
    drive: Drive | Circuit,
    command: Any,  # noqa: ANN401
    duration: Any,  # noqa: ANN401
    *,
    vary: Mapping[str, Any] | EnsembleDesign,
    outputs: Sequence[str | Output] | None = None,
    initial: Any = None,  # noqa: ANN401
    rtol: float = 1e-6,
    threads: int | None = None,
    refuse: bool = True,
) -> EnsembleStudy:
    """Read and check a whole study before anything runs.

    Arguments and errors are those of `simulate_many`. Without `refuse`, the caller checks the rows of the design.
    """
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    check_tolerance(rtol)
    plans = member_plans(command, duration, drive.commandable)
    design = design_of(vary)
    for_all, each = parted_starts(initial)
    of = variation_of
    begun = {f"{INITIAL}{key}": values for key, values in each.items()}
    variation = of(drive, [*design.names, *begun], for_all)
    rows = design.rows(of(drive, design.names, for_all) if begun else variation)
    if begun:
        beside = EnsembleDesign.table(begun).rows(of(drive, [*begun], for_all))
        if beside.size != rows.size:
            raise CommandError(f"initial has {beside.size} rows, and there are {rows.size} members")
        rows = rows.wider(beside)
    plans.check(rows.size)
    columns = [variable.name for variable in start(drive, for_all).variables if variable.kind == "output"]
    kept = reductions(outputs, _signals(drive, columns, plans))
    taken = {*(number.name for number in variation.numbers), "member", "status", "reason"}
    taken |= {"time"} if any(one.word == "samples" for one in kept) else set()
    for name in taken.intersection(one.name for one in kept):
        raise CommandError(f'outputs: the name "{name}" is already used', remedy='Give another name: "NAME = ...".')
    if len(plans.durations) > 1 and any(one.word in ("samples", "own") for one in kept):
        rule = "samples, settling and user functions need one duration for all members"
        raise CommandError("outputs: members of different durations are sampled", rule=rule)
    for first in range(0, rows.size if refuse else 0, CHECKED_ROWS):
        variation.check(rows.take(first, min(first + CHECKED_ROWS, rows.size)), first)
    return EnsembleStudy(variation, rows, plans, rtol, kept, threads)


def variation_of(drive: Drive | Circuit, names: Sequence[str], initial: Any = None) -> Variation:  # noqa: ANN401
    """Return the numbers of a drive or a circuit that a design sets."""
    return (Variation if drive.system.names else CircuitVariation)(drive, names, initial)


def _signals(drive: Drive | Circuit, columns: Sequence[str], plans: MemberPlans) -> SignalNames:
    if drive.system.names is None:
        begun = drive.system.compiled().start_names
        return SignalNames(columns, states=[meaning(name)[0] for name in begun])
    return SignalNames(columns, plans.moves_up)
