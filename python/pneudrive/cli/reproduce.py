"""``pneudrive reproduce``: the source paper's figures from the simulated rig and drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for the report and its figures.")] = Path("reproduction"),
    seed: Annotated[int, typer.Option(help="Seed of the simulated sensors' noise.", min=0)] = 0,
) -> None:
    """Reproduce figures 1 to 9 of the source paper: campaigns on simulated rigs, a simulated drive, one report."""
    from pneudrive.cli.output import writable_folder
    from pneudrive.paper import FOLDER
    from pneudrive.report import reproduce as run
    from pneudrive.report import write_report

    folder = writable_folder(out)
    made = run(folder / FOLDER, seed)
    report = write_report(None, {}, folder, made)
    for figure in made.figures.values():
        verdict = "holds" if figure.holds else "DOES NOT HOLD"
        typer.echo(f"figure {figure.number}: {figure.sentence}")
        typer.echo(f"          {verdict}: {figure.measured}")
    typer.echo(str(report))
