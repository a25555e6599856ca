"""``pneudrive reproduce``: reproduce the source paper's figures on the simulated rig and drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def reproduce(
    out: Path = Path("reproduction"),
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Reproduce figures 1 to 9 of the source paper on simulated rigs.

    Options
    -------
    out
        Folder for the report and its figures.
    seed
        Seed of the noise of the simulated sensors.
    """
    from pneudrive.cli.output import writable_folder
    from pneudrive.report import write_report
    from pneudrive.studies.bracha import FOLDER
    from pneudrive.studies.bracha.pages import count_verdicts
    from pneudrive.studies.bracha.reproduction import reproduce as run

    folder = writable_folder(out)
    made = run(folder / FOLDER, seed)
    report = write_report(None, {}, folder, made)
    for claim in made.claims:
        typer.echo(f'{claim.place}: "{claim.said}"')
        typer.echo(f"    {claim.verdict}: {claim.found}")
    typer.echo(f"\nOf the paper, {count_verdicts(made.claims)}.")
    typer.echo(str(report))
