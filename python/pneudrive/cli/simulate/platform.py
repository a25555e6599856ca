"""``pneudrive platform``: ranges, loads and limits of a platform on legs, and pictures of its runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from pneudrive.cli.options import CatalogueFolders
from pneudrive.cli.output import check_outputs
from pneudrive.errors import CommandError
from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from pneudrive.describe import Circuit
    from pneudrive.platforms import Platform

#: Endings of pictures, and of files that show or hold a run.
PICTURES, OF_RUNS = (".svg", ".png", ".pdf"), (".html", ".mp4", ".gif", ".parquet", ".csv")


def platform(
    circuit: str,
    name: str | None = None,
    run: Path | None = None,
    out: Path | None = None,
    dark: Annotated[bool, typer.Option("--dark")] = False,
    catalogue: CatalogueFolders = None,
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
    """
    from pneudrive.describe.files.load import load_described
    from pneudrive.platforms import platform as platform_of

    check_outputs(out, (*PICTURES, *OF_RUNS))
    own = platform_of(cast("Circuit", load_described(circuit)), name)
    if out is None:
        _show(own) if run is None else _show_run(own, run)
        return
    _write(own, run, out, dark=dark)
    typer.echo(str(out))


def _write(own: Platform, run: Path | None, out: Path, *, dark: bool) -> None:
    """Write the file with the name `out`."""
    from pneudrive.platforms.outputs import motion_of, platform_outputs
    from pneudrive.report.platform.figures import animate_platform, draw_platform
    from pneudrive.report.platform.page import read_platform_run, write_platform_page
    from pneudrive.simulation.trajectory import save_columns

    suffix = out.suffix.lower()
    if run is None and suffix in OF_RUNS:
        raise CommandError(f"{out.name} shows a run", remedy="Add --run RUN.parquet, from pneudrive simulate --out.")
    if run is None:
        draw_platform(own, path=out, dark=dark)
        return
    columns = read_platform_run(own, run)
    poses = motion_of(own, columns)[0]
    if suffix in PICTURES:
        draw_platform(own, poses, out, dark=dark)
    elif suffix == ".html":
        write_platform_page(own, columns, out)
    elif suffix in (".parquet", ".csv"):
        save_columns(columns | platform_outputs(own, columns), {"title": own.name}, out)
    else:
        animate_platform(own, columns["time_s"], poses, out, dark=dark)


def _show_run(own: Platform, run: Path) -> None:
    from pneudrive.platforms.outputs import platform_outputs
    from pneudrive.report.platform.page import RANGE_HEAD, read_platform_run, run_ranges

    columns = read_platform_run(own, run)
    typer.echo(f"{own.name}, {len(columns['time_s'])} samples to {columns['time_s'][-1]:g} s")
    ranges = run_ranges(own, columns | platform_outputs(own, columns))
    typer.echo(aligned([RANGE_HEAD, *ranges], right_from=2))


def _show(own: Platform) -> None:
    typer.echo(f"{own.name}: {own.text(own.home)}, with every leg at half of its stroke")
    forces = own.load(own.home)
    rows = [("leg", "position mm", "stroke mm", "load N")]
    for leg, x, force in zip(own.legs, own.inverse(own.home), forces, strict=True):
        rows.append((leg.name, f"{1e3 * x:.4g}", f"{1e3 * leg.stroke_m:.4g}", f"{force:.4g}"))
    typer.echo(aligned(rows, right_from=1))
    values = ", ".join(f"{value:.4g}" for value in own.singular_values(own.home))
    typer.echo(f"singular values, without unit: {values}\n")
    space = own.workspace()
    table = [("coordinate", "from", "limited by", "to", "limited by", "singular value", "largest load N")]
    for k, (key, limits) in enumerate(space.limits.items()):
        poses = [own.home.copy(), own.home.copy()]
        ends = []
        for pose, limit in zip(poses, limits, strict=True):
            pose[k] = limit.value
            ends += [own.text(pose).split(", ")[k].partition(" = ")[2], limit.reason]
        least = min(float(own.singular_values(pose)[-1]) for pose in poses)
        most = max(float(abs(own.load(pose)).max()) for pose in poses)
        table.append((key, *ends, f"{least:.3g}", f"{most:.4g}"))
    typer.echo(aligned(table, right_from=5))
    typer.echo("One coordinate moves at a time, the others stay at half strokes. Loads hold the platform at rest.")
