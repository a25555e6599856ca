"""``pneudrive sweep``: simulate many variants of a drive, and write a table of results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneudrive.cli.options import CatalogueFolders, Changes, Described, Rtol, Steps
from pneudrive.cli.output import check_outputs, show_table, tell
from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.ensemble.design import EnsembleDesign
    from pneudrive.ensemble.many import Gathered

#: Ending of the folder in which the chunks of a file that is not finished lie.
PARTS = ".parts"
TABLES = (".parquet", ".csv", ".nc")


def sweep(
    drive: Described,
    duration: Annotated[str, typer.Option()],
    vary: Annotated[list[str], typer.Option()],
    out: Annotated[Path, typer.Option()],
    command: Steps = None,
    members: int | None = None,
    design: str = "sobol",
    seed: int = 0,
    correlation: list[str] | None = None,
    output: list[str] | None = None,
    set: Changes = None,  # noqa: A002 - the name of the option
    initial: str | None = None,
    rtol: Rtol = 1e-6,
    chunk: int | None = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Simulate many variants and write a table of results.

    Finished chunks are kept. The same command continues after an interruption.

    Options
    -------
    duration
        Duration, such as "2 s".
    vary : NAME=VALUES|FILE
        Varied number, repeatable: "load.mass = uniform(1 kg, 2 kg)", normal, triangular, lognormal, "grid(20 mm ..
        32 mm, 7)", "20 mm, 25 mm". Or a table (.csv, .parquet) in SI, or a fit.toml.
    out
        Table (.parquet, .csv, .nc) or folder.
    members : N
        Number of members of distributions or of a fit.
    design
        sobol, latin-hypercube or random.
    seed
        Random seed of the sampling.
    correlation : A,B=R
        Correlated numbers, such as "cylinder.bore, friction.coulomb = 0.6".
    output : OUTPUT
        Output of each run, repeatable: final(position), max(velocity), min, mean, integral, "time_when(position >
        0.45 m)", "settling(position, 0.5 mm)", stroke_time, "samples(position, 100 Hz)". Default: final state,
        stroke time.
    initial
        Start, such as "position = 50 mm".
    chunk : N
        Size of a chunk.
    """
    from pneudrive.cli.described import changed, command_of
    from pneudrive.cli.progress import on_terminal
    from pneudrive.ensemble.many import IN_MEMORY, Gathered, results, study_of
    from pneudrive.ensemble.store import ChunkStore

    is_file = out.suffix != ""
    if is_file:
        check_outputs(out, TABLES)
    described = changed(drive, set)
    study = study_of(
        described,
        command_of(described, command),
        duration,
        vary=_design(described, vary, members, design, seed, correlation or []),
        outputs=output,
        initial=initial,
        rtol=rtol,
    )
    if out.suffix == ".csv" and any(one.word == "samples" for one in study.outputs):
        raise CommandError("a CSV file has no place for samples", remedy="Write .parquet or .nc.")
    fits = study.rows.size <= IN_MEMORY
    if is_file and not fits:
        raise CommandError(
            f"{study.rows.size} members are too many for one file", remedy="Give a folder: --out results"
        )
    store = ChunkStore(out.with_name(out.name + PARTS) if is_file else out, study, chunk)
    missing = len(store.missing())
    if missing < len(store.chunks):
        typer.echo(f"{len(store.chunks) - missing} of {len(store.chunks)} chunks are there", err=True)
    for _ in results(study, store, chunk, None, on_terminal()):
        pass  # each is kept in the store
    if fits:
        gathered = Gathered(study)
        gathered.read(store)
        if is_file:
            gathered.save(out)
            store.remove()
        _say(gathered)
    tell([out])


def _design(
    drive: Drive | Circuit, vary: Sequence[str], members: int | None, method: str, seed: int, correlation: Sequence[str]
) -> EnsembleDesign:
    """Read what varies."""
    from dataclasses import replace

    from pneudrive.ensemble.design import EnsembleDesign, design_of
    from pneudrive.ensemble.rows import SAMPLERS
    from pneudrive.errors import nearest
    from pneudrive.identify.files import read_fit

    if method not in SAMPLERS:
        raise CommandError(f"--design {method} is not known", remedy=nearest(method, SAMPLERS))
    files = [text for text in vary if "=" not in text]
    if correlation and (files or not all("(" in text and "grid(" not in text for text in vary)):
        raise CommandError("--correlation has no effect here", rule="all numbers that vary have distributions")
    if files and len(vary) > 1:
        raise CommandError("--vary has a file and more", rule="give one file, or NAME = VALUES for each number")
    if files:
        path = Path(files[0])
        if path.suffix == ".toml":
            if members is None:
                raise CommandError("--members is missing", remedy="Give the number of members from the fit.")
            return EnsembleDesign.posterior(read_fit(path), members, seed=seed, method=method)
        return design_of(_table(drive, path), members)
    each: dict[str, str] = {}
    for text in vary:
        name, _, values = (one.strip() for one in text.partition("="))
        if name in each:
            raise CommandError(f"vary: {name} is given twice", remedy="Keep one of them.")
        each[name] = values
    made = design_of(each, members, seed, method)
    return replace(made, correlation=dict(map(_pair, correlation)))


def _pair(text: str) -> tuple[tuple[str, str], float]:
    names, _, value = text.partition("=")
    first, _, second = (one.strip() for one in names.partition(","))
    try:
        if first and second:
            return (first, second), float(value)
    except ValueError:
        pass
    remedy = 'For instance "cylinder.bore, friction.coulomb = 0.6".'
    raise CommandError(f'--correlation "{text}" is not A, B = R', remedy=remedy)


def _table(drive: Drive | Circuit, path: Path) -> dict[str, Any]:
    """Read a table of members: names of numbers, with or without the unit, are its columns."""
    from pneudrive.ensemble.many import numbers_of
    from pneudrive.errors import RecordingError, nearest
    from pneudrive.files.csv_tables import csv_names
    from pneudrive.files.tables import open_table
    from pneudrive.simulation.trajectory import read_columns

    if path.suffix not in (".csv", ".parquet"):
        raise CommandError(
            f'--vary "{path}" is neither NAME = VALUES nor a file', rule="a .csv, .parquet or .toml file"
        )
    known = {number.file_name: name for name, number in numbers_of(drive).items()}
    columns = csv_names(path, RecordingError) if path.suffix == ".csv" else open_table(path, "parquet").names
    for column in columns:
        if column not in known and column not in known.values():
            raise CommandError(
                f"vary: {column} is not a number of this {drive.file_kind}",
                where=str(path),
                remedy=nearest(column, known),
            )
    return {known.get(column, column): values for column, values in read_columns(path, columns).items()}


def _say(gathered: Gathered) -> None:
    """Print how many members there are, and the spread of each output."""
    import numpy as np

    from pneudrive.units import readable

    study, failed = gathered.study, np.flatnonzero(gathered.status)
    typer.echo(f"{study.variation.drive.name}: {gathered.size} members, {len(failed)} failed")
    for place in failed[:1]:
        typer.echo(f"  member {place}: {gathered.reason[place]}")
    rows, lacking = [], []
    for output, values in zip(study.outputs, gathered.values, strict=True):
        if values.ndim > 1:
            continue
        factor, unit = readable(output.unit)
        own = values[np.isfinite(values)]
        shares = [f"{x / factor:.5g}" for x in np.quantile(own, [0.0, 0.05, 0.5, 0.95, 1.0])] if own.size else ["-"] * 5
        rows.append((output.name, unit, *shares))
        if own.size < values.size:
            lacking.append(f"{output.name} has no value in {values.size - own.size} of {values.size} members")
    show_table(("output", "<unit", "lowest", "5 %", "median", "95 %", "highest"), rows)
    for line in lacking:
        typer.echo(f"{line}: its row is of the others")
