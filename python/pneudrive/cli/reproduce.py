"""``pneudrive reproduce``: the source paper's figures from the simulated rig and drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def reproduce(
    out: Annotated[Path, typer.Option(help="Folder for the report and its figures.")] = Path("reproduction"),
    seed: Annotated[int, typer.Option(help="Seed of the simulated sensors' noise.", min=0)] = 0,
) -> None:
    """Reproduce figures 1-3, 5, 6 and 8 of the source paper from a simulated rig and drive, with a report."""
    from pneudrive.cli.output import writable_folder
    from pneudrive.paper import NOT_REPRODUCED
    from pneudrive.report import reproduce as run
    from pneudrive.report import write_report

    folder = writable_folder(out)
    made = run(seed=seed)
    report = write_report(None, {}, folder, made)
    for figure in made.figures.values():
        verdict = "holds" if figure.holds else "DOES NOT HOLD"
        typer.echo(f"figure {figure.number}: {figure.sentence}")
        typer.echo(f"          {verdict}: {figure.measured}")
    for numbers, why in NOT_REPRODUCED.items():
        typer.echo(f"figure {numbers}: not reproduced: {why}")
    typer.echo(str(report))
