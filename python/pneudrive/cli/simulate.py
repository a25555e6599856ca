"""Section "Simulate": single runs, sweeps, tube studies, platforms, and the page of a folder."""

from __future__ import annotations

import sys
import tempfile
import threading
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

import typer

import pneudrive as pn
from pneudrive.cli.options import Port, changed, command_of, names_in, pairs_in
from pneudrive.cli.terminal import check_outputs, show_paths, show_view, watch, write_outputs
from pneudrive.errors import CommandError, nearest
from pneudrive.lazy_names import upper, used_later

with used_later(__name__):
    from pneudrive import report, units
    from pneudrive.describe.files import load
    from pneudrive.ensemble import design, many, variation
    from pneudrive.identify import files as fits
    from pneudrive.identify.follow import fit as motion_fits
    from pneudrive.platforms import kinematics
    from pneudrive.report import platform as platform_page
    from pneudrive.report import trajectory as pictures
    from pneudrive.simulation import run_view, trajectory
    from pneudrive.simulation import simulate as simulation

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr


#: Ending of the folder with the finished chunks of an unfinished table.
PARTS = ".parts"
#: Endings of pictures, and of files that show or contain a run.
PICTURES, OF_RUNS = (".svg", ".png", ".pdf"), (".html", ".mp4", ".gif", ".parquet", ".csv")


def simulate(
    drive: str,
    *,
    duration: str = "",
    command: list[str] | None = None,
    initial: str | None = None,
    set: list[str] | None = None,  # noqa: A002 - the name of the option
    motion: Path | None = None,
    layout: Path | None = None,
    sample_rate: str = "1 kHz",
    rtol: float = 1e-6,
    budget: int | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    energy: bool = False,
) -> None:
    r"""Simulate a drive or a circuit, and write or plot the run.

    Options
    -------
    duration
        Duration, e.g. "2 s"; not with --motion.
    initial
        Start state, e.g. "position = 50 mm, pressure_a = 3 bar abs"; for a circuit "left.position = 50 mm".
    motion : RECORDING
        Recording whose position the piston of a circuit follows.
    layout
        Layout of that recording.
    sample_rate
        Samples per second.
    budget : ATTEMPTS
        Number of attempted steps after which the run fails.
    out
        Trajectory file: .parquet, .csv or .nc.
    plot
        Picture of the trajectory: .png, .svg or .pdf.
    energy
        Print energy, lost exergy and supplied air.

    Examples
    --------
    pneudrive simulate catalogue:parker-osp-p25-mpye --duration '2 s' \
        --command '0 s: 0.3, 1 s: -0.3' --plot run.png
    """
    check_outputs(out, plot=plot)
    if motion is not None:
        columns, provenance = motion_fits.simulate_motion(drive, motion, layout=layout)
        end = f"{len(columns['time_s'])} samples to {columns['time_s'][-1]:g} s"
        if out is not None:
            trajectory.save_columns(columns, provenance, out)
        typer.echo(f"{provenance['title']}: {end} along {motion}")
        show_paths(out)
        return
    if not duration:
        raise CommandError("the duration is missing", remedy='Add --duration "2 s", or --motion RECORDING.')
    described = changed(drive, set)
    commands = command_of(described, command)
    result = simulation.run(
        described,
        commands,
        duration,
        initial=initial,
        sample_rate=sample_rate,
        watch=watch(),
        rtol=rtol,
        budget=budget,
    )
    view = run_view.run_view(result.columns, result.provenance)
    show_view(replace(view, findings=()))  # warnings are on stderr
    write_outputs((out, partial(_save, result)), (plot, lambda path: report.plot(result.dataset(), path)))
    if energy:
        typer.echo(str(pn.energy_balance(described, commands, duration, initial=initial, rtol=rtol)))


def _save(result: simulation.Run, path: Path) -> None:
    if path.suffix.lower() == ".nc":
        trajectory.save(result.dataset(), path)
    else:
        trajectory.save_columns(result.columns, result.provenance, path)


def sweep(
    drive: str,
    *,
    duration: str,
    vary: list[str],
    out: Path,
    command: list[str] | None = None,
    members: int | None = None,
    seed: int = 0,
    output: list[str] | None = None,
    set: list[str] | None = None,  # noqa: A002 - the name of the option
    initial: str | None = None,
    rtol: float = 1e-6,
    chunk: int | None = None,
) -> None:
    r"""Simulate many variants and write a table of results.

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
    seed
        Random seed of the sampling.
    output : OUTPUT
        Output of each run, repeatable: final(position), max(velocity), min, mean, integral, "time_when(position >
        0.45 m)", "settling(position, 0.5 mm)", stroke_time, "samples(position, 100 Hz)". Default: final state,
        stroke time.
    initial
        Start, such as "position = 50 mm".
    chunk : N
        Size of a chunk.

    Examples
    --------
    pneudrive sweep drive.toml --command 1 --duration '0.5 s' --members 100 \
        --vary 'load.mass = uniform(1 kg, 4 kg)' --out many.parquet
    """
    is_file = out.suffix != ""
    if is_file:
        check_outputs(out, (".parquet", ".csv", ".nc"))
    described = changed(drive, set)
    study = many.study_of(
        described,
        command_of(described, command),
        duration,
        vary=_design(described, vary, members, seed),
        outputs=output,
        initial=initial,
        rtol=rtol,
    )
    if out.suffix == ".csv" and any(reduction.word == "samples" for reduction in study.outputs):
        raise CommandError("a CSV file cannot hold sampled outputs", remedy="Write .parquet or .nc.")
    fits_memory = study.rows.size <= many.IN_MEMORY
    if is_file and not fits_memory:
        raise CommandError.of("cli.too-many", members=study.rows.size)
    chunks = many.ChunkStore(out.with_name(out.name + PARTS) if is_file else out, study, chunk)
    missing = len(chunks.missing())
    if missing < len(chunks.chunks):
        typer.echo(f"{len(chunks.chunks) - missing} of {len(chunks.chunks)} chunks are already computed", err=True)
    members_run = many.run_study(study, watch(), store=chunks, in_memory=fits_memory)
    if is_file:
        members_run.save(out)
        chunks.remove()
    if fits_memory:
        show_view(members_run.view())
    show_paths(out)


def _design(
    drive: pn.Drive | pn.Circuit,
    vary: Sequence[str],
    members: int | None,
    seed: int,
) -> pn.EnsembleDesign:
    """Read the varied parameters, and return the design."""
    files = [text for text in vary if "=" not in text]
    if files and len(vary) > 1:
        raise CommandError("--vary mixes a file and values", rule="give one file, or NAME = VALUES for each number")
    if files:
        path = Path(files[0])
        if path.suffix == ".toml":
            if members is None:
                raise CommandError("--members is missing", remedy="Give the number of members to draw from the fit.")
            return pn.EnsembleDesign.posterior(fits.read_fit(path), members, seed=seed)
        if path.suffix not in (".csv", ".parquet"):
            raise CommandError.of("cli.no-table", path=path)
        # The columns are names of parameters, with or without unit.
        known = {number.file_name: name for name, number in variation.all_numbers(drive).items()}
        columns = trajectory.column_names(path)
        for column in columns:
            if column not in known and column not in known.values():
                kind, remedy = drive.file_kind, nearest(column, known)
                raise CommandError.of("cli.no-number", where=path, column=column, kind=kind, remedy=remedy)
        table = trajectory.read_columns(path, columns).items()
        return design.design_of({known.get(column, column): values for column, values in table}, members)
    return design.design_of(pairs_in("--vary", vary, "load.mass = uniform(1 kg, 2 kg)"), members, seed)


def lines(
    drive: str,
    *,
    length: str = "0.5 m, 1 m, 2 m, 5 m",
    diameter: str = "4 mm, 6 mm, 8 mm",
    out: Path | None = None,
    plot: Path | None = None,
) -> None:
    """Show speed and stroke time over length and bore of the tubes.

    Options
    -------
    drive : DRIVE
        Drive file (TOML), or catalogue:NAME.
    length : LENGTHS
        Lengths of the tubes.
    diameter : DIAMETERS
        Inner diameters of the tubes.
    out
        Table: .csv or .parquet.

    Examples
    --------
    pneudrive lines catalogue:reference --length '0.5 m, 2 m'
    """
    check_outputs(out, (".csv", ".parquet"), plot)
    described = cast("pn.Drive", load.load_described(drive))
    study = pn.lines(described, names_in(length), names_in(diameter), progress=watch().tell)
    show_view(pictures.view_of_tubes(study))
    write_outputs((out, partial(_save_tubes, study)), (plot, partial(pictures.plot_lines, study)))


def _save_tubes(study: xr.Dataset, path: Path) -> None:
    """Write a row for each length and bore, with units in the column names."""
    table = study.to_dataframe().reset_index()
    columns = {units.column_name(name, study[name].attrs["units"]): table[name].to_numpy() for name in map(str, table)}
    trajectory.save_columns(columns, dict(study.attrs), path)


def platform(
    circuit: str,
    *,
    name: str | None = None,
    run: Path | None = None,
    out: Path | None = None,
    dark: bool = False,
) -> None:
    """Show ranges, singular values and loads of a platform on legs, or draw it, at rest or during a run.

    Options
    -------
    circuit : CIRCUIT
        Circuit file (TOML) with a platform.
    name
        Platform, if the circuit has several.
    run
        Run of the circuit: .parquet, .csv or .nc.
    out
        Picture (.svg, .png, .pdf), page (.html) or film (.mp4, .gif) of the platform, or table (.parquet, .csv) of
        its singular value and leg forces.
    dark
        Draw on dark paper.

    Examples
    --------
    pneudrive platform tripod.toml
    pneudrive platform tripod.toml --run run.parquet --out motion.gif
    """
    check_outputs(out, (*PICTURES, *OF_RUNS))
    machine = pn.platform(cast("pn.Circuit", load.load_described(circuit)), name)
    columns = None if run is None else platform_page.read_platform_run(machine, run)
    if out is None:
        show_view(machine.view() if columns is None else platform_page.platform_run_view(machine, columns))
        return
    suffix = out.suffix.lower()
    if suffix in PICTURES:
        poses = None if columns is None else kinematics.motion_of(machine, columns)[0]
        platform_page.draw_platform(machine, poses, out, dark=dark)
    elif columns is None:
        raise CommandError(f"{out.name} needs a run", remedy="Add --run RUN.parquet, from pneudrive simulate --out.")
    elif suffix == ".html":
        platform_page.write_platform_page(machine, columns, out)
    elif suffix in (".parquet", ".csv"):
        of_run = columns | kinematics.platform_outputs(machine, columns)
        trajectory.save_columns(of_run, {"title": machine.name}, out)
    else:
        poses = kinematics.motion_of(machine, columns)[0]
        platform_page.animate_platform(machine, columns["time_s"], poses, out, dark=dark)
    show_paths(out)


def web(
    folder: Path = Path(),
    *,
    port: Port = 0,
    control: bool = False,
    browser: bool = True,
) -> None:
    """Open a folder in the browser, with live simulations.

    The server answers this machine only. From another machine, use ssh -L.

    Options
    -------
    folder
        Folder of drives, circuits and recordings.
    port
        Port of this machine; 0 takes a free one.
    control
        Let the page pause, stop, resume and abort campaigns too.
    browser
        Open the page in the browser.

    Examples
    --------
    pneudrive web my-studies
    ssh -L 8123:127.0.0.1:8123 HOST   # with --port 8123 on HOST
    """
    import webbrowser

    with tempfile.TemporaryDirectory(prefix="pneudrive-") as private:

        def opened(address: str) -> None:
            typer.echo(f"{address}\nAnyone who knows this address can open the page. Ctrl-C ends the server.")
            sys.stdout.flush()
            if browser:
                # Only the user may read this file. Arguments of the browser's process are visible to all accounts.
                redirect = Path(private) / "open.html"
                redirect.touch(0o600, exist_ok=False)
                text = f'<meta http-equiv="refresh" content="0;url={address}"><a href="{address}">open</a>\n'
                redirect.write_text(text, encoding="utf-8")
                threading.Thread(target=webbrowser.open, args=(redirect.as_uri(),), daemon=True).start()

        upper("serve")(folder, port, opened, control=control)
