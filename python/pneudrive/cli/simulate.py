"""``pneudrive simulate``: a drive, a command, a trajectory file or picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MOST_IMPACTS = 5  # shown; the file holds all of them


def simulate(
    drive: Annotated[str, typer.Argument(help="Drive file (TOML), or catalogue:NAME.", metavar="DRIVE")],
    command: Annotated[
        str,
        typer.Option(
            help='Valve command in -1 .. 1: 0.5, "0 s: 0.6, 1 s: -0.6", or a CSV file (time_s,command).',
            metavar="STEPS",
        ),
    ],
    duration: Annotated[str, typer.Option(help='How long, e.g. "2 s".')],
    initial: Annotated[
        str | None, typer.Option(help='Start state, e.g. "position = 50 mm, pressure_a = 3 bar abs".')
    ] = None,
    sample_rate: Annotated[str, typer.Option(help="Samples a second.")] = "1 kHz",
    rtol: Annotated[float, typer.Option(help="Relative tolerance of the solver.")] = 1e-6,
    budget: Annotated[
        int | None, typer.Option(help="Attempts at a step after which the run is given up.", metavar="ATTEMPTS")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Trajectory file: .parquet, .csv or .nc.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Picture of the trajectory: .png, .svg, .pdf or .html.")] = None,
) -> None:
    """Simulate a drive and write its trajectory."""
    from pneudrive.cli.progress import on_terminal
    from pneudrive.describe import Drive
    from pneudrive.simulate import run
    from pneudrive.trajectory import check_target, save, save_columns

    if out is not None:
        check_target(out)
    if plot is not None:
        from pneudrive.report.trajectory import PICTURES

        check_target(plot, PICTURES)
    described = Drive.load(drive)
    result = run(
        described,
        command,
        duration,
        initial=initial,
        sample_rate=sample_rate,
        rtol=rtol,
        budget=budget,
        watch=on_terminal(),
    )
    if out is not None:
        if out.suffix.lower() == ".nc":
            save(result.dataset(), out)
        else:
            save_columns(result.columns, result.provenance, out)
    if plot is not None:
        from pneudrive.report import plot as draw

        draw(result.dataset(), plot)
    _say(described.name, result.columns, result.provenance, [p for p in (out, plot) if p is not None])


def _say(name: str, columns: dict, provenance: dict, written: list[Path]) -> None:
    time, x, statistics = columns["time_s"], columns["position_m"], provenance["statistics"]
    typer.echo(f"{name}: {len(time)} samples to {time[-1]:g} s, {statistics['steps']} steps of the solver")
    typer.echo(
        f"position {x[0] * 1e3:.3f} mm -> {x[-1] * 1e3:.3f} mm, between {x.min() * 1e3:.3f} and {x.max() * 1e3:.3f} mm"
    )
    for impact in provenance["impacts"][:MOST_IMPACTS]:
        typer.echo(
            f"impact at {impact['time_s']:.4f} s on the end of chamber {impact['end']}: {impact['speed_m_s']:.3f} m/s, "
            f"{impact['energy_j']:.3g} J, {impact['depth_m'] * 1e3:.3f} mm deep, {impact['peak_force_n']:.0f} N"
        )
    if len(provenance["impacts"]) > MOST_IMPACTS:
        typer.echo(f"and {len(provenance['impacts']) - MOST_IMPACTS} impacts more")
    for path in written:
        typer.echo(str(path))
