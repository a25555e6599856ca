"""``pneudrive simulate``: simulate a drive or a circuit into a trajectory file or picture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneudrive.cli.options import CatalogueFolders, Changes, Described, Rtol, Steps
from pneudrive.cli.output import check_outputs, tell, write_outputs
from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.simulation.simulate import Run

MOST_IMPACTS = 5  # printed impacts; the file has all of them


def simulate(
    drive: Described,
    duration: str = "",
    command: Steps = None,
    initial: str | None = None,
    set: Changes = None,  # noqa: A002 - the name of the option
    motion: Path | None = None,
    layout: Path | None = None,
    sample_rate: str = "1 kHz",
    rtol: Rtol = 1e-6,
    budget: int | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    energy: Annotated[bool, typer.Option("--energy")] = False,
    catalogue: CatalogueFolders = None,
) -> None:
    """Simulate a drive or a circuit, and write or plot the run.

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
        Attempted steps after which the run fails.
    out
        Trajectory file: .parquet, .csv or .nc.
    plot
        Picture of the trajectory: .png, .svg, .pdf or .html.
    energy
        Print energy, lost exergy and supplied air.
    """
    from pneudrive.cli.described import changed, command_of
    from pneudrive.cli.progress import on_terminal
    from pneudrive.simulation.simulate import run

    check_outputs(out, plot=plot, more=(".html",))
    if motion is not None:
        _along(drive, motion, layout, out)
        return
    if not duration:
        raise CommandError("the duration is missing", remedy='Add --duration "2 s", or --motion RECORDING.')
    described = changed(drive, set)
    result = run(
        described,
        command_of(described, command),
        duration,
        initial=initial,
        sample_rate=sample_rate,
        rtol=rtol,
        budget=budget,
        watch=on_terminal(),
        arrays=plot is not None or (out is not None and out.suffix.lower() != ".parquet"),
    )
    _say(described.name, result.columns, result.provenance)
    write_outputs((out, partial(_save, result)), (plot, partial(_plot, result, described)))
    if energy:
        from pneudrive.datasheet.characteristics.air import energy_balance

        given = command_of(described, command)
        typer.echo(str(energy_balance(described, given, duration, initial=initial, rtol=rtol)))


def _along(circuit: str, motion: Path, layout: Path | None, out: Path | None) -> None:
    """Simulate a circuit along a recorded motion."""
    from pneudrive.identify.follow.fit import simulate_motion
    from pneudrive.simulation.trajectory import save_columns

    columns, provenance = simulate_motion(circuit, motion, layout=layout)
    if out is not None:
        save_columns(columns, provenance, out)
    typer.echo(f"{provenance['title']}: {len(columns['time_s'])} samples to {columns['time_s'][-1]:g} s along {motion}")
    tell([out])


def _save(result: Run, path: Path) -> None:
    from pneudrive.simulation.trajectory import save, save_columns

    if path.suffix.lower() == ".nc":
        save(result.dataset(), path)
    else:
        save_columns(result.columns, result.provenance, path)


def _plot(result: Run, described: Drive | Circuit, path: Path) -> None:
    from pneudrive.report import plot

    plot(result.dataset(), path, described)


def _say(name: str, columns: dict, provenance: dict) -> None:
    time, statistics = columns["time_s"], provenance["statistics"]
    typer.echo(f"{name}: {len(time)} samples to {time[-1]:g} s, {statistics['steps']} steps of the solver")
    for column, x in columns.items():
        of, _, last = column.rpartition(".")
        if last == "position_m":
            typer.echo(
                f"{of and f'{of}: '}position {x[0] * 1e3:.3f} mm -> {x[-1] * 1e3:.3f} mm, "
                f"between {x.min() * 1e3:.3f} and {x.max() * 1e3:.3f} mm"
            )
    for impact in provenance["impacts"][:MOST_IMPACTS]:
        of = f"{impact['cylinder']}: " if impact.get("cylinder") else ""
        typer.echo(
            f"{of}impact at {impact['time_s']:.4f} s on the end of chamber {impact['end']}: "
            f"{impact['speed_m_s']:.3f} m/s, {impact['energy_j']:.3g} J, {impact['depth_m'] * 1e3:.3f} mm deep, "
            f"{impact['peak_force_n']:.0f} N"
        )
    if len(provenance["impacts"]) > MOST_IMPACTS:
        typer.echo(f"and {len(provenance['impacts']) - MOST_IMPACTS} more impacts")
